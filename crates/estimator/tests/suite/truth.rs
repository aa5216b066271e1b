//! The estimator on an independent simulator's truth runs through the thesis's sensors.

mod alone;
mod locked;
mod parameters;

use atvrec_estimator::{Calibration, Input, Method, Settings};
use model::sensors::Sensors;
use model::vehicle::Vehicle;
use sample::{Axle, Event, EventKind, Sample, Side, Wheel};
use sim::Manoeuvre;
use testkit::drive::virtual_drive;
use testkit::scoring::{
    Estimated, deviations, estimate, force_errors, motion_errors, rate_errors, rms, row,
    slip_errors,
};
use testkit::sensing;
use testkit::truth::{self, RATE_HZ, Run};

use crate::RUNS;

/// Seed of the sensors' noise.
const SEED: u64 = 1;

/// Largest RMSE of sideslip above 3 m/s, of roll and of pitch, degrees.
const MOTION_MAX_DEG: [f64; 3] = [0.2, 0.2, 0.2];
/// Largest RMSE of a wheel's slip angle above 3 m/s, degrees: up to 0.27 on the sines without the
/// body's roll and the linkage's travel.
const SLIP_MAX_DEG: f64 = 0.15;
/// Largest RMSE of an angular rate, degrees a second: the raw gyro's noise is 0.3.
const RATE_MAX_DEG_S: f64 = 0.3;
/// Largest error of the forces by statics alone (F_x, F_y, F_z, per cent, worst tyre).
const STATICS_MAX: [f64; 3] = [3.0, 5.0, 3.5];
/// When the front right wheel's load falls below 2 % of its static load (that of the vehicle file, as
/// `score` has it: the run starts in the turn) in `b_circle`, s.
const LIFT_S: f64 = 51.935;
/// How far from it lift may be declared with a 10-bit potentiometer, s.
const LIFT_WITHIN_S: f64 = 1.2;
/// How long before it a warning must come, s.
const WARNING_S: f64 = 0.8;

/// When the first axle of `d_sine_mu` comes onto the slippery ground, s, and how late that may be
/// said: only saturation tells there.
const SURFACE_S: f64 = 24.0;
const SURFACE_WITHIN_S: f64 = 1.0;
/// The same where the surface changes the slopes, too, s.
const SLOPES_WITHIN_S: f64 = 0.5;
/// Seeds on whose circle sideslip's error passed for another surface, counted but once.
const CIRCLE_SEEDS: [u64; 2] = [3, 5];
/// Largest RMSE of sideslip without any GNSS, degrees.
const BLIND_SIDESLIP_MAX_DEG: f64 = 0.8;

/// Height of the centre of gravity at which the circle ends on two wheels, m, and 2 % of the heavier
/// wheel's static load, N: both wheels of a side below it are off the ground.
const TALL_CG_M: f64 = 0.7;
const TALL_LIFT_N: f64 = 36.6;
/// Estimates a second.
const GRID_HZ: f64 = 100.0;

/// Largest errors F_x, F_y, F_z, per cent, on a sine of 0.7 Hz: a steering wheel whose rate lags is worth
/// half a per cent of F_y.
const QUICK_MAX: [f64; 3] = [1.5, 1.5, 2.1];

/// Length of a drive in which whatever adds up has done so, s.
const LONG_DRIVE_S: f64 = 900.0;

/// Largest errors F_x, F_y, F_z on a slope of 15 %, per cent, with 10-bit and with bending bridges (a
/// linkage for which gravity is not along the slope's normal is 0.18 % off), and of all angles there,
/// degrees.
const HILLSIDE_MAX: [(&str, [f64; 3]); 2] = [
    ("thesis-10bit", [1.0, 0.7, 1.1]),
    ("full-bridge-16bit-bending", [0.3, 0.3, 0.6]),
];
const HILLSIDE_MAX_DEG: f64 = 0.15;
/// The same of the forces that the vehicle model expects: 18, 8 and 14 if it takes the ground for
/// level.
const HILLSIDE_MODEL_MAX: f64 = 9.0;

/// What a locked rear axle's left wheel pushes more than half in the sharpest turn, N, and the
/// largest errors F_x, F_y, F_z, per cent (16.9, 6.7 and 1.4 where the shafts are taken for alike).
const LOCKED_N: f64 = 300.0;
const LOCKED_MAX: [f64; 3] = [1.3, 1.0, 0.9];

