//! Stresses against a balance of the front left corner of the Prowler that is written down here by itself: the
//! points of the vehicle file, the six forces that hold the upright, the moments about the hinges of both arms, and
//! the moment along a tube as the sum of its shear force.

use nalgebra::{Matrix2, Matrix3, Matrix6, Vector2, Vector3, Vector6};

use super::*;

const G: f64 = 9.80665;

type V = Vector3<f64>;

/// Points of `prowler.toml`, [front.wishbone], and of its unsprung masses.
struct Points {
    centre: V,
    upper: [V; 2],
    upper_ball: V,
    lower: [V; 2],
    lower_ball: V,
    strut: [V; 2],
    tie_rod: [V; 2],
}

fn points() -> Points {
    let v = V::new;
    Points {
        centre: v(0.0, 0.5715, 0.306429),
        upper: [v(0.13, 0.215, 0.407), v(-0.15, 0.215, 0.407)],
        upper_ball: v(-0.012, 0.447, 0.395),
        lower: [v(0.17, 0.18065, 0.265), v(-0.17, 0.18065, 0.265)],
        lower_ball: v(0.006, 0.47, 0.225),
        strut: [v(0.0, 0.275, 0.6), v(0.0, 0.306454, 0.247609)],
        tie_rod: [v(-0.1, 0.1705, 0.3268), v(-0.1, 0.435, 0.3)],
    }
}

/// Tensions of upper front and rear, lower front and rear outboard, and tie rod, and the force along the normal of
/// the lower arm at its ball joint, N.
fn balance(force: V) -> ([f64; 5], f64, V) {
    let p = points();
    let unit = |from: V, to: V| (to - from).normalize();
    let pulls = [
        (p.upper_ball, unit(p.upper_ball, p.upper[0])),
        (p.upper_ball, unit(p.upper_ball, p.upper[1])),
        (p.tie_rod[1], unit(p.tie_rod[1], p.tie_rod[0])),
    ];
    let contact = p.centre - V::z() * (0.3175 - force.z / 120_000.0);
    // What acts on wheel and upright: the ground, their weights, and the weight of the upper arm by its lever.
    let mut loads = vec![
        (contact, force),
        (p.centre, V::z() * -(18.0 * G)),
        (V::new(0.0, 0.49, 0.306429), V::z() * -(3.0 * G)),
    ];
    let normal = |front: V, rear: V, ball: V| {
        let n = (front - ball).cross(&(rear - ball)).normalize();
        n * n.z.signum()
    };
    let hinge = (p.upper[0] - p.upper[1]).normalize();
    let about = |point: V, force: V, origin: V| (point - origin).cross(&force).dot(&hinge);
    let n = normal(p.upper[0], p.upper[1], p.upper_ball);
    let weight = about(
        V::new(-0.008, 0.325, 0.401),
        V::z() * -(2.0 * G),
        p.upper[1],
    );
    // The ball joint carries the arm: the arm pushes the upright by as much along its normal.
    loads.push((
        p.upper_ball,
        n * (weight / about(p.upper_ball, n, p.upper[1])),
    ));
    let mut a = Matrix6::zeros();
    for (k, (at, pull)) in pulls.iter().enumerate() {
        a.fixed_view_mut::<3, 1>(0, k).copy_from(pull);
        a.fixed_view_mut::<3, 1>(3, k).copy_from(&at.cross(pull));
    }
    for k in 0..3 {
        let axis = Matrix3::identity().column(k).into_owned();
        a.fixed_view_mut::<3, 1>(0, 3 + k).copy_from(&axis);
        a.fixed_view_mut::<3, 1>(3, 3 + k)
            .copy_from(&p.lower_ball.cross(&axis));
    }
    let mut b = Vector6::zeros();
    for (at, load) in loads {
        let moment = at.cross(&load);
        b -= Vector6::new(load.x, load.y, load.z, moment.x, moment.y, moment.z);
    }
    let x = a.try_inverse().expect("a linkage that holds") * b;
    let ball = V::new(x[3], x[4], x[5]);
    // The lower arm gets the opposite force.
    let n = normal(p.lower[0], p.lower[1], p.lower_ball);
    let pull = p.lower.map(|hinge| unit(p.lower_ball, hinge));
    let in_plane = Matrix3::from_columns(&[pull[0], pull[1], -n]);
    let legs = in_plane.try_inverse().expect("an arm") * ball;
    ([x[0], x[1], legs[0], legs[1], x[2]], legs[2], n)
}

/// More tension inboard of the mount, from the strut's force by the moments about the hinge of the lower arm.
fn excess(ball_normal_n: f64, n: V) -> [f64; 2] {
    let p = points();
    let hinge = (p.lower[0] - p.lower[1]).normalize();
    let about = |point: V, force: V| (point - p.lower[1]).cross(&force).dot(&hinge);
    let weight = V::z() * -(3.0 * G);
    let along = (p.strut[1] - p.strut[0]).normalize();
    let others = about(p.lower_ball, n * ball_normal_n) + about(V::new(0.0, 0.31, 0.247), weight);
    let load = along * (-others / about(p.strut[1], along)) + weight;
    let legs = p.lower.map(|hinge| (p.lower_ball - hinge).normalize());
    // The least force in both legs that balances the part of the load in the plane.
    let c = legs[0].dot(&legs[1]);
    let solved = Matrix2::new(1.0, c, c, 1.0)
        .try_inverse()
        .expect("two legs")
        * Vector2::new(legs[0].dot(&load), legs[1].dot(&load));
    [solved.x, solved.y]
}

