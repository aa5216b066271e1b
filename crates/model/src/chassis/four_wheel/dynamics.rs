//! Equations of motion of the four-wheel model.

use nalgebra::{SMatrix, SVector};
use num_dual::DualSVec64;

use super::{Inputs, Parameters, STATES, State};
use crate::Scalar;
use crate::integrate::rk4;
use crate::tyre::{Contact, relaxed_rate, saturated, steady_slip};

/// What the model tells besides the derivative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outputs<T> {
    /// Rate of the state.
    pub rate: State<T>,
    /// Normal loads, N.
    pub load_n: [T; 4],
    /// Longitudinal tyre forces, wheel frame, N.
    pub longitudinal_n: [T; 4],
    /// Lateral tyre forces, wheel frame, N.
    pub lateral_n: [T; 4],
    /// Aligning moments, N m.
    pub aligning_n_m: [T; 4],
    /// Slip angles of the tyres, rad (relaxed where they relax).
    pub slip_angle_rad: [T; 4],
    /// Longitudinal slips of the tyres (relaxed where they relax).
    pub slip_ratio: [T; 4],
    /// Acceleration u' - v r of the centre of gravity, body axes, m/s^2.
    pub longitudinal_m_s2: T,
    /// Acceleration v' + u r of the centre of gravity, body axes, m/s^2.
    pub lateral_m_s2: T,
}

/// Wheels' motion, before any force.
#[derive(Clone, Copy)]
struct Wheels<T> {
    sin: [T; 4],
    cos: [T; 4],
    rolling: [T; 4],
    sliding: [T; 4],
    tangent: [T; 4],
    ratio: [T; 4],
}

#[derive(Clone, Copy)]
struct Solution<T> {
    load: [T; 4],
    x: [T; 4],
    y: [T; 4],
    moment: [T; 4],
    accelerations: [T; 5],
}

/// Sine and cosine of each wheel's steer angle without roll steer, the same for all stages of a
/// step.
type Turned<T> = [(T, T); 4];

#[inline]
fn turned<T: Scalar>(inputs: &Inputs<T>) -> Turned<T> {
    inputs.steer_rad.map(|steer| {
        if T::NDERIV == 0 && steer == 0.0 {
            (steer, T::from(1.0))
        } else {
            steer.sin_cos()
        }
    })
}

#[inline]
fn wheels<T: Scalar>(
    parameters: &Parameters,
    state: &State<T>,
    inputs: &Inputs<T>,
    turned: &Turned<T>,
) -> Wheels<T> {
    let zero = [T::from(0.0); 4];
    let mut wheels = Wheels {
        sin: zero,
        cos: zero,
        rolling: zero,
        sliding: zero,
        tangent: zero,
        ratio: zero,
    };
    for i in 0..4 {
        let axle = parameters.axle(i);
        let [x, y] = parameters.wheel_position_m(i);
        let along = state.longitudinal_m_s - state.yaw_rate_rad_s * y;
        let across = state.lateral_m_s + state.yaw_rate_rad_s * x;
        let (sin, cos) = if axle.roll_steer == 0.0 {
            turned[i]
        } else {
            (inputs.steer_rad[i] + state.roll_rad * axle.roll_steer).sin_cos()
        };
        let rolling = along * cos + across * sin;
        let sliding = across * cos - along * sin;
        wheels.sin[i] = sin;
        wheels.cos[i] = cos;
        wheels.rolling[i] = rolling;
        wheels.sliding[i] = sliding;
        if axle.relaxation_length_m > 0.0 {
            wheels.tangent[i] = state.slip_tangent[i];
            wheels.ratio[i] = state.slip_ratio[i];
        } else {
            let low = parameters.low_speed_m_s;
            let slip = state.wheel_speed_rad_s[i] * axle.rolling_radius_m - rolling;
            wheels.tangent[i] = steady_slip(sliding, rolling, low);
            wheels.ratio[i] = steady_slip(slip, rolling, low);
        }
    }
    wheels
}

