//! Equations of motion of the 14-degree-of-freedom model.

use nalgebra::{SMatrix, SVector};
use num_dual::DualSVec64;

use super::vector::{V3, add, along, cross, dot, dot_constant, scale, solve_symmetric, sub};
use super::{CornerParameters, Inputs, Parameters, STATES, State};
use crate::Scalar;
use crate::integrate::rk4;
use crate::tyre::{Contact, relaxed_rate, saturated, steady_slip};

/// What the model tells besides the rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outputs<T> {
    /// Rate of the state.
    pub rate: State<T>,
    /// Normal loads, N; zero where the wheel is in the air.
    pub load_n: [T; 4],
    /// How far each tyre is pressed in, m; negative is its clearance above ground.
    pub deflection_m: [T; 4],
    /// Longitudinal tyre forces, contact frame, N.
    pub longitudinal_n: [T; 4],
    /// Lateral tyre forces, contact frame, N.
    pub lateral_n: [T; 4],
    /// Slip angles, rad.
    pub slip_angle_rad: [T; 4],
    /// Longitudinal slips.
    pub slip_ratio: [T; 4],
    /// Strut lengths, m.
    pub strut_length_m: [T; 4],
    /// Force along each strut, N, pushing its ends apart.
    pub strut_force_n: [T; 4],
    /// Specific force at the sprung part's centre of gravity, body axes, m/s^2.
    pub specific_force_m_s2: [T; 3],
}

/// Orientation of the body and gravity.
#[derive(Clone, Copy)]
struct Frame<T> {
    /// Heading axes (ahead, left, up) in body axes.
    axes: [V3<T>; 3],
    gravity: V3<T>,
}

/// One wheel's forces.
#[derive(Clone, Copy)]
struct WheelForces<T> {
    centre: V3<T>,
    /// Force on the wheel and its moment about the sprung centre of gravity, spin taken off.
    force: V3<T>,
    moment: V3<T>,
    load: T,
    deflection: T,
    longitudinal: T,
    lateral: T,
    tangent: T,
    ratio: T,
    tangent_rate: T,
    ratio_rate: T,
    spin_rate: T,
}

#[inline]
fn frame<T: Scalar>(parameters: &Parameters, state: &State<T>, inputs: &Inputs<T>) -> Frame<T> {
    let [roll, pitch, _] = state.attitude_rad;
    let (sr, cr) = roll.sin_cos();
    let (sp, cp) = pitch.sin_cos();
    let axes = [
        [cp, sp * sr, sp * cr],
        [T::from(0.0), cr, -sr],
        [-sp, cp * sr, cp * cr],
    ];
    let g = parameters.gravity_m_s2;
    let level = T::NDERIV == 0 && inputs.bank_rad == 0.0 && inputs.grade_rad == 0.0;
    let gravity = if level {
        scale(axes[2], T::from(-g))
    } else {
        let (sb, cb) = inputs.bank_rad.sin_cos();
        let (sg, cg) = inputs.grade_rad.sin_cos();
        let ahead = scale(axes[0], sg * g);
        let left = scale(axes[1], -sb * cg * g);
        add(add(ahead, left), scale(axes[2], -cb * cg * g))
    };
    Frame { axes, gravity }
}

