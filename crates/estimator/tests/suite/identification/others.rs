//! Understeer, roll and pitch, response, tyre and inertia.

use atvrec_estimator::finding::{Findings, Refusal};
use atvrec_estimator::identification::{
    Drive, inertia, response, roll_centre, roll_pitch, tyre, understeer,
};
use atvrec_estimator::regression::least_squares;
use model::chassis::four_wheel::Parameters;
use model::tyre::{Contact, Tyre};
use model::vehicle::Vehicle;
use nalgebra::{DMatrix, DVector};
use sample::Wheel;

use super::rides::{self, DT_S, Noise};
use crate::coverage;

fn near(found: &Findings, name: &str, truth: f64, part: f64) {
    let [value, sigma] = found.value(name);
    println!("{name} {value:.5} +- {sigma:.5} of {truth:.5}");
    assert!(
        (value / truth - 1.0).abs() < part,
        "{name}: {value} of {truth}"
    );
}

/// Two-wheel model's m (b/C_f - a/C_r)/L, rad/(m/s^2).
fn gradient(vehicle: &Vehicle) -> f64 {
    let (body, length) = (&vehicle.body, vehicle.wheelbase_m());
    let axle = |tyre: &model::vehicle::Tyre, wheel| {
        let load = vehicle.static_load_n(wheel);
        2.0 * tyre.cornering_stiffness_n_rad
            * math::powf(load / tyre.reference_load_n, tyre.load_exponent)
    };
    let (a, b) = (body.front_axle_to_cg_m, body.cg_to_rear_axle_m);
    let front = axle(&vehicle.front.tyre, Wheel::FrontLeft);
    let rear = axle(&vehicle.rear.tyre, Wheel::RearLeft);
    body.mass_kg / length * (b / front - a / rear)
}

/// The model's circle of 15 m: speed rises while the steer angle that keeps the path is read off
/// the model itself.
fn circle(vehicle: &Vehicle) -> Drive {
    let speed = |t: f64| 2.5 + 0.1 * t;
    rides::drive(vehicle, 40.0, speed, |t| held(vehicle, speed(t)))
}

/// Steer angle that keeps the two-wheel model on the circle.
fn held(vehicle: &Vehicle, speed_m_s: f64) -> f64 {
    (vehicle.wheelbase_m() + gradient(vehicle) * speed_m_s.powi(2)) / 15.0
}

/// The circle to the left, then to the right, both from walking pace.
fn both_circles(vehicle: &Vehicle) -> Drive {
    let speed = |t: f64| {
        let slowing = (t - 40.0).clamp(0.0, 4.0);
        2.5 + 0.1 * (t - slowing) - slowing
    };
    let side = |t: f64| (42.0 - t).clamp(-1.0, 1.0);
    rides::drive(vehicle, 84.0, speed, |t| side(t) * held(vehicle, speed(t)))
}

/// The four-wheel model's tyres have no trail.
fn trailless() -> understeer::Body {
    let mut body = understeer::Body::of(&rides::vehicle());
    body.axles.trail_m = [0.0; 2];
    body
}

fn understeer_of(drive: &Drive) -> Findings {
    understeer::identify(drive, &trailless(), &understeer::Options::default()).expect("a circle")
}

/// Slope of the steer angle beyond Ackermann's where lateral acceleration is small, by a polynomial
/// without regard to what bends it.
fn slope_of(clean: &Drive) -> f64 {
    let length_m = rides::vehicle().wheelbase_m();
    let rows: Vec<[f64; 2]> = (0..clean.rows())
        .map(|row| {
            let curvature = clean.yaw_rate_rad_s[row] / clean.speed_m_s[row];
            let beyond = clean.steer_rad[row] - math::atan(length_m * curvature);
            [clean.lateral_m_s2[row], beyond]
        })
        .filter(|[lateral, _]| (0.45..1.6).contains(lateral))
        .collect();
    let design = DMatrix::from_fn(rows.len(), 3, |row, power| {
        rows[row][0].powi([0, 1, 3][power])
    });
    let beyond = DVector::from_iterator(rows.len(), rows.iter().map(|row| row[1]));
    let fit = least_squares(&design, &beyond).expect("rises");
    fit.coefficients[1]
}

const OFFSET_RAD: f64 = 0.01;

#[test]
fn circles_to_both_sides_tell_the_offset_from_the_gradient() {
    let vehicle = rides::vehicle();
    let clean = both_circles(&vehicle);
    for seed in 0..5 {
        let found = understeer_of(&rides::as_measured(&clean, OFFSET_RAD, seed));
        near(&found, "understeer_gradient", slope_of(&clean), 0.1);
        near(&found, "steer_offset", OFFSET_RAD, 0.1);
        assert!(found.notes.is_empty(), "{:?}", found.notes);
    }
}