/// What does not depend on the tyres' forces.
#[derive(Clone, Copy)]
struct Held<T> {
    /// m g cos(bank) cos(grade).
    down: T,
    bank_pull: T,
    grade_pull: T,
    drag: T,
    /// m_s g h_s sin(phi) - K_phi phi - B_phi phi'.
    rolling: T,
    /// m_s g h_p sin(theta) - K_theta theta - B_theta theta'.
    pitching: T,
    /// (K_theta theta + B_theta theta')/L.
    pitch_transfer: T,
    /// (K_phi phi + B_phi phi')/t of each axle.
    roll_transfer: [T; 2],
}

#[inline]
fn held<T: Scalar>(parameters: &Parameters, state: &State<T>, inputs: &Inputs<T>) -> Held<T> {
    let p = parameters;
    let g = p.gravity_m_s2;
    let weight = p.sprung_mass_kg * g;
    let level = T::NDERIV == 0 && inputs.bank_rad == 0.0 && inputs.grade_rad == 0.0;
    let (down, bank_pull, grade_pull) = if level {
        (T::from(p.mass_kg * g), T::from(0.0), T::from(0.0))
    } else {
        let (sb, cb) = inputs.bank_rad.sin_cos();
        let (sg, cg) = inputs.grade_rad.sin_cos();
        (cb * cg * (p.mass_kg * g), sb * g, sg * g)
    };
    let [front, rear] = [&p.front, &p.rear].map(|axle| {
        state.roll_rad * axle.roll_stiffness_n_m_rad
            + state.roll_rate_rad_s * axle.roll_damping_n_m_s_rad
    });
    let spring = state.pitch_rad * p.pitch_stiffness_n_m_rad
        + state.pitch_rate_rad_s * p.pitch_damping_n_m_s_rad;
    let speed = state.longitudinal_m_s;
    Held {
        down,
        bank_pull,
        grade_pull,
        drag: speed * speed.magnitude() * p.drag_n_s2_m2,
        rolling: state.roll_rad.sin() * (weight * p.roll_arm_m) - front - rear,
        pitching: state.pitch_rad.sin() * (weight * p.pitch_arm_m) - spring,
        pitch_transfer: spring * p.inverse_wheelbase,
        roll_transfer: [front * p.inverse_track[0], rear * p.inverse_track[1]],
    }
}

/// Loads from roll, pitch and the axles' forces.
#[inline]
fn loads<T: Scalar>(
    parameters: &Parameters,
    held: &Held<T>,
    lateral_force: [T; 2],
    longitudinal_force: T,
    felt_lateral: T,
) -> [T; 4] {
    let p = parameters;
    let pitch =
        held.pitch_transfer - longitudinal_force * (p.pitch_centre_height_m * p.inverse_wheelbase);
    // An axle that would pull hangs; the other carries the vehicle.
    let front = (held.down * (-p.rear.ahead_m * p.inverse_wheelbase) + pitch).at_least(0.0);
    let front = if front > held.down { held.down } else { front };
    let sums = [front, held.down - front];
    let mut load = [T::from(0.0); 4];
    for (k, axle) in [&p.front, &p.rear].into_iter().enumerate() {
        let height = axle.roll_centre_height_m;
        let unsprung = axle.unsprung_mass_kg * (axle.unsprung_height_m - height);
        let transfer = held.roll_transfer[k]
            + (lateral_force[k] * height + felt_lateral * unsprung) * p.inverse_track[k];
        let half = sums[k] * 0.5;
        // A wheel that would pull hangs; its neighbour carries the axle.
        let transfer = if transfer > half {
            half
        } else if -transfer > half {
            -half
        } else {
            transfer
        };
        load[2 * k] = half - transfer;
        load[2 * k + 1] = half + transfer;
    }
    load
}

