//! Measurement equations of the sensors of one corner: potentiometer, strain channels, hub accelerometer.

use sample::{InnovationKind, StrainChannel};

use super::forms::{AT_LENGTH, Back, CornerForms, Form, MEASURED, measured_states};
use super::joint::{Joint, NO_OWN, Rows, TOGETHER};
use super::lag::Unlagged;
use super::latency::{Ageing, AgeingRows};
use super::layout::{FORCE, HUB_BIAS, LENGTH_ERROR, OFFSET};
use super::{Change, ChannelChange, Fusion, StepInput, StepModel};
use crate::calibration::SensitivityMatrix;
use crate::corners::KnownLinkage;
use crate::gaussian::within;
use crate::inputs::{Reading, Readings};
use crate::statics::AXIAL;
use crate::tuning::MemberTuning;

type CornerRows = Rows<MEASURED>;
/// Rows of a corner's potentiometer, of its first strain channel and of its hub accelerometer's first axis.
const LENGTH_ROW: usize = 0;
const STRAIN: usize = 1;
const HUB: usize = STRAIN + StrainChannel::COUNT;

/// Measurements of one corner with a new reading.
pub(super) struct CornerMeasurements {
    pub(super) places: Places,
    pub(super) length: Option<RowMeasurement>,
    pub(super) strain: [Option<RowMeasurement>; StrainChannel::COUNT],
    hub: [Option<RowMeasurement>; 3],
    /// Number of axial channels with a recent reading.
    pub(super) alive: usize,
    /// Whether the channels tell the forces of this wheel apart from those of others.
    pub(super) is_split: bool,
}

/// Rows of the measurements of a wheel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Places {
    /// Of the potentiometer.
    pub(super) length: usize,
    /// Of each strain channel.
    pub(super) strain: [usize; StrainChannel::COUNT],
    /// Of the hub accelerometer's first axis.
    pub(super) hub: usize,
}

/// Rows of a corner by itself.
const ALONE: Places = Places {
    length: LENGTH_ROW,
    strain: [
        STRAIN,
        STRAIN + 1,
        STRAIN + 2,
        STRAIN + 3,
        STRAIN + 4,
        STRAIN + 5,
        STRAIN + 6,
    ],
    hub: HUB,
};

impl CornerMeasurements {
    /// Nothing is measured yet.
    pub(super) fn none(places: Places) -> Self {
        Self {
            places,
            length: None,
            strain: [None; StrainChannel::COUNT],
            hub: [None; 3],
            alive: 0,
            is_split: true,
        }
    }

    /// Adds how its rows change with their age.
    pub(super) fn add_ageing(&self, rows: &mut AgeingRows) {
        let of = |row: &Option<RowMeasurement>| row.and_then(|row| row.ageing);
        let places = self.places;
        if self.length.is_some() {
            rows[places.length] = of(&self.length);
        }
        for (m, strain) in places.strain.into_iter().zip(&self.strain) {
            if strain.is_some() {
                rows[m] = of(strain);
            }
        }
        for (axis, hub) in self.hub.iter().enumerate() {
            if hub.is_some() {
                rows[places.hub + axis] = of(hub);
            }
        }
    }
}

/// Measured value of a row.
#[derive(Clone, Copy)]
pub(super) struct RowMeasurement {
    pub(super) value: f64,
    /// Variance of the converter's noise.
    pub(super) variance: f64,
    /// Standard deviation of the model, which is adapted.
    pub(super) tolerance: f64,
    /// How it changes with its age, if the latency of its message is not known.
    pub(super) ageing: Option<Ageing>,
}

/// Fewest axial channels with a recent reading that measure the forces of a corner or of a live axle.
pub(super) const STRAINED: usize = 4;

