//! Buffer of the samples for the next step.
//!
//! Devices have different latencies, so the order of arrival is not the order of measurement. A
//! step takes all samples that have arrived in the order of their own time; equal times are ordered
//! by kind and content. So within the 5 ms delay of a step the order of arrival changes no bit.

use std::cmp::Ordering;

use crate::inputs::Stamp;
use nalgebra::Vector3;
use sample::{
    CornerSample, Counts, GnssAttitude, GnssVelocity, HubAccelerationSample, LogTime, PerWheel,
    SourceId,
};

/// Capacity; a step of 10 ms has about thirty samples.
const CAPACITY: usize = 2048;

/// Content of a sample.
#[derive(Clone, Copy, Debug)]
pub enum Held {
    /// Specific force and rate, body axes, calibration applied.
    Inertial {
        /// Specific force, m/s^2.
        force: Vector3<f64>,
        /// Angular rate, rad/s.
        rate: Vector3<f64>,
    },
    /// An inertial reading that the unit marks as invalid.
    NoInertial,
    /// Velocity of a source's antenna.
    Velocity(SourceId, GnssVelocity),
    /// Attitude of the antennas.
    Attitude(GnssAttitude),
    /// Counts of a corner.
    Corner(CornerSample),
    /// Steering-wheel angle, rad.
    SteeringWheel(f64),
    /// Steer angles of the left and the right front wheel, rad; `NaN` where there is none.
    WheelAngles([f64; 2]),
    /// Wheel speeds, rad/s.
    WheelSpeed(PerWheel<Option<f64>>),
    /// Readings of a wheel's hub accelerometer.
    HubAcceleration(HubAccelerationSample),
    /// Force of a load on the hitch, vehicle axes, N.
    HitchForce([f64; 3]),
    /// Drive and brake torque of each wheel, N m; `NaN` where there is none.
    WheelTorque([[f64; 4]; 2]),
    /// Temperature of the bridges of each wheel, degrees Celsius; `NaN` where there is none.
    BridgeTemperature([f64; 4]),
    /// Inflation pressure of each tyre, Pa; `NaN` where there is none.
    TyrePressure([f64; 4]),
}

/// A sample with its time of validity.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// Time of validity.
    pub time: LogTime,
    /// Its message, if the latency of the message is not known.
    pub stream: Option<u8>,
    /// Content.
    pub held: Held,
}

impl Entry {
    /// By time, then by kind, then by content.
    fn order(&self, other: &Self) -> Ordering {
        let first = |entry: &Self| (entry.time, entry.rank());
        let order = first(self).cmp(&first(other));
        order.then_with(|| self.content().cmp(&other.content()))
    }

    fn rank(&self) -> u8 {
        match &self.held {
            Held::Inertial { .. } | Held::NoInertial => 0,
            Held::Velocity(..) => 1,
            Held::Attitude(_) => 2,
            Held::Corner(corner) => 3 + corner.wheel.index() as u8,
            Held::SteeringWheel(_) => 7,
            Held::WheelSpeed(_) => 8,
            Held::HubAcceleration(hub) => 9 + hub.wheel.index() as u8,
            Held::HitchForce(_) => 13,
            Held::WheelTorque(_) => 14,
            Held::BridgeTemperature(_) => 15,
            Held::WheelAngles(_) => 16,
            Held::TyrePressure(_) => 17,
        }
    }

    fn content(&self) -> u64 {
        match &self.held {
            Held::Inertial { force, rate } => digest(force.iter().chain(rate.iter()).copied()),
            Held::NoInertial => 0,
            Held::Velocity(source, gnss) => {
                digest(gnss.velocity_enu_m_s).wrapping_add(u64::from(source.0))
            }
            Held::Attitude(gnss) => {
                let angles = [gnss.yaw_rad, gnss.pitch_rad, gnss.roll_rad];
                digest(angles.map(|angle| angle.unwrap_or(f64::NAN)))
            }
            Held::Corner(corner) => {
                let counts = corner
                    .strain_counts
                    .iter()
                    .chain([&corner.deflection_counts]);
                digest(counts.map(|count| count.map_or(-1.0, Counts::number)))
            }
            Held::SteeringWheel(angle) => angle.to_bits(),
            Held::HitchForce(force) => digest(*force),
            Held::WheelTorque(torques) => digest(torques.iter().flatten().copied()),
            Held::BridgeTemperature(values) | Held::TyrePressure(values) => digest(*values),
            Held::WheelAngles(angles) => digest(*angles),
            Held::WheelSpeed(speeds) => digest(speeds.0.map(|speed| speed.unwrap_or(f64::NAN))),
            Held::HubAcceleration(hub) => {
                let axes = hub.specific_force_m_s2;
                digest(axes.map(|axis| axis.unwrap_or(f64::NAN)))
            }
        }
    }
}

/// FNV-1a over the bits of numbers.
fn digest(numbers: impl IntoIterator<Item = f64>) -> u64 {
    numbers.into_iter().fold(0xcbf2_9ce4_8422_2325, |hash, x| {
        (hash ^ x.to_bits()).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

/// The buffer.
#[derive(Clone, Debug)]
pub struct Waiting {
    entries: Vec<Entry>,
    taken: usize,
}

impl Waiting {
    /// An empty buffer with its full capacity reserved.
    pub fn new() -> Self {
        Self {
            entries: Vec::with_capacity(CAPACITY),
            taken: 0,
        }
    }

    /// Adds a sample. Samples beyond the capacity, tens of times what a rig sends, are dropped.
    pub fn push(&mut self, Stamp { time, stream }: Stamp, held: Held) {
        if self.entries.len() < CAPACITY {
            self.entries.push(Entry { time, stream, held });
        }
    }

    /// Sorts the samples; the first is taken next.
    pub fn sort(&mut self) {
        self.taken = 0;
        self.entries.sort_unstable_by(Entry::order);
    }

    /// The next sample in order; `None` after the last, and the buffer is empty then.
    pub fn take(&mut self) -> Option<Entry> {
        let entry = self.entries.get(self.taken).copied();
        self.taken += 1;
        if entry.is_none() {
            self.entries.clear();
        }
        entry
    }
}