fn table(force_n: [f64; 3], axial_distance_m: Option<f64>) -> GaugeTable {
    let vehicle = Vehicle::builtin("prowler").expect("built in");
    let sensors = Sensors::builtin("full-bridge-16bit-bending").expect("built in");
    let load = GaugeLoad {
        wheel: Wheel::FrontLeft,
        force_n,
        compression_m: 0.0,
        axial_distance_m,
    };
    gauges(&vehicle, &sensors, &load).expect("a table")
}

#[test]
fn stresses_agree_with_a_balance_of_their_own() {
    let p = points();
    // Tube of 25.4 mm by 1.65 mm.
    let (area, modulus) = (123.11e-6, 686.7e-9);
    for force_n in [
        [0.0, 0.0, 1327.0],
        [-900.0, 1100.0, 2400.0],
        [300.0, -700.0, 800.0],
    ] {
        let (tension_n, ball_normal_n, n) = balance(force_n.into());
        let found = table(force_n, None);
        for (gauge, tension_n) in found.gauges.iter().zip(tension_n) {
            assert!(
                (gauge.tension_n - tension_n).abs() < 0.5,
                "{gauge:?} for {tension_n}"
            );
            let stress_pa = tension_n / area;
            assert!(
                (gauge.axial_stress_pa - stress_pa).abs() < 2e-3 * stress_pa.abs() + 5e3,
                "{gauge:?}"
            );
        }
        // The mount is at the part of the way from ball joint to hinge at which the strut is.
        let part = 1.0
            - math::hypot(0.306454 - 0.18065, 0.265 - 0.247609)
                / math::hypot(0.47 - 0.18065, 0.265 - 0.225);
        let excess_n = excess(ball_normal_n, n);
        for (side, beam) in found.beams[2..4].iter().enumerate() {
            let length_m = (p.lower_ball - p.lower[side]).norm();
            let mount_m = part * length_m;
            assert!((beam.mount_m.expect("a mount") - mount_m).abs() < 1e-4);
            let inboard_n = tension_n[2 + side] + excess_n[side];
            assert!(
                (beam.tension_n[1] - inboard_n).abs() < 1.0,
                "{beam:?} for {inboard_n}"
            );
            // Sum of the shear force: half of the ball-normal force, less the strut's inboard of its mount.
            let (steps, mut moment) = (10_000, 0.0);
            let strut_n = 0.5 * ball_normal_n * length_m / (length_m - mount_m);
            for k in 0..steps {
                let x = (f64::from(k) + 0.5) / f64::from(steps) * length_m;
                if k % 1000 == 500 {
                    assert!((beam.moment_n_m(x) - moment).abs() < 0.05, "{x}: {moment}");
                }
                let shear = 0.5 * ball_normal_n - if x > mount_m { strut_n } else { 0.0 };
                moment += shear * length_m / f64::from(steps);
            }
            assert!(moment.abs() < 0.1, "the hinge turns freely: {moment}");
        }
        for gauge in &found.gauges[5..7] {
            let moment = 0.5 * ball_normal_n * 0.1;
            assert!(
                (gauge.moment_n_m - moment).abs() < 0.05,
                "{gauge:?} for {moment}"
            );
            let strain = (moment.abs() / modulus + gauge.tension_n.abs() / area) / 190e9;
            assert!(
                (gauge.strain / strain - 1.0).abs() < 0.01,
                "{gauge:?} for {strain}"
            );
        }
    }
}

#[test]
fn counts_are_those_of_the_chain_and_can_be_beyond_its_range() {
    let sensors = Sensors::builtin("full-bridge-16bit-bending").expect("built in");
    let axial = sensors.strain.axial_scale().expect("a scale");
    let found = table([0.0, 3000.0, 1327.0], None);
    for gauge in &found.gauges[..5] {
        let load = axial.load(gauge.counts);
        assert!((load - gauge.tension_n).abs() < 1e-6 * gauge.tension_n.abs().max(1.0));
        let [low, high] = axial.range();
        let part = gauge.tension_n / if gauge.tension_n < 0.0 { low } else { high };
        assert!(
            (gauge.part_of_range - part).abs() < 1e-6,
            "{gauge:?} {part}"
        );
    }
    let beyond = table([0.0, 300_000.0, 1327.0], None);
    assert!(beyond.gauges.iter().any(|gauge| gauge.part_of_range > 1.0));
}

#[test]
fn a_gauge_inboard_of_the_mount_has_the_force_of_the_strut() {
    let outboard = table([0.0, 0.0, 1327.0], Some(0.1));
    let inboard = table([0.0, 0.0, 1327.0], Some(0.25));
    let tension = |table: &GaugeTable| table.gauges[2].tension_n;
    assert!((tension(&inboard) - tension(&outboard)).abs() > 50.0);
}

#[test]
fn what_has_no_stresses_is_named() {
    let sensors = Sensors::builtin("full-bridge-16bit-bending").expect("built in");
    let load = GaugeLoad {
        wheel: Wheel::RearLeft,
        force_n: [0.0, 0.0, 1800.0],
        compression_m: 0.0,
        axial_distance_m: Some(0.9),
    };
    let said = |name: &str, sensors: &Sensors, load: &GaugeLoad| {
        let vehicle = Vehicle::builtin(name).expect("built in");
        gauges(&vehicle, sensors, load)
            .expect_err("refused")
            .to_string()
    };
    let far = said("prowler", &sensors, &load);
    assert!(
        far.contains("upper_front: the gauge is 0.9 m from the outer joint"),
        "{far}"
    );
    let solid = said("second-vehicle", &sensors, &load);
    assert!(solid.contains("the rear axle is a solid axle"), "{solid}");
    let mut bare = sensors.clone();
    bare.strain.youngs_modulus_pa = None;
    let bare = said("prowler", &bare, &load);
    assert!(bare.contains("strain.youngs_modulus_pa"), "{bare}");
}