#[inline]
fn wheel<T: Scalar>(
    parameters: &Parameters,
    state: &State<T>,
    inputs: &Inputs<T>,
    frame: &Frame<T>,
    i: usize,
) -> WheelForces<T> {
    let corner = &parameters.corners[i];
    let up = frame.axes[2];
    let (sin, cos) = inputs.steer_rad[i].sin_cos();
    let spindle = [-sin, cos, T::from(0.0)];
    let path = along(corner.path, state.jounce_m[i]);
    let centre = add(corner.wheel_centre_m.map(T::from), path);
    let travel = along(corner.path, state.jounce_rate_m_s[i]);
    let velocity = add(
        add(state.velocity_m_s, cross(state.rate_rad_s, centre)),
        travel,
    );
    let height = state.position_m[2] + dot(up, centre) - inputs.road_m[i];
    let lean = dot(spindle, up);
    let upright = (-lean * lean + 1.0).sqrt();
    let radius = height / upright;
    let deflection = -radius + corner.unloaded_radius_m;
    let closing = -(dot(up, velocity) - inputs.road_rate_m_s[i]) / upright;
    let load = if deflection > 0.0 {
        (deflection * corner.vertical_stiffness_n_m + closing * corner.vertical_damping_n_s_m)
            .at_least(0.0)
    } else {
        T::from(0.0)
    };
    let ahead = scale(cross(spindle, up), upright.recip());
    let left = cross(up, ahead);
    let reach = scale(sub(up, scale(spindle, lean)), radius / upright);
    let contact = sub(centre, reach);
    let sliding = dot(sub(velocity, cross(state.rate_rad_s, reach)), left);
    let rolling = dot(velocity, ahead);
    let slip_speed = state.wheel_speed_rad_s[i] * corner.rolling_radius_m - rolling;
    let length = corner.relaxation_length_m;
    let (tangent, ratio, tangent_rate, ratio_rate) = if length > 0.0 {
        let (tangent, ratio) = (state.slip_tangent[i], state.slip_ratio[i]);
        (
            tangent,
            ratio,
            relaxed_rate(tangent, sliding, rolling, length),
            relaxed_rate(ratio, slip_speed, rolling, length),
        )
    } else {
        let low = parameters.low_speed_m_s;
        let zero = T::from(0.0);
        (
            steady_slip(sliding, rolling, low),
            steady_slip(slip_speed, rolling, low),
            zero,
            zero,
        )
    };
    let forces = corner.tyre.forces(&Contact {
        load_n: load,
        slip_tangent: tangent,
        slip_ratio: ratio,
        camber_rad: lean,
        friction_scale: inputs.friction_scale[i],
        stiffness_scale: inputs.stiffness_scale[i],
    });
    let (x, y) = (forces.longitudinal_n, forces.lateral_n);
    let force = add(scale(up, load), add(scale(ahead, x), scale(left, y)));
    let spin = state.wheel_speed_rad_s[i];
    let turn = saturated(spin);
    let rolling_moment = load * turn * (-corner.rolling_resistance * corner.rolling_radius_m);
    let torque = inputs.drive_n_m[i] - x * corner.rolling_radius_m + rolling_moment
        - inputs.brake_n_m[i] * turn;
    let spin_rate = torque / corner.spin_inertia_kg_m2;
    let momentum = scale(spindle, spin * corner.spin_inertia_kg_m2);
    let moment = add(cross(contact, force), scale(up, forces.aligning_n_m));
    let spun = sub(
        scale(spindle, rolling_moment - torque),
        cross(state.rate_rad_s, momentum),
    );
    WheelForces {
        centre,
        force,
        moment: add(moment, spun),
        load,
        deflection,
        longitudinal: x,
        lateral: y,
        tangent,
        ratio,
        tangent_rate,
        ratio_rate,
        spin_rate,
    }
}

/// Strut length, strut force, and force of strut and bar referred to jounce.
#[inline]
fn suspension<T: Scalar>(corner: &CornerParameters, state: &State<T>, i: usize) -> [T; 3] {
    let strut = &corner.strut;
    let length = strut.length_m(state.jounce_m[i]);
    let rate = -state.jounce_rate_m_s[i] * strut.motion_ratio;
    let force = strut.force_n(length, rate);
    let mut push = force * strut.motion_ratio;
    if corner.bar_n_m != 0.0 {
        push += (state.jounce_m[i] - state.jounce_m[i ^ 1]) * corner.bar_n_m;
    }
    [length, force, push]
}

/// The body's 6 x 6 system, grown wheel by wheel.
struct System<T> {
    matrix: [[T; 6]; 6],
    right: [T; 6],
}

impl<T: Scalar> System<T> {
    #[inline]
    fn of_body(parameters: &Parameters, state: &State<T>, frame: &Frame<T>) -> Self {
        let p = parameters;
        let zero = T::from(0.0);
        let mut matrix = [[zero; 6]; 6];
        let [x, y, z] = p.inertia_kg_m2;
        let xz = p.inertia_xz_kg_m2;
        for k in 0..3 {
            matrix[k][k] = T::from(p.sprung_mass_kg);
            matrix[3 + k][3 + k] = T::from(p.inertia_kg_m2[k]);
        }
        matrix[5][3] = T::from(-xz);
        let w = state.rate_rad_s;
        let momentum = [w[0] * x - w[2] * xz, w[1] * y, w[2] * z - w[0] * xz];
        let gyroscopic = cross(w, momentum);
        let mut force = scale(frame.gravity, T::from(p.sprung_mass_kg));
        if p.drag_n_s2_m2 != 0.0 {
            let speed = state.velocity_m_s[0];
            force[0] -= speed * speed.magnitude() * p.drag_n_s2_m2;
        }
        Self {
            matrix,
            right: [
                force[0],
                force[1],
                force[2],
                -gyroscopic[0],
                -gyroscopic[1],
                -gyroscopic[2],
            ],
        }
    }

