//! Linear forms of the states of one corner: forces of its members and the acceleration of its strut.

use nalgebra::Vector3;
use sample::Wheel;

use super::layout::{BEFORE, BETWEEN, FORCE, LENGTH, MOMENT, SPEED, STRUT, TORQUE};
use super::{Fusion, StepInput};
use crate::statics::AXIAL;

/// States of one corner.
pub(super) const CORNER: usize = 10;
/// Positions among them, after the three forces.
pub(super) const AT_MOMENT: usize = 3;
pub(super) const AT_SPEED: usize = 5;
pub(super) const AT_LENGTH: usize = 6;
pub(super) const AT_STRUT: usize = 7;
pub(super) const AT_TORQUE: usize = 8;

/// States of a corner's measurement rows: those of the corner, the forces one step before, and the
/// load between the steps.
pub(super) const MEASURED: usize = CORNER + 4;

/// Gains of the states of a corner, and a constant.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Form {
    pub(super) gains: [f64; CORNER],
    pub(super) constant: f64,
}

/// Gains of the states of a measurement row, and a constant.
#[derive(Clone, Copy, Debug)]
pub(super) struct MeasuredForm {
    pub(super) gains: [f64; MEASURED],
    pub(super) constant: f64,
}

/// Indices of the states of a corner.
pub(super) const fn corner_states(wheel: usize) -> [usize; CORNER] {
    [
        FORCE + 3 * wheel,
        FORCE + 3 * wheel + 1,
        FORCE + 3 * wheel + 2,
        MOMENT + 2 * wheel,
        MOMENT + 2 * wheel + 1,
        SPEED + wheel,
        LENGTH + wheel,
        STRUT + wheel,
        TORQUE + wheel / 2,
        TORQUE + 2 + wheel / 2,
    ]
}

/// Indices of the states of a corner's measurement rows.
pub(super) fn measured_states(wheel: usize) -> [usize; MEASURED] {
    let corner = corner_states(wheel);
    std::array::from_fn(|k| match k.checked_sub(CORNER) {
        None => corner[k],
        Some(axis @ 0..3) => BEFORE + 3 * wheel + axis,
        Some(_) => BETWEEN + wheel,
    })
}

impl Form {
    pub(super) fn plus(mut self, factor: f64, other: &Self) -> Self {
        for (gain, of_other) in self.gains.iter_mut().zip(other.gains) {
            *gain += factor * of_other;
        }
        self.constant += factor * other.constant;
        self
    }

    pub(super) fn times(mut self, factor: f64) -> Self {
        self.gains = self.gains.map(|gain| gain * factor);
        self.constant *= factor;
        self
    }

    pub(super) fn value(&self, wheel: usize, state: &[f64]) -> f64 {
        let terms = corner_states(wheel).into_iter().zip(self.gains);
        terms.map(|(i, gain)| gain * state[i]).sum::<f64>() + self.constant
    }
}

/// When a reading shows the signal: a mean over the time before an instant.
#[derive(Clone, Copy, Debug)]
pub(super) struct Back {
    /// Mean time before the instant, s.
    pub(super) mean_s: f64,
    /// Mean square of that time, s^2.
    pub(super) square_s2: f64,
}

impl Back {
    /// The same, seen from `age_s` later.
    pub(super) fn earlier(self, age_s: f64) -> Self {
        Self {
            mean_s: self.mean_s + age_s,
            square_s2: self.square_s2 + age_s * (2.0 * self.mean_s + age_s),
        }
    }

    /// A single instant.
    pub(super) fn at(mean_s: f64) -> Self {
        Self {
            mean_s,
            square_s2: mean_s * mean_s,
        }
    }
}

/// What the members of one corner carry.
pub(super) struct CornerForms {
    /// Force of each member without the strut's acceleration, now and a step before, N.
    members: [[Form; 2]; 6],
    /// Member forces for 1 m/s^2 of it.
    per_acceleration: [f64; 6],
    /// The strut's force, N.
    pub(super) strut: Form,
    /// The strut's acceleration, m/s^2.
    pub(super) acceleration: Form,
    /// What the other corner of a live axle adds to it.
    pub(super) coupled: Option<Coupled>,
    /// Force that 1 m more of strut presses a tyre on the ground with less, N/m.
    pub(super) stiffness_n_m: f64,
    /// 1 for a tyre on the ground, 0 for a wheel in the air, by the load before the step.
    pub(super) touching: f64,
    step_s: f64,
    steps_back_max: f64,
}

/// How the other corner of a live axle moves a corner.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coupled {
    /// The other wheel.
    pub(super) wheel: usize,
    /// Gains of its states on the acceleration of this corner's spring.
    pub(super) gains: [f64; CORNER],
    /// Force that 1 m more of its spring presses this corner's tyre on the ground with less, N/m.
    pub(super) stiffness_n_m: f64,
}

impl Coupled {
    /// States and gains.
    pub(super) fn terms(&self) -> impl Iterator<Item = (usize, f64)> {
        corner_states(self.wheel).into_iter().zip(self.gains)
    }
}

/// Gains of the states of a corner on a force, by its gains `m` of the wrench of the tyre about the contact point. The
/// wheel turns freely on its spindle, so the balance is taken about the wheel's centre: the longitudinal force has no
/// moment there but the spindle's. `left` is 1 for a left wheel, -1 for a right one.
pub(super) fn wrench_gains(m: [f64; 6], arm: &Vector3<f64>, left: f64) -> [f64; CORNER] {
    let mut gains = [0.0; CORNER];
    gains[0] = m[0] - m[4] * arm.z;
    gains[1] = m[1];
    gains[2] = m[2] + m[4] * arm.x;
    gains[AT_MOMENT] = m[3];
    gains[AT_MOMENT + 1] = m[5];
    gains[AT_TORQUE] = m[4];
    gains[AT_TORQUE + 1] = left * m[4];
    gains
}

