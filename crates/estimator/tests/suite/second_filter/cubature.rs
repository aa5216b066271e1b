//! Motion by points instead of derivatives: the inertial equations integrated for each of 24 points
//! that have the estimate's mean and covariance (I. Arasaratnam, S. Haykin, "Cubature Kalman
//! filters", IEEE Trans. Automatic Control 54 (2009) 1254-1269). Late measurements are taken in at
//! the instant that they are for, and what came after is done again.

use atvrec_estimator::motion::{
    ACCEL_BIAS, ATTITUDE, GYRO_BIAS, MotionFilter, MotionSettings, STATES, Solution, VELOCITY,
    VelocityReceiver,
};
use atvrec_estimator::triads::Triads;
use atvrec_estimator::tuning::MotionTuning;
use model::sensors::Sensors;
use nalgebra::{Rotation3, SMatrix, SVector, UnitQuaternion, Vector3};
use sample::{ImuSample, LogTime, Measurement, STANDARD_GRAVITY_M_S2, Sample};
use testkit::{sensing, truth};

/// From when to when both filters run, s: the second begins with what the first knows then.
const SPAN_S: [f64; 2] = [3.0, 45.0];
/// What the second has forgotten its beginning after, s.
const FORGOTTEN_S: f64 = 5.0;
/// Time between two comparisons, s.
const EACH_S: f64 = 0.5;
/// No measurement is later than this, s.
const LATEST_S: f64 = 0.08;
/// Walk of the biases, (m/s^2)/sqrt(s) and (rad/s)/sqrt(s).
const BIAS_WALK: [f64; 2] = [1e-3, 3e-5];

/// Largest difference, as a part of a deviation, and of the deviations as a part of one another: of
/// the lag's neglected dynamics, and of what was late when the second began.
const APART_MAX: f64 = 0.2;
const RATIO_MAX: f64 = 0.05;

type Error = SVector<f64, STATES>;
type Covariance = SMatrix<f64, STATES, STATES>;

/// What differed at most, by attitude, velocity, accelerometer and gyro bias.
#[derive(Debug, Default)]
pub struct Found {
    pub instants: usize,
    pub apart: [f64; 4],
    pub ratio: [f64; 4],
}

impl Found {
    pub fn same(&self) -> bool {
        self.apart.iter().all(|apart| *apart < APART_MAX)
            && self.ratio.iter().all(|ratio| *ratio < RATIO_MAX)
    }

    pub fn assert_same(&self, name: &str) {
        assert!(self.same(), "{name}: {self:?}");
    }
}

/// The production filter against points on an excerpt, whose gravity is `gravity` times the
/// standard.
pub fn compare(name: &str, gravity: f64) -> Found {
    let sensors = Sensors::builtin("thesis-10bit").unwrap();
    let mut samples = truth::excerpt(name).samples("thesis-10bit", 1).to_vec();
    samples.retain(|sample| !matches!(sample.measurement, Measurement::Corner(_)));
    let settings = settings(&sensors);
    let mut first = MotionFilter::new(settings.clone(), &MotionTuning::default());
    let mut second: Option<Points> = None;
    let mut by_truth = samples.clone();
    by_truth.sort_by_key(|sample| sample.valid_time);
    let mut found = Found::default();
    let [mut next_s, end_s] = SPAN_S;
    for sample in &samples {
        let now = sample.log_time;
        let now_s = now.seconds_since(sensing::START);
        if now_s > end_s {
            break;
        }
        give(&mut first, sample);
        if now_s < next_s || !matches!(sample.measurement, Measurement::Imu(_)) {
            continue;
        }
        next_s += EACH_S;
        let here = first.solution();
        let Some(second) = &mut second else {
            second = Some(Points::new(&here, &settings, gravity));
            continue;
        };
        let at = here.time.unwrap();
        second.take(&by_truth, LogTime(now.0 - (1e9 * LATEST_S) as u64), now);
        let mut ahead = second.clone();
        ahead.take(&by_truth, at, now);
        if now_s > SPAN_S[0] + FORGOTTEN_S {
            note(&mut found, &here, &ahead);
        }
    }
    found
}

