//! What the model drives is what the manoeuvre's name says, and it obeys Newton.

use atvrec_sim::{Manoeuvre, Motion, TruthState};
use nalgebra::Vector3;
use sample::{STANDARD_GRAVITY_M_S2, Wheel};

use crate::support::vehicle;

fn drive(manoeuvre: Manoeuvre) -> Motion {
    let motion = manoeuvre.drive(&vehicle()).expect("a motion");
    for state in motion.states() {
        let numbers = [state.velocity_body_m_s, state.rate_rad_s, state.position_m];
        assert!(numbers.iter().flatten().all(|x| x.is_finite()), "{state:?}");
        for wheel in &state.wheels.0 {
            assert!(wheel.link_force_n.iter().all(|f| f.is_finite()));
            assert!((0.30..0.43).contains(&wheel.strut_length_m));
            assert!(wheel.ball_normal_n.is_finite() && wheel.force_n[2] >= 0.0);
        }
    }
    motion
}

/// Greatest difference between the tyre forces' sum and mass times acceleration, level axes, N.
/// The specific force is that of a body that has turned with its springs by then.
const NEWTON_TOLERANCE_N: f64 = 25.0;

fn check_newton(state: &TruthState) {
    let earth_from_body = state.earth_from_body();
    let (sin_yaw, cos_yaw) = math::sin_cos(state.yaw_rad);
    let earth = earth_from_body * Vector3::from(state.acceleration_m_s2);
    let upwards = earth[2] + STANDARD_GRAVITY_M_S2;
    let level = [
        cos_yaw * earth[0] + sin_yaw * earth[1],
        cos_yaw * earth[1] - sin_yaw * earth[0],
    ];
    let mass_kg = vehicle().body.mass_kg;
    let (mut sum, mut load_n) = ([0.0; 2], 0.0);
    for wheel in &state.wheels.0 {
        let (sin, cos) = math::sin_cos(wheel.steer_rad);
        let [x, y, z] = wheel.force_n;
        sum[0] += x * cos - y * sin;
        sum[1] += x * sin + y * cos;
        load_n += z;
    }
    for axis in 0..2 {
        let error = sum[axis] - mass_kg * level[axis];
        assert!(
            error.abs() < NEWTON_TOLERANCE_N,
            "{} s, axis {axis}: {error} N",
            state.time_s
        );
    }
    // Wheels rise and sink against the body.
    let error = load_n - mass_kg * upwards;
    assert!(
        error.abs() < 2.0 * NEWTON_TOLERANCE_N,
        "{} s, upwards: {error} N",
        state.time_s
    );
}

#[test]
fn a_circle_has_its_radius_and_rolls_to_the_right() {
    let motion = drive(Manoeuvre::Circle);
    for time_s in [20.0, 35.0, 50.0] {
        let state = motion.at(time_s);
        let [vx, vy, _] = state.velocity_body_m_s;
        let radius_m = math::hypot(vx, vy) / state.rate_rad_s[2];
        assert!((radius_m - 15.24).abs() < 0.5, "{radius_m} m at {time_s} s");
        assert!(state.roll_rad > 0.03 && state.acceleration_m_s2[1] > 2.0);
        let load_n = |wheel: Wheel| state.wheels[wheel].force_n[2];
        assert!(load_n(Wheel::FrontRight) > load_n(Wheel::FrontLeft));
        check_newton(&state);
    }
    let speed_m_s = motion.at(53.0).velocity_body_m_s[0];
    assert!((9.5..9.9).contains(&speed_m_s), "{speed_m_s} m/s");
}

#[test]
fn the_circle_ends_with_the_inner_front_wheel_in_the_air() {
    let motion = drive(Manoeuvre::Circle);
    let lifted = |state: &&TruthState| state.wheels[Wheel::FrontLeft].force_n[2] == 0.0;
    let since_s = motion.states().iter().find(lifted).expect("a lift").time_s;
    assert!((40.0..51.0).contains(&since_s), "{since_s} s");
    let (end, droop_stop_m) = (motion.at(53.5), vehicle().front.strut);
    let wheel = &end.wheels[Wheel::FrontLeft];
    assert_eq!(wheel.force_n, [0.0; 3]);
    let droop_stop_m = droop_stop_m.expect("a strut").droop_stop_length_m;
    assert!(wheel.strut_length_m > droop_stop_m, "the wheel hangs");
    for other in [Wheel::FrontRight, Wheel::RearLeft, Wheel::RearRight] {
        assert!(end.wheels[other].force_n[2] > 100.0, "{other}");
    }
    // The body does not jerk as the wheel leaves the ground.
    let around = motion.states().iter();
    let roll_rate = around
        .filter(|state| (state.time_s - since_s).abs() < 0.5)
        .map(|state| state.rate_rad_s[0].abs());
    assert!(roll_rate.fold(0.0, f64::max) < 0.1);
}

