//! How soft ground enters the vehicle.

use nalgebra::Vector3;

use super::soil::{RigidWheel, SoftLayer};
use super::{Ground, GroundContact, Road, tread_width_m};
use crate::vehicle::Vehicle;

/// A road with the soil below the tyres of a vehicle.
///
/// Tyre and soil are two springs in series: the depth by which the tread envelope overlaps the road
/// is shared between the tyre and the sinkage z, such that k (depth - z) is the load of Bekker's
/// closed form, W = b (k_c/b + k_phi) (3 - n)/3 sqrt(2 R) z^(n + 1/2) (Wong, Theory of Ground
/// Vehicles, 2008, section 2.5). The sinkage is at most the thickness of the soft layer. The ground
/// lies lower by z. The friction is at most tan phi + c A/W with the area A of the contact, width b
/// and length sqrt(2 R depth) + sqrt(2 R (depth - z)). Bekker's compaction resistance,
/// b (k_c/b + k_phi) z^(n + 1)/(n + 1), adds to the rolling resistance.
///
/// The stiffness of the tyre is the mean of both axles. The soil has no memory: the second wheel in
/// a rut sinks in as the first does, and no rut stays. Slip stiffness is that of the tyre; the
/// shear displacement of Janosi and Hanamoto enters [`super::Soil::forces`] alone.
#[derive(Clone, Copy, Debug)]
pub struct SoftGround<'a> {
    road: &'a Road,
    /// Vertical stiffness of a tyre, N/m.
    stiffness_n_m: f64,
    /// Friction coefficient of a tyre on firm ground.
    friction: f64,
}

impl<'a> SoftGround<'a> {
    /// The road below a vehicle.
    #[must_use]
    pub fn new(road: &'a Road, vehicle: &Vehicle) -> Self {
        let [front, rear] = [&vehicle.front.tyre, &vehicle.rear.tyre];
        Self {
            road,
            stiffness_n_m: 0.5 * (front.vertical_stiffness_n_m + rear.vertical_stiffness_n_m),
            friction: 0.5 * (front.friction + rear.friction),
        }
    }

    /// Lets a wheel sink in.
    fn soften(
        &self,
        contact: &mut GroundContact,
        layer: &SoftLayer,
        centre_m: Vector3<f64>,
        wheel: RigidWheel,
    ) {
        let (soil, depth_m) = (&layer.soil, contact.depth_m);
        let sinkage_m = self.sinkage_m(layer, wheel, depth_m);
        let load_n = self.stiffness_n_m * (depth_m - sinkage_m);
        let pressed_m = depth_m - sinkage_m;
        let length_m = [depth_m, pressed_m].map(|depth| (2.0 * wheel.radius_m * depth).sqrt());
        let area_m2 = wheel.width_m * (length_m[0] + length_m[1]);
        let limit = math::tan(soil.friction_rad) + soil.cohesion_pa * area_m2 / load_n;
        let out = (centre_m - contact.point_m).normalize();
        contact.point_m -= out * sinkage_m;
        contact.depth_m = pressed_m;
        contact.ground_height_m -= sinkage_m;
        contact.friction = contact.friction.min(limit / self.friction);
        contact.resistance = soil.compaction_n(wheel, sinkage_m) / load_n;
    }

    /// The part of a depth by which the soil gives way. Newton's method from the deep side, where it
    /// converges without overshoot: the load grows faster than the sinkage (n + 1/2 >= 1).
    fn sinkage_m(&self, layer: &SoftLayer, wheel: RigidWheel, depth_m: f64) -> f64 {
        let mut sinkage_m = depth_m;
        for _ in 0..12 {
            let [load_n, stiffness_n_m] = layer.soil.bekker_load(wheel, sinkage_m);
            let over_n = load_n - self.stiffness_n_m * (depth_m - sinkage_m);
            sinkage_m -= over_n / (stiffness_n_m + self.stiffness_n_m);
        }
        sinkage_m.min(layer.depth_m)
    }
}

impl Ground for SoftGround<'_> {
    fn contact(
        &self,
        wheel_centre_m: Vector3<f64>,
        spindle: Vector3<f64>,
        radius_m: f64,
        width_m: f64,
    ) -> GroundContact {
        let mut contact = (self.road).contact(wheel_centre_m, spindle, radius_m, width_m);
        let layer = (self.road).soil(contact.point_m.x, contact.point_m.y);
        if let Some(layer) = layer
            && contact.depth_m > 0.0
        {
            let width_m = tread_width_m(radius_m, width_m);
            let wheel = RigidWheel { radius_m, width_m };
            self.soften(&mut contact, layer, wheel_centre_m, wheel);
        }
        contact
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tyre_and_soil_carry_the_same_load() {
        let text = "[part.pit]\nkind = \"soil\"\nsoil = \"sand\"\ndepth_m = 0.05\n";
        let none = |_: &str| Err(String::new());
        let road = Road::from_toml(text, "pit.toml", &none).expect("a road");
        let vehicle = Vehicle::builtin("prowler").expect("a vehicle");
        let ground = SoftGround::new(&road, &vehicle);
        let (radius_m, width_m) = (0.31, 0.2);
        let wheel = RigidWheel { radius_m, width_m };
        let contact = |depth_m: f64| {
            let centre = Vector3::new(1.0, 2.0, radius_m - depth_m);
            ground.contact(centre, Vector3::y(), radius_m, width_m)
        };
        let found = contact(0.06);
        let sinkage_m = 0.06 - found.depth_m;
        assert!((0.02..0.05).contains(&sinkage_m), "{sinkage_m}");
        assert!((found.ground_height_m + sinkage_m).abs() < 1e-9);
        assert!((found.point_m.z + sinkage_m).abs() < 1e-9);
        let soil = road.soil(0.0, 0.0).expect("sand").soil;
        let carried_n = soil.bekker_load(wheel, sinkage_m)[0];
        let load_n = ground.stiffness_n_m * found.depth_m;
        assert!(
            (carried_n / load_n - 1.0).abs() < 1e-9,
            "{carried_n} {load_n}"
        );
        // Sand shears before the tyre slides, and resists.
        assert!(found.friction < 1.0 && found.resistance > 0.05, "{found:?}");
        // Below the layer the ground is firm.
        assert!((contact(0.11).depth_m - 0.06).abs() < 1e-9);
        assert_eq!(contact(-0.01).resistance, 0.0);
    }
}
