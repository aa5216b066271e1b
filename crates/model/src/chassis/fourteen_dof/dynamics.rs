//! Equations of motion of the 14-degree-of-freedom model.

use nalgebra::Matrix3;

use super::vector::{
    Symmetric, V3, add, along, cross, dot, dot_constant, lift, scale, solve_symmetric, sub,
};
use super::{CornerParameters, Inputs, Parameters, State};
use crate::Scalar;
use crate::chassis::form::Form;
use crate::scalar::{each, sin_cos};
use crate::tyre::{Brush, Contact, Forces, OnSurface, saturated, steady_slip, tread_moment};

/// How the tyres are asked for their forces.
pub(super) trait Tyres<T> {
    /// Longitudinal and lateral force and aligning moment in the contact frame, N and N m.
    fn force(
        &self,
        wheel: usize,
        load_n: T,
        slip_tangent: T,
        slip_ratio: T,
        camber_rad: T,
    ) -> [T; 3];

    /// Overturning moment and size of the rolling resistance moment, N m, of a wheel with a load (N), a
    /// camber angle (rad), forces as above and a speed (m/s); `None` for what the tyre itself does not
    /// give.
    #[inline(always)]
    fn moments(&self, _: usize, _: [T; 2], _: [T; 3], _: T) -> [Option<T>; 2] {
        [None, None]
    }
}

/// Tyres of any kind, through [`Tyre::forces`](crate::tyre::Tyre::forces).
pub(super) struct AnyTyres<'a, T> {
    pub parameters: &'a Parameters,
    pub inputs: &'a Inputs<T>,
}

impl<T: Scalar> Tyres<T> for AnyTyres<'_, T> {
    #[inline]
    fn force(&self, wheel: usize, load_n: T, slip_tangent: T, slip_ratio: T, lean: T) -> [T; 3] {
        let contact = Contact {
            load_n,
            slip_tangent,
            slip_ratio,
            camber_rad: lean,
            friction_scale: self.inputs.friction_scale[wheel],
            stiffness_scale: self.inputs.stiffness_scale[wheel],
        };
        let tyre = &self.parameters.corners[wheel].tyre;
        let forces = tyre.forces_on(wheel.is_multiple_of(2), &contact);
        [forces.longitudinal_n, forces.lateral_n, forces.aligning_n_m]
    }

    #[inline]
    fn moments(
        &self,
        wheel: usize,
        [load_n, camber_rad]: [T; 2],
        [longitudinal_n, lateral_n, aligning_n_m]: [T; 3],
        speed_m_s: T,
    ) -> [Option<T>; 2] {
        let contact = Contact {
            camber_rad,
            ..Contact::combined(load_n, T::from(0.0), T::from(0.0))
        };
        let forces = Forces {
            longitudinal_n,
            lateral_n,
            aligning_n_m,
        };
        let tyre = &self.parameters.corners[wheel].tyre;
        tyre.moments_on(wheel.is_multiple_of(2), &contact, &forces, speed_m_s)
    }
}

/// Brush tyres under the inputs of one step.
pub(super) struct BrushTyres<'a, T, const GROWS: bool> {
    pub corners: &'a [Brush; 4],
    pub surfaces: [OnSurface<T>; 4],
}

impl<T: Scalar, const GROWS: bool> Tyres<T> for BrushTyres<'_, T, GROWS> {
    #[inline(always)]
    fn force(&self, wheel: usize, load_n: T, slip_tangent: T, slip_ratio: T, _: T) -> [T; 3] {
        let (brush, surface) = (&self.corners[wheel], &self.surfaces[wheel]);
        let slip = brush.slipping(surface, slip_tangent, slip_ratio);
        let pull = slip.pull::<GROWS>(load_n);
        [slip.along * pull, slip.across * pull, T::from(0.0)]
    }
}

/// What the parameters come to, worked out once a step.
pub(super) struct Constants {
    corners: [CornerConstants; 4],
    /// Inverse of m_s + sum m_i P_i, which is constant in body axes.
    inverse_mass: [[f64; 3]; 3],
}