impl Fusion {
    /// Takes the new readings of one corner.
    pub(super) fn take_corner(
        &mut self,
        input: &StepInput<'_>,
        model: &StepModel,
        wheel: usize,
        readings: &mut Readings,
        changes: &mut impl FnMut(ChannelChange),
    ) {
        let (mut measured, rows) = self.measure_corner(input, model, wheel, readings);
        let mut joint = self.covariance.project(&rows, &self.state);
        let matrix = input.channels.0[wheel].matrix.as_ref();
        let needed = matrix.map_or(STRAINED, SensitivityMatrix::channels_needed);
        let strained = measured.alive >= needed;
        if strained && self.leaps(&joint, &measured) {
            measured.length = None;
            self.suspected[wheel] = true;
        }
        let event = self.judge_channels(&joint, &measured, wheel, changes);
        let limit = if event.is_some() || self.settling() {
            f64::INFINITY
        } else {
            self.tuning.members.limit_sigma
        };
        if let Some(z) = event {
            self.surprise(wheel, z);
            joint = self.covariance.project(&rows, &self.state);
        }
        if let Some(length) = measured.length {
            // Without strain, only the balances of the whole vehicle contradict a potentiometer: one relation.
            let alone = strained && limit.is_finite();
            self.take_length(&mut joint, (LENGTH_ROW, &length), wheel, limit, alone);
        }
        for channel in StrainChannel::ALL {
            if let Some(strain) = measured.strain[channel.index()] {
                let m = STRAIN + channel.index();
                self.take_channel(&mut joint, (m, &strain), wheel, channel, limit);
            }
        }
        for (axis, hub) in measured.hub.into_iter().enumerate() {
            if let Some(hub) = hub {
                let z = self.take_limited(&mut joint, HUB + axis, hub.value, hub.variance, limit);
                if axis == 2 && !self.settling() {
                    self.force_noise.take_hub(wheel, z);
                }
            }
        }
        self.covariance.apply(&rows, &joint, &mut self.state);
        if !self.settling() {
            let mut ageing = [None; TOGETHER];
            measured.add_ageing(&mut ageing);
            self.latencies
                .take(&rows.view(), &joint, &self.covariance, &ageing);
        }
        if !strained {
            self.blind = true;
            self.take_expected(input, wheel);
        }
    }

    /// Measurements of a corner.
    fn measure_corner(
        &mut self,
        input: &StepInput<'_>,
        model: &StepModel,
        wheel: usize,
        readings: &mut Readings,
    ) -> (CornerMeasurements, CornerRows) {
        let forms = &model.forms[wheel];
        let mut rows = CornerRows::new(measured_states(wheel));
        let mut length = None;
        if let Some(read) = input.corners[wheel].length_read {
            let age = self.age_s(input, &read);
            let mut form = Form::default();
            form.gains[AT_LENGTH] = 1.0;
            let ageing = self.ageing(read.stream, |more_s| {
                let form = forms.ago(&form, Back::at(age + more_s));
                form.value(wheel, &self.state)
            });
            let form = forms.ago(&form, Back::at(age));
            rows.set(LENGTH_ROW, form.gains, (LENGTH_ERROR + wheel, -1.0));
            length = Some(self.length_measurement(input, wheel, &read, form.constant, ageing));
        }
        let (strain, alive) = self.measure_strain(input, model, wheel, readings, &mut rows);
        let measured = CornerMeasurements {
            length,
            strain,
            alive,
            hub: self.measure_hub(input, forms, wheel, readings, &mut rows),
            ..CornerMeasurements::none(ALONE)
        };
        (measured, rows)
    }

    /// Measurement of a potentiometer whose form has this constant, mm.
    pub(super) fn length_measurement(
        &self,
        input: &StepInput<'_>,
        wheel: usize,
        read: &Reading,
        constant: f64,
        ageing: Option<Ageing>,
    ) -> RowMeasurement {
        let noise = 1e3 * input.channels.0[wheel].deflection.noise_sigma;
        RowMeasurement {
            value: 1e3 * read.value - constant,
            variance: noise * noise / f64::from(read.count) + self.latencies.variance(ageing),
            tolerance: 0.0,
            ageing,
        }
    }

    /// A reading of a strain channel without its lag, and when it shows the signal.
    pub(super) fn unlag(
        &mut self,
        input: &StepInput<'_>,
        wheel: usize,
        channel: usize,
        reading: &Reading,
    ) -> (Unlagged, Back) {
        let unlagged = self.strain_lag[wheel][channel].invert(reading, self.lag_s);
        let back = unlagged.delay.earlier(self.age_s(input, reading));
        (unlagged, back)
    }

    /// Variance of the noise of a strain channel's reading.
    pub(super) fn strain_noise(
        &self,
        input: &StepInput<'_>,
        [wheel, channel]: [usize; 2],
        unlagged: &Unlagged,
    ) -> f64 {
        let noise_sigma = input.channels.0[wheel].strain[channel].noise_sigma;
        let bent = self.tuning.members.bend_part * unlagged.bend;
        unlagged.noise * noise_sigma.powi(2) + bent * bent
    }

    /// Errors of the linkage's model on the force of a member: variance by the road, N^2, and the standard
    /// deviation that is adapted, N.
    pub(super) fn member_errors(
        &self,
        input: &StepInput<'_>,
        wheel: usize,
        force_n: f64,
    ) -> (f64, f64) {
        let t = self.tuning.members;
        let n = &self.tuning.force_noise;
        let posed = input.corners[wheel].strut_sigma_n.is_finite();
        let road = self.force_noise.road(wheel);
        let rough = n.road_member * n.road_member * road;
        (rough, member_tolerance_n(posed, force_n, road, &t))
    }

