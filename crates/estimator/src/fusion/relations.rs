//! Relations between the readings of one step: members and struts against the forces of the tyres, and the
//! inertial unit against their sums. Means over a window are what [`crate::mistakes`] judges.
//!
//! The rows are those of the force filter's measurement equations. What the filter estimates from step to step
//! (forces and moments of the tyres, torques, errors of the struts) is unknown in them; lengths and rates of the
//! struts are taken from the filter, which has them from the potentiometers.

use nalgebra::{Matrix3, Vector3};
use sample::{StrainChannel, Wheel};

use super::forms::corner_states;
use super::inertial::Sum;
use super::layout::{BODY_RATE, FORCE, LENGTH, MOMENT, SPEED, STRUT, TORQUE};
use super::{Fusion, StepInput, StepModel};
use crate::calibration::Resolved;
use crate::corners::KnownLinkage;
use crate::inputs::Readings;
use crate::mistakes::{Setup, Stated};
use crate::statics::AXIAL;
use model::sensors::Sensors;
use model::vehicle::Vehicle;

/// Axial channels of all corners.
pub const CHANNELS: usize = 4 * AXIAL.len();
/// Rows: axial channels, struts, accelerometers, angular accelerations.
pub const ROWS: usize = CHANNELS + 4 + 6;
/// First row of the struts.
pub const STRUT_ROW: usize = CHANNELS;
/// First row of the accelerometers.
pub const ACCEL_ROW: usize = STRUT_ROW + 4;
/// First row of the angular accelerations.
pub const TURN_ROW: usize = ACCEL_ROW + 3;
/// Unknowns: forces, moments, errors of the struts, torques.
pub const UNKNOWNS: usize = 28;

/// What the errors of the parameters act on.
#[derive(Clone, Copy, Debug, Default)]
pub struct Loads {
    /// Readings of the axial channels, N.
    pub member_n: [f64; CHANNELS],
    /// Forces of the tyres by the filter, N.
    pub force_n: [f64; 12],
    /// Force of each strut that its length gives, without damping, N.
    pub spring_n: [f64; 4],
    /// Strut force for 1 m/s^2, kg.
    pub strut_mass_kg: [f64; 4],
    /// Specific force, as read, m/s^2.
    pub specific_force_m_s2: Vector3<f64>,
    /// What an offset of the inertial unit adds to its specific force: w' x + w x (w x), 1/s^2.
    pub lever: Matrix3<f64>,
}

impl Loads {
    /// All numbers that do not belong to the inertial unit.
    fn numbers(&mut self) -> impl Iterator<Item = &mut f64> {
        let of_corners = [
            self.member_n.as_mut_slice(),
            &mut self.force_n,
            &mut self.spring_n,
            &mut self.strut_mass_kg,
        ];
        of_corners.into_iter().flatten()
    }

    fn add(&mut self, other: &mut Self) {
        for (sum, value) in self.numbers().zip(other.numbers()) {
            *sum += *value;
        }
        self.specific_force_m_s2 += other.specific_force_m_s2;
        self.lever += other.lever;
    }

    fn scale(&mut self, factor: f64) {
        self.numbers().for_each(|value| *value *= factor);
        self.specific_force_m_s2 *= factor;
        self.lever *= factor;
    }
}

/// Means of the relations over a window.
#[derive(Clone, Debug)]
pub struct RelationWindow {
    /// Steps in it.
    pub steps: u32,
    /// Gains of the unknowns.
    pub gains: [[f64; UNKNOWNS]; ROWS],
    /// Reading less what does not depend on the unknowns: N of members, m/s^2 of struts, N of
    /// accelerometers, rad/s^2.
    pub value: [f64; ROWS],
    /// Steps in which the row has a reading.
    pub read: [u32; ROWS],
    /// Means of what the parameters' errors act on.
    pub loads: Loads,
    /// Force of each damper, N.
    pub damper_n: [f64; 4],
    /// Bias of the accelerometers that the motion filter has learnt at the end, and its standard deviation, m/s^2.
    pub learnt_bias: [Vector3<f64>; 2],
    /// Mean roughness of the road: see [`Fusion::roughness`].
    pub road: f64,
    /// Standard deviation of the ground's normal at a wheel, rad.
    pub tilt_rad: f64,
    /// Density of the road's noise at each wheel.
    pub roads: [f64; 4],
    /// Smallest load of each wheel, as a part of the static load.
    pub least_load: [f64; 4],
    /// Forward speed, m/s.
    pub speed: f64,
    /// Strut rates and body rates at the beginning.
    start: Option<([f64; 4], Vector3<f64>)>,
    span_s: f64,
}

impl Default for RelationWindow {
    fn default() -> Self {
        Self {
            steps: 0,
            gains: [[0.0; UNKNOWNS]; ROWS],
            value: [0.0; ROWS],
            read: [0; ROWS],
            loads: Loads::default(),
            damper_n: [0.0; 4],
            learnt_bias: [Vector3::zeros(); 2],
            road: 0.0,
            tilt_rad: 0.0,
            roads: [0.0; 4],
            least_load: [f64::INFINITY; 4],
            speed: 0.0,
            start: None,
            span_s: 0.0,
        }
    }
}