/// How often the intervals hold what the drive gives without noise, on ground whose grip is not the
/// vehicle file's.
fn understeer_holds(clean: &Drive, seeds: std::ops::Range<u64>) {
    let exact = understeer_of(clean);
    let truths = ["understeer_gradient", "steer_offset", "roll_gradient"];
    let truths = truths.map(|name| (name, exact.value(name)[0]));
    coverage::covers(seeds, &truths, |seed| {
        let grip = (1.0 + 0.3 * Noise::new(seed).normal()).max(0.1).recip();
        let mut body = trailless();
        body.axles.grip_n = body.axles.grip_n.map(|grip_n| grip * grip_n);
        let drive = rides::as_measured(clean, 0.0, 700 + seed);
        understeer::identify(&drive, &body, &understeer::Options::default()).expect("a circle")
    });
}

#[test]
fn intervals_of_circles_hold() {
    understeer_holds(&both_circles(&rides::vehicle()), 0..30);
}

#[test]
#[ignore = "200 seeds: `make campaigns`"]
fn intervals_of_200_circles_hold() {
    understeer_holds(&both_circles(&rides::vehicle()), 0..200);
    understeer_holds(&circle(&rides::vehicle()), 0..200);
}

#[test]
fn the_understeer_gradient_is_the_slope_at_small_lateral_acceleration() {
    let vehicle = rides::vehicle();
    let clean = circle(&vehicle);
    let found = understeer_of(&rides::as_measured(&clean, OFFSET_RAD, 1));
    near(&found, "understeer_gradient", slope_of(&clean), 0.1);
    assert!(found.notes.iter().any(|note| note.contains("to one side")));
    let roll = found.value("roll_gradient")[0];
    let parameters = Parameters::from_vehicle(&vehicle);
    let lever = parameters.sprung_mass_kg * parameters.roll_arm_m;
    let stiffness =
        parameters.front.roll_stiffness_n_m_rad + parameters.rear.roll_stiffness_n_m_rad;
    let truth = lever / (stiffness - lever * parameters.gravity_m_s2);
    assert!((roll / truth - 1.0).abs() < 0.05, "{roll} {truth}");
    let straight = rides::drive(&vehicle, 20.0, |_| 8.0, |_| 0.0);
    let sides = understeer::Body::of(&vehicle);
    let refusal = understeer::identify(&straight, &sides, &understeer::Options::default());
    assert!(matches!(
        refusal,
        Err(Refusal::NotExcited { .. } | Refusal::TooShort { .. })
    ));
}

/// The four-wheel model has no linkage: its springs are lumped and its wheels upright.
fn roll_body(vehicle: &Vehicle) -> roll_pitch::Body {
    let mut vehicle = vehicle.clone();
    vehicle.front.wishbone = None;
    vehicle.rear.wishbone = None;
    roll_pitch::Body::of(&vehicle)
}

/// Roll stiffness in a sine under the noise of a seed.
fn roll_found(seed: u64) -> Findings {
    let vehicle = rides::vehicle();
    let clean = rides::sine(&vehicle, 0.12, 0.3, 32.0);
    let drive = rides::as_measured(&clean, 0.0, 900 + seed);
    let body = roll_body(&vehicle);
    roll_pitch::identify(&drive, &body, &roll_pitch::Options::default()).expect("rolls")
}

fn roll_truth() -> f64 {
    let vehicle = rides::vehicle();
    vehicle.front.roll_stiffness_n_m_rad + vehicle.rear.roll_stiffness_n_m_rad
}

#[test]
#[ignore = "200 seeds: `make campaigns`"]
fn intervals_of_200_roll_stiffnesses_hold_the_truth() {
    coverage::covers(0..200, &[("roll_stiffness", roll_truth())], roll_found);
}

#[test]
fn roll_stiffness_is_within_five_per_cent_and_its_intervals_hold() {
    for seed in 0..5 {
        near(&roll_found(seed), "roll_stiffness", roll_truth(), 0.05);
    }
    coverage::covers(0..30, &[("roll_stiffness", roll_truth())], roll_found);
    let found = roll_found(1);
    assert!(
        found.get("pitch_stiffness").is_none(),
        "nothing pitches in a sine"
    );
    assert!(
        found.notes.iter().any(|note| note.contains("pitch angle")),
        "{:?}",
        found.notes
    );
}