struct CornerConstants {
    /// Path e over its length.
    direction: [f64; 3],
    /// 1/(e'e) and 1/(m e'e).
    inverse_square: f64,
    inverse_travel: f64,
    inverse_spin: f64,
    inverse_length: f64,
}

impl Constants {
    #[inline(always)]
    pub(super) fn of(parameters: &Parameters) -> Self {
        let corners = each(|i| {
            let corner = &parameters.corners[i];
            let e = corner.path;
            let inverse_square = (e[0] * e[0] + e[1] * e[1] + e[2] * e[2]).recip();
            let inverse = inverse_square.sqrt();
            CornerConstants {
                direction: [e[0] * inverse, e[1] * inverse, e[2] * inverse],
                inverse_square,
                inverse_travel: inverse_square / corner.mass_kg,
                inverse_spin: corner.spin_inertia_kg_m2.recip(),
                inverse_length: corner.relaxation_length_m.recip(),
            }
        });
        let mut mass = Matrix3::identity() * parameters.sprung_mass_kg;
        for (corner, constants) in parameters.corners.iter().zip(&corners) {
            let e = nalgebra::Vector3::from(constants.direction);
            mass += (Matrix3::identity() - e * e.transpose()) * corner.mass_kg;
        }
        let inverse = mass.try_inverse().unwrap_or_else(Matrix3::zeros);
        Self {
            corners,
            inverse_mass: [0, 1, 2].map(|i| [0, 1, 2].map(|j| inverse[(i, j)])),
        }
    }
}

/// What the inputs come to, the same for all stages of a step.
#[derive(Clone, Copy)]
pub(super) struct Held<T> {
    pub sin: [T; 4],
    pub cos: [T; 4],
    pub drive: [T; 4],
    pub brake: [T; 4],
    pub road: [T; 4],
    pub road_rate: [T; 4],
    /// Gravity along the road's axes ahead, left, up: g sin(grade), -g sin(bank) cos(grade),
    /// -g cos(bank) cos(grade).
    pub gravity: [T; 3],
}

impl<T: Scalar> Held<T> {
    #[inline(always)]
    pub(super) fn of(parameters: &Parameters, inputs: &Inputs<T>) -> Self {
        let turned = each(|i| sin_cos(inputs.steer_rad[i]));
        let (sb, cb) = sin_cos(inputs.bank_rad);
        let (sg, cg) = sin_cos(inputs.grade_rad);
        let g = parameters.gravity_m_s2;
        Self {
            sin: each(|i| turned[i].0),
            cos: each(|i| turned[i].1),
            drive: inputs.drive_n_m,
            brake: inputs.brake_n_m,
            road: inputs.road_m,
            road_rate: inputs.road_rate_m_s,
            gravity: [sg * g, -sb * cg * g, -cb * cg * g],
        }
    }
}

/// Wheel centre from the sprung centre of gravity, m, right above the contact point: along its path
/// with jounce, and about an upright axis as it is steered.
#[inline(always)]
pub(super) fn centre<T: Scalar>(
    parameters: &Parameters,
    state: &State<T>,
    held: &Held<T>,
    i: usize,
) -> V3<T> {
    let corner = &parameters.corners[i];
    let ([x, y], sin, back) = (corner.steer_arm_m, held.sin[i], held.cos[i] - 1.0);
    let steered = [back * x - sin * y, sin * x + back * y, T::from(0.0)];
    let travelled = along(corner.path, state.jounce_m[i]);
    add(add(lift(corner.wheel_centre_m), steered), travelled)
}

/// Orientation of the body and gravity.
#[derive(Clone, Copy)]
pub(super) struct Frame<T> {
    /// Sine and cosine of roll.
    roll: [T; 2],
    /// Sine and cosine of pitch.
    pitch: [T; 2],
    /// Heading axes (ahead, left, up) in body axes.
    pub axes: [V3<T>; 3],
    pub gravity: V3<T>,
}

