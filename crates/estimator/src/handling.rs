//! Handling parameters of a vehicle.

use model::vehicle::{Axle, Vehicle};
use sample::STANDARD_GRAVITY_M_S2;
use serde::{Deserialize, Serialize};

/// Curve shapes that [`normalised_force`](crate::planar::normalised_force) is meant for.
pub const SHAPE_RANGE: [f64; 2] = [1.2, 6.0];

/// Handling parameters, as [`crate::identification::handling`] estimates them and a calibration
/// file stores them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Handling {
    /// Cornering stiffness of the front axle at its static load, steering and suspension included,
    /// N/rad.
    pub front_stiffness_n_rad: f64,
    /// The same of the rear axle, N/rad.
    pub rear_stiffness_n_rad: f64,
    /// Greatest lateral force of the front axle over its load.
    pub front_friction: f64,
    /// The same of the rear axle.
    pub rear_friction: f64,
    /// Shape n of the front axle's curve x/(1 + |x|^n)^(1/n).
    pub front_shape: f64,
    /// The same of the rear axle.
    pub rear_shape: f64,
    /// Yaw inertia, kg m^2.
    pub yaw_inertia_kg_m2: f64,
    /// Accelerometer reading over lateral acceleration: above 1, since the body rolls.
    pub roll_gain: f64,
    /// Road-wheel angle over the angle that the vehicle file's steering ratio gives.
    pub steer_gain: f64,
    /// Part of the driving force that the front axle has.
    pub drive_split_front: f64,
    /// Part of the braking force that the front axle has.
    pub brake_split_front: f64,
    /// Height whose moment moves load from axle to axle, m.
    pub load_transfer_height_m: f64,
    /// Way on which a slip angle builds up, m.
    pub relaxation_length_m: f64,
}

impl Handling {
    /// Handling parameters from the vehicle file alone.
    #[must_use]
    pub fn of_vehicle(vehicle: &Vehicle) -> Self {
        let body = &vehicle.body;
        let (a, b) = (body.front_axle_to_cg_m, body.cg_to_rear_axle_m);
        let weight = body.mass_kg * STANDARD_GRAVITY_M_S2 / (a + b);
        let stiffness = |axle: &Axle, load_n: f64| {
            let tyre = &axle.tyre;
            let ratio = 0.5 * load_n / tyre.reference_load_n;
            2.0 * tyre.cornering_stiffness_n_rad * math::powf(ratio, tyre.load_exponent)
        };
        let roll: f64 = [&vehicle.front, &vehicle.rear]
            .iter()
            .map(|axle| axle.roll_stiffness_n_m_rad)
            .sum();
        let arm = body.cg_height_m
            - (vehicle.front.roll_centre_height_m * b + vehicle.rear.roll_centre_height_m * a)
                / (a + b);
        let moment = body.mass_kg * arm.max(0.0);
        let left = (roll - moment * STANDARD_GRAVITY_M_S2)
            .max(0.2 * roll)
            .max(1.0);
        Self {
            front_stiffness_n_rad: stiffness(&vehicle.front, weight * b),
            rear_stiffness_n_rad: stiffness(&vehicle.rear, weight * a),
            front_friction: vehicle.front.tyre.friction,
            rear_friction: vehicle.rear.tyre.friction,
            front_shape: 2.0,
            rear_shape: 2.0,
            yaw_inertia_kg_m2: body.inertia_kg_m2[2],
            roll_gain: 1.0 + STANDARD_GRAVITY_M_S2 * moment / left,
            steer_gain: 1.0,
            drive_split_front: vehicle.drivetrain.drive_split_front,
            brake_split_front: vehicle.drivetrain.brake_split_front,
            load_transfer_height_m: body.cg_height_m,
            relaxation_length_m: 0.5,
        }
    }

    /// Name and value of the first parameter that no vehicle can have.
    #[must_use]
    pub fn implausible(&self) -> Option<(&'static str, f64)> {
        let [least_shape, most_shape] = SHAPE_RANGE;
        [
            (
                "front_stiffness_n_rad",
                self.front_stiffness_n_rad,
                1e2,
                1e7,
            ),
            ("rear_stiffness_n_rad", self.rear_stiffness_n_rad, 1e2, 1e7),
            ("front_friction", self.front_friction, 0.05, 5.0),
            ("rear_friction", self.rear_friction, 0.05, 5.0),
            ("front_shape", self.front_shape, least_shape, most_shape),
            ("rear_shape", self.rear_shape, least_shape, most_shape),
            ("yaw_inertia_kg_m2", self.yaw_inertia_kg_m2, 1.0, 1e7),
            ("roll_gain", self.roll_gain, 0.5, 2.0),
            ("steer_gain", self.steer_gain, 0.2, 5.0),
            ("drive_split_front", self.drive_split_front, -0.5, 1.5),
            ("brake_split_front", self.brake_split_front, -0.5, 1.5),
            (
                "load_transfer_height_m",
                self.load_transfer_height_m,
                0.0,
                5.0,
            ),
            ("relaxation_length_m", self.relaxation_length_m, 0.05, 5.0),
        ]
        .into_iter()
        .find(|(_, value, least, most)| !(*least..=*most).contains(value))
        .map(|(name, value, _, _)| (name, value))
    }
}
