//! The vehicle's parameters in the balances of forces and moments.

use model::vehicle::{Tyre, Vehicle};
use nalgebra::{Matrix3, Vector3};
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
        let sprung = vehicle.sprung();
        let to_cg = Vector3::new(
            sprung.cg_m[0],
            sprung.cg_m[1],
            sprung.cg_m[2] - body.cg_height_m,
        );
        // Wheels and uprights do not roll or pitch with the body, but they yaw with it.
        let away = sprung.mass_kg * to_cg.norm_squared();
        let roll = sprung.inertia_kg_m2[0] + away - sprung.mass_kg * to_cg.x * to_cg.x;
        let pitch = sprung.inertia_kg_m2[1] + away - sprung.mass_kg * to_cg.y * to_cg.y;
        let xz = -body.inertia_xz_kg_m2;
        let inertia = Matrix3::new(
            roll,
            0.0,
            xz,
            0.0,
            pitch,
            0.0,
            xz,
            0.0,
            body.inertia_kg_m2[2],
        );
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
