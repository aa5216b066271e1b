//! Steady turning: the state and the steer that keep a speed on a radius.

use nalgebra::SVector;

use super::{Inputs, Outputs, Parameters, State, derivative, outputs};
use crate::chassis::slopes::jacobian;
use crate::error::require;
use crate::{Error, Scalar};

/// Where the torque that holds the speed comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drive {
    /// None: all wheels roll free and the speed is held from outside, as in a bicycle model.
    /// Longitudinal balance is left out.
    Free,
    /// The engine, this part of the torque on the front axle, both wheels of an axle alike.
    Torque {
        /// Part of the torque on the front axle.
        front: f64,
    },
}

/// A steady turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SteadyState {
    /// The state.
    pub state: State<f64>,
    /// The inputs that hold it.
    pub inputs: Inputs<f64>,
    /// Loads, forces and slips.
    pub outputs: Outputs<f64>,
}

/// Unknowns: v, phi, theta, steer, torque, four longitudinal slips.
const UNKNOWNS: usize = 9;

/// Largest acceleration that may be left over, m/s^2 or rad/s^2.
const TOLERANCE: f64 = 1e-9;

/// The steady turn at longitudinal velocity u on a path whose radius is R = u/r (positive to the
/// left), both front wheels steered alike.
///
/// # Errors
/// Where an argument is out of range, and where no equilibrium is found: beyond the tyres' grip
/// none exists.
pub fn steady_turn(
    parameters: &Parameters,
    longitudinal_m_s: f64,
    radius_m: f64,
    drive: Drive,
) -> Result<SteadyState, Error> {
    require(
        longitudinal_m_s > 0.0,
        "longitudinal_m_s",
        longitudinal_m_s,
        "m/s",
        "greater than 0",
    )?;
    require(
        radius_m != 0.0,
        "radius_m",
        radius_m,
        "m",
        "different from 0",
    )?;
    // Continuation from a slow turn: each turn starts from the one before.
    let mut unknown = SVector::<f64, UNKNOWNS>::zeros();
    unknown[3] = parameters.wheelbase_m() / radius_m;
    unknown[0] = -parameters.rear.ahead_m * 0.2 * longitudinal_m_s / radius_m;
    let mut left_over = f64::INFINITY;
    for part in [0.2, 0.4, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95, 1.0] {
        let turn = Turn {
            parameters,
            speed: longitudinal_m_s * part,
            radius: radius_m,
            drive,
        };
        left_over = turn.newton(&mut unknown);
        if !left_over.is_finite() {
            break;
        }
    }
    if left_over < TOLERANCE {
        let turn = Turn {
            parameters,
            speed: longitudinal_m_s,
            radius: radius_m,
            drive,
        };
        let (state, inputs) = turn.assemble(&unknown);
        return Ok(SteadyState {
            state,
            inputs,
            outputs: outputs(parameters, &state, &inputs),
        });
    }
    Err(Error::NoEquilibrium {
        speed_m_s: longitudinal_m_s,
        radius_m,
        residual_m_s2: left_over,
    })
}

struct Turn<'a> {
    parameters: &'a Parameters,
    speed: f64,
    radius: f64,
    drive: Drive,
}

impl Turn<'_> {
    fn assemble<T: Scalar>(&self, unknown: &SVector<T, UNKNOWNS>) -> (State<T>, Inputs<T>) {
        let p = self.parameters;
        let mut state = State::at_rest();
        let speed = T::from(self.speed);
        state.longitudinal_m_s = speed;
        state.lateral_m_s = unknown[0];
        state.yaw_rate_rad_s = T::from(self.speed / self.radius);
        state.roll_rad = unknown[1];
        state.pitch_rad = unknown[2];
        let mut inputs = Inputs::steered(unknown[3]);
        for i in 0..4 {
            if let Drive::Torque { front } = self.drive {
                let part = if i < 2 { front } else { 1.0 - front };
                inputs.drive_n_m[i] = unknown[4] * (0.5 * part);
            }
            let axle = p.axle(i);
            let [x, y] = p.wheel_position_m(i);
            let along = speed - state.yaw_rate_rad_s * y;
            let across = state.lateral_m_s + state.yaw_rate_rad_s * x;
            let steer = inputs.steer_rad[i] + state.roll_rad * axle.roll_steer;
            let (sin, cos) = (steer.sine(), steer.cosine());
            let rolling = along * cos + across * sin;
            state.slip_tangent[i] = (across * cos - along * sin) / rolling.magnitude();
            state.slip_ratio[i] = unknown[5 + i];
            state.wheel_speed_rad_s[i] =
                (rolling + rolling.magnitude() * unknown[5 + i]) / axle.rolling_radius_m;
        }
        (state, inputs)
    }

    fn residual<T: Scalar>(&self, unknown: &SVector<T, UNKNOWNS>) -> SVector<T, UNKNOWNS> {
        let (state, inputs) = self.assemble(unknown);
        let rate = derivative(self.parameters, &state, &inputs);
        let mut left = SVector::from([
            rate.lateral_m_s,
            rate.roll_rate_rad_s,
            rate.pitch_rate_rad_s,
            rate.yaw_rate_rad_s,
            rate.longitudinal_m_s,
            rate.wheel_speed_rad_s[0],
            rate.wheel_speed_rad_s[1],
            rate.wheel_speed_rad_s[2],
            rate.wheel_speed_rad_s[3],
        ]);
        if self.drive == Drive::Free {
            for i in 4..UNKNOWNS {
                left[i] = unknown[i];
            }
        }
        left
    }

    fn newton(&self, unknown: &mut SVector<f64, UNKNOWNS>) -> f64 {
        let mut size = self.residual(unknown).amax();
        for _ in 0..60 {
            if size < 1e-3 * TOLERANCE {
                break;
            }
            let (left, slope) = jacobian(|x| self.residual(&x), unknown);
            let Some(change) = slope.lu().solve(&left) else {
                break;
            };
            let mut scale = 1.0;
            let mut best = None;
            while scale > 1e-4 {
                let tried = *unknown - change * scale;
                let amount = self.residual(&tried).amax();
                if amount < size {
                    best = Some((tried, amount));
                    break;
                }
                scale *= 0.5;
            }
            let Some((tried, amount)) = best else { break };
            *unknown = tried;
            size = amount;
        }
        size
    }
}
