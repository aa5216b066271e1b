//! The single-track filter in the estimator.

use std::collections::VecDeque;

use model::sensors::Sensors;
use model::vehicle::Vehicle;
use nalgebra::{SMatrix, SVector, Vector3};
use sample::{InnovationKind, LogTime, Motion, Parameters, STANDARD_GRAVITY_M_S2, Sample};

use super::{
    ACCEL, GYRO, Handling, PlanarDoubt, PlanarFilter, PlanarInput, PlanarModel, PlanarNoise,
    PlanarReadings, PlanarState, SPEED_MIN_M_S, STATES, STEER,
};
use crate::calibration::Resolved;
use crate::grid::{HOLD_NANOS, grid};
use crate::inertial_forces::InertialInput;
use crate::innovation::InnovationTally;
use crate::motion::MotionState;
use crate::trace::Operation;
use crate::tuning::{PlanarTuning, Tuning};
use crate::{EstimatorError, Settings};

/// The filter with its readings.
#[derive(Clone, Debug)]
pub struct Planar {
    filter: PlanarFilter,
    readings: PlanarReadings,
    /// Innovations since the last report.
    pub innovations: InnovationTally,
    before: Option<LogTime>,
    /// Instants whose values may not have arrived yet.
    pending: VecDeque<LogTime>,
    traces: Vec<(LogTime, PlanarTrace)>,
    traced: bool,
    contradiction: Contradiction,
}

/// Whether innovations show that the vehicle file is not that of the driven vehicle.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Contradiction {
    /// Mean square of the normalised innovations of lateral acceleration, and the time over which it
    /// was taken, s.
    square: f64,
    driven_s: f64,
    found: bool,
    reported: bool,
}

impl Contradiction {
    pub(super) fn push(&mut self, square: f64, step_s: f64, tuning: &PlanarTuning) {
        let time_s = tuning.contradiction_time_s;
        self.driven_s = (self.driven_s + step_s).min(time_s);
        // The mean of all before the time is over.
        let square = square.min(tuning.contradiction_square_max);
        self.square += (step_s / self.driven_s).min(1.0) * (square - self.square);
        let [from, to] = tuning.contradiction;
        if self.driven_s >= time_s {
            self.found = self.square > if self.found { to } else { from };
        }
    }

    pub(super) fn take_change(&mut self) -> Option<(bool, f64)> {
        let changed = self.found != self.reported;
        self.reported = self.found;
        changed.then_some((self.found, self.square))
    }
}

/// Result of the filter at one instant with its input.
#[derive(Clone, Copy, Debug)]
pub struct PlanarMotion {
    tuning: PlanarTuning,
    input: PlanarInput,
    pub(super) state: PlanarState,
}

/// Record of one step for a smoother.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanarTrace {
    /// Operations since the step before.
    pub operations: Vec<Operation<STATES>>,
    /// Covariance after them.
    pub covariance: SMatrix<f64, STATES, STATES>,
    pub(super) state: SVector<f64, STATES>,
    model: PlanarModel,
    input: PlanarInput,
}

impl PlanarTrace {
    /// The motion with a smoother's correction of the state and reduction of the covariance.
    #[must_use]
    pub fn corrected(
        &self,
        correction: &SVector<f64, STATES>,
        shrinkage: &SMatrix<f64, STATES, STATES>,
    ) -> PlanarMotion {
        let state = self.state + correction;
        let covariance = self.covariance - shrinkage;
        PlanarMotion {
            tuning: self.model.tuning,
            input: self.input,
            state: self.model.result(&state, &covariance, &self.input),
        }
    }
}

