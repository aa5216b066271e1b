use serde::{Deserialize, Serialize};

use crate::Tuning;

/// Settings of the estimator beside vehicle, sensors and calibration.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// How tyre forces are estimated.
    pub method: Method,
    /// Inputs that are ignored, as if they were not fitted.
    pub ignore: Vec<Input>,
    /// Payloads of the vehicle file that are on the vehicle at the start.
    pub payload: Vec<String>,
    /// Radius of the curve whose largest speed is wanted, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub curve_radius_m: Option<f64>,
    /// Friction with which the vehicle model computes its forces.
    #[serde(skip_serializing_if = "ModelFriction::is_of_vehicle")]
    pub model_friction: ModelFriction,
    /// Tuned numbers.
    pub tuning: Tuning,
}

impl Settings {
    /// Whether an input is used.
    #[must_use]
    pub fn uses(&self, input: Input) -> bool {
        !self.ignore.contains(&input)
    }
}

/// Friction coefficients of the vehicle model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ModelFriction {
    /// Those of the vehicle file.
    #[default]
    Vehicle,
    /// Those that the drive has shown, while they are known; else those of the vehicle file.
    Found,
}

impl ModelFriction {
    // serde hands out a reference.
    #[allow(clippy::trivially_copy_pass_by_ref)]
    fn is_of_vehicle(&self) -> bool {
        *self == Self::Vehicle
    }
}

/// How tyre forces are estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Method of the thesis: statics of each corner by itself, from strain and deflection, at each
    /// instant without memory.
    Thesis,
    /// One filter over all corners, with the inertial unit's balance of forces and moments.
    #[default]
    Fusion,
}

/// A kind of measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Input {
    /// Strain channels.
    Strain,
    /// Spring potentiometers.
    Deflection,
    /// Inertial unit.
    Imu,
    /// GNSS velocity.
    GnssVelocity,
    /// GNSS attitude.
    GnssAttitude,
    /// Wheel speeds.
    WheelSpeed,
    /// Steering-wheel angle.
    Steer,
    /// Velocity over ground, body axes.
    GroundSpeed,
    /// Hub accelerometers.
    HubAcceleration,
}
