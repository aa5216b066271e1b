//! Faults of channels, chosen or drawn at random.

use std::ops::Range;

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use sample::{Counts, Measurement, Sample, Wheel};
use testkit::sensing;

/// Strain channels of a corner that are fitted.
const STRAIN: usize = 5;
/// Largest count of the converter.
const COUNT_MAX: f64 = 1023.0;

/// One channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    Strain(Wheel, usize),
    Potentiometer(Wheel),
    SpecificForce(usize),
    Rate(usize),
    Velocity(usize),
    Angle(usize),
    SteeringWheel,
    WheelSpeed(Wheel),
}

/// What happens to it.
#[derive(Clone, Copy, Debug)]
pub enum Kind {
    NotANumber,
    Frozen,
    Dead,
    /// At the end of its range, on one side or the other.
    Saturated(bool),
    /// Steps by a part of its range.
    Shifted(f64),
    /// Wild values with a probability.
    Spikes(f64),
    /// Another of the same device stands in its place, and it in the other's.
    Swapped(usize),
    /// Its messages are lost with a probability.
    Dropped(f64),
    /// The device's clock runs backwards.
    TimeReversed,
    /// Its messages come later by so many seconds.
    Late(f64),
}

/// A fault of a channel over some time.
#[derive(Clone, Debug)]
pub struct Fault {
    pub channel: Channel,
    pub kind: Kind,
    pub span_s: Range<f64>,
}

impl Fault {
    /// A fault between two times, s from the start of the run.
    pub fn draw(rng: &mut ChaCha8Rng, [earliest_s, latest_s]: [f64; 2]) -> Self {
        let begin_s = rng.random_range(earliest_s..latest_s - 0.2);
        let end_s = rng.random_range(begin_s + 0.1..latest_s);
        Self {
            channel: Channel::draw(rng),
            kind: Kind::draw(rng),
            span_s: begin_s..end_s,
        }
    }
}

impl Channel {
    fn draw(rng: &mut ChaCha8Rng) -> Self {
        let wheel = Wheel::ALL[rng.random_range(0..4)];
        let axis = rng.random_range(0..3);
        match rng.random_range(0..10) {
            0..=2 => Self::Strain(wheel, rng.random_range(0..STRAIN)),
            3 => Self::Potentiometer(wheel),
            4 => Self::SpecificForce(axis),
            5 => Self::Rate(axis),
            6 => Self::Velocity(axis),
            7 => Self::Angle(axis),
            8 => Self::SteeringWheel,
            _ => Self::WheelSpeed(wheel),
        }
    }

    /// The end of its range, in the measurement's unit.
    pub fn range(self) -> f64 {
        match self {
            Self::Strain(..) | Self::Potentiometer(_) => COUNT_MAX,
            Self::SpecificForce(_) => 40.0,
            Self::Rate(_) => 3.5,
            Self::Velocity(_) => 60.0,
            Self::Angle(_) => std::f64::consts::PI,
            Self::SteeringWheel => 8.0,
            Self::WheelSpeed(_) => 150.0,
        }
    }

    /// Whether a measurement is of its device.
    fn is_in(self, measurement: &Measurement) -> bool {
        match (self, measurement) {
            (Self::Strain(wheel, _) | Self::Potentiometer(wheel), Measurement::Corner(corner)) => {
                corner.wheel == wheel
            }
            (Self::SpecificForce(_) | Self::Rate(_), Measurement::Imu(_))
            | (Self::Velocity(_), Measurement::GnssVelocity(_))
            | (Self::Angle(_), Measurement::GnssAttitude(_))
            | (Self::SteeringWheel, Measurement::Steer(_))
            | (Self::WheelSpeed(_), Measurement::WheelSpeed(_)) => true,
            _ => false,
        }
    }

    /// The neighbour that it may be swapped with.
    fn neighbour(self, other: usize) -> Self {
        match self {
            Self::Strain(wheel, i) => Self::Strain(wheel, (i + 1 + other % 4) % STRAIN),
            Self::SpecificForce(i) => Self::SpecificForce((i + 1 + other % 2) % 3),
            Self::Rate(i) => Self::Rate((i + 1 + other % 2) % 3),
            Self::Velocity(i) => Self::Velocity((i + 1 + other % 2) % 3),
            Self::Angle(i) => Self::Angle((i + 1 + other % 2) % 3),
            Self::WheelSpeed(wheel) => {
                Self::WheelSpeed(Wheel::ALL[(wheel.index() + 1 + other % 3) % 4])
            }
            alone => alone,
        }
    }

