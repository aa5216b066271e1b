//! The corner's statics against an independent solve: free-body equations of upper arm, lower arm
//! and upright with wheel, 18 equations in 18 unknowns.

use atvrec_model::suspension::{
    ChannelKind, Corner, CornerMotion, CornerPose, CornerStatics, TyreFrame, Wrench,
};
use atvrec_model::vehicle::{Axle, Tyre, Unsprung, Wishbone};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use proptest::prelude::*;
use sample::Wheel;

/// Rounding of an 18 by 18 solve with kilonewtons in it, N.
const TOLERANCE_N: f64 = 1e-6;

const UPRIGHT: usize = 0;
const UPPER: usize = 6;
const LOWER: usize = 12;

// Columns of the unknowns.
const UPPER_BALL: usize = 0;
const LOWER_BALL: usize = 3;
const UPPER_HINGE: usize = 6;
const LOWER_HINGE: usize = 11;
const TIE_ROD: usize = 16;
const STRUT: usize = 17;

fn axle() -> Axle {
    Axle {
        track_m: 1.2,
        roll_centre_height_m: 0.1,
        roll_stiffness_n_m_rad: 8000.0,
        roll_damping_n_m_s_rad: 800.0,
        anti_roll_bar_n_m_rad: 0.0,
        unsprung: Some(Unsprung {
            wheel_mass_kg: 17.0,
            wheel_spin_inertia_kg_m2: 0.7,
            wheel_diametral_inertia_kg_m2: 0.4,
            upright_mass_kg: 3.5,
            upper_arm_mass_kg: 1.8,
            lower_arm_mass_kg: 2.9,
            upright_cg_m: Some([0.01, 0.50, 0.31]),
            upper_arm_cg_m: None,
            lower_arm_cg_m: Some([0.005, 0.33, 0.25]),
        }),
        strut: None,
        macpherson: None,
        five_link: None,
        trailing_arm: None,
        live_axle: None,
        leaf_axle: None,
        wishbone: Some(Wishbone {
            wheel_centre_m: [0.0, 0.6, 0.3],
            upper_front_m: [0.15, 0.22, 0.41],
            upper_rear_m: [-0.13, 0.24, 0.40],
            upper_ball_m: [-0.015, 0.46, 0.40],
            lower_front_m: [0.18, 0.17, 0.27],
            lower_rear_m: [-0.16, 0.19, 0.26],
            lower_ball_m: [0.01, 0.48, 0.22],
            strut_chassis_m: [0.02, 0.28, 0.61],
            strut_arm_m: [0.01, 0.33, 0.25],
            tie_rod_inner_m: [-0.11, 0.18, 0.325],
            tie_rod_outer_m: [-0.10, 0.45, 0.31],
        }),
        tyre: Tyre {
            tir: None,
            unloaded_radius_m: 0.31,
            vertical_stiffness_n_m: 120_000.0,
            vertical_damping_n_s_m: 0.0,
            width_m: 0.0,
            cornering_stiffness_n_rad: 6000.0,
            slip_stiffness_n: 12_000.0,
            reference_load_n: 1500.0,
            load_exponent: 1.0,
            friction: 0.8,
            relaxation_length_m: 0.0,
            rolling_resistance: 0.0,
            camber_stiffness_n_rad: 0.0,
            pressure: None,
        },
    }
}

fn cross_matrix(r: Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -r.z, r.y, r.z, 0.0, -r.x, -r.y, r.x, 0.0)
}

/// Equations of motion A x + b = 0, moments about the vehicle's origin.
struct System {
    a: DMatrix<f64>,
    b: DVector<f64>,
}

impl System {
    fn new() -> Self {
        Self {
            a: DMatrix::zeros(18, 18),
            b: DVector::zeros(18),
        }
    }

    /// An unknown force (three components) at a point, with this sign on this body.
    fn joint(&mut self, body: usize, column: usize, at: Vector3<f64>, sign: f64) {
        let mut force = self.a.fixed_view_mut::<3, 3>(body, column);
        force += Matrix3::identity() * sign;
        let mut moment = self.a.fixed_view_mut::<3, 3>(body + 3, column);
        moment += cross_matrix(at) * sign;
    }

