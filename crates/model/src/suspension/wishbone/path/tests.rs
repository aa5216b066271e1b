use nalgebra::Vector3;
use sample::Wheel;

use crate::suspension::linkage::{Coordinates, Linkage};
use crate::suspension::{Corner, CornerPose};
use crate::vehicle::Vehicle;

/// Shortest strut of the Prowler in deep bump, m: 24 mm into the front stop, 37 mm into the rear
/// one.
const DEEP_BUMP_M: f64 = 0.285;

fn corners() -> [Corner; 4] {
    let vehicle = Vehicle::builtin("prowler").unwrap();
    Wheel::ALL.map(|wheel| Corner::of(&vehicle, wheel).unwrap())
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
    (0..=12).flat_map(move |step| {
        let length = DEEP_BUMP_M + (longest - DEEP_BUMP_M) * f64::from(step) / 12.0;
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
    for corner in &corners() {
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
    for corner in &corners() {
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
