//! Measurements whose parts come in several messages, such as those of an inertial unit.

use std::collections::BTreeMap;

use sample::{FixQuality, LogTime, Measurement};
use wire::column::{Quantity, of_values};

/// Largest age of a part, parts of the interval of its message: an older one is of the instant before.
const AGE_MAX: f64 = 0.6;
/// Growth of the known interval of a message from frame to frame, so that it follows a lower rate.
const INTERVAL_GROWTH: f64 = 1.1;

/// Measurements that have one sample when all of their parts are there.
const KINDS: usize = 5;

/// The measurement that a quantity is a part of.
const fn kind(quantity: Quantity) -> usize {
    match quantity {
        Quantity::Acceleration(_) | Quantity::Rate(_) => 0,
        Quantity::Latitude | Quantity::Longitude | Quantity::Height => 1,
        Quantity::Velocity(_) | Quantity::GroundTrackSpeed | Quantity::Course => 2,
        Quantity::Heading | Quantity::Yaw | Quantity::Pitch | Quantity::Roll => 3,
        _ => 4,
    }
}

/// A part with its time.
#[derive(Clone, Copy, Debug)]
struct Part {
    value: f64,
    time: LogTime,
    /// Largest time to the other parts, s.
    age_max_s: f64,
}

/// The parts of all measurements of a bus.
#[derive(Clone, Debug, Default)]
pub struct Parts {
    /// Parts that each measurement has, with those that wait for others.
    waiting: [BTreeMap<Quantity, Option<Part>>; KINDS],
    /// Time of the last frame of each identifier, and its interval, s.
    intervals: BTreeMap<u32, (LogTime, f64)>,
    /// The receiver says that it has no solution.
    unsolved: bool,
}

impl Parts {
    /// States that a quantity is a part.
    pub fn expect(&mut self, quantity: Quantity) {
        self.waiting[kind(quantity)].insert(quantity, None);
    }

    /// Takes whether the receiver has a solution.
    pub fn take_fix(&mut self, is_solved: bool) {
        self.unsolved = !is_solved;
    }

    /// Takes the parts in a frame. Returns the measurements that they complete.
    pub fn take(&mut self, id: u32, time: LogTime, values: &[(Quantity, f64)]) -> Vec<Measurement> {
        if values.is_empty() {
            return Vec::new();
        }
        let age_max_s = AGE_MAX * self.interval_s(id, time);
        let mut all = Vec::new();
        let mut touched = [false; KINDS];
        for (quantity, value) in values {
            touched[kind(*quantity)] = true;
            let part = Part {
                value: *value,
                time,
                age_max_s,
            };
            self.waiting[kind(*quantity)].insert(*quantity, Some(part));
        }
        for parts in self.waiting.iter_mut().zip(touched).filter(|(_, t)| *t) {
            let (parts, _) = parts;
            for part in parts.values_mut() {
                *part = part.filter(|part| time.seconds_since(part.time) <= part.age_max_s);
            }
            if parts.values().all(Option::is_some) {
                let values = parts.iter_mut();
                let values = values.filter_map(|(q, part)| Some((*q, part.take()?.value)));
                all.extend(of_values(values.collect()));
            }
        }
        if self.unsolved {
            for measurement in &mut all {
                withhold(measurement);
            }
        }
        all
    }

    /// Interval of the frames of an identifier, s; infinite before the second one.
    fn interval_s(&mut self, id: u32, time: LogTime) -> f64 {
        let Some((last, interval_s)) = self.intervals.get_mut(&id) else {
            self.intervals.insert(id, (time, f64::INFINITY));
            return f64::INFINITY;
        };
        let since_s = time.seconds_since(*last);
        if since_s > 0.0 {
            *interval_s = since_s.min(*interval_s * INTERVAL_GROWTH);
        }
        *last = time;
        *interval_s
    }
}

/// Marks a receiver's measurement as being without a solution.
fn withhold(measurement: &mut Measurement) {
    match measurement {
        Measurement::GnssPosition(position) => position.quality = FixQuality::None,
        Measurement::GnssVelocity(velocity) => velocity.quality = FixQuality::None,
        Measurement::GnssAttitude(attitude) => attitude.quality = FixQuality::None,
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Specific forces in one message and rates in another, 0.4 ms later: each sample has those of one
    /// instant, though a frame is lost.
    #[test]
    fn a_lost_frame_mixes_no_instants() {
        let mut parts = Parts::default();
        for axis in 0..3 {
            parts.expect(Quantity::Acceleration(axis));
            parts.expect(Quantity::Rate(axis));
        }
        let mut samples = Vec::new();
        for k in 0..100_u32 {
            let at = |after_s: f64| LogTime(0).offset_seconds(0.01 * f64::from(k) + after_s);
            let value = f64::from(k);
            let force = [0, 1, 2].map(|axis| (Quantity::Acceleration(axis), value));
            let rate = [0, 1, 2].map(|axis| (Quantity::Rate(axis), value));
            if k != 40 {
                samples.extend(parts.take(1, at(0.0), &force));
            }
            if k != 70 {
                samples.extend(parts.take(2, at(0.0004), &rate));
            }
        }
        assert_eq!(samples.len(), 98);
        for sample in samples {
            let Measurement::Imu(imu) = sample else {
                panic!("{sample:?}")
            };
            assert_eq!(imu.specific_force_m_s2, imu.angular_rate_rad_s);
        }
    }

    #[test]
    fn a_receiver_without_a_solution_measures_nothing() {
        let mut parts = Parts::default();
        parts.expect(Quantity::GroundTrackSpeed);
        parts.expect(Quantity::Course);
        let values = [(Quantity::GroundTrackSpeed, 10.0), (Quantity::Course, 0.0)];
        let quality = |parts: &mut Parts, time| match parts.take(1, LogTime(time), &values)[..] {
            [Measurement::GnssVelocity(velocity)] => velocity.quality,
            ref other => panic!("{other:?}"),
        };
        assert_eq!(quality(&mut parts, 0), FixQuality::Single);
        parts.take_fix(false);
        assert_eq!(quality(&mut parts, 100_000_000), FixQuality::None);
        parts.take_fix(true);
        assert_eq!(quality(&mut parts, 200_000_000), FixQuality::Single);
    }
}
