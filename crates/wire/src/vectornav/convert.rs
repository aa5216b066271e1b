use sample::{
    Attitude, DeviceTime, FixQuality, GnssPosition, GnssVelocity, ImuSample, Measurement,
};

use super::{Ascii, Binary, Output};
use crate::Measurements;
use crate::geodesy::yaw_from_heading_deg;
use crate::gps_time::SECONDS_PER_WEEK;

/// Time of week and date are known.
const DATED: u8 = 0b11;
const NANOS_PER_WEEK: u64 = 604_800_000_000_000;

impl Output {
    /// The device's time: GPS time where the device knows the date, else the time since its start.
    #[must_use]
    pub fn device_time(&self) -> Option<DeviceTime> {
        match self {
            Self::Binary(b) => b.device_time(),
            Self::Ascii(b) => {
                let (time_of_week_s, week) = b.gps_time?;
                (0.0..SECONDS_PER_WEEK)
                    .contains(&time_of_week_s)
                    .then_some(DeviceTime::Gps {
                        week: Some(week),
                        time_of_week_s,
                    })
            }
        }
    }

    /// What the message measured, in SI; inertial samples in the axes of the device.
    #[must_use]
    pub fn measurements(&self) -> Measurements {
        match self {
            Self::Binary(b) => b.measurements(),
            Self::Ascii(b) => b.measurements(),
        }
    }
}

impl Binary {
    fn device_time(&self) -> Option<DeviceTime> {
        let dated = self
            .time_status
            .is_some_and(|status| status & DATED == DATED);
        let of_week = self.gps_week.0.zip(self.gps_week.1);
        let since_epoch = self
            .gps_ns
            .map(|ns| (ns % NANOS_PER_WEEK, ns / NANOS_PER_WEEK));
        let since_epoch = since_epoch.and_then(|(ns, week)| Some((ns, u16::try_from(week).ok()?)));
        let gps = of_week
            .or(since_epoch)
            .filter(|(ns, _)| dated && *ns < NANOS_PER_WEEK);
        if let Some((ns, week)) = gps {
            return Some(DeviceTime::Gps {
                week: Some(week),
                time_of_week_s: ns as f64 * 1e-9,
            });
        }
        let ns = i64::try_from(self.since_start_ns?).ok()?;
        Some(DeviceTime::AdapterNanos(ns))
    }

    fn measurements(&self) -> Measurements {
        let wide = |v: [f32; 3]| v.map(f64::from);
        let force = self
            .acceleration_m_s2
            .or(self.uncompensated_acceleration_m_s2);
        let rate = self.rate_rad_s.or(self.uncompensated_rate_rad_s);
        let imu = force.zip(rate).map(|(force, rate)| {
            imu_of(wide(force), wide(rate), self.temperature_c.map(f64::from))
        });
        let attitude = self.yaw_pitch_roll_deg.map(|v| attitude(wide(v)));
        // The receiver's own solution is the measurement; that of the navigation repeats the unit.
        let fix = self.fix.map(quality_of_fix).filter(|fix| fix.is_solved());
        let own = fix.is_some() && self.gnss_position.is_some();
        let (quality, place, velocity) = if own {
            (fix, self.gnss_position, self.gnss_velocity_ned_m_s)
        } else {
            let status = self.ins_status.map(quality_of_status);
            (status, self.ins_position, self.ins_velocity_ned_m_s)
        };
        let spread = |sigma: Option<f32>| sigma.map(|s| [s; 3]);
        let sigmas = if own {
            let velocity = spread(self.gnss_velocity_sigma_m_s);
            [self.gnss_position_sigma_m, velocity]
        } else {
            self.ins_sigma.map(spread)
        };
        let [position_sigma, velocity_sigma] = sigmas.map(|s| s.map(wide));
        // A device without a state of its navigation says that it has no solution.
        let quality = quality.unwrap_or_default();
        let satellites = self.satellites.filter(|_| own);
        Measurements::of([
            imu,
            attitude,
            place.map(|place| position(quality, place, position_sigma, satellites)),
            velocity.map(|v| velocity_of(quality, wide(v), velocity_sigma)),
        ])
    }
}

impl Ascii {
    fn measurements(&self) -> Measurements {
        let imu = self.acceleration_m_s2.zip(self.rate_rad_s);
        let quality = match (self.fix, self.ins_status) {
            (Some((fix, _)), _) => quality_of_fix(fix),
            (None, Some(status)) => quality_of_status(status),
            (None, None) => FixQuality::DeadReckoning,
        };
        let sigma = self.velocity_sigma_m_s.map(|sigma| [sigma; 3]);
        let satellites = self.fix.map(|(_, satellites)| satellites);
        Measurements::of([
            imu.map(|(force, rate)| imu_of(force, rate, self.temperature_c)),
            self.yaw_pitch_roll_deg.map(attitude),
            self.position
                .map(|place| position(quality, place, self.position_sigma_m, satellites)),
            self.velocity_ned_m_s
                .map(|v| velocity_of(quality, v, sigma)),
        ])
    }
}

const fn quality_of_fix(fix: u8) -> FixQuality {
    match fix {
        2 | 3 => FixQuality::Single,
        4 => FixQuality::Differential,
        7 => FixQuality::Float,
        8 => FixQuality::Fixed,
        _ => FixQuality::None,
    }
}

/// Quality of the navigation: mode in bits 0 and 1, and in bit 2 whether its receiver has a fix.
const fn quality_of_status(status: u16) -> FixQuality {
    match (status & 3, status >> 2 & 1) {
        (1 | 2, 1) => FixQuality::Single,
        (2 | 3, _) => FixQuality::DeadReckoning,
        _ => FixQuality::None,
    }
}

fn imu_of(force: [f64; 3], rate: [f64; 3], temperature_c: Option<f64>) -> Measurement {
    let finite = force.iter().chain(&rate).all(|v| v.is_finite());
    Measurement::Imu(ImuSample {
        specific_force_m_s2: force,
        angular_rate_rad_s: rate,
        temperature_c,
        interval_s: 0.0,
        status: 0,
        valid: finite,
    })
}

fn attitude([yaw, pitch, roll]: [f64; 3]) -> Measurement {
    Measurement::Attitude(Attitude {
        roll_rad: roll.to_radians(),
        pitch_rad: -pitch.to_radians(),
        yaw_rad: yaw_from_heading_deg(yaw),
    })
}

fn position(
    quality: FixQuality,
    [latitude, longitude, height]: [f64; 3],
    sigma_ned_m: Option<[f64; 3]>,
    satellites: Option<u8>,
) -> Measurement {
    let only = |value: f64| if quality.is_solved() { value } else { f64::NAN };
    Measurement::GnssPosition(GnssPosition {
        quality,
        latitude_rad: only(latitude.to_radians()),
        longitude_rad: only(longitude.to_radians()),
        height_m: only(height),
        sigma_enu_m: sigma_ned_m.filter(|_| quality.is_solved()).map(east_first),
        satellites,
    })
}

fn velocity_of(
    quality: FixQuality,
    [north, east, down]: [f64; 3],
    sigma_m_s: Option<[f64; 3]>,
) -> Measurement {
    let only = |value: f64| if quality.is_solved() { value } else { f64::NAN };
    Measurement::GnssVelocity(GnssVelocity {
        quality,
        velocity_enu_m_s: [east, north, -down].map(only),
        sigma_enu_m_s: sigma_m_s.filter(|_| quality.is_solved()),
        latency_s: None,
    })
}

fn east_first([north, east, down]: [f64; 3]) -> [f64; 3] {
    [east, north, down]
}
