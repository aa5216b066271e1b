//! The two satellite receivers: what they solve for, and when the solution leaves.

use model::sensors::Sensors;
use nalgebra::Vector3;
use wire::geodesy::Geodetic;
use wire::gps_time::MILLISECONDS_PER_WEEK;

use crate::can_bus::period_if_fitted_s;
use crate::emission::{Emission, Output, Port};
use crate::hidden::Hidden;
use crate::random::Noise;
use crate::serial_line::SerialLine;
use crate::{Motion, Options, SeptentrioBlocks, SimError, TruthState, VelocityReceiver, encode};

/// Velocity is averaged over this many points of its interval.
const AVERAGING_POINTS: u32 = 20;

/// A solution of position and velocity.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Solution {
    /// GPS week and milliseconds of the time tag.
    pub(crate) week: u16,
    pub(crate) time_of_week_ms: u32,
    /// Whether there is one at all.
    pub(crate) valid: bool,
    pub(crate) place: Geodetic,
    pub(crate) undulation_m: f64,
    pub(crate) velocity_enu_m_s: [f64; 3],
    pub(crate) position_sigma_m: f64,
    pub(crate) velocity_sigma_m_s: f64,
    pub(crate) latency_s: f64,
}

/// A solution of attitude.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AttitudeSolution {
    pub(crate) valid: bool,
    /// Yaw from east (left positive), pitch (nose down), roll (right side down), rad.
    pub(crate) yaw_pitch_roll_rad: [f64; 3],
    pub(crate) sigma_rad: [f64; 3],
}

/// What both receivers share.
struct Receiver {
    antenna_m: [f64; 3],
    velocity_noise_m_s: f64,
    position_noise_m: f64,
    latency_s: f64,
    /// Latency of the velocity that the message does not tell.
    untold_s: f64,
    averaging_s: f64,
    processing_s: f64,
    options: Options,
    position_error_m: [f64; 3],
    noise: Noise,
    noise_line: Noise,
    line: SerialLine,
    period_s: f64,
    count: u64,
    end_s: f64,
}

impl Receiver {
    /// The next time tag, seconds since the start; none at the end.
    fn next_tag_s(&mut self) -> Option<f64> {
        self.count += 1;
        let tag_s = self.count as f64 * self.period_s;
        (tag_s <= self.end_s).then_some(tag_s)
    }

    /// Week and time of week of a tag.
    fn gps_time(&self, tag_s: f64) -> (u16, u32) {
        let week_ms = u64::from(MILLISECONDS_PER_WEEK);
        let start = self.options.gps_start;
        let total_ms = u64::from(start.time_of_week_ms) + (tag_s * 1e3).round() as u64;
        let week = u64::from(start.week) + total_ms / week_ms;
        (week as u16, (total_ms % week_ms) as u32)
    }

    fn solve(&mut self, motion: &Motion, tag_s: f64, valid: bool) -> Solution {
        let decay = math::exp(-self.period_s / self.options.position_correlation_s);
        let drive = self.position_noise_m * (1.0 - decay * decay).sqrt();
        let step_m = self.noise.normal3(drive);
        for (error, step) in self.position_error_m.iter_mut().zip(step_m) {
            *error = *error * decay + step;
        }
        let velocity_noise = self.noise.normal3(self.velocity_noise_m_s);
        let velocity = self.mean_velocity(motion, tag_s - self.latency_s - self.untold_s);
        let position = antenna_position(&motion.at(tag_s), self.antenna_m);
        let position = std::array::from_fn(|i| position[i] + self.position_error_m[i]);
        let place = encode::geodetic_from_enu(&self.options.origin, position);
        let (week, time_of_week_ms) = self.gps_time(tag_s);
        Solution {
            week,
            time_of_week_ms,
            valid,
            place,
            undulation_m: self.options.origin.undulation_m,
            velocity_enu_m_s: std::array::from_fn(|i| velocity[i] + velocity_noise[i]),
            position_sigma_m: self.position_noise_m,
            velocity_sigma_m_s: self.velocity_noise_m_s,
            latency_s: self.latency_s,
        }
    }

    /// Mean velocity of the antenna over the averaging interval centred at `centre_s`.
    fn mean_velocity(&self, motion: &Motion, centre_s: f64) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for k in 0..AVERAGING_POINTS {
            let part = (f64::from(k) + 0.5) / f64::from(AVERAGING_POINTS) - 0.5;
            let velocity = antenna_velocity(
                &motion.at(centre_s + part * self.averaging_s),
                self.antenna_m,
            );
            for (total, value) in sum.iter_mut().zip(velocity) {
                *total += value;
            }
        }
        sum.map(|total| total / f64::from(AVERAGING_POINTS))
    }

    /// Sends the messages of one epoch.
    fn send(&mut self, port: Port, tag_s: f64, messages: Vec<Vec<u8>>) -> Vec<Emission> {
        let ready_s = tag_s + self.processing_s + self.noise_line.delay(self.options.gnss_jitter_s);
        messages
            .into_iter()
            .map(|bytes| Emission {
                time_s: self.line.send(ready_s, bytes.len()),
                port,
                output: Output::Bytes(bytes),
            })
            .collect()
    }
}

/// The receiver of position and velocity.
pub(crate) struct Novatel(Receiver);

