//! Standing still.

use nalgebra::{SMatrix, SVector, Vector3};
use sample::Wheel;

use super::{Inputs, Parameters, State, outputs};
use crate::Error;
use crate::road::Ground;

/// Unknowns: height, roll, pitch, four strut lengths.
const UNKNOWNS: usize = 7;
type Unknowns = SVector<f64, UNKNOWNS>;

/// Step of the differences, m or rad.
const STEP: f64 = 1e-6;
/// Acceleration that is rounding, m/s^2 or rad/s^2.
const ROUNDING: f64 = 1e-8;
/// Largest acceleration that may be left over.
const TOLERANCE: f64 = 1e-5;
/// Height from which the ground below a wheel is looked up, m.
const ABOVE_M: f64 = 1000.0;

/// The vehicle at rest at a place (east, north, m) and yaw, rad: springs and tyres carry it across
/// the ground; what pulls it down a slope is not balanced.
///
/// # Errors
/// Where no equilibrium is found.
pub fn at_rest<G: Ground + ?Sized>(
    parameters: &Parameters,
    ground: &G,
    [east_m, north_m, yaw_rad]: [f64; 3],
) -> Result<State, Error> {
    let assemble = |unknown: &Unknowns| State {
        position_m: Vector3::new(east_m, north_m, unknown[0]),
        attitude_rad: Vector3::new(unknown[1], unknown[2], yaw_rad),
        velocity_m_s: Vector3::zeros(),
        rate_rad_s: Vector3::zeros(),
        strut_m: std::array::from_fn(|i| unknown[3 + i]),
        strut_rate_m_s: [0.0; 4],
        rack: [0.0; 4],
        rack_rate: [0.0; 4],
        wheel_speed_rad_s: [0.0; 4],
        slip_tangent: [0.0; 4],
        slip_ratio: [0.0; 4],
    };
    let left_over = |unknown: &Unknowns| -> Result<Unknowns, Error> {
        let state = assemble(unknown);
        let rate = outputs(parameters, &state, &Inputs::default(), ground)?.rate;
        let [a, b, c, d] = rate.strut_rate_m_s;
        let (v, w) = (rate.velocity_m_s, rate.rate_rad_s);
        Ok(Unknowns::from([v.z, w.x, w.y, a, b, c, d]))
    };
    let mut unknown = start(parameters, ground, [east_m, north_m, yaw_rad]);
    let mut left = left_over(&unknown)?;
    for _ in 0..100 {
        if left.amax() < ROUNDING {
            break;
        }
        let mut slope = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::zeros();
        for k in 0..UNKNOWNS {
            let mut beside = [unknown; 2];
            beside[0][k] += STEP;
            beside[1][k] -= STEP;
            let rise = left_over(&beside[0])? - left_over(&beside[1])?;
            slope.set_column(k, &(rise / (2.0 * STEP)));
        }
        let Some(change) = slope.lu().solve(&left) else {
            break;
        };
        // A part of the step where stops or contacts bend the slope.
        let better = [1.0, 0.5, 0.25, 0.1, 0.03, 0.01]
            .into_iter()
            .find_map(|part| {
                let tried = unknown - change * part;
                let amount = left_over(&tried).ok()?;
                (amount.amax() < left.amax()).then_some((tried, amount))
            });
        let Some(better) = better else {
            break;
        };
        (unknown, left) = better;
    }
    if left.amax() < TOLERANCE {
        Ok(assemble(&unknown))
    } else {
        Err(Error::NoEquilibrium {
            speed_m_s: 0.0,
            radius_m: f64::INFINITY,
            residual_m_s2: left.amax(),
        })
    }
}

/// The design position on the plane through the ground below the wheels.
fn start<G: Ground + ?Sized>(
    parameters: &Parameters,
    ground: &G,
    [east_m, north_m, yaw_rad]: [f64; 3],
) -> Unknowns {
    let (sin, cos) = math::sin_cos(yaw_rad);
    let places = Wheel::ALL.map(|wheel| {
        let corner = &parameters.corners[wheel.index()];
        let at = crate::suspension::Coordinates {
            strut: corner.strut.design_length_m,
            rack: 0.0,
        };
        let placed = corner.suspension.outboard(at, &corner.unsprung);
        placed.map_or(Vector3::zeros(), |outboard| outboard.wheel.point_m)
    });
    let heights = places.map(|place| {
        let from_cg = place - parameters.sprung_cg_m;
        let [x, y] = [
            east_m + cos * from_cg.x - sin * from_cg.y,
            north_m + sin * from_cg.x + cos * from_cg.y,
        ];
        let centre = Vector3::new(x, y, ABOVE_M);
        let contact = ground.contact(centre, Vector3::new(-sin, cos, 0.0), 0.3, 0.2);
        contact.ground_height_m
    });
    let mean = |list: [f64; 4]| 0.25 * list.iter().sum::<f64>();
    let rise = |sign: [f64; 4], along: fn(&Vector3<f64>) -> f64| {
        let sum: f64 = (0..4).map(|i| sign[i] * heights[i]).sum();
        let span: f64 = (0..4).map(|i| sign[i] * along(&places[i])).sum();
        sum / span
    };
    let ahead = rise([1.0, 1.0, -1.0, -1.0], |place| place.x);
    let left = rise([1.0, -1.0, 1.0, -1.0], |place| place.y);
    let struts = std::array::from_fn::<f64, 4, _>(|i| parameters.corners[i].strut.design_length_m);
    Unknowns::from([
        mean(heights) + parameters.sprung_cg_m.z,
        math::atan(left),
        -math::atan(ahead),
        struts[0],
        struts[1],
        struts[2],
        struts[3],
    ])
}
