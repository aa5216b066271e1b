//! Channels that the estimator excluded, and whether they were faulty.

use sample::{Event, EventKind, LogTime};
use serde_json::{Value, json};
use store::InjectedFault;

/// An exclusion belongs to a fault until this time after its end, s.
const AFTER_FAULT_S: f64 = 2.0;

/// Channels that were excluded.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Channels {
    /// Exclusions of channels that had no fault: names in the order of time.
    pub healthy: Vec<String>,
    /// How many of them were used again.
    pub healthy_recovered: usize,
    /// Faults of channels that were injected.
    pub faults: usize,
    /// Those of them without an exclusion while they lasted.
    pub missed: Vec<String>,
}

impl Channels {
    /// As JSON.
    #[must_use]
    pub fn to_json(&self) -> Value {
        json!({
            "excluded_healthy": self.healthy,
            "excluded_healthy_recovered": self.healthy_recovered,
            "injected_faults": self.faults,
            "missed_faults": self.missed,
        })
    }
}

/// Compares the exclusions with the faults that the simulation injected; `start` is the start of the
/// truth.
pub(super) fn find(
    injected: &[InjectedFault],
    start: LogTime,
    from_s: f64,
    events: &[Event],
) -> Channels {
    let mut all = Channels {
        faults: injected.len(),
        ..Channels::default()
    };
    let is_of = |fault: &InjectedFault, name: &str, at_s: f64| {
        let span = fault.from_s..fault.to_s + AFTER_FAULT_S;
        name.starts_with(&fault.sensor) && span.contains(&at_s)
    };
    let mut excluded: Vec<&str> = Vec::new();
    for event in events {
        let at_s = event.time.seconds_since(start);
        match &event.kind {
            EventKind::SensorFault(name)
                if at_s >= from_s && !injected.iter().any(|fault| is_of(fault, name, at_s)) =>
            {
                all.healthy.push(name.clone());
                excluded.push(name);
            }
            EventKind::SensorRecovered(name) => {
                if let Some(at) = excluded.iter().position(|other| *other == name) {
                    excluded.remove(at);
                    all.healthy_recovered += 1;
                }
            }
            _ => {}
        }
    }
    let found = |fault: &&InjectedFault| {
        events.iter().any(|event| match &event.kind {
            EventKind::SensorFault(name) => is_of(fault, name, event.time.seconds_since(start)),
            _ => false,
        })
    };
    let missed = injected.iter().filter(|fault| !found(fault));
    all.missed = missed.map(|fault| fault.sensor.clone()).collect();
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_channel_is_healthy_before_its_fault_and_without_one() {
        let event = |at_s: f64, kind: EventKind| Event {
            time: LogTime(0).offset_seconds(at_s),
            onset: LogTime(0).offset_seconds(at_s),
            kind,
            probability: None,
            load_transfer_ratio: None,
            text: String::new(),
        };
        let fault = |name: &str| EventKind::SensorFault(name.to_owned());
        let events = [
            event(3.0, fault("FL lower_front")),
            event(4.0, EventKind::SensorRecovered("FL lower_front".to_owned())),
            event(6.0, fault("FL lower_front")),
            event(7.0, fault("RR tie_rod")),
            event(8.0, fault("inertial unit yaw rate")),
        ];
        let injected = |sensor: &str, from_s: f64, to_s: f64| InjectedFault {
            sensor: sensor.to_owned(),
            from_s,
            to_s,
        };
        let faults = [
            injected("FL lower_front", 5.0, 5.5),
            injected("inertial unit", 7.5, 9.0),
            injected("RL deflection", 1.0, 9.0),
        ];
        let found = find(&faults, LogTime(0), 2.0, &events);
        assert_eq!(found.healthy, ["FL lower_front", "RR tie_rod"]);
        assert_eq!(found.healthy_recovered, 1);
        assert_eq!(
            (found.faults, found.missed),
            (3, vec!["RL deflection".to_owned()])
        );
    }
}