fn note(found: &mut Found, first: &Solution, second: &Points) {
    found.instants += 1;
    let apart = second.centre.error_of(&Centre::of(first));
    for i in 0..STATES {
        let sigma = first.covariance[(i, i)].sqrt();
        let of_second = second.covariance[(i, i)].sqrt();
        let [worst, ratio] = [&mut found.apart[i / 3], &mut found.ratio[i / 3]];
        *worst = worst.max(apart[i].abs() / sigma);
        *ratio = ratio.max((of_second / sigma - 1.0).abs());
    }
}

fn settings(sensors: &Sensors) -> MotionSettings {
    let imu = &sensors.imu;
    MotionSettings {
        interval_s: 1.0 / imu.rate_hz,
        accel_sigma_m_s2: imu.accel_noise_m_s2,
        gyro_sigma_rad_s: imu.gyro_noise_rad_s,
        accel_bias_sigma_m_s2: imu.accel_bias_m_s2,
        gyro_bias_sigma_rad_s: imu.gyro_bias_rad_s,
        imu_m: Vector3::from(imu.position_m),
        antenna_m: [Vector3::from(sensors.gnss_velocity.antenna_m); 2],
        velocity_sigma_m_s: sensors.gnss_velocity.velocity_noise_m_s,
        heading_sigma_rad: sensors.gnss_attitude.heading_noise_rad,
        tilt_sigma_rad: sensors.gnss_attitude.roll_pitch_noise_rad,
    }
}

fn give(filter: &mut MotionFilter, sample: &Sample) {
    let time = sample.valid_time;
    match &sample.measurement {
        Measurement::Imu(imu) => filter.push_imu(
            time,
            Vector3::from(imu.specific_force_m_s2),
            Vector3::from(imu.angular_rate_rad_s),
            &Triads::default(),
        ),
        Measurement::GnssVelocity(gnss) => {
            let velocity = Vector3::from(gnss.velocity_enu_m_s);
            let _ = filter.push_velocity(time, VelocityReceiver::Own, velocity, None);
        }
        Measurement::GnssAttitude(gnss) => {
            let angles = [gnss.yaw_rad, gnss.pitch_rad, gnss.roll_rad];
            let _ = filter.push_attitude(time, angles, None);
        }
        _ => {}
    }
}

/// Attitude, velocity and biases of one point.
#[derive(Clone, Copy)]
struct Centre {
    earth_from_body: Rotation3<f64>,
    velocity: Vector3<f64>,
    accel_bias: Vector3<f64>,
    gyro_bias: Vector3<f64>,
}

impl Centre {
    fn of(solution: &Solution) -> Self {
        Self {
            earth_from_body: solution.earth_from_body,
            velocity: solution.velocity_m_s,
            accel_bias: solution.accel_bias,
            gyro_bias: solution.gyro_bias,
        }
    }

    /// The point whose error from here is this.
    fn with(&self, error: &Error) -> Self {
        let part = |first: usize| error.fixed_rows::<3>(first).into_owned();
        Self {
            earth_from_body: Rotation3::new(part(ATTITUDE)) * self.earth_from_body,
            velocity: self.velocity + part(VELOCITY),
            accel_bias: self.accel_bias + part(ACCEL_BIAS),
            gyro_bias: self.gyro_bias + part(GYRO_BIAS),
        }
    }