impl Planar {
    /// A filter without readings.
    pub fn new(
        vehicle: &Vehicle,
        sensors: &Sensors,
        calibration: &Resolved,
        tuning: &Tuning,
    ) -> Result<Self, EstimatorError> {
        let t = &tuning.planar;
        let handling = calibration.handling;
        let model = PlanarModel::new(
            vehicle,
            handling.unwrap_or_else(|| Handling::of_vehicle(vehicle)),
            calibration.plain_imu_ahead_m,
            t,
        );
        let doubt = if handling.is_some() {
            PlanarDoubt::identified(t)
        } else {
            PlanarDoubt::file(t)
        };
        let noise = PlanarNoise {
            yaw_rate_rad_s: calibration
                .gyro_noise_rad_s
                .unwrap_or(sensors.imu.gyro_noise_rad_s),
            acceleration_m_s2: calibration
                .accel_noise_m_s2
                .unwrap_or(sensors.imu.accel_noise_m_s2),
        };
        Ok(Self {
            filter: PlanarFilter::new(model, noise, doubt, handling.is_some()),
            readings: PlanarReadings::new(vehicle, t.input)?,
            innovations: InnovationTally::default(),
            before: None,
            pending: VecDeque::with_capacity(PENDING_MAX),
            traces: Vec::new(),
            traced: false,
            contradiction: Contradiction::default(),
        })
    }

    /// The same filter on other tyres. A handling that was identified stays.
    pub fn load_tyres(&mut self, vehicle: &Vehicle, calibration: &Resolved) {
        if calibration.handling.is_none() {
            self.filter.model.handling = Handling::of_vehicle(vehicle);
        }
        self.readings.load_tyres(vehicle);
    }

    /// Starts recording operations.
    pub fn switch_trace_on(&mut self) {
        self.filter.trace.switch_on();
        self.traced = true;
    }

    /// State, covariance and operations of each instant that was completed since the last call. An
    /// instant without a speed or a steer angle has none.
    pub fn take_traces(&mut self) -> Vec<(LogTime, PlanarTrace)> {
        std::mem::take(&mut self.traces)
    }

    /// Number of restarts after divergence.
    #[must_use]
    pub fn resets(&self) -> u64 {
        self.filter.resets()
    }

    /// Takes a sample, unless the settings ignore it.
    pub fn push(&mut self, sample: &Sample, calibration: &Resolved, settings: &Settings) {
        self.readings.push(sample, calibration, settings);
    }

    /// Offsets of steer angle, yaw rate and lateral acceleration, see [`PlanarFilter::offsets`].
    #[must_use]
    pub fn offsets(&self) -> [f64; 3] {
        self.filter.offsets()
    }

    /// Writes the filter's offsets in place of the inertial navigation's biases.
    pub fn write_offsets(&self, parameters: &mut Parameters) {
        let unknown = f64::NAN;
        let sigma = |i: usize| self.filter.covariance[(i, i)].sqrt();
        let state = &self.filter.state;
        parameters.accel_bias_m_s2 = [unknown, state[ACCEL], unknown];
        parameters.accel_bias_sigma_m_s2 = [unknown, sigma(ACCEL), unknown];
        parameters.gyro_bias_rad_s = [unknown, unknown, state[GYRO]];
        parameters.gyro_bias_sigma_rad_s = [unknown, unknown, sigma(GYRO)];
        parameters.steer_offset_rad = state[STEER];
        parameters.steer_offset_sigma_rad = sigma(STEER);
    }

    /// The motion at `time`; `None` without a speed and a steer angle.
    ///
    /// An instant is completed when its last values have arrived. From there, the filter repeats the
    /// steps up to `time` with the values that have arrived so far, and holds the others.
    pub fn step(&mut self, time: LogTime, step_s: f64) -> Option<PlanarMotion> {
        if self.pending.len() == PENDING_MAX {
            self.pending.pop_front();
        }
        self.pending.push_back(time);
        self.readings.sort();
        let complete = time.offset_seconds(-self.readings.late_s());
        let mut motion = None;
        while let Some(instant) = next_complete(&mut self.pending, complete) {
            let input = self.readings.take(instant, until(instant, time));
            motion = self.advance(instant, step_s, input);
            self.count(motion.as_ref(), step_s);
            self.trace(instant, input);
        }
        if self.pending.is_empty() {
            return motion;
        }
        self.look_ahead(time, step_s)
    }

    /// The motion at `time`, the last pending instant; the filter stays where it was.
    fn look_ahead(&mut self, time: LogTime, step_s: f64) -> Option<PlanarMotion> {
        let before = self.before;
        let kept = self.filter.begin_look_ahead();
        let begin = self.readings.look_ahead();
        let mut taken = begin;
        let mut motion = None;
        for index in 0..self.pending.len() {
            let instant = self.pending[index];
            let input = self
                .readings
                .take_ahead(&mut taken, instant, until(instant, time));
            motion = self.advance(instant, step_s, input);
        }
        self.readings.return_to(&begin);
        self.filter.end_look_ahead(kept);
        self.before = before;
        motion
    }