    /// Adds one wheel; gives omega x (omega x r) + 2 omega x e s'.
    #[inline]
    #[allow(clippy::needless_range_loop)]
    fn add_wheel(
        &mut self,
        corner: &CornerParameters,
        state: &State<T>,
        frame: &Frame<T>,
        forces: &WheelForces<T>,
        push: T,
        i: usize,
    ) -> V3<T> {
        let e = corner.path;
        let square = e[0] * e[0] + e[1] * e[1] + e[2] * e[2];
        let m = corner.mass_kg;
        let r = forces.centre;
        let w = state.rate_rad_s;
        let travel = along(e, state.jounce_rate_m_s[i] * 2.0);
        let bias = cross(w, add(cross(w, r), travel));
        // m P, constant and symmetric.
        let projected: [[f64; 3]; 3] = std::array::from_fn(|a| {
            std::array::from_fn(|b| m * (f64::from(u8::from(a == b)) - e[a] * e[b] / square))
        });
        let held = |v: V3<T>| -> V3<T> { std::array::from_fn(|a| dot_constant(projected[a], v)) };
        // Columns of -m P [r]x are m P (axis x r).
        let zero = T::from(0.0);
        let turned = [
            held([zero, -r[2], r[1]]),
            held([r[2], zero, -r[0]]),
            held([-r[1], r[0], zero]),
        ];
        for b in 0..3 {
            for a in b..3 {
                self.matrix[a][b] += T::from(projected[a][b]);
            }
            // Lower left block: [r]x m P, the transpose of the upper right one.
            for a in 0..3 {
                self.matrix[3 + b][a] += turned[b][a];
            }
            let column = cross(r, turned[b]);
            for a in b..3 {
                self.matrix[3 + a][3 + b] += column[a];
            }
        }
        let weight = scale(frame.gravity, T::from(m));
        let outer = add(forces.force, weight);
        let guided = along(e, (push - dot_constant(e, outer)) / square);
        let inertial = held(bias);
        let onto_body = sub(add(outer, guided), inertial);
        let at_centre = sub(add(weight, guided), inertial);
        let moment = add(forces.moment, cross(r, at_centre));
        for k in 0..3 {
            self.right[k] += onto_body[k];
            self.right[3 + k] += moment[k];
        }
        bias
    }
}

/// A solved instant.
struct Solution<T> {
    rate: State<T>,
    wheels: [WheelForces<T>; 4],
    struts: [[T; 3]; 4],
    specific_force: V3<T>,
}

/// Rate of the state with loads, forces, slips and strut lengths.
pub fn outputs<T: Scalar>(
    parameters: &Parameters,
    state: &State<T>,
    inputs: &Inputs<T>,
) -> Outputs<T> {
    let Solution {
        rate,
        wheels,
        struts,
        specific_force,
    } = solve(parameters, state, inputs);
    Outputs {
        rate,
        load_n: wheels.map(|wheel| wheel.load),
        deflection_m: wheels.map(|wheel| wheel.deflection),
        longitudinal_n: wheels.map(|wheel| wheel.longitudinal),
        lateral_n: wheels.map(|wheel| wheel.lateral),
        slip_angle_rad: wheels.map(|wheel| wheel.tangent.atan()),
        slip_ratio: wheels.map(|wheel| wheel.ratio),
        strut_length_m: struts.map(|strut| strut[0]),
        strut_force_n: struts.map(|strut| strut[1]),
        specific_force_m_s2: specific_force,
    }
}

#[inline]
fn solve<T: Scalar>(parameters: &Parameters, state: &State<T>, inputs: &Inputs<T>) -> Solution<T> {
    let frame = frame(parameters, state, inputs);
    let mut system = System::of_body(parameters, state, &frame);
    let wheels: [WheelForces<T>; 4] =
        std::array::from_fn(|i| wheel(parameters, state, inputs, &frame, i));
    let struts: [[T; 3]; 4] = std::array::from_fn(|i| suspension(&parameters.corners[i], state, i));
    let bias: [V3<T>; 4] = std::array::from_fn(|i| {
        let corner = &parameters.corners[i];
        system.add_wheel(corner, state, &frame, &wheels[i], struts[i][2], i)
    });
    let solved = solve_symmetric(system.matrix, system.right);
    let acceleration = [solved[0], solved[1], solved[2]];
    let turning = [solved[3], solved[4], solved[5]];
    let mut rate = kinematics(state, &frame);
    rate.velocity_m_s = sub(acceleration, cross(state.rate_rad_s, state.velocity_m_s));
    rate.rate_rad_s = turning;
    for i in 0..4 {
        let corner = &parameters.corners[i];
        let (e, m) = (corner.path, corner.mass_kg);
        let square = e[0] * e[0] + e[1] * e[1] + e[2] * e[2];
        let own = add(add(acceleration, cross(turning, wheels[i].centre)), bias[i]);
        let pull = add(wheels[i].force, scale(sub(frame.gravity, own), T::from(m)));
        rate.jounce_rate_m_s[i] = (dot_constant(e, pull) - struts[i][2]) / (m * square);
        rate.wheel_speed_rad_s[i] = wheels[i].spin_rate;
        rate.slip_tangent[i] = wheels[i].tangent_rate;
        rate.slip_ratio[i] = wheels[i].ratio_rate;
    }
    Solution {
        rate,
        wheels,
        struts,
        specific_force: sub(acceleration, frame.gravity),
    }
}

