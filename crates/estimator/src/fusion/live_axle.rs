//! A live axle in the force filter: linear forms of the states of both its corners, and its measurement rows.
//!
//! The accelerations a of both springs' lengths follow from the springs: P a = S - s, with the forces S of the springs
//! by their lengths, the forces s that tyres, dampers, weight and inertia call for, and P the inertia that each
//! acceleration adds to s. The error of the strut's model acts along the damper, whose law is the less certain part.
//!
//! The state of self-stress of the links tells nothing of the tyres. It is a state of its own that every step forgets,
//! in the place of the offset of the right wheel's fifth channel, which a live axle does not have.

use model::suspension::live_axle::LINKS;
use nalgebra::{Matrix2, SVector, Vector2, Vector3};
use sample::{PerWheel, StrainChannel};

use super::corner::{CornerMeasurements, Places, RowMeasurement, STRAINED};
use super::forms::{
    AT_LENGTH, AT_SPEED, AT_STRUT, AT_TORQUE, Back, CORNER, CornerForms, Coupled, MEASURED,
    measured_states, wrench_gains,
};
use super::joint::{Rows, TOGETHER};
use super::lag::Unlagged;
use super::latency::Ageing;
use super::layout::{LENGTH_ERROR, OFFSET, State, TORQUE};
use super::moments::KnownMoment;
use super::propagation::Moving;
use super::{ChannelChange, Fusion, StepInput, carrier};
use crate::calibration::CornerChannels;
use crate::corners::{BENDING, LiveAxleState, PANHARD, link_of};
use crate::inputs::Readings;
use crate::statics::AXIAL;

/// Wheels of the axle.
const WHEELS: [usize; 2] = [2, 3];
/// States of the offsets of the bending channels: those of axial channels that the axle does not have.
const OFFSET_OF_BENDING: [usize; 2] = [1, 3];
/// State of the self-stress.
const SELF_STRESS: usize = OFFSET + 5 * WHEELS[1] + PANHARD;
/// States of the measurement rows: those of both corners and the self-stress.
const SHARED: usize = 2 * MEASURED + 1;
type AxleRows = Rows<SHARED>;

/// Gains of the states of both corners, and a constant. The torques, which both share, are those of the left one.
#[derive(Clone, Copy, Debug, Default)]
struct AxleForm {
    gains: [[f64; CORNER]; 2],
    constant: f64,
}

impl AxleForm {
    fn add(&mut self, factor: f64, other: &Self) {
        for (to, from) in self.gains.iter_mut().zip(&other.gains) {
            for (gain, of_other) in to.iter_mut().zip(from) {
                *gain += factor * of_other;
            }
        }
        self.constant += factor * other.constant;
    }

    fn plus(mut self, factor: f64, other: &Self) -> Self {
        self.add(factor, other);
        self
    }

    fn times(self, factor: f64) -> Self {
        Self::default().plus(factor, &self)
    }
}

/// Links and bending moments of both tubes, without the accelerations.
type Members = ([AxleForm; LINKS], [[AxleForm; 2]; 2]);

/// What links and tubes of a live axle carry.
pub(super) struct AxleForms {
    pub(super) wheels: [usize; 2],
    /// Now and a step before.
    members: [Members; 2],
    links_per_acceleration: [[f64; 2]; LINKS],
    bending_per_acceleration: [[[f64; 2]; 2]; 2],
    self_stress: [f64; LINKS],
    acceleration: [AxleForm; 2],
    /// Load that 1 m more of each spring takes off each tyre on the ground, N/m.
    stiffness_n_m: [[f64; 2]; 2],
    touching: [f64; 2],
    step_s: f64,
    steps_back_max: f64,
    has_links: bool,
    has_section: bool,
}

impl AxleForms {
    /// Whether the readings measure the forces: of the links, or of both tubes where there are none.
    fn is_strained(&self, measured: &[CornerMeasurements; 2]) -> bool {
        if self.has_links {
            measured.iter().map(|m| m.alive).sum::<usize>() >= STRAINED
        } else {
            measured.iter().all(|m| m.is_split)
        }
    }
}

