use sample::Wheel;

use super::*;
use crate::tuning::LimitsTuning;

const G: f64 = STANDARD_GRAVITY_M_S2;

fn vehicle() -> Vehicle {
    Vehicle::builtin("prowler").unwrap()
}

fn grip(friction: f64, sigma: f64, utilisation: f64) -> AxleGrip {
    AxleGrip {
        friction: Some(friction),
        friction_sigma: Some(sigma),
        friction_min: 0.9 * friction * utilisation,
        stiffness_factor: 1.0,
        utilisation,
        ..AxleGrip::default()
    }
}

/// A steady left turn on level ground: lateral acceleration over g, lateral force over load of both axles, and
/// load-transfer ratio.
fn turned(limits: &mut LimitsEstimator, y: f64, ratios: [f64; 2], transfer: f64) {
    let vehicle = vehicle();
    let forces = PerWheel::from_fn(|wheel: Wheel| {
        let load_n = vehicle.static_load_n(wheel);
        TyreForce {
            force_n: [0.0, ratios[wheel.index() / 2] * load_n, load_n],
            ..TyreForce::default()
        }
    });
    let motion = Motion {
        velocity_x_m_s: 8.0,
        acceleration_m_s2: [0.0, y * G, 0.0],
        rate_rad_s: [0.0, 0.0, y * G / 8.0],
        ..Motion::default()
    };
    for _ in 0..3000 {
        limits.step(&LimitsInput {
            dt: 0.01,
            motion: &motion,
            load_transfer_ratio: transfer,
            forces: &forces,
        });
    }
}

#[test]
fn an_axle_that_gives_away_force_ends_the_turn_before_its_friction() {
    let t = LimitsTuning::default();
    let mut limits = LimitsEstimator::new(&vehicle(), Some(20.0), &t);
    // The front axle needs 0.55 of its load for 0.45 g.
    turned(&mut limits, 0.45, [0.55, 0.4], 0.55);
    let [front, rear] = [grip(0.7, 0.02, 0.79), grip(0.7, 0.02, 0.57)];
    let found = limits.limits(LogTime(1), [&front, &rear]);
    let tyre = &vehicle().front.tyre;
    let load_n = vehicle().static_load_n(Wheel::FrontLeft);
    let at_load = math::powf(load_n / tyre.reference_load_n, tyre.load_exponent);
    let bend = t.bend * load_n / (tyre.cornering_stiffness_n_rad * at_load);
    let expected = 0.7 * (0.45 / 0.55 - bend * (0.7 - 0.55));
    let left = found.lateral_m_s2;
    assert_eq!(found.limited_by, LimitedBy::FrontGrip);
    assert!(
        (left.value - (expected - 0.45) * G).abs() < 0.05,
        "{left:?}"
    );
    assert!(left.at_least < left.value && left.at_least > left.value - 0.15 * G);
    // v^2/R is the limit, in the present curve and in the set one.
    let speed = found.speed_m_s.value;
    assert!(
        (speed * speed * 0.45 / 64.0 - expected).abs() < 0.01,
        "{speed}"
    );
    let curve = found.curve_speed_m_s.value;
    assert!(
        (curve * curve / 20.0 - expected * G).abs() < 0.05,
        "{curve}"
    );
    let slope = found.side_slope_rad.value;
    assert!((math::tan(slope) - expected).abs() < 0.01, "{slope}");
}

#[test]
fn a_tall_vehicle_tips_before_it_slides() {
    let t = LimitsTuning::default();
    let mut limits = LimitsEstimator::new(&vehicle(), None, &t);
    // At 0.25 g, four fifths of the load have left the inner wheels: it tips at 0.3125 g.
    turned(&mut limits, 0.25, [0.25, 0.25], 0.8);
    let sure = grip(0.5, 0.01, 0.5);
    let found = limits.limits(LogTime(1), [&sure, &sure]);
    assert_eq!(found.limited_by, LimitedBy::Rollover);
    let left = found.lateral_m_s2;
    assert!((left.value - 0.0625 * G).abs() < 0.01 * G, "{left:?}");
    assert!(left.at_least < left.value, "{left:?}");
    assert!(found.curve_radius_m.is_nan() && found.curve_speed_m_s.value.is_nan());
}

