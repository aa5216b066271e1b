//! Instants of the truth near which the forces change within a step: a strut on its stop, a touchdown, and the
//! instant at which the vehicle comes to a standstill.

use std::collections::VecDeque;

use model::vehicle::Vehicle;
use sample::{Estimate, LogTime, PerWheel, Wheel};
use serde_json::{Value, json};

use super::flights::Flights;
use super::{Pair, TILE_PAIRS, contact_load_n};

/// A sample within this time of an instant is near it, s.
const NEAR_S: f64 = 0.1;
/// Time after a sample that the truth must have reached before the sample is compared, s: [`NEAR_S`], and as
/// much again for messages of the ground, which come later than those of the motion.
pub(super) const AHEAD_S: f64 = 2.0 * NEAR_S;
/// Spans that are kept: of at least 13 minutes, which no sample waits for its truth.
const SPANS_MAX: usize = 4096;
/// A vehicle stands below this speed, m/s.
const STANDSTILL_M_S: f64 = 0.05;

/// Instants of the truth near which samples are scored apart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StopCounts {
    /// Times at which a wheel gains contact with the ground.
    pub touchdowns: usize,
    /// Times at which a strut reaches its bump or droop stop; `None`: the truth has no strut lengths, or the
    /// vehicle file no stops.
    pub strut_stops: Option<usize>,
    /// Times at which the vehicle comes to a standstill.
    pub standstills: usize,
}

impl StopCounts {
    /// As JSON, by the keys of `docs/score.md`.
    #[must_use]
    pub fn to_json(self) -> Value {
        json!({
            "touchdowns": self.touchdowns,
            "strut_stops": self.strut_stops,
            "standstills": self.standstills,
        })
    }
}

/// What samples are near to: a stop of the wheel's strut or a touchdown of the wheel, or a standstill.
pub(super) const NEAR: usize = 2;

/// Samples of a tile, one bit each, that are near a stop or touchdown of a wheel, and near a standstill.
pub(super) type Masks = [[u32; 4]; NEAR];

const _: () = assert!(TILE_PAIRS <= u32::BITS as usize);

/// Instants of one kind, each with the time near it.
#[derive(Default)]
struct Instants {
    /// In the order of time, without overlap.
    spans: VecDeque<[LogTime; 2]>,
    count: usize,
}

impl Instants {
    fn push(&mut self, time: LogTime) {
        let [from, to] = [-NEAR_S, NEAR_S].map(|s| time.offset_seconds(s));
        match self.spans.back_mut() {
            Some(last) if from <= last[1] => last[1] = to,
            _ => self.spans.push_back([from, to]),
        }
        if self.spans.len() > SPANS_MAX {
            self.spans.pop_front();
        }
    }

    fn is_near(&self, time: LogTime) -> bool {
        let next = self.spans.partition_point(|span| span[1] < time);
        self.spans.get(next).is_some_and(|span| span[0] <= time)
    }
}

/// One wheel.
struct WheelStops {
    flights: Flights,
    touchdowns: Instants,
    /// Lengths of the strut between its stops, m; `None`: the vehicle file has no stops.
    free_m: Option<[f64; 2]>,
    on_stop: bool,
    stops: Instants,
}

impl WheelStops {
    fn new(vehicle: &Vehicle, wheel: Wheel) -> Self {
        let axle = vehicle.axle(wheel);
        let free_m = axle.strut.as_ref().map(|strut| {
            // The droop stop of a solid axle is that of its damper, whose length the truth does not have.
            let droop_m = if axle.is_solid() {
                f64::INFINITY
            } else {
                strut.droop_stop_length_m
            };
            [strut.bump_stop_length_m, droop_m]
        });
        Self {
            flights: Flights::default(),
            touchdowns: Instants::default(),
            free_m,
            on_stop: false,
            stops: Instants::default(),
        }
    }

    fn push_load(&mut self, time: LogTime, at_s: f64, part: f64) {
        if self.flights.push(at_s, part).is_some() {
            self.touchdowns.count += 1;
            self.touchdowns.push(time);
        }
    }

    /// Takes the next strut length. Returns whether the truth tells if the strut is on a stop.
    fn push_length(&mut self, time: LogTime, length_m: f64) -> bool {
        let Some([bump_m, droop_m]) = self.free_m else {
            return false;
        };
        let on_stop = length_m <= bump_m || length_m >= droop_m;
        if on_stop {
            self.stops.count += usize::from(!self.on_stop);
            self.stops.push(time);
        }
        self.on_stop = on_stop;
        true
    }
}

/// Stops, touchdowns and standstills of the truth so far.
pub(super) struct Stops {
    wheels: PerWheel<WheelStops>,
    is_known: bool,
    moves: bool,
    standstills: Instants,
}

impl Stops {
    pub fn new(vehicle: &Vehicle) -> Self {
        Self {
            wheels: PerWheel::from_fn(|wheel| WheelStops::new(vehicle, wheel)),
            is_known: false,
            moves: false,
            standstills: Instants::default(),
        }
    }