    /// An unknown force along a line.
    fn line(&mut self, body: usize, column: usize, at: Vector3<f64>, along: Vector3<f64>) {
        let moment = at.cross(&along);
        for i in 0..3 {
            self.a[(body + i, column)] += along[i];
            self.a[(body + 3 + i, column)] += moment[i];
        }
    }

    /// Hinge: an unknown force, and unknown moments across the axis.
    fn hinge(&mut self, body: usize, column: usize, at: Vector3<f64>, axis: Vector3<f64>) {
        self.joint(body, column, at, 1.0);
        let across = axis.cross(&Vector3::z()).normalize();
        for (k, moment) in [across, axis.cross(&across)].into_iter().enumerate() {
            for i in 0..3 {
                self.a[(body + 3 + i, column + 3 + k)] += moment[i];
            }
        }
    }

    fn known(&mut self, body: usize, at: Vector3<f64>, force: Vector3<f64>, couple: Vector3<f64>) {
        let moment = at.cross(&force) + couple;
        for i in 0..3 {
            self.b[body + i] += force[i];
            self.b[body + 3 + i] += moment[i];
        }
    }
}

fn solve(
    corner: &Corner,
    pose: &CornerPose,
    frame: &TyreFrame,
    unsprung: &Unsprung,
    motion: &CornerMotion,
    wrench: &Wrench,
) -> DVector<f64> {
    let mut system = System::new();
    let p = &corner.points;
    system.joint(UPRIGHT, UPPER_BALL, pose.upper_ball_m, -1.0);
    system.joint(UPPER, UPPER_BALL, pose.upper_ball_m, 1.0);
    system.joint(UPRIGHT, LOWER_BALL, pose.lower_ball_m, -1.0);
    system.joint(LOWER, LOWER_BALL, pose.lower_ball_m, 1.0);
    system.hinge(
        UPPER,
        UPPER_HINGE,
        p.upper_front,
        (p.upper_front - p.upper_rear).normalize(),
    );
    system.hinge(
        LOWER,
        LOWER_HINGE,
        p.lower_rear,
        (p.lower_front - p.lower_rear).normalize(),
    );
    let rod = (pose.tie_rod_inner_m - pose.tie_rod_outer_m).normalize();
    system.line(UPRIGHT, TIE_ROD, pose.tie_rod_outer_m, rod);
    system.line(LOWER, STRUT, pose.strut_arm_m, pose.strut_direction);

    let r = frame.vehicle_from_tyre;
    system.known(
        UPRIGHT,
        frame.contact_m,
        r * wrench.force_n,
        r * wrench.moment_n_m,
    );
    let s = pose.spindle;
    let diametral = Matrix3::identity() * unsprung.wheel_diametral_inertia_kg_m2;
    let polar = s
        * s.transpose()
        * (unsprung.wheel_spin_inertia_kg_m2 - unsprung.wheel_diametral_inertia_kg_m2);
    let inertia = diametral + polar;
    let rate = motion.upright_rate_rad_s;
    let momentum = inertia * (rate + s * motion.spin_rad_s);
    let momentum_dot = inertia * (motion.upright_rate_dot_rad_s2 + s * motion.spin_dot_rad_s2)
        + rate.cross(&momentum);
    system.known(
        UPRIGHT,
        pose.wheel_centre_m,
        motion.wheel_specific_force_m_s2 * -unsprung.wheel_mass_kg,
        s * motion.axle_torque_n_m - momentum_dot,
    );
    for (body, at, mass, f) in [
        (
            UPRIGHT,
            pose.upright_cg_m,
            unsprung.upright_mass_kg,
            motion.upright_specific_force_m_s2,
        ),
        (
            UPPER,
            pose.upper_arm_cg_m,
            unsprung.upper_arm_mass_kg,
            motion.upper_arm_specific_force_m_s2,
        ),
        (
            LOWER,
            pose.lower_arm_cg_m,
            unsprung.lower_arm_mass_kg,
            motion.lower_arm_specific_force_m_s2,
        ),
    ] {
        system.known(body, at, f * -mass, Vector3::zeros());
    }
    system
        .a
        .lu()
        .solve(&-system.b)
        .expect("18 independent equations")
}

/// The parts of a ball joint's force along both legs and the normal.
fn legs(
    front: Vector3<f64>,
    rear: Vector3<f64>,
    ball: Vector3<f64>,
    force: Vector3<f64>,
    normal: Vector3<f64>,
) -> Vector3<f64> {
    let base = Matrix3::from_columns(&[
        (ball - front).normalize(),
        (ball - rear).normalize(),
        normal,
    ]);
    base.try_inverse().expect("legs span a plane") * force
}