    /// Measurements of the strain channels, and the number of axial channels with a recent reading.
    fn measure_strain(
        &mut self,
        input: &StepInput<'_>,
        model: &StepModel,
        wheel: usize,
        readings: &mut Readings,
        rows: &mut CornerRows,
    ) -> ([Option<RowMeasurement>; StrainChannel::COUNT], usize) {
        let t = self.tuning.members;
        let forms = &model.forms[wheel];
        let known_n_m = &model.known[wheel].moment_n_m;
        let matrix_variance = self.matrix_variance(input, wheel, known_n_m);
        let has_matrix = input.channels.0[wheel].matrix.is_some();
        let corner = &input.corners[wheel];
        // Each tube of the lower arm carries half of the ball-normal force, so its bending gauges
        // measure M = F_n d/2, independent of spring and damper.
        let arm = 0.5 * self.bending_distance_m;
        let mut alive = 0;
        if corner.linkage != KnownLinkage::Corner && !has_matrix {
            return ([None; StrainChannel::COUNT], alive);
        }
        let strain = StrainChannel::ALL.map(|channel| {
            let i = channel.index();
            let reading = readings.corners.0[wheel].strain[i].as_mut()?;
            let axial = i < AXIAL.len();
            alive += usize::from(axial && reading.fresh(input.now, input.fresh_s).is_some());
            let is_described = axial || arm != 0.0 && !has_matrix;
            if std::mem::replace(&mut reading.taken, true) || !is_described {
                return None;
            }
            let reading = *reading;
            let c = &input.channels.0[wheel].strain[i];
            let (unlagged, back) = self.unlag(input, wheel, i, &reading);
            let linked = |back: Back| {
                if axial {
                    return forms.member(i, back.mean_s);
                }
                let statics = &corner.statics;
                let form = forms.strut.times(arm * statics.ball_normal_per_strut);
                let mut form = form.plus(arm * corner.travel.ball_normal, &forms.acceleration);
                form.constant += arm * statics.ball_normal_offset_n;
                form
            };
            let ageing = self.ageing(reading.stream, |more_s| {
                let back = back.earlier(more_s);
                forms.ago(&linked(back), back).value(wheel, &self.state)
            });
            let form = forms.ago(&linked(back), back);
            let own = if axial {
                (OFFSET + 5 * wheel + i, 1.0)
            } else {
                NO_OWN
            };
            rows.set(STRAIN + i, form.gains, own);
            let noise = self.strain_noise(input, [wheel, i], &unlagged);
            let (extra, tolerance) = if axial {
                let (rough, tolerance) = self.member_errors(input, wheel, unlagged.value);
                (rough + matrix_variance[i], tolerance)
            } else {
                (c.offset_sigma.powi(2), arm * t.bending_sigma_n)
            };
            Some(RowMeasurement {
                value: unlagged.value - form.constant,
                variance: noise + extra + self.latencies.variance(ageing),
                tolerance,
                ageing,
            })
        });
        (strain, alive)
    }

    /// Measurements of the hub accelerometer.
    fn measure_hub(
        &mut self,
        input: &StepInput<'_>,
        forms: &CornerForms,
        wheel: usize,
        readings: &mut Readings,
        rows: &mut CornerRows,
    ) -> [Option<RowMeasurement>; 3] {
        let Some(hub) = self.hubs[wheel] else {
            return [None; 3];
        };
        let [still, unit] = input.corners[wheel].travel.hub;
        let lag_s = time_constant_s(hub.lag_hz);
        let t = self.tuning.members;
        // An axis that is turned by a small angle reads a part of the other axes.
        let square: f64 = (0..3)
            .filter_map(|axis| readings.hub_acceleration_m_s2.0[wheel][axis])
            .map(|reading| reading.value * reading.value)
            .sum();
        let floor =
            t.hub_sigma_m_s2 * t.hub_sigma_m_s2 + t.hub_sigma_part * t.hub_sigma_part * square;
        std::array::from_fn(|axis| {
            let reading = readings.hub_acceleration_m_s2.0[wheel][axis].as_mut()?;
            if std::mem::replace(&mut reading.taken, true) {
                return None;
            }
            let reading = *reading;
            let unlagged = self.hub_lag[wheel][axis].invert(&reading, lag_s);
            let back = unlagged.delay.earlier(self.age_s(input, &reading));
            let along = forms.acceleration.times(unit[axis]);
            let ageing = self.ageing(reading.stream, |more_s| {
                let form = forms.ago(&along, back.earlier(more_s));
                form.value(wheel, &self.state)
            });
            let form = forms.ago(&along, back);
            let own = (HUB_BIAS + 3 * wheel + axis, 1.0);
            rows.set(HUB + axis, form.gains, own);
            let bent = t.bend_part * unlagged.bend;
            let noise = unlagged.noise * hub.noise_sigma_m_s2 * hub.noise_sigma_m_s2 + bent * bent;
            Some(RowMeasurement {
                value: unlagged.value - form.constant - still[axis],
                variance: noise + floor + self.latencies.variance(ageing),
                tolerance: 0.0,
                ageing,
            })
        })
    }