#[test]
fn pitch_stiffness_comes_from_braking() {
    let vehicle = rides::vehicle();
    let clean = rides::drive(&vehicle, 24.0, |t| 8.0 + 3.0 * math::sin(0.8 * t), |_| 0.0);
    let drive = rides::as_measured(&clean, 0.0, 3);
    let found = roll_pitch::identify(
        &drive,
        &roll_body(&vehicle),
        &roll_pitch::Options::default(),
    )
    .expect("pitches");
    near(
        &found,
        "pitch_stiffness",
        vehicle.pitch().stiffness_n_m_rad,
        0.05,
    );
}

#[test]
fn a_known_second_order_system_is_found_in_its_frequency_response() {
    // Yaw rate of G (1 + T s)/(1 + 2 zeta s/w + s^2/w^2) under a sweep, integrated finely.
    let (gain, omega, zeta, lead) = (5.0, 9.0, 0.7, 0.12);
    let mut drive = Drive {
        dt_s: DT_S,
        ..Default::default()
    };
    let phase = |t: f64| std::f64::consts::TAU * (0.1 * t + 0.5 * 0.05 * (t % 60.0) * t);
    let steer =
        |t: f64| 0.05 * (math::sin(phase(t)) + 0.4 * math::sin(1.7 * t) + 0.4 * math::sin(4.3 * t));
    let (mut x, mut v) = (0.0, 0.0);
    for row in 0..8_000 {
        for k in 0..20 {
            let t = row as f64 * DT_S + f64::from(k) * DT_S / 20.0;
            if k == 0 {
                drive.steer_rad.push(steer(t));
                drive.yaw_rate_rad_s.push(gain * (x + lead * v));
            }
            let force = steer(t) - x - 2.0 * zeta / omega * v;
            v += omega * omega * force * DT_S / 20.0;
            x += v * DT_S / 20.0;
        }
    }
    let mut noise = Noise::new(4);
    noise.spoil(&mut drive.yaw_rate_rad_s, 0.004, 0.0);
    let found = response::frequency(&drive, 10.0, 1).expect("coherent");
    near(&found, "yaw_rate_gain", gain, 0.03);
    near(
        &found,
        "natural_frequency",
        omega / std::f64::consts::TAU,
        0.05,
    );
    near(&found, "damping_ratio", zeta, 0.07);
    near(&found, "lead_time", lead, 0.07);
    drive.steer_rad.fill(0.0);
    noise.spoil(&mut drive.steer_rad, 0.001, 0.0);
    let refusal = response::frequency(&drive, 10.0, 1).expect_err("nothing is coherent");
    assert!(matches!(refusal, Refusal::NotExcited { .. }), "{refusal}");
}

#[test]
fn a_first_order_step_takes_its_time() {
    // After a step, 1 - exp(-t/tau) reaches 90 % at tau ln 10.
    let tau = 0.2;
    let rows = 900;
    let at = |row: usize| row as f64 * DT_S - 3.0;
    let drive = Drive {
        dt_s: DT_S,
        steer_rad: (0..rows)
            .map(|row| if at(row) < 0.0 { 0.0 } else { 0.1 })
            .collect(),
        yaw_rate_rad_s: (0..rows)
            .map(|row| 0.5 * (1.0 - math::exp(-at(row).max(0.0) / tau)))
            .collect(),
        lateral_m_s2: (0..rows)
            .map(|row| 3.0 * (1.0 - math::exp(-at(row).max(0.0) / tau)))
            .collect(),
        ..Default::default()
    };
    let found = response::step(&drive, 0.02).expect("a step");
    near(
        &found,
        "yaw_rate_response_time",
        tau * math::ln(10.0_f64),
        0.03,
    );
    near(&found, "yaw_rate_gain", 5.0, 0.01);
    near(&found, "lateral_acceleration_gain", 30.0, 0.01);
    assert!(found.value("yaw_rate_overshoot")[0] < 0.01);
    // The true reason: the vehicle stands, the step is not held, or there is none.
    let speed = |speed_m_s: f64| Drive {
        speed_m_s: vec![speed_m_s; rows],
        ..drive.clone()
    };
    assert!(response::step(&speed(10.0), 0.02).is_ok());
    // Steps that are held for 1 s.
    let pulse = |row: usize| if row / 100 % 2 == 1 { 0.1 } else { 0.0 };
    let short = Drive {
        steer_rad: (0..rows).map(pulse).collect(),
        ..drive.clone()
    };
    let still = Drive {
        steer_rad: vec![0.0; rows],
        ..drive.clone()
    };
    for (drive, reason) in [
        (speed(0.0), "the wheels were turned while the vehicle stood"),
        (short, "hold the steering wheel for 2 s after a step"),
        (still, "turn the steering wheel within half a second"),
    ] {
        let refusal = response::step(&drive, 0.02).map(|_| ()).expect_err(reason);
        assert!(matches!(refusal, Refusal::NotExcited { .. }), "{refusal}");
        assert!(refusal.to_string().contains(reason), "{refusal}");
    }
}