/// (u', v', r', phi'', theta'') and the felt lateral acceleration from the forces' sums.
#[inline]
fn accelerations<T: Scalar>(
    parameters: &Parameters,
    state: &State<T>,
    held: &Held<T>,
    [x, y, moment]: [T; 3],
) -> ([T; 5], T) {
    let p = parameters;
    let felt_x = (x - held.drag) * p.inverse_mass;
    let right = [y, moment, held.rolling];
    let row = |i: usize| {
        right[0] * p.inverse[(i, 0)] + right[1] * p.inverse[(i, 1)] + right[2] * p.inverse[(i, 2)]
    };
    // Solved for a_y + g sin(bank), which is what springs and gauges feel.
    let felt_y = row(0);
    let pitching =
        (felt_x * (-p.sprung_mass_kg * p.pitch_arm_m) + held.pitching) * p.inverse_pitch_inertia;
    let r = state.yaw_rate_rad_s;
    let rates = [
        felt_x + held.grade_pull + state.lateral_m_s * r,
        felt_y - held.bank_pull - state.longitudinal_m_s * r,
        row(1),
        row(2),
        pitching,
    ];
    (rates, felt_y)
}

#[inline]
fn solve<T: Scalar>(
    parameters: &Parameters,
    state: &State<T>,
    inputs: &Inputs<T>,
    wheels: &Wheels<T>,
) -> Solution<T> {
    let p = parameters;
    let held = held(p, state, inputs);
    // Exact in steady turning, where v' = r' = 0.
    let mut felt = state.longitudinal_m_s * state.yaw_rate_rad_s + held.bank_pull;
    let share = felt * (p.mass_kg * p.inverse_wheelbase);
    let mut lateral_force = [share * -p.rear.ahead_m, share * p.front.ahead_m];
    let mut longitudinal_force = T::from(0.0);
    let zero = [T::from(0.0); 4];
    let (mut x, mut y, mut moment) = (zero, zero, zero);
    let mut rates = [T::from(0.0); 5];
    for _ in 0..p.load_passes {
        let load = loads(p, &held, lateral_force, longitudinal_force, felt);
        let mut yawing = T::from(0.0);
        longitudinal_force = T::from(0.0);
        lateral_force = [T::from(0.0); 2];
        for i in 0..4 {
            let contact = Contact {
                load_n: load[i],
                slip_tangent: wheels.tangent[i],
                slip_ratio: wheels.ratio[i],
                camber_rad: T::from(0.0),
                friction_scale: inputs.friction_scale[i],
                stiffness_scale: inputs.stiffness_scale[i],
            };
            let force = p.axle(i).tyre.forces(&contact);
            x[i] = force.longitudinal_n;
            y[i] = force.lateral_n;
            moment[i] = force.aligning_n_m;
            let body_x = x[i] * wheels.cos[i] - y[i] * wheels.sin[i];
            let body_y = x[i] * wheels.sin[i] + y[i] * wheels.cos[i];
            let [ahead, left] = p.wheel_position_m(i);
            longitudinal_force += body_x;
            lateral_force[i / 2] += body_y;
            yawing += body_y * ahead - body_x * left + moment[i];
        }
        let sums = [
            longitudinal_force,
            lateral_force[0] + lateral_force[1],
            yawing,
        ];
        (rates, felt) = accelerations(p, state, &held, sums);
    }
    let load = loads(p, &held, lateral_force, longitudinal_force, felt);
    Solution {
        load,
        x,
        y,
        moment,
        accelerations: rates,
    }
}

