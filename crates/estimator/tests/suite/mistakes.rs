//! Mistakes of the configuration: each is named and corrected, and a right configuration is not blamed.

mod campaigns;

use atvrec_estimator::mistakes::Hypothesis;
use atvrec_estimator::{Calibration, Estimator, FoundMistake, MistakeReport, Output, Settings};
use model::sensors::Sensors;
use model::vehicle::{Payload, Vehicle};
use nalgebra::{Rotation3, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use sample::{CornerSample, Counts, Estimate, EventKind, Measurement, Sample, Wheel};
use testkit::truth::Run;
use testkit::{drive, report, scoring, sensing, truth};

/// Payload of the tests: mass, kg, and place in the frame of the front axle, m.
const LOAD: (f64, [f64; 3]) = (80.0, [-0.8, 0.3, 0.9]);

/// What is wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mistake {
    None,
    /// Offsets within so many counts.
    Zeros(f64),
    Exchanged(usize, [usize; 2]),
    Corners([usize; 2]),
    Gain(usize, usize, f64),
    Tilt(usize, f64),
    /// A quarter turn about z.
    Turned,
    Moved([f64; 3]),
    Grams,
    Payload,
    /// Gauges that are wired for bending: a lower leg reads what its bending bridge reads, the others only noise.
    Bending(usize, usize),
    /// Signs and gains of channels at three wheels.
    Several,
    /// A channel that was torn off before the drive.
    Dead(usize, usize),
}

/// Wheel, channel and factor of the gains that are wrong in [`Mistake::Several`].
const SEVERAL: [(usize, usize, f64); 4] = [(0, 4, -1.0), (1, 0, 3.0), (2, 2, -1.0), (3, 3, 0.2)];

impl Mistake {
    /// What the evidence should say of it.
    fn is(self, found: &Hypothesis) -> bool {
        match (self, *found) {
            (Self::Zeros(_), Hypothesis::Zeros)
            | (Self::Turned, Hypothesis::Turned(_))
            | (Self::Moved(_), Hypothesis::Moved)
            | (Self::Grams, Hypothesis::Unit(false))
            | (Self::Payload, Hypothesis::Payload)
            | (Self::Several, Hypothesis::Several) => true,
            (Self::Exchanged(wheel, pair), Hypothesis::Exchanged(w, p)) => wheel == w && pair == p,
            (Self::Corners(wheels), Hypothesis::Corners(found)) => wheels == found,
            (Self::Gain(wheel, i, _) | Self::Bending(wheel, i), Hypothesis::Gain(at)) => {
                at == 5 * wheel + i
            }
            (Self::Tilt(axis, _), Hypothesis::Tilted(found)) => axis == found,
            (Self::Bending(wheel, i), Hypothesis::Bent(at)) => at == 5 * wheel + i,
            _ => false,
        }
    }

    /// Changes the sensors that are on the vehicle.
    fn make(self, sensors: &mut Sensors, real: &Vehicle) {
        match self {
            Self::Zeros(counts) => sensors.strain.zero_error_counts = counts,
            Self::Payload => {
                // The centre of gravity moves, the inertial unit does not.
                let (bare, loaded) = (&truth::vehicle().body, &real.body);
                sensors.imu.position_m[0] += loaded.front_axle_to_cg_m - bare.front_axle_to_cg_m;
                sensors.imu.position_m[1] -= loaded.cg_y_m - bare.cg_y_m;
                sensors.imu.position_m[2] -= loaded.cg_height_m - bare.cg_height_m;
            }
            Self::Moved(by) => {
                for (axis, by) in by.iter().enumerate() {
                    sensors.imu.position_m[axis] += by;
                }
            }
            _ => {}
        }
    }

