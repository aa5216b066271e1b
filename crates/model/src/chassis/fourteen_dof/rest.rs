//! Standing still.

use nalgebra::SVector;

use super::{Inputs, Parameters, State, derivative};
use crate::chassis::slopes::jacobian;
use crate::{Error, Scalar};

/// Unknowns: height, roll, pitch, four jounces.
const UNKNOWNS: usize = 7;

/// Largest acceleration that may be left over, m/s^2 or rad/s^2.
const TOLERANCE: f64 = 1e-8;

/// The vehicle at rest on level ground, springs and tyres carrying it.
///
/// # Errors
/// Where no equilibrium is found, as with springs too soft to carry the body.
pub fn at_rest(parameters: &Parameters) -> Result<State<f64>, Error> {
    let mut unknown = SVector::<f64, UNKNOWNS>::zeros();
    unknown[0] = parameters.design_height_m;
    let mut size = residual(parameters, &unknown).amax();
    for _ in 0..100 {
        if size < 1e-2 * TOLERANCE {
            break;
        }
        let (left, slope) = jacobian(|x| residual(parameters, &x), &unknown);
        let Some(change) = slope.lu().solve(&left) else {
            break;
        };
        let mut part = 1.0;
        let mut tried = unknown - change;
        let mut amount = residual(parameters, &tried).amax();
        while amount >= size && part > 1e-6 {
            part *= 0.5;
            tried = unknown - change * part;
            amount = residual(parameters, &tried).amax();
        }
        if amount >= size {
            break;
        }
        (unknown, size) = (tried, amount);
    }
    if size < TOLERANCE {
        Ok(assemble(&unknown))
    } else {
        Err(Error::NoEquilibrium {
            speed_m_s: 0.0,
            radius_m: f64::INFINITY,
            residual_m_s2: size,
        })
    }
}

fn assemble<T: Scalar>(unknown: &SVector<T, UNKNOWNS>) -> State<T> {
    let mut state = State::zero();
    state.position_m[2] = unknown[0];
    state.attitude_rad[0] = unknown[1];
    state.attitude_rad[1] = unknown[2];
    state.jounce_m = [unknown[3], unknown[4], unknown[5], unknown[6]];
    state
}

fn residual<T: Scalar>(
    parameters: &Parameters,
    unknown: &SVector<T, UNKNOWNS>,
) -> SVector<T, UNKNOWNS> {
    let rate = derivative(parameters, &assemble(unknown), &Inputs::coasting());
    let [s0, s1, s2, s3] = rate.jounce_rate_m_s;
    SVector::from([
        rate.velocity_m_s[2],
        rate.rate_rad_s[0],
        rate.rate_rad_s[1],
        s0,
        s1,
        s2,
        s3,
    ])
}