    /// Age of a reading, s.
    pub(super) fn age_s(&self, input: &StepInput<'_>, reading: &Reading) -> f64 {
        input
            .now
            .seconds_since(reading.time)
            .clamp(-0.01, input.fresh_s)
    }

    /// An event on the road: the forces of the wheel have changed by more than their noise tells. `z` is the
    /// largest normalised innovation.
    pub(super) fn surprise(&mut self, wheel: usize, z: f64) {
        let t = self.tuning;
        let part = (z / t.channels.gate_sigma).min(t.members.surprise_max);
        for (axis, sigma_n) in t.members.surprise_n.into_iter().enumerate() {
            let sigma_n = part * sigma_n;
            self.covariance
                .add_noise(FORCE + 3 * wheel + axis, sigma_n * sigma_n);
        }
        self.force_noise.surprise(wheel);
    }

    /// Judges each strain channel by what the state before any reading of this step expects. Several
    /// channels that are outside their gates at once, potentiometer and hub accelerometer among them, show an
    /// event on the road: then returns the largest normalised innovation.
    pub(super) fn judge_channels(
        &mut self,
        joint: &Joint,
        measured: &CornerMeasurements,
        wheel: usize,
        changes: &mut impl FnMut(ChannelChange),
    ) -> Option<f64> {
        if self.settling() {
            return None;
        }
        let t = self.tuning;
        let squares = StrainChannel::ALL.map(|channel| {
            let i = channel.index();
            let strain = measured.strain[i]?;
            let m = measured.places.strain[i];
            let health = &self.health[wheel][i];
            let own = health.model_variance(strain.tolerance, &t.channels);
            let doubt = t.members.gain_tolerance * strain.value;
            let total = joint.variance(m) + strain.variance + own + doubt * doubt;
            let innovation = strain.value - joint.value(m);
            Some(innovation * innovation / total)
        });
        let limit = t.channels.gate_sigma * t.channels.gate_sigma;
        let length = measured.length.map(|length| {
            let m = measured.places.length;
            let innovation = length.value - joint.value(m);
            innovation * innovation / (joint.variance(m) + length.variance)
        });
        let hubs = (0..3).map(|axis| {
            let hub = measured.hub[axis]?;
            let m = measured.places.hub + axis;
            let innovation = hub.value - joint.value(m);
            Some(innovation * innovation / (joint.variance(m) + hub.variance))
        });
        let all = squares.into_iter().chain([length]).chain(hubs).flatten();
        let (mut outside, mut largest) = (0, 0.0_f64);
        for square in all.filter(|square| *square > limit) {
            outside += 1;
            largest = largest.max(square);
        }
        let is_evidence = outside < t.channels.event_channels;
        for channel in StrainChannel::ALL {
            let i = channel.index();
            let Some(square) = squares[i] else { continue };
            let change =
                self.health[wheel][i].judge(square, is_evidence, !self.undecided, &t.channels);
            if change != Change::None {
                changes(ChannelChange {
                    wheel,
                    channel: Some(channel),
                    faulty: change == Change::Faulty,
                });
            }
        }
        (!is_evidence).then(|| largest.sqrt())
    }

    /// Whether the potentiometer has moved further than a strut can in a step.
    pub(super) fn leaps(&self, joint: &Joint, measured: &CornerMeasurements) -> bool {
        let t = self.tuning;
        measured.length.is_some_and(|length| {
            let m = measured.places.length;
            let apart_mm = (length.value - joint.value(m)).abs();
            let variance = joint.variance(m) + length.variance;
            let is_far = apart_mm > t.potentiometers.leap_mm;
            is_far && !self.settling() && !within(t.members.jump_sigma, apart_mm, variance)
        })
    }