    fn advance(
        &mut self,
        time: LogTime,
        step_s: f64,
        input: Option<PlanarInput>,
    ) -> Option<PlanarMotion> {
        let input = input?;
        let dt_s = self
            .before
            .map_or(f64::INFINITY, |before| time.seconds_since(before));
        self.before = Some(time);
        let nearly = (dt_s - step_s).abs() < 1e-6;
        let state = self.filter.step(if nearly { step_s } else { dt_s }, &input);
        Some(PlanarMotion {
            tuning: self.filter.model.tuning,
            input,
            state,
        })
    }

    /// The change of the contradiction between vehicle file and drive since the last call, with the
    /// mean square of the normalised innovations.
    pub fn contradiction(&mut self) -> Option<(bool, f64)> {
        self.contradiction.take_change()
    }

    fn count(&mut self, motion: Option<&PlanarMotion>, step_s: f64) {
        let kinds = [InnovationKind::Gyro, InnovationKind::Accelerometer];
        let innovations = motion.map(|motion| motion.state.innovations);
        for (kind, innovation) in kinds.into_iter().zip(innovations.into_iter().flatten()) {
            if innovation.value.is_finite() {
                let normalised = innovation.value / innovation.sigma;
                let square = normalised * normalised;
                self.innovations.used(kind, square);
                if kind == InnovationKind::Accelerometer {
                    let tuning = &self.filter.model.tuning;
                    self.contradiction.push(square, step_s, tuning);
                }
            }
        }
    }

    fn trace(&mut self, instant: LogTime, input: Option<PlanarInput>) {
        let (Some(input), true) = (input, self.traced) else {
            return;
        };
        let filter = &mut self.filter;
        let trace = PlanarTrace {
            operations: filter.trace.take(),
            covariance: filter.covariance,
            state: filter.state,
            model: filter.model,
            input,
        };
        self.traces.push((instant, trace));
    }
}

/// Most instants whose values may not have arrived yet, at 100 Hz.
const PENDING_MAX: usize = 128;

/// Removes the first instant if it is complete.
fn next_complete(pending: &mut VecDeque<LogTime>, complete: LogTime) -> Option<LogTime> {
    pending.front().filter(|instant| **instant <= complete)?;
    pending.pop_front()
}

/// Time of the last values that belong to an instant. The newest instant takes all that have arrived.
fn until(instant: LogTime, newest: LogTime) -> LogTime {
    if instant == newest {
        LogTime(u64::MAX)
    } else {
        instant.offset_nanos(HOLD_NANOS.cast_signed())
    }
}

/// Records the filter's inputs, for identification.
#[derive(Clone, Debug)]
pub struct PlanarRecorder {
    readings: PlanarReadings,
    calibration: Resolved,
    settings: Settings,
    next_grid: Option<LogTime>,
    pending: VecDeque<LogTime>,
    inputs: Vec<PlanarInput>,
}

impl PlanarRecorder {
    /// A recorder without rows; it ignores what the settings ignore.
    pub fn new(
        vehicle: &Vehicle,
        calibration: Resolved,
        settings: Settings,
    ) -> Result<Self, EstimatorError> {
        Ok(Self {
            readings: PlanarReadings::new(vehicle, settings.tuning.planar.input)?,
            calibration,
            settings,
            next_grid: None,
            pending: VecDeque::new(),
            inputs: Vec::new(),
        })
    }

    /// Moves time on, as [`crate::Estimator::advance`] does.
    pub fn advance(&mut self, now: LogTime) {
        for time in grid(&mut self.next_grid, now) {
            self.pending.push_back(time);
            let complete = time.offset_seconds(-self.readings.late_s());
            self.complete(complete, time);
        }
    }

    /// Adds the rows of the instants up to `complete`, whose values have arrived.
    fn complete(&mut self, complete: LogTime, newest: LogTime) {
        self.readings.sort();
        while let Some(instant) = next_complete(&mut self.pending, complete) {
            let row = self.readings.take(instant, until(instant, newest));
            self.inputs.extend(row);
        }
    }

