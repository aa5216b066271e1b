use nalgebra::Vector3;
use sample::{STANDARD_GRAVITY_M_S2, Wheel};

use super::*;
use crate::suspension::{ChannelKind, CornerMotion, CornerStatics, TyreFrame, Wrench};
use crate::vehicle::{StrutOn, Vehicle};

/// The Prowler with a strut on the front leg of its lower arm, in the plane of the leg and of the arm's normal: as a
/// double wishbone, and on five links.
fn both() -> [Vehicle; 2] {
    let mut arms = Vehicle::builtin("prowler").unwrap();
    let w = arms.front.wishbone.as_mut().unwrap();
    let [hinge, rear, ball] = [w.lower_front_m, w.lower_rear_m, w.lower_ball_m].map(Vector3::from);
    let leg = ball - hinge;
    let normal = (hinge - ball).cross(&(rear - ball)).normalize();
    let mount = hinge + leg * 0.7;
    w.strut_arm_m = mount.into();
    w.strut_chassis_m =
        (mount + normal * (0.33 * normal.z.signum()) - leg.normalize() * 0.15).into();
    let w = w.clone();
    let unsprung = arms.front.unsprung.as_mut().unwrap();
    (unsprung.upper_arm_mass_kg, unsprung.lower_arm_mass_kg) = (0.0, 0.0);
    let mut links = arms.clone();
    links.front.wishbone = None;
    links.front.five_link = Some(FiveLink {
        wheel_centre_m: w.wheel_centre_m,
        upper_front_inner_m: w.upper_front_m,
        upper_front_outer_m: w.upper_ball_m,
        upper_rear_inner_m: w.upper_rear_m,
        upper_rear_outer_m: w.upper_ball_m,
        lower_front_inner_m: w.lower_front_m,
        lower_front_outer_m: w.lower_ball_m,
        lower_rear_inner_m: w.lower_rear_m,
        lower_rear_outer_m: w.lower_ball_m,
        tie_rod_inner_m: w.tie_rod_inner_m,
        tie_rod_outer_m: w.tie_rod_outer_m,
        strut_chassis_m: w.strut_chassis_m,
        strut_mount_m: w.strut_arm_m,
        strut_on: StrutOn::LowerFront,
    });
    [arms, links]
}

#[test]
fn five_links_with_common_ball_joints_are_a_double_wishbone() {
    let both = both();
    for wheel in [Wheel::FrontLeft, Wheel::FrontRight] {
        let [arms, links] = both.each_ref().map(|v| Corner::of(v, wheel).unwrap());
        for (length, rack) in [(-0.06, -0.02), (0.0, 0.0), (-0.02, 0.03), (0.04, 0.01)] {
            let length_m = arms.design_strut_length_m() + length;
            let poses = [&arms, &links].map(|corner| corner.pose(length_m, rack).unwrap());
            let close = |a: Vector3<f64>, b: Vector3<f64>, most: f64| {
                assert!((a - b).amax() < most, "{length} {rack}: {a} {b}");
            };
            close(poses[0].wheel_centre_m, poses[1].wheel_centre_m, 1e-11);
            close(poses[0].spindle, poses[1].spindle, 1e-11);
            let [a, b] = [arms.path(&poses[0]).wheel, links.path(&poses[1]).wheel];
            for [a, b] in [[a.travel, b.travel], [a.rotation, b.rotation]] {
                close(a.by_strut, b.by_strut, 1e-9);
                close(a.by_rack, b.by_rack, 1e-9);
                close(a.by_strut_strut, b.by_strut_strut, 1e-7);
                close(a.by_strut_rack, b.by_strut_rack, 1e-7);
                close(a.by_rack_rack, b.by_rack_rack, 1e-7);
            }
            let unsprung = both[0].front.unsprung.as_ref().unwrap();
            let forces = [(&arms, &poses[0]), (&links, &poses[1])].map(|(corner, pose)| {
                let frame = TyreFrame::new(pose, Vector3::z(), 0.31, 0.01);
                let motion = CornerMotion::at_rest(Vector3::z() * STANDARD_GRAVITY_M_S2);
                let kind = ChannelKind::Strut;
                let statics = CornerStatics::new(corner, pose, &frame, unsprung, &motion, kind);
                let wrench = Wrench {
                    force_n: Vector3::new(300.0, -900.0, 1500.0),
                    moment_n_m: Vector3::new(20.0, -8.0, 15.0),
                };
                statics.unwrap().members(&wrench).to_vector()
            });
            // Away from the design position, the strut also bends its leg in the plane of the arm.
            let same: &[usize] = if length == 0.0 {
                &[0, 1, 2, 3, 4, 5]
            } else {
                &[0, 1, 4, 5]
            };
            for k in same {
                assert!((forces[0][*k] - forces[1][*k]).abs() < 1e-6, "{forces:?}");
            }
        }
    }
}

