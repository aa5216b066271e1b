use std::ops::Range;

use sample::{ControlSample, DeviceTime, Measurement, Signal};

use crate::{crossbow440, line, nmea, novatel, sbf, ubx, vectornav};

/// The language that a message was written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Protocol {
    /// Crossbow 440 packets.
    Crossbow440,
    /// NovAtel binary, long or short header.
    NovatelBinary,
    /// NovAtel ASCII, long or short header.
    NovatelAscii,
    /// Septentrio Binary Format.
    Sbf,
    /// NMEA 0183.
    Nmea,
    /// u-blox UBX.
    Ubx,
    /// VectorNav, binary or ASCII.
    Vectornav,
    /// RTCM 3 frames, which are not decoded.
    Rtcm,
    /// A receiver's plain-text answer to a command.
    Reply,
    /// A configured text device.
    Line,
    /// Delimited text.
    Csv,
    /// A MOOS log.
    Alog,
}

impl Protocol {
    /// Name in logs, snake case.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Crossbow440 => "crossbow440",
            Self::NovatelBinary => "novatel_binary",
            Self::NovatelAscii => "novatel_ascii",
            Self::Sbf => "sbf",
            Self::Nmea => "nmea",
            Self::Ubx => "ubx",
            Self::Vectornav => "vectornav",
            Self::Rtcm => "rtcm",
            Self::Reply => "reply",
            Self::Line => "line",
            Self::Csv => "csv",
            Self::Alog => "alog",
        }
    }
}

/// One message as a decoder hands it on.
#[derive(Clone, Debug, PartialEq)]
pub struct Item<'a> {
    /// The language that it was written in.
    pub protocol: Protocol,
    /// The message's name in the maker's manual; `"unknown"` if this crate does not decode it.
    pub name: &'static str,
    /// The device's own time: the time tag of the solution, before `latency_s` is taken off.
    pub device_time: Option<DeviceTime>,
    /// How long before `device_time` the velocity was true, from the message's own field, s; of a
    /// table's row how long before its arrival it was true.
    pub latency_s: Option<f64>,
    /// What it measured, in SI.
    pub measurements: Measurements,
    /// The message field by field, in the maker's units.
    pub message: Message,
    /// Its bytes, header and checksum included.
    pub raw: &'a [u8],
    /// Where they stand in the stream, in bytes from the decoder's start.
    pub range: Range<u64>,
}

/// A decoded message, field by field.
#[expect(
    clippy::large_enum_variant,
    reason = "it lives for one message, on the stack"
)]
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Message {
    /// A Crossbow 440 packet.
    Crossbow440(crossbow440::Packet),
    /// A NovAtel log.
    Novatel(novatel::Log),
    /// A Septentrio block.
    Sbf(sbf::Block),
    /// An NMEA sentence.
    Nmea(nmea::Sentence),
    /// A UBX message.
    Ubx(Box<ubx::Body>),
    /// An output of a VectorNav unit.
    Vectornav(Box<vectornav::Output>),
    /// A reading of a text device.
    Line(line::Reading),
    /// A row of a table; the text is in [`Item::raw`].
    Row,
    /// A plain-text answer; the text is in [`Item::raw`].
    Reply,
    /// Framed and checked, but not decoded; the number is the message id where it has one.
    Unknown(Option<u16>),
    /// Framed and checked, but its content makes no sense; as `Unknown`.
    Malformed(Option<u16>),
}

/// The measurements of one message: none to four, held in place.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measurements {
    slots: [Option<Measurement>; Self::CAPACITY],
}

impl Measurements {
    /// The most that one message gives.
    pub const CAPACITY: usize = 4;

    /// No measurement.
    #[must_use]
    pub const fn none() -> Self {
        Self {
            slots: [const { None }; Self::CAPACITY],
        }
    }

    /// One measurement.
    #[must_use]
    pub fn one(measurement: Measurement) -> Self {
        Self {
            slots: [Some(measurement), None, None, None],
        }
    }

    /// Two measurements.
    #[must_use]
    pub fn two(first: Measurement, second: Measurement) -> Self {
        Self {
            slots: [Some(first), Some(second), None, None],
        }
    }

    /// Three measurements.
    #[must_use]
    pub fn three(first: Measurement, second: Measurement, third: Measurement) -> Self {
        Self {
            slots: [Some(first), Some(second), Some(third), None],
        }
    }

    /// The measurements that there are, of at most four.
    #[must_use]
    pub(crate) fn of(all: [Option<Measurement>; Self::CAPACITY]) -> Self {
        let mut found = all.into_iter().flatten();
        Self {
            slots: std::array::from_fn(|_| found.next()),
        }
    }

    /// The measurements in order.
    pub fn iter(&self) -> impl Iterator<Item = &Measurement> {
        self.slots.iter().flatten()
    }

    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.iter().count()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.slots[0].is_none()
    }
}

impl IntoIterator for Measurements {
    type Item = Measurement;
    type IntoIter =
        std::iter::Flatten<std::array::IntoIter<Option<Measurement>, { Measurements::CAPACITY }>>;

    fn into_iter(self) -> Self::IntoIter {
        self.slots.into_iter().flatten()
    }
}

/// Values by name, each with its unit.
pub(crate) fn values(all: &[(&str, f64, &str)]) -> ControlSample {
    let values = all.iter().map(|(name, value, unit)| Signal {
        name: (*name).into(),
        value: *value,
        unit: (*unit).into(),
    });
    ControlSample {
        values: values.collect(),
    }
}
