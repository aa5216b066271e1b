//! Tyres on the ground, and the torques that turn wheels.

use nalgebra::{Matrix3, Vector3};

use super::dynamics::CornerPlace;
use super::{Corner, Inputs, Parameters, State};
use crate::road::{Ground, GroundContact};
use crate::tyre::{
    Contact, Forces, relaxed_rate, rolling_resistance_n_m, saturated, steady_slip, tread_moment,
};

/// A tyre on its ground. Vectors in vehicle axes.
pub(super) struct TyreForces {
    pub contact: GroundContact,
    pub axes: Matrix3<f64>,
    pub force: Vector3<f64>,
    pub moment: Vector3<f64>,
    pub about_centre: Vector3<f64>,
    pub velocity: Vector3<f64>,
    pub carrier_rate: Vector3<f64>,
    pub slips: [f64; 2],
    pub slip_rates: [f64; 2],
    pub spin: f64,
}

impl TyreForces {
    pub(super) fn new<G: Ground + ?Sized>(
        parameters: &Parameters,
        state: &State,
        earth: &Matrix3<f64>,
        place: &CornerPlace,
        ground: &G,
        i: usize,
    ) -> Self {
        let corner = &parameters.corners[i];
        let file = &corner.tyre_file;
        let (wheel, s) = (&place.outboard.wheel, place.outboard.spindle);
        let r = wheel.point_m - parameters.sprung_cg_m;
        let turning = state.rate_rad_s;
        let carrier_rate = turning + wheel.rotation.rate(place.rate);
        let velocity = state.velocity_m_s + turning.cross(&r) + wheel.travel.rate(place.rate);
        let contact = ground.contact(
            state.position_m + earth * r,
            earth * s,
            file.unloaded_radius_m,
            file.width_m,
        );
        let normal = earth.transpose() * contact.normal;
        let lean = normal.dot(&s);
        let in_plane = normal - s * lean;
        let upright = in_plane.norm();
        let closing = -normal.dot(&velocity) / upright;
        let load_n = load_n(file, contact.depth_m, closing);
        let ahead = s.cross(&normal) / upright;
        let left = normal.cross(&ahead);
        let foot = in_plane * ((contact.depth_m - file.unloaded_radius_m) / upright);
        let rolling = velocity.dot(&ahead);
        let (slips, slip_rates) = slips(
            parameters,
            state,
            rolling,
            (velocity + carrier_rate.cross(&foot)).dot(&left),
            i,
        );
        let tyre_contact = Contact {
            load_n,
            slip_tangent: slips[0],
            slip_ratio: slips[1],
            camber_rad: math::asin(lean.clamp(-1.0, 1.0)),
            friction_scale: contact.friction,
            stiffness_scale: 1.0,
        };
        let forces = corner.tyre.forces_on(i.is_multiple_of(2), &tyre_contact);
        let spin = state.wheel_speed_rad_s[i] - carrier_rate.dot(&s);
        let moment = moment(
            corner,
            i,
            &tyre_contact,
            &forces,
            contact.resistance,
            [rolling, spin, lean / upright],
        );
        let force = Vector3::new(forces.longitudinal_n, forces.lateral_n, load_n);
        let axes = Matrix3::from_columns(&[ahead, left, normal]);
        Self {
            contact,
            axes,
            force,
            moment,
            about_centre: foot.cross(&(axes * force)) + axes * moment,
            velocity,
            carrier_rate,
            slips,
            slip_rates,
            spin,
        }
    }

    /// Power of force and moment on the wheel, W.
    pub(super) fn power_w(&self, spindle: Vector3<f64>, wheel_speed_rad_s: f64) -> f64 {
        let about_spindle = self.about_centre.dot(&spindle);
        let across = self.about_centre - spindle * about_spindle;
        (self.axes * self.force).dot(&self.velocity)
            + across.dot(&self.carrier_rate)
            + about_spindle * wheel_speed_rad_s
    }
}

/// Moment of the ground on the tyre `i` about the contact point, contact frame, N m: `resistance` is the
/// coefficient of soft ground; speed (m/s), spin (rad/s) and tangent of the inclination follow.
fn moment(
    corner: &Corner,
    i: usize,
    tyre_contact: &Contact<f64>,
    forces: &Forces<f64>,
    resistance: f64,
    [rolling, spin, tilt]: [f64; 3],
) -> Vector3<f64> {
    let (file, load_n) = (&corner.tyre_file, tyre_contact.load_n);
    let is_left = i.is_multiple_of(2);
    let [overturning, own] = (corner.tyre).moments_on(is_left, tyre_contact, forces, rolling);
    let by_ground = |coefficient: f64| {
        rolling_resistance_n_m(coefficient, load_n, corner.rolling_radius_m, spin)
    };
    let tread = || tread_moment(file.width_m, file.vertical_stiffness_n_m, load_n, tilt);
    Vector3::new(
        overturning.unwrap_or_else(|| -tread()),
        match own {
            Some(own) => by_ground(resistance) - own * saturated(spin),
            None => by_ground(file.rolling_resistance + resistance),
        },
        forces.aligning_n_m,
    )
}

/// Drive and brake torque of one wheel.
pub(super) struct Torques {
    pub on_wheel: f64,
    /// The part that the chassis reacts.
    pub on_chassis: f64,
}

impl Torques {
    pub(super) fn new(parameters: &Parameters, inputs: &Inputs, spin: f64, i: usize) -> Self {
        let corner = &parameters.corners[i];
        let drive = inputs.drive_n_m[i];
        let brake = -inputs.brake_n_m[i] * saturated(spin);
        let by_chassis = |torque: f64, reacts: bool| if reacts { torque } else { 0.0 };
        Self {
            on_wheel: drive + brake,
            on_chassis: by_chassis(drive, corner.drive_on_chassis)
                + by_chassis(brake, !corner.brake_on_carrier),
        }
    }
}

/// Load of a tyre pressed in by a depth, m, that grows at a speed, m/s: spring and damper, never
/// negative, N.
fn load_n(tyre: &crate::vehicle::Tyre, depth_m: f64, closing_m_s: f64) -> f64 {
    if depth_m > 0.0 {
        let spring = tyre.vertical_stiffness_n_m * depth_m;
        (spring + tyre.vertical_damping_n_s_m * closing_m_s).max(0.0)
    } else {
        0.0
    }
}

/// The slips that a tyre sees (tangent of the slip angle, longitudinal) and the rates of the relaxed
/// ones, from the speeds of the contact patch along and across the wheel plane.
fn slips(
    parameters: &Parameters,
    state: &State,
    rolling: f64,
    sliding: f64,
    i: usize,
) -> ([f64; 2], [f64; 2]) {
    let corner = &parameters.corners[i];
    let length_m = corner.tyre_file.relaxation_length_m;
    let slip_speed = state.wheel_speed_rad_s[i] * corner.rolling_radius_m - rolling;
    if length_m > 0.0 {
        let slips = [state.slip_tangent[i], state.slip_ratio[i]];
        let rate = |slip: f64, speed: f64| relaxed_rate(slip, speed, rolling, length_m);
        (slips, [rate(slips[0], sliding), rate(slips[1], slip_speed)])
    } else {
        let steady = |speed: f64| steady_slip(speed, rolling, parameters.low_speed_m_s);
        ([steady(sliding), steady(slip_speed)], [0.0; 2])
    }
}
