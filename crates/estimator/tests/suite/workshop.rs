//! Parameters as a careful workshop measures them: the forces stay near the truth, and their standard deviations
//! contain what the parameters' errors make.

use std::ops::Range;

use atvrec_estimator::{Calibration, Settings};
use model::sensors::Sensors;
use model::vehicle::{Axle, Vehicle};
use model::{SensorsTolerances, VehicleTolerances};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sample::{EventKind, StrainChannel, Wheel};
use testkit::truth::Run;
use testkit::{report, scoring, truth};

/// A vehicle file of a careful workshop, and gains: every error is uniform within its bounds. Hard-points 1 mm,
/// gains, springs and mass 1 %, centre of gravity 10 mm, free length 0.3 mm, damper 10 %, rate of the tyres 5 %.
pub fn measured(vehicle: &Vehicle, sensors: &Sensors, seed: u64) -> (Vehicle, Calibration) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut within = |most: f64| rng.random_range(-most..most);
    let mut calibration = Calibration::nominal(&vehicle.name);
    let nominal = 1.0 / sensors.strain.axial_scale().unwrap().counts_per_unit;
    for wheel in Wheel::ALL {
        let corner = calibration.corner.entry(wheel).or_default();
        for channel in &StrainChannel::ALL[..5] {
            let gain = nominal * (1.0 + within(0.01));
            corner.strain.entry(*channel).or_default().gain_per_count = Some(gain);
        }
    }
    let mut vehicle = vehicle.clone();
    for axle in [&mut vehicle.front, &mut vehicle.rear] {
        disturb(axle, &mut within);
    }
    let body = &mut vehicle.body;
    body.mass_kg *= 1.0 + within(0.01);
    let ahead = within(0.01);
    body.front_axle_to_cg_m += ahead;
    body.cg_to_rear_axle_m -= ahead;
    body.cg_y_m += within(0.01);
    body.cg_height_m += within(0.01);
    (vehicle, calibration)
}

fn disturb(axle: &mut Axle, within: &mut impl FnMut(f64) -> f64) {
    for point in axle.hard_points_mut() {
        for x in point {
            *x += within(0.001);
        }
    }
    let strut = axle.strut.as_mut().unwrap();
    strut.stiffness_n_m *= 1.0 + within(0.01);
    strut.free_length_m += within(0.0003);
    strut.damping_n_s_m *= 1.0 + within(0.1);
    axle.tyre.vertical_stiffness_n_m *= 1.0 + within(0.05);
}

/// The files with the tolerances of that workshop.
fn state(vehicle: &mut Vehicle, sensors: &mut Sensors) {
    vehicle.tolerances = Some(VehicleTolerances {
        hard_points_m: Some(0.001),
        stiffness_fraction: Some(0.01),
        free_length_m: Some(0.0003),
        damping_fraction: Some(0.1),
        mass_fraction: Some(0.01),
        cg_m: Some(0.01),
    });
    sensors.tolerances = Some(SensorsTolerances {
        gain_fraction: Some(0.01),
        // The workshop knows its inertial unit.
        imu_direction_rad: Some(0.0),
        imu_position_m: Some(0.0),
        accel_scale_fraction: Some(0.0),
    });
}

/// Drives a run with a workshop's parameters, whose tolerances are stated or not.
fn driven(
    run: &'static Run,
    sensors: &str,
    seed: u64,
    stated: bool,
    settings: Settings,
) -> scoring::Estimated {
    let mut set = Sensors::builtin(sensors).unwrap();
    let (mut file, calibration) = measured(truth::vehicle(), &set, seed);
    if stated {
        state(&mut file, &mut set);
    }
    let samples = run.samples(sensors, seed);
    scoring::estimate(&file, &set, &calibration, settings, samples)
}

/// Largest errors F_x, F_y, F_z with a careful workshop's parameters, per cent.
const ERRORS_MAX: [f64; 3] = [2.7, 3.3, 2.5];

#[test]
fn a_workshops_parameters_are_good_enough() {
    for name in ["b_circle", "c_sine03", "f_launch_brake"] {
        let Some(run) = truth::run(name) else { return };
        for seed in 11..14 {
            let result = driven(run, "thesis-10bit", seed, false, Settings::default());
            let errors = scoring::force_errors(run, truth::vehicle(), &result);
            eprintln!("{name:15} workshop {seed}: {errors:.2?} %");
            for (error, most) in errors.iter().zip(ERRORS_MAX) {
                assert!(*error <= most, "{name} {errors:?}");
            }
        }
    }
}

/// In this drive, the mean squares of F_x and F_y are 15 and 8 with parameters that are taken for exact.
#[test]
fn standard_deviations_contain_the_errors_of_a_workshops_parameters() {
    let run = truth::excerpt("c_sine03");
    let mut exact = Settings::default();
    exact.tuning.mistakes.care_limits = [0.0; 2];
    let of = |settings| {
        let result = driven(run, "full-bridge-16bit-bending", 12, false, settings);
        scoring::deviations(run, &result).axes
    };
    let [exact, considered] = [exact, Settings::default()].map(of);
    eprintln!("mean squares {exact:.1?} and {considered:.2?}");
    for axis in 0..2 {
        assert!(exact[axis] > 6.0, "{exact:?}");
        assert!(considered[axis] < 3.0, "{considered:?}");
    }
}

