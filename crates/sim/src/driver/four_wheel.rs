//! A car by the four-wheel model.

use model::chassis::four_wheel::{Inputs, Outputs, Parameters, Pose, State, outputs};
use model::simulation::Model;
use model::vehicle::Vehicle;
use nalgebra::Vector3;
use sample::{PerWheel, Wheel};

use super::body_rates;
use super::car::Commands;
use crate::{TruthState, WheelTruth};

/// The car under way.
pub(super) struct FourWheel {
    parameters: Parameters,
    cg_height_m: f64,
    /// Friction of the tyres, front and rear.
    friction: [f64; 2],
    state: State<f64>,
    pose: Pose,
}

fn inputs(commands: &Commands) -> Inputs<f64> {
    Inputs {
        steer_rad: commands.steer_rad,
        drive_n_m: commands.drive_n_m,
        brake_n_m: commands.brake_n_m,
        bank_rad: commands.bank_rad,
        grade_rad: commands.grade_rad,
        friction_scale: commands.friction_scale,
        stiffness_scale: commands.stiffness_scale,
    }
}

impl FourWheel {
    /// The car at a speed, straight ahead.
    pub(super) fn new(vehicle: &Vehicle, speed_m_s: f64) -> Self {
        let parameters = Parameters::from_vehicle(vehicle);
        Self {
            cg_height_m: vehicle.body.cg_height_m,
            friction: [vehicle.front.tyre.friction, vehicle.rear.tyre.friction],
            state: State::rolling(speed_m_s, &parameters),
            pose: Pose::default(),
            parameters,
        }
    }

    pub(super) fn advance(&mut self, commands: &Commands, step_s: f64) {
        let next = (self.parameters).steps(&self.state, &inputs(commands), step_s, 1);
        self.pose = self.pose.advanced(&self.state, &next, step_s);
        self.state = next;
    }

    pub(super) fn speed_m_s(&self) -> f64 {
        self.state.longitudinal_m_s
    }

    pub(super) fn yaw_rate_rad_s(&self) -> f64 {
        self.state.yaw_rate_rad_s
    }

    pub(super) fn place(&self) -> Pose {
        self.pose
    }

    pub(super) fn rolling_radius_m(&self) -> f64 {
        self.parameters.rear.rolling_radius_m
    }

    /// What is true now. The model's velocity is that of a point on the roll axis; the centre of
    /// gravity sways against it.
    pub(super) fn truth(&self, commands: &Commands) -> TruthState {
        let inputs = &inputs(commands);
        let (state, p) = (&self.state, &self.parameters);
        let told = outputs(p, state, inputs);
        let sway_m = p.sprung_mass_kg / p.mass_kg * p.roll_arm_m;
        let (roll, pitch) = (state.roll_rad, state.pitch_rad);
        let level = TruthState {
            roll_rad: roll,
            pitch_rad: pitch,
            ..TruthState::default()
        };
        let lateral_m_s = state.lateral_m_s - sway_m * state.roll_rate_rad_s;
        let lateral_m_s2 = told.lateral_m_s2 - sway_m * told.rate.roll_rate_rad_s;
        let body_from_heading = level.earth_from_body().inverse();
        let turn = |x, y, z| (body_from_heading * Vector3::new(x, y, z)).into();
        TruthState {
            position_m: [self.pose.east_m, self.pose.north_m, self.cg_height_m],
            yaw_rad: self.pose.yaw_rad,
            velocity_body_m_s: turn(state.longitudinal_m_s, lateral_m_s, 0.0),
            rate_rad_s: body_rates(
                [roll, pitch],
                [
                    state.roll_rate_rad_s,
                    state.pitch_rate_rad_s,
                    state.yaw_rate_rad_s,
                ],
            ),
            rate_derivative_rad_s2: [f64::NAN; 3],
            specific_force_m_s2: turn(told.longitudinal_m_s2, lateral_m_s2, p.gravity_m_s2),
            acceleration_m_s2: turn(told.longitudinal_m_s2, lateral_m_s2, 0.0),
            wheels: PerWheel::from_fn(|wheel| self.wheel_truth(wheel, inputs, &told)),
            ..level
        }
    }

    fn wheel_truth(&self, wheel: Wheel, inputs: &Inputs<f64>, told: &Outputs<f64>) -> WheelTruth {
        let i = wheel.index();
        let axle = self.parameters.axle(i);
        let spin = self.state.wheel_speed_rad_s[i];
        let rolling = axle.rolling_resistance * axle.rolling_radius_m * told.load_n[i];
        WheelTruth {
            force_n: [told.longitudinal_n[i], told.lateral_n[i], told.load_n[i]],
            moment_n_m: [0.0, -rolling * math::tanh(spin), told.aligning_n_m[i]],
            angular_speed_rad_s: spin,
            steer_rad: inputs.steer_rad[i] + axle.roll_steer * self.state.roll_rad,
            slip_angle_rad: told.slip_angle_rad[i],
            friction: self.friction[usize::from(!wheel.is_front())] * inputs.friction_scale[i],
            ..WheelTruth::default()
        }
    }
}