/// How the forms of a live axle depend on the tyres.
struct Tyres {
    /// Arms from the wheel centres to the contact points, wheel-carrier frame, m.
    arms: [Vector3<f64>; 2],
    known_n_m: [Vector3<f64>; 2],
    /// Torque of the propeller shaft: gain of the mean moment of the spindles, and a constant, N m.
    shaft: [f64; 2],
}

impl Tyres {
    fn new(
        fusion: &Fusion,
        input: &StepInput<'_>,
        axle: &LiveAxleState,
        known: &[KnownMoment; 4],
    ) -> Self {
        let arms = WHEELS.map(|wheel| {
            let corner = &input.corners[wheel];
            carrier(corner).transpose() * (corner.frame.contact_m - corner.pose.wheel_centre_m)
        });
        let spun_up: f64 = WHEELS
            .iter()
            .map(|wheel| fusion.body.spin_inertia[*wheel] * input.corners[*wheel].spin_dot_rad_s2)
            .sum();
        let torque = spun_up - 2.0 * fusion.state[TORQUE + 1];
        // A torque against the direction of travel is taken for that of the brakes, which the axle reacts.
        let is_driving = torque * input.motion.velocity_m_s.x >= 0.0;
        let ratio = axle.final_drive_ratio.filter(|_| is_driving);
        let per_torque = ratio.map_or(0.0, f64::recip);
        Self {
            arms,
            known_n_m: WHEELS.map(|wheel| known[wheel].moment_n_m),
            shaft: [-2.0 * per_torque, spun_up * per_torque],
        }
    }

    /// Form of a member with these gains of the wrenches of both tyres and of the shaft.
    fn form(&self, of_tyre: [[f64; 6]; 2], of_shaft: f64, offset: f64) -> AxleForm {
        let mut form = AxleForm {
            constant: offset + of_shaft * self.shaft[1],
            ..AxleForm::default()
        };
        for side in 0..2 {
            let left = if side == 0 { 1.0 } else { -1.0 };
            let gains = wrench_gains(of_tyre[side], &self.arms[side], left);
            form.gains[side] = gains;
            form.constant += of_tyre[side][3] * self.known_n_m[side].x
                + of_tyre[side][5] * self.known_n_m[side].z;
        }
        for torque in [AT_TORQUE, AT_TORQUE + 1] {
            form.gains[0][torque] += std::mem::take(&mut form.gains[1][torque]);
        }
        form.gains[0][AT_TORQUE] += of_shaft * self.shaft[0];
        form
    }
}

/// Force of a damper with the error of the strut's model.
fn damper(axle: &LiveAxleState, side: usize) -> AxleForm {
    let d = &axle.dampers[side];
    let mut form = AxleForm {
        constant: d.force_n,
        ..AxleForm::default()
    };
    for (other, by_length) in d.by_length.into_iter().enumerate() {
        let spring = &axle.springs[other];
        form.gains[other][AT_SPEED] = -1e-3 * d.damping_n_s_m * by_length;
        form.gains[other][AT_LENGTH] = -1e-3 * d.stiffness_n_m * by_length;
        form.constant +=
            by_length * (d.damping_n_s_m * spring.rate_m_s + d.stiffness_n_m * spring.length_m);
    }
    form.gains[side][AT_STRUT] = 1.0;
    form
}

/// Forces of links (5) and springs (2) without the accelerations.
fn forces(tyres: &Tyres, axle: &LiveAxleState) -> [AxleForm; 7] {
    let dampers = [0, 1].map(|side| damper(axle, side));
    std::array::from_fn(|i| {
        let of_tyre = axle
            .members_from_tyre
            .map(|map| map.row(i).transpose().into());
        let form = tyres.form(
            of_tyre,
            axle.members_from_shaft[i],
            axle.members_offset[0][i],
        );
        form.plus(axle.members_from_damper[0][i], &dampers[0])
            .plus(axle.members_from_damper[1][i], &dampers[1])
    })
}

