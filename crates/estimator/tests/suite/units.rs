//! Wrong units of rates, angles and speeds: each is named and corrected during the drive.

use std::f64::consts::PI;

use atvrec_estimator::{Calibration, Estimator, MistakeReport, Output, Quantity, Settings};
use model::sensors::Sensors;
use sample::{Estimate, EventKind, Measurement, Sample, Wheel};
use testkit::truth::Run;
use testkit::{scoring, sensing, truth};

/// A wrong unit: the signal, and reading over value.
type Case = (Quantity, f64);

const DEGREE: f64 = 180.0 / PI;
const CASES: [Case; 8] = [
    (Quantity::Rates, DEGREE),
    (Quantity::Rates, 1.0 / DEGREE),
    (Quantity::Attitude, DEGREE),
    (Quantity::Velocity, 3.6),
    (Quantity::Velocity, 1.0 / 3.6),
    (Quantity::WheelSpeeds, 3.6),
    (Quantity::WheelSpeeds, 1.0 / 3.6),
    (Quantity::WheelSpeeds, 30.0 / PI),
];

fn spoil(samples: &mut [Sample], (quantity, factor): Case) {
    for sample in samples {
        match (&mut sample.measurement, quantity) {
            (Measurement::Imu(imu), Quantity::Rates) => {
                imu.angular_rate_rad_s = imu.angular_rate_rad_s.map(|rate| factor * rate);
            }
            (Measurement::GnssAttitude(gnss), Quantity::Attitude) => {
                for angle in [&mut gnss.yaw_rad, &mut gnss.pitch_rad, &mut gnss.roll_rad] {
                    *angle = angle.map(|angle| factor * angle);
                }
            }
            (Measurement::GnssVelocity(gnss), Quantity::Velocity) => {
                gnss.velocity_enu_m_s = gnss.velocity_enu_m_s.map(|speed| factor * speed);
            }
            (Measurement::WheelSpeed(speeds), Quantity::WheelSpeeds) => {
                for speed in &mut speeds.angular_speed_rad_s.0 {
                    *speed = speed.map(|speed| factor * speed);
                }
            }
            _ => {}
        }
    }
}

struct Watched {
    report: MistakeReport,
    lagged: Vec<Estimate>,
    /// Sensors that were reported as faulty, with the time, s.
    blamed: Vec<(f64, String)>,
}

fn watch(run: &Run, sensors: &str, seed: u64, case: Case) -> Watched {
    let vehicle = truth::vehicle();
    let sensors = Sensors::builtin(sensors).unwrap();
    let mut samples = sensing::samples(run, vehicle, &sensors, seed);
    spoil(&mut samples, case);
    let calibration = Calibration::nominal(&vehicle.name);
    let mut estimator =
        Estimator::new(vehicle, &sensors, &calibration, Settings::default()).unwrap();
    let (mut lagged, mut blamed) = (Vec::new(), Vec::new());
    for sample in &samples {
        estimator.advance(sample.log_time, &mut |output| match output {
            Output::Lagged(estimate) => lagged.push(estimate),
            Output::Event(event) => {
                if let EventKind::SensorFault(name) = event.kind {
                    blamed.push((event.time.seconds_since(sensing::START), name));
                }
            }
            _ => {}
        });
        estimator.push(sample);
    }
    Watched {
        report: estimator.mistake_report().unwrap(),
        lagged,
        blamed,
    }
}

impl Watched {
    /// When a unit was found, s.
    fn found_s(&self) -> Option<f64> {
        let (time, _) = self.report.units.first()?;
        Some(time.seconds_since(sensing::START))
    }

    /// Root mean square of the difference of the forces to those of another drive, from 5 s after the correction to
    /// the end, N.
    fn difference_n(&self, other: &Self) -> f64 {
        let from_s = self.found_s().unwrap_or(0.0) + 5.0;
        let differences = self
            .lagged
            .iter()
            .zip(&other.lagged)
            .flat_map(|(own, other)| {
                let is_late = own.time.seconds_since(sensing::START) > from_s;
                Wheel::ALL.into_iter().flat_map(move |wheel| {
                    let [own, other] = [own, other].map(|e| e.measured[wheel].force_n);
                    (0..3).filter_map(move |axis| is_late.then_some(own[axis] - other[axis]))
                })
            });
        scoring::rms(differences)
    }
}

/// Time after which a unit is found, s.
const FOUND_MAX_S: f64 = 10.0;
/// Difference of the forces to those of a drive with the right unit, 5 s after the correction, N. A start of the
/// filters leaves 0.7 N.
const DIFFERENCE_MAX_N: f64 = 2.0;

#[test]
fn wrong_units_of_rates_angles_and_speeds_are_named_and_corrected() {
    let run = truth::excerpt("c_sine03");
    let clean = watch(run, "thesis-10bit", 11, (Quantity::Rates, 1.0));
    assert!(clean.report.is_clean());
    for case in CASES {
        let watched = watch(run, "thesis-10bit", 11, case);
        let [(_, unit)] = &watched.report.units[..] else {
            panic!("{case:?}: {:?}", watched.report.units);
        };
        let (words, found_s) = (unit.describe(), watched.found_s().unwrap());
        let (quantity, factor) = case;
        let difference_n = watched.difference_n(&clean);
        eprintln!("{case:?}: after {found_s:.1} s {words:?}, then {difference_n:.2} N");
        assert_eq!(unit.quantity, quantity);
        assert!((unit.factor / factor - 1.0).abs() < 1e-9, "{words:?}");
        assert!(found_s < FOUND_MAX_S, "{case:?}: {found_s} s");
        assert!(watched.report.found.is_empty(), "{case:?}");
        assert!(difference_n < DIFFERENCE_MAX_N, "{case:?}: {difference_n}");
        // Gyros that read 57 times too much are faulty; no other sensor is.
        let others = watched.blamed.iter().filter(|(_, name)| {
            quantity != Quantity::Rates
                || !name.starts_with("inertial unit")
                || !name.contains("rate")
        });
        assert_eq!(others.count(), 0, "{case:?}: {:?}", watched.blamed);
    }
}

#[test]
fn a_unit_is_named_with_both_units_and_the_next_step() {
    let run = truth::excerpt("c_sine03");
    let page = std::fs::read_to_string(testkit::project().join("docs/guide/mistakes.md")).unwrap();
    for (case, subject, cause, remedy) in [
        (
            (Quantity::Rates, DEGREE),
            "gyros: unit",
            "the readings are 57.3 times too large: values in deg/s are taken for rad/s",
            "roles rate",
        ),
        (
            (Quantity::Velocity, 3.6),
            "velocity of GNSS: unit",
            "the readings are 3.6 times too large: values in km/h are taken for m/s",
            "roles velocity",
        ),
    ] {
        let watched = watch(run, "thesis-10bit", 12, case);
        let words = watched.report.units[0].1.describe();
        assert_eq!(words.subject, subject);
        assert!(words.cause.starts_with(cause), "{}", words.cause);
        assert!(words.remedy.contains(remedy), "{}", words.remedy);
        assert!(page.contains(cause), "the guide has no {cause}");
    }
}
