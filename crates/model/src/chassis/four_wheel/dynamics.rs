//! Equations of motion of the four-wheel model.

use super::constants::Constants;
use super::contacts::{Contacts, Forces};
use super::motion::Motion;
use super::{Inputs, Parameters};
use crate::chassis::form::Form;
use crate::scalar::sin_cos;
use crate::tyre::{saturated, slip_base};
use crate::values::{PerWheelValues, Values};

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
    /// Loads that balance the forces.
    pub load: V,
    /// Loads that the forces were found at.
    carried: V,
    pub forces: Forces<V>,
    /// u', v', r', phi'', theta''.
    accelerations: [V::Number; 5],
}

/// What the inputs come to, the same for all stages of a step.
#[derive(Clone, Copy)]
pub(super) struct Held<V: PerWheelValues> {
    pub steer: V,
    pub sin: V,
    pub cos: V,
    pub drive: V,
    pub brake: V,
    /// m g cos(bank) cos(grade)/2, g sin(bank), g sin(grade).
    pub road: [V::Number; 3],
}

impl<V: PerWheelValues> Held<V> {
    #[inline(always)]
    pub(super) fn of(p: &Parameters, inputs: &Inputs<V::Number>) -> Self {
        let steer = V::of(inputs.steer_rad);
        let (sin, cos) = steer.sine_cosine();
        let ((sb, cb), (sg, cg)) = (sin_cos(inputs.bank_rad), sin_cos(inputs.grade_rad));
        let g = p.gravity_m_s2;
        Self {
            steer,
            sin,
            cos,
            drive: V::of(inputs.drive_n_m),
            brake: V::of(inputs.brake_n_m),
            road: [
                (cb * cg).scaled(0.5 * p.mass_kg * g),
                sb.scaled(g),
                sg.scaled(g),
            ],
        }
    }

    /// Sine and cosine of the steer angles, roll steer included.
    #[inline(always)]
    fn turned<F: Form>(&self, constants: &Constants, roll: V::Number) -> (V, V) {
        let gains = constants.roll_steer;
        if gains.iter().any(|gain| F::roll_steers(*gain)) {
            (self.steer + V::all(roll).times(gains)).sine_cosine()
        } else {
            (self.sin, self.cos)
        }
    }
}

#[inline(always)]
pub(super) fn wheels<V: PerWheelValues, F: Form>(
    constants: &Constants,
    at: &Motion<V>,
    held: &Held<V>,
) -> Wheels<V> {
    let c = constants;
    let yaw_rate = V::all(at.yaw_rate);
    let along = V::all(at.longitudinal) - yaw_rate.times(c.left);
    let across = V::all(at.lateral) + yaw_rate.times(c.ahead);
    let (sin, cos) = held.turned::<F>(c, at.roll);
    let rolling = along * cos + across * sin;
    let slip = [
        across * cos - along * sin,
        at.spin.times(c.radius) - rolling,
    ];
    let inverse = V::constant(1.0) / slip_base(rolling, c.low_speed);
    let relaxing = |relaxed: V, slip: V| F::relaxing(&c.length, relaxed, slip * inverse);
    Wheels {
        sin,
        cos,
        rolling,
        slip,
        tangent: relaxing(at.tangent, slip[0]),
        ratio: relaxing(at.ratio, slip[1]),
    }
}

/// What bears on the loads whatever the tyres do: of each axle half of what it carries, and what
/// its right wheel has more.
struct Stance<V: PerWheelValues> {
    middle: V::Axles,
    transfer: V::Axles,
}

/// What the tyres' forces sum up to.
#[derive(Clone, Copy)]
struct Sums<V: PerWheelValues> {
    /// Lateral force of each axle, N.
    lateral: V::Axles,
    /// Longitudinal force, N.
    longitudinal: V::Number,
    /// Their part of the felt lateral acceleration a_y + g sin(bank), m/s^2: what springs and
    /// gauges feel.
    felt: V::Number,
    /// Their part of r', rad/s^2.
    yaw: V::Number,
}

/// Loads of the wheels from half of what each axle carries, and what its right wheel has more.
///
/// An axle that would pull hangs, the other carries the vehicle; a wheel that would pull hangs, its
/// neighbour carries the axle. What hangs has a load below zero.
#[inline(always)]
fn loads<V: PerWheelValues>(held: &Held<V>, middle: V::Axles, transfer: V::Axles) -> V {
    let middle = middle.lesser(V::both(held.road[0]));
    V::shifted(middle, transfer).lesser(V::of_axles(middle + middle))
}

/// Loads under the tyres' forces.
#[inline(always)]
fn loaded<V: PerWheelValues>(
    constants: &Constants,
    held: &Held<V>,
    stance: &Stance<V>,
    sums: &Sums<V>,
) -> V {
    let [height, unsprung] = constants.transfer;
    let [.., lift] = constants.pitch_transfer;
    let middle = stance.middle + V::both(sums.longitudinal).times(lift);
    let transfer =
        (sums.lateral.times(height) + stance.transfer) + V::both(sums.felt).times(unsprung);
    loads(held, middle, transfer)
}

