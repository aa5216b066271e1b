//! Motion of the body: attitude, velocity and sideslip by inertial navigation, corrected by GNSS
//! velocity and attitude, wheel speeds and constraints of a road vehicle.
//!
//! Error-state Kalman filter. Nominal state: attitude R (earth from body), velocity v of the
//! inertial unit in earth axes, accelerometer bias b_a and gyro bias b_g. With specific force f and
//! rate w of the unit in body axes,
//!
//! R' = R [w - b_g]x, v' = R (f - b_a) - (0, 0, g)
//!
//! The error (d theta, d v, d b_a, d b_g) is defined by R_true = exp([d theta]x) R in earth axes,
//! so that d v' = -[R (f - b_a)]x d theta - R d b_a and d theta' = -R d b_g.
//!
//! A GNSS value has a latency. It is compared with the nominal state of its own time, from a
//! history of [`history::SPAN_S`], and the correction is applied to the present. The change of the
//! error within the latency is neglected (less than 1 % of it in 50 ms), so the order of arrival of
//! late values does not matter to first order.

mod acceptance;
mod attitude;
mod flow;
pub mod history;
mod jumps;
mod latency;
mod solution;
mod state;
mod update;

use nalgebra::{Matrix3, Rotation3, SMatrix, SVector, Vector3};
use sample::{LogTime, STANDARD_GRAVITY_M_S2};

use crate::innovation::InnovationTally;
use crate::trace::{Operation, Restart, Term, Trace};
use crate::triads::Triads;
use crate::tuning::MotionTuning;
use acceptance::{AcceptanceCounter, ReceiverState};
use flow::Flow;
use history::{History, Pose};
use jumps::Jumps;
pub use solution::Solution;
pub use state::MotionState;
pub use update::Verdict;

/// Size of the error state: attitude, velocity, accelerometer bias, gyro bias.
pub const STATES: usize = 12;
/// Position of the attitude error in the error state, earth axes, rad.
pub const ATTITUDE: usize = 0;
/// Position of the velocity error, earth axes, m/s.
pub const VELOCITY: usize = 3;
/// Position of the accelerometer bias's error, body axes, m/s^2.
pub const ACCEL_BIAS: usize = 6;
/// Position of the gyro bias's error, body axes, rad/s.
pub const GYRO_BIAS: usize = 9;

/// Longest step that the inertial equations are carried over at once, s.
const STEP_MAX_S: f64 = 0.05;

/// Largest variances of attitude, velocity, accelerometer bias and gyro bias: they keep the
/// covariance finite.
const VARIANCE_MAX: [f64; 4] = [10.0, 1e4, 4.0, 0.1];

/// Noise and geometry that the filter assumes.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionSettings {
    /// Interval of the inertial unit's messages, s.
    pub interval_s: f64,
    /// Standard deviation of specific force, m/s^2.
    pub accel_sigma_m_s2: f64,
    /// Standard deviation of rate, rad/s.
    pub gyro_sigma_rad_s: f64,
    /// Standard deviation of the biases at the start.
    pub accel_bias_sigma_m_s2: f64,
    /// Standard deviation of the rate biases at the start, rad/s.
    pub gyro_bias_sigma_rad_s: f64,
    /// Inertial unit from the centre of gravity, m.
    pub imu_m: Vector3<f64>,
    /// Antennas from the centre of gravity, m, in the order of [`VelocityReceiver`].
    pub antenna_m: [Vector3<f64>; 2],
    /// Standard deviation of GNSS velocity where the record has none, m/s.
    pub velocity_sigma_m_s: f64,
    /// Standard deviation of GNSS heading where the record has none, rad.
    pub heading_sigma_rad: f64,
    /// Standard deviation of GNSS roll and pitch where the record has none, rad.
    pub tilt_sigma_rad: f64,
}