#[inline]
fn rate<T: Scalar>(
    parameters: &Parameters,
    state: &State<T>,
    inputs: &Inputs<T>,
    wheels: &Wheels<T>,
    solution: &Solution<T>,
) -> State<T> {
    let [u, v, r, roll, pitch] = solution.accelerations;
    let mut rate = State {
        longitudinal_m_s: u,
        lateral_m_s: v,
        yaw_rate_rad_s: r,
        roll_rad: state.roll_rate_rad_s,
        roll_rate_rad_s: roll,
        pitch_rad: state.pitch_rate_rad_s,
        pitch_rate_rad_s: pitch,
        slip_tangent: [T::from(0.0); 4],
        slip_ratio: [T::from(0.0); 4],
        wheel_speed_rad_s: [T::from(0.0); 4],
    };
    for i in 0..4 {
        let axle = parameters.axle(i);
        let spin = state.wheel_speed_rad_s[i];
        let radius = axle.rolling_radius_m;
        let length = axle.relaxation_length_m;
        if length > 0.0 {
            let slip = spin * radius - wheels.rolling[i];
            rate.slip_tangent[i] = relaxed_rate(
                state.slip_tangent[i],
                wheels.sliding[i],
                wheels.rolling[i],
                length,
            );
            rate.slip_ratio[i] = relaxed_rate(state.slip_ratio[i], slip, wheels.rolling[i], length);
        }
        let resisting = inputs.brake_n_m[i] + solution.load[i] * (axle.rolling_resistance * radius);
        let mut torque = inputs.drive_n_m[i] - solution.x[i] * radius;
        if T::NDERIV > 0 || resisting != 0.0 {
            torque -= resisting * saturated(spin);
        }
        rate.wheel_speed_rad_s[i] = torque * parameters.inverse_spin_inertia[i / 2];
    }
    rate
}

/// Rate of the state.
#[inline]
pub fn derivative<T: Scalar>(
    parameters: &Parameters,
    state: &State<T>,
    inputs: &Inputs<T>,
) -> State<T> {
    derivative_turned(parameters, state, inputs, &turned(inputs))
}

#[inline]
fn derivative_turned<T: Scalar>(
    parameters: &Parameters,
    state: &State<T>,
    inputs: &Inputs<T>,
    turned: &Turned<T>,
) -> State<T> {
    let wheels = wheels(parameters, state, inputs, turned);
    let solution = solve(parameters, state, inputs, &wheels);
    rate(parameters, state, inputs, &wheels, &solution)
}

/// Rate of the state with loads, forces, slips and accelerations.
pub fn outputs<T: Scalar>(
    parameters: &Parameters,
    state: &State<T>,
    inputs: &Inputs<T>,
) -> Outputs<T> {
    let wheels = wheels(parameters, state, inputs, &turned(inputs));
    let solution = solve(parameters, state, inputs, &wheels);
    let rate = rate(parameters, state, inputs, &wheels, &solution);
    Outputs {
        rate,
        load_n: solution.load,
        longitudinal_n: solution.x,
        lateral_n: solution.y,
        aligning_n_m: solution.moment,
        slip_angle_rad: wheels.tangent.map(|tangent| tangent.atan()),
        slip_ratio: wheels.ratio,
        longitudinal_m_s2: rate.longitudinal_m_s - state.lateral_m_s * state.yaw_rate_rad_s,
        lateral_m_s2: rate.lateral_m_s + state.longitudinal_m_s * state.yaw_rate_rad_s,
    }
}

/// Tyre forces (F_x, F_y, F_z) of each wheel, wheel frame, N.
pub fn tyre_forces<T: Scalar>(
    parameters: &Parameters,
    state: &State<T>,
    inputs: &Inputs<T>,
) -> [[T; 3]; 4] {
    let wheels = wheels(parameters, state, inputs, &turned(inputs));
    let solution = solve(parameters, state, inputs, &wheels);
    std::array::from_fn(|i| [solution.x[i], solution.y[i], solution.load[i]])
}

/// One step of the classical fourth-order Runge-Kutta rule, inputs held. Allocates nothing.
#[inline]
pub fn step<T: Scalar>(
    parameters: &Parameters,
    state: &State<T>,
    inputs: &Inputs<T>,
    step_s: f64,
) -> State<T> {
    let turned = turned(inputs);
    State::from_array(rk4(&state.to_array(), step_s, |x| {
        derivative_turned(parameters, &State::from_array(*x), inputs, &turned).to_array()
    }))
}

/// Exact Jacobian of the rate by the state, by dual numbers: row i, column j is
/// d(rate_i)/d(state_j).
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
