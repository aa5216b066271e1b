use estimator::Calibration;
use estimator::calibration::{Recording, Step};
use sample::{EventKind, Measurement, Wheel};
use sim::{HubFault, Options};
use store::Record;

use super::*;
use crate::FileSource;
use crate::virtual_drive::{Course, Drive};

/// A drive with hub accelerometers: what was recorded, the records, and the true calibration.
fn drive(manoeuvre: &str, seed: u64, options: Options) -> (Recording, Vec<Record>, Calibration) {
    let mut simulated = VirtualDrive::new(&Drive {
        course: Course::Manoeuvre(manoeuvre.to_owned()),
        vehicle: FileSource::Path("prowler".into()),
        sensors: FileSource::Path("full-bridge-16bit-hub".into()),
        seed,
        options,
        duration_s: Some(40.0),
    })
    .expect("a drive");
    let config = simulated.config().expect("a configuration");
    let settings = config.estimator.clone().expect("an estimator");
    let start = simulated.start();
    let mut recording = Recording::new(
        manoeuvre.to_owned(),
        settings.vehicle.clone(),
        settings.sensors.clone(),
        start,
    );
    let mut records = Vec::new();
    simulate(&mut simulated, &config, |entry| {
        if let Entry::Record(record) = entry {
            if let Record::Sample(sample) = &record {
                let source = &config.sources[usize::from(sample.source.0)].spec.name;
                recording.push(source, sample);
            }
            records.push(record);
        }
        Ok::<_, Error>(())
    })
    .expect("a simulation");
    (recording, records, simulated.true_calibration)
}

/// Biases and turns that a drive from rest with braking and turns gives hold the truth.
#[test]
fn hub_accelerometers_are_calibrated_by_rest_and_driving() {
    let (mut squares, mut count, mut largest) = (0.0, 0.0, [0.0_f64; 2]);
    for seed in [11, 12, 13] {
        let drives = ["turned", "launch-brake", "mixed-driving"];
        let mut logs = Vec::new();
        let mut known = Calibration::default();
        for name in drives {
            let (recording, _, truth) = drive(name, seed, Options::default());
            logs.push(recording);
            known = truth;
        }
        let truth = known.clone();
        for corner in known.corner.values_mut() {
            corner.hub_acceleration = Default::default();
        }
        let found = Step::Hub.calibrate(&logs, &known).expect("a calibration");
        assert_eq!(found.findings[0].findings.len(), 4 * 6);
        for finding in &found.findings[0].findings {
            let wheel = Wheel::from_abbreviation(&finding.name[..2]).expect("a wheel");
            let hub = truth.corner[&wheel].hub_acceleration;
            let values = [hub.misalignment_rad, hub.bias_m_s2][usize::from(finding.unit != "rad")];
            let axis = ["x", "y", "z"]
                .iter()
                .position(|axis| finding.name.ends_with(axis));
            let error = finding.value - values.expect("is told")[axis.expect("an axis")];
            let kind = usize::from(finding.unit != "rad");
            largest[kind] = largest[kind].max(error.abs());
            squares += (error / finding.sigma).powi(2);
            count += 1.0;
        }
    }
    let consistency = squares / count;
    assert!(
        (0.05..2.0).contains(&consistency),
        "{consistency} {largest:?}"
    );
    // Of 17 mrad and 0.3 m/s^2.
    assert!(
        largest[0] < 0.003 && largest[1] < 0.03,
        "{largest:?} {consistency}"
    );
}

/// The estimator and the calibration name a sensor that is mounted turned, with axis and value.
#[test]
fn a_turned_hub_accelerometer_is_named() {
    let mut options = Options::default();
    options.faults.hub = vec![HubFault {
        wheel: Wheel::RearRight,
        turned_rad: [-std::f64::consts::FRAC_PI_2, 0.0, 0.0],
    }];
    let (recording, records, known) = drive("turned", 11, options);
    let mut faults = records.iter().filter_map(|record| match record {
        Record::Event(event) => match &event.kind {
            EventKind::SensorFault(name) if name.contains("hub") => Some(event.text.clone()),
            _ => None,
        },
        _ => None,
    });
    let text = faults.next().expect("an event");
    assert!(
        text.starts_with("channel RR hub acceleration has wrong axes"),
        "{text}"
    );
    assert!(
        text.contains("m/s^2 on y instead of +9.8 m/s^2 on z"),
        "{text}"
    );
    assert_eq!(faults.next(), None);
    let error = Step::Hub
        .calibrate(&[recording], &known)
        .expect_err("is turned");
    assert!(
        error.to_string().contains("hub RR: mean of y at rest"),
        "{error}"
    );
}

/// Hub accelerations reach the log with counts and the nominal scale, and change no estimate.
#[test]
fn hub_accelerations_are_recorded_and_change_no_estimate() {
    let (recording, records, _) = drive("slow-sine", 11, Options::default());
    let scale = recording
        .sensors
        .hub_acceleration
        .as_ref()
        .expect("has hubs");
    let hubs = records.iter().filter_map(|record| match record {
        Record::Sample(sample) => match &sample.measurement {
            Measurement::HubAcceleration(hub) => Some(hub),
            _ => None,
        },
        _ => None,
    });
    let mut count = 0;
    for hub in hubs {
        for (force, counts) in hub.specific_force_m_s2.into_iter().zip(hub.counts) {
            assert_eq!(scale.specific_force_m_s2(counts.expect("counts")), force);
        }
        count += 1;
    }
    assert!(count > 4000, "{count}");
    let estimates = |records: &[Record]| -> Vec<String> {
        let estimates = records.iter().filter(|r| matches!(r, Record::Estimate(_)));
        estimates.map(|record| format!("{record:?}")).collect()
    };
    let mut simulated = VirtualDrive::new(&Drive {
        course: Course::Manoeuvre("slow-sine".to_owned()),
        vehicle: FileSource::Path("prowler".into()),
        sensors: FileSource::Path("full-bridge-16bit".into()),
        seed: 11,
        options: Options::default(),
        duration_s: Some(40.0),
    })
    .expect("a drive");
    let config = simulated.config().expect("a configuration");
    let mut without = Vec::new();
    simulate(&mut simulated, &config, |entry| {
        if let Entry::Record(record) = entry {
            without.push(record);
        }
        Ok::<_, Error>(())
    })
    .expect("a simulation");
    assert_eq!(estimates(&records), estimates(&without));
}