/// The filter.
#[derive(Clone, Debug)]
pub struct MotionFilter {
    settings: MotionSettings,
    tuning: MotionTuning,
    time: Option<LogTime>,
    earth_from_body: Rotation3<f64>,
    velocity_m_s: Vector3<f64>,
    accel_bias: Vector3<f64>,
    gyro_bias: Vector3<f64>,
    covariance: SMatrix<f64, STATES, STATES>,
    rate: Vector3<f64>,
    rate_dot: Vector3<f64>,
    force: Vector3<f64>,
    force_dot: Vector3<f64>,
    history: History,
    jumps: Jumps,
    /// Biases before the last jump that was found and not yet taken.
    before_jump: Option<[f64; 6]>,
    imu_time: Option<LogTime>,
    velocity_time: Option<LogTime>,
    attitude_time: Option<LogTime>,
    heading_known: bool,
    /// Integral of the yaw rate, rad, without corrections.
    turned_rad: f64,
    /// Last heading less that integral, rad, and the number of consecutive headings that agree.
    heading_run: [f64; 2],
    /// Whether attitude and velocity must be found again from GNSS, attitude first.
    attitude_lost: bool,
    levelled: bool,
    velocities: [ReceiverState; 2],
    attitude_acceptance: AcceptanceCounter,
    /// Last yaw, pitch and roll of the receiver, and whether they were rejected.
    last_angles: [Option<f64>; 3],
    angles_rejected: [bool; 3],
    /// Standard deviation of the latency of the next GNSS value, s.
    latency_sigma_s: f64,
    /// Whether the balances of forces and moments confirm the inertial unit.
    imu_consistent: bool,
    resets: u32,
    /// Innovations since they were last reported.
    pub(crate) innovations: InnovationTally,
    trace: Trace<STATES>,
}

/// The antenna of a velocity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VelocityReceiver {
    /// A receiver of velocity alone.
    Own,
    /// The receiver that also measures attitude.
    OfAttitude,
}

impl MotionFilter {
    /// A filter without readings.
    #[must_use]
    pub fn new(settings: MotionSettings, tuning: &MotionTuning) -> Self {
        let mut filter = Self {
            settings,
            tuning: *tuning,
            time: None,
            earth_from_body: Rotation3::identity(),
            velocity_m_s: Vector3::zeros(),
            accel_bias: Vector3::zeros(),
            gyro_bias: Vector3::zeros(),
            covariance: SMatrix::zeros(),
            rate: Vector3::zeros(),
            rate_dot: Vector3::zeros(),
            force: Vector3::z() * STANDARD_GRAVITY_M_S2,
            force_dot: Vector3::zeros(),
            history: History::default(),
            jumps: Jumps::new(tuning.jumps),
            before_jump: None,
            imu_time: None,
            velocity_time: None,
            attitude_time: None,
            heading_known: false,
            turned_rad: 0.0,
            heading_run: [0.0; 2],
            attitude_lost: false,
            levelled: false,
            velocities: [ReceiverState::default(); 2],
            attitude_acceptance: AcceptanceCounter::default(),
            last_angles: [None; 3],
            angles_rejected: [false; 3],
            latency_sigma_s: 0.0,
            imu_consistent: false,
            resets: 0,
            innovations: InnovationTally::default(),
            trace: Trace::default(),
        };
        filter.restart();
        filter
    }

    /// Sets whether the balances of forces and moments confirm the inertial unit. Then GNSS that
    /// contradicts a confirmed state is considered wrong.
    pub fn set_imu_consistent(&mut self, imu_consistent: bool) {
        self.imu_consistent = imu_consistent;
    }

    /// Whether the balances confirm the inertial unit, in a state that GNSS has confirmed.
    #[must_use]
    pub fn is_imu_consistent(&self) -> bool {
        self.imu_consistent && self.all_acceptance(|acceptance| acceptance.confirmed)
    }

    /// Speed by the state, m/s.
    #[must_use]
    pub fn speed_m_s(&self) -> f64 {
        math::hypot(self.velocity_m_s.x, self.velocity_m_s.y)
    }

    /// Whether GNSS confirms the state now.
    #[must_use]
    pub fn is_confirmed(&self) -> bool {
        self.all_acceptance(|acceptance| acceptance.confirmed && acceptance.uses > 0)
    }

    /// Whether a condition holds for attitude and for the velocity of one receiver, as far as they
    /// are measured.
    fn all_acceptance(&self, holds: impl Fn(&AcceptanceCounter) -> bool) -> bool {
        let now = self.time.unwrap_or_default();
        let active_s = self.tuning.receivers.active_s;
        let silent = !(self.velocities.iter()).any(|receiver| receiver.is_active(now, active_s));
        let holds_of = |receiver: &ReceiverState| {
            let counts = receiver.is_active(now, active_s) || silent && receiver.at.is_some();
            counts && holds(&receiver.acceptance)
        };
        (self.velocity_time.is_none() || self.velocities.iter().any(holds_of))
            && (self.attitude_time.is_none() || holds(&self.attitude_acceptance))
    }

