//! Equations of motion of the four-wheel model.

use super::contacts::{Contacts, Forces};
use super::{AxleParameters, Inputs, Parameters, State};
use crate::Scalar;
use crate::chassis::form::Form;
use crate::scalar::{each, sin_cos};
use crate::tyre::{saturated, slip_base};
use crate::values::PerWheelValues;

/// Wheels' motion, before any force.
#[derive(Clone, Copy)]
pub(super) struct Wheels<V> {
    /// Sine and cosine of the steer angles.
    pub sin: V,
    pub cos: V,
    /// Speed of the wheel centres along the wheels, m/s.
    rolling: V,
    /// Slip speeds to the left and along, m/s.
    slip: [V; 2],
    /// Slips that the tyres see.
    pub tangent: V,
    pub ratio: V,
}

/// Forces and accelerations.
#[derive(Clone, Copy)]
pub(super) struct Solution<V: PerWheelValues> {
    pub load: V,
    pub forces: Forces<V>,
    /// u', v', r', phi'', theta''.
    accelerations: [V::Number; 5],
}

/// What the parameters come to, worked out once a step.
///
/// Wheel by wheel in lists, so that four wheels make one vector.
pub(super) struct Constants {
    /// Position of each wheel from the centre of gravity.
    pub ahead: [f64; 4],
    pub left: [f64; 4],
    radius: [f64; 4],
    /// Rolling resistance moment per load, m.
    resistance: [f64; 4],
    inverse_spin: [f64; 4],
    length: [f64; 4],
    inverse_length: [f64; 4],
    roll_steer: [f64; 4],
    /// K_phi/t, B_phi/t, h_r/t, m_u (h_u - h_r)/t of each axle.
    transfer: [[f64; 4]; 2],
    /// Share b/L of the weight on the front axle.
    front_share: f64,
    /// Load that a longitudinal force takes off the front axle, h_pc/L.
    pitch_lift: f64,
    /// K_theta/L, B_theta/L.
    pitch_transfer: [f64; 2],
    /// m_s g h_s, K_phi, B_phi.
    roll: [f64; 3],
    /// m_s g h_p, K_theta, B_theta.
    pitch: [f64; 3],
    /// m b/L, m a/L.
    masses: [f64; 2],
    drag: f64,
    inverse_mass: f64,
    /// Rows of the inverse mass matrix of (v' + u r, r', phi'').
    inverse: [[f64; 3]; 3],
    /// -m_s h_p/I and 1/I of pitch.
    pitching: [f64; 2],
    low_speed: f64,
    passes: usize,
}

impl Constants {
    #[inline(always)]
    pub(super) fn of(p: &Parameters) -> Self {
        let g = p.gravity_m_s2;
        let transfer = |k: usize| {
            let (axle, t) = (p.axle(2 * k), p.inverse_track[k]);
            let height = axle.roll_centre_height_m;
            [
                axle.roll_stiffness_n_m_rad * t,
                axle.roll_damping_n_m_s_rad * t,
                height * t,
                axle.unsprung_mass_kg * (axle.unsprung_height_m - height) * t,
            ]
        };
        let of = |value: fn(&AxleParameters) -> f64| each(|i| value(p.axle(i)));
        let share = [-p.rear.ahead_m, p.front.ahead_m].map(|arm| arm * p.inverse_wheelbase);
        let row = |i: usize| [p.inverse[(i, 0)], p.inverse[(i, 1)], p.inverse[(i, 2)]];
        Self {
            ahead: each(|i| p.wheel_position_m(i)[0]),
            left: each(|i| p.wheel_position_m(i)[1]),
            radius: of(|axle| axle.rolling_radius_m),
            resistance: of(|axle| axle.rolling_resistance * axle.rolling_radius_m),
            inverse_spin: each(|i| p.inverse_spin_inertia[i / 2]),
            length: of(|axle| axle.relaxation_length_m),
            inverse_length: of(|axle| axle.relaxation_length_m.recip()),
            roll_steer: of(|axle| axle.roll_steer),
            transfer: [transfer(0), transfer(1)],
            front_share: share[0],
            pitch_lift: p.pitch_centre_height_m * p.inverse_wheelbase,
            pitch_transfer: [
                p.pitch_stiffness_n_m_rad * p.inverse_wheelbase,
                p.pitch_damping_n_m_s_rad * p.inverse_wheelbase,
            ],
            roll: [
                p.sprung_mass_kg * g * p.roll_arm_m,
                p.front.roll_stiffness_n_m_rad + p.rear.roll_stiffness_n_m_rad,
                p.front.roll_damping_n_m_s_rad + p.rear.roll_damping_n_m_s_rad,
            ],
            pitch: [
                p.sprung_mass_kg * g * p.pitch_arm_m,
                p.pitch_stiffness_n_m_rad,
                p.pitch_damping_n_m_s_rad,
            ],
            masses: share.map(|share| share * p.mass_kg),
            drag: p.drag_n_s2_m2,
            inverse_mass: p.inverse_mass,
            inverse: [row(0), row(1), row(2)],
            pitching: [
                -p.sprung_mass_kg * p.pitch_arm_m * p.inverse_pitch_inertia,
                p.inverse_pitch_inertia,
            ],
            low_speed: p.low_speed_m_s,
            passes: p.load_passes,
        }
    }
}