    fn value(self, measurement: &Measurement) -> Option<f64> {
        match (self, measurement) {
            (Self::Strain(_, i), Measurement::Corner(c)) => c.strain_counts[i].map(Counts::number),
            (Self::Potentiometer(_), Measurement::Corner(c)) => {
                c.deflection_counts.map(Counts::number)
            }
            (Self::SpecificForce(i), Measurement::Imu(imu)) => Some(imu.specific_force_m_s2[i]),
            (Self::Rate(i), Measurement::Imu(imu)) => Some(imu.angular_rate_rad_s[i]),
            (Self::Velocity(i), Measurement::GnssVelocity(gnss)) => Some(gnss.velocity_enu_m_s[i]),
            (Self::Angle(i), Measurement::GnssAttitude(gnss)) => {
                [gnss.yaw_rad, gnss.pitch_rad, gnss.roll_rad][i]
            }
            (Self::SteeringWheel, Measurement::Steer(steer)) => Some(steer.steering_wheel_rad),
            (Self::WheelSpeed(wheel), Measurement::WheelSpeed(speeds)) => {
                speeds.angular_speed_rad_s[wheel]
            }
            _ => None,
        }
    }

    /// Counts cannot be anything but a number of the converter, or absent.
    fn set(self, measurement: &mut Measurement, value: f64) {
        let counts = value
            .is_finite()
            .then(|| Counts::Converter(value.clamp(0.0, COUNT_MAX) as i32));
        match (self, measurement) {
            (Self::Strain(_, i), Measurement::Corner(c)) => c.strain_counts[i] = counts,
            (Self::Potentiometer(_), Measurement::Corner(c)) => c.deflection_counts = counts,
            (Self::SpecificForce(i), Measurement::Imu(imu)) => imu.specific_force_m_s2[i] = value,
            (Self::Rate(i), Measurement::Imu(imu)) => imu.angular_rate_rad_s[i] = value,
            (Self::Velocity(i), Measurement::GnssVelocity(gnss)) => {
                gnss.velocity_enu_m_s[i] = value;
            }
            (Self::Angle(i), Measurement::GnssAttitude(gnss)) => {
                *[&mut gnss.yaw_rad, &mut gnss.pitch_rad, &mut gnss.roll_rad][i] = Some(value);
            }
            (Self::SteeringWheel, Measurement::Steer(steer)) => steer.steering_wheel_rad = value,
            (Self::WheelSpeed(wheel), Measurement::WheelSpeed(speeds)) => {
                speeds.angular_speed_rad_s[wheel] = Some(value);
            }
            _ => {}
        }
    }
}

impl Kind {
    fn draw(rng: &mut ChaCha8Rng) -> Self {
        match rng.random_range(0..10) {
            0 => Self::NotANumber,
            1 => Self::Frozen,
            2 => Self::Dead,
            3 => Self::Saturated(rng.random()),
            4 => Self::Shifted(rng.random_range(-0.5..0.5)),
            5 => Self::Spikes(rng.random_range(0.01..0.5)),
            6 => Self::Swapped(rng.random_range(0..12)),
            7 => Self::Dropped(rng.random_range(0.1..1.0)),
            8 => Self::TimeReversed,
            _ => Self::Late(rng.random_range(0.01..1.0)),
        }
    }
}

/// The samples as they come with the faults, in the order of their arrival.
pub fn spoil(mut samples: Vec<Sample>, faults: &[Fault], rng: &mut ChaCha8Rng) -> Vec<Sample> {
    for fault in faults {
        spoil_by(&mut samples, fault, rng);
    }
    samples.sort_by_key(|sample| sample.log_time);
    samples
}

fn spoil_by(samples: &mut Vec<Sample>, fault: &Fault, rng: &mut ChaCha8Rng) {
    let Fault { channel, kind, .. } = *fault;
    let [begin, end] =
        [fault.span_s.start, fault.span_s.end].map(|time_s| sensing::START.offset_seconds(time_s));
    let mut held = None;
    samples.retain_mut(|sample| {
        if !(begin..end).contains(&sample.log_time) || !channel.is_in(&sample.measurement) {
            return true;
        }
        let value = channel.value(&sample.measurement).unwrap_or(f64::NAN);
        let measurement = &mut sample.measurement;
        match kind {
            Kind::NotANumber => channel.set(measurement, f64::NAN),
            Kind::Frozen => channel.set(measurement, *held.get_or_insert(value)),
            Kind::Dead => channel.set(measurement, 0.0),
            Kind::Saturated(high) => {
                let range = channel.range();
                channel.set(measurement, if high { range } else { -range });
            }
            Kind::Shifted(part) => channel.set(measurement, value + part * channel.range()),
            Kind::Spikes(probability) => {
                if rng.random_bool(probability) {
                    let wild = rng.random_range(-100.0..100.0) * channel.range();
                    channel.set(measurement, wild);
                }
            }
            Kind::Swapped(other) => {
                let other = channel.neighbour(other);
                if let Some(of_other) = other.value(measurement) {
                    other.set(measurement, value);
                    channel.set(measurement, of_other);
                }
            }
            Kind::Dropped(probability) => return !rng.random_bool(probability),
            Kind::TimeReversed => {
                let past_s = 2.0 * sample.valid_time.seconds_since(begin).max(0.0);
                sample.valid_time = sample.valid_time.offset_seconds(-past_s);
            }
            Kind::Late(by_s) => sample.log_time = sample.log_time.offset_seconds(by_s),
        }
        true
    });
}
