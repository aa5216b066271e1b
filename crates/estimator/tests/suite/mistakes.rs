//! Mistakes of the configuration: each is named and corrected, and a right configuration is not blamed.

use atvrec_estimator::mistakes::Hypothesis;
use atvrec_estimator::{Calibration, Estimator, FoundMistake, MistakeReport, Output, Settings};
use model::sensors::Sensors;
use model::vehicle::{Payload, Vehicle};
use nalgebra::{Rotation3, Vector3};
use sample::{Counts, Estimate, EventKind, Measurement, Sample, Wheel};
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
}

impl Mistake {
    /// What the evidence should say of it.
    fn is(self, found: &Hypothesis) -> bool {
        match (self, *found) {
            (Self::Zeros(_), Hypothesis::Zeros)
            | (Self::Turned, Hypothesis::Turned(_))
            | (Self::Moved(_), Hypothesis::Moved)
            | (Self::Grams, Hypothesis::Unit(false))
            | (Self::Payload, Hypothesis::Payload) => true,
            (Self::Exchanged(wheel, pair), Hypothesis::Exchanged(w, p)) => wheel == w && pair == p,
            (Self::Corners(wheels), Hypothesis::Corners(found)) => wheels == found,
            (Self::Gain(wheel, i, _), Hypothesis::Gain(at)) => at == 5 * wheel + i,
            (Self::Tilt(axis, _), Hypothesis::Tilted(found)) => axis == found,
            _ => false,
        }
    }