    /// The error of a point from here.
    fn error_of(&self, other: &Self) -> Error {
        let turn = other.earth_from_body * self.earth_from_body.inverse();
        let mut error = Error::zeros();
        // An axis of the matrix itself is not a number where it hardly turns.
        let turn = UnitQuaternion::from_rotation_matrix(&turn).scaled_axis();
        error.fixed_rows_mut::<3>(ATTITUDE).copy_from(&turn);
        let velocity = other.velocity - self.velocity;
        error.fixed_rows_mut::<3>(VELOCITY).copy_from(&velocity);
        let bias = other.accel_bias - self.accel_bias;
        error.fixed_rows_mut::<3>(ACCEL_BIAS).copy_from(&bias);
        let bias = other.gyro_bias - self.gyro_bias;
        error.fixed_rows_mut::<3>(GYRO_BIAS).copy_from(&bias);
        error
    }

    /// Over `dt` with readings (force, rate) that change evenly, by four slopes of Runge and Kutta
    /// for the velocity and the middle rate for the attitude.
    fn carry(&mut self, dt: f64, from: &Reading, to: &Reading, gravity: f64) {
        let rate = (from.rate + to.rate) * 0.5 - self.gyro_bias;
        let slope = |part: f64| {
            let turn = (from.rate - self.gyro_bias) * part * dt
                + (to.rate - from.rate) * (0.5 * part * part * dt);
            let force = from.force.lerp(&to.force, part) - self.accel_bias;
            self.earth_from_body * Rotation3::new(turn) * force
                - Vector3::z() * (gravity * STANDARD_GRAVITY_M_S2)
        };
        self.velocity += (slope(0.0) + slope(0.5) * 4.0 + slope(1.0)) * (dt / 6.0);
        self.earth_from_body *= Rotation3::new(rate * dt);
    }
}

/// A reading of the inertial unit.
#[derive(Clone, Copy)]
struct Reading {
    time: LogTime,
    force: Vector3<f64>,
    rate: Vector3<f64>,
}

impl Reading {
    fn of(time: LogTime, imu: &ImuSample) -> Self {
        Self {
            time,
            force: Vector3::from(imu.specific_force_m_s2),
            rate: Vector3::from(imu.angular_rate_rad_s),
        }
    }

    fn at(&self, next: &Self, time: LogTime) -> Self {
        let part = time.seconds_since(self.time) / next.time.seconds_since(self.time);
        Self {
            time,
            force: self.force.lerp(&next.force, part),
            rate: self.rate.lerp(&next.rate, part),
        }
    }
}

/// The filter: as far as `time`, with the reading there.
#[derive(Clone)]
pub struct Points {
    settings: MotionSettings,
    gravity: f64,
    centre: Centre,
    covariance: Covariance,
    reading: Reading,
}

impl Points {
    fn new(solution: &Solution, settings: &MotionSettings, gravity: f64) -> Self {
        Self {
            settings: settings.clone(),
            gravity,
            centre: Centre::of(solution),
            covariance: solution.covariance,
            reading: Reading {
                time: solution.time.unwrap(),
                force: solution.force,
                rate: solution.rate,
            },
        }
    }

    /// Takes in, by their own time, samples as far as `until` that have arrived by `now`.
    fn take(&mut self, by_truth: &[Sample], until: LogTime, now: LogTime) {
        let begin = self.reading.time;
        let span = begin.0 + 1..=until.0;
        let of_imu = |sample: &Sample| match &sample.measurement {
            Measurement::Imu(imu) => Some(Reading::of(sample.valid_time, imu)),
            _ => None,
        };
        let first = by_truth.partition_point(|sample| sample.valid_time <= begin);
        for (k, sample) in by_truth.iter().enumerate().skip(first) {
            if !span.contains(&sample.valid_time.0) {
                break;
            }
            if sample.log_time > now {
                continue;
            }
            let Some(next) = by_truth[k..].iter().find_map(of_imu) else {
                break;
            };
            self.carry(&self.reading.at(&next, sample.valid_time));
            self.measure(sample);
        }
    }