    fn set_acceptance(&mut self, acceptance: AcceptanceCounter) {
        for receiver in &mut self.velocities {
            receiver.acceptance = acceptance;
        }
        self.attitude_acceptance = acceptance;
    }

    /// Number of restarts.
    #[must_use]
    pub fn resets(&self) -> u32 {
        self.resets
    }

    /// Biases of accelerometers and gyros, m/s^2 and rad/s.
    #[must_use]
    pub fn biases(&self) -> [f64; 6] {
        let [a, g] = [self.accel_bias, self.gyro_bias];
        [a.x, a.y, a.z, g.x, g.y, g.z]
    }

    /// Biases before a jump, if one was found since the last call.
    pub fn take_jump(&mut self) -> Option<[f64; 6]> {
        self.before_jump.take()
    }

    /// Initial standard deviations of accelerometer and gyro biases, m/s^2 and rad/s.
    #[must_use]
    pub fn bias_sigma_at_start(&self) -> [f64; 2] {
        let s = &self.settings;
        [s.accel_bias_sigma_m_s2, s.gyro_bias_sigma_rad_s]
    }

    /// Accelerometer bias, body axes, m/s^2.
    #[must_use]
    pub fn accel_bias(&self) -> Vector3<f64> {
        self.accel_bias
    }

    /// Gyro bias, body axes, rad/s.
    #[must_use]
    pub fn gyro_bias(&self) -> Vector3<f64> {
        self.gyro_bias
    }

    /// Standard deviations of the three errors from `first` on, such as [`GYRO_BIAS`].
    #[must_use]
    pub fn sigma(&self, first: usize) -> [f64; 3] {
        std::array::from_fn(|axis| self.covariance[(first + axis, first + axis)].sqrt())
    }

    /// Seconds since the last GNSS velocity that was used; infinite before the first.
    #[must_use]
    pub fn velocity_age_s(&self, now: LogTime) -> f64 {
        self.velocity_time
            .map_or(f64::INFINITY, |time| now.seconds_since(time))
    }

    /// Seconds since the last GNSS attitude that was used; infinite before the first.
    #[must_use]
    pub fn attitude_age_s(&self, now: LogTime) -> f64 {
        self.attitude_time
            .map_or(f64::INFINITY, |time| now.seconds_since(time))
    }

    /// Initial variances.
    fn start_variance(&self) -> SVector<f64, STATES> {
        let (s, t) = (&self.settings, &self.tuning);
        let mut sigma = SVector::<f64, STATES>::zeros();
        sigma
            .fixed_rows_mut::<2>(ATTITUDE)
            .fill(t.tilt_start_sigma_rad);
        sigma[ATTITUDE + 2] = t.heading_start_sigma_rad;
        sigma
            .fixed_rows_mut::<3>(VELOCITY)
            .fill(t.velocity_start_sigma_m_s);
        sigma
            .fixed_rows_mut::<3>(ACCEL_BIAS)
            .fill(s.accel_bias_sigma_m_s2.max(t.accel_bias_start_min_m_s2));
        sigma
            .fixed_rows_mut::<3>(GYRO_BIAS)
            .fill(s.gyro_bias_sigma_rad_s.max(t.gyro_bias_start_min_rad_s));
        sigma.component_mul(&sigma)
    }

    /// Forgets all that was learnt, for an inertial unit that was corrected.
    pub(crate) fn begin_again(&mut self) {
        self.restart();
        self.velocity_time = None;
        self.forget_attitude();
    }

    fn restart(&mut self) {
        let variance = self.start_variance();
        self.covariance = SMatrix::from_diagonal(&variance);
        self.trace.note(|| {
            Operation::Restart(Box::new(Restart {
                state: SVector::zeros(),
                variance,
            }))
        });
        self.earth_from_body = Rotation3::identity();
        self.velocity_m_s = Vector3::zeros();
        self.accel_bias = Vector3::zeros();
        self.gyro_bias = Vector3::zeros();
        self.heading_known = false;
        self.attitude_lost = false;
        self.levelled = false;
        self.set_acceptance(AcceptanceCounter::default());
        self.velocity_time = None;
        self.forget_attitude();
        self.history.clear();
    }

