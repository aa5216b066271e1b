//! What the estimator says of its sensors and of itself.

use sample::{Event, EventKind, LogTime, StrainChannel, Wheel};

use crate::fusion::ChannelChange;
use crate::inputs::FrozenChange;
use crate::watch::{CONTRADICTS, FROZEN, SensorChange};

pub(super) fn motion_event(now: LogTime, change: SensorChange) -> Event {
    sensor_event(now, change.faulty, change.name.to_owned(), change.why)
}

pub(super) fn reset_event(now: LogTime, what: &str) -> Event {
    Event {
        time: now,
        onset: now,
        kind: EventKind::FilterReset,
        probability: None,
        load_transfer_ratio: None,
        text: format!("{what} and was started anew"),
    }
}

pub(super) fn channel_event(now: LogTime, change: ChannelChange) -> Event {
    let wheel = Wheel::ALL[change.wheel];
    let channel = change
        .channel
        .map_or("deflection", |channel| channel.name());
    let name = format!("{wheel} {channel}");
    sensor_event(now, change.faulty, name, CONTRADICTS)
}

pub(super) fn frozen_event(now: LogTime, change: FrozenChange) -> Event {
    let channel = StrainChannel::ALL
        .get(change.channel)
        .map_or("deflection", |channel| channel.name());
    let name = format!("{} {channel}", change.wheel);
    sensor_event(now, change.frozen, name, FROZEN)
}

fn sensor_event(now: LogTime, faulty: bool, name: String, why: &str) -> Event {
    let text = if faulty {
        format!("channel {name} {why} and is left out")
    } else {
        format!("channel {name} is used again")
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