#[inline(always)]
pub(super) fn frame<T: Scalar>(state: &State<T>, held: &Held<T>) -> Frame<T> {
    let (sr, cr) = sin_cos(state.attitude_rad[0]);
    let (sp, cp) = sin_cos(state.attitude_rad[1]);
    let axes = [
        [cp, sp * sr, sp * cr],
        [T::from(0.0), cr, -sr],
        [-sp, cp * sr, cp * cr],
    ];
    let [ahead, left, up] = held.gravity;
    Frame {
        roll: [sr, cr],
        pitch: [sp, cp],
        axes,
        gravity: add(
            add(scale(axes[0], ahead), scale(axes[1], left)),
            scale(axes[2], up),
        ),
    }
}

/// One wheel's forces.
#[derive(Clone, Copy)]
pub(super) struct WheelForces<T> {
    /// Wheel centre from the sprung centre of gravity, m.
    pub centre: V3<T>,
    /// Force on the wheel and its moment about the sprung centre of gravity, spin taken off.
    force: V3<T>,
    moment: V3<T>,
    pub load: T,
    pub deflection: T,
    /// Longitudinal and lateral force, contact frame.
    pub contact: [T; 2],
    /// Slips that the tyre sees, and their rates.
    pub slips: [T; 2],
    slip_rates: [T; 2],
    spin_rate: T,
}

#[inline(always)]
fn wheel<T: Scalar, F: Form>(
    parameters: &Parameters,
    constants: &Constants,
    tyres: &impl Tyres<T>,
    state: &State<T>,
    held: &Held<T>,
    frame: &Frame<T>,
    i: usize,
) -> WheelForces<T> {
    let corner = &parameters.corners[i];
    let up = frame.axes[2];
    let (sin, cos) = (held.sin[i], held.cos[i]);
    let spindle = [-sin, cos, T::from(0.0)];
    let centre = centre(parameters, state, held, i);
    let travel = along(corner.path, state.jounce_rate_m_s[i]);
    let turning = state.rate_rad_s;
    let velocity = add(add(state.velocity_m_s, cross(turning, centre)), travel);
    let height = state.position_m[2] + dot(up, centre) - held.road[i];
    let lean = up[1] * cos - up[0] * sin;
    let upright = (-lean * lean + 1.0).sqrt().recip();
    let radius = height * upright;
    let deflection = -radius + corner.unloaded_radius_m;
    let closing = -(dot(up, velocity) - held.road_rate[i]) * upright;
    let pressed = (deflection * corner.vertical_stiffness_n_m
        + closing * corner.vertical_damping_n_s_m)
        .at_least(0.0);
    let load = if deflection > 0.0 {
        pressed
    } else {
        T::from(0.0)
    };
    // Spindle x up, of unit length.
    let ahead = scale(
        [cos * up[2], sin * up[2], -sin * up[1] - cos * up[0]],
        upright,
    );
    let left = cross(up, ahead);
    let reach = scale(sub(up, scale(spindle, lean)), radius * upright);
    let sliding = dot(sub(velocity, cross(turning, reach)), left);
    let rolling = dot(velocity, ahead);
    let spin = state.wheel_speed_rad_s[i];
    let slip_speed = spin * corner.rolling_radius_m - rolling;
    let (slips, slip_rates) = if F::relaxes(corner.relaxation_length_m) {
        let (tangent, ratio) = (state.slip_tangent[i], state.slip_ratio[i]);
        let (speed, inverse) = (rolling.magnitude(), constants.corners[i].inverse_length);
        let rates = [
            (sliding - speed * tangent) * inverse,
            (slip_speed - speed * ratio) * inverse,
        ];
        ([tangent, ratio], rates)
    } else {
        let low = parameters.low_speed_m_s;
        let slips = [
            steady_slip(sliding, rolling, low),
            steady_slip(slip_speed, rolling, low),
        ];
        (slips, [T::from(0.0); 2])
    };
    let [by_jounce, by_steer] = corner.inclination;
    let inclination = lean + state.jounce_m[i] * by_jounce + sin * by_steer;
    let [x, y, aligning] = tyres.force(i, load, slips[0], slips[1], inclination);
    let force = add(scale(up, load), add(scale(ahead, x), scale(left, y)));
    let turn = saturated(spin);
    let [overturning, resistance] =
        tyres.moments(i, [load, inclination], [x, y, aligning], rolling);
    let rolling_moment = match resistance {
        Some(resistance) => -resistance * turn,
        None => load * turn * (-corner.rolling_resistance * corner.rolling_radius_m),
    };
    let torque =
        held.drive[i] - x * corner.rolling_radius_m + rolling_moment - held.brake[i] * turn;
    let tipping = match overturning {
        Some(overturning) => -overturning,
        None => tread_moment(
            corner.tread_width_m,
            corner.vertical_stiffness_n_m,
            load,
            inclination * upright,
        ),
    };
    let turned = sub(scale(up, aligning), scale(ahead, tipping));
    let moment = add(cross(sub(centre, reach), force), turned);
    // The body takes what drives and brakes the wheel, and turns the wheel's spin momentum.
    let momentum = spin * corner.spin_inertia_kg_m2;
    let gyroscopic = [
        -turning[2] * cos,
        -turning[2] * sin,
        turning[0] * cos + turning[1] * sin,
    ];
    let spun = sub(
        scale(spindle, rolling_moment - torque),
        scale(gyroscopic, momentum),
    );
    WheelForces {
        centre,
        force,
        moment: add(moment, spun),
        load,
        deflection,
        contact: [x, y],
        slips,
        slip_rates,
        spin_rate: torque * constants.corners[i].inverse_spin,
    }
}