    /// Takes a reading of the inertial unit, body axes, calibration applied. `replaced_density` is
    /// the density of the error of replaced axes, (rad/s)/√Hz and (m/s^2)/√Hz.
    ///
    /// A reading that is not finite, out of a road vehicle's range, or not later than the last one
    /// is ignored.
    pub fn push_imu(
        &mut self,
        time: LogTime,
        force: Vector3<f64>,
        rate: Vector3<f64>,
        replaced_density: &Triads<[f64; 3]>,
    ) {
        let t = self.tuning;
        let good = force.iter().all(|f| f.abs() <= t.force_max_m_s2)
            && rate.iter().all(|w| w.abs() <= t.rate_max_rad_s);
        if !good || self.time.is_some_and(|last| time <= last) {
            return;
        }
        if !self.levelled {
            self.level(force);
        }
        let Some(last) = self.time else {
            self.begin(time, force, rate);
            return;
        };
        let gap_s = time.seconds_since(last);
        if self.imu_time.is_none() || gap_s > t.slope_interval_max_s {
            self.rate = rate;
            self.rate_dot = Vector3::zeros();
            self.force_dot = Vector3::zeros();
        } else {
            let weight = gap_s / (t.slope_time_s + gap_s);
            self.rate_dot += ((rate - self.rate) / gap_s - self.rate_dot) * weight;
            self.force_dot += ((force - self.force) / gap_s - self.force_dot) * weight;
        }
        let settings = &self.settings;
        // Readings are samples, so the trapezoidal rule integrates between two of them.
        let (mean_force, mean_rate) = if gap_s < t.mean_interval_max_s && self.imu_time.is_some() {
            ((force + self.force) * 0.5, (rate + self.rate) * 0.5)
        } else {
            (force, rate)
        };
        let density = settings.interval_s.max(1e-4).sqrt();
        // Between the readings beside a gap, the motion is as unknown as while the unit is silent.
        let is_gap = gap_s > t.gap_intervals * settings.interval_s || self.imu_time.is_none();
        let noise = if is_gap {
            // What is wrong after a gap comes from the gap: it is no sign of a jump.
            self.jumps = Jumps::new(t.jumps);
            [t.coast_accel_density, t.coast_rate_density]
        } else {
            [
                settings.accel_sigma_m_s2 * density,
                settings.gyro_sigma_rad_s * density,
            ]
        };
        self.propagate(gap_s, mean_force, mean_rate, noise);
        self.add_replaced_noise(gap_s, replaced_density);
        self.begin(time, force, rate);
    }

    /// Propagates the state to `now` while the inertial unit is silent.
    pub fn coast(&mut self, now: LogTime) {
        let Some(last) = self.time else {
            self.time = Some(now);
            return;
        };
        let gap_s = now.seconds_since(last);
        let t = self.tuning;
        if gap_s < t.silence_s {
            return;
        }
        self.imu_time = None;
        self.rate *= t.coast_rate_keep;
        self.rate_dot = Vector3::zeros();
        self.force_dot = Vector3::zeros();
        self.force =
            self.earth_from_body.inverse() * Vector3::z() * STANDARD_GRAVITY_M_S2 + self.accel_bias;
        let (force, rate) = (self.force, self.rate + self.gyro_bias);
        self.propagate(
            gap_s,
            force,
            rate,
            [t.coast_accel_density, t.coast_rate_density],
        );
        self.time = Some(now);
        self.remember(now);
    }

    /// Resets the biases: they were estimated in a wrong state.
    fn forget_biases(&mut self) {
        self.accel_bias = Vector3::zeros();
        self.gyro_bias = Vector3::zeros();
        let variance = self.start_variance();
        for i in ACCEL_BIAS..STATES {
            self.forget(i, variance[i]);
        }
    }

    /// Restarts from GNSS: attitude first, then velocity; the biases are reset.
    fn restart_from_gnss(&mut self) {
        self.resets += 1;
        self.forget_biases();
        self.attitude_lost = true;
        self.set_acceptance(AcceptanceCounter::adopted());
        self.velocity_time = None;
        self.forget_attitude();
    }

