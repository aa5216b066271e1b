use std::collections::BTreeMap;

use estimator::Calibration;
use estimator::calibration::{Recording, Step};
use model::sensors::{HubAxis, Sensors};
use model::vehicle::Vehicle;
use sample::{DeviceTime, EventKind, LogTime, Measurement, PerWheel, TyreForce, Wheel};
use sim::{HubAxisFault, HubAxisFaultKind, HubFault, InertialUnit, Options, VelocityReceiver};
use store::Record;

use super::drives::of_prowler;
use super::*;
use crate::FileSource;
use crate::virtual_drive::Drive;

/// A drive with hub accelerometers: what was recorded, the records, and the true calibration.
fn drive(manoeuvre: &str, seed: u64, options: Options) -> (Recording, Vec<Record>, Calibration) {
    let mut simulated = VirtualDrive::new(&Drive {
        seed,
        options,
        duration_s: Some(40.0),
        ..of_prowler(manoeuvre, "full-bridge-16bit-hub")
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
            let error = finding.value - values.expect("values")[axis.expect("an axis")];
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

/// Time after which a dead or frozen axis must be named, s: 30 repeats at 100 Hz, and one step.
const NAMED_WITHIN_S: f64 = 0.35;

/// Dead and frozen axes are named while they are, the same names are in the metadata of the log, and no
/// axis is named without a fault.
#[test]
fn dead_and_frozen_axes_of_hub_accelerometers_are_named() {
    let fault = |wheel, axis, kind, from_s, to_s| HubAxisFault {
        wheel,
        axis,
        kind,
        from_s,
        to_s,
    };
    let mut options = Options::default();
    options.faults.hub_axis = vec![
        fault(
            Wheel::FrontLeft,
            HubAxis::X,
            HubAxisFaultKind::Dead,
            8.0,
            16.0,
        ),
        fault(
            Wheel::RearRight,
            HubAxis::Z,
            HubAxisFaultKind::Frozen,
            12.0,
            20.0,
        ),
    ];
    let expected = options.faults.sensors();
    let (_, records, _) = drive("slow-sine", 11, options);
    let start = records.iter().find_map(|record| match record {
        Record::Truth(truth) => Some(truth.time),
        _ => None,
    });
    let start = start.expect("the truth");
    let mut told: Vec<(String, bool, f64)> = Vec::new();
    let mut left_out = 0;
    for record in &records {
        match record {
            Record::Event(event) => {
                let at_s = event.time.seconds_since(start);
                match &event.kind {
                    EventKind::SensorFault(name) => told.push((name.clone(), true, at_s)),
                    EventKind::SensorRecovered(name) => told.push((name.clone(), false, at_s)),
                    _ => {}
                }
            }
            Record::Health(health) => {
                let sensors = health.faulty_sensors.iter();
                left_out += sensors
                    .filter(|name| name.contains("hub acceleration"))
                    .count();
            }
            _ => {}
        }
    }
    let told_of = |name: &str, faulty: bool| {
        let mut all = told.iter().filter(|t| t.0 == name && t.1 == faulty);
        let at_s = all.next().map_or(f64::NAN, |t| t.2);
        assert!(all.next().is_none(), "{told:?}");
        at_s
    };
    for (name, span) in &expected {
        let late_s = [
            told_of(name, true) - span.start,
            told_of(name, false) - span.end,
        ];
        assert!((0.0..NAMED_WITHIN_S).contains(&late_s[0]), "{told:?}");
        assert!((0.0..0.05).contains(&late_s[1]), "{told:?}");
    }
    assert_eq!(told.len(), 4, "{told:?}");
    // Health is reported once a second.
    assert!((14..=18).contains(&left_out), "{left_out}");
}

/// Largest differences (root mean square) of the motion by potentiometers along the tie rods from that by
/// the encoder: sideslip, yaw rate, steer angle of the front wheels, rad and rad/s.
const BY_RODS_MAX: [f64; 3] = [5e-6, 1e-4, 1e-3];

#[test]
fn potentiometers_along_the_tie_rods_give_the_motion_of_the_encoder() {
    let encoder = Sensors::builtin_text("thesis-10bit").expect("built-in sensors");
    let begin = encoder.find("[steer]").expect("an encoder");
    let end = begin + encoder[begin..].find("\n\n").expect("the table's end");
    let rods = "[steer_potentiometers]\nrate_hz = 100.0\nspan_m = 0.1\nadc_bits = 12\n\
                noise_counts = 1.0\nzero_error_counts = 80.0\n";
    let by_rods = format!("{}{rods}{}", &encoder[..begin], &encoder[end..]);
    let motions = [encoder, &by_rods].map(|sensors| {
        let mut simulated = VirtualDrive::new(&Drive {
            sensors: FileSource::Text(sensors.to_owned()),
            ..of_prowler("slow-sine", "thesis-10bit")
        })
        .expect("a drive");
        let mut config = simulated.config().expect("a configuration");
        let settings = config.estimator.as_mut().expect("an estimator");
        settings.calibration = simulated.true_calibration.clone();
        let start = simulated.start();
        let mut motion = BTreeMap::new();
        let mut steered = 0;
        simulate(&mut simulated, &config, |entry| {
            match entry {
                Entry::Record(Record::Estimate(estimate))
                    if estimate.time > start.offset_seconds(2.0) =>
                {
                    let m = estimate.motion;
                    let steer_rad = m.steer_rad[Wheel::FrontLeft];
                    motion.insert(estimate.time, [m.sideslip_rad, m.rate_rad_s[2], steer_rad]);
                }
                Entry::Record(Record::Sample(sample)) => {
                    steered += u32::from(matches!(sample.measurement, Measurement::Steer(_)));
                }
                _ => {}
            }
            Ok::<_, Error>(())
        })
        .expect("a simulation");
        assert!((2590..=2602).contains(&steered), "{steered}");
        motion
    });
    let rms: [f64; 3] = std::array::from_fn(|i| {
        let pairs = motions[0]
            .iter()
            .filter_map(|(time, a)| Some(a[i] - motions[1].get(time)?[i]));
        let squares: Vec<f64> = pairs.map(|difference| difference * difference).collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    });
    let fits = rms
        .iter()
        .zip(BY_RODS_MAX)
        .all(|(found, most)| *found < most);
    assert!(fits, "{rms:?}");
}

#[test]
fn the_truth_has_the_class_of_the_road() {
    let road_class = |road: Option<&str>| {
        let simulated = VirtualDrive::new(&Drive {
            road: road.map(str::to_owned),
            ..of_prowler("fast-sine", "thesis-10bit")
        })
        .expect("a drive");
        match simulated.truth(1.0) {
            Record::Truth(truth) => truth.ground.expect("the ground").road_class,
            _ => None,
        }
    };
    assert_eq!(road_class(Some("iso8608:D")).as_deref(), Some("D"));
    assert_eq!(road_class(None), None);
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

/// Hub accelerations reach the log with counts and the nominal scale, and the estimates use them.
#[test]
fn hub_accelerations_are_recorded_and_used() {
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
        duration_s: Some(40.0),
        ..of_prowler("slow-sine", "full-bridge-16bit")
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
    let (with, without) = (estimates(&records), estimates(&without));
    assert_eq!(with.len(), without.len());
    assert_ne!(with, without);
}

/// The Prowler with a driver of 80 kg, 0.3 m left of the middle.
fn with_driver() -> String {
    let text = Vehicle::builtin_text("prowler").expect("a built-in vehicle");
    format!(
        "{text}\n[[payload]]\nname = \"driver\"\nmass_kg = 80.0\nposition_m = [-0.8, 0.3, 0.7]\n\
         \n[[payload]]\nname = \"ballast\"\nmass_kg = 80.0\nposition_m = [-0.8, 0.0, 0.7]\n"
    )
}

type Forces = BTreeMap<LogTime, PerWheel<TyreForce>>;

/// Errors of the lateral forces of a drive with the driver, 100 RMS / max(peak, static load), worst
/// wheel, after `from_s`. The estimator knows of `known` at the start and gets `marks`.
fn lateral_error(known: &[&str], marks: &[(f64, &str)], from_s: f64) -> (f64, Vec<String>) {
    let mut simulated = VirtualDrive::new(&Drive {
        vehicle: FileSource::Text(with_driver()),
        payload: vec!["driver".to_owned()],
        ..of_prowler("slow-sine", "thesis-10bit")
    })
    .expect("a drive");
    let text = simulated.configuration(&crate::Ports {
        directory: std::path::Path::new("virtual"),
        can: None,
    });
    assert!(text.contains("payload = [\"driver\"]"), "{text}");
    let mut config = simulated.config().expect("a configuration");
    let settings = config.estimator.as_mut().expect("an estimator");
    settings.settings.payload = known.iter().map(|name| (*name).to_owned()).collect();
    settings.calibration = simulated.true_calibration.clone();
    let start = simulated.start();
    let mut feed = Feed::new(&config).expect("an engine");
    let (mut truth, mut found, mut notes) = (Forces::new(), Forces::new(), Vec::new());
    let mut waiting = marks.to_vec();
    let mut take = |entry: Entry| {
        match entry {
            Entry::Record(Record::Truth(instant)) => {
                let contact = instant.contact.expect("the truth in the contact frame");
                truth.insert(instant.time, contact);
            }
            Entry::Record(Record::Estimate(estimate)) => {
                found.insert(estimate.time, estimate.measured);
            }
            Entry::Record(Record::Log(message)) if message.name == "estimator" => {
                notes.push(message.text);
            }
            _ => {}
        }
        Ok::<_, Error>(())
    };
    simulate(&mut simulated, &config, |entry| {
        if let Entry::Arrival(arrival) = &entry {
            let now_s = arrival.log_time.seconds_since(start);
            while let Some((at_s, text)) = waiting.first().copied().filter(|m| m.0 <= now_s) {
                waiting.remove(0);
                let mark = Payload::Notice(Notice::Mark(text.to_owned()));
                feed.push(SourceId::HOST, start.offset_seconds(at_s), mark, &mut take)?;
            }
            let arrival = arrival.clone();
            feed.push(arrival.source, arrival.log_time, arrival.payload, &mut take)?;
            return Ok(());
        }
        match entry {
            Entry::Record(Record::Truth(_)) => take(entry),
            _ => Ok(()),
        }
    })
    .expect("a simulation");
    truth.retain(|time, _| time.seconds_since(start) > from_s);
    (worst_percent(&truth, &found), notes)
}

/// Error of the lateral force of the worst wheel, 100 RMS / max(peak, static load).
fn worst_percent(truth: &Forces, found: &Forces) -> f64 {
    let worst = Wheel::ALL.map(|wheel| {
        let (mut square, mut peak, mut count) = (0.0, 1500.0_f64, 0.0);
        for (time, forces) in truth {
            let Some(estimate) = found.get(time) else {
                continue;
            };
            square += (estimate[wheel].force_n[1] - forces[wheel].force_n[1]).powi(2);
            peak = peak.max(forces[wheel].force_n[1].abs());
            count += 1.0;
        }
        100.0 * (square / f64::max(count, 1.0)).sqrt() / peak
    });
    worst.into_iter().fold(0.0, f64::max)
}

#[test]
fn a_driver_who_sits_aside_is_known_or_found_or_costs_lateral_force() {
    // The estimator finds who is not configured within some seconds, but not that a load is elsewhere.
    let (without, _) = lateral_error(&[], &[], 10.0);
    let (aside, _) = lateral_error(&["ballast"], &[], 2.0);
    let (with, _) = lateral_error(&["driver"], &[], 2.0);
    let (marked, notes) = lateral_error(&[], &[(1.0, "payload driver on")], 4.0);
    assert!(notes.is_empty(), "{notes:?}");
    let (after, _) = lateral_error(&["driver"], &[], 4.0);
    let told = format!("{without} {aside} {with} {marked} {after}");
    assert!(without < 1.5 && (2.0..6.0).contains(&aside), "{told}");
    assert!(with < 1.2 && (marked - after).abs() < 0.4, "{told}");
    let (_, notes) = lateral_error(&[], &[(1.0, "payload pilot on")], 2.0);
    assert!(notes[0].contains("use one of driver, ballast"), "{notes:?}");
}

/// The receiver and the inertial unit of other makers: their messages become samples whose times are
/// those of the device.
#[test]
fn devices_of_other_makers_are_recorded_with_their_own_times() {
    for (unit, has_device_time) in [
        (InertialUnit::Vectornav, true),
        (InertialUnit::VectornavAscii, false),
    ] {
        let options = Options {
            velocity_receiver: VelocityReceiver::Ublox,
            inertial_unit: unit,
            imu_baud: 230_400,
            ..Options::default()
        };
        let (_, records, _) = drive("slow-sine", 3, options);
        let (mut velocities, mut inertial, mut late_s) = (0, 0, 0.0_f64);
        for record in &records {
            let Record::Sample(sample) = record else {
                continue;
            };
            match sample.measurement {
                Measurement::GnssVelocity(_) => {
                    if let Some(DeviceTime::Gps { week: Some(_), .. }) = sample.device_time {
                        velocities += 1;
                    }
                }
                Measurement::Imu(_) => {
                    assert_eq!(sample.device_time.is_some(), has_device_time, "{unit:?}");
                    inertial += 1;
                    late_s = late_s.max(sample.log_time.seconds_since(sample.valid_time));
                }
                _ => {}
            }
        }
        assert!(velocities > 200, "{unit:?}: {velocities} velocities");
        assert!(inertial > 2_000, "{unit:?}: {inertial} samples");
        assert!((0.0..0.05).contains(&late_s), "{unit:?}: {late_s} s");
    }
}