fn members(tyres: &Tyres, axle: &LiveAxleState) -> Members {
    let forces = forces(tyres, axle);
    let bending = std::array::from_fn(|side: usize| {
        std::array::from_fn(|k| {
            let mut of_tyre = [[0.0; 6]; 2];
            of_tyre[side] = axle.bending_from_tyre[side].row(k).transpose().into();
            tyres.form(of_tyre, 0.0, axle.bending_offset[side][0][k])
        })
    });
    (std::array::from_fn(|i| forces[i]), bending)
}

/// Accelerations of both springs' lengths.
fn accelerations(needed: &[AxleForm; 2], axle: &LiveAxleState) -> [AxleForm; 2] {
    let [_, left, right] = &axle.members_offset;
    let of_springs = |offset: &SVector<f64, 7>| Vector2::new(offset[5], offset[6]);
    let inertia = Matrix2::from_columns(&[of_springs(left), of_springs(right)]);
    // The inertia of a body with mass is positive definite.
    let inverse = inertia.try_inverse().unwrap_or_else(Matrix2::zeros);
    let excess = [0, 1].map(|side| {
        let line = &axle.springs[side];
        let mut spring = AxleForm {
            constant: line.constant_n(),
            ..AxleForm::default()
        };
        spring.gains[side][AT_LENGTH] = -1e-3 * line.stiffness_n_m;
        spring.gains[side][AT_SPEED] = -1e-3 * line.damping_n_s_m;
        spring.plus(-1.0, &needed[side])
    });
    [0, 1].map(|side| {
        AxleForm::default()
            .plus(inverse[(side, 0)], &excess[0])
            .plus(inverse[(side, 1)], &excess[1])
    })
}

impl AxleForms {
    /// What moves a corner of the axle.
    pub(super) fn moving(&self, side: usize, forms: &[CornerForms; 4]) -> Moving<2> {
        let touching = forms[self.wheels[side]].touching;
        Moving {
            acceleration: self.acceleration[side].gains,
            constant: self.acceleration[side].constant,
            touching,
            pressing_n_mm: self.stiffness_n_m[side].map(|k| 1e-3 * touching * k),
        }
    }

    /// Puts the accelerations of the axle into the forms of its corners.
    pub(super) fn couple(&self, forms: &mut [CornerForms; 4]) {
        for side in 0..2 {
            let (other, acceleration) = (1 - side, &self.acceleration[side]);
            let corner = &mut forms[self.wheels[side]];
            let mut own = acceleration.gains[side];
            own[AT_TORQUE..].copy_from_slice(&acceleration.gains[0][AT_TORQUE..]);
            let mut of_other = acceleration.gains[other];
            of_other[AT_TORQUE..].fill(0.0);
            corner.acceleration.gains = own;
            corner.acceleration.constant = acceleration.constant;
            corner.coupled = Some(Coupled {
                wheel: self.wheels[other],
                gains: of_other,
                stiffness_n_m: self.stiffness_n_m[side][other],
            });
        }
    }

    /// The forms of a member now, or of the linkage of `back_s` ago.
    fn ago_linkage(&self, of: impl Fn(&Members) -> AxleForm, back_s: f64) -> AxleForm {
        let back = (back_s / self.step_s).clamp(0.0, self.steps_back_max);
        let [now, before] = &self.members;
        of(now).times(1.0 - back).plus(back, &of(before))
    }

    fn link(&self, i: usize, back_s: f64) -> AxleForm {
        let [left, right] = self.links_per_acceleration[i];
        self.ago_linkage(|(links, _)| links[i], back_s)
            .plus(left, &self.acceleration[0])
            .plus(right, &self.acceleration[1])
    }

    fn bending(&self, side: usize, k: usize, back_s: f64) -> AxleForm {
        let [left, right] = self.bending_per_acceleration[side][k];
        self.ago_linkage(|(_, bending)| bending[side][k], back_s)
            .plus(left, &self.acceleration[0])
            .plus(right, &self.acceleration[1])
    }

