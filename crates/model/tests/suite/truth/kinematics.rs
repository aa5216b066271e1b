//! Positions and angles of every corner.

use atvrec_model::suspension::{Corner, CornerPose};
use nalgebra::Vector3;
use sample::Wheel;
use testkit::truth::vehicle;

use super::run::Run;

/// Ball joints, tie rod and wheel centre: the simulator's own drift of its constraints is about 1 um.
const POSITION_TOLERANCE_M: f64 = 2.0e-6;
/// Angles follow from positions over arms of 0.1 m and more.
const ANGLE_TOLERANCE_RAD: f64 = 2.0e-5;

#[test]
fn poses_match_the_simulator() {
    let vehicle = vehicle();
    let corners = Wheel::ALL.map(|wheel| Corner::of(vehicle, wheel).expect("hard-points"));
    for name in ["b_circle", "c_sine03", "f_launch_brake"] {
        let Some(run) = Run::open(name, 97) else {
            return;
        };
        let mut worst = [0.0_f64; 6];
        for row in 0..run.rows {
            for corner in &corners {
                let prefix = corner.wheel.abbreviation();
                let rack = if corner.wheel.is_front() {
                    run.get("rack", row)
                } else {
                    0.0
                };
                let length = run.get(&format!("{prefix}_spring_len"), row);
                let pose = corner.pose(length, rack).expect("within reach");
                let miss = |point: Vector3<f64>, column: &str| {
                    (point - run.vector(&format!("{prefix}_{column}_"), "", row)).norm()
                };
                let angle = |value: f64, column: &str| {
                    (value - run.get(&format!("{prefix}_{column}"), row)).abs()
                };
                let misses = [
                    miss(pose.lower_ball_m, "lbj"),
                    miss(pose.upper_ball_m, "ubj"),
                    miss(pose.tie_rod_outer_m, "tro"),
                    miss(pose.wheel_centre_m, "wc"),
                    miss(pose.strut_direction, "strut_dir"),
                    angle(pose.steer_rad(), "steer"),
                ];
                for (worst, miss) in worst.iter_mut().zip(misses) {
                    *worst = worst.max(miss);
                }
            }
        }
        println!("{name}: worst lbj, ubj, tro, wc (m), strut, steer (rad) {worst:?}");
        assert!(
            worst[..4].iter().all(|miss| *miss < POSITION_TOLERANCE_M),
            "{name}: {worst:?}"
        );
        assert!(
            worst[4..].iter().all(|miss| *miss < ANGLE_TOLERANCE_RAD),
            "{name}: {worst:?}"
        );
    }
}

#[test]
fn design_ratios_match_the_simulator() {
    let vehicle = vehicle();
    // Secants read off the simulator's own runs: motion ratio, camber gain in deg/m, bump steer in deg/m.
    for (wheel, ratio, camber, steer) in [
        (Wheel::FrontLeft, 0.406, 28.1, 0.21),
        (Wheel::RearLeft, 0.413, 22.4, 0.003),
    ] {
        let corner = Corner::of(vehicle, wheel).expect("hard-points");
        let pose_at = |jounce| -> CornerPose { corner.pose_at_jounce(jounce, 0.0).expect("near") };
        let rates = corner.rates(&pose_at(0.0));
        println!("{wheel}: motion ratio {:.4}", rates.motion_ratio());
        assert!(
            (rates.motion_ratio() - ratio).abs() < 0.0012,
            "{}",
            rates.motion_ratio()
        );
        let gain = (pose_at(0.005).camber_rad(wheel) - pose_at(-0.005).camber_rad(wheel)) / 0.01;
        println!("{wheel}: camber gain {:.2} deg/m", gain.to_degrees());
        assert!((gain.to_degrees().abs() - camber).abs() < 0.5);
        let bump = rates.bump_steer_rad_m().to_degrees();
        println!("{wheel}: bump steer {bump:.4} deg/m");
        assert!((bump.abs() - steer).abs() < 0.06);
    }
}

/// Both constructions agree to the steer that the planar one leaves out.
const ROLL_CENTRE_TOLERANCE_M: f64 = 2.0e-3;

/// The roll centre from the contact point's path against the textbook's: both arms' lines, seen
/// from the rear, meet in the instant centre; its line to the contact point cuts the middle plane.
#[test]
fn roll_centre_by_the_instant_centre() {
    let vehicle = vehicle();
    for wheel in Wheel::ALL {
        let corner = Corner::of(vehicle, wheel).expect("hard-points");
        for jounce in [-0.05, 0.0, 0.05] {
            let pose = corner.pose_at_jounce(jounce, 0.0).expect("within reach");
            let radius = 0.305;
            let point = corner.jounce_point(jounce, radius).expect("within reach");
            let p = &corner.points;
            let slope =
                |hinge: Vector3<f64>, ball: Vector3<f64>| (ball.z - hinge.z) / (ball.y - hinge.y);
            let upper = slope(p.upper_front, pose.upper_ball_m);
            let lower = slope(p.lower_front, pose.lower_ball_m);
            let y = (p.lower_front.z - p.upper_front.z + upper * p.upper_front.y
                - lower * p.lower_front.y)
                / (upper - lower);
            let z = p.lower_front.z + lower * (y - p.lower_front.y);
            let (sine, cosine) = math::sin_cos(math::asin(pose.spindle.z));
            let contact_y = pose.wheel_centre_m.y + radius * sine;
            let contact_z = pose.wheel_centre_m.z - radius * cosine;
            let height = -contact_y * (z - contact_z) / (y - contact_y);
            assert!(
                (point.roll_centre_height_m - height).abs() < ROLL_CENTRE_TOLERANCE_M,
                "{wheel} at {jounce}: {} {height}",
                point.roll_centre_height_m
            );
            assert!((point.track_m - 2.0 * contact_y.abs()).abs() < 1e-4);
        }
    }
}

#[test]
fn jounce_curves_mirror_and_rise() {
    let vehicle = vehicle();
    let curve = |wheel| {
        let corner = Corner::of(vehicle, wheel).expect("hard-points");
        corner
            .jounce_curve(-0.06, 0.06, 13, 0.305)
            .expect("within reach")
    };
    let (left, right) = (curve(Wheel::FrontLeft), curve(Wheel::FrontRight));
    for (l, r) in left.iter().zip(&right) {
        assert!((l.camber_rad - r.camber_rad).abs() < 1e-12);
        assert!((l.toe_in_rad - r.toe_in_rad).abs() < 1e-12);
        assert!((l.roll_centre_height_m - r.roll_centre_height_m).abs() < 1e-9);
    }
    for pair in left.windows(2) {
        assert!(pair[1].strut_length_m < pair[0].strut_length_m);
        // The motion ratio is the strut's travel over the wheel's.
        let slope = (pair[0].strut_length_m - pair[1].strut_length_m) / 0.01;
        let mean = 0.5 * (pair[0].motion_ratio + pair[1].motion_ratio);
        assert!((slope - mean).abs() < 1e-3, "{slope} {mean}");
    }
}
