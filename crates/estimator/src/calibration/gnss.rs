//! Antenna places and latencies of GNSS receivers, from a drive with turns and the inertial unit.
//!
//! A filter carries the inertial unit's attitude R and velocity v through the drive, and with them
//! what a receiver's readings hang on:
//!
//! velocity read = v + R (w x r) - tau_v d/dt(v + R (w x r)), attitude read = R - tau_a dR/dt + offset
//!
//! with the lever arm r from unit to antenna, the latencies tau that the stamps still hold, and what
//! the attitude antennas' mounting adds; a milliradian of the unit's misalignment stays open, as
//! `imu` leaves it. Lever arm and latency are constants of the filter, so that what it says at the
//! end is what the whole drive says. It is run several times, each time at the instants that the
//! latencies found so far give.

use model::sensors::Sensors;
use nalgebra::{Matrix3, Rotation3, SMatrix, SVector, Vector3};
use sample::STANDARD_GRAVITY_M_S2;

use super::GnssCalibration;
use super::imu::ImuSignal;
use crate::finding::{Excitation, Figure, Finding, Findings, Refusal, Series, Span};
use crate::regression::whiteness;

/// States: turn of earth axes, velocity, accelerometer and gyro bias, lever arm, latency of
/// velocity and of attitude, what the mounting adds to yaw, pitch and roll, what is left of the
/// inertial unit's misalignment.
const N: usize = 23;
const TURN: usize = 0;
const VELOCITY: usize = 3;
const ACCEL_BIAS: usize = 6;
const GYRO_BIAS: usize = 9;
const LEVER: usize = 12;
const VELOCITY_LATENCY: usize = 15;
const ATTITUDE_LATENCY: usize = 16;
const OFFSET: usize = 17;
const MISALIGNMENT: usize = 20;

/// Passes over the drive.
const PASSES: usize = 3;
/// Half of the time that a rate is averaged over, s.
const RATE_HALF_S: f64 = 0.025;
/// What is known beforehand, standard deviations in the order of the states.
const PRIOR: [f64; 9] = [0.1, 1.0, 0.15, 0.02, 0.7, 0.1, 0.1, 0.15, 1e-3];
/// A reading further off than this many deviations is left out.
const GATE: f64 = 6.0;
/// Least driving, s.
const NEEDED_S: f64 = 20.0;
/// Greatest deviations with which a place (x, y) and a latency count as found, m and s.
const PLACE_SIGMA_M: f64 = 0.04;
const LATENCY_SIGMA_S: f64 = 0.004;
/// Deviation up to which the height of an antenna counts as found, m.
const HEIGHT_SIGMA_M: f64 = 0.05;

/// Vectors at instants.
#[derive(Clone, Copy, Debug, Default)]
pub struct Vectors<'a> {
    /// Instants, s, rising.
    pub time_s: &'a [f64],
    /// Values; `NaN` where there is none.
    pub value: &'a [[f64; 3]],
}

/// A drive with the readings of one receiver's velocity and of the attitude receiver.
#[derive(Clone, Copy, Debug)]
pub struct GnssInput<'a> {
    /// Name of the velocity's receiver, for messages.
    pub receiver: &'a str,
    /// Inertial unit, bias and misalignment taken off: body axes.
    pub imu: ImuSignal<'a>,
    /// Velocity of the antenna, east, north, up, m/s, at the instants that the stamps say.
    pub velocity: Vectors<'a>,
    /// Yaw, pitch and roll, rad, at the instants that the stamps say.
    pub attitude: Vectors<'a>,
    /// Standard deviation of a velocity component, m/s, and of yaw, pitch and roll, rad.
    pub sigma: [f64; 4],
    /// Standard deviation of a reading of specific force, m/s^2, and of rate, rad/s.
    pub imu_sigma: [f64; 2],
    /// Place of the inertial unit from the centre of gravity, body axes, m.
    pub imu_m: [f64; 3],
    /// Place of the antenna as it is known so far, m.
    pub antenna_m: [f64; 3],
}

