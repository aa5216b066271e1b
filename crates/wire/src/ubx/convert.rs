use sample::{
    Attitude as VehicleAttitude, DeviceTime, FixQuality, GnssAttitude, GnssPosition, GnssVelocity,
    ImuSample, Measurement,
};

use super::sensors::{Reading, Readings};
use super::{Attitude, Body, Dop, Pvt, RelativePosition, TimeMark};
use crate::Measurements;
use crate::geodesy::yaw_from_heading_deg;
use crate::gps_time::{GPS_EPOCH_UNIX_S, SECONDS_PER_WEEK, unix_s_of_date};
use crate::item::values;

/// Length of a unit of the sensors' time in ESF-RAW, ns: 1/25600 s.
const SENSOR_UNIT_NS: f64 = 39_062.5;

/// What earlier messages say about later ones: the GPS week.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Memory {
    /// Week and time of week of the last NAV-PVT with a date.
    week: Option<(u16, f64)>,
}

/// What a message measured, and when by the receiver's clock.
pub(crate) struct Measured {
    pub device_time: Option<DeviceTime>,
    pub measurements: Measurements,
}

impl Memory {
    /// What a message measured, in SI and the project's axes; ESF-RAW gives one result for each of its
    /// instants, others one result.
    pub fn measured(&mut self, body: &Body, mut sink: impl FnMut(Measured)) {
        let mut one = |device_time, measurements| {
            sink(Measured {
                device_time,
                measurements,
            });
        };
        match body {
            Body::Pvt(b) => {
                self.date(b);
                one(self.time(b.time_of_week_ms), b.measurements());
            }
            Body::RelativePosition(b) => one(self.time(b.time_of_week_ms), b.measurements()),
            Body::Attitude(b) => one(self.time(b.time_of_week_ms), b.measurements()),
            Body::Dop(b) => one(self.time(b.time_of_week_ms), b.measurements()),
            Body::TimeMark(b) => {
                let edges = [(1 << 7, "rising", 0), (1 << 2, "falling", 1)];
                for (bit, name, edge) in edges {
                    if b.flags & bit != 0 {
                        one(b.time(edge), b.measurements(name));
                    }
                }
            }
            Body::Measured(b) => one(None, named(b.iter())),
            Body::Raw(b) => b.instants(one),
        }
    }

    fn date(&mut self, pvt: &Pvt) {
        let [month, day, hour, minute, second] = pvt.month_to_second;
        let midnight = unix_s_of_date(pvt.year, month, day).filter(|_| pvt.valid & 3 == 3);
        let tow_s = f64::from(pvt.time_of_week_ms) * 1e-3;
        if let Some(midnight) = midnight {
            let of_day = u32::from(hour) * 3600 + u32::from(minute) * 60 + u32::from(second);
            let utc_s = (midnight - GPS_EPOCH_UNIX_S) as f64 + f64::from(of_day);
            // Leap seconds are less than half a week.
            let week = ((utc_s - tow_s) / SECONDS_PER_WEEK).round();
            if (0.0..=f64::from(u16::MAX)).contains(&week) {
                self.week = Some((week as u16, tow_s));
            }
        }
    }

    /// GPS time of a message; the week is that of the last date, or the next after a rollover.
    fn time(&self, time_of_week_ms: u32) -> Option<DeviceTime> {
        let time_of_week_s = f64::from(time_of_week_ms) * 1e-3;
        let week = self.week.map(|(week, then_s)| {
            let passed = then_s - time_of_week_s > 0.5 * SECONDS_PER_WEEK;
            week.saturating_add(u16::from(passed))
        });
        (time_of_week_s < SECONDS_PER_WEEK).then_some(DeviceTime::Gps {
            week,
            time_of_week_s,
        })
    }
}

/// Quality of a carrier solution, 1 float, 2 fixed, and of a differential one.
const fn quality(carrier: u32, differential: bool) -> FixQuality {
    match (carrier, differential) {
        (2, _) => FixQuality::Fixed,
        (1, _) => FixQuality::Float,
        (_, true) => FixQuality::Differential,
        _ => FixQuality::Single,
    }
}

impl Pvt {
    fn measurements(&self) -> Measurements {
        let solved = match self.fix {
            _ if self.flags & 1 == 0 => FixQuality::None,
            1 => FixQuality::DeadReckoning,
            2..=4 => quality(u32::from(self.flags >> 6), self.flags & 2 != 0),
            _ => FixQuality::None,
        };
        let placed = match self.flags3 & 1 {
            0 => solved,
            _ => FixQuality::None,
        };
        let only =
            |quality: FixQuality, value: f64| if quality.is_solved() { value } else { f64::NAN };
        let [horizontal, vertical] = self.accuracy_mm.map(|a| f64::from(a) * 1e-3);
        let [north, east, down] = self.velocity_ned_mm_s.map(|v| f64::from(v) * 1e-3);
        let speed_sigma = f64::from(self.speed_accuracy_mm_s) * 1e-3;
        let degrees = |value: i32| (f64::from(value) * 1e-7).to_radians();
        Measurements::two(
            Measurement::GnssPosition(GnssPosition {
                quality: placed,
                latitude_rad: only(placed, degrees(self.latitude_1e7_deg)),
                longitude_rad: only(placed, degrees(self.longitude_1e7_deg)),
                height_m: only(placed, f64::from(self.height_mm) * 1e-3),
                sigma_enu_m: placed
                    .is_solved()
                    .then_some([horizontal, horizontal, vertical]),
                satellites: Some(self.satellites),
            }),
            Measurement::GnssVelocity(GnssVelocity {
                quality: solved,
                velocity_enu_m_s: [east, north, -down].map(|v| only(solved, v)),
                sigma_enu_m_s: solved.is_solved().then_some([speed_sigma; 3]),
                latency_s: None,
            }),
        )
    }
}