    /// Changes what they read.
    fn spoil(self, samples: &mut [Sample], sensors: &Sensors) {
        let middle = f64::powi(2.0, i32::from(sensors.strain.adc_bits) - 1);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for sample in samples {
            match (&mut sample.measurement, self) {
                (Measurement::Corner(c), Self::Exchanged(wheel, [a, b]))
                    if c.wheel.index() == wheel =>
                {
                    c.strain_counts.swap(a, b);
                }
                (Measurement::Corner(c), Self::Corners([a, b])) => {
                    let at = c.wheel.index();
                    let other = if at == a { b } else { a };
                    if at == a || at == b {
                        c.wheel = Wheel::ALL[other];
                    }
                }
                (Measurement::Corner(c), Self::Gain(wheel, i, factor)) => {
                    multiply(c, (wheel, i, factor), middle);
                }
                (Measurement::Corner(c), Self::Dead(wheel, i)) if c.wheel.index() == wheel => {
                    c.strain_counts[i] = Some(Counts::Converter(0));
                }
                (Measurement::Corner(c), Self::Several) => {
                    for gain in SEVERAL {
                        multiply(c, gain, middle);
                    }
                }
                (Measurement::Corner(c), Self::Bending(wheel, i)) if c.wheel.index() == wheel => {
                    let noise: f64 = StandardNormal.sample(&mut rng);
                    let none = (middle + sensors.strain.noise_counts * noise).round() as i32;
                    let bending = if i == 2 { c.strain_counts[5] } else { None };
                    c.strain_counts[i] = bending.or(Some(Counts::Converter(none)));
                }
                (Measurement::Imu(imu), Self::Tilt(..) | Self::Turned) => {
                    let turn = match self {
                        Self::Tilt(axis, angle) => Rotation3::new(Vector3::ith(axis, angle)),
                        _ => Rotation3::new(Vector3::z() * std::f64::consts::FRAC_PI_2),
                    };
                    for values in [&mut imu.specific_force_m_s2, &mut imu.angular_rate_rad_s] {
                        *values = (turn * Vector3::from(*values)).into();
                    }
                }
                (Measurement::Imu(imu), Self::Grams) => {
                    imu.specific_force_m_s2 = imu.specific_force_m_s2.map(|x| x / 9.80665);
                }
                _ => {}
            }
        }
    }
}

/// Multiplies what a channel reads, if the corner is that of the wheel.
fn multiply(corner: &mut CornerSample, (wheel, i, factor): (usize, usize, f64), middle: f64) {
    if let (Some(Counts::Converter(n)), true) =
        (&mut corner.strain_counts[i], corner.wheel.index() == wheel)
    {
        *n = (middle + factor * (f64::from(*n) - middle)).round() as i32;
    }
}

/// A drive with a mistake.
struct Drive<'a> {
    run: &'a Run,
    /// The vehicle that drives.
    real: &'a Vehicle,
    sensors: &'static str,
    seed: u64,
    mistake: Mistake,
}

/// What came out of it.
struct Watched {
    report: MistakeReport,
    lagged: Vec<Estimate>,
    /// Faults of channels, by name.
    blamed: Vec<String>,
}

impl Watched {
    fn first(&self) -> Option<(f64, &FoundMistake)> {
        let (found, _) = self.report.found.first()?;
        Some((found.time.seconds_since(sensing::START), found))
    }

    fn words(&self) -> String {
        let units = self.report.units.iter().map(|(_, unit)| unit.describe());
        let found = self.report.found.iter().map(|(_, words)| words.clone());
        units
            .chain(found)
            .map(|words| format!("{}: {}", words.subject, words.cause))
            .collect::<Vec<_>>()
            .join("; ")
    }

    /// Error of F_y in per cent, contact frame, lagged, worst wheel, from a time on.
    fn lateral_error(&self, run: &Run, vehicle: &Vehicle, from_s: f64) -> f64 {
        let of_wheel = |wheel: Wheel| {
            let forces_n = run.column(&format!("{}_Fy", wheel.abbreviation()));
            let load_n = vehicle.static_load_n(wheel);
            let peak = forces_n
                .iter()
                .fold(load_n, |most, force| most.max(force.abs()));
            let late = self.lagged.iter().filter_map(|estimate| {
                let row = scoring::row(estimate);
                (row as f64 > from_s * truth::RATE_HZ && row < run.rows)
                    .then(|| estimate.measured[wheel].force_n[1] - forces_n[row])
            });
            100.0 * scoring::rms(late) / peak
        };
        Wheel::ALL.into_iter().map(of_wheel).fold(0.0, f64::max)
    }

    /// Errors in per cent, wheel-carrier frame, lagged, from 3 s after the correction.
    fn errors(&self, run: &Run, vehicle: &Vehicle) -> [f64; 3] {
        let from_s = self.first().map_or(3.0, |(at_s, _)| at_s) + 3.0;
        let late = |e: &&Estimate| e.time.seconds_since(sensing::START) > from_s;
        let kept: Vec<Estimate> = self.lagged.iter().filter(late).cloned().collect();
        scoring::carrier_errors(run, vehicle, &kept)
    }
}