    /// A form as it was before the instant: [`CornerForms::ago`] with both corners.
    fn ago(&self, form: &AxleForm, back: Back) -> ([f64; SHARED], f64) {
        let Back { mean_s, square_s2 } = back;
        let part = (mean_s / self.step_s).clamp(-1.0, 1.5);
        let bent = 0.5 * square_s2 / self.step_s;
        let mut sum = *form;
        let mut before = [0.0; 2];
        for side in 0..2 {
            let [of_speed, of_length] = [AT_SPEED, AT_LENGTH].map(|at| form.gains[side][at]);
            let now = 1e3 * (of_speed * (bent - mean_s) + 0.5 * of_length * square_s2);
            sum.add(now, &self.acceleration[side]);
            sum.gains[side][AT_SPEED] -= of_length * mean_s;
            let pressed = 0.5
                * form.gains[side][2]
                * (mean_s * self.step_s - square_s2)
                * self.touching[side];
            for other in 0..2 {
                let per_length = pressed * self.stiffness_n_m[side][other];
                sum.add(per_length, &self.acceleration[other]);
            }
            before[side] = -1e3 * of_speed * bent;
        }
        let mut gains = [0.0; SHARED];
        let mut moved = [[0.0; 3]; 2];
        for side in 0..2 {
            // One step before: the springs' states of then, by the motion since.
            let acceleration = &self.acceleration[side];
            sum.add(before[side], acceleration);
            for other in 0..2 {
                let of_speed = acceleration.gains[other][AT_SPEED];
                sum.add(
                    -1e3 * before[side] * of_speed * self.step_s,
                    &self.acceleration[other],
                );
                sum.gains[other][AT_SPEED] -=
                    before[side] * acceleration.gains[other][AT_LENGTH] * self.step_s;
                for (axis, moved) in moved[other].iter_mut().enumerate() {
                    *moved += before[side] * acceleration.gains[other][axis];
                }
            }
        }
        for side in 0..2 {
            let block = &mut gains[side * MEASURED..(side + 1) * MEASURED];
            block[..CORNER].copy_from_slice(&sum.gains[side]);
            for axis in 0..3 {
                let moved = part * form.gains[side][axis] + moved[side][axis];
                block[axis] -= moved;
                block[CORNER + axis] = moved;
            }
            block[CORNER + 3] = form.gains[side][2];
        }
        (gains, sum.constant)
    }
}

/// Standard deviations of the offset states of the strain channels of a wheel, in the channels' units.
pub(super) fn offset_sigmas(channels: &PerWheel<CornerChannels>, wheel: usize) -> [f64; 5] {
    let strain = &channels.0[wheel].strain;
    let mut sigmas = std::array::from_fn(|i| strain[i].offset_sigma);
    for (state, channel) in OFFSET_OF_BENDING.into_iter().zip(BENDING) {
        sigmas[state] = strain[channel].offset_sigma;
    }
    sigmas
}

/// Value of a row's form in a state, without the row's own state and the self-stress.
fn value((gains, constant): &([f64; SHARED], f64), state: &State) -> f64 {
    let states = WHEELS.map(measured_states);
    let terms = states.as_flattened().iter().zip(gains);
    terms.map(|(i, gain)| gain * state[*i]).sum::<f64>() + constant
}

/// Rows: both potentiometers, then the channels of the left wheel and those of the right one.
fn places(side: usize) -> Places {
    let strain = match side {
        0 => [2, 0, 3, 0, 4, 5, 6],
        _ => [7, 0, 8, 0, 0, 9, 10],
    };
    Places {
        length: side,
        strain,
        hub: 0,
    }
}

