//! The road under the wheels, longitudinal slip, and a load on the hitch.

use atvrec_estimator::road::Section;
use atvrec_estimator::{Calibration, Settings};
use model::sensors::Sensors;
use model::vehicle::Vehicle;
use sample::{
    ControlSample, EventKind, LogTime, Measurement, PerWheel, Road, RoadUnknown, Sample, Signal,
    SourceId, Wheel,
};
use sim::Manoeuvre;
use testkit::drive::virtual_drive;
use testkit::scoring::{Estimated, estimate, rms, row};
use testkit::truth::{RATE_HZ, Run};
use testkit::{sensing, truth};

/// Seed of the sensors' noise: tuning uses seeds from 11.
const SEED: u64 = 11;
/// Rows of a run's first 3 s.
const SETTLING_ROWS: usize = 600;
/// Largest error of a height above 0.5 Hz with the lag, m: about twice what was measured (1.2, 6.0 and 4.4 mm),
/// and not above the 5, 10 and 9 mm that the project asks for.
const HEIGHT_M: [(&str, f64); 3] = [
    ("r1_iso_c_a", 0.0025),
    ("r2_iso_e_a", 0.010),
    ("r8_trail_a", 0.009),
];

fn on(run: &'static Run, sensors: &str) -> Estimated {
    let vehicle = truth::vehicle();
    let calibration = Calibration::nominal(&vehicle.name);
    let set = Sensors::builtin(sensors).unwrap();
    let samples = run.samples(sensors, SEED);
    estimate(vehicle, &set, &calibration, Settings::default(), samples)
}

/// Error of the height above 0.5 Hz, of the worst wheel, m.
fn height_error_m(run: &Run, roads: &[Road]) -> f64 {
    let high_pass = Section::new(0.5 * 0.01, true);
    let worst = Wheel::ALL.map(|wheel| {
        let truth = run.column(&format!("{}_ground_z", wheel.abbreviation()));
        let mut all: Vec<f64> = roads
            .iter()
            .filter(|road| road.unknown.is_none())
            .map(|road| (row_of(road.time), road))
            .filter(|(row, _)| *row > SETTLING_ROWS && *row < run.rows)
            .map(|(row, road)| road.height_m[wheel] - truth[row])
            .collect();
        for _ in 0..2 {
            let first = all[0];
            let mut memory = [0.0; 2];
            for value in &mut all {
                *value = high_pass.push(&mut memory, *value - first);
            }
            all.reverse();
        }
        rms(all.into_iter())
    });
    worst.into_iter().fold(0.0, f64::max)
}

fn row_of(time: LogTime) -> usize {
    (time.seconds_since(sensing::START) * RATE_HZ).round() as usize
}

#[test]
fn heights_and_class_of_the_road_are_those_of_the_ground() {
    for (name, limit_m) in HEIGHT_M {
        let Some(run) = truth::rough_run(name) else {
            return;
        };
        let found = on(run, "thesis-10bit");
        let [causal, lagged] =
            [&found.roads, &found.lagged_roads].map(|roads| height_error_m(run, roads));
        let last = found.roads.iter().rev().find_map(|road| road.roughness);
        let last = last.expect("a roughness");
        eprintln!(
            "{name}: {:.1} mm causal, {:.1} mm with the lag; {last:?}",
            causal * 1e3,
            lagged * 1e3
        );
        assert!(lagged < limit_m, "{name}: {lagged}");
        let classes: &[char] = match name {
            "r1_iso_c_a" => &['C'],
            "r2_iso_e_a" => &['E'],
            _ => &['D', 'E'],
        };
        assert!(classes.contains(&last.class()), "{name}: {last:?}");
        let indexed = found
            .roads
            .iter()
            .filter(|road| road.iri_m_km[0].is_finite());
        let slow = indexed.filter(|road| {
            let row = row_of(road.time);
            row < run.rows && run.column("vx_body")[row] < 7.8
        });
        assert_eq!(slow.count(), 0, "{name}: an index below 8 m/s");
    }
}

#[test]
fn nothing_is_told_of_the_road_below_2_m_s_and_the_reason_is() {
    let Some(run) = truth::rough_run("r5_crossaxle_a") else {
        return;
    };
    let found = on(run, "thesis-10bit");
    let mut slow = 0;
    for road in &found.roads {
        let row = row_of(road.time);
        if row < SETTLING_ROWS || row >= run.rows {
            continue;
        }
        let speed = run.column("vx_body")[row];
        if speed < 1.9 {
            slow += 1;
            assert_eq!(road.unknown, Some(RoadUnknown::Slow), "{road:?}");
            assert!(road.height_m[Wheel::FrontLeft].is_nan() && road.roughness.is_none());
            assert!(road.plane.bank_rad.is_nan());
        } else if speed > 2.1 {
            assert_eq!(road.unknown, None, "{road:?}");
        }
    }
    assert!(slow > 500, "{slow}");
}