#[test]
fn sines_have_their_frequencies() {
    for (manoeuvre, frequency_hz) in [(Manoeuvre::SlowSine, 0.3), (Manoeuvre::FastSine, 0.7)] {
        let motion = drive(manoeuvre);
        let rising =
            |a: &TruthState, b: &TruthState| a.rate_rad_s[2] < 0.0 && b.rate_rad_s[2] >= 0.0;
        let crossings: Vec<f64> = motion
            .states()
            .windows(2)
            .filter(|pair| rising(&pair[0], &pair[1]))
            .map(|pair| pair[1].time_s)
            .filter(|time_s| (3.0..12.0).contains(time_s))
            .collect();
        let period_s =
            (crossings[crossings.len() - 1] - crossings[0]) / (crossings.len() - 1) as f64;
        assert!((period_s * frequency_hz - 1.0).abs() < 0.02, "{period_s} s");
        motion
            .states()
            .iter()
            .skip(400)
            .step_by(50)
            .for_each(check_newton);
    }
}

#[test]
fn gravel_takes_the_grip_away_axle_by_axle() {
    let motion = drive(Manoeuvre::AsphaltToGravel);
    let asphalt = vehicle().front.tyre.friction;
    let reached = |wheel: Wheel| {
        let on_gravel = |s: &&TruthState| s.wheels[wheel].friction < 0.6 * asphalt;
        motion
            .states()
            .iter()
            .find(on_gravel)
            .expect("gravel")
            .time_s
    };
    let (front_s, rear_s) = (reached(Wheel::FrontLeft), reached(Wheel::RearLeft));
    // 1.45 m of wheelbase at about 8 m/s.
    assert!(
        (0.15..0.21).contains(&(rear_s - front_s)),
        "{front_s} {rear_s}"
    );
    let peak = |from_s: f64, to_s: f64| {
        let inside = |s: &&TruthState| (from_s..to_s).contains(&s.time_s);
        let states = motion.states().iter().filter(inside);
        states
            .map(|s| s.acceleration_m_s2[1].abs())
            .fold(0.0, f64::max)
    };
    assert!(peak(13.5, 20.0) < 0.9 * peak(4.0, front_s));
}

#[test]
fn launch_pitches_up_and_braking_down() {
    let motion = drive(Manoeuvre::LaunchBrake);
    let (launch, brake) = (motion.at(4.0), motion.at(10.0));
    assert!(launch.pitch_rad < -0.02 && launch.acceleration_m_s2[0] > 2.5);
    assert!(brake.pitch_rad > 0.04 && brake.acceleration_m_s2[0] < -4.0);
    let fastest = motion
        .states()
        .iter()
        .map(|s| s.velocity_body_m_s[0])
        .fold(0.0, f64::max);
    assert!((14.0..16.0).contains(&fastest), "{fastest} m/s");
    [launch, brake].iter().for_each(check_newton);
}

/// Slip that does not relax is stiff near rest: a step too long for it rings, and accelerometers
/// feel forces that move nothing.
#[test]
fn a_vehicle_whose_tyres_do_not_relax_stands_still() {
    let mut vehicle = vehicle();
    for axle in [&mut vehicle.front, &mut vehicle.rear] {
        axle.tyre.relaxation_length_m = 0.0;
    }
    let motion = Manoeuvre::LaunchBrake.drive(&vehicle).expect("a motion");
    for state in motion.states().iter().filter(|state| state.time_s < 0.9) {
        let [ahead, _, _] = state.specific_force_m_s2;
        let weight = -STANDARD_GRAVITY_M_S2 * math::sin(state.pitch_rad);
        assert!((ahead - weight).abs() < 0.02, "{} s: {ahead}", state.time_s);
    }
    for time_s in [2.5, 4.0, 10.0] {
        check_newton(&motion.at(time_s));
    }
}

/// The tread's overturning moment turns the body as much as it pulls at the links: roll and load
/// transfer follow from it.
#[test]
fn a_wide_tread_takes_roll_moment_from_the_springs() {
    let narrow = drive(Manoeuvre::Circle);
    let mut vehicle = vehicle();
    for axle in [&mut vehicle.front, &mut vehicle.rear] {
        axle.tyre.width_m = 0.25;
    }
    let wide = Manoeuvre::Circle.drive(&vehicle).expect("a motion");
    let transfer = |motion: &Motion| {
        let wheels = &motion.at(30.0).wheels;
        let load_n = |wheel: Wheel| wheels[wheel].force_n[2];
        load_n(Wheel::FrontRight) + load_n(Wheel::RearRight)
            - load_n(Wheel::FrontLeft)
            - load_n(Wheel::RearLeft)
    };
    let [narrow, wide] = [transfer(&narrow), transfer(&wide)];
    assert!(
        wide > 20.0 + 0.5 * narrow && wide < narrow - 20.0,
        "{narrow} {wide}"
    );
}

#[test]
fn a_step_settles() {
    let motion = drive(Manoeuvre::StepSteer);
    let (turning, straight) = (motion.at(4.8), motion.at(7.5));
    assert!(turning.rate_rad_s[2] > 0.2 && turning.acceleration_m_s2[1] > 2.5);
    assert!(straight.rate_rad_s[2].abs() < 0.01);
}

