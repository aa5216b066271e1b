//! Estimates for controllers: frames of a CAN bus and datagrams. docs/live.md has both layouts.
//!
//! Forces are in the wheel-carrier frame (y = spindle axis, x = unit(y × z of the chassis),
//! z = x × y), in N. Wheels are in the order FL, FR, RL, RR.

mod can;
mod datagram;

use sample::{
    Axle, Estimate, Event, EventKind, LogTime, Motion, PerWheel, Rollover, Side, TyreForce, Wheel,
};

pub use can::{DBC, FRAMES, decode_frames, encode_frames};
pub use datagram::{DATAGRAM_BYTES, decode_datagram, encode_datagram, encode_json};

/// Time after an event's lead time for which its warning is kept, s.
const WARNING_KEPT_S: f64 = 0.5;

/// Whether the values may be used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Validity {
    /// The forces are valid.
    Valid = 0,
    /// There has been no estimate yet.
    #[default]
    None = 1,
    /// The newest estimate is too old; its values are not sent again.
    Stale = 2,
    /// The estimate is new, but its forces are unknown.
    Unknown = 3,
}

impl Validity {
    const ALL: [Self; 4] = [Self::Valid, Self::None, Self::Stale, Self::Unknown];

    /// The validity with this number.
    #[must_use]
    pub fn from_number(number: u8) -> Option<Self> {
        Self::ALL.get(usize::from(number)).copied()
    }
}

/// State of the wheels by the events.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LiftState {
    /// Wheels off the ground.
    pub lifted: PerWheel<bool>,
    /// Wheels that are predicted to lift.
    pub warned: PerWheel<bool>,
    /// Sides with both wheels off the ground, left and right.
    pub side_lifted: [bool; 2],
    /// Sides with both wheels predicted to lift.
    pub side_warned: [bool; 2],
    /// Number of changes of the surface under each axle, modulo 256.
    pub surface_changes: [u8; 2],
    /// Number of all lift and surface events, modulo 256.
    pub events: u8,
}

/// What a controller receives at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControllerOutput {
    /// Whether the values may be used.
    pub validity: Validity,
    /// Instant of the estimate.
    pub time: LogTime,
    /// Time from the instant of the estimate to the sending, s.
    pub age_s: f64,
    /// Forces in the wheel-carrier frame.
    pub forces: PerWheel<TyreForce>,
    /// Load-transfer ratios and times to lift.
    pub rollover: Rollover,
    /// Motion of the body.
    pub motion: Motion,
    /// Wheels off the ground, warnings, changes of the surface.
    pub lift: LiftState,
}

/// Follows estimates and events, and gives what is to be sent.
#[derive(Clone, Debug, Default)]
pub struct OutputState {
    newest: Option<Estimate>,
    lift: LiftState,
    /// Ends of the warnings of wheels and sides.
    warned_until: [Option<LogTime>; 4],
    side_warned_until: [Option<LogTime>; 2],
}

impl OutputState {
    /// Takes a new estimate.
    pub fn estimate(&mut self, estimate: &Estimate) {
        self.newest = Some(estimate.clone());
    }

    /// Takes an event. Events of sensors and filters change nothing.
    pub fn event(&mut self, event: &Event) {
        // A warning of a load that does not fall names no time.
        let until = |lead_s: f64| {
            let lead_s = if lead_s.is_finite() { lead_s } else { 0.0 };
            Some(event.time.offset_seconds(lead_s + WARNING_KEPT_S))
        };
        let lift = &mut self.lift;
        match &event.kind {
            EventKind::LiftWarning(wheel, lead_s) => {
                self.warned_until[wheel.index()] = until(*lead_s);
            }
            EventKind::Lift(wheel) => lift.lifted[*wheel] = true,
            EventKind::Touchdown(wheel) => {
                lift.lifted[*wheel] = false;
                self.warned_until[wheel.index()] = None;
                let side = if wheel.is_left() {
                    Side::Left
                } else {
                    Side::Right
                };
                lift.side_lifted[side.index()] = false;
                self.side_warned_until[side.index()] = None;
            }
            EventKind::TwoWheelLiftWarning(side, lead_s) => {
                self.side_warned_until[side.index()] = until(*lead_s);
            }
            EventKind::TwoWheelLift(side) => lift.side_lifted[side.index()] = true,
            EventKind::SurfaceChange(axle, _) => {
                let count = &mut lift.surface_changes[usize::from(*axle == Axle::Rear)];
                *count = count.wrapping_add(1);
            }
            EventKind::SensorFault(_)
            | EventKind::SensorRecovered(_)
            | EventKind::Mistake(_)
            | EventKind::InexactParameters(_)
            | EventKind::FilterReset
            | EventKind::FilterRecovered => return,
        }
        lift.events = lift.events.wrapping_add(1);
    }