    fn forget_attitude(&mut self) {
        self.attitude_time = None;
        self.heading_run = [0.0; 2];
    }

    fn begin(&mut self, time: LogTime, force: Vector3<f64>, rate: Vector3<f64>) {
        self.force = force;
        self.rate = rate;
        self.time = Some(time);
        self.imu_time = Some(time);
        self.remember(time);
    }

    fn remember(&mut self, time: LogTime) {
        self.history.push(Pose {
            time,
            earth_from_body: self.earth_from_body,
            velocity_m_s: self.velocity_m_s,
            rate_rad_s: self.rate - self.gyro_bias,
        });
    }

    /// Sets roll and pitch from the specific force, if the unit may be at rest.
    fn level(&mut self, force: Vector3<f64>) {
        self.levelled = true;
        if (force.norm() / STANDARD_GRAVITY_M_S2 - 1.0).abs() > self.tuning.rest_tolerance {
            return;
        }
        let roll = math::atan2(force.y, force.z);
        let pitch = math::atan2(-force.x, math::hypot(force.y, force.z));
        let (_, _, yaw) = self.earth_from_body.euler_angles();
        self.earth_from_body = Rotation3::from_euler_angles(roll, pitch, yaw);
    }

    fn propagate(&mut self, span_s: f64, force: Vector3<f64>, rate: Vector3<f64>, noise: [f64; 2]) {
        let mut left_s = span_s.min(2.0);
        while left_s > 0.0 {
            let step_s = left_s.min(STEP_MAX_S);
            self.propagate_step(step_s, force, rate, noise);
            left_s -= step_s;
        }
    }

    fn propagate_step(
        &mut self,
        dt: f64,
        force: Vector3<f64>,
        rate: Vector3<f64>,
        noise: [f64; 2],
    ) {
        let turn = (rate - self.gyro_bias) * dt;
        let middle = self.earth_from_body * Rotation3::new(turn * 0.5);
        let earth_force = middle * (force - self.accel_bias);
        let gravity = Vector3::z() * STANDARD_GRAVITY_M_S2;
        self.velocity_m_s += (earth_force - gravity) * dt;
        self.turned_rad += (middle * turn).z;
        self.earth_from_body *= Rotation3::new(turn);
        self.earth_from_body = orthonormal(&self.earth_from_body);

        let flow = Flow {
            of_bias: -middle.into_inner() * dt,
            of_attitude: -earth_force.cross_matrix() * dt,
        };
        self.flow(&flow);
        self.jumps.propagate(self.time.unwrap_or_default(), &flow);
        let [accel_walk, gyro_walk] = [self.tuning.accel_bias_walk, self.tuning.gyro_bias_walk];
        let mut add = |first: usize, variance: f64| {
            for i in first..first + 3 {
                self.add_noise(i, i, variance * dt);
            }
        };
        add(ATTITUDE, noise[1] * noise[1]);
        add(VELOCITY, noise[0] * noise[0]);
        add(ACCEL_BIAS, accel_walk * accel_walk);
        add(GYRO_BIAS, gyro_walk * gyro_walk);
        self.tidy();
    }

    /// P = F P F' of the inertial equations.
    fn flow(&mut self, flow: &Flow) {
        let half = flow.times(self.covariance).transpose();
        self.covariance = flow.times(half);
        self.trace
            .note(|| Operation::mixed(&flow.times(SMatrix::identity())));
    }

    /// P = F P F'.
    fn mix(&mut self, f: &SMatrix<f64, STATES, STATES>) {
        self.covariance = f * self.covariance * f.transpose();
        self.trace.note(|| Operation::mixed(f));
    }

    /// Adds the noise of replaced axes of the inertial unit over a span.
    fn add_replaced_noise(&mut self, span_s: f64, replaced_density: &Triads<[f64; 3]>) {
        for (first, replaced_density) in [
            (ATTITUDE, replaced_density.rate),
            (VELOCITY, replaced_density.force),
        ] {
            for (axis, sigma) in replaced_density
                .into_iter()
                .enumerate()
                .filter(|(_, sigma)| *sigma > 0.0)
            {
                let along = self.earth_from_body.matrix().column(axis) * sigma;
                for i in 0..3 {
                    for j in i..3 {
                        self.add_noise(first + i, first + j, along[i] * along[j] * span_s);
                    }
                }
            }
        }
    }

