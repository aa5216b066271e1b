//! Latencies of messages that the configuration does not know, from the bytes of a virtual vehicle.

use estimator::LatencyEstimate;
use sample::{Arrival, Payload};
use sim::Output;
use store::Record;

use super::drives::of_prowler;
use super::*;
use crate::config::Meaning;
use crate::virtual_drive::Drive;
use crate::{Config, Engine};

/// Duration of the drive, s.
const DURATION_S: f64 = 24.0;
/// Largest error of a latency, in its standard deviations.
const ERROR_MAX_SIGMA: f64 = 4.0;
/// What is configured in the place of 0.5 to 3.5 ms: mean and standard deviation, s.
const PRIOR_S: [f64; 2] = [0.0025, 0.0015];

fn engine_after(config: &Config, arrivals: &[Arrival]) -> (Vec<LatencyEstimate>, Vec<Record>) {
    let mut engine = Engine::new(config).expect("an engine");
    let mut records = Vec::new();
    for arrival in arrivals {
        engine.push(arrival, &mut records);
    }
    (engine.latencies(), records)
}

/// The messages of the bus wait for each other for up to 2.6 ms; each gets its own latency. A repetition gives the
/// same bits.
#[test]
fn a_drive_tells_the_latency_of_each_message_of_the_bus() {
    let drive = Drive {
        duration_s: Some(DURATION_S),
        ..of_prowler("mixed-driving", "full-bridge-16bit")
    };
    let mut simulated = VirtualDrive::new(&drive).expect("a drive");
    let mut config = simulated.config().expect("a configuration");
    let start = simulated.start();
    let mut truth = Vec::new();
    for source in &mut config.sources {
        let Meaning::Can(can) = &mut source.meaning else {
            continue;
        };
        for (names, latencies_s) in can.names.iter().zip(&mut can.latencies_s) {
            let known = names.iter().zip(latencies_s.iter_mut());
            truth.extend(known.map(|(name, s)| (format!("can0.{name}"), s.take())));
        }
        source.transport_delay_s = PRIOR_S[0];
        source.latency_sigma_s = PRIOR_S[1];
    }
    let mut arrivals = Vec::new();
    for emission in simulated.vehicle.by_ref() {
        let mut sources = config.sources.iter();
        let Some(source) = sources.find(|source| source.spec.name == emission.port.name()) else {
            continue;
        };
        let log_time = start.offset_seconds(emission.time_s);
        arrivals.push(Arrival {
            sequence: arrivals.len() as u64,
            source: source.spec.id,
            log_time,
            realtime_ns: log_time.0.cast_signed(),
            payload: match emission.output {
                Output::Bytes(bytes) => Payload::Bytes(bytes),
                Output::Can(frame) => Payload::Can(vec![frame]),
            },
        });
    }
    arrivals.sort_by_key(|arrival| arrival.log_time);
    let (latencies, records) = engine_after(&config, &arrivals);
    let of_corners = latencies.iter().filter(|one| {
        ["Strain_", "Corner_"]
            .iter()
            .any(|name| one.prior.name.contains(name))
    });
    let mut of_eight = 0;
    for one in of_corners {
        let true_s = truth.iter().find(|(name, _)| *name == one.prior.name);
        let true_s = true_s.and_then(|(_, s)| *s).expect("a latency");
        let error_s = (one.latency_s - true_s).abs();
        assert!(
            error_s < ERROR_MAX_SIGMA * one.sigma_s && one.sigma_s < PRIOR_S[1],
            "{one:?}, in truth {true_s} s"
        );
        of_eight += 1;
    }
    assert_eq!(of_eight, 8, "{latencies:?}");
    let reported = records.iter().filter(|record| {
        matches!(record, Record::Log(message) if message.text.starts_with("latency of can0."))
    });
    assert_eq!(
        reported.count(),
        latencies.iter().filter(|one| one.is_found).count()
    );
    let (again, _) = engine_after(&config, &arrivals);
    assert_eq!(latencies, again);
}
