//! What is driven: the model that the vehicle file allows.

use model::chassis::four_wheel::Pose;
use model::vehicle::Vehicle;

use super::four_wheel::FourWheel;
use super::fourteen_dof::FourteenDof;
use crate::{SimError, TruthState};

/// What a driver and the ground do to the car.
#[derive(Clone, Copy, Debug)]
pub(super) struct Commands {
    /// Steer angle of each road wheel, rad.
    pub(super) steer_rad: [f64; 4],
    /// Drive torque of each wheel, N m.
    pub(super) drive_n_m: [f64; 4],
    /// Brake torque of each wheel, N m.
    pub(super) brake_n_m: [f64; 4],
    /// Factor on each tyre's friction.
    pub(super) friction_scale: [f64; 4],
    /// Factor on each tyre's slip stiffnesses.
    pub(super) stiffness_scale: [f64; 4],
}

impl Commands {
    /// Straight ahead without torque, on the file's ground.
    pub(super) const fn coasting() -> Self {
        Self {
            steer_rad: [0.0; 4],
            drive_n_m: [0.0; 4],
            brake_n_m: [0.0; 4],
            friction_scale: [1.0; 4],
            stiffness_scale: [1.0; 4],
        }
    }
}

/// A car under way.
pub(super) enum Car {
    /// With springs and unsprung masses: its wheels can leave the ground.
    FourteenDof(Box<FourteenDof>),
    /// For vehicle files without them.
    FourWheel(Box<FourWheel>),
}

impl Car {
    /// The car at a speed, straight ahead.
    pub(super) fn new(vehicle: &Vehicle, speed_m_s: f64) -> Result<Self, SimError> {
        Ok(match FourteenDof::new(vehicle, speed_m_s)? {
            Some(car) => Self::FourteenDof(Box::new(car)),
            None => Self::FourWheel(Box::new(FourWheel::new(vehicle, speed_m_s))),
        })
    }

    /// Moves on.
    pub(super) fn advance(&mut self, commands: &Commands, step_s: f64) {
        match self {
            Self::FourteenDof(car) => car.advance(commands, step_s),
            Self::FourWheel(car) => car.advance(commands, step_s),
        }
    }

    /// What is true now, without time and hand wheel.
    pub(super) fn truth(&self, commands: &Commands) -> TruthState {
        match self {
            Self::FourteenDof(car) => car.truth(commands),
            Self::FourWheel(car) => car.truth(commands),
        }
    }

    /// Forward speed, m/s.
    pub(super) fn speed_m_s(&self) -> f64 {
        match self {
            Self::FourteenDof(car) => car.speed_m_s(),
            Self::FourWheel(car) => car.speed_m_s(),
        }
    }

    /// Yaw rate, rad/s.
    pub(super) fn yaw_rate_rad_s(&self) -> f64 {
        match self {
            Self::FourteenDof(car) => car.yaw_rate_rad_s(),
            Self::FourWheel(car) => car.yaw_rate_rad_s(),
        }
    }

    /// Where the centre of gravity is.
    pub(super) fn place(&self) -> Pose {
        match self {
            Self::FourteenDof(car) => car.place(),
            Self::FourWheel(car) => car.place(),
        }
    }

    /// Rolling radius of the rear wheels, m.
    pub(super) fn rolling_radius_m(&self) -> f64 {
        match self {
            Self::FourteenDof(car) => car.rolling_radius_m(),
            Self::FourWheel(car) => car.rolling_radius_m(),
        }
    }

    /// Strut lengths, where the model has struts, m.
    pub(super) fn strut_lengths_m(&self) -> Option<[f64; 4]> {
        match self {
            Self::FourteenDof(car) => Some(car.strut_lengths_m()),
            Self::FourWheel(_) => None,
        }
    }
}
