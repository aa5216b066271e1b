//! What is driven: the model that the vehicle file allows.

use model::chassis::four_wheel::{Parameters, Pose};
use model::vehicle::Vehicle;

use super::four_wheel::FourWheel;
use super::fourteen_dof::FourteenDof;
use crate::{SimError, TruthState};

/// What a driver and the ground do to the car.
#[derive(Clone, Copy, Debug)]
pub(super) struct Commands {
    /// Steer angle of each road wheel, rad.
    pub(super) steer_rad: [f64; 4],
    /// Displacement of the inner end of each tie rod beside the rack, m.
    pub(super) rod_shift_m: [f64; 4],
    /// Drive torque of each wheel, N m.
    pub(super) drive_n_m: [f64; 4],
    /// Brake torque of each wheel, N m.
    pub(super) brake_n_m: [f64; 4],
    /// Bank of the ground below the car, rad: right side down positive.
    pub(super) bank_rad: f64,
    /// Grade of the ground, rad: nose down positive.
    pub(super) grade_rad: f64,
    /// Factor on each tyre's friction.
    pub(super) friction_scale: [f64; 4],
    /// Factor on each tyre's slip stiffnesses.
    pub(super) stiffness_scale: [f64; 4],
}

impl Commands {
    /// Straight ahead without torque, on the file's ground, level.
    pub(super) const fn coasting() -> Self {
        Self {
            steer_rad: [0.0; 4],
            rod_shift_m: [0.0; 4],
            drive_n_m: [0.0; 4],
            brake_n_m: [0.0; 4],
            bank_rad: 0.0,
            grade_rad: 0.0,
            friction_scale: [1.0; 4],
            stiffness_scale: [1.0; 4],
        }
    }
}

/// Greatest product of step and decay rate; Runge and Kutta's method of fourth order loses its hold
/// at 2.8.
pub(super) const DECAY_A_STEP: f64 = 1.5;
/// A tyre's slip stiffness may grow by this factor with load.
const STIFFER: f64 = 1.6;

/// A car under way.
pub(super) struct Car {
    model: Model,
    /// Decay rate of a wheel's slip near rest where it does not relax, 1/s.
    decay_1_s: f64,
}

enum Model {
    /// With springs and unsprung masses: its wheels can leave the ground.
    FourteenDof(Box<FourteenDof>),
    /// For vehicle files without them.
    FourWheel(Box<FourWheel>),
}

impl Car {
    /// The car at a speed, straight ahead.
    pub(super) fn new(vehicle: &Vehicle, speed_m_s: f64) -> Result<Self, SimError> {
        let model = match FourteenDof::new(vehicle, speed_m_s)? {
            Some(car) => Model::FourteenDof(Box::new(car)),
            None => Model::FourWheel(Box::new(FourWheel::new(vehicle, speed_m_s))),
        };
        Ok(Self {
            model,
            decay_1_s: decay_1_s(vehicle),
        })
    }

    /// Moves on, in as many steps as the wheels' slip asks for.
    pub(super) fn advance(&mut self, commands: &Commands, step_s: f64) {
        let parts = (step_s * self.decay_1_s / DECAY_A_STEP).ceil().max(1.0);
        for _ in 0..parts as u32 {
            match &mut self.model {
                Model::FourteenDof(car) => car.advance(commands, step_s / parts),
                Model::FourWheel(car) => car.advance(commands, step_s / parts),
            }
        }
    }

    /// What is true now, without time and steering wheel.
    pub(super) fn truth(&self, commands: &Commands) -> TruthState {
        match &self.model {
            Model::FourteenDof(car) => car.truth(commands),
            Model::FourWheel(car) => car.truth(commands),
        }
    }

    /// Forward speed, m/s.
    pub(super) fn speed_m_s(&self) -> f64 {
        match &self.model {
            Model::FourteenDof(car) => car.speed_m_s(),
            Model::FourWheel(car) => car.speed_m_s(),
        }
    }

    /// Yaw rate, rad/s.
    pub(super) fn yaw_rate_rad_s(&self) -> f64 {
        match &self.model {
            Model::FourteenDof(car) => car.yaw_rate_rad_s(),
            Model::FourWheel(car) => car.yaw_rate_rad_s(),
        }
    }

    /// Where the centre of gravity is.
    pub(super) fn place(&self) -> Pose {
        match &self.model {
            Model::FourteenDof(car) => car.place(),
            Model::FourWheel(car) => car.place(),
        }
    }

    /// Rolling radius of the rear wheels, m.
    pub(super) fn rolling_radius_m(&self) -> f64 {
        match &self.model {
            Model::FourteenDof(car) => car.rolling_radius_m(),
            Model::FourWheel(car) => car.rolling_radius_m(),
        }
    }

    /// Strut lengths, where the model has struts, m.
    pub(super) fn strut_lengths_m(&self) -> Option<[f64; 4]> {
        match &self.model {
            Model::FourteenDof(car) => Some(car.strut_lengths_m()),
            Model::FourWheel(_) => None,
        }
    }
}

/// C R^2/(I v) with the speed v below which slip is blended; zero where slip relaxes.
pub(super) fn decay_1_s(vehicle: &Vehicle) -> f64 {
    let parameters = Parameters::from_vehicle(vehicle);
    let axles = [
        (&parameters.front, &vehicle.front.tyre),
        (&parameters.rear, &vehicle.rear.tyre),
    ];
    let rates = axles.map(|(axle, tyre)| {
        if axle.relaxation_length_m > 0.0 {
            return 0.0;
        }
        let stiffness = STIFFER * tyre.slip_stiffness_n;
        stiffness * axle.rolling_radius_m.powi(2)
            / (axle.spin_inertia_kg_m2 * parameters.low_speed_m_s)
    });
    rates[0].max(rates[1])
}