/// What the inputs come to, the same for all stages of a step.
#[derive(Clone, Copy)]
pub(super) struct Held<V: PerWheelValues> {
    pub steer: [V::Number; 4],
    pub sin: V,
    pub cos: V,
    pub drive: V,
    pub brake: V,
    /// m g cos(bank) cos(grade), g sin(bank), g sin(grade).
    pub road: [V::Number; 3],
}

impl<V: PerWheelValues> Held<V> {
    #[inline(always)]
    pub(super) fn of(p: &Parameters, inputs: &Inputs<V::Number>) -> Self {
        let turned = each(|i| sin_cos(inputs.steer_rad[i]));
        let (sb, cb) = sin_cos(inputs.bank_rad);
        let (sg, cg) = sin_cos(inputs.grade_rad);
        let g = p.gravity_m_s2;
        Self {
            steer: inputs.steer_rad,
            sin: V::of(each(|i| turned[i].0)),
            cos: V::of(each(|i| turned[i].1)),
            drive: V::of(inputs.drive_n_m),
            brake: V::of(inputs.brake_n_m),
            road: [cb * cg * (p.mass_kg * g), sb * g, sg * g],
        }
    }

    /// Sine and cosine of the steer angles, roll steer included.
    #[inline(always)]
    fn turned<F: Form>(&self, constants: &Constants, roll_rad: V::Number) -> [V; 2] {
        if !constants
            .roll_steer
            .iter()
            .any(|gain| F::roll_steers(*gain))
        {
            return [self.sin, self.cos];
        }
        let turned = each(|i| sin_cos(self.steer[i] + roll_rad * constants.roll_steer[i]));
        [V::of(each(|i| turned[i].0)), V::of(each(|i| turned[i].1))]
    }
}

#[inline(always)]
pub(super) fn wheels<V: PerWheelValues, F: Form>(
    constants: &Constants,
    state: &State<V::Number>,
    held: &Held<V>,
) -> Wheels<V> {
    let c = constants;
    let yaw_rate = V::all(state.yaw_rate_rad_s);
    let along = V::all(state.longitudinal_m_s) - yaw_rate.times(c.left);
    let across = V::all(state.lateral_m_s) + yaw_rate.times(c.ahead);
    let [sin, cos] = held.turned::<F>(c, state.roll_rad);
    let rolling = along * cos + across * sin;
    let slip = [
        across * cos - along * sin,
        V::of(state.wheel_speed_rad_s).times(c.radius) - rolling,
    ];
    let inverse = V::constant(1.0) / slip_base(rolling, c.low_speed);
    let relaxing =
        |relaxed: [V::Number; 4], slip: V| F::relaxing(&c.length, V::of(relaxed), slip * inverse);
    Wheels {
        sin,
        cos,
        rolling,
        slip,
        tangent: relaxing(state.slip_tangent, slip[0]),
        ratio: relaxing(state.slip_ratio, slip[1]),
    }
}

/// Sums that loads come from.
#[derive(Clone, Copy)]
struct Sums<T> {
    /// Lateral force of each axle, N.
    lateral: [T; 2],
    /// Longitudinal force, N.
    longitudinal: T,
    /// Yaw moment, N m.
    turning: T,
    /// Felt lateral acceleration a_y + g sin(bank), m/s^2.
    felt: T,
}

/// Loads from roll, pitch and the axles' forces.
#[inline(always)]
fn loads<V: PerWheelValues>(
    constants: &Constants,
    state: &State<V::Number>,
    held: &Held<V>,
    sums: &Sums<V::Number>,
) -> V {
    let c = constants;
    let down = held.road[0];
    let pitch =
        state.pitch_rad * c.pitch_transfer[0] + state.pitch_rate_rad_s * c.pitch_transfer[1];
    // An axle that would pull hangs; the other carries the vehicle.
    let front = (down * c.front_share + pitch - sums.longitudinal * c.pitch_lift).at_least(0.0);
    let front = if front > down { down } else { front };
    let axle = |k: usize, sum: V::Number| {
        let [stiffness, damping, height, unsprung] = c.transfer[k];
        let transfer = state.roll_rad * stiffness
            + state.roll_rate_rad_s * damping
            + (sums.lateral[k] * height + sums.felt * unsprung);
        let half = sum * 0.5;
        // A wheel that would pull hangs; its neighbour carries the axle.
        let transfer = if transfer > half { half } else { transfer };
        let transfer = if transfer < -half { -half } else { transfer };
        [half - transfer, half + transfer]
    };
    let ([fl, fr], [rl, rr]) = (axle(0, front), axle(1, down - front));
    V::of([fl, fr, rl, rr])
}