    fn points(&self) -> Vec<Centre> {
        let root = self.covariance.cholesky().expect("positive").unpack() * (STATES as f64).sqrt();
        let columns = root.column_iter().map(|column| column.into_owned());
        columns
            .flat_map(|error| [self.centre.with(&error), self.centre.with(&-error)])
            .collect()
    }

    fn carry(&mut self, to: &Reading) {
        let dt = to.time.seconds_since(self.reading.time);
        if dt <= 0.0 {
            return;
        }
        let mut points = self.points();
        for point in &mut points {
            point.carry(dt, &self.reading, to, self.gravity);
        }
        self.centre.carry(dt, &self.reading, to, self.gravity);
        self.centre = mean(&self.centre, &points);
        let errors: Vec<Error> = points.iter().map(|p| self.centre.error_of(p)).collect();
        self.covariance =
            errors.iter().map(|e| e * e.transpose()).sum::<Covariance>() / errors.len() as f64;
        let s = &self.settings;
        let noise = [
            s.gyro_sigma_rad_s.powi(2) * s.interval_s,
            s.accel_sigma_m_s2.powi(2) * s.interval_s,
            BIAS_WALK[0].powi(2),
            BIAS_WALK[1].powi(2),
        ];
        for i in 0..STATES {
            self.covariance[(i, i)] += noise[i / 3] * dt;
        }
        self.reading = *to;
    }

    fn measure(&mut self, sample: &Sample) {
        let s = &self.settings;
        let arm = s.antenna_m[0] - s.imu_m;
        let rate = self.reading.rate;
        match &sample.measurement {
            Measurement::GnssVelocity(gnss) => {
                let sigma = [s.velocity_sigma_m_s; 3];
                self.update(Vector3::from(gnss.velocity_enu_m_s), sigma, |point| {
                    let swing = (rate - point.gyro_bias).cross(&arm);
                    point.velocity + point.earth_from_body * swing
                });
            }
            Measurement::GnssAttitude(gnss) => {
                let angles = [gnss.roll_rad, gnss.pitch_rad, gnss.yaw_rad];
                let sigma = [s.tilt_sigma_rad, s.tilt_sigma_rad, s.heading_sigma_rad];
                let value = Vector3::from(angles.map(Option::unwrap));
                self.update(value, sigma, |point| {
                    let (roll, pitch, yaw) = point.earth_from_body.euler_angles();
                    Vector3::new(roll, pitch, value.z - turned(value.z - yaw))
                });
            }
            _ => {}
        }
    }

    fn update(
        &mut self,
        value: Vector3<f64>,
        sigma: [f64; 3],
        see: impl Fn(&Centre) -> Vector3<f64>,
    ) {
        let points = self.points();
        let count = points.len() as f64;
        let seen: Vec<Vector3<f64>> = points.iter().map(&see).collect();
        let expected = seen.iter().sum::<Vector3<f64>>() / count;
        let mut total = SMatrix::<f64, 3, 3>::from_diagonal(&Vector3::from(sigma.map(|s| s * s)));
        let mut across = SMatrix::<f64, STATES, 3>::zeros();
        for (point, seen) in points.iter().zip(&seen) {
            let apart = seen - expected;
            total += apart * apart.transpose() / count;
            across += self.centre.error_of(point) * apart.transpose() / count;
        }
        let gain = across * total.try_inverse().expect("noise");
        self.covariance -= gain * total * gain.transpose();
        self.centre = self.centre.with(&(gain * (value - expected)));
    }
}

/// The angle within half a turn.
fn turned(angle: f64) -> f64 {
    math::atan2(math::sin(angle), math::cos(angle))
}

/// The point from which the points' errors are zero on average.
fn mean(near: &Centre, points: &[Centre]) -> Centre {
    let mut centre = *near;
    for _ in 0..3 {
        let sum: Error = points.iter().map(|point| centre.error_of(point)).sum();
        centre = centre.with(&(sum / points.len() as f64));
    }
    centre
}