#[test]
fn without_friction_the_lower_bound_and_the_reason_are_left() {
    let mut limits = LimitsEstimator::new(&vehicle(), None, &LimitsTuning::default());
    turned(&mut limits, 0.15, [0.15, 0.15], 0.18);
    let unknown = AxleGrip {
        friction_min: 0.2,
        utilisation: 0.21,
        stiffness_factor: 1.0,
        ..AxleGrip::default()
    };
    let found = limits.limits(LogTime(1), [&unknown, &unknown]);
    assert_eq!(found.unknown, Some(LimitsUnknown::Grip));
    assert_eq!(
        found.reason().as_deref(),
        Some("no more than 0.3 of the grip has been used")
    );
    assert!(found.lateral_m_s2.value.is_nan() && found.grade_rad.value.is_nan());
    let least = found.lateral_m_s2.at_least;
    assert!((0.0..0.06 * G).contains(&least), "{least}");
    // Without forces nothing is known.
    let motion = Motion::default();
    let forces = PerWheel::default();
    limits.step(&LimitsInput {
        dt: 0.01,
        motion: &motion,
        load_transfer_ratio: f64::NAN,
        forces: &forces,
    });
    let found = limits.limits(LogTime(1), [&unknown, &unknown]);
    assert_eq!(found.unknown, Some(LimitsUnknown::NoForces));
}

/// Gillespie, *Fundamentals of Vehicle Dynamics*, 1992, section 2: traction of one driven axle on a grade.
#[test]
fn the_driven_axle_limits_the_grade() {
    let mut vehicle = vehicle();
    let body = &vehicle.body;
    let (a, b, h) = (
        body.front_axle_to_cg_m,
        body.cg_to_rear_axle_m,
        body.cg_height_m,
    );
    let l = a + b;
    let climb = |vehicle: &Vehicle, friction: [f64; 2]| {
        math::tan(Climb::new(vehicle).steepest_rad(friction, 1.0))
    };
    vehicle.drivetrain.drive_split_front = 0.0;
    let rear = climb(&vehicle, [f64::NAN, 0.5]);
    assert!((rear - 0.5 * a / (l - 0.5 * h)).abs() < 1e-12, "{rear}");
    vehicle.drivetrain.drive_split_front = 1.0;
    let front = climb(&vehicle, [0.5, f64::NAN]);
    assert!((front - 0.5 * b / (l + 0.5 * h)).abs() < 1e-12, "{front}");
    // Both axles at their limit at once climb as steep as the friction.
    let share = (b - 0.5 * h) / l;
    vehicle.drivetrain.drive_split_front = share;
    let both = climb(&vehicle, [0.5, 0.5]);
    assert!((both - 0.5).abs() < 1e-12, "{both}");
    // With any friction, it falls over backwards at b/h.
    vehicle.drivetrain.drive_split_front = 0.0;
    assert!((climb(&vehicle, [9.0, 9.0]) - b / h).abs() < 1e-12);
    assert!(climb(&vehicle, [0.5, f64::NAN]).is_nan());
}

/// A side slope pushes as a turn does; a bank that helps the turn raises its speed.
#[test]
fn the_bank_counts() {
    let bank = 0.2;
    let standing = Motion {
        roll_rad: bank,
        bank_rad: bank,
        ..Motion::default()
    };
    let [left, up] = specific_force(&standing);
    assert!((left - G * math::sin(bank)).abs() < 1e-12, "{left}");
    assert!((up - G * math::cos(bank)).abs() < 1e-12, "{up}");
}