    /// Adds `value` to an element of the covariance, and to its mirror image.
    fn add_noise(&mut self, row: usize, column: usize, value: f64) {
        self.covariance[(row, column)] += value;
        if row != column {
            self.covariance[(column, row)] += value;
        }
        self.trace
            .note(|| Operation::Noise(Term { row, column, value }));
    }

    /// Inflates the covariance along the signature of a jump, and attitude and velocity once more,
    /// since the instant of the jump is known only approximately.
    fn open(&mut self, errors: &SVector<f64, STATES>) {
        let mut late = errors * self.tuning.jump_time_part;
        late.fixed_rows_mut::<6>(ACCEL_BIAS).fill(0.0);
        for i in 0..STATES {
            for j in i..STATES {
                self.add_noise(i, j, errors[i] * errors[j] + late[i] * late[j]);
            }
        }
    }

    /// Makes an error independent of all others, with this variance.
    fn forget(&mut self, i: usize, variance: f64) {
        self.covariance.fill_row(i, 0.0);
        self.covariance.fill_column(i, 0.0);
        self.covariance[(i, i)] = variance;
        self.jumps = Jumps::new(self.tuning.jumps);
        self.trace.note(|| Operation::Forget { index: i, variance });
    }

    /// Keeps the covariance symmetric and bounded, and restarts the filter if a number is not
    /// finite.
    fn tidy(&mut self) {
        self.covariance = (self.covariance + self.covariance.transpose()) * 0.5;
        for i in 0..STATES {
            let bound = VARIANCE_MAX[i / 3];
            let variance = self.covariance[(i, i)];
            if variance > bound {
                // Scaling row and column keeps it positive semi-definite.
                let mut scale = SMatrix::identity();
                scale[(i, i)] = (bound / variance).sqrt();
                self.mix(&scale);
            }
        }
        let finite = self.covariance.iter().all(|p| p.is_finite())
            && self.velocity_m_s.iter().all(|v| v.abs() < 1e3)
            && self.earth_from_body.matrix().iter().all(|r| r.is_finite());
        if !finite {
            self.resets += 1;
            self.restart();
        }
    }

    /// The motion at `now`, extrapolated from the last reading by at most 50 ms.
    #[must_use]
    pub fn state(&self, now: LogTime) -> MotionState {
        self.solution().state(now)
    }

    /// Nominal state and covariance at the last reading.
    #[must_use]
    pub fn solution(&self) -> Solution {
        Solution {
            time: self.time,
            earth_from_body: self.earth_from_body,
            velocity_m_s: self.velocity_m_s,
            accel_bias: self.accel_bias,
            gyro_bias: self.gyro_bias,
            covariance: self.covariance,
            rate: self.rate,
            rate_dot: self.rate_dot,
            force: self.force,
            force_dot: self.force_dot,
            imu_m: self.settings.imu_m,
            inertial: self.imu_time.is_some(),
        }
    }

    /// Other positions of the inertial unit and the antennas from the centre of gravity, which has
    /// moved.
    pub fn place(&mut self, imu_m: Vector3<f64>, antenna_m: [Vector3<f64>; 2]) {
        (self.settings.imu_m, self.settings.antenna_m) = (imu_m, antenna_m);
    }

    /// Starts recording operations for [`Self::take_operations`].
    pub fn switch_trace_on(&mut self) {
        self.trace.switch_on();
    }

    /// The operations since the last call.
    pub fn take_operations(&mut self) -> Vec<Operation<STATES>> {
        self.trace.take()
    }
}

/// The angle within (-pi, pi].
pub(crate) fn wrap(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    let turned = (angle + PI).rem_euclid(TAU) - PI;
    if turned == -PI { PI } else { turned }
}

/// The rotation nearest to one with rounding errors.
fn orthonormal(r: &Rotation3<f64>) -> Rotation3<f64> {
    let m = r.matrix();
    let x = m.column(0).normalize();
    let z = x.cross(&m.column(1)).normalize();
    Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, z.cross(&x), z]))
}

/// Cross-product matrix.
fn cross(v: Vector3<f64>) -> Matrix3<f64> {
    v.cross_matrix()
}