/// [`GnssInput::sigma`] by a sensors file.
#[must_use]
pub const fn sigma_of(sensors: &Sensors) -> [f64; 4] {
    let attitude = &sensors.gnss_attitude;
    [
        sensors.gnss_velocity.velocity_noise_m_s,
        attitude.heading_noise_rad,
        attitude.roll_pitch_noise_rad,
        attitude.roll_pitch_noise_rad,
    ]
}

/// What was found of one receiver.
#[derive(Clone, Debug, PartialEq)]
pub struct GnssFound {
    /// Place, latencies and mounting with their deviations.
    pub findings: Findings,
    /// The velocity antenna's place and latency.
    pub velocity: GnssCalibration,
    /// Latency and mounting of the attitude, with the antenna's place unknown.
    pub attitude: GnssCalibration,
}

/// Finds place and latency of a receiver's antenna.
///
/// # Errors
/// No velocity, no attitude, too short a drive, or one whose turns do not tell place and latency.
pub fn gnss(input: &GnssInput<'_>) -> Result<GnssFound, Refusal> {
    let what = format!("gnss {}", input.receiver);
    check(input).map_err(|refusal| refusal.of(&what))?;
    let mut pass = Pass::run(input, [0.0; 2], [0.0; 3])?;
    for _ in 1..PASSES {
        let state = pass.parameters;
        let latency = [state[VELOCITY_LATENCY], state[ATTITUDE_LATENCY]];
        let lever = [state[LEVER], state[LEVER + 1], state[LEVER + 2]];
        pass = Pass::run(input, latency, lever)?;
    }
    pass.found(input, &what)
}

fn check(input: &GnssInput<'_>) -> Result<(), Refusal> {
    let lacking = |channel: &str, help: &str| {
        Err(Refusal::Missing {
            what: String::new(),
            channel: channel.to_owned(),
            help: help.to_owned(),
        })
    };
    let known = |vectors: &Vectors<'_>, least: usize| {
        let finite = vectors.value.iter().filter(|v| v[0].is_finite());
        finite.take(least).count() == least
    };
    if input.imu.time_s.len() < 100 {
        return lacking(
            "inertial unit",
            "record the inertial unit with the receivers",
        );
    }
    if !known(&input.velocity, 20) {
        return lacking("GNSS velocity", "record a drive with a valid solution");
    }
    if !known(&input.attitude, 20) {
        return lacking(
            "GNSS attitude",
            "heading must be measured; record the attitude receiver in the same drive",
        );
    }
    let span_s = input.imu.time_s[input.imu.time_s.len() - 1] - input.imu.time_s[0];
    if span_s < NEEDED_S {
        return Err(Refusal::TooShort {
            what: String::new(),
            found_s: span_s,
            needed_s: NEEDED_S,
            help: "drive a minute with turns to both sides at changing speed".to_owned(),
        });
    }
    Ok(())
}

/// One pass of the filter over the drive.
struct Pass {
    /// Constants at the end, whole values.
    parameters: SVector<f64, N>,
    covariance: SMatrix<f64, N, N>,
    /// Instants and normalised innovations of velocity, horizontal.
    innovations: Vec<[f64; 3]>,
    left_out: usize,
    used: usize,
    span_s: [f64; 2],
    yaw_rate_rms: f64,
}

/// What is read when.
#[derive(Clone, Copy)]
enum Reading {
    Velocity([f64; 3]),
    Attitude([f64; 3]),
}

/// The filter between two readings.
struct Filter {
    earth_from_body: Rotation3<f64>,
    velocity: Vector3<f64>,
    accel_bias: Vector3<f64>,
    gyro_bias: Vector3<f64>,
    lever: Vector3<f64>,
    /// Latencies beyond those that the instants are moved by already.
    latency: [f64; 2],
    offset: Vector3<f64>,
    /// Small turn m from body to sensor axes beyond the one that is taken off: f + m x f, w + m x w
    /// are read.
    misalignment: Vector3<f64>,
    covariance: SMatrix<f64, N, N>,
}