impl RelativePosition {
    /// The baseline by name, and between antennas that move together the direction as an attitude.
    fn measurements(&self) -> Measurements {
        let has = |bit: u32| self.flags >> bit & 1 != 0;
        if !(has(0) && has(2)) {
            return Measurements::none();
        }
        let axis = |i: usize| {
            f64::from(self.position_ned_cm[i]) * 1e-2 + f64::from(self.fine_100um[i]) * 1e-4
        };
        let [north, east, down] = [axis(0), axis(1), axis(2)];
        let baseline = Measurement::Control(values(&[
            ("baseline_north", north, "m"),
            ("baseline_east", east, "m"),
            ("baseline_up", -down, "m"),
        ]));
        if !(self.version > 0 && has(5) && has(8)) {
            return Measurements::one(baseline);
        }
        let length = math::hypot(math::hypot(north, east), down);
        let pitch = math::atan2(-down, math::hypot(north, east));
        let sigma_down = f64::from(self.sigma_ned_100um[2]) * 1e-4;
        let heading_sigma = (f64::from(self.heading_sigma_1e5_deg) * 1e-5).to_radians();
        let attitude = Measurement::GnssAttitude(GnssAttitude {
            quality: quality(self.flags >> 3 & 3, has(1)),
            yaw_rad: Some(yaw_from_heading_deg(f64::from(self.heading_1e5_deg) * 1e-5)),
            pitch_rad: Some(-pitch),
            roll_rad: None,
            sigma_rad: Some([heading_sigma, sigma_down / length.max(1e-3), f64::INFINITY]),
        });
        Measurements::two(attitude, baseline)
    }
}

impl Attitude {
    /// A receiver without an attitude sends zeros and accuracies of zero.
    fn measurements(&self) -> Measurements {
        if self.accuracy_1e5_deg == [0; 3] {
            return Measurements::none();
        }
        let [roll, pitch, heading] = self.angles_1e5_deg.map(|v| f64::from(v) * 1e-5);
        Measurements::one(Measurement::Attitude(VehicleAttitude {
            roll_rad: roll.to_radians(),
            pitch_rad: -pitch.to_radians(),
            yaw_rad: yaw_from_heading_deg(heading),
        }))
    }
}

impl Dop {
    fn measurements(&self) -> Measurements {
        let names = [
            "dop_geometric",
            "dop_position",
            "dop_time",
            "dop_vertical",
            "dop_horizontal",
            "dop_northing",
            "dop_easting",
        ];
        let all: Vec<_> = names
            .into_iter()
            .zip(self.dilutions_c)
            .map(|(name, dop)| (name, f64::from(dop) * 0.01, "1"))
            .collect();
        Measurements::one(Measurement::Control(values(&all)))
    }
}

impl TimeMark {
    /// GPS time of the rising (0) or falling (1) edge, if the receiver knows it.
    fn time(&self, edge: usize) -> Option<DeviceTime> {
        let is_gps = self.flags >> 3 & 3 == 1 && self.flags & 1 << 6 != 0;
        let [ms, ns] = [self.rising, self.falling][edge];
        is_gps.then(|| DeviceTime::Gps {
            week: Some(self.weeks[edge]),
            time_of_week_s: f64::from(ms) * 1e-3 + f64::from(ns) * 1e-9,
        })
    }

    fn measurements(&self, edge: &str) -> Measurements {
        let name = format!("time_mark_{edge}");
        Measurements::one(Measurement::Control(values(&[
            (&name, f64::from(self.count), "1"),
            ("time_mark_channel", f64::from(self.channel), "1"),
            (
                "time_mark_accuracy",
                f64::from(self.accuracy_ns) * 1e-9,
                "s",
            ),
        ])))
    }
}

/// Readings by name.
fn named<'r>(readings: impl Iterator<Item = &'r Reading>) -> Measurements {
    let all: Vec<_> = readings.filter_map(Reading::value).collect();
    if all.is_empty() {
        return Measurements::none();
    }
    Measurements::one(Measurement::Control(values(&all)))
}

impl Readings {
    /// Each instant of ESF-RAW: a sample of the inertial unit where it has three axes of both, else the
    /// readings by name.
    fn instants(&self, mut one: impl FnMut(Option<DeviceTime>, Measurements)) {
        let all = &self.all[..self.count];
        for instant in all.chunk_by(|a, b| a.time == b.time) {
            let time_ns = f64::from(instant[0].time) * SENSOR_UNIT_NS;
            let measurements = match imu(instant) {
                Some(imu) => Measurements::one(Measurement::Imu(imu)),
                None => named(instant.iter()),
            };
            one(Some(DeviceTime::AdapterNanos(time_ns as i64)), measurements);
        }
    }
}

fn imu(readings: &[Reading]) -> Option<ImuSample> {
    let of = |sensor: u8| {
        let reading = readings.iter().find(|r| r.sensor == sensor)?;
        Some(reading.value()?.1)
    };
    Some(ImuSample {
        specific_force_m_s2: [of(16)?, of(17)?, of(18)?],
        angular_rate_rad_s: [of(14)?, of(13)?, of(5)?],
        temperature_c: of(12),
        interval_s: 0.0,
        status: 0,
        valid: true,
    })
}
