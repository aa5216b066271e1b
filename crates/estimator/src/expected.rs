//! Tyre forces that the four-wheel model expects from steer angles and motion (section 2.1.2 of the
//! thesis). Inputs of the model are the measured steer angles, the speed, and the estimated bank
//! and grade of the ground; sideslip, yaw rate, roll, pitch and forces are outputs.
//!
//! The speed is given, so that a model that spins would never stop: its tyres would stay at their friction. A model
//! whose sideslip differs from the estimated one by more than `spun_rad` begins again with the estimated motion.

use model::chassis::four_wheel::{self, Inputs, Parameters, State};
use model::simulation::Model;
use model::vehicle::Vehicle;
use sample::{ForceSource, Motion, PerWheel, TyreForce};

use crate::tuning::ExpectedTuning;

/// Steps of the integration in one step of the grid.
const SUBSTEPS: usize = 2;

/// The model's state.
#[derive(Clone, Debug)]
pub struct ExpectedForces {
    parameters: Parameters,
    state: State<f64>,
    drive_split_front: f64,
    brake_split_front: f64,
    slip_stiffness_n: [f64; 2],
    tuning: ExpectedTuning,
}

/// What the model takes from the estimator in one step.
#[derive(Clone, Copy, Debug)]
pub struct ExpectedInput<'a> {
    /// Forward speed, m/s.
    pub speed_m_s: f64,
    /// Estimated sideslip angle, rad.
    pub sideslip_rad: f64,
    /// Estimated yaw rate, rad/s.
    pub yaw_rate_rad_s: f64,
    /// Longitudinal acceleration, bank and grade. These three give the sum of drive and brake forces.
    pub motion: &'a Motion,
    /// Steer angles of the road wheels, rad.
    pub steer_rad: [f64; 4],
    /// Factors on the friction of the axles that the drive has shown; `None` for that of the vehicle file.
    pub friction: Option<[f64; 2]>,
}

impl ExpectedForces {
    /// A model at rest.
    #[must_use]
    pub fn new(vehicle: &Vehicle, tuning: &ExpectedTuning) -> Self {
        Self {
            tuning: *tuning,
            parameters: Parameters::from_vehicle(vehicle),
            state: State::at_rest(),
            drive_split_front: vehicle.drivetrain.drive_split_front,
            brake_split_front: vehicle.drivetrain.brake_split_front,
            slip_stiffness_n: slip_stiffness_n(vehicle),
        }
    }

    /// The same model with a vehicle whose mass properties or tyres have changed.
    pub fn load(&mut self, vehicle: &Vehicle) {
        self.parameters = Parameters::from_vehicle(vehicle);
        self.slip_stiffness_n = slip_stiffness_n(vehicle);
    }

    /// Propagates the model by `dt`.
    pub fn step(&mut self, dt: f64, input: &ExpectedInput<'_>) -> PerWheel<TyreForce> {
        let mut inputs = Inputs::coasting();
        let source = match input.friction {
            Some(factor) => {
                inputs.friction_scale = std::array::from_fn(|i| factor[i / 2]);
                ForceSource::ModelFound
            }
            None => ForceSource::Model,
        };
        let (speed_m_s, motion) = (input.speed_m_s, input.motion);
        let (bank_rad, grade_rad) = (motion.bank_rad, motion.grade_rad);
        let felt_m_s2 =
            motion.acceleration_m_s2[0] - self.parameters.gravity_m_s2 * math::sin(grade_rad);
        let known = speed_m_s.is_finite()
            && felt_m_s2.is_finite()
            && bank_rad.is_finite()
            && input.steer_rad.iter().all(|angle| angle.is_finite());
        if !known || speed_m_s.abs() < self.tuning.rest_speed_m_s {
            self.state = State::at_rest();
            return self.forces(&inputs, source);
        }
        let [most_rad, most_m_s2] = [self.tuning.angle_max_rad, self.tuning.acceleration_max_m_s2];
        inputs.steer_rad = input
            .steer_rad
            .map(|angle| angle.clamp(-most_rad, most_rad));
        (inputs.bank_rad, inputs.grade_rad) = (
            bank_rad.clamp(-most_rad, most_rad),
            grade_rad.clamp(-most_rad, most_rad),
        );
        let push_n = self.parameters.mass_kg * felt_m_s2.clamp(-most_m_s2, most_m_s2);
        for _ in 0..SUBSTEPS {
            self.substep(dt / SUBSTEPS as f64, speed_m_s, push_n, &mut inputs);
        }
        self.stop_spin(input);
        self.forces(&inputs, source)
    }