    fn spoil(self, samples: &mut [Sample], sensors: &Sensors) {
        let middle = f64::powi(2.0, i32::from(sensors.strain.adc_bits) - 1);
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
                    if let (Some(Counts::Converter(n)), true) =
                        (&mut c.strain_counts[i], c.wheel.index() == wheel)
                    {
                        *n = (middle + factor * (f64::from(*n) - middle)).round() as i32;
                    }
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
        let found = self.report.found.iter();
        found
            .map(|(_, words)| format!("{}: {}", words.subject, words.cause))
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
    let vehicle = truth::vehicle();
    let sensors = Sensors::builtin(drive.sensors).unwrap();
    let mut made = sensors.clone();
    match drive.mistake {
        Mistake::Zeros(counts) => made.strain.zero_error_counts = counts,
        Mistake::Payload => {
            // The centre of gravity moves, the inertial unit does not.
            let (bare, loaded) = (&vehicle.body, &drive.real.body);
            made.imu.position_m[0] += loaded.front_axle_to_cg_m - bare.front_axle_to_cg_m;
            made.imu.position_m[1] -= loaded.cg_y_m - bare.cg_y_m;
            made.imu.position_m[2] -= loaded.cg_height_m - bare.cg_height_m;
        }
        Mistake::Moved(by) => {
            for (axis, by) in by.iter().enumerate() {
                made.imu.position_m[axis] += by;
            }
        }
        _ => {}
    }
    let mut samples = sensing::samples(drive.run, drive.real, &made, drive.seed);
    drive.mistake.spoil(&mut samples, &sensors);
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
        if let Mistake::Gain(_, _, factor) = mistake {
            let gain = 1.0 - found.judged.value[0];
            let most = 3.0 * found.judged.sigma[0];
            assert!((gain - factor).abs() < most, "{gain} for {factor}");
        }
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
                watched.report.found.is_empty(),
                "{name} {sensors}: {}",
                watched.words()
            );
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

/// The table of the documentation: each mistake on a flat and a rough run and both converters.
#[test]
#[ignore = "minutes; `make campaigns` runs it and writes target/mistakes.md"]
fn campaign_of_mistakes() {
    let vehicle = truth::vehicle();
    let runs = [truth::run("c_sine03"), truth::rough_run("r1_iso_c_a")];
    let mut rows = vec![
        "| mistake | run | sensors | named, of 4 | after, s | errors then F_x F_y F_z, % | as configured |"
            .to_owned(),
        "|---|---|---|---|---|---|---|".to_owned(),
    ];
    let mut missed = 0;
    for run in runs.into_iter().flatten() {
        for sensors in ["thesis-10bit", "full-bridge-16bit-bending"] {
            let with = |mistake, seed| {
                watch(&Drive {
                    run,
                    real: vehicle,
                    sensors,
                    seed,
                    mistake,
                })
            };
            let right = with(Mistake::None, 1).errors(run, vehicle);
            for mistake in MISTAKES {
                let mut named = 0;
                let (mut latest_s, mut worst) = (0.0_f64, [0.0_f64; 3]);
                for seed in 1..=4 {
                    let watched = with(mistake, seed);
                    let Some((at_s, found)) = watched.first() else {
                        continue;
                    };
                    if mistake.is(&found.judged.hypothesis) {
                        named += 1;
                        latest_s = latest_s.max(at_s);
                        for (worst, error) in worst.iter_mut().zip(watched.errors(run, vehicle)) {
                            *worst = worst.max(error);
                        }
                    }
                }
                missed += 4 - named;
                let three = |e: [f64; 3]| format!("{:.1} {:.1} {:.1}", e[0], e[1], e[2]);
                rows.push(format!(
                    "| {mistake:?} | {} | {sensors} | {named} | {latest_s:.0} | {} | {} |",
                    run.name,
                    three(worst),
                    three(right)
                ));
            }
        }
    }
    let path = testkit::project().join("target/mistakes.md");
    std::fs::write(path, rows.join("\n")).unwrap();
    report(&format!("{missed} of {} not named", MISTAKES.len() * 16));
    // 16-bit bridges that are off by 20 counts (6 N) are within what the geometry leaves unknown.
    assert!(
        missed <= 8 + 4,
        "{missed} not named; see target/mistakes.md"
    );
}

/// Largest errors of a load that is not configured: mass, kg, place across, m, and F_y, per cent, then.
const LOAD_MASS_MAX_KG: f64 = 10.0;
const LOAD_PLACE_MAX_M: f64 = 0.05;
const LOAD_LATERAL_MAX: f64 = 1.5;

/// A load of 80 kg, 0.3 m off the middle, seeds 1 to 4, 10 and 16 bit.
#[test]
#[ignore = "minutes; `make campaigns` runs it"]
fn campaign_of_a_load() {
    let vehicle = truth::vehicle();
    let real = loaded();
    let run = drive::virtual_drive(&real, sim::Manoeuvre::MixedDriving, 60.0);
    let mut off = Vec::new();
    for sensors in ["thesis-10bit", "full-bridge-16bit-bending"] {
        for seed in 1..=4 {
            let watched = watch(&Drive {
                run: &run,
                real: &real,
                sensors,
                seed,
                mistake: Mistake::Payload,
            });
            let Some((at_s, found)) = watched.first() else {
                off.push(format!("{sensors} {seed}: nothing"));
                continue;
            };
            let [mass_kg, _, moment, ..] = found.judged.value;
            let left_m = moment / mass_kg;
            let expected_m = LOAD.1[1] - vehicle.body.cg_y_m;
            let lateral = watched.lateral_error(&run, &real, at_s + 3.0);
            let line = format!(
                "{sensors} {seed}: after {at_s:.0} s {}; F_y {lateral:.2} % then; blamed {:?}",
                watched.words(),
                watched.blamed
            );
            println!("{line}");
            let is_good = found.judged.hypothesis == Hypothesis::Payload
                && (mass_kg - LOAD.0).abs() < LOAD_MASS_MAX_KG
                && (left_m - expected_m).abs() < LOAD_PLACE_MAX_M
                && lateral < LOAD_LATERAL_MAX
                && watched.blamed.is_empty();
            if !is_good {
                off.push(line);
            }
        }
    }
    report(&format!("{} of 8 loads are off", off.len()));
    assert!(off.is_empty(), "{}", off.join("\n"));
}

/// No mistake is found where there is none: all truth runs, all sensor sets, seeds 1 to 4.
#[test]
#[ignore = "minutes; `make campaigns` runs it"]
fn campaign_without_mistakes() {
    let flat = [
        "b_circle",
        "c_sine03",
        "d_sine_mu",
        "f_launch_brake",
        "h_jack",
    ];
    let rough = [
        "r1_iso_c_a",
        "r2_iso_e_a",
        "r3_rocks_a",
        "r4_washboard",
        "r5_crossaxle_a",
        "r6_jump",
        "r8_trail_a",
    ];
    let flat = flat.into_iter().filter_map(truth::run);
    let (mut false_ones, mut drives) = (Vec::new(), 0);
    for run in flat.chain(rough.into_iter().filter_map(truth::rough_run)) {
        for sensors in [
            "thesis-10bit",
            "full-bridge-16bit",
            "full-bridge-16bit-bending",
        ] {
            for seed in 1..=4 {
                let watched = watch(&Drive {
                    run,
                    real: truth::vehicle(),
                    sensors,
                    seed,
                    mistake: Mistake::None,
                });
                drives += 1;
                if !watched.report.found.is_empty() {
                    false_ones.push(format!(
                        "{} {sensors} {seed}: {}",
                        run.name,
                        watched.words()
                    ));
                }
            }
        }
    }
    report(&format!(
        "{} of {drives} drives with a false report",
        false_ones.len()
    ));
    assert!(false_ones.is_empty(), "{}", false_ones.join("\n"));
}