impl Fusion {
    /// Forms of a live axle.
    pub(super) fn axle_forms(
        &self,
        input: &StepInput<'_>,
        known: &[KnownMoment; 4],
        corners: &[CornerForms; 4],
    ) -> Option<AxleForms> {
        let [axle, before] = input.axle?;
        let tyres = Tyres::new(self, input, axle, known);
        let all = forces(&tyres, axle);
        let acceleration = accelerations(&[all[5], all[6]], axle);
        let [_, left, right] = &axle.members_offset;
        let stiffness_n_m = [0, 1].map(|side| {
            let corner = &input.corners[WHEELS[side]];
            let normal = corner.frame.normal();
            let tyre_n_m = self.body.tyres[WHEELS[side]].vertical_stiffness_n_m;
            axle.paths[side].map(|path| tyre_n_m * normal.dot(&path))
        });
        Some(AxleForms {
            wheels: WHEELS,
            members: [members(&tyres, axle), members(&tyres, before)],
            links_per_acceleration: std::array::from_fn(|i| [left[i], right[i]]),
            bending_per_acceleration: axle
                .bending_offset
                .map(|[_, left, right]| [0, 1].map(|k| [left[k], right[k]])),
            self_stress: axle.self_stress,
            acceleration,
            stiffness_n_m,
            touching: WHEELS.map(|wheel| corners[wheel].touching),
            step_s: input.dt,
            steps_back_max: self.tuning.members.steps_back_max,
            has_links: axle.has_links,
            has_section: axle.has_section,
        })
    }

    /// Takes the new readings of both corners of a live axle.
    pub(super) fn take_axle(
        &mut self,
        input: &StepInput<'_>,
        axle: &AxleForms,
        readings: &mut Readings,
        changes: &mut impl FnMut(ChannelChange),
    ) {
        let sigma_n = self.tuning.force_start_sigma_n;
        self.state[SELF_STRESS] = 0.0;
        self.covariance.forget(SELF_STRESS, sigma_n * sigma_n);
        self.latencies.forget_effect(SELF_STRESS);
        let [left, right] = [0, 1].map(|side| measured_states(axle.wheels[side]));
        let mut rows = AxleRows::new(std::array::from_fn(|k| match k.checked_sub(MEASURED) {
            None => left[k],
            Some(k) => right.get(k).copied().unwrap_or(SELF_STRESS),
        }));
        let measured = [0, 1].map(|side| self.measure_axle(input, axle, side, readings, &mut rows));
        let strained = axle.is_strained(&measured);
        let mut joint = self.covariance.project(&rows, &self.state);
        let mut measured = measured;
        for (side, of_wheel) in measured.iter_mut().enumerate() {
            if strained && self.leaps(&joint, of_wheel) {
                of_wheel.length = None;
                self.suspected[axle.wheels[side]] = true;
            }
        }
        let events = [0, 1]
            .map(|side| self.judge_channels(&joint, &measured[side], axle.wheels[side], changes));
        let is_calm = events.iter().all(Option::is_none);
        let limit = if !is_calm || self.settling() {
            f64::INFINITY
        } else {
            self.tuning.members.limit_sigma
        };
        if let Some(z) = events.into_iter().flatten().reduce(f64::max) {
            for wheel in axle.wheels {
                self.surprise(wheel, z);
            }
            joint = self.covariance.project(&rows, &self.state);
        }
        let alone = strained && limit.is_finite();
        for (side, of_wheel) in measured.iter().enumerate() {
            if let Some(length) = of_wheel.length {
                let (wheel, m) = (axle.wheels[side], of_wheel.places.length);
                self.take_length(&mut joint, (m, &length), wheel, limit, alone);
            }
        }
        for (side, of_wheel) in measured.iter().enumerate() {
            for channel in StrainChannel::ALL {
                if let Some(strain) = of_wheel.strain[channel.index()] {
                    let (wheel, m) = (axle.wheels[side], of_wheel.places.strain[channel.index()]);
                    self.take_channel(&mut joint, (m, &strain), wheel, channel, limit);
                }
            }
        }
        self.covariance.apply(&rows, &joint, &mut self.state);
        if !self.settling() {
            let mut ageing = [None; TOGETHER];
            for of_wheel in &measured {
                of_wheel.add_ageing(&mut ageing);
            }
            self.latencies
                .take(&rows.view(), &joint, &self.covariance, &ageing);
        }
        self.blind |= !strained;
        for (side, of_wheel) in measured.iter().enumerate() {
            if !strained || !of_wheel.is_split {
                self.take_expected(input, axle.wheels[side]);
            }
        }
    }

