use nalgebra::{Matrix3, Rotation3, Vector3};
use sample::WheelAxes;

use super::*;

/// A wheel in a turn: its aligning moment, moved to the wheel centre by the exact axes and the place of the contact point
/// in the plane of the wheel, comes back.
#[test]
fn the_moment_about_the_contact_point_comes_back_from_that_about_the_wheel_centre() {
    let vehicle = Vehicle::builtin("prowler").unwrap();
    let tyre = &vehicle.rear.tyre;
    for (roll, pitch, steer, camber, force_n) in [
        (0.05, 0.02, 0.0, 0.01, [90.0, 520.0, 1900.0]),
        (-0.06, -0.03, 0.0, 0.02, [60.0, -700.0, 1500.0]),
        (0.04, 0.015, 0.25, -0.03, [-40.0, 400.0, 1200.0]),
    ] {
        // On level ground; the axes of the body are turned about z, y and x.
        let body = Rotation3::from_euler_angles(roll, pitch, 0.0).inverse();
        let normal: Vector3<f64> = body * Vector3::z();
        let (sin, cos) = math::sin_cos(steer);
        let (lean, upright) = math::sin_cos(camber);
        let spindle = Vector3::new(-sin * upright, cos * upright, lean);
        let upward = (normal - spindle * normal.dot(&spindle)).normalize();
        let [carrier, contact] = [
            WheelAxes::carrier(spindle.into()),
            WheelAxes::contact(spindle.into(), normal.into()),
        ]
        .map(|axes| Matrix3::from_fn(|row, column| axes.rows()[row][column]));
        let radius_m = tyre.unloaded_radius_m - force_n[2] / tyre.vertical_stiffness_n_m;
        let rolling_n_m = tyre.rolling_resistance * tyre.unloaded_radius_m * force_n[2];
        let aligning_n_m = -0.03 * force_n[1];
        let from_contact = contact.transpose();
        let moment = from_contact * Vector3::new(0.0, -rolling_n_m, aligning_n_m)
            + (-radius_m * upward).cross(&(from_contact * Vector3::from(force_n)));
        let wheel = Wheel::RearLeft;
        let of_wheel = |value: f64| {
            let mut wheels = PerWheel::<Vec<f64>>::default();
            wheels[wheel] = vec![value];
            wheels
        };
        let mut forces = PerWheel::<[Vec<f64>; 3]>::default();
        forces[wheel] = force_n.map(|force| vec![force]);
        let motion = Motion {
            roll_rad: vec![roll],
            pitch_rad: vec![pitch],
            slope_rad: [vec![0.0], vec![0.0]],
            steer_rad: of_wheel(steer),
            ..Motion::default()
        };
        let forces = TyreForces {
            force_n: forces,
            aligning_n_m: of_wheel((carrier * moment).z),
            fused: true,
        };
        let recorded = Recorded::new(vehicle.clone(), motion, forces);
        let inclination_rad = math::asin(spindle.dot(&normal));
        let found = recorded.about_contact(wheel, 0, inclination_rad);
        // The part of the load along the spindle changes the first turn by 0.7 N m.
        assert!(
            (found - aligning_n_m).abs() < 0.1,
            "{found} for {aligning_n_m}"
        );
    }
}