/// Unknown of a state of the filter, if it is one.
fn unknown(state: usize) -> Option<usize> {
    match state {
        FORCE..12 => Some(state),
        MOMENT..SPEED => Some(12 + state - MOMENT),
        STRUT..BODY_RATE => Some(20 + state - STRUT),
        _ => None,
    }
}

/// A row in the making.
struct Row<'a> {
    window: &'a mut RelationWindow,
    row: usize,
    value: f64,
}

impl Row<'_> {
    fn gain(&mut self, state: usize, gain: f64, known: &[f64]) {
        match unknown(state) {
            Some(column) => self.window.gains[self.row][column] += gain,
            None => self.value -= gain * known[state],
        }
    }

    fn finish(self) {
        self.window.value[self.row] += self.value;
        self.window.read[self.row] += 1;
    }
}

impl Fusion {
    /// Adds the relations of a step to the window.
    pub(super) fn relate(&mut self, input: &StepInput<'_>, model: &StepModel, readings: &Readings) {
        let Some(mut window) = self.relations.take() else {
            return;
        };
        let mut loads = self.loads;
        for wheel in 0..4 {
            self.relate_corner(input, model, readings, wheel, &mut window, &mut loads);
        }
        if input.motion.inertial {
            self.relate_inertial(input, model, &mut window, &mut loads);
        }
        let state = &self.state;
        loads.force_n = std::array::from_fn(|k| state[FORCE + k]);
        window.loads.add(&mut loads);
        window.road += self.roughness();
        window.tilt_rad += input.tilt_rad;
        window.speed += input.motion.velocity_m_s.x;
        let strut_rates = std::array::from_fn(|wheel| 1e-3 * state[SPEED + wheel]);
        let rate = input.motion.rate_rad_s;
        let (first, turn) = *window.start.get_or_insert((strut_rates, rate));
        if window.steps > 0 {
            window.span_s += input.dt;
        }
        window.steps += 1;
        if window.steps == self.window_steps {
            window.finish(&first, &strut_rates, &(rate - turn));
            self.related = true;
        }
        self.relations = Some(window);
        self.loads = loads;
    }

    /// Adds the rows of the members and of the strut of a corner.
    fn relate_corner(
        &self,
        input: &StepInput<'_>,
        model: &StepModel,
        readings: &Readings,
        wheel: usize,
        window: &mut RelationWindow,
        loads: &mut Loads,
    ) {
        let state = &self.state;
        let corner = &input.corners[wheel];
        let forms = &model.forms[wheel];
        let is_linked = input.channels.0[wheel].matrix.is_none();
        if corner.linkage == KnownLinkage::Corner && is_linked {
            for (i, channel) in AXIAL.into_iter().enumerate() {
                // The monitors have found it faulty in this drive: it says nothing of the configuration.
                if self.health[wheel][channel.index()].is_faulty() {
                    continue;
                }
                let reading = readings.corners.0[wheel].strain[channel.index()];
                let Some(value) = reading.and_then(|r| r.fresh(input.now, self.related_age_s))
                else {
                    continue;
                };
                let form = forms.member(i, 0.0);
                let at = AXIAL.len() * wheel + i;
                loads.member_n[at] = value;
                let mut row = Row {
                    window: &mut *window,
                    row: at,
                    value: value - form.constant,
                };
                for (index, gain) in corner_states(wheel).into_iter().zip(form.gains) {
                    row.gain(index, gain, state);
                }
                row.finish();
            }
        }
        // The force of a stop is not known well enough.
        let is_measured = corner.strut_sigma_n.is_finite() && !self.lengths[wheel].is_faulty();
        if is_measured && !corner.travel.strut.stopped {
            let form = &forms.acceleration;
            let mut row = Row {
                window: &mut *window,
                row: STRUT_ROW + wheel,
                value: -form.constant,
            };
            for (index, gain) in corner_states(wheel).into_iter().zip(form.gains) {
                row.gain(index, gain, state);
            }
            for (index, gain) in forms.coupled.iter().flat_map(|coupled| coupled.terms()) {
                row.gain(index, gain, state);
            }
            row.finish();
        }
        let line = &corner.travel.strut;
        loads.spring_n[wheel] =
            line.constant_n() - line.stiffness_n_m * 1e-3 * state[LENGTH + wheel];
        window.damper_n[wheel] -= line.damping_n_s_m * 1e-3 * state[SPEED + wheel];
        loads.strut_mass_kg[wheel] = corner.travel.members[5];
        window.roads[wheel] += self.force_noise.road(wheel);
        let part = state[FORCE + 3 * wheel + 2] / self.body.static_load[wheel];
        window.least_load[wheel] = window.least_load[wheel].min(part);
    }