    /// What is to be sent at `now`. An estimate older than `stale_s` is not valid, and its values are
    /// not repeated.
    #[must_use]
    pub fn at(&self, now: LogTime, stale_s: f64) -> ControllerOutput {
        let mut lift = self.lift;
        let lasts = |until: &Option<LogTime>| until.is_some_and(|until| until >= now);
        lift.warned = PerWheel::from_fn(|wheel| lasts(&self.warned_until[wheel.index()]));
        lift.side_warned = [0, 1].map(|side| lasts(&self.side_warned_until[side]));
        let none = ControllerOutput {
            validity: Validity::None,
            time: LogTime::default(),
            age_s: f64::INFINITY,
            forces: PerWheel::default(),
            rollover: Rollover::default(),
            motion: Motion::UNKNOWN,
            lift,
        };
        let Some(newest) = &self.newest else {
            return none;
        };
        let age_s = now.seconds_since(newest.time);
        let (time, stale) = (newest.time, age_s > stale_s);
        if stale {
            return ControllerOutput {
                validity: Validity::Stale,
                time,
                age_s,
                ..none
            };
        }
        let is_known = |wheel: Wheel| newest.carrier[wheel].force_n.iter().all(|f| f.is_finite());
        ControllerOutput {
            validity: if Wheel::ALL.into_iter().all(is_known) {
                Validity::Valid
            } else {
                Validity::Unknown
            },
            time,
            age_s,
            forces: newest.carrier,
            rollover: newest.rollover,
            motion: newest.motion,
            lift,
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn estimate(time: LogTime) -> Estimate {
        Estimate {
            time,
            motion: Motion {
                velocity_x_m_s: 8.0,
                roll_rad: 0.1,
                ..Motion::default()
            },
            carrier: PerWheel::from_fn(|wheel| TyreForce {
                force_n: [10.0, -20.0, 1000.0 + wheel.index() as f64],
                sigma_n: [5.0, 6.0, 7.0],
                ..TyreForce::default()
            }),
            measured: PerWheel::default(),
            expected: PerWheel::default(),
            rollover: Rollover {
                load_transfer_ratio: -0.25,
                load_transfer_ratio_sigma: 0.01,
                time_to_lift_s: PerWheel([0.5, f64::INFINITY, 1.5, f64::NAN]),
                time_to_two_wheel_lift_s: [2.0, f64::INFINITY],
                ..Rollover::default()
            },
        }
    }

    fn event(time: LogTime, kind: EventKind) -> Event {
        Event {
            time,
            onset: time,
            kind,
            probability: None,
            load_transfer_ratio: None,
            text: String::new(),
        }
    }

    #[test]
    fn a_stale_estimate_is_marked_and_its_values_are_not_repeated() {
        let start = LogTime(1_000_000_000);
        let mut state = OutputState::default();
        assert_eq!(state.at(start, 0.03).validity, Validity::None);
        state.estimate(&estimate(start));
        let fresh = state.at(start.offset_seconds(0.02), 0.03);
        assert_eq!(fresh.validity, Validity::Valid);
        assert!((fresh.age_s - 0.02).abs() < 1e-9);
        let stale = state.at(start.offset_seconds(0.04), 0.03);
        assert_eq!(stale.validity, Validity::Stale);
        assert!(stale.forces[Wheel::FrontLeft].force_n[2].is_nan());
        assert!(stale.rollover.load_transfer_ratio.is_nan());
        let mut unknown = estimate(start);
        unknown.carrier[Wheel::RearLeft].force_n[0] = f64::NAN;
        state.estimate(&unknown);
        assert_eq!(state.at(start, 0.03).validity, Validity::Unknown);
    }

    #[test]
    fn lifts_last_until_touchdown_and_warnings_for_their_lead_time() {
        let start = LogTime(1_000_000_000);
        let mut state = OutputState::default();
        state.event(&event(
            start,
            EventKind::LiftWarning(Wheel::FrontRight, 0.4),
        ));
        state.event(&event(start, EventKind::Lift(Wheel::FrontRight)));
        state.event(&event(start, EventKind::TwoWheelLift(Side::Right)));
        state.event(&event(start, EventKind::SensorFault("imu".to_owned())));
        let lift = state.at(start, 1.0).lift;
        assert!(lift.lifted[Wheel::FrontRight] && lift.warned[Wheel::FrontRight]);
        assert!(lift.side_lifted[1] && !lift.side_lifted[0]);
        assert_eq!(lift.events, 3);
        assert!(!state.at(start.offset_seconds(1.0), 1.0).lift.warned[Wheel::FrontRight]);
        state.event(&event(start, EventKind::Touchdown(Wheel::FrontRight)));
        let lift = state.at(start, 1.0).lift;
        assert!(!lift.lifted[Wheel::FrontRight] && !lift.side_lifted[1]);
    }
}
