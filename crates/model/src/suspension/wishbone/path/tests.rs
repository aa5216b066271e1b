use nalgebra::Vector3;
use sample::Wheel;

use crate::suspension::linkage::{Coordinates, Linkage};
use crate::suspension::{Corner, CornerPose};
use crate::vehicle::{Macpherson, Vehicle};

/// Shortest strut of the Prowler in deep bump, m: 24 mm into the front stop, 37 mm into the rear
/// one.
const DEEP_BUMP_M: f64 = 0.285;

fn corners() -> [Corner; 4] {
    let vehicle = Vehicle::builtin("prowler").unwrap();
    Wheel::ALL.map(|wheel| Corner::of(&vehicle, wheel).unwrap())
}

/// The front corners of the second vehicle of the independent simulator.
fn struts() -> [Corner; 2] {
    let mut vehicle = Vehicle::builtin("prowler").unwrap();
    vehicle.front.wishbone = None;
    vehicle.front.macpherson = Some(Macpherson {
        wheel_centre_m: [0.0, 0.74, 0.3527],
        lower_front_m: [0.105, 0.36, 0.252],
        lower_rear_m: [-0.265, 0.372, 0.262],
        lower_ball_m: [0.012, 0.69, 0.235],
        strut_top_m: [-0.045, 0.56, 0.945],
        strut_low_m: [0.0, 0.584, 0.45],
        hinge_front_share: None,
        tie_rod_inner_m: [0.158, 0.352, 0.2795],
        tie_rod_outer_m: [0.145, 0.702, 0.262],
    });
    [Wheel::FrontLeft, Wheel::FrontRight].map(|wheel| Corner::of(&vehicle, wheel).unwrap())
}

/// Corners on five links, the rear ones with the strut on a link, and on semi-trailing arms.
fn others() -> Vec<Corner> {
    let texts = [
        include_str!("../../../../../../testdata/vehicle-with-links.toml"),
        include_str!("../../../../../../testdata/vehicle-with-trailing-arms.toml"),
    ];
    let [links, arms] = texts.map(|text| Vehicle::from_toml(text, "v.toml").unwrap());
    let on_links = Wheel::ALL.map(|wheel| Corner::of(&links, wheel).unwrap());
    let on_arms = [Wheel::RearLeft, Wheel::RearRight].map(|w| Corner::of(&arms, w).unwrap());
    on_links.into_iter().chain(on_arms).collect()
}

/// Strut lengths from deep bump to past the droop stop, and rack travels within the front axle's
/// reach.
fn poses(corner: &Corner) -> impl Iterator<Item = CornerPose> {
    let longest = corner.design_strut_length_m() + 0.045;
    let racks: &[f64] = if corner.wheel.is_front() {
        &[-0.03, 0.0, 0.02]
    } else {
        &[0.0]
    };
    let shortest = DEEP_BUMP_M.max(corner.design_strut_length_m() - 0.1);
    (0..=12).flat_map(move |step| {
        let length = shortest + (longest - shortest) * f64::from(step) / 12.0;
        racks
            .iter()
            .map(move |rack| corner.pose(length, *rack).unwrap())
    })
}

/// Central differences of the first derivatives over 2e-6 m: exact to 1e-6 of the larger ones.
#[test]
fn second_derivatives_match_differences_of_the_first() {
    const STEP_M: f64 = 1e-6;
    let mut worst = 0.0_f64;
    for corner in corners().iter().chain(&struts()).chain(&others()) {
        for pose in poses(corner) {
            let path = corner.path(&pose);
            let (l, z) = (pose.strut_length_m, pose.rack_m);
            let rates = |l: f64, z: f64| {
                let pose = corner.pose(l, z).unwrap();
                let rates = corner.rates(&pose);
                [
                    rates.strut.wheel_centre,
                    rates.rack.wheel_centre,
                    rates.strut.rotation,
                    rates.rack.rotation,
                    Vector3::new(
                        rates.lower_angle_per_strut,
                        rates.upper_angle_per_strut,
                        0.0,
                    ),
                ]
            };
            let slope = |dl: f64, dz: f64| {
                let (after, before) = (rates(l + dl, z + dz), rates(l - dl, z - dz));
                std::array::from_fn::<_, 5, _>(|i| (after[i] - before[i]) / (2.0 * STEP_M))
            };
            let (by_strut, by_rack) = (slope(STEP_M, 0.0), slope(0.0, STEP_M));
            let wheel = &path.wheel;
            let mut check = |found: Vector3<f64>, expected: Vector3<f64>| {
                let miss = (found - expected).norm() / (10.0 + expected.norm());
                worst = worst.max(miss);
                assert!(
                    miss < 1e-6,
                    "{:?} {l} {z}: {found} {expected}",
                    corner.wheel
                );
            };
            check(wheel.travel.by_strut_strut, by_strut[0]);
            check(wheel.travel.by_strut_rack, by_strut[1]);
            check(wheel.travel.by_strut_rack, by_rack[0]);
            check(wheel.travel.by_rack_rack, by_rack[1]);
            check(wheel.rotation.by_strut_strut, by_strut[2]);
            check(
                wheel.rotation.by_strut_rack,
                (by_strut[3] + by_rack[2]) * 0.5,
            );
            check(wheel.rotation.by_rack_rack, by_rack[3]);
            check(
                path.lower_arm.rotation.by_strut_strut,
                corner.lower_axis * by_strut[4].x,
            );
            check(
                path.upper_arm.rotation.by_strut_strut,
                corner.upper_axis * by_strut[4].y,
            );
        }
    }
    println!("second derivatives off by {worst:.1e} of their size");
}