#[test]
fn every_tyre_model_is_fitted_and_the_wrong_shape_is_told() {
    let vehicle = rides::vehicle();
    let truth = &vehicle.front.tyre;
    let own = Tyre::from_vehicle(truth);
    let mut noise = Noise::new(8);
    let mut data = tyre::Data {
        dt_s: 0.05,
        ..Default::default()
    };
    for row in 0..600 {
        let t = f64::from(row) * 0.05;
        let slip = 0.25 * math::sin(1.9 * t);
        let load = 1330.0 * (1.0 + 0.4 * math::sin(1.9 * t + 0.4));
        data.load_n.push(load);
        data.slip_angle_rad
            .push(slip + 0.02 + 0.001 * noise.normal());
        data.lateral_n
            .push(own.forces(&Contact::lateral(load, slip)).lateral_n + 15.0 * noise.normal());
    }
    let reference = truth.reference_load_n;
    let mut criteria = Vec::new();
    for kind in tyre::Kind::ALL {
        let (found, _) = tyre::fit(&data, kind, reference, [0.75, 0.87], 1)
            .unwrap_or_else(|refusal| panic!("{}: {refusal}", kind.name()));
        let criterion = found
            .beside
            .iter()
            .find(|b| b.0 == "akaike_criterion")
            .expect("beside")
            .1;
        println!("{}: {criterion:.0} {:?}", kind.name(), found.beside[0]);
        criteria.push((kind, criterion));
        if kind == tyre::Kind::Fiala {
            near(
                &found,
                "cornering_stiffness",
                truth.cornering_stiffness_n_rad,
                0.02,
            );
            near(&found, "friction", truth.friction, 0.06);
            near(&found, "load_exponent", truth.load_exponent, 0.1);
            near(&found, "slip_angle_offset", 0.02, 0.05);
        }
    }
    let of = |kind| criteria.iter().find(|c| c.0 == kind).expect("fitted").1;
    assert!(of(tyre::Kind::Linear) > of(tyre::Kind::Fiala) + 100.0);
    assert!(of(tyre::Kind::Dugoff) > of(tyre::Kind::Fiala) + 50.0);
    data.slip_angle_rad.fill(0.01);
    let refusal = tyre::fit(&data, tyre::Kind::Fiala, reference, [0.75, 0.87], 1);
    assert!(matches!(refusal, Err(Refusal::NotExcited { .. })));
}

#[test]
fn a_pendulums_inertia_is_found_and_its_intervals_hold() {
    let wires = inertia::Pendulum::Wires {
        mass_kg: 644.0,
        radius_m: 0.8,
        length_m: 2.5,
    };
    let truth = 454.0;
    let omega = (644.0 * 9.80665 * 0.64 / 2.5 / (truth + 20.0_f64)).sqrt();
    let find = |seed| {
        let swing = |row: i32| {
            let time_s = f64::from(row) * 0.05;
            0.1 * math::exp(-0.01 * time_s) * math::cos(omega * time_s)
        };
        let mut rate: Vec<f64> = (0..800).map(swing).collect();
        Noise::new(seed).spoil(&mut rate, 0.008, 0.02);
        inertia::pendulum(&rate, 0.05, wires, 20.0, seed).expect("swings")
    };
    near(&find(1), "inertia", truth, 0.02);
    coverage::covers(0..60, &[("inertia", truth)], find);
    let still = inertia::pendulum(&[0.0; 10], DT_S, wires, 0.0, 1);
    assert!(matches!(still, Err(Refusal::NotExcited { .. })));
}

#[test]
fn implausible_inertia_is_named() {
    let thesis = Vehicle::builtin("prowler-table-2.3").expect("ships with the program");
    let found = inertia::by_formula(&thesis);
    assert!(
        found.notes.iter().any(|note| note.contains("times m a b")),
        "{:?}",
        found.notes
    );
}

#[test]
fn roll_centres_come_from_hard_points_only() {
    let found = roll_centre::identify(&rides::vehicle()).expect("has hard-points");
    for name in ["roll_centre_height_front", "roll_centre_height_rear"] {
        assert!(
            (0.02..0.3).contains(&found.value(name)[0]),
            "{name} {:?}",
            found.value(name)
        );
    }
    let without = Vehicle::builtin("prowler-table-2.3").expect("ships with the program");
    assert!(matches!(
        roll_centre::identify(&without),
        Err(Refusal::Missing { .. })
    ));
}