fn vector(size: f64) -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-size..size).prop_map(Vector3::from)
}

fn motion() -> impl Strategy<Value = CornerMotion> {
    (
        prop::array::uniform4(vector(15.0)),
        vector(2.0),
        vector(20.0),
        -80.0..80.0,
        -100.0..100.0,
        -300.0..300.0,
    )
        .prop_map(
            |(forces, rate, rate_dot, spin, spin_dot, torque)| CornerMotion {
                wheel_specific_force_m_s2: forces[0],
                upright_specific_force_m_s2: forces[1],
                upper_arm_specific_force_m_s2: forces[2],
                lower_arm_specific_force_m_s2: forces[3],
                wheel_travel_m_s: Vector3::zeros(),
                upright_rate_rad_s: rate,
                upright_rate_dot_rad_s2: rate_dot,
                spin_rad_s: spin,
                spin_dot_rad_s2: spin_dot,
                axle_torque_n_m: torque,
            },
        )
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 200,
        failure_persistence: None,
        rng_seed: proptest::test_runner::RngSeed::Fixed(3),
        ..ProptestConfig::default()
    })]

    #[test]
    fn statics_match_three_free_bodies(
        left in any::<bool>(),
        jounce in -0.06..0.06,
        rack in -0.02..0.02,
        force in vector(3000.0),
        moment in vector(200.0),
        tilt in vector(0.2),
        motion in motion(),
    ) {
        let axle = axle();
        let unsprung = axle.unsprung.clone().expect("given");
        let wheel = if left { Wheel::FrontLeft } else { Wheel::FrontRight };
        let corner = Corner::new(&axle, 0.8, wheel).expect("sound");
        let pose = corner.pose_at_jounce(jounce, rack).expect("within reach");
        let normal = (Vector3::z() + tilt).normalize();
        let frame = TyreFrame::new(&pose, normal, 0.31, 0.012);
        let wrench = Wrench { force_n: force, moment_n_m: moment };
        let x = solve(&corner, &pose, &frame, &unsprung, &motion, &wrench);

        let statics = |kind| CornerStatics::new(&corner, &pose, &frame, &unsprung, &motion, kind);
        let by_strut = statics(ChannelKind::Strut).expect("independent members");
        let by_ball = statics(ChannelKind::BallNormal).expect("independent members");
        let found = by_strut.members(&wrench);
        let p = &corner.points;
        let upper_force = x.fixed_rows::<3>(UPPER_BALL).into_owned();
        let lower_force = x.fixed_rows::<3>(LOWER_BALL).into_owned();
        let across = (p.upper_front - pose.upper_ball_m).cross(&(p.upper_rear - pose.upper_ball_m));
        let upper = legs(p.upper_front, p.upper_rear, pose.upper_ball_m, upper_force, across.normalize());
        let lower = legs(p.lower_front, p.lower_rear, pose.lower_ball_m, lower_force, by_strut.lower_normal);
        for (name, found, expected) in [
            ("upper front", found.upper_front_n, upper.x),
            ("upper rear", found.upper_rear_n, upper.y),
            ("lower front", found.lower_front_n, lower.x),
            ("lower rear", found.lower_rear_n, lower.y),
            ("tie rod", found.tie_rod_n, x[TIE_ROD]),
            ("strut", found.sixth_n, x[STRUT]),
            ("ball normal", by_strut.ball_normal_n(&found), lower.z),
            ("ball normal as sixth", by_ball.members(&wrench).sixth_n, lower.z),
        ] {
            prop_assert!((found - expected).abs() < TOLERANCE_N, "{name}: {found} {expected}");
        }
        let back = by_strut.wrench(&found).to_vector() - wrench.to_vector();
        prop_assert!(back.amax() < TOLERANCE_N, "{back}");
    }

    #[test]
    fn left_and_right_mirror(jounce in -0.06..0.06, rack in -0.02..0.02) {
        let axle = axle();
        let mirror = |v: Vector3<f64>| Vector3::new(v.x, -v.y, v.z);
        let left = Corner::new(&axle, 0.8, Wheel::FrontLeft).expect("sound");
        let right = Corner::new(&axle, 0.8, Wheel::FrontRight).expect("sound");
        let l = left.pose_at_jounce(jounce, rack).expect("within reach");
        let r = right.pose_at_jounce(jounce, -rack).expect("within reach");
        prop_assert!((mirror(l.wheel_centre_m) - r.wheel_centre_m).norm() < 1e-12);
        prop_assert!((l.steer_rad() + r.steer_rad()).abs() < 1e-12);
        prop_assert!((l.camber_rad(Wheel::FrontLeft) - r.camber_rad(Wheel::FrontRight)).abs() < 1e-12);
        prop_assert_eq!(l.steer_rad() > left.pose_at_jounce(jounce, 0.0).expect("near").steer_rad(), rack > 0.0);
    }

    #[test]
    fn lengths_hold_and_rates_are_the_slopes(jounce in -0.06..0.06, rack in -0.02..0.02) {
        let corner = Corner::new(&axle(), -0.6, Wheel::RearLeft).expect("sound");
        let pose = corner.pose_at_jounce(jounce, rack).expect("within reach");
        let p = &corner.points;
        let length = |a: Vector3<f64>, b: Vector3<f64>| (a - b).norm();
        for (now, design) in [
            (length(pose.lower_ball_m, p.lower_front), length(p.lower_ball, p.lower_front)),
            (length(pose.upper_ball_m, p.upper_rear), length(p.upper_ball, p.upper_rear)),
            (length(pose.upper_ball_m, pose.lower_ball_m), length(p.upper_ball, p.lower_ball)),
            (length(pose.tie_rod_outer_m, pose.tie_rod_inner_m), length(p.tie_rod_outer, p.tie_rod_inner)),
            (length(pose.tie_rod_outer_m, pose.upper_ball_m), length(p.tie_rod_outer, p.upper_ball)),
            (length(pose.wheel_centre_m, pose.lower_ball_m), length(p.wheel_centre, p.lower_ball)),
        ] {
            prop_assert!((now - design).abs() < 1e-12);
        }
        let again = corner.pose(pose.strut_length_m, rack).expect("same pose");
        prop_assert!((again.wheel_centre_m - pose.wheel_centre_m).norm() < 1e-12);

        let rates = corner.rates(&pose);
        let step = 1e-6;
        let differ = |twist: &atvrec_model::suspension::Twist, dl: f64, dr: f64| {
            let at = |k: f64| corner.pose(pose.strut_length_m + k * dl, rack + k * dr).expect("near");
            let (high, low) = (at(1.0), at(-1.0));
            let point = |pose: &CornerPose| pose.tie_rod_outer_m;
            let wheel = (high.wheel_centre_m - low.wheel_centre_m) / (2.0 * step) - twist.wheel_centre;
            let outer = (point(&high) - point(&low)) / (2.0 * step) - twist.at(&pose, point(&pose));
            wheel.norm().max(outer.norm())
        };
        prop_assert!(differ(&rates.strut, step, 0.0) < 1e-7);
        prop_assert!(differ(&rates.rack, 0.0, step) < 1e-7);
    }
}

#[test]
fn out_of_reach_is_an_error_that_names_the_value() {
    let corner = Corner::new(&axle(), 0.8, Wheel::FrontLeft).expect("sound");
    let error = corner.pose(1.5, 0.0).expect_err("too long");
    assert_eq!(
        error.to_string(),
        "strut length = 1.5 m is out of the linkage's reach"
    );
    let error = corner.pose(f64::NAN, 0.0).expect_err("not a number");
    assert_eq!(
        error.to_string(),
        "strut length = NaN m is not valid; expected a finite number"
    );
    assert!(corner.pose_at_jounce(0.0, 1.0).is_err());
    let mut without = axle();
    without.wishbone = None;
    let error = Corner::new(&without, 0.8, Wheel::FrontLeft).expect_err("no hard-points");
    assert!(
        error
            .to_string()
            .starts_with("front.wishbone, macpherson, five_link or trailing_arm is missing")
    );
    let mut flat = axle();
    if let Some(wishbone) = &mut flat.wishbone {
        wishbone.lower_ball_m = wishbone.lower_front_m;
    }
    assert!(Corner::new(&flat, 0.8, Wheel::FrontLeft).is_err());
}
