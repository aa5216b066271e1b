//! The vehicle's parameters in the balances of forces and moments.

use model::vehicle::{Tyre, Vehicle};
use nalgebra::Matrix3;
use sample::Wheel;

/// Parameters of the vehicle in the balances.
#[derive(Clone, Debug)]
pub(super) struct Body {
    pub(super) mass_kg: f64,
    pub(super) inertia: Matrix3<f64>,
    pub(super) inverse: Matrix3<f64>,
    pub(super) cg_height_m: f64,
    pub(super) drag: f64,
    pub(super) rolling: [f64; 4],
    pub(super) tyres: [Tyre; 4],
    pub(super) spin_inertia: [f64; 4],
    pub(super) static_load: [f64; 4],
}

impl Body {
    pub(super) fn new(vehicle: &Vehicle) -> Self {
        let body = &vehicle.body;
        let xz = -body.inertia_xz_kg_m2;
        // Of the whole vehicle: what moves against the frame is in the balances by itself.
        let [roll, pitch, yaw] = body.inertia_kg_m2;
        let inertia = Matrix3::new(roll, 0.0, xz, 0.0, pitch, 0.0, xz, 0.0, yaw);
        let axles = [&vehicle.front, &vehicle.front, &vehicle.rear, &vehicle.rear];
        Self {
            mass_kg: body.mass_kg,
            inertia,
            inverse: inertia.try_inverse().unwrap_or_else(Matrix3::zeros),
            cg_height_m: body.cg_height_m,
            drag: body.drag_n_s2_m2,
            tyres: axles.map(|a| a.tyre.clone()),
            rolling: axles.map(|a| a.tyre.rolling_resistance * a.tyre.unloaded_radius_m),
            spin_inertia: axles.map(|a| {
                a.unsprung
                    .as_ref()
                    .map_or(0.0, |part| part.wheel_spin_inertia_kg_m2)
            }),
            static_load: Wheel::ALL.map(|wheel| vehicle.static_load_n(wheel)),
        }
    }
}