#[test]
fn on_jackstands_the_wheels_hang_and_then_carry() {
    let motion = drive(Manoeuvre::Jackstand);
    let load_n = |time_s: f64, wheel: Wheel| motion.at(time_s).wheels[wheel].force_n[2];
    for wheel in Wheel::ALL {
        assert_eq!(load_n(3.0, wheel), 0.0);
        let axle = vehicle();
        let strut = if wheel.is_front() {
            axle.front.strut
        } else {
            axle.rear.strut
        };
        let hanging_m = motion.at(3.0).wheels[wheel].strut_length_m;
        assert!(
            hanging_m > strut.expect("a strut").droop_stop_length_m,
            "on the droop stop"
        );
    }
    assert_eq!(load_n(11.0, Wheel::RearLeft), 0.0);
    assert!(load_n(11.0, Wheel::FrontLeft) > 1_000.0);
    let weight_n: f64 = Wheel::ALL.map(|wheel| load_n(39.0, wheel)).iter().sum();
    assert!((weight_n / (vehicle().body.mass_kg * STANDARD_GRAVITY_M_S2) - 1.0).abs() < 1e-6);
    let rest = motion.at(39.0);
    assert!(rest.specific_force_m_s2[0].abs() < 0.1 && rest.roll_rad.abs() < 1e-3);
}

#[test]
fn vehicles_without_hard_points_drive_too() {
    for name in ["prowler-chang", "prowler-table-2.3"] {
        let vehicle = model::vehicle::Vehicle::builtin(name).expect("a built-in vehicle");
        let motion = Manoeuvre::StepSteer.drive(&vehicle).expect("a motion");
        let turning = motion.at(4.8);
        assert!(turning.acceleration_m_s2[1] > 2.0, "{name}");
        // Only one of them has struts; in a left turn the right one is shorter.
        let length_m = |wheel: Wheel| turning.wheels[wheel].strut_length_m;
        let told = length_m(Wheel::RearLeft) > length_m(Wheel::RearRight) + 0.005;
        assert_eq!(told, vehicle.rear.strut.is_some(), "{name}");
    }
}

/// On a slope of 15 % the tyres carry what gravity and the path call for, along all axes of the
/// ground, and bank and grade go round with the heading.
#[test]
fn a_hillside_is_circled_by_newtons_laws() {
    let motion = drive(Manoeuvre::Hillside);
    let mut seen = [[0.0_f64; 2]; 2];
    for time_s in (1..28).map(|k| 2.0 * f64::from(k)) {
        let state = motion.at(time_s);
        let level = TruthState {
            roll_rad: state.roll_rad - state.bank_rad,
            pitch_rad: state.pitch_rad - state.grade_rad,
            yaw_rad: 0.0,
            ..state
        };
        let mass_kg = vehicle().body.mass_kg;
        let felt = level.earth_from_body() * Vector3::from(state.specific_force_m_s2) * mass_kg;
        let mut pushed = [0.0; 3];
        for wheel in &state.wheels.0 {
            let (sin, cos) = math::sin_cos(wheel.steer_rad);
            let [x, y, z] = wheel.force_n;
            pushed[0] += x * cos - y * sin;
            pushed[1] += x * sin + y * cos;
            pushed[2] += z;
        }
        for axis in 0..3 {
            let error = pushed[axis] - felt[axis];
            assert!(
                error.abs() < 2.0 * NEWTON_TOLERANCE_N,
                "{time_s} s, axis {axis}: {error} N"
            );
        }
        for (seen, now) in seen.iter_mut().zip([state.bank_rad, state.grade_rad]) {
            *seen = [seen[0].min(now), seen[1].max(now)];
        }
    }
    for [least, most] in seen {
        assert!((least + 0.15).abs() < 0.01 && (most - 0.15).abs() < 0.01);
    }
}

#[test]
fn mixed_driving_ends_as_it_begins() {
    let motion = drive(Manoeuvre::MixedDriving);
    let [first, last] = [0.0, 60.0].map(|time_s| motion.at(time_s));
    assert!((motion.duration_s() - 60.0).abs() < 0.01);
    assert!((first.velocity_body_m_s[0] - last.velocity_body_m_s[0]).abs() < 0.05);
    for axis in 0..3 {
        assert!((first.rate_rad_s[axis] - last.rate_rad_s[axis]).abs() < 1e-3);
    }
    for (a, b) in first.wheels.0.iter().zip(&last.wheels.0) {
        for axis in 0..3 {
            assert!(
                (a.force_n[axis] - b.force_n[axis]).abs() < 15.0,
                "{a:?} {b:?}"
            );
        }
        assert!((a.strut_length_m - b.strut_length_m).abs() < 2e-4);
    }
    let laps = motion.repeated(3);
    assert!((laps.duration_s() - 180.0).abs() < 0.01);
    let (before, after) = (laps.at(119.99), laps.at(120.01));
    let step_m = (0..2)
        .map(|i| (after.position_m[i] - before.position_m[i]).powi(2))
        .sum::<f64>()
        .sqrt();
    assert!(
        (step_m - 0.16).abs() < 0.01,
        "8 m/s across the seam: {step_m} m"
    );
}