impl Pass {
    fn run(input: &GnssInput<'_>, latency_s: [f64; 2], lever_m: [f64; 3]) -> Result<Self, Refusal> {
        let events = events(input, latency_s);
        let start = first_attitude(&events);
        let mut filter = Filter::new(start, &events, lever_m);
        let imu = &input.imu;
        let mut now_s = imu.time_s[0].max(start.0);
        let mut sample = imu.time_s.partition_point(|&t| t <= now_s).max(1) - 1;
        let (mut innovations, mut left_out, mut used) = (Vec::new(), 0, 0);
        let mut turned = 0.0;
        for (time_s, reading) in &events {
            if *time_s < now_s || *time_s >= imu.time_s[imu.time_s.len() - 1] {
                continue;
            }
            while now_s < *time_s {
                while sample + 2 < imu.time_s.len() && imu.time_s[sample + 1] <= now_s {
                    sample += 1;
                }
                let until_s = time_s.min(imu.time_s[sample + 1]);
                let at_s = 0.5 * (now_s + until_s);
                let (force, rate) = between(imu, sample, at_s);
                filter.propagate(until_s - now_s, force, rate, input.imu_sigma);
                turned += rate.z * rate.z * (until_s - now_s);
                now_s = until_s;
            }
            let motion = Motion::at(imu, *time_s);
            match reading {
                Reading::Velocity(velocity) => {
                    match filter.push_velocity(velocity, &motion, input.sigma[0]) {
                        Some([east, north]) => innovations.push([*time_s, east, north]),
                        None => left_out += 1,
                    }
                }
                Reading::Attitude(angles) => {
                    filter.push_attitude(angles, &motion, input.sigma);
                }
            }
            used += 1;
        }
        let begin_s = imu.time_s[0].max(start.0);
        Ok(Self {
            parameters: filter.parameters(latency_s),
            covariance: filter.covariance,
            innovations,
            left_out,
            used,
            span_s: [begin_s, now_s],
            yaw_rate_rms: (turned / (now_s - begin_s).max(1e-9)).sqrt(),
        })
    }

    fn sigma(&self, state: usize) -> f64 {
        self.covariance[(state, state)].max(0.0).sqrt()
    }