/// Runs one sensors file over all runs and holds the fusion filter's errors (F_x, F_y, F_z, per
/// cent, worst tyre) below `force_max` in each, with at least `below_least` of the windows of their
/// normalised squares below the upper bound, run by run.
fn judge_file(file: &str, force_max: [f64; 3], below_least: [f64; 4], lift_within_s: f64) {
    let vehicle = truth::vehicle();
    let sensors = Sensors::builtin(file).unwrap();
    let calibration = Calibration::nominal(&vehicle.name);
    for (name, below_least) in RUNS.into_iter().zip(below_least) {
        let Some(run) = truth::run(name) else { return };
        let samples = run.samples(file, SEED);
        for method in [Method::Thesis, Method::Fusion] {
            let settings = Settings {
                method,
                ..Settings::default()
            };
            let result = estimate(vehicle, &sensors, &calibration, settings, samples);
            let motion = motion_errors(run, &result);
            let force = force_errors(run, vehicle, &result);
            let found = deviations(run, &result);
            eprintln!(
                "{file} {name:15} {method:?}: sideslip, roll, pitch {motion:.3?} deg; \
                 Fx, Fy, Fz {force:.2?} %; NEES {:.2?}, surprise {:.2?}; {:.0} % of windows below the bound",
                found.axes,
                found.surprise,
                100.0 * (1.0 - found.all.above)
            );
            if method == Method::Thesis {
                for (axis, most) in STATICS_MAX.into_iter().enumerate() {
                    assert!(force[axis] <= most, "{name} statics {force:?}");
                }
                continue;
            }
            for (axis, name) in ["sideslip", "roll", "pitch"].iter().enumerate() {
                assert!(motion[axis] <= MOTION_MAX_DEG[axis], "{name} {motion:?}");
            }
            for axis in 0..3 {
                assert!(force[axis] <= force_max[axis], "{name} {force:?}");
            }
            assert!(
                1.0 - found.all.above >= below_least,
                "{name} {:?}",
                found.all
            );
            let rate = rate_errors(run, &result);
            eprintln!("{file} {name:15} rates {rate:.3?} deg/s");
            assert!(
                rate.iter().all(|error| *error <= RATE_MAX_DEG_S),
                "{rate:?}"
            );
            let others = [
                alone::model(&result),
                alone::deflection(vehicle, &sensors, samples, &result),
                alone::thesis(vehicle, &sensors, samples),
            ];
            let others = others.map(|other| force_errors(run, vehicle, &other));
            eprintln!("{file} {name:15} model, deflection, thesis alone {others:.2?} %");
            for (axis, found) in force.iter().enumerate() {
                // An error of zero is a force that the method does not tell.
                let told = others
                    .iter()
                    .map(|other| other[axis])
                    .filter(|other| *other > 0.0);
                let best = told.fold(f64::INFINITY, f64::min);
                // On flat ground the statics tell the load as well as the filter does.
                let better = if axis == 2 { 0.7 } else { 1.5 };
                assert!(better * found <= best, "{name} {force:?} {others:?}");
            }
            let slip = slip_errors(run, &result);
            eprintln!("{name:15} slip angles {slip:.3?} deg");
            assert!(
                slip.iter().all(|error| *error <= SLIP_MAX_DEG),
                "{name}: {slip:?}"
            );
            judge_events(name, &result, lift_within_s);
            let settings = Settings {
                ignore: vec![Input::GnssVelocity, Input::GnssAttitude],
                ..Settings::default()
            };
            let result = estimate(vehicle, &sensors, &calibration, settings, samples);
            let motion = motion_errors(run, &result);
            eprintln!("{name:15} without GNSS: sideslip, roll, pitch {motion:.3?} deg");
            assert!(motion[0] <= BLIND_SIDESLIP_MAX_DEG, "{name}: {motion:?}");
        }
    }
}

