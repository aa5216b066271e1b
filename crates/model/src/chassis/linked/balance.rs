//! Energy and momentum.

use nalgebra::Vector3;

use super::dynamics::{CornerPlace, earth_from_vehicle};
use super::{Parameters, State};
use crate::Error;

/// Momentum of the whole vehicle, earth axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Momentum {
    /// Linear momentum, N s.
    pub linear_n_s: Vector3<f64>,
    /// Angular momentum about the earth's origin, N m s.
    pub angular_n_m_s: Vector3<f64>,
}

/// Kinetic energy, energy of height, and energy of coils and anti-roll bars, J. Tyres and stops give
/// and take work instead.
///
/// # Errors
/// A strut length or rack travel that the linkage does not reach.
pub fn energy_j(parameters: &Parameters, state: &State) -> Result<f64, Error> {
    let earth = earth_from_vehicle(state);
    let places = CornerPlace::all(parameters, state)?;
    let (v, w) = (state.velocity_m_s, state.rate_rad_s);
    let g = parameters.gravity_m_s2;
    let sprung_kg = parameters.sprung_mass_kg;
    let mut energy = 0.5 * sprung_kg * v.norm_squared()
        + 0.5 * w.dot(&(parameters.sprung_inertia_kg_m2 * w))
        + sprung_kg * g * state.position_m.z;
    for (i, place) in places.iter().enumerate() {
        let corner = &parameters.corners[i];
        for part in &place.outboard.parts {
            let r = part.cg.point_m - parameters.sprung_cg_m;
            let velocity = v + w.cross(&r) + part.cg.travel.rate(place.rate);
            let rate = w + part.cg.rotation.rate(place.rate);
            energy += 0.5 * part.mass_kg * velocity.norm_squared()
                + 0.5 * rate.dot(&(part.inertia_kg_m2 * rate))
                + part.mass_kg * g * (state.position_m + earth * r).z;
        }
        let spin = corner.unsprung.wheel_spin_inertia_kg_m2;
        let pressed_m = corner.strut.free_length_m - state.strut_m[i];
        let higher_m = place.jounce_m(parameters, i) - places[i ^ 1].jounce_m(parameters, i ^ 1);
        energy += 0.5 * spin * state.wheel_speed_rad_s[i].powi(2)
            + 0.5 * corner.strut.stiffness_n_m * pressed_m.powi(2)
            + 0.25 * corner.bar_n_m * higher_m.powi(2);
    }
    Ok(energy)
}

/// Momentum of body and wheels.
///
/// # Errors
/// A strut length or rack travel that the linkage does not reach.
pub fn momentum(parameters: &Parameters, state: &State) -> Result<Momentum, Error> {
    let earth = earth_from_vehicle(state);
    let places = CornerPlace::all(parameters, state)?;
    let (v, w) = (state.velocity_m_s, state.rate_rad_s);
    // Both in vehicle axes, the angular one about the sprung part's centre of gravity.
    let mut linear = v * parameters.sprung_mass_kg;
    let mut angular = parameters.sprung_inertia_kg_m2 * w;
    for (i, place) in places.iter().enumerate() {
        for part in &place.outboard.parts {
            let r = part.cg.point_m - parameters.sprung_cg_m;
            let own = (v + w.cross(&r) + part.cg.travel.rate(place.rate)) * part.mass_kg;
            let rate = w + part.cg.rotation.rate(place.rate);
            linear += own;
            angular += r.cross(&own) + part.inertia_kg_m2 * rate;
        }
        let spin = parameters.corners[i].unsprung.wheel_spin_inertia_kg_m2;
        angular += place.outboard.spindle * (spin * state.wheel_speed_rad_s[i]);
    }
    let linear_n_s = earth * linear;
    Ok(Momentum {
        linear_n_s,
        angular_n_m_s: earth * angular + state.position_m.cross(&linear_n_s),
    })
}