/// Strut length, strut force, and force of strut and bar referred to jounce.
#[inline(always)]
fn suspension<T: Scalar>(corner: &CornerParameters, state: &State<T>, i: usize) -> [T; 3] {
    let strut = &corner.strut;
    let jounce = state.jounce_m[i];
    let length = strut.length_m(jounce);
    let ratio = strut.motion_ratio_at(jounce);
    let force = strut.force_n(length, -state.jounce_rate_m_s[i] * ratio);
    let push = force * ratio + (jounce - state.jounce_m[i ^ 1]) * corner.bar_n_m;
    [length, force, push]
}

/// What one wheel adds to the body's equations. With d = e/|e| and q = r x d:
/// sum m_i P_i [r_i]x' and sum [r_i]x m_i P_i [r_i]x' need r, q and d only.
struct Share<T> {
    /// Upward to the body: force, and moment about its centre of gravity.
    force: V3<T>,
    moment: V3<T>,
    /// m r, and q.
    lever: V3<T>,
    across: V3<T>,
    /// omega x (omega x r) + 2 omega x e s'.
    bias: V3<T>,
}

#[inline(always)]
fn share<T: Scalar>(
    parameters: &Parameters,
    constants: &Constants,
    state: &State<T>,
    gravity: V3<T>,
    forces: &WheelForces<T>,
    push: T,
    i: usize,
) -> Share<T> {
    let (corner, constants) = (&parameters.corners[i], &constants.corners[i]);
    let (e, d, m) = (corner.path, constants.direction, corner.mass_kg);
    let (r, w) = (forces.centre, state.rate_rad_s);
    let travel = along(e, state.jounce_rate_m_s[i] * 2.0);
    let bias = cross(w, add(cross(w, r), travel));
    let weight = scale(gravity, T::from(m));
    let outer = add(forces.force, weight);
    let guided = along(
        e,
        (push - dot_constant(e, outer)) * constants.inverse_square,
    );
    // m P bias
    let inertial = scale(sub(bias, along(d, dot_constant(d, bias))), T::from(m));
    let at_centre = sub(guided, inertial);
    Share {
        force: add(outer, at_centre),
        moment: add(forces.moment, cross(r, add(weight, at_centre))),
        lever: scale(r, T::from(m)),
        across: cross(r, lift(d)),
        bias,
    }
}