    /// Takes the next instant of the truth.
    pub fn push(&mut self, truth: &Estimate, start: LogTime, loads: &PerWheel<f64>) {
        let at_s = truth.time.seconds_since(start);
        for wheel in Wheel::ALL {
            let part = contact_load_n(truth, wheel) / loads[wheel];
            self.wheels[wheel].push_load(truth.time, at_s, part);
        }
        let speed_m_s = truth.motion.velocity_x_m_s.abs();
        if speed_m_s.is_nan() {
            return;
        }
        let moves = speed_m_s >= STANDSTILL_M_S;
        if self.moves && !moves {
            self.standstills.count += 1;
            self.standstills.push(truth.time);
        }
        self.moves = moves;
    }

    /// Takes the strut lengths of an instant of the truth.
    pub fn push_ground(&mut self, time: LogTime, ground: &store::Ground) {
        for wheel in Wheel::ALL {
            if let Some(length_m) = ground.wheels[wheel].strut_length_m {
                self.is_known |= self.wheels[wheel].push_length(time, length_m);
            }
        }
    }

    /// Samples of a tile that are near a stop.
    pub fn masks(&self, tile: &[Pair]) -> Masks {
        let mut masks = Masks::default();
        for (place, (estimate, _)) in tile.iter().enumerate() {
            let halts = self.standstills.is_near(estimate.time);
            for wheel in Wheel::ALL {
                let of = &self.wheels[wheel];
                let stops = of.touchdowns.is_near(estimate.time) || of.stops.is_near(estimate.time);
                for (mask, near) in masks.iter_mut().zip([stops, halts]) {
                    mask[wheel.index()] |= u32::from(near) << place;
                }
            }
        }
        masks
    }

    pub fn finish(self) -> StopCounts {
        let wheels = || self.wheels.0.iter();
        StopCounts {
            touchdowns: wheels().map(|wheel| wheel.touchdowns.count).sum(),
            strut_stops: self
                .is_known
                .then(|| wheels().map(|wheel| wheel.stops.count).sum()),
            standstills: self.standstills.count,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::rc::Rc;

    use store::{Ground, WheelGround};

    use super::*;

    /// A drive of 2 s at 100 Hz of the built-in vehicle: the front left wheel is in the air from 0.5 to 0.6 s, the
    /// rear right strut is on its bump stop from 1.0 to 1.1 s, and the vehicle stands from 1.5 s on.
    fn stops(with_lengths: bool) -> (Stops, LogTime) {
        let vehicle = Vehicle::builtin("prowler").expect("a vehicle");
        let strut = vehicle.rear.strut.clone().expect("a strut");
        let loads = super::super::static_loads(&vehicle);
        let start = LogTime(1_000_000_000);
        let mut stops = Stops::new(&vehicle);
        for k in 0..200 {
            let at_s = f64::from(k) * 0.01;
            let mut truth = estimate(start.offset_seconds(at_s));
            for wheel in Wheel::ALL {
                let in_air = wheel == Wheel::FrontLeft && (50..60).contains(&k);
                let load_n = if in_air { 0.0 } else { loads[wheel] };
                truth.measured[wheel].force_n = [0.0, 0.0, load_n];
            }
            truth.motion.velocity_x_m_s = if k < 150 { 5.0 } else { 0.0 };
            stops.push(&truth, start, &loads);
            let mut ground = Ground::default();
            for wheel in Wheel::ALL {
                let bump = wheel == Wheel::RearRight && (100..110).contains(&k);
                let length_m = if bump {
                    strut.bump_stop_length_m - 1e-3
                } else {
                    strut.design_length_m
                };
                ground.wheels[wheel] = WheelGround {
                    strut_length_m: with_lengths.then_some(length_m),
                    ..WheelGround::default()
                };
            }
            stops.push_ground(truth.time, &ground);
        }
        (stops, start)
    }

    fn estimate(time: LogTime) -> Estimate {
        Estimate {
            time,
            motion: sample::Motion::UNKNOWN,
            carrier: PerWheel::default(),
            measured: PerWheel::default(),
            expected: PerWheel::default(),
            rollover: sample::Rollover::default(),
        }
    }

    #[test]
    fn a_tenth_of_a_second_on_both_sides_of_stops_is_near_them_at_their_wheel() {
        let (stops, start) = stops(true);
        let near = |group: usize, wheel: Wheel| {
            let is_near = |k: &i64| {
                let sample = estimate(start.offset_seconds(*k as f64 * 0.01));
                let pair = (Box::new(sample.clone()), Rc::new(Box::new(sample)));
                stops.masks(&[pair])[group][wheel.index()] == 1
            };
            (0..200).filter(is_near).collect::<Vec<_>>()
        };
        // The load is back at 0.6 s. The strut leaves its stop after 1.09 s.
        assert_eq!(near(0, Wheel::FrontLeft), Vec::from_iter(50..=70));
        assert_eq!(near(0, Wheel::RearRight), Vec::from_iter(90..=119));
        assert!(near(0, Wheel::FrontRight).is_empty());
        for wheel in Wheel::ALL {
            assert_eq!(near(1, wheel), Vec::from_iter(140..=160));
        }
        let counts = stops.finish();
        assert_eq!(
            (counts.touchdowns, counts.strut_stops, counts.standstills),
            (1, Some(1), 1)
        );
    }

    #[test]
    fn without_strut_lengths_the_number_of_stops_is_unknown() {
        assert_eq!(stops(false).0.finish().strut_stops, None);
    }
}