impl CornerForms {
    /// Acceleration of the strut of wheel `wheel` in a state, m/s^2.
    pub(super) fn acceleration_m_s2(&self, wheel: usize, state: &[f64]) -> f64 {
        let own = self.acceleration.value(wheel, state);
        self.coupled.map_or(own, |coupled| {
            let terms = coupled.terms().map(|(i, gain)| gain * state[i]);
            own + terms.sum::<f64>()
        })
    }

    /// A form as it was before the instant. The forces lie between those of now and of one step before;
    /// the load bends from the line between them as the wheel's travel presses the tyre. The strut's
    /// acceleration lies between both steps' likewise.
    pub(super) fn ago(&self, form: &Form, back: Back) -> MeasuredForm {
        let Back { mean_s, square_s2 } = back;
        let part = (mean_s / self.step_s).clamp(-1.0, 1.5);
        let [of_speed, of_length] = [AT_SPEED, AT_LENGTH].map(|at| form.gains[at]);
        let bent = 0.5 * square_s2 / self.step_s;
        // Of the acceleration now and one step before.
        let now = 1e3 * (of_speed * (bent - mean_s) + 0.5 * of_length * square_s2)
            + 0.5
                * form.gains[2]
                * (mean_s * self.step_s - square_s2)
                * self.touching
                * self.stiffness_n_m;
        let before = -1e3 * of_speed * bent;
        let mut sum = form.plus(now, &self.acceleration);
        sum.gains[AT_SPEED] -= of_length * mean_s;
        // One step before: the struts' states of then, by the motion since.
        let acceleration = &self.acceleration;
        sum = sum.plus(before, acceleration).plus(
            -1e3 * before * acceleration.gains[AT_SPEED] * self.step_s,
            acceleration,
        );
        sum.gains[AT_SPEED] -= before * acceleration.gains[AT_LENGTH] * self.step_s;
        let mut gains = [0.0; MEASURED];
        gains[..CORNER].copy_from_slice(&sum.gains);
        for axis in 0..3 {
            let moved = part * form.gains[axis] + before * acceleration.gains[axis];
            gains[axis] -= moved;
            gains[CORNER + axis] = moved;
        }
        gains[CORNER + 3] = form.gains[2];
        MeasuredForm {
            gains,
            constant: sum.constant,
        }
    }

    /// Force of member `i` with the linkage of `back_s` ago, N.
    pub(super) fn member(&self, i: usize, back_s: f64) -> Form {
        let back = (back_s / self.step_s).clamp(0.0, self.steps_back_max);
        let [now, before] = &self.members[i];
        now.times(1.0 - back)
            .plus(back, before)
            .plus(self.per_acceleration[i], &self.acceleration)
    }
}

impl Fusion {
    /// Load that presses a tyre, N. The estimated load of a wheel in the air can alternate about zero from step to
    /// step. Taken for a tyre that lands in every second step, it would grow.
    pub(super) fn pressing_n(&self, wheel: usize) -> f64 {
        let [now, before] = [FORCE, BEFORE].map(|at| self.state[at + 3 * wheel + 2]);
        (now + before.min(0.0)).max(0.0)
    }

    /// Forms of a corner.
    pub(super) fn forms(
        &self,
        input: &StepInput<'_>,
        wheel: usize,
        known_n_m: &Vector3<f64>,
    ) -> CornerForms {
        let corner = &input.corners[wheel];
        let axes = super::carrier(corner);
        let arm = axes.transpose() * (corner.frame.contact_m - corner.pose.wheel_centre_m);
        let left = if Wheel::ALL[wheel].is_left() {
            1.0
        } else {
            -1.0
        };
        let statics = [&corner.statics, &input.statics_before[wheel]];
        let matrix = self.matrix(input, wheel);
        // The last row is that of the strut.
        let of_matrix = |i: usize| matrix.as_ref().filter(|_| i < AXIAL.len());
        let members = std::array::from_fn(|i| {
            statics.map(|statics| {
                if let Some(matrix) = of_matrix(i) {
                    return matrix.form(i, statics, known_n_m, left);
                }
                let m: [f64; 6] = std::array::from_fn(|k| statics.members_from_wrench[(i, k)]);
                Form {
                    gains: wrench_gains(m, &arm, left),
                    constant: statics.members_offset[i] + m[3] * known_n_m.x + m[5] * known_n_m.z,
                }
            })
        });
        let travel = &corner.travel;
        let line = &travel.strut;
        let mut strut = Form::default();
        strut.gains[AT_LENGTH] = -1e-3 * line.stiffness_n_m;
        strut.gains[AT_SPEED] = -1e-3 * line.damping_n_s_m;
        strut.gains[AT_STRUT] = 1.0;
        strut.constant = line.constant_n();
        let needed: Form = members[5][0];
        let acceleration = strut.plus(-1.0, &needed).times(1.0 / travel.members[5]);
        let light_n = self.tuning.light_part * self.body.static_load[wheel];
        let touching = (self.pressing_n(wheel) / light_n - 1.0).clamp(0.0, 1.0);
        CornerForms {
            members,
            per_acceleration: std::array::from_fn(|i| {
                of_matrix(i).map_or(travel.members[i], |matrix| {
                    matrix.per_acceleration(i, &corner.statics, &travel.members)
                })
            }),
            strut,
            acceleration,
            coupled: None,
            touching,
            stiffness_n_m: self.body.tyres[wheel].vertical_stiffness_n_m
                * corner.frame.normal().dot(&travel.path),
            step_s: input.dt,
            steps_back_max: self.tuning.members.steps_back_max,
        }
    }
}