fn watch(drive: &Drive<'_>) -> Watched {
    watch_all(drive, &[drive.mistake])
}

/// The drive with these mistakes in place of its own.
fn watch_all(drive: &Drive<'_>, mistakes: &[Mistake]) -> Watched {
    let vehicle = truth::vehicle();
    let sensors = Sensors::builtin(drive.sensors).unwrap();
    let mut made = sensors.clone();
    for mistake in mistakes {
        mistake.make(&mut made, drive.real);
    }
    let mut samples = sensing::samples(drive.run, drive.real, &made, drive.seed);
    for mistake in mistakes {
        mistake.spoil(&mut samples, &sensors);
    }
    let calibration = Calibration::nominal(&vehicle.name);
    let mut estimator =
        Estimator::new(vehicle, &sensors, &calibration, Settings::default()).unwrap();
    let (mut lagged, mut blamed) = (Vec::new(), Vec::new());
    for sample in &samples {
        estimator.advance(sample.log_time, &mut |output| match output {
            Output::Lagged(estimate) => lagged.push(estimate),
            Output::Event(event) => {
                if let EventKind::SensorFault(name) = event.kind {
                    blamed.push(name);
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

fn loaded() -> Vehicle {
    let mut vehicle = truth::vehicle().clone();
    vehicle.payload = vec![Payload {
        name: "sack".to_owned(),
        mass_kg: LOAD.0,
        position_m: LOAD.1,
        inertia_kg_m2: [0.0; 3],
    }];
    vehicle.loaded(&["sack"]).unwrap().vehicle
}

/// The mistakes of the documentation.
const MISTAKES: [Mistake; 15] = [
    Mistake::Zeros(20.0),
    Mistake::Exchanged(0, [0, 1]),
    Mistake::Exchanged(2, [1, 4]),
    Mistake::Exchanged(1, [2, 3]),
    Mistake::Corners([0, 1]),
    Mistake::Gain(0, 2, -1.0),
    Mistake::Gain(1, 4, -1.0),
    Mistake::Gain(2, 0, 0.5),
    Mistake::Gain(3, 3, 1.4),
    Mistake::Tilt(0, 0.052),
    Mistake::Tilt(1, 0.052),
    Mistake::Tilt(2, 0.052),
    Mistake::Turned,
    Mistake::Moved([0.3, 0.0, 0.0]),
    Mistake::Grams,
];

#[test]
fn mistakes_of_the_strain_channels_are_named_and_corrected() {
    let run = truth::excerpt("c_sine03");
    let vehicle = truth::vehicle();
    for (mistake, sensors) in [
        (Mistake::Zeros(20.0), "thesis-10bit"),
        (Mistake::Corners([0, 1]), "thesis-10bit"),
        (Mistake::Exchanged(2, [1, 4]), "full-bridge-16bit"),
        (Mistake::Gain(0, 2, -1.0), "thesis-10bit"),
        (Mistake::Gain(2, 0, 0.5), "full-bridge-16bit"),
        (Mistake::Bending(0, 1), "full-bridge-16bit"),
        (Mistake::Bending(3, 4), "thesis-10bit"),
        (Mistake::Bending(2, 2), "full-bridge-16bit-bending"),
    ] {
        let drive = Drive {
            run,
            real: vehicle,
            sensors,
            seed: 11,
            mistake,
        };
        let watched = watch(&drive);
        let words = watched.words();
        let (at_s, found) = watched
            .first()
            .unwrap_or_else(|| panic!("{mistake:?}: nothing"));
        assert!(mistake.is(&found.judged.hypothesis), "{mistake:?}: {words}");
        assert!(found.corrected && at_s < 20.0, "{mistake:?}: {at_s} s");
        assert_eq!(watched.report.found.len(), 1, "{mistake:?}: {words}");
        assert!(
            watched.blamed.is_empty(),
            "{mistake:?}: {:?}",
            watched.blamed
        );
        if let Mistake::Bending(..) = mistake {
            assert!(
                words.contains("the gauges are wired for bending"),
                "{words}"
            );
        }
        if let Mistake::Gain(_, _, factor) = mistake {
            let gain = 1.0 - found.judged.value[0];
            let most = 3.0 * found.judged.sigma[0];
            assert!((gain - factor).abs() < most, "{gain} for {factor}");
        }
    }
}

/// What explains the readings best is no explanation where it leaves most of the contradiction: corrected, it led
/// to a payload beside the wheels and to an inertial unit on its head.
#[test]
fn several_mistakes_are_not_taken_for_one() {
    for sensors in ["thesis-10bit", "full-bridge-16bit"] {
        let watched = watch(&Drive {
            run: truth::excerpt("c_sine03"),
            real: truth::vehicle(),
            sensors,
            seed: 11,
            mistake: Mistake::Several,
        });
        let words = watched.words();
        let (at_s, found) = watched.first().expect("nothing was found");
        assert!(Mistake::Several.is(&found.judged.hypothesis), "{words}");
        assert!(!found.corrected && at_s < 25.0, "{at_s} s: {words}");
        assert_eq!(watched.report.found.len(), 1, "{words}");
        assert!(watched.report.changes.is_empty(), "{words}");
    }
}

/// A channel that was torn off is a fault, and no mistake of its corner.
#[test]
fn dead_channels_are_faults_and_no_mistakes() {
    for i in 0..5 {
        let watched = watch(&Drive {
            run: truth::excerpt("c_sine03"),
            real: truth::vehicle(),
            sensors: "thesis-10bit",
            seed: 11,
            mistake: Mistake::Dead(1, i),
        });
        assert!(watched.report.found.is_empty(), "{}", watched.words());
        assert_eq!(watched.blamed.len(), 1, "{:?}", watched.blamed);
    }
}

#[test]
fn a_load_that_is_not_configured_is_found_with_its_place() {
    let vehicle = truth::vehicle();
    let real = loaded();
    let run = drive::virtual_drive(&real, sim::Manoeuvre::MixedDriving, 20.0);
    let watched = watch(&Drive {
        run: &run,
        real: &real,
        sensors: "thesis-10bit",
        seed: 11,
        mistake: Mistake::Payload,
    });
    let (_, found) = watched.first().unwrap();
    assert_eq!(
        found.judged.hypothesis,
        Hypothesis::Payload,
        "{}",
        watched.words()
    );
    let [mass_kg, _, moment, ..] = found.judged.value;
    let left_m = moment / mass_kg;
    let expected_m = LOAD.1[1] - vehicle.body.cg_y_m;
    assert!((mass_kg - LOAD.0).abs() < 12.0, "{mass_kg} kg");
    assert!(
        (left_m - expected_m).abs() < 0.1,
        "{left_m} m, {expected_m} m"
    );
    let load = watched.report.payload.as_ref().unwrap();
    assert!((load.position_m[1] - LOAD.1[1]).abs() < 0.1, "{load:?}");
}

#[test]
fn a_right_configuration_is_not_blamed() {
    let vehicle = truth::vehicle();
    for name in [
        "b_circle",
        "d_sine_mu",
        "f_launch_brake",
        "r2_iso_e_a",
        "r8_trail_a",
    ] {
        for sensors in ["thesis-10bit", "full-bridge-16bit-bending"] {
            let watched = watch(&Drive {
                run: truth::excerpt(name),
                real: vehicle,
                sensors,
                seed: 11,
                mistake: Mistake::None,
            });
            assert!(
                watched.report.is_clean(),
                "{name} {sensors}: {}",
                watched.words()
            );
            let parameters = &watched.report.parameters;
            assert_eq!(parameters.factor, 0.0, "{name} {sensors}: {parameters:?}");
        }
    }
}

#[test]
fn a_correction_is_offered_as_a_calibration() {
    let watched = watch(&Drive {
        run: truth::excerpt("c_sine03"),
        real: truth::vehicle(),
        sensors: "thesis-10bit",
        seed: 12,
        mistake: Mistake::Gain(0, 2, -1.0),
    });
    let mut calibration = Calibration::nominal(&truth::vehicle().name);
    let nominal = Sensors::builtin("thesis-10bit").unwrap();
    let before = atvrec_estimator::calibration::Resolved::new(&nominal, &calibration).unwrap();
    watched.report.changes.apply(&mut calibration);
    let after = atvrec_estimator::calibration::Resolved::new(&nominal, &calibration).unwrap();
    let gain = |c: &atvrec_estimator::calibration::Resolved| c.corners.0[0].strain[2].gain;
    assert_eq!(gain(&after), -gain(&before));
    let kept = |c: &atvrec_estimator::calibration::Resolved| c.corners.0[0].strain[3].gain;
    assert_eq!(kept(&after), kept(&before));
}
