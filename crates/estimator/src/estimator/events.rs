//! Events about sensors and filters.

use model::vehicle::Vehicle;
use sample::{Event, EventKind, LogTime, StrainChannel, Wheel};

use crate::calibration::hub::WrongAxes;
use crate::fusion::ChannelChange;
use crate::inputs::{FrozenChange, RangeFault};
use crate::watch::{CONTRADICTS, FROZEN, SensorChange};

use super::Output;

pub(super) fn motion_event(now: LogTime, change: SensorChange) -> Event {
    sensor_event(now, change.faulty, change.name.to_owned(), change.why)
}

/// A hub accelerometer that was found to be mounted turned, or that is right again.
pub(super) fn hub_event(now: LogTime, wheel: Wheel, wrong: Option<WrongAxes>) -> Event {
    let name = format!("{} hub acceleration", wheel.abbreviation());
    let why = wrong.map(|wrong| format!("has wrong axes: {wrong}"));
    sensor_event(now, why.is_some(), name, why.as_deref().unwrap_or_default())
}

/// A vehicle file that contradicts the drive, or does not any more; `square` is the mean square of the
/// normalised innovations of lateral acceleration.
pub(super) fn vehicle_event(now: LogTime, contradicts: bool, square: f64) -> Event {
    let text = if contradicts {
        format!(
            "the vehicle file contradicts the drive: the innovations of lateral acceleration have a mean \
             square of {square:.0} over 10 s, but 1 is expected; check units and scales and the vehicle \
             file, or identify the handling"
        )
    } else {
        "the vehicle file does not contradict the drive any more".to_owned()
    };
    Event {
        text,
        ..sensor_event(now, contradicts, "vehicle file".to_owned(), "")
    }
}

/// State of a filter that can diverge, from its restart to its recovery.
#[derive(Clone, Copy, Debug)]
pub(super) struct Divergence {
    name: &'static str,
    /// Time without a further start after which the filter has settled, s.
    recovery_s: f64,
    /// Number of restarts so far.
    starts: u64,
    /// Time of the last restart, until the filter has settled.
    since: Option<LogTime>,
}

impl Divergence {
    /// For the filter that events call `name`.
    pub(super) fn new(name: &'static str, recovery_s: f64) -> Self {
        Self {
            name,
            recovery_s,
            starts: 0,
            since: None,
        }
    }

    /// Compares the number of restarts with the one before. A filter that restarts repeatedly is
    /// reported once. Restarts that come `silently` belong to the filter's first start.
    pub(super) fn step(
        &mut self,
        now: LogTime,
        starts: u64,
        silently: bool,
        out: &mut impl FnMut(Output),
    ) {
        let event = |kind, text| {
            Output::Event(Event {
                time: now,
                onset: now,
                kind,
                probability: None,
                load_transfer_ratio: None,
                text,
            })
        };
        if starts > self.starts {
            self.starts = starts;
            if !silently && self.since.is_none() {
                let text = format!("the {} filter diverged and was started anew", self.name);
                out(event(EventKind::FilterReset, text));
            }
            if !silently || self.since.is_some() {
                self.since = Some(now);
            }
        } else if self
            .since
            .is_some_and(|since| now.seconds_since(since) > self.recovery_s)
        {
            self.since = None;
            let text = format!("the {} filter has settled again", self.name);
            out(event(EventKind::FilterRecovered, text));
        }
    }
}

pub(super) fn channel_event(now: LogTime, change: ChannelChange, vehicle: &Vehicle) -> Event {
    let wheel = Wheel::ALL[change.wheel];
    let channel = change
        .channel
        .map_or("deflection", |channel| vehicle.channel_name(wheel, channel));
    let name = format!("{wheel} {channel}");
    sensor_event(now, change.faulty, name, CONTRADICTS)
}

pub(super) fn frozen_event(now: LogTime, change: FrozenChange, vehicle: &Vehicle) -> Event {
    let FrozenChange { wheel, channel, .. } = change;
    let channel = StrainChannel::from_name(channel)
        .map_or(channel, |channel| vehicle.channel_name(wheel, channel));
    let name = format!("{wheel} {channel}");
    sensor_event(now, change.frozen, name, FROZEN)
}

/// A channel whose counts the sensors file does not allow.
pub(super) fn range_event(now: LogTime, fault: &RangeFault, vehicle: &Vehicle) -> Event {
    let RangeFault {
        wheel,
        channel,
        beyond,
    } = fault;
    let channel = channel.map_or("deflection", |channel| {
        vehicle.channel_name(*wheel, channel)
    });
    let why = format!("has counts beyond its range: {beyond}");
    sensor_event(now, true, format!("{wheel} {channel}"), &why)
}

pub(super) fn temperature_event(
    now: LogTime,
    wheel: Wheel,
    is_old: bool,
    last_c: Option<f64>,
) -> Event {
    let name = format!("{wheel} bridge temperature");
    let why = match last_c {
        Some(last_c) => format!(
            "does not arrive; the last value of {last_c:.1} degrees Celsius is used with a larger standard deviation of \
             the strain offsets"
        ),
        None => "does not arrive; the reference temperature of the calibration is used with a larger standard deviation \
                 of the strain offsets"
            .to_owned(),
    };
    sensor_event(now, is_old, name, &why)
}

fn sensor_event(now: LogTime, faulty: bool, name: String, why: &str) -> Event {
    let text = if faulty {
        format!("channel {name} {why}")
    } else {
        format!("channel {name} is good again")
    };
    Event {
        time: now,
        onset: now,
        kind: if faulty {
            EventKind::SensorFault(name)
        } else {
            EventKind::SensorRecovered(name)
        },
        probability: None,
        load_transfer_ratio: None,
        text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On a MacPherson strut, an event names the force that the channel measures there.
    #[test]
    fn events_name_the_channels_of_a_strut() {
        let struts = include_str!("../../../../testdata/vehicle-with-struts.toml");
        let struts = Vehicle::from_toml(struts, "struts.toml").unwrap();
        let arms = Vehicle::builtin("prowler").unwrap();
        let wheel = Wheel::FrontLeft;
        let told = |vehicle: &Vehicle, channel| {
            let faulty = ChannelChange {
                wheel: wheel.index(),
                channel: Some(channel),
                faulty: true,
            };
            let frozen = FrozenChange {
                wheel,
                channel: channel.name(),
                frozen: true,
            };
            let events = [
                channel_event(LogTime(0), faulty, vehicle),
                frozen_event(LogTime(0), frozen, vehicle),
            ];
            events.map(|event| event.text)
        };
        for text in told(&struts, StrainChannel::UpperRear) {
            assert!(text.contains("strut_side_y"), "{text}");
        }
        for text in told(&struts, StrainChannel::LowerRear) {
            assert!(text.contains("lower_rear"), "{text}");
        }
        for text in told(&arms, StrainChannel::UpperRear) {
            assert!(text.contains("upper_rear"), "{text}");
        }
    }
}