/// The tyres' forces and what they sum up to.
#[inline(always)]
fn pulled<V: PerWheelValues>(load: V, contacts: &impl Contacts<V>) -> (Forces<V>, Sums<V>) {
    let forces = contacts.forces(load);
    let effects = &forces.effects;
    let sums = Sums {
        lateral: effects.left.axles(),
        longitudinal: V::whole(effects.ahead.axles()),
        felt: V::whole(effects.felt.axles()),
        yaw: V::whole(effects.yaw.axles()),
    };
    (forces, sums)
}

/// Closes the loop between loads and forces.
#[inline(always)]
pub(super) fn solve<V: PerWheelValues, F: Form>(
    constants: &Constants,
    at: &Motion<V>,
    held: &Held<V>,
    contacts: &impl Contacts<V>,
) -> Solution<V> {
    let c = constants;
    let [half_weight, bank, grade] = held.road;
    let (u, v, r) = (at.longitudinal, at.lateral, at.yaw_rate);
    // Two calls and no `map` over an array: its loop would keep the loop over the runs of a batch
    // from becoming vector code, which costs a batch three times its time.
    let (sin_roll, _) = sin_cos(at.roll);
    let (sin_pitch, _) = sin_cos(at.pitch);
    let rolling =
        sin_roll.scaled(c.roll[0]) - (at.roll.scaled(c.roll[1]) + at.roll_rate.scaled(c.roll[2]));
    let pitching = sin_pitch.scaled(c.pitch[0])
        - (at.pitch.scaled(c.pitch[1]) + at.pitch_rate.scaled(c.pitch[2]));
    let middle = V::both(half_weight).times(c.share)
        + (V::both(at.pitch).times(c.pitch_transfer[0])
            + V::both(at.pitch_rate).times(c.pitch_transfer[1]));
    let swaying = V::both(at.roll).times(c.swaying[0]) + V::both(at.roll_rate).times(c.swaying[1]);
    let stance = Stance {
        middle,
        transfer: swaying + V::both(rolling).times(c.transfer_by_rolling),
    };
    // Exact in steady turning, where v' = r' = 0.
    let felt = u * r + bank;
    let steady = swaying + V::both(felt).times(c.steady_transfer);
    let mut carried = loads(held, middle, steady);
    let (mut forces, mut sums) = pulled(carried, contacts);
    let passes = if F::TWICE { 2 } else { c.passes };
    for _ in 1..passes {
        carried = loaded(c, held, &stance, &sums);
        (forces, sums) = pulled(carried, contacts);
    }
    let drag = (u * u.absolute()).scaled(c.drag);
    let [felt_by_rolling, yaw_by_rolling, roll_by_rolling] = c.rolling;
    Solution {
        load: loaded(c, held, &stance, &sums).not_below(0.0),
        carried,
        forces,
        accelerations: [
            sums.longitudinal.scaled(c.inverse_mass) + (grade + v * r - drag),
            sums.felt + (rolling.scaled(felt_by_rolling) - felt),
            sums.yaw + rolling.scaled(yaw_by_rolling),
            sums.felt.scaled(c.roll_by[0])
                + rolling.scaled(roll_by_rolling)
                + sums.yaw.scaled(c.roll_by[1]),
            sums.longitudinal.scaled(c.pitching[0])
                + (pitching.scaled(c.pitching[1]) - drag.scaled(c.pitching[2])),
        ],
    }
}

/// Rate of the state from what was solved. Rolling resistance takes the loads that the forces were
/// found at.
#[inline(always)]
pub(super) fn rate<V: PerWheelValues, F: Form>(
    constants: &Constants,
    at: &Motion<V>,
    held: &Held<V>,
    wheels: &Wheels<V>,
    solution: &Solution<V>,
) -> Motion<V> {
    let c = constants;
    let [longitudinal, lateral, yaw_rate, roll_rate, pitch_rate] = solution.accelerations;
    let speed = wheels.rolling.absolute();
    let relaxing = |relaxed: V, slip: V| {
        let rate = (slip - speed * relaxed).times(c.inverse_length);
        F::relaxing(&c.length, rate, V::constant(0.0))
    };
    let resisting = held.brake + solution.carried.not_below(0.0).times(c.resistance);
    let torque =
        held.drive - resisting * saturated(at.spin) - solution.forces.wheel[0].times(c.radius);
    Motion {
        longitudinal,
        lateral,
        yaw_rate,
        roll: at.roll_rate,
        roll_rate,
        pitch: at.pitch_rate,
        pitch_rate,
        tangent: relaxing(at.tangent, wheels.slip[0]),
        ratio: relaxing(at.ratio, wheels.slip[1]),
        spin: torque.times(c.inverse_spin),
    }
}