    /// Takes a potentiometer. Several innovations that no strut makes are a jump of its level, if it is `alone`
    /// against sensors that agree with each other.
    pub(super) fn take_length(
        &mut self,
        joint: &mut Joint,
        (m, length): (usize, &RowMeasurement),
        wheel: usize,
        limit: f64,
        alone: bool,
    ) {
        let t = self.tuning;
        let innovation_mm = length.value - joint.value(m);
        let z = self.take_limited(joint, m, length.value, length.variance, limit);
        if self.settling() {
            return;
        }
        self.count(InnovationKind::Strut, z, t.members.jump_sigma);
        self.force_noise.take_length(wheel, z);
        self.length_measured[wheel] = true;
        if alone {
            self.lengths[wheel].learn(z, innovation_mm, &t.potentiometers);
        }
        self.jumps[wheel] = if alone && z.abs() > t.members.jump_sigma {
            self.jumps[wheel] + 1
        } else {
            0
        };
        if self.jumps[wheel] == t.members.jump_readings {
            self.suspected[wheel] = true;
        }
    }

    /// Takes one strain channel.
    pub(super) fn take_channel(
        &mut self,
        joint: &mut Joint,
        (m, strain): (usize, &RowMeasurement),
        wheel: usize,
        channel: StrainChannel,
        limit: f64,
    ) {
        let t = self.tuning;
        let i = channel.index();
        let model = self.health[wheel][i].model_variance(strain.tolerance, &t.channels);
        let variance = strain.variance + model;
        let kind = if i < AXIAL.len() {
            InnovationKind::Strain
        } else {
            InnovationKind::Bending
        };
        if !self.settling() && !self.health[wheel][i].is_used(&t.channels) {
            self.innovations.rejected(kind);
            return;
        }
        let innovation = strain.value - joint.value(m);
        let total = joint.variance(m) + variance;
        let z = self.take_limited(joint, m, strain.value, variance, limit);
        if self.settling() {
            return;
        }
        self.health[wheel][i].expect(total);
        self.health[wheel][i].learn(innovation, strain.tolerance, &t.channels);
        self.count(kind, z, f64::INFINITY);
    }

    /// Takes a row's value; an innovation beyond the limit weighs as one at the limit. Returns the
    /// normalised innovation.
    fn take_limited(
        &self,
        joint: &mut Joint,
        m: usize,
        value: f64,
        variance: f64,
        limit: f64,
    ) -> f64 {
        let total = joint.variance(m) + variance;
        let z = (value - joint.value(m)) / total.sqrt();
        joint.take(m, value, total * (z.abs() / limit).max(1.0));
        z
    }

    /// Takes the vehicle model's forces where strain is missing: without strain the forces of one
    /// axle are not observable separately, and without a potentiometer neither are the loads of the
    /// diagonals.
    pub(super) fn take_expected(&mut self, input: &StepInput<'_>, wheel: usize) {
        let t = self.tuning.members;
        let posed = input.corners[wheel].strut_sigma_n.is_finite();
        let expected = input.expected.0[wheel].force_n;
        let load = if posed {
            self.state[FORCE + 3 * wheel + 2].abs()
        } else {
            expected[2]
        };
        let mut rows = Rows::new([0, 1, 2].map(|axis| FORCE + 3 * wheel + axis));
        for (axis, unit) in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
            .into_iter()
            .enumerate()
        {
            rows.set(axis, unit, NO_OWN);
        }
        let mut joint = self.covariance.project(&rows, &self.state);
        for axis in 0..if posed { 2 } else { 3 } {
            // The same expected force in every step is one measurement, not many.
            let sigma = t.expected_sigma_part[axis] * load + t.expected_sigma_n;
            let variance = sigma * sigma * (t.expected_time_s / input.dt).max(1.0);
            self.take(&mut joint, axis, expected[axis], variance, f64::INFINITY);
        }
        self.covariance.apply(&rows, &joint, &mut self.state);
        let known = [None; TOGETHER];
        self.latencies
            .take(&rows.view(), &joint, &self.covariance, &known);
    }
}

/// Time constant of a first-order lag, s.
pub(super) fn time_constant_s(corner_hz: f64) -> f64 {
    1.0 / (std::f64::consts::TAU * corner_hz.max(0.1))
}

/// Error of the linkage's model on a member's force, N. Without a deflection the design position
/// replaces the measured one, with an error that grows with the roughness of the road.
fn member_tolerance_n(posed: bool, force_n: f64, road: f64, tuning: &MemberTuning) -> f64 {
    if posed {
        tuning.member_sigma_n + tuning.member_sigma_part * force_n.abs()
    } else {
        let part = tuning.unposed_sigma_part + tuning.unposed_road * road.sqrt();
        tuning.unposed_sigma_n + part * force_n.abs()
    }
}