/// A member's joint moves across its line, but for what the rack pushes along it; the strut's end
/// moves along the strut as it lengthens.
#[test]
fn members_keep_their_length() {
    let others = others();
    let on_links = others.iter().filter(|corner| corner.links().is_some());
    for corner in corners().iter().chain(on_links) {
        for pose in poses(corner) {
            let at = Coordinates {
                strut: pose.strut_length_m,
                rack: pose.rack_m,
            };
            let pose = Linkage::pose(corner, at).unwrap();
            for (index, member) in corner.members(&pose).iter().enumerate() {
                let pull = member.pull();
                let travel = member.outboard.travel;
                let rack = if index == 4 {
                    pull.y * corner.rack_direction
                } else {
                    0.0
                };
                assert!(pull.dot(&travel.by_strut).abs() < 1e-12);
                assert!((pull.dot(&travel.by_rack) - rack).abs() < 1e-12);
            }
            let strut = corner.strut(&pose).unwrap();
            assert!((strut.direction.dot(&strut.outboard.travel.by_strut) - 1.0).abs() < 1e-12);
        }
    }
}

/// The upright of a MacPherson strut is rigid, its axis goes through the top at the strut's length, the arm and
/// the tie rod keep their lengths, and the wheel moves as the derivatives say.
#[test]
fn a_strut_guides_its_upright() {
    for corner in &struts() {
        let p = &corner.points;
        let axis = (p.strut_arm - p.strut_chassis).normalize();
        for pose in poses(corner) {
            let turned = pose.vehicle_from_upright;
            let from_ball = |point: Vector3<f64>| turned * (point - p.lower_ball);
            let close = |a: Vector3<f64>, b: Vector3<f64>| {
                assert!((a - b).norm() < 1e-12, "{a} {b} {pose:?}");
            };
            assert!((turned.determinant() - 1.0).abs() < 1e-12);
            close(pose.strut_arm_m - pose.lower_ball_m, from_ball(p.strut_arm));
            close(
                pose.tie_rod_outer_m - pose.lower_ball_m,
                from_ball(p.tie_rod_outer),
            );
            close(
                pose.wheel_centre_m - pose.lower_ball_m,
                from_ball(p.wheel_centre),
            );
            close(
                pose.strut_arm_m - turned * axis * pose.strut_length_m,
                p.strut_chassis,
            );
            for hinge in [p.lower_front, p.lower_rear] {
                let kept = (pose.lower_ball_m - hinge).norm() - (p.lower_ball - hinge).norm();
                assert!(kept.abs() < 1e-12);
            }
            let rod = |a: Vector3<f64>, b: Vector3<f64>| (a - b).norm();
            let kept = rod(pose.tie_rod_outer_m, pose.tie_rod_inner_m)
                - rod(p.tie_rod_outer, p.tie_rod_inner);
            assert!(kept.abs() < 1e-12);
            let again = corner
                .pose_at_angle(pose.lower_angle_rad, pose.rack_m)
                .unwrap();
            close(again.wheel_centre_m, pose.wheel_centre_m);
            let step = 1e-6;
            let at = |l: f64| corner.pose(pose.strut_length_m + l, pose.rack_m).unwrap();
            let moved = (at(step).wheel_centre_m - at(-step).wheel_centre_m) / (2.0 * step);
            let rates = corner.rates(&pose);
            assert!((moved - rates.strut.wheel_centre).norm() < 1e-7, "{moved}");
        }
        let design = corner.pose(corner.design_strut_length_m(), 0.0).unwrap();
        let ratio = corner.rates(&design).motion_ratio();
        println!(
            "motion ratio {ratio:.4}, bump steer {:.3} deg/m",
            corner.rates(&design).bump_steer_rad_m().to_degrees()
        );
    }
}

/// An upper arm that takes the other branch in deep bump turned 7.7 kN into 17.9 kN.
#[test]
fn deep_bump_stays_on_the_branch_of_the_design_position() {
    for corner in &corners() {
        let mut before = corner.pose(corner.design_strut_length_m(), 0.0).unwrap();
        let steps = ((before.strut_length_m - DEEP_BUMP_M) / 1e-4).round();
        let step = (before.strut_length_m - DEEP_BUMP_M) / steps;
        for count in 1..=steps as u32 {
            let length = corner.design_strut_length_m() - step * f64::from(count);
            let pose = corner.pose(length, 0.0).unwrap();
            let rates = corner.rates(&pose);
            for (now, last) in [
                (pose.upper_ball_m, before.upper_ball_m),
                (pose.lower_ball_m, before.lower_ball_m),
                (pose.tie_rod_outer_m, before.tie_rod_outer_m),
                (pose.wheel_centre_m, before.wheel_centre_m),
            ] {
                assert!((now - last).norm() < 4.0 * step, "{length}");
            }
            assert!(
                (2.0..3.0).contains(&-rates.strut.wheel_centre.z),
                "{length} {rates:?}"
            );
            before = pose;
        }
    }
}
