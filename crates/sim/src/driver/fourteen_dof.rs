//! A car by the model of 14 degrees of freedom: wheels that travel, and leave the ground.

use model::chassis::four_wheel::Pose;
use model::chassis::fourteen_dof::{Inputs, Outputs, Parameters, State, at_rest, outputs};
use model::simulation::Model;
use model::suspension::Corner;
use model::tyre::{Contact, Tyre};
use model::vehicle::Vehicle;
use nalgebra::Vector3;
use sample::{PerWheel, Wheel};

use super::car::Commands;
use crate::{SimError, TruthState, WheelTruth};

/// Adams' tyre width of a brush tyre, parts of its contact length: the trail is a third of the one
/// and a sixth of the other.
const WIDTH_OF_CONTACT_LENGTH: f64 = 0.5;

/// The car under way.
pub(super) struct FourteenDof {
    parameters: Parameters,
    /// The whole vehicle's centre of gravity from that of the sprung part, body axes, m.
    cg_m: Vector3<f64>,
    /// Friction of the tyres, front and rear.
    friction: [f64; 2],
    /// Whether strut lengths are left to the linkage, which then also carries the body.
    linked: bool,
    state: State<f64>,
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
        ..Inputs::coasting()
    }
}

impl FourteenDof {
    /// The car at a speed, straight ahead; `None` where the vehicle file has no unsprung masses or
    /// struts.
    pub(super) fn new(vehicle: &Vehicle, speed_m_s: f64) -> Result<Option<Self>, SimError> {
        let Ok(mut parameters) = Parameters::from_vehicle(vehicle) else {
            return Ok(None);
        };
        lay_on_contact_length(&mut parameters);
        let [x, y, z] = vehicle.sprung().cg_m;
        Ok(Some(Self {
            cg_m: Vector3::new(-x, -y, vehicle.body.cg_height_m - z),
            friction: [vehicle.front.tyre.friction, vehicle.rear.tyre.friction],
            linked: Corner::of(vehicle, Wheel::FrontLeft).is_ok(),
            state: at_rest(&parameters)?.rolling(speed_m_s, &parameters),
            parameters,
        }))
    }

    pub(super) fn advance(&mut self, commands: &Commands, step_s: f64) {
        self.state = (self.parameters).steps(&self.state, &inputs(commands), step_s, 1);
    }

    pub(super) fn speed_m_s(&self) -> f64 {
        self.state.velocity_m_s[0]
    }

    pub(super) fn yaw_rate_rad_s(&self) -> f64 {
        self.state.rate_rad_s[2]
    }

    pub(super) fn place(&self) -> Pose {
        let [_, _, yaw_rad] = self.state.attitude_rad;
        let [east_m, north_m, _] = self.position_m();
        Pose {
            east_m,
            north_m,
            yaw_rad,
        }
    }

    pub(super) fn rolling_radius_m(&self) -> f64 {
        self.parameters.corners[Wheel::RearLeft.index()].rolling_radius_m
    }

    pub(super) fn strut_lengths_m(&self) -> [f64; 4] {
        let corners = &self.parameters.corners;
        std::array::from_fn(|i| corners[i].strut.length_m(self.state.jounce_m[i]))
    }

    /// Roll, pitch and yaw as a state's.
    fn attitude(&self) -> TruthState {
        let [roll_rad, pitch_rad, yaw_rad] = self.state.attitude_rad;
        TruthState {
            roll_rad,
            pitch_rad,
            yaw_rad,
            ..TruthState::default()
        }
    }

    /// Aligning moment of one tyre, as the model had it, N m.
    fn aligning_n_m(&self, wheel: usize, told: &Outputs<f64>, commands: &Commands) -> f64 {
        let contact = Contact {
            load_n: told.load_n[wheel],
            slip_tangent: math::tan(told.slip_angle_rad[wheel]),
            slip_ratio: told.slip_ratio[wheel],
            camber_rad: 0.0,
            friction_scale: commands.friction_scale[wheel],
            stiffness_scale: commands.stiffness_scale[wheel],
        };
        let tyre = &self.parameters.corners[wheel].tyre;
        tyre.forces_on(wheel.is_multiple_of(2), &contact)
            .aligning_n_m
    }

    fn position_m(&self) -> [f64; 3] {
        let arm_m = self.attitude().earth_from_body() * self.cg_m;
        (Vector3::from(self.state.position_m) + arm_m).into()
    }

    /// What is true now, at the whole vehicle's centre of gravity.
    pub(super) fn truth(&self, commands: &Commands) -> TruthState {
        let told = outputs(&self.parameters, &self.state, &inputs(commands));
        let rate = Vector3::from(self.state.rate_rad_s);
        let turning = Vector3::from(told.rate.rate_rad_s);
        let velocity = Vector3::from(self.state.velocity_m_s) + rate.cross(&self.cg_m);
        let force = Vector3::from(told.specific_force_m_s2)
            + turning.cross(&self.cg_m)
            + rate.cross(&rate.cross(&self.cg_m));
        let wheel = |wheel: Wheel| {
            let i = wheel.index();
            WheelTruth {
                force_n: [told.longitudinal_n[i], told.lateral_n[i], told.load_n[i]],
                moment_n_m: [f64::NAN, f64::NAN, self.aligning_n_m(i, &told, commands)],
                angular_speed_rad_s: self.state.wheel_speed_rad_s[i],
                steer_rad: commands.steer_rad[i],
                rod_shift_m: commands.rod_shift_m[i],
                slip_angle_rad: told.slip_angle_rad[i],
                friction: self.friction[usize::from(!wheel.is_front())]
                    * commands.friction_scale[i],
                strut_length_m: if self.linked {
                    f64::NAN
                } else {
                    told.strut_length_m[i]
                },
                ..WheelTruth::default()
            }
        };
        TruthState {
            position_m: self.position_m(),
            velocity_body_m_s: velocity.into(),
            rate_rad_s: self.state.rate_rad_s,
            rate_derivative_rad_s2: told.rate.rate_rad_s,
            specific_force_m_s2: force.into(),
            acceleration_m_s2: [f64::NAN; 3],
            wheels: PerWheel::from_fn(wheel),
            ..self.attitude()
        }
    }
}

/// Gives the tyres the pneumatic trail of their contact length under the load at rest,
/// 2 sqrt(2 R_0 d) pressed in by d: the same moment then turns the vehicle and pulls the tie rods.
fn lay_on_contact_length(parameters: &mut Parameters) {
    let wheels_n = 0.25 * parameters.mass_kg() * parameters.gravity_m_s2;
    for corner in &mut parameters.corners {
        let pressed_m = wheels_n / corner.vertical_stiffness_n_m;
        if let Tyre::Physical(tyre) = &mut corner.tyre {
            let contact_length_m = 2.0 * (2.0 * corner.unloaded_radius_m * pressed_m).sqrt();
            tyre.contact_length_m = WIDTH_OF_CONTACT_LENGTH * contact_length_m;
        }
    }
}