/// Lift is declared and warned of in time, a change of surface is found, and nothing else.
fn judge_events(name: &str, result: &Estimated, within_s: f64) {
    let seconds = |event: &Event| event.time.seconds_since(sensing::START);
    let mut change = None;
    let mut lift = None;
    let mut warning = None;
    for event in &result.events {
        match event.kind {
            EventKind::Lift(Wheel::FrontRight) => lift = lift.or(Some(seconds(event))),
            EventKind::LiftWarning(Wheel::FrontRight, _) => {
                warning = warning.or(Some(seconds(event)));
            }
            EventKind::SurfaceChange(_, ratio) => {
                let time_s = seconds(event);
                eprintln!("{name}: at {time_s:.2} s {}", event.text);
                let expected = name == "d_sine_mu" && time_s >= SURFACE_S && ratio < 1.0;
                assert!(expected, "{name}: false alarm {event:?}");
                change = change.or(Some(time_s));
            }
            _ => panic!("{name}: false alarm {event:?}"),
        }
    }
    eprintln!("{name}: warned at {warning:.2?} s, lift declared at {lift:.2?} s");
    if name == "d_sine_mu" {
        assert!(
            change.unwrap() - SURFACE_S <= SURFACE_WITHIN_S,
            "{change:?}"
        );
    }
    if name == "b_circle" {
        assert!((lift.unwrap() - LIFT_S).abs() <= within_s, "{lift:?}");
        assert!(warning.unwrap() <= LIFT_S - WARNING_S, "{warning:?}");
    } else {
        assert!(lift.is_none() && warning.is_none(), "{name}: false alarm");
    }
}

#[test]
fn ten_bit_sensors_meet_their_floors() {
    judge_file("thesis-10bit", [1.2, 0.9, 0.65], [0.9; 4], LIFT_WITHIN_S);
}

#[test]
fn sixteen_bit_full_bridges_meet_their_floors() {
    let below_least = [0.9, 0.85, 0.9, 0.4];
    judge_file(
        "full-bridge-16bit",
        [0.3, 0.25, 0.65],
        below_least,
        LIFT_WITHIN_S,
    );
}

#[test]
fn bending_bridges_meet_their_floors() {
    let below_least = [0.9, 0.5, 0.6, 0.2];
    let force_max = [0.2, 0.23, 0.42];
    judge_file("full-bridge-16bit-bending", force_max, below_least, 0.15);
}

/// What the estimator makes of a virtual drive through the sensors of a file that ships.
fn through(file: &str, vehicle: &Vehicle, run: &Run, seed: u64) -> Estimated {
    let sensors = Sensors::builtin(file).unwrap();
    let samples = sensing::samples(run, vehicle, &sensors, seed);
    estimated(file, vehicle, &samples)
}

fn estimated(file: &str, vehicle: &Vehicle, samples: &[Sample]) -> Estimated {
    let sensors = Sensors::builtin(file).unwrap();
    let calibration = Calibration::nominal(&vehicle.name);
    let settings = Settings::default();
    estimate(vehicle, &sensors, &calibration, settings, samples)
}

#[test]
fn hanging_wheels_of_a_jacked_vehicle_are_no_alarm() {
    let vehicle = truth::vehicle();
    let Some(run) = truth::run("h_jack") else {
        return;
    };
    // While stands carry a part of the weight, the balance of all forces does not hold; finer
    // bridges are more surprised by the touchdown, and must not be by what they were set free to do.
    for (file, seed, most) in [
        ("thesis-10bit", 1, 3.2),
        ("full-bridge-16bit-bending", 2, 1.2),
    ] {
        let result = estimated(file, vehicle, run.samples(file, seed));
        let force = force_errors(run, vehicle, &result);
        eprintln!("h_jack {file} Fx, Fy, Fz {force:.2?} %");
        assert!(result.events.is_empty(), "{file} {:?}", result.events);
        assert!(force.iter().all(|error| *error <= most), "{file} {force:?}");
    }
}

/// What little the model is wrong by for long must not end up in the strain channels' offsets.
#[test]
fn forces_and_deviations_hold_on_a_long_drive() {
    let vehicle = Vehicle::builtin("prowler").unwrap();
    let run = virtual_drive(&vehicle, Manoeuvre::MixedDriving, LONG_DRIVE_S);
    let result = through("thesis-10bit", &vehicle, &run, SEED);
    let force = force_errors(&run, &vehicle, &result);
    let found = deviations(&run, &result);
    let (axes, below) = (found.axes, 1.0 - found.all.above);
    eprintln!("Fx, Fy, Fz {force:.2?} %, NEES {axes:.2?}, {below:.3} of windows below the bound");
    assert!(force.iter().all(|error| *error < 1.1), "{force:?}");
    assert!(
        below > 0.95,
        "{below} of windows below the bound, NEES {axes:?}"
    );
    assert!(result.events.is_empty(), "{:?}", result.events);
}