    fn relate_inertial(
        &self,
        input: &StepInput<'_>,
        model: &StepModel,
        window: &mut RelationWindow,
        loads: &mut Loads,
    ) {
        let state = &self.state;
        let sum = self.measured_sum_n(input, &model.balance);
        let mut push = |row: usize, value: f64, gains: &Sum| {
            let mut row = Row { window, row, value };
            for (index, gain) in gains.gains.iter().enumerate() {
                row.gain(index, *gain, state);
            }
            row.finish();
        };
        for axis in 0..3 {
            let form = self.accelerometer(input, &model.balance, axis);
            let biased = sum[axis] + self.body.mass_kg * input.motion.accel_bias_m_s2[axis];
            push(ACCEL_ROW + axis, biased, &form);
            let turn = &model.balance.turn[axis];
            push(TURN_ROW + axis, -turn.constant, turn);
        }
        let motion = input.motion;
        loads.specific_force_m_s2 = motion.specific_force_m_s2 + motion.accel_bias_m_s2;
        window.learnt_bias = [motion.accel_bias_m_s2, motion.accel_bias_sigma_m_s2];
        let turning = motion.rate_rad_s.cross_matrix();
        loads.lever = motion.rate_dot_rad_s2.cross_matrix() + turning * turning;
    }

    /// What the errors of the parameters act on in the last step.
    pub(crate) fn loads(&self) -> &Loads {
        &self.loads
    }

    /// What the evidence for mistakes needs.
    pub(crate) fn mistake_setup(
        &self,
        vehicle: &Vehicle,
        sensors: &Sensors,
        calibration: &Resolved,
    ) -> Setup {
        let body = &vehicle.body;
        let hitch = vehicle.hitch.as_ref().map(|hitch| hitch.position_m);
        // Without a hitch in the vehicle file: behind the rear axle, at the height of the wheels' centres.
        let [x, y, z] = hitch.unwrap_or([
            -body.front_axle_to_cg_m
                - body.cg_to_rear_axle_m
                - self.body.tyres[2].unloaded_radius_m,
            0.0,
            self.body.tyres[2].unloaded_radius_m,
        ]);
        let channel = |at: usize| {
            let (wheel, channel) = channel_of(at);
            calibration.corners.0[wheel].strain[channel.index()]
        };
        let added = |wheel: Wheel| {
            let at = |ahead_m: f64, left_m: f64| {
                vehicle.weight_on_n(wheel, 1.0, [ahead_m, body.cg_y_m + left_m])
            };
            let here = at(0.0, 0.0);
            [here, at(1.0, 0.0) - here, at(0.0, 1.0) - here]
        };
        Setup {
            mass_kg: self.body.mass_kg,
            static_n: self.body.static_load,
            weight_n: Wheel::ALL.map(added),
            load_n: self.body.static_load.iter().sum::<f64>() / 4.0,
            inverse: self.body.inverse,
            imu_m: calibration.imu_m,
            hitch_m: Vector3::new(
                x + body.front_axle_to_cg_m,
                y - body.cg_y_m,
                z - body.cg_height_m,
            ),
            radius_m: self
                .body
                .tyres
                .each_ref()
                .map(|tyre| tyre.unloaded_radius_m),
            offset_sigma_n: std::array::from_fn(|at| {
                let channel = channel(at);
                channel.offset_sigma.max(channel.noise_sigma)
            }),
            bias_sigma_m_s2: sensors.imu.accel_bias_m_s2,
            count_n: std::array::from_fn(|at| channel(at).gain),
            stated: Stated::of(vehicle, sensors),
        }
    }

    /// Hands the window to `work`, if it is complete; the next begins.
    pub(crate) fn with_relations(&mut self, work: impl FnOnce(&RelationWindow)) {
        if let Some(window) = &mut self.relations
            && std::mem::take(&mut self.related)
        {
            work(window);
            **window = RelationWindow::default();
        }
    }
}

impl RelationWindow {
    /// Divides by the number of steps, and adds what changed from the beginning to the end.
    fn finish(&mut self, first: &[f64; 4], last: &[f64; 4], turned: &Vector3<f64>) {
        let part = 1.0 / f64::from(self.steps);
        let long = [self.value.as_mut_slice(), self.gains.as_flattened_mut()];
        long.into_iter().flatten().for_each(|value| *value *= part);
        self.loads.scale(part);
        for values in [&mut self.damper_n, &mut self.roads] {
            *values = values.map(|value| value * part);
        }
        self.road *= part;
        self.tilt_rad *= part;
        self.speed *= part;
        for wheel in 0..4 {
            self.value[STRUT_ROW + wheel] += (last[wheel] - first[wheel]) / self.span_s;
        }
        for axis in 0..3 {
            self.value[TURN_ROW + axis] += turned[axis] / self.span_s;
        }
    }

    /// Whether the row has a reading in every step.
    pub fn has(&self, row: usize) -> bool {
        self.read[row] == self.steps
    }
}

/// Channel of a row of a member.
#[must_use]
pub fn channel_of(row: usize) -> (usize, StrainChannel) {
    (row / AXIAL.len(), AXIAL[row % AXIAL.len()])
}

const _: () = assert!(TORQUE + 4 == BODY_RATE);