    /// Propagates the model by a part of a step; `push_n` is the sum of drive and brake forces.
    fn substep(&mut self, dt: f64, speed_m_s: f64, push_n: f64, inputs: &mut Inputs<f64>) {
        let front = if push_n > 0.0 {
            self.drive_split_front
        } else {
            self.brake_split_front
        };
        self.state.longitudinal_m_s = speed_m_s;
        for i in 0..4 {
            let axle = self.parameters.axle(i);
            let part = 0.5 * if i < 2 { front } else { 1.0 - front };
            let force = push_n * part;
            let slip = (force / self.slip_stiffness_n[i / 2])
                .clamp(-self.tuning.slip_max, self.tuning.slip_max);
            inputs.drive_n_m[i] = force * axle.rolling_radius_m;
            let along = self.along_m_s(i, inputs.steer_rad[i]);
            self.state.wheel_speed_rad_s[i] = (along + slip * along.abs()) / axle.rolling_radius_m;
        }
        let next = self.parameters.step(&self.state, inputs, dt);
        let sound = |next: &State<f64>| {
            next.to_array().iter().all(|x| x.abs() < 1e4)
                && next.lateral_m_s.abs() < 2.0 * speed_m_s.abs() + 5.0
                && next.roll_rad.abs() < 1.0
        };
        self.state = next.ok().filter(sound).unwrap_or_else(State::at_rest);
        self.state.longitudinal_m_s = speed_m_s;
    }

    /// Begins again with the estimated motion, if the model spins and the vehicle does not.
    fn stop_spin(&mut self, input: &ExpectedInput<'_>) {
        let speed_m_s = input.speed_m_s;
        let sideslip_rad = math::atan2(self.state.lateral_m_s, speed_m_s.abs());
        let estimated_rad = input.sideslip_rad;
        let spins = (sideslip_rad - estimated_rad).abs() > self.tuning.spun_rad;
        // Backward, the sideslip angle is that of the direction of travel.
        if speed_m_s > self.tuning.spun_speed_m_s && input.yaw_rate_rad_s.is_finite() && spins {
            self.state.lateral_m_s = speed_m_s * math::tan(estimated_rad.clamp(-1.0, 1.0));
            self.state.yaw_rate_rad_s = input.yaw_rate_rad_s;
            self.state.slip_tangent = [0.0; 4];
        }
    }

    /// Velocity of a wheel along its heading, m/s. In a turn the outer wheels roll faster; with the
    /// body's speed for all wheels one side would brake and the other drive.
    fn along_m_s(&self, i: usize, steer_rad: f64) -> f64 {
        let [x, y] = self.parameters.wheel_position_m(i);
        let state = &self.state;
        let (sin, cos) = math::sin_cos(steer_rad);
        (state.longitudinal_m_s - state.yaw_rate_rad_s * y) * cos
            + (state.lateral_m_s + state.yaw_rate_rad_s * x) * sin
    }

    fn forces(&self, inputs: &Inputs<f64>, source: ForceSource) -> PerWheel<TyreForce> {
        let forces = four_wheel::tyre_forces(&self.parameters, &self.state, inputs);
        PerWheel(forces.map(|force_n| TyreForce {
            force_n,
            sigma_n: [f64::NAN; 3],
            source,
            ..TyreForce::default()
        }))
    }
}

/// Slip stiffness of a tyre of each axle, N.
fn slip_stiffness_n(vehicle: &Vehicle) -> [f64; 2] {
    [&vehicle.front, &vehicle.rear].map(|axle| axle.tyre.slip_stiffness_n.max(1.0))
}