    fn found(&self, input: &GnssInput<'_>, what: &str) -> Result<GnssFound, Refusal> {
        let unsure = [LEVER, LEVER + 1]
            .into_iter()
            .map(|state| (self.sigma(state), PLACE_SIGMA_M, "antenna's place", "m"))
            .chain([(
                self.sigma(VELOCITY_LATENCY),
                LATENCY_SIGMA_S,
                "latency",
                "s",
            )])
            .find(|(sigma, most, ..)| sigma > most);
        if let Some((sigma, most, name, unit)) = unsure {
            return Err(Refusal::NotExcited {
                what: what.to_owned(),
                quantity: format!("certainty (1/sigma) of the {name}"),
                found: 1.0 / sigma,
                needed: 1.0 / most,
                unit: format!("1/{unit}"),
                help: "drive a minute with quick turns to both sides, braking and speeding up"
                    .to_owned(),
            });
        }
        let p = &self.parameters;
        let span = Span {
            from_s: self.span_s[0],
            to_s: self.span_s[1],
            used_s: self.span_s[1] - self.span_s[0],
            rows: self.used,
        };
        let east: Vec<f64> = self.innovations.iter().map(|row| row[1]).collect();
        let white = whiteness(&east);
        let finding = |name: &str, state: usize, base: f64, unit: &str| {
            let (value, sigma) = (base + p[state], self.sigma(state));
            Finding {
                name: format!("{} {name}", input.receiver),
                value,
                unit: unit.to_owned(),
                sigma,
                interval: Some([value - 1.96 * sigma, value + 1.96 * sigma]),
                condition: self.condition(),
                excitation: Some(Excitation {
                    rms: self.yaw_rate_rms,
                    unit: "rad/s".to_owned(),
                }),
                whiteness: Some(white),
                span,
            }
        };
        let mut findings = Findings {
            what: what.to_owned(),
            ..Findings::default()
        };
        let mut antenna_m = input.antenna_m;
        for (axis, name) in ["antenna x", "antenna y", "antenna z"]
            .into_iter()
            .enumerate()
        {
            let found = finding(name, LEVER + axis, input.imu_m[axis], "m");
            if axis == 2 && found.sigma > HEIGHT_SIGMA_M {
                findings.notes.push(format!(
                    "{what}: the antenna's height is known to {:.2} m only (roll and pitch move it \
                     little); the one that was known is kept",
                    found.sigma
                ));
            } else {
                antenna_m[axis] = found.value;
            }
            findings.findings.push(found);
        }
        findings.findings.extend([
            finding("velocity latency", VELOCITY_LATENCY, 0.0, "s"),
            finding("attitude latency", ATTITUDE_LATENCY, 0.0, "s"),
            finding("attitude yaw offset", OFFSET, 0.0, "rad"),
            finding("attitude pitch offset", OFFSET + 1, 0.0, "rad"),
            finding("attitude roll offset", OFFSET + 2, 0.0, "rad"),
        ]);
        findings.beside = vec![
            (
                "velocities left out".to_owned(),
                self.left_out as f64,
                "-".to_owned(),
            ),
            (
                "mean square of normalised innovations".to_owned(),
                self.innovation_square(),
                "-".to_owned(),
            ),
        ];
        findings.figures.push(self.figure(input));
        Ok(GnssFound {
            findings,
            velocity: GnssCalibration {
                antenna_m: Some(antenna_m),
                latency_s: Some(p[VELOCITY_LATENCY]),
                attitude_offset_rad: [0.0; 3],
            },
            attitude: GnssCalibration {
                antenna_m: None,
                latency_s: Some(p[ATTITUDE_LATENCY]),
                attitude_offset_rad: [p[OFFSET], p[OFFSET + 1], p[OFFSET + 2]],
            },
        })
    }

    /// Condition number of the correlation of place and latency.
    fn condition(&self) -> f64 {
        let sigma = SVector::<f64, 4>::from_fn(|i, _| self.sigma(LEVER + i));
        let block = self.covariance.fixed_view::<4, 4>(LEVER, LEVER);
        let correlation =
            SMatrix::<f64, 4, 4>::from_fn(|i, j| block[(i, j)] / (sigma[i] * sigma[j]));
        let values = correlation.symmetric_eigenvalues();
        (values.max() / values.min().max(1e-12)).sqrt()
    }

    fn innovation_square(&self) -> f64 {
        let sum: f64 = self
            .innovations
            .iter()
            .map(|row| row[1] * row[1] + row[2] * row[2])
            .sum();
        sum / (2 * self.innovations.len()).max(1) as f64
    }

    fn figure(&self, input: &GnssInput<'_>) -> Figure {
        let column = |k: usize| {
            self.innovations
                .iter()
                .map(|row| row[k])
                .collect::<Vec<f64>>()
        };
        let series = |name: &str, k: usize| Series {
            name: name.to_owned(),
            line: false,
            x: column(0),
            y: column(k),
        };
        Figure {
            title: format!(
                "{}: what the velocity differs from what was expected",
                input.receiver
            ),
            x_label: "time (s)".to_owned(),
            y_label: "innovation over its deviation".to_owned(),
            series: vec![series("east", 1), series("north", 2)],
        }
    }
}