/// Circles on a slope of 15 %: bank and grade change with the heading and are separated from the body's
/// own roll and pitch. They cause no force error and no event.
#[test]
fn a_hillside_is_no_roll_and_no_force() {
    let vehicle = Vehicle::builtin("prowler").unwrap();
    let run = virtual_drive(&vehicle, Manoeuvre::Hillside, 0.0);
    for (file, force_max) in HILLSIDE_MAX {
        let result = through(file, &vehicle, &run, SEED);
        let force = force_errors(&run, &vehicle, &result);
        let model = force_errors(&run, &vehicle, &alone::model(&result));
        let motion = motion_errors(&run, &result);
        let [bank, grade] = [0, 1].map(|i| {
            let truth = run.column(["bank", "grade"][i]);
            rms(result.estimates.iter().filter_map(|estimate| {
                let row = row(estimate);
                let value = [estimate.motion.bank_rad, estimate.motion.grade_rad][i];
                (row > 600 && row < truth.len()).then(|| (value - truth[row]).to_degrees())
            }))
        });
        eprintln!(
            "hillside, {file}: Fx, Fy, Fz {force:.2?} %, by the model {model:.1?} %; sideslip, \
             roll, pitch {motion:.3?}, bank {bank:.3}, grade {grade:.3} deg"
        );
        for (error, most) in force.iter().zip(force_max) {
            assert!(*error < most, "{file} {force:?}");
        }
        assert!(
            model.iter().all(|error| *error < HILLSIDE_MODEL_MAX),
            "{file} {model:?}"
        );
        for error in motion.into_iter().chain([bank, grade]) {
            assert!(error < HILLSIDE_MAX_DEG, "{file} {motion:?} {bank} {grade}");
        }
        assert!(result.events.is_empty(), "{file} {:?}", result.events);
    }
}

/// Of a tall vehicle on the circle first one wheel of the inner side leaves the ground, then both,
/// and it tips over.
#[test]
fn a_vehicle_that_tips_over_is_warned_of() {
    let mut vehicle = Vehicle::builtin("prowler").unwrap();
    vehicle.body.cg_height_m = TALL_CG_M;
    let run = virtual_drive(&vehicle, Manoeuvre::Circle, 0.0);
    let result = through("thesis-10bit", &vehicle, &run, SEED);
    let loads = ["FL", "RL"].map(|wheel| run.column(&format!("{wheel}_Fz")));
    let up = |row: &usize| loads.iter().all(|load| load[*row] < TALL_LIFT_N);
    let lift_s = (0..run.rows).find(up).unwrap() as f64 / RATE_HZ;
    let (mut warned_s, mut declared_s) = (None, None);
    for event in &result.events {
        let at_s = event.time.seconds_since(sensing::START);
        match event.kind {
            EventKind::TwoWheelLiftWarning(Side::Left, lead_s) => {
                eprintln!("{:.2} s ahead: {}", lift_s - at_s, event.text);
                // A warning may name too early a time, not one that is past. Of a load that does not
                // fall it names none.
                let names_past = lead_s.is_finite() && at_s + lead_s - lift_s > 1.0;
                assert!(!names_past && lift_s - at_s < 6.0, "{lead_s} s told");
                warned_s = Some(at_s);
            }
            EventKind::TwoWheelLift(Side::Left) => {
                eprintln!("{:.2} s after: {}", at_s - lift_s, event.text);
                assert!(event.load_transfer_ratio.unwrap() > 0.95, "{event:?}");
                declared_s = Some(at_s);
            }
            EventKind::LiftWarning(wheel, _)
            | EventKind::Lift(wheel)
            | EventKind::Touchdown(wheel)
                if wheel.is_left() => {}
            _ => panic!("false alarm {event:?}"),
        }
    }
    assert!(warned_s.unwrap() < lift_s - WARNING_S, "{warned_s:?}");
    assert!((declared_s.unwrap() - lift_s).abs() < 1.0, "{declared_s:?}");
    let tells = |time_s: f64| {
        let row = (time_s * GRID_HZ).round() as usize;
        result.estimates[row].rollover
    };
    let (early, late) = (tells(2.0), tells(lift_s + 0.3));
    assert!(early.load_transfer_ratio.abs() < 0.3, "{early:?}");
    assert!(early.time_to_two_wheel_lift_s[0] > 5.0, "{early:?}");
    let sure = (late.load_transfer_ratio - 1.0).abs() < 3.0 * late.load_transfer_ratio_sigma;
    assert!(sure && late.time_to_two_wheel_lift_s[0] == 0.0, "{late:?}");
}