impl Novatel {
    pub(crate) fn new(
        motion: &Motion,
        sensors: &Sensors,
        options: &Options,
        hidden: &Hidden,
        seed: u64,
    ) -> Result<Self, SimError> {
        let gnss = &sensors.gnss_velocity;
        let mut noise = Noise::new(seed, "novatel");
        Ok(Self(Receiver {
            antenna_m: gnss.antenna_m,
            velocity_noise_m_s: gnss.velocity_noise_m_s,
            position_noise_m: gnss.position_noise_m,
            latency_s: gnss.latency_s,
            untold_s: hidden.velocity_latency_s,
            averaging_s: gnss.averaging_s,
            processing_s: options.novatel_processing_s,
            options: options.clone(),
            position_error_m: noise.normal3(gnss.position_noise_m),
            noise,
            noise_line: Noise::new(seed, "novatel line"),
            line: SerialLine::new(options.novatel_baud),
            period_s: period_if_fitted_s("gnss_velocity.rate_hz", gnss.rate_hz)?,
            count: 0,
            end_s: motion.duration_s(),
        }))
    }

    /// The next epoch's messages; none at the end.
    pub(crate) fn produce(&mut self, motion: &Motion) -> Vec<Emission> {
        let Some(tag_s) = self.0.next_tag_s() else {
            return Vec::new();
        };
        let valid = !self.0.options.faults.is_out(Port::Novatel, tag_s);
        let solution = self.0.solve(motion, tag_s, valid);
        let messages = match self.0.options.velocity_receiver {
            VelocityReceiver::Novatel => encode::novatel_epoch(&solution),
            VelocityReceiver::Ublox => encode::ublox_epoch(&solution),
        };
        self.0.send(Port::Novatel, tag_s, messages)
    }
}

/// The receiver of attitude, which solves for position and velocity too.
pub(crate) struct Septentrio {
    receiver: Receiver,
    blocks: SeptentrioBlocks,
    noise_attitude: Noise,
    /// What the antennas' mounting adds to yaw, pitch and roll.
    offset_rad: [f64; 3],
    heading_noise_rad: f64,
    roll_pitch_noise_rad: f64,
}

impl Septentrio {
    pub(crate) fn new(
        motion: &Motion,
        sensors: &Sensors,
        options: &Options,
        hidden: &Hidden,
        seed: u64,
    ) -> Result<Self, SimError> {
        let gnss = &sensors.gnss_attitude;
        let mut noise = Noise::new(seed, "septentrio");
        let period_s = period_if_fitted_s("gnss_attitude.rate_hz", gnss.rate_hz)?;
        Ok(Self {
            receiver: Receiver {
                antenna_m: gnss.antenna_m,
                velocity_noise_m_s: sensors.gnss_velocity.velocity_noise_m_s,
                position_noise_m: sensors.gnss_velocity.position_noise_m,
                latency_s: gnss.latency_s,
                untold_s: 0.0,
                averaging_s: period_s,
                processing_s: options.septentrio_processing_s,
                options: options.clone(),
                position_error_m: noise.normal3(sensors.gnss_velocity.position_noise_m),
                noise,
                noise_line: Noise::new(seed, "septentrio line"),
                line: SerialLine::new(options.septentrio_baud),
                period_s,
                count: 0,
                end_s: motion.duration_s(),
            },
            blocks: options.septentrio_blocks,
            noise_attitude: Noise::new(seed, "septentrio attitude"),
            offset_rad: hidden.attitude_offset_rad,
            heading_noise_rad: gnss.heading_noise_rad,
            roll_pitch_noise_rad: gnss.roll_pitch_noise_rad,
        })
    }

    /// The next epoch's blocks; none at the end.
    pub(crate) fn produce(&mut self, motion: &Motion) -> Vec<Emission> {
        let Some(tag_s) = self.receiver.next_tag_s() else {
            return Vec::new();
        };
        let faults = &self.receiver.options.faults;
        let valid = !faults.is_out(Port::Septentrio, tag_s);
        let solution = self.receiver.solve(motion, tag_s, valid);
        let attitude = self.solve_attitude(motion, tag_s, valid);
        let processing_s = self.receiver.processing_s;
        let messages = encode::septentrio_epoch(&solution, &attitude, self.blocks, processing_s);
        self.receiver.send(Port::Septentrio, tag_s, messages)
    }

    fn solve_attitude(&mut self, motion: &Motion, tag_s: f64, valid: bool) -> AttitudeSolution {
        let state = motion.at(tag_s - self.receiver.latency_s);
        let sigma_rad = [
            self.heading_noise_rad,
            self.roll_pitch_noise_rad,
            self.roll_pitch_noise_rad,
        ];
        let angles = [state.yaw_rad, state.pitch_rad, state.roll_rad];
        AttitudeSolution {
            valid,
            yaw_pitch_roll_rad: std::array::from_fn(|i| {
                angles[i] + self.offset_rad[i] + self.noise_attitude.normal(sigma_rad[i])
            }),
            sigma_rad,
        }
    }
}

/// Velocity of a point `r` of the body, earth axes: R (v + w x r).
fn antenna_velocity(state: &TruthState, r: [f64; 3]) -> [f64; 3] {
    let turn = Vector3::from(state.rate_rad_s).cross(&Vector3::from(r));
    let velocity = Vector3::from(state.velocity_body_m_s) + turn;
    (state.earth_from_body() * velocity).into()
}

/// Position of a point `r` of the body, east, north, up of the motion's origin.
fn antenna_position(state: &TruthState, r: [f64; 3]) -> [f64; 3] {
    let arm = state.earth_from_body() * Vector3::from(r);
    (Vector3::from(state.position_m) + arm).into()
}