/// All readings in the order of the instants that they are taken for.
fn events(input: &GnssInput<'_>, latency_s: [f64; 2]) -> Vec<(f64, Reading)> {
    let velocity = input.velocity.time_s.iter().zip(input.velocity.value);
    let attitude = input.attitude.time_s.iter().zip(input.attitude.value);
    let finite = |value: &[f64; 3]| value.iter().all(|v| v.is_finite());
    let mut events: Vec<(f64, Reading)> = velocity
        .filter(|(_, value)| finite(value))
        .map(|(time_s, value)| (time_s - latency_s[0], Reading::Velocity(*value)))
        .chain(
            attitude
                .filter(|(_, value)| value[0].is_finite())
                .map(|(time_s, value)| (time_s - latency_s[1], Reading::Attitude(*value))),
        )
        .collect();
    events.sort_by(|a, b| a.0.total_cmp(&b.0));
    events
}

fn first_attitude(events: &[(f64, Reading)]) -> (f64, [f64; 3]) {
    let mut attitudes = events.iter().filter_map(|(time_s, reading)| match reading {
        Reading::Attitude(angles) => Some((*time_s, *angles)),
        Reading::Velocity(_) => None,
    });
    attitudes.next().unwrap_or((0.0, [0.0; 3]))
}

/// Specific force and rate at `at_s`, linear between the samples `k` and `k + 1`.
fn between(imu: &ImuSignal<'_>, k: usize, at_s: f64) -> (Vector3<f64>, Vector3<f64>) {
    let span_s = imu.time_s[k + 1] - imu.time_s[k];
    let part = ((at_s - imu.time_s[k]) / span_s).clamp(0.0, 1.0);
    let mix = |values: &[[f64; 3]]| {
        let (a, b) = (Vector3::from(values[k]), Vector3::from(values[k + 1]));
        a + (b - a) * part
    };
    (mix(imu.force_m_s2), mix(imu.rate_rad_s))
}

/// Rate, its derivative and specific force about an instant.
struct Motion {
    force: Vector3<f64>,
    rate: Vector3<f64>,
    rate_dot: Vector3<f64>,
}

impl Motion {
    fn at(imu: &ImuSignal<'_>, time_s: f64) -> Self {
        let over = |from_s: f64, to_s: f64, values: &[[f64; 3]]| -> Vector3<f64> {
            Vector3::from_fn(|axis, _| {
                let first = imu.time_s.partition_point(|&t| t < from_s);
                let last = imu.time_s.partition_point(|&t| t <= to_s).max(first + 1);
                let rows = first.min(values.len() - 1)..last.min(values.len());
                let count = rows.len().max(1) as f64;
                rows.map(|k| values[k][axis]).sum::<f64>() / count
            })
        };
        let (before, after) = (time_s - 2.0 * RATE_HALF_S, time_s + 2.0 * RATE_HALF_S);
        Self {
            force: over(time_s - RATE_HALF_S, time_s + RATE_HALF_S, imu.force_m_s2),
            rate: over(time_s - RATE_HALF_S, time_s + RATE_HALF_S, imu.rate_rad_s),
            rate_dot: (over(time_s, after, imu.rate_rad_s) - over(before, time_s, imu.rate_rad_s))
                / (2.0 * RATE_HALF_S),
        }
    }
}

impl Filter {
    fn new(start: (f64, [f64; 3]), events: &[(f64, Reading)], lever_m: [f64; 3]) -> Self {
        let [yaw, pitch, roll] = start
            .1
            .map(|angle| if angle.is_finite() { angle } else { 0.0 });
        let velocity = events.iter().find_map(|(time_s, reading)| match reading {
            Reading::Velocity(value) if *time_s >= start.0 => Some(Vector3::from(*value)),
            _ => None,
        });
        let sizes = [3, 3, 3, 3, 3, 1, 1, 3, 3];
        let mut covariance = SMatrix::<f64, N, N>::zeros();
        let mut state = 0;
        for (size, sigma) in sizes.into_iter().zip(PRIOR) {
            for _ in 0..size {
                covariance[(state, state)] = sigma * sigma;
                state += 1;
            }
        }
        Self {
            earth_from_body: Rotation3::from_euler_angles(roll, pitch, yaw),
            velocity: velocity.unwrap_or_default(),
            accel_bias: Vector3::zeros(),
            gyro_bias: Vector3::zeros(),
            lever: lever_m.into(),
            latency: [0.0; 2],
            offset: Vector3::zeros(),
            misalignment: Vector3::zeros(),
            covariance,
        }
    }

