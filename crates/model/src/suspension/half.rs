//! Half car: heave and pitch over both axles (section 2.2.2 of the thesis, which prints its state
//! 2.22 and no equations), or heave and roll over one axle.

use nalgebra::{SMatrix, SVector};
use sample::Wheel;

use super::SuspensionError;
use super::quarter::sprung_masses_kg;
use super::ride::{Assembly, Ride, RideCorner};
use crate::vehicle::Vehicle;

/// Half car; degrees of freedom z_s (at the body's centre of gravity), body angle, and both
/// wheels' heights.
pub type HalfCar = Ride<4, 8, 2>;

impl HalfCar {
    /// The longitudinal model: both wheels of an axle together, pitch nose down positive.
    ///
    /// m_s z_s'' = sum F_i, I_y theta'' = -sum x_i F_i, with F_i = k_i d_i + b_i d_i' and the
    /// compression d_i = z_i - (z_s - x_i theta). Angles are small (2.23, 2.24).
    ///
    /// # Errors
    /// When a value is not finite, a mass not positive, or a stiffness or damping negative.
    pub fn longitudinal(
        sprung_mass_kg: f64,
        pitch_inertia_kg_m2: f64,
        axle_x_m: [f64; 2],
        axles: [RideCorner; 2],
    ) -> Result<Self, SuspensionError> {
        let lever = axle_x_m.map(|x| -x);
        Self::on_levers(sprung_mass_kg, pitch_inertia_kg_m2, lever, axles, 0.0)
    }

    /// The lateral model of one axle, left wheel first, roll right side down positive:
    /// compression d_i = z_i - (z_s + y_i phi). The anti-roll bar's stiffness is in N m/rad.
    ///
    /// # Errors
    /// When a value is not finite, a mass not positive, or a stiffness or damping negative.
    pub fn lateral(
        sprung_mass_kg: f64,
        roll_inertia_kg_m2: f64,
        track_m: f64,
        corner: RideCorner,
        anti_roll_bar_n_m_rad: f64,
    ) -> Result<Self, SuspensionError> {
        let lever = [0.5 * track_m, -0.5 * track_m];
        let bar = anti_roll_bar_n_m_rad / track_m.powi(2);
        Self::on_levers(sprung_mass_kg, roll_inertia_kg_m2, lever, [corner; 2], bar)
    }

    /// A vehicle's longitudinal half car, both sides together, with its whole sprung mass.
    ///
    /// # Errors
    /// When an axle's hard-points are degenerate.
    pub fn of(vehicle: &Vehicle) -> Result<Self, SuspensionError> {
        let sprung = vehicle.sprung();
        let both = |corner: RideCorner| RideCorner {
            unsprung_mass_kg: 2.0 * corner.unsprung_mass_kg,
            stiffness_n_m: 2.0 * corner.stiffness_n_m,
            damping_n_s_m: 2.0 * corner.damping_n_s_m,
            tyre_stiffness_n_m: 2.0 * corner.tyre_stiffness_n_m,
            tyre_damping_n_s_m: 2.0 * corner.tyre_damping_n_s_m,
        };
        Self::longitudinal(
            sprung.mass_kg,
            sprung.inertia_kg_m2[1],
            [
                vehicle.body.front_axle_to_cg_m - sprung.cg_m[0],
                -vehicle.body.cg_to_rear_axle_m - sprung.cg_m[0],
            ],
            [
                both(RideCorner::of(vehicle, Wheel::FrontLeft)?),
                both(RideCorner::of(vehicle, Wheel::RearLeft)?),
            ],
        )
    }

    /// A vehicle's lateral half car over the axle of `wheel`, with the axle's share of the sprung
    /// mass and roll inertia.
    ///
    /// # Errors
    /// When the axle's hard-points are degenerate.
    pub fn lateral_of(vehicle: &Vehicle, wheel: Wheel) -> Result<Self, SuspensionError> {
        let sprung = vehicle.sprung();
        let mass = sprung_masses_kg(vehicle)[usize::from(!wheel.is_front())];
        let axle = vehicle.axle(wheel);
        Self::lateral(
            mass,
            sprung.inertia_kg_m2[0] * mass / sprung.mass_kg,
            axle.track_m,
            RideCorner::of(vehicle, wheel)?,
            axle.anti_roll_bar_n_m_rad,
        )
    }

    fn on_levers(
        sprung_mass_kg: f64,
        inertia_kg_m2: f64,
        lever_m: [f64; 2],
        corners: [RideCorner; 2],
        bar_n_m: f64,
    ) -> Result<Self, SuspensionError> {
        Self::assemble(&Assembly {
            body_mass: SVector::from([sprung_mass_kg, inertia_kg_m2, 0.0, 0.0]),
            lift: SMatrix::from([[1.0, 1.0], lever_m, [0.0; 2], [0.0; 2]]),
            corners,
            bars: [(bar_n_m > 0.0).then_some((0, 1, bar_n_m)), None],
        })
    }
}