/// One pass of the loop between loads and forces.
#[inline(always)]
fn pass<V: PerWheelValues>(
    constants: &Constants,
    load: V,
    rolling: V::Number,
    contacts: &impl Contacts<V>,
) -> (Forces<V>, Sums<V::Number>) {
    let forces = contacts.forces(load);
    let [ahead, lateral, turning] = forces.body.map(V::axles);
    let turning = turning[0] + turning[1];
    let [by_side, by_turning, by_roll] = constants.inverse[0];
    let sums = Sums {
        lateral,
        longitudinal: ahead[0] + ahead[1],
        turning,
        // Solved for a_y + g sin(bank), which is what springs and gauges feel.
        felt: (lateral[0] + lateral[1]) * by_side + (turning * by_turning + rolling * by_roll),
    };
    (forces, sums)
}

/// Closes the loop between loads and forces.
#[inline(always)]
pub(super) fn solve<V: PerWheelValues, F: Form>(
    constants: &Constants,
    state: &State<V::Number>,
    held: &Held<V>,
    contacts: &impl Contacts<V>,
) -> Solution<V> {
    let c = constants;
    let [_, bank, grade] = held.road;
    let (u, v, r) = (
        state.longitudinal_m_s,
        state.lateral_m_s,
        state.yaw_rate_rad_s,
    );
    let rolling = sin_cos(state.roll_rad).0 * c.roll[0]
        - (state.roll_rad * c.roll[1] + state.roll_rate_rad_s * c.roll[2]);
    let pitching = sin_cos(state.pitch_rad).0 * c.pitch[0]
        - (state.pitch_rad * c.pitch[1] + state.pitch_rate_rad_s * c.pitch[2]);
    // Exact in steady turning, where v' = r' = 0.
    let felt = u * r + bank;
    let start = Sums {
        lateral: [felt * c.masses[0], felt * c.masses[1]],
        longitudinal: V::Number::from(0.0),
        turning: V::Number::from(0.0),
        felt,
    };
    let (mut forces, mut sums) = pass(c, loads(c, state, held, &start), rolling, contacts);
    if F::TWICE {
        (forces, sums) = pass(c, loads(c, state, held, &sums), rolling, contacts);
    } else {
        for _ in 1..c.passes {
            (forces, sums) = pass(c, loads(c, state, held, &sums), rolling, contacts);
        }
    }
    let felt_x = (sums.longitudinal - u * u.magnitude() * c.drag) * c.inverse_mass;
    let side = sums.lateral[0] + sums.lateral[1];
    let row = |i: usize| {
        let [by_side, by_turning, by_roll] = c.inverse[i];
        side * by_side + (sums.turning * by_turning + rolling * by_roll)
    };
    Solution {
        load: loads(c, state, held, &sums),
        forces,
        accelerations: [
            felt_x + grade + v * r,
            sums.felt - bank - u * r,
            row(1),
            row(2),
            felt_x * c.pitching[0] + pitching * c.pitching[1],
        ],
    }
}

/// Rate of the state from what was solved.
#[inline(always)]
pub(super) fn rate<V: PerWheelValues, F: Form>(
    constants: &Constants,
    state: &State<V::Number>,
    held: &Held<V>,
    wheels: &Wheels<V>,
    solution: &Solution<V>,
) -> State<V::Number> {
    let c = constants;
    let [u, v, r, roll, pitch] = solution.accelerations;
    let speed = wheels.rolling.absolute();
    let relaxing = |relaxed: [V::Number; 4], slip: V| {
        let rate = (slip - speed * V::of(relaxed)).times(c.inverse_length);
        F::relaxing(&c.length, rate, V::constant(0.0)).list()
    };
    let resisting = held.brake + solution.load.times(c.resistance);
    let torque = held.drive
        - resisting * saturated(V::of(state.wheel_speed_rad_s))
        - solution.forces.wheel[0].times(c.radius);
    State {
        longitudinal_m_s: u,
        lateral_m_s: v,
        yaw_rate_rad_s: r,
        roll_rad: state.roll_rate_rad_s,
        roll_rate_rad_s: roll,
        pitch_rad: state.pitch_rate_rad_s,
        pitch_rate_rad_s: pitch,
        slip_tangent: relaxing(state.slip_tangent, wheels.slip[0]),
        slip_ratio: relaxing(state.slip_ratio, wheels.slip[1]),
        wheel_speed_rad_s: torque.times(c.inverse_spin).list(),
    }
}