    /// Takes a sample.
    pub fn push(&mut self, sample: &Sample) {
        self.readings
            .push(sample, &self.calibration, &self.settings);
    }

    /// All rows so far.
    #[must_use]
    pub fn into_inputs(mut self) -> Vec<PlanarInput> {
        if let Some(newest) = self.pending.back().copied() {
            self.complete(newest, newest);
        }
        self.inputs
    }
}

impl PlanarMotion {
    /// Replaces the inertial navigation's motion by this one.
    pub fn apply_to(&self, state: &mut MotionState) {
        state.velocity_m_s.x = self.input.speed_m_s;
        state.velocity_m_s.y = self.state.lateral_m_s;
        state.velocity_m_s.z = 0.0;
        state.rate_rad_s.z = self.state.yaw_rate_rad_s;
        let gravity = Vector3::new(0.0, 0.0, STANDARD_GRAVITY_M_S2);
        let (ahead, left) = (self.input.acceleration_m_s2, self.state.acceleration_m_s2);
        state.specific_force_m_s2 =
            state.earth_from_body.inverse() * gravity + Vector3::new(ahead, left, 0.0);
        state.sideslip_rad = self.sideslip_rad();
        state.sideslip_sigma_rad = self.sideslip_sigma_rad();
    }

    /// Writes what the force estimate of a vehicle without linkages needs: the readings (the yaw rate less
    /// `gyro`, the filter's offset; that of the accelerometer also contains what the single-track model omits), moved from the inertial unit (`ahead_m` ahead of the centre of gravity) to the centre of gravity with the yaw
    /// acceleration `turning_rad_s2`. Without a forward specific force, the rate of change of the speed replaces it.
    pub fn write_input(
        &self,
        gyro: f64,
        ahead_m: f64,
        turning_rad_s2: f64,
        input: &mut InertialInput,
    ) {
        let last = &self.input.inertial;
        let yaw_rate = last.yaw_rate_rad_s - gyro;
        let [forward, left, up] = last.force_m_s2;
        let forward = if forward.is_finite() {
            forward + ahead_m * yaw_rate * yaw_rate
        } else {
            input.forward_sigma_m_s2 = self.tuning.speed_slope_sigma_m_s2;
            self.input.acceleration_m_s2
        };
        input.force_m_s2 = [forward, left - ahead_m * turning_rad_s2, up];
        input.rate_rad_s = [f64::NAN, f64::NAN, yaw_rate];
        input.speed_m_s = self.input.speed_m_s;
        let steer = self.state.steer_rad;
        input.steer_rad = [steer, steer, 0.0, 0.0];
    }

    /// Whether the yaw rate is measured.
    pub(crate) fn has_yaw_rate(&self) -> bool {
        self.input.inertial.yaw_rate_rad_s.is_finite()
    }

    /// Standard deviation of sideslip: the filter's own and the error of a single-track model.
    fn sideslip_sigma_rad(&self) -> f64 {
        let speed = self.input.speed_m_s.max(SPEED_MIN_M_S);
        let own = self.state.lateral_sigma_m_s / speed;
        let model = self.tuning.sideslip_sigma_rad
            + self.tuning.sideslip_sigma_part * self.state.rear_slip_rad.abs();
        math::hypot(own, model)
    }

    fn sideslip_rad(&self) -> f64 {
        let (forward, left) = (self.input.speed_m_s, self.state.lateral_m_s);
        if math::hypot(forward, left) < 0.1 {
            return 0.0;
        }
        math::atan2(left, forward)
    }

    /// Writes the motion; attitude, which the filter does not have, is unknown.
    pub fn write_to(&self, motion: &mut Motion) {
        let unknown = f64::NAN;
        *motion = Motion {
            velocity_x_m_s: self.input.speed_m_s,
            velocity_y_m_s: self.state.lateral_m_s,
            sideslip_rad: self.sideslip_rad(),
            sideslip_sigma_rad: self.sideslip_sigma_rad(),
            rate_rad_s: [unknown, unknown, self.state.yaw_rate_rad_s],
            acceleration_m_s2: [
                self.input.acceleration_m_s2,
                self.state.acceleration_m_s2,
                unknown,
            ],
            ..Motion::UNKNOWN
        };
    }
}