/// A quick sine, in which the tyres' forces lag behind their slip, is no change of surface; gravel,
/// which takes stiffness as well as friction, is one; the forces follow the sine. Nor is asphalt that
/// is stiffer than the file has it, whose stiffness is found while sideslip's error lasts, nor the
/// slow sine of a vehicle that rolls so far that its inner wheels leave the ground.
#[test]
fn a_change_of_surface_is_told_from_a_lag() {
    let vehicle = Vehicle::builtin("prowler").unwrap();
    let quick = virtual_drive(&vehicle, Manoeuvre::FastSine, 0.0);
    let mut result = through("thesis-10bit", &vehicle, &quick, SEED);
    // Quick steering contradicts exact parameters.
    (result.events).retain(|event| !matches!(event.kind, EventKind::InexactParameters(_)));
    assert!(result.events.is_empty(), "{:?}", result.events);
    let force = force_errors(&quick, &vehicle, &result);
    eprintln!("quick sine: Fx, Fy, Fz {force:.2?} %");
    for (error, most) in force.iter().zip(QUICK_MAX) {
        assert!(*error < most, "{force:?}");
    }
    let other = |event: &&Event| matches!(event.kind, EventKind::SurfaceChange(..));
    let circle = virtual_drive(&vehicle, Manoeuvre::Circle, 0.0);
    for seed in CIRCLE_SEEDS {
        let events = through("thesis-10bit", &vehicle, &circle, seed).events;
        assert_eq!(events.iter().find(other), None, "seed {seed}");
    }
    let soft = truth::vehicle();
    let sine = virtual_drive(soft, Manoeuvre::SlowSine, 0.0);
    let events = through("thesis-10bit", soft, &sine, SEED).events;
    assert_eq!(events.iter().find(other), None);
    let run = virtual_drive(&vehicle, Manoeuvre::AsphaltToGravel, 0.0);
    let events = through("thesis-10bit", &vehicle, &run, SEED).events;
    assert_eq!(events.len(), 2, "{events:?}");
    for (event, (axle, wheel)) in events.iter().zip([(Axle::Front, "FL"), (Axle::Rear, "RL")]) {
        let friction = run.column(&format!("{wheel}_mu"));
        let onto = friction.iter().position(|mu| *mu < 0.6 * friction[0]);
        let line_s = onto.unwrap() as f64 / RATE_HZ;
        let late_s = event.time.seconds_since(sensing::START) - line_s;
        eprintln!("{late_s:.2} s late: {}", event.text);
        assert!(
            matches!(event.kind, EventKind::SurfaceChange(of, ratio) if of == axle && ratio < 0.9)
        );
        assert!((0.0..SLOPES_WITHIN_S).contains(&late_s), "{late_s}");
    }
}

/// Behind locked differentials the half-shafts of an axle differ by what the turn calls for.
#[test]
fn locked_differentials_are_learnt() {
    let vehicle = truth::vehicle();
    let Some(run) = truth::run("c_sine03") else {
        return;
    };
    let mut run = run.clone();
    let steering_wheel = run.column("handwheel").to_vec();
    let largest = steering_wheel
        .iter()
        .fold(0.0_f64, |most, angle| most.max(angle.abs()));
    locked::lock_axles(&mut run, vehicle, |row| {
        LOCKED_N * steering_wheel[row] / largest
    });
    for file in ["thesis-10bit", "full-bridge-16bit"] {
        let result = through(file, vehicle, &run, SEED);
        let force = force_errors(&run, vehicle, &result);
        let found = deviations(&run, &result);
        eprintln!(
            "locked, {file}: Fx, Fy, Fz {force:.2?} %, NEES {:.2?}, {:.2} inside",
            found.axes, found.all.inside
        );
        assert!(result.events.is_empty(), "{file} {:?}", result.events);
        for (error, most) in force.iter().zip(LOCKED_MAX) {
            assert!(*error < most, "{file} {force:?}");
        }
    }
}
