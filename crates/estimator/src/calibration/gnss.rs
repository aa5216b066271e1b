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

mod filter;
mod readings;

use model::sensors::Sensors;
use nalgebra::{SMatrix, SVector};

use self::filter::{ATTITUDE_LATENCY, Filter, LEVER, N, OFFSET, VELOCITY_LATENCY};
use self::readings::{Motion, Reading, between, events, first_attitude};
use super::GnssCalibration;
use super::imu::ImuSignal;
use crate::finding::{Excitation, Figure, Finding, Findings, Refusal, Series, Span};
use crate::regression::whiteness;
use crate::statistics::interval_95;

/// Passes over the drive.
const PASSES: usize = 3;
/// Least driving, s.
const NEEDED_S: f64 = 20.0;
/// Greatest deviations with which a place (x, y) and a latency count as found, m and s.
const PLACE_SIGMA_M: f64 = 0.04;
const LATENCY_SIGMA_S: f64 = 0.004;
/// Deviation above which a latency may well be off by two milliseconds, s: a third of that.
const LATENCY_SURE_S: f64 = 0.0007;
/// Deviation up to which the height of an antenna counts as found, m.
const HEIGHT_SIGMA_M: f64 = 0.016;

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
    /// Time that a velocity is the mean over, about the instant that it is of, s.
    pub averaging_s: f64,
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
    let mut pass = Pass::run(input, [0.0; 2]);
    for _ in 1..PASSES {
        let state = pass.parameters;
        let latency = [state[VELOCITY_LATENCY], state[ATTITUDE_LATENCY]];
        pass = Pass::run(input, latency);
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

impl Pass {
    fn run(input: &GnssInput<'_>, latency_s: [f64; 2]) -> Self {
        let lever_m = [0, 1, 2].map(|axis| input.antenna_m[axis] - input.imu_m[axis]);
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
            match reading {
                Reading::Velocity(velocity) => {
                    let motion = Motion::at(imu, *time_s, input.averaging_s);
                    let [sigma, rate_sigma] = [input.sigma[0], input.imu_sigma[1]];
                    match filter.push_velocity(velocity, &motion, sigma, rate_sigma) {
                        Some([east, north]) => innovations.push([*time_s, east, north]),
                        None => left_out += 1,
                    }
                }
                Reading::Attitude(angles) => {
                    filter.push_attitude(angles, &Motion::at(imu, *time_s, 0.0), input.sigma);
                }
            }
            used += 1;
        }
        let begin_s = imu.time_s[0].max(start.0);
        Self {
            parameters: filter.parameters(latency_s),
            covariance: filter.covariance_at_end(),
            innovations,
            left_out,
            used,
            span_s: [begin_s, now_s],
            yaw_rate_rms: (turned / (now_s - begin_s).max(1e-9)).sqrt(),
        }
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
            // A filter that diverged has no deviation.
            .find(|(sigma, most, ..)| sigma.is_nan() || sigma > most);
        if let Some((sigma, most, name, unit)) = unsure {
            return Err(Refusal::NotExcited {
                what: what.to_owned(),
                quantity: format!("certainty (1/sigma) of the {name}"),
                found: if sigma.is_finite() { 1.0 / sigma } else { 0.0 },
                needed: 1.0 / most,
                unit: format!("1/{unit}"),
                help: "drive a minute with quick turns to both sides, braking and speeding up"
                    .to_owned(),
            });
        }
        let p = &self.parameters;
        if !p
            .iter()
            .chain(self.covariance.iter())
            .all(|value| value.is_finite())
        {
            return Err(Refusal::NotConverged {
                what: what.to_owned(),
                iterations: PASSES,
                help: "look at the noise in the sensors file and at the units of the recording"
                    .to_owned(),
            });
        }
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
                interval: Some(interval_95(value, sigma)),
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
                    "{what}: the antenna's height is known to {:.3} m only (roll and pitch move it \
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
        findings.notes.extend(self.unsure_latencies(what));
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

    /// Notes on the latencies that a longer drive would tell better.
    fn unsure_latencies(&self, what: &str) -> Vec<String> {
        [
            (VELOCITY_LATENCY, "velocity"),
            (ATTITUDE_LATENCY, "attitude"),
        ]
        .into_iter()
        .map(|(state, name)| (self.sigma(state), name))
        .filter(|(sigma_s, _)| *sigma_s > LATENCY_SURE_S)
        .map(|(sigma_s, name)| {
            format!(
                "{what}: the latency of the {name} is known to {:.1} ms (one deviation); a longer \
                 drive, or one that turns more, tells it better",
                1e3 * sigma_s
            )
        })
        .collect()
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
