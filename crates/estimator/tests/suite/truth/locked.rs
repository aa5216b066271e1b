//! A truth run whose axles are locked: in a turn one wheel of each pushes and the other is dragged.

use model::suspension::{ChannelKind, Corner, CornerMotion, CornerStatics, TyreFrame};
use model::vehicle::Vehicle;
use nalgebra::{Vector3, Vector6};
use sample::Wheel;
use testkit::truth::Run;

const LINKS: [&str; 5] = [
    "UCA_tubeF_T",
    "UCA_tubeB_T",
    "LCA_tubeF_T",
    "LCA_tubeB_T",
    "tierod_T",
];

/// Adds `more_n(row)` of F_x to the rear left wheel and takes it off the right one, and the opposite
/// in front, so that the body turns as before: the half-shafts' torques, the links' forces, and of
/// the loads what leaves the struts where they are.
pub fn lock_axles(run: &mut Run, vehicle: &Vehicle, more_n: impl Fn(usize) -> f64) {
    let rack_m_rad = vehicle.steering.rack_m_rad.unwrap();
    for wheel in Wheel::ALL {
        let name = wheel.abbreviation();
        let axle = vehicle.axle(wheel);
        let share = match wheel.is_front() {
            true => -vehicle.rear.track_m / vehicle.front.track_m,
            false => 1.0,
        };
        let share = if wheel.is_left() { share } else { -share };
        let corner = Corner::of(vehicle, wheel).unwrap();
        for row in 0..run.rows {
            let forward = share * more_n(row);
            let at = |column: &str| run.column(column)[row];
            let of_wheel = |column: &str| at(&format!("{name}_{column}"));
            let (sin_roll, cos_roll) = math::sin_cos(at("roll"));
            let (sin_pitch, cos_pitch) = math::sin_cos(at("pitch"));
            let normal = Vector3::new(-sin_pitch, cos_pitch * sin_roll, cos_pitch * cos_roll);
            let rack = if wheel.is_front() {
                rack_m_rad * at("handwheel")
            } else {
                0.0
            };
            let pose = corner.pose(of_wheel("spring_len"), rack).unwrap();
            let radius = axle.tyre.unloaded_radius_m;
            let pressed = of_wheel("Fz") / axle.tyre.vertical_stiffness_n_m;
            let frame = TyreFrame::new(&pose, normal, radius, pressed);
            let statics = CornerStatics::new(
                &corner,
                &pose,
                &frame,
                axle.unsprung.as_ref().unwrap(),
                &CornerMotion::default(),
                ChannelKind::Strut,
            )
            .unwrap();
            let spindle = frame.vehicle_from_tyre.transpose() * pose.spindle;
            let torque = spindle * (forward * (radius - pressed));
            let mut wrench = Vector6::new(forward, 0.0, 0.0, torque.x, torque.y, torque.z);
            let map = &statics.members_from_wrench;
            wrench[2] = -(map.row(5) * wrench)[0] / map[(5, 2)];
            let members = map * wrench;
            let mut add = |column: &str, value: f64| {
                run.columns.get_mut(&format!("{name}_{column}")).unwrap()[row] += value;
            };
            add("Fx", forward);
            add("Fz", wrench[2]);
            for (link, force) in LINKS.iter().zip(members.iter()) {
                add(link, *force);
            }
        }
    }
}