    fn parameters(&self, latency_s: [f64; 2]) -> SVector<f64, N> {
        let mut p = SVector::<f64, N>::zeros();
        p.fixed_rows_mut::<3>(ACCEL_BIAS)
            .copy_from(&self.accel_bias);
        p.fixed_rows_mut::<3>(GYRO_BIAS).copy_from(&self.gyro_bias);
        p.fixed_rows_mut::<3>(LEVER).copy_from(&self.lever);
        p[VELOCITY_LATENCY] = latency_s[0] + self.latency[0];
        p[ATTITUDE_LATENCY] = latency_s[1] + self.latency[1];
        p.fixed_rows_mut::<3>(OFFSET).copy_from(&self.offset);
        p
    }

    fn propagate(&mut self, dt: f64, force: Vector3<f64>, rate: Vector3<f64>, sigma: [f64; 2]) {
        let body = self.earth_from_body.into_inner();
        let force = force - self.accel_bias - self.misalignment.cross(&force);
        let rate = rate - self.gyro_bias - self.misalignment.cross(&rate);
        let half = Rotation3::new(rate * (0.5 * dt));
        let push = (self.earth_from_body * half) * force;
        self.velocity += (push - Vector3::z() * STANDARD_GRAVITY_M_S2) * dt;
        self.earth_from_body *= Rotation3::new(rate * dt);
        let mut step = SMatrix::<f64, N, N>::identity();
        let bias = -body * dt;
        step.fixed_view_mut::<3, 3>(TURN, GYRO_BIAS)
            .copy_from(&bias);
        step.fixed_view_mut::<3, 3>(VELOCITY, ACCEL_BIAS)
            .copy_from(&bias);
        // d(-m x w) = w x dm.
        step.fixed_view_mut::<3, 3>(TURN, MISALIGNMENT)
            .copy_from(&(body * cross(rate) * dt));
        step.fixed_view_mut::<3, 3>(VELOCITY, MISALIGNMENT)
            .copy_from(&(body * cross(force) * dt));
        let lean = -cross(push) * dt;
        step.fixed_view_mut::<3, 3>(VELOCITY, TURN).copy_from(&lean);
        self.covariance = step * self.covariance * step.transpose();
        // A reading stands for the time until the next: its noise adds up as a random walk.
        let interval_s = 0.01_f64.max(dt);
        for axis in 0..3 {
            self.covariance[(TURN + axis, TURN + axis)] += sigma[1].powi(2) * interval_s * dt;
            self.covariance[(VELOCITY + axis, VELOCITY + axis)] +=
                sigma[0].powi(2) * interval_s * dt;
        }
    }

    /// The horizontal normalised innovations; none where the reading is left out.
    fn push_velocity(&mut self, read: &[f64; 3], motion: &Motion, sigma: f64) -> Option<[f64; 2]> {
        let body = self.earth_from_body.into_inner();
        let rate = motion.rate - self.gyro_bias;
        let swing = body * rate.cross(&self.lever);
        let push = body * (motion.force - self.accel_bias) - Vector3::z() * STANDARD_GRAVITY_M_S2;
        let whirl = motion.rate_dot.cross(&self.lever) + rate.cross(&rate.cross(&self.lever));
        let pull = push + body * whirl;
        let expected = self.velocity + swing - pull * self.latency[0];
        let mut h = SMatrix::<f64, 3, N>::zeros();
        h.fixed_view_mut::<3, 3>(0, VELOCITY)
            .copy_from(&Matrix3::identity());
        h.fixed_view_mut::<3, 3>(0, TURN).copy_from(&-cross(swing));
        h.fixed_view_mut::<3, 3>(0, GYRO_BIAS)
            .copy_from(&(body * cross(self.lever)));
        h.fixed_view_mut::<3, 3>(0, LEVER)
            .copy_from(&(body * cross(rate)));
        h.fixed_view_mut::<3, 1>(0, VELOCITY_LATENCY)
            .copy_from(&-pull);
        let residual = Vector3::from(*read) - expected;
        let mut normalised = [0.0; 2];
        let mut delta = SVector::<f64, N>::zeros();
        for axis in 0..3 {
            let row = h.row(axis).transpose();
            let variance = (row.transpose() * self.covariance * row)[(0, 0)] + sigma * sigma;
            let innovation = residual[axis] - row.dot(&delta);
            if innovation * innovation > GATE * GATE * variance {
                self.inject(&delta);
                return None;
            }
            if axis < 2 {
                normalised[axis] = innovation / variance.sqrt();
            }
            self.scalar(&row, residual[axis], sigma * sigma, &mut delta);
        }
        self.inject(&delta);
        Some(normalised)
    }