/// The drive above: mean squares of F_x, F_y and F_z, standard deviations of the forces of a wheel after 1 s, N,
/// and the number of events on the parameters.
fn judged(
    vehicle: &Vehicle,
    sensors: &Sensors,
    calibration: &Calibration,
) -> ([f64; 3], [f64; 3], usize) {
    let run = truth::excerpt("c_sine03");
    let samples = run.samples("full-bridge-16bit-bending", 12);
    let settings = Settings::default();
    let result = scoring::estimate(vehicle, sensors, calibration, settings, samples);
    let events = result.events.iter();
    let inexact = events.filter(|event| matches!(event.kind, EventKind::InexactParameters(_)));
    let early = &result.estimates[100].measured[Wheel::FrontLeft];
    let squares = scoring::deviations(run, &result).axes;
    (squares, early.sigma_n, inexact.count())
}

/// Without a table, the drive needs seconds to tell; an event says so once where the errors are large.
#[test]
fn stated_tolerances_count_from_the_beginning_and_those_of_zero_are_exact() {
    let mut sensors = Sensors::builtin("full-bridge-16bit-bending").unwrap();
    let (mut vehicle, calibration) = measured(truth::vehicle(), &sensors, 12);
    let (learnt, _, events) = judged(&vehicle, &sensors, &calibration);
    assert_eq!(events, 0, "less than half of the tolerances");
    let (worse, zeroed) = measured(truth::vehicle(), &sensors, 21);
    assert_eq!(judged(&worse, &sensors, &zeroed).2, 1);
    state(&mut vehicle, &mut sensors);
    let (stated, stated_n, events) = judged(&vehicle, &sensors, &calibration);
    assert_eq!(events, 0);
    vehicle.tolerances = Some(VehicleTolerances {
        hard_points_m: Some(0.0),
        stiffness_fraction: Some(0.0),
        free_length_m: Some(0.0),
        damping_fraction: Some(0.0),
        mass_fraction: Some(0.0),
        cg_m: Some(0.0),
    });
    sensors.tolerances.as_mut().unwrap().gain_fraction = Some(0.0);
    let (zero, zero_n, _) = judged(&vehicle, &sensors, &calibration);
    eprintln!("mean squares {learnt:.2?} learnt, {stated:.2?} stated, {zero:.1?} of zero");
    eprintln!("after 1 s {stated_n:.2?} N stated, {zero_n:.2?} N of zero");
    for axis in 0..2 {
        assert!(stated[axis] < 2.5, "{stated:?}");
        assert!(zero[axis] > 6.0, "{zero:?}");
        assert!(
            stated_n[axis] > 1.5 * zero_n[axis],
            "{stated_n:?} {zero_n:?}"
        );
    }
}

fn quantile(values: impl Iterator<Item = f64>, part: f64) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted[((sorted.len() - 1) as f64 * part).round() as usize]
}

/// Errors and mean squares of 20 workshops, wheel-carrier frame, with a lag of 20 ms: without and with stated
/// tolerances.
#[test]
#[ignore = "minutes; `make campaigns` runs it"]
fn campaign_of_a_workshop() {
    for name in ["c_sine03", "r1_iso_c_a", "r8_trail_a"] {
        let Some(run) = truth::run(name).or_else(|| truth::rough_run(name)) else {
            return;
        };
        for sensors in [
            "thesis-10bit",
            "full-bridge-16bit",
            "full-bridge-16bit-bending",
        ] {
            for stated in [false, true] {
                workshops(run, sensors, stated, 31..51);
            }
        }
    }
}

fn workshops(run: &'static Run, sensors: &str, stated: bool, seeds: Range<u64>) {
    let all: Vec<_> = seeds
        .map(|seed| {
            let lagged = driven(run, sensors, seed, stated, Settings::default()).lagged;
            let errors = scoring::carrier_errors(run, truth::vehicle(), &lagged);
            (errors, scoring::carrier_squares(run, &lagged))
        })
        .collect();
    let errors = |part: f64| -> [f64; 3] {
        std::array::from_fn(|axis| quantile(all.iter().map(|one| one.0[axis]), part))
    };
    let squares = |part: f64| -> [f64; 3] {
        std::array::from_fn(|axis| quantile(all.iter().map(|one| one.1[axis]), part))
    };
    report(&format!(
        "{} {sensors}, tolerances {}: median {:.2?}, 95 % {:.2?}; NEES median {:.2?}, largest {:.2?}",
        run.name,
        if stated { "stated" } else { "not stated" },
        errors(0.5),
        errors(0.95),
        squares(0.5),
        squares(1.0)
    ));
}