/// The body's equations, grown wheel by wheel.
#[derive(Clone, Copy)]
struct Body<T> {
    force: V3<T>,
    moment: V3<T>,
    /// sum m r.
    lever: V3<T>,
    /// sum m q d', rows.
    slanted: [V3<T>; 3],
    /// Inertia about the sprung part's centre of gravity, wheels included where the paths hold
    /// them.
    inertia: Symmetric<T>,
}

impl<T: Scalar> Body<T> {
    #[inline(always)]
    fn new(parameters: &Parameters, state: &State<T>, gravity: V3<T>) -> Self {
        let p = parameters;
        let [ix, iy, iz] = p.inertia_kg_m2;
        let xz = p.inertia_xz_kg_m2;
        let w = state.rate_rad_s;
        let spin = [w[0] * ix - w[2] * xz, w[1] * iy, w[2] * iz - w[0] * xz];
        let [x, y, z] = scale(gravity, T::from(p.sprung_mass_kg));
        let speed = state.velocity_m_s[0];
        let zero = T::from(0.0);
        Self {
            force: [x - speed * speed.magnitude() * p.drag_n_s2_m2, y, z],
            moment: cross(spin, w),
            lever: [zero; 3],
            slanted: [[zero; 3]; 3],
            inertia: [
                T::from(ix),
                zero,
                T::from(iy),
                T::from(-xz),
                zero,
                T::from(iz),
            ],
        }
    }

    #[inline(always)]
    fn with(
        self,
        parameters: &Parameters,
        constants: &Constants,
        wheel: &WheelForces<T>,
        share: &Share<T>,
        i: usize,
    ) -> Self {
        let mass_kg = parameters.corners[i].mass_kg;
        let direction = constants.corners[i].direction;
        let (r, q) = (wheel.centre, share.across);
        let [mx, my, mz] = share.lever;
        let [qx, qy, qz] = scale(q, T::from(mass_kg));
        let (xx, yy, zz) = (mx * r[0], my * r[1], mz * r[2]);
        let [ixx, iyx, iyy, izx, izy, izz] = self.inertia;
        let [sx, sy, sz] = self.slanted;
        Self {
            force: add(self.force, share.force),
            moment: add(self.moment, share.moment),
            lever: add(self.lever, share.lever),
            slanted: [
                add(sx, along(direction, qx)),
                add(sy, along(direction, qy)),
                add(sz, along(direction, qz)),
            ],
            inertia: [
                ixx + (yy + zz - qx * q[0]),
                iyx - (my * r[0] + qy * q[0]),
                iyy + (xx + zz - qy * q[1]),
                izx - (mz * r[0] + qz * q[0]),
                izy - (mz * r[1] + qz * q[1]),
                izz + (xx + yy - qz * q[2]),
            ],
        }
    }

    /// (a_0, alpha): the force's equation solved for a_0 and put into the moment's.
    #[inline(always)]
    fn solve(&self, constants: &Constants) -> [V3<T>; 2] {
        let zero = T::from(0.0);
        let [x, y, z] = self.lever;
        // C = sum [r]x m P.
        let c = [
            sub([zero, -z, y], self.slanted[0]),
            sub([z, zero, -x], self.slanted[1]),
            sub([-y, x, zero], self.slanted[2]),
        ];
        // G = C A^-1 with A the constant block of the force's equation.
        let inverse = &constants.inverse_mass;
        let times = |v: V3<T>| {
            [
                dot_constant(inverse[0], v),
                dot_constant(inverse[1], v),
                dot_constant(inverse[2], v),
            ]
        };
        let g = [times(c[0]), times(c[1]), times(c[2])];
        let [ixx, iyx, iyy, izx, izy, izz] = self.inertia;
        let left = [
            ixx - dot(g[0], c[0]),
            iyx - dot(g[1], c[0]),
            iyy - dot(g[1], c[1]),
            izx - dot(g[2], c[0]),
            izy - dot(g[2], c[1]),
            izz - dot(g[2], c[2]),
        ];
        let f = self.force;
        let right = sub(self.moment, [dot(g[0], f), dot(g[1], f), dot(g[2], f)]);
        let turning = solve_symmetric(left, right);
        let held = add(
            add(scale(c[0], turning[0]), scale(c[1], turning[1])),
            scale(c[2], turning[2]),
        );
        [times(sub(f, held)), turning]
    }
}