    fn push_attitude(&mut self, read: &[f64; 3], motion: &Motion, sigma: [f64; 4]) {
        let (roll, pitch, yaw) = self.earth_from_body.euler_angles();
        let (sine, cosine) = yaw.sin_cos();
        let (tangent, secant) = (pitch.tan(), 1.0 / pitch.cos());
        // How a turn of earth axes moves yaw, pitch and roll.
        let slopes = [
            Vector3::new(tangent * cosine, tangent * sine, 1.0),
            Vector3::new(-sine, cosine, 0.0),
            Vector3::new(secant * cosine, secant * sine, 0.0),
        ];
        let rate = self.earth_from_body * (motion.rate - self.gyro_bias);
        let mut delta = SVector::<f64, N>::zeros();
        for (axis, nominal) in [yaw, pitch, roll].into_iter().enumerate() {
            if !read[axis].is_finite() {
                continue;
            }
            let speed = slopes[axis].dot(&rate);
            let expected = nominal + self.offset[axis] - speed * self.latency[1];
            let residual = wrap(read[axis] - expected);
            let mut row = SVector::<f64, N>::zeros();
            row.fixed_rows_mut::<3>(TURN).copy_from(&slopes[axis]);
            row[ATTITUDE_LATENCY] = -speed;
            row[OFFSET + axis] = 1.0;
            let variance = sigma[1 + axis].powi(2);
            let total = (row.transpose() * self.covariance * row)[(0, 0)] + variance;
            let innovation = residual - row.dot(&delta);
            if innovation * innovation <= GATE * GATE * total {
                self.scalar(&row, residual, variance, &mut delta);
            }
        }
        self.inject(&delta);
    }

    fn scalar(
        &mut self,
        row: &SVector<f64, N>,
        residual: f64,
        variance: f64,
        delta: &mut SVector<f64, N>,
    ) {
        let gain = self.covariance * row;
        let total = row.dot(&gain) + variance;
        let innovation = residual - row.dot(delta);
        *delta += gain * (innovation / total);
        self.covariance -= gain * gain.transpose() / total;
    }

    fn inject(&mut self, delta: &SVector<f64, N>) {
        let part = |state: usize| delta.fixed_rows::<3>(state).into_owned();
        self.earth_from_body = Rotation3::new(part(TURN)) * self.earth_from_body;
        self.velocity += part(VELOCITY);
        self.accel_bias += part(ACCEL_BIAS);
        self.gyro_bias += part(GYRO_BIAS);
        self.lever += part(LEVER);
        self.latency[0] += delta[VELOCITY_LATENCY];
        self.latency[1] += delta[ATTITUDE_LATENCY];
        self.offset += part(OFFSET);
        self.misalignment += part(MISALIGNMENT);
        self.covariance = (self.covariance + self.covariance.transpose()) * 0.5;
    }
}

/// The matrix of a vector product from the left.
fn cross(v: Vector3<f64>) -> Matrix3<f64> {
    v.cross_matrix()
}

fn wrap(angle_rad: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    angle_rad - turn * (angle_rad / turn).round()
}