/// Slip of a vehicle that starts and brakes with 7 %.
#[test]
fn longitudinal_slip_is_that_of_the_tyres() {
    let Some(run) = truth::run("f_launch_brake") else {
        return;
    };
    let found = on(run, "thesis-10bit");
    let (mut errors, mut squares) = (Vec::new(), Vec::new());
    for estimate in &found.estimates {
        let row = row(estimate);
        if row < SETTLING_ROWS || row >= run.rows {
            continue;
        }
        for wheel in Wheel::ALL {
            let at = |name: &str| run.column(&format!("{}_{name}", wheel.abbreviation()))[row];
            let slip = estimate.motion.longitudinal_slip[wheel];
            if at("Vx") < 0.9 {
                assert!(slip.is_nan(), "{slip} at {} m/s", at("Vx"));
            } else if slip.is_finite() {
                let error = slip - at("kappa");
                errors.push(error);
                squares.push(error / estimate.motion.longitudinal_slip_sigma[wheel]);
            }
        }
    }
    let (error, square) = (
        rms(errors.iter().copied()),
        rms(squares.into_iter()).powi(2),
    );
    eprintln!("slip: {error:.4} rms, mean square {square:.2}");
    assert!(errors.len() > 3000 && error < 0.01, "{error}");
    assert!(square > 0.3 && square < 1.5, "{square}");
}

/// What a load cell on the hitch sends, 100 times a second.
fn hitch_samples(run: &Run, force_n: impl Fn(f64) -> [f64; 3]) -> Vec<Sample> {
    let count = (run.rows as f64 / RATE_HZ * 100.0) as usize;
    let sample = |k: usize| {
        let time_s = 0.01 * k as f64;
        let time = sensing::START.offset_seconds(time_s);
        let values = ControlSample::HITCH_FORCE
            .into_iter()
            .zip(force_n(time_s))
            .map(|(name, value)| Signal {
                name: name.into(),
                value,
                unit: "N".into(),
            });
        Sample {
            source: SourceId(3),
            log_time: time,
            valid_time: time,
            device_time: None,
            measurement: Measurement::Control(ControlSample {
                values: values.collect(),
            }),
        }
    };
    (0..count).map(sample).collect()
}

/// A trailer that pulls with 400 N costs nothing where its force is measured, and is neither a fault nor a lift nor
/// another surface.
#[test]
fn a_known_load_on_the_hitch_disturbs_nothing() {
    let vehicle = Vehicle::builtin("prowler").unwrap();
    let run = virtual_drive(&vehicle, Manoeuvre::Tow, 1.0);
    let sensors = Sensors::builtin("thesis-10bit").unwrap();
    let calibration = Calibration::nominal(&vehicle.name);
    let plain = sensing::samples(&run, &vehicle, &sensors, SEED);
    let mut measured = plain.clone();
    measured.extend(hitch_samples(&run, |time_s| {
        let row = (time_s * RATE_HZ).round() as usize;
        run.vector(["hitch_Fx", "hitch_Fy", "hitch_Fz"], row)
    }));
    measured.sort_by_key(|sample| sample.log_time);
    let worst = |samples: &[Sample], is_known: bool| {
        let settings = Settings::default();
        let mut found = estimate(&vehicle, &sensors, &calibration, settings, samples);
        // A force that is not measured contradicts the vehicle file.
        (found.events)
            .retain(|event| is_known || !matches!(event.kind, EventKind::InexactParameters(_)));
        assert!(found.events.is_empty(), "{:?}", found.events);
        let error = PerWheel::from_fn(|wheel| {
            let name = wheel.abbreviation();
            rms(found.estimates.iter().filter_map(|estimate| {
                let row = row(estimate);
                let judged = row > SETTLING_ROWS && row < run.rows;
                let truth = || run.column(&format!("{name}_Fx"))[row];
                judged.then(|| estimate.measured[wheel].force_n[0] - truth())
            }))
        });
        error.0.into_iter().fold(0.0, f64::max)
    };
    let [known, unknown] = [worst(&measured, true), worst(&plain, false)];
    eprintln!("F_x with a measured hitch force: {known:.1} N rms, without: {unknown:.1} N");
    assert!(known < 0.7 * unknown, "{known} {unknown}");
}