/// Both sides are mirror images, and the inverse of the map gives the wrench back.
#[test]
fn right_corners_mirror_left_ones() {
    let text = include_str!("../../../../../../testdata/vehicle-with-links.toml");
    let mut vehicle = Vehicle::from_toml(text, "v.toml").unwrap();
    vehicle.body.cg_y_m = 0.0;
    for (left, right) in [
        (Wheel::FrontLeft, Wheel::FrontRight),
        (Wheel::RearLeft, Wheel::RearRight),
    ] {
        let corners = [left, right].map(|wheel| Corner::of(&vehicle, wheel).unwrap());
        let rack = if left.is_front() { 0.02 } else { 0.0 };
        let pose = |corner: &Corner, rack: f64| {
            let length_m = corner.design_strut_length_m() - 0.03;
            corner.pose(length_m, rack).unwrap()
        };
        let [a, b] = [pose(&corners[0], rack), pose(&corners[1], -rack)];
        let mirrored = b
            .wheel_centre_m
            .component_mul(&Vector3::new(1.0, -1.0, 1.0));
        assert!((a.wheel_centre_m - mirrored).amax() < 1e-12);
        assert!((a.steer_rad() + b.steer_rad()).abs() < 1e-12);
        assert!(a.steer_rad().abs() > 1e-3 || !left.is_front());
        let at = corners[0].pose_at_jounce(0.04, rack).unwrap();
        assert!((at.wheel_centre_m.z - corners[0].points.wheel_centre.z - 0.04).abs() < 1e-11);
    }
}

#[test]
fn lengths_and_racks_out_of_reach_are_refused_by_name() {
    let text = include_str!("../../../../../../testdata/vehicle-with-links.toml");
    let vehicle = Vehicle::from_toml(text, "v.toml").unwrap();
    let corner = Corner::of(&vehicle, Wheel::FrontLeft).unwrap();
    let length_m = corner.design_strut_length_m();
    let what = |length_m: f64, rack_m: f64| match corner.pose(length_m, rack_m) {
        Err(SuspensionError::OutOfReach { what, .. }) => what,
        other => panic!("{other:?}"),
    };
    assert_eq!(what(length_m - 0.4, 0.0), "strut length");
    assert_eq!(what(length_m, 0.3), "rack travel");
    assert!(corner.pose(f64::NAN, 0.0).is_err());
    let mut parallel = vehicle.clone();
    let links = parallel.front.five_link.as_mut().unwrap();
    for (inner, outer) in [
        (&mut links.upper_front_inner_m, links.upper_front_outer_m),
        (&mut links.upper_rear_inner_m, links.upper_rear_outer_m),
        (&mut links.lower_front_inner_m, links.lower_front_outer_m),
        (&mut links.lower_rear_inner_m, links.lower_rear_outer_m),
    ] {
        *inner = [outer[0], outer[1] - 0.3, outer[2]];
    }
    let error = Corner::of(&parallel, Wheel::FrontLeft).unwrap_err();
    assert!(error.to_string().contains("parallel"), "{error}");
}