/// Rates of place, attitude and jounce.
#[inline]
fn kinematics<T: Scalar>(state: &State<T>, frame: &Frame<T>) -> State<T> {
    let mut rate = State::zero();
    let [roll, pitch, yaw] = state.attitude_rad;
    let [p, q, r] = state.rate_rad_s;
    let (sr, cr) = roll.sin_cos();
    let (sp, cp) = pitch.sin_cos();
    let turn = (q * sr + r * cr) / cp;
    rate.attitude_rad = [p + turn * sp, q * cr - r * sr, turn];
    let ahead = dot(frame.axes[0], state.velocity_m_s);
    let left = dot(frame.axes[1], state.velocity_m_s);
    let (sy, cy) = yaw.sin_cos();
    rate.position_m = [
        ahead * cy - left * sy,
        ahead * sy + left * cy,
        dot(frame.axes[2], state.velocity_m_s),
    ];
    rate.jounce_m = state.jounce_rate_m_s;
    rate
}

/// Rate of the state.
#[inline]
pub fn derivative<T: Scalar>(
    parameters: &Parameters,
    state: &State<T>,
    inputs: &Inputs<T>,
) -> State<T> {
    solve(parameters, state, inputs).rate
}

/// Numbers whose signs tell contact, wheel by wheel: how far the tyres are pressed in, how far the
/// struts are past their droop stops, and past their bump stops, m.
#[must_use]
pub fn guards(parameters: &Parameters, state: &State<f64>, inputs: &Inputs<f64>) -> [f64; 12] {
    let frame = frame(parameters, state, inputs);
    let up = frame.axes[2];
    let mut guards = [0.0; 12];
    for (i, corner) in parameters.corners.iter().enumerate() {
        let centre = add(corner.wheel_centre_m, along(corner.path, state.jounce_m[i]));
        let (sin, cos) = inputs.steer_rad[i].sin_cos();
        let lean = up[1] * cos - up[0] * sin;
        let height = state.position_m[2] + dot(up, centre) - inputs.road_m[i];
        let length = corner.strut.length_m(state.jounce_m[i]);
        guards[i] = corner.unloaded_radius_m - height / (1.0 - lean * lean).sqrt();
        guards[4 + i] = length - corner.strut.strut.droop_stop_length_m;
        guards[8 + i] = corner.strut.strut.bump_stop_length_m - length;
    }
    guards
}

/// One step of the classical fourth-order Runge-Kutta rule, inputs held. Allocates nothing.
#[inline]
pub fn step<T: Scalar>(
    parameters: &Parameters,
    state: &State<T>,
    inputs: &Inputs<T>,
    step_s: f64,
) -> State<T> {
    State::from_array(rk4(&state.to_array(), step_s, |x| {
        derivative(parameters, &State::from_array(*x), inputs).to_array()
    }))
}

/// Exact Jacobian of the rate by the state, by dual numbers.
#[must_use]
pub fn jacobian(
    parameters: &Parameters,
    state: &State<f64>,
    inputs: &Inputs<f64>,
) -> SMatrix<f64, STATES, STATES> {
    let lift = |values: [f64; 4]| values.map(DualSVec64::<STATES>::from);
    let inputs = Inputs {
        steer_rad: lift(inputs.steer_rad),
        drive_n_m: lift(inputs.drive_n_m),
        brake_n_m: lift(inputs.brake_n_m),
        road_m: lift(inputs.road_m),
        road_rate_m_s: lift(inputs.road_rate_m_s),
        bank_rad: inputs.bank_rad.into(),
        grade_rad: inputs.grade_rad.into(),
        friction_scale: lift(inputs.friction_scale),
        stiffness_scale: lift(inputs.stiffness_scale),
    };
    let rate = |x: SVector<_, STATES>| {
        derivative(parameters, &State::from_vector(&x), &inputs).to_vector()
    };
    num_dual::jacobian(rate, &state.to_vector()).1
}