/// A solved instant.
pub(super) struct Solution<T> {
    pub rate: State<T>,
    pub wheels: [WheelForces<T>; 4],
    pub struts: [[T; 3]; 4],
    pub specific_force: V3<T>,
}

#[inline(always)]
pub(super) fn solve<T: Scalar, F: Form>(
    parameters: &Parameters,
    constants: &Constants,
    tyres: &impl Tyres<T>,
    state: &State<T>,
    held: &Held<T>,
) -> Solution<T> {
    let frame = frame(state, held);
    let g = frame.gravity;
    // Written out: a closure of this size would stay a call, which vector code cannot hold.
    let wheels = [
        wheel::<T, F>(parameters, constants, tyres, state, held, &frame, 0),
        wheel::<T, F>(parameters, constants, tyres, state, held, &frame, 1),
        wheel::<T, F>(parameters, constants, tyres, state, held, &frame, 2),
        wheel::<T, F>(parameters, constants, tyres, state, held, &frame, 3),
    ];
    let struts = each(|i| suspension(&parameters.corners[i], state, i));
    let shares = [
        share(parameters, constants, state, g, &wheels[0], struts[0][2], 0),
        share(parameters, constants, state, g, &wheels[1], struts[1][2], 1),
        share(parameters, constants, state, g, &wheels[2], struts[2][2], 2),
        share(parameters, constants, state, g, &wheels[3], struts[3][2], 3),
    ];
    let [acceleration, turning] = Body::new(parameters, state, g)
        .with(parameters, constants, &wheels[0], &shares[0], 0)
        .with(parameters, constants, &wheels[1], &shares[1], 1)
        .with(parameters, constants, &wheels[2], &shares[2], 2)
        .with(parameters, constants, &wheels[3], &shares[3], 3)
        .solve(constants);
    let jounce = each(|i| {
        let corner = &parameters.corners[i];
        let own = add(
            add(acceleration, cross(turning, wheels[i].centre)),
            shares[i].bias,
        );
        let weight = scale(sub(g, own), T::from(corner.mass_kg));
        let pull = add(wheels[i].force, weight);
        (dot_constant(corner.path, pull) - struts[i][2]) * constants.corners[i].inverse_travel
    });
    let mut rate = kinematics(state, &frame);
    rate.velocity_m_s = sub(acceleration, cross(state.rate_rad_s, state.velocity_m_s));
    rate.rate_rad_s = turning;
    rate.jounce_rate_m_s = jounce;
    rate.wheel_speed_rad_s = each(|i| wheels[i].spin_rate);
    rate.slip_tangent = each(|i| wheels[i].slip_rates[0]);
    rate.slip_ratio = each(|i| wheels[i].slip_rates[1]);
    Solution {
        rate,
        specific_force: sub(acceleration, g),
        wheels,
        struts,
    }
}

/// Rates of place, attitude and jounce.
#[inline(always)]
fn kinematics<T: Scalar>(state: &State<T>, frame: &Frame<T>) -> State<T> {
    let mut rate = State::zero();
    let [[sr, cr], [sp, cp]] = [frame.roll, frame.pitch];
    let [p, q, r] = state.rate_rad_s;
    let turn = (q * sr + r * cr) / cp;
    rate.attitude_rad = [p + turn * sp, q * cr - r * sr, turn];
    let ahead = dot(frame.axes[0], state.velocity_m_s);
    let left = dot(frame.axes[1], state.velocity_m_s);
    let (sy, cy) = sin_cos(state.attitude_rad[2]);
    rate.position_m = [
        ahead * cy - left * sy,
        ahead * sy + left * cy,
        dot(frame.axes[2], state.velocity_m_s),
    ];
    rate.jounce_m = state.jounce_rate_m_s;
    rate
}