    /// Measurements of one wheel of a live axle.
    fn measure_axle(
        &mut self,
        input: &StepInput<'_>,
        axle: &AxleForms,
        side: usize,
        readings: &mut Readings,
        rows: &mut AxleRows,
    ) -> CornerMeasurements {
        let wheel = axle.wheels[side];
        let places = places(side);
        let mut measured = CornerMeasurements::none(places);
        if let Some(read) = input.corners[wheel].length_read {
            let mut form = AxleForm::default();
            form.gains[side][AT_LENGTH] = 1.0;
            let back = Back::at(self.age_s(input, &read));
            let ageing = self.ageing(read.stream, |more_s| {
                value(&axle.ago(&form, back.earlier(more_s)), &self.state)
            });
            let (gains, constant) = axle.ago(&form, back);
            let own = (LENGTH_ERROR + wheel, -1.0);
            rows.set(places.length, gains, own);
            measured.length = Some(self.length_measurement(input, wheel, &read, constant, ageing));
        }
        let mut bent = 0;
        for channel in StrainChannel::ALL {
            let i = channel.index();
            let link = link_of(side, i).filter(|_| axle.has_links);
            let bending = BENDING.iter().position(|of_bending| *of_bending == i);
            if link.is_none() && (bending.is_none() || !axle.has_section) {
                continue;
            }
            let Some(reading) = readings.corners.0[wheel].strain[i].as_mut() else {
                continue;
            };
            let is_fresh = reading.fresh(input.now, input.fresh_s).is_some();
            measured.alive += usize::from(is_fresh && link.is_some());
            bent += usize::from(is_fresh && bending.is_some());
            if std::mem::replace(&mut reading.taken, true) {
                continue;
            }
            let reading = *reading;
            let (unlagged, back) = self.unlag(input, wheel, i, &reading);
            let linked = |back: Back| match (link, bending) {
                (Some(link), _) => axle.link(link, back.mean_s),
                (None, k) => axle.bending(side, k.unwrap_or(0), back.mean_s),
            };
            let ageing = self.ageing(reading.stream, |more_s| {
                let back = back.earlier(more_s);
                value(&axle.ago(&linked(back), back), &self.state)
            });
            let (mut gains, constant) = axle.ago(&linked(back), back);
            let offset = match (link, bending) {
                (Some(link), _) => {
                    gains[SHARED - 1] = axle.self_stress[link];
                    i
                }
                (None, k) => OFFSET_OF_BENDING[k.unwrap_or(0)],
            };
            rows.set(places.strain[i], gains, (OFFSET + 5 * wheel + offset, 1.0));
            measured.strain[i] =
                Some(self.axle_measurement(input, [wheel, i], &unlagged, constant, ageing));
        }
        measured.is_split = bent == BENDING.len();
        measured
    }

    fn axle_measurement(
        &self,
        input: &StepInput<'_>,
        [wheel, i]: [usize; 2],
        unlagged: &Unlagged,
        constant: f64,
        ageing: Option<Ageing>,
    ) -> RowMeasurement {
        // A force at the contact point bends the tube with the radius as its arm.
        let corner = &input.corners[wheel];
        let arm_m = if i < AXIAL.len() {
            1.0
        } else {
            (corner.frame.contact_m - corner.pose.wheel_centre_m).norm()
        };
        let noise = self.strain_noise(input, [wheel, i], unlagged);
        let (rough, tolerance_n) = self.member_errors(input, wheel, unlagged.value / arm_m);
        RowMeasurement {
            value: unlagged.value - constant,
            variance: noise + rough * arm_m * arm_m + self.latencies.variance(ageing),
            tolerance: tolerance_n * arm_m,
            ageing,
        }
    }
}
