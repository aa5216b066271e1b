//! Logs of CAN frames that other programs write.
//!
//! A reader passes the frames to a sink in the order of the file. A reader never needs memory in
//! proportion to the length of the file. Defects that leave the rest of the file readable (an
//! object of an unknown type, a file that ends in the middle of a record) are counted in a
//! [`Summary`]; a defect that makes the rest unreadable is an [`Error`].

pub mod asc;
pub mod blf;
mod bytes;
pub mod candump;
mod date;
mod defects;
mod error;
mod format;
mod inflate;
mod lines;
pub mod mf4;
mod number;
pub mod trc;

use std::collections::BTreeMap;
use std::io::{Read, Seek};
use std::ops::ControlFlow;

use sample::{CanFlags, CanFrame};

pub use error::Error;
pub use format::{Format, HEAD_BYTES, recognise};

/// Most defects that a [`Summary`] describes; the others are only counted.
const DEFECTS_MAX: usize = 10;
/// Most bytes of a line in the description of a defect.
const SHOWN_MAX: usize = 100;
/// Most channels of a file.
const CHANNELS_MAX: usize = 256;

/// Which way a frame went, seen from the tool that wrote the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Received.
    Received,
    /// Sent, and seen on the bus.
    Sent,
    /// Handed to the controller for sending; not yet on the bus.
    SendRequest,
}

/// One frame of a log.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Stamp, ns. What time zero is, is in the [`Summary`]. Differences are summed.
    pub stamp_ns: i64,
    /// Position in [`Summary::channels`]. `None`: the file does not tell the channel.
    pub channel: Option<u16>,
    /// `None`: not in the file.
    pub direction: Option<Direction>,
    /// Data length code as it is in the file, if the file has it. Binary files can have one above 15.
    pub dlc: Option<u8>,
    /// Frame. Its `kernel_ns` is `None`.
    pub frame: CanFrame,
}

/// Record of a log.
#[derive(Clone, Debug, PartialEq)]
#[allow(
    clippy::large_enum_variant,
    reason = "records are passed one by one and not stored"
)]
pub enum Record {
    /// A frame.
    Frame(Entry),
    /// The program that wrote the log reports that frames were lost here.
    Lost {
        /// Position in [`Summary::channels`], if the file tells the channel.
        channel: Option<u16>,
        /// Number of lost frames.
        count: u64,
    },
}

/// What the stamps of a log mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Stamps {
    /// UNIX time.
    Unix,
    /// Time since the start of the measurement.
    #[default]
    SinceStart,
    /// Time of day.
    OfDay,
    /// Date and time of the writer's computer, as UNIX time as if its clock showed UTC.
    LocalDate,
    /// Each stamp is the time since the record before it; an [`Entry`] has the sum.
    Differences,
}

/// What a reader has found besides the frames.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Summary {
    /// Meaning of the stamps.
    pub stamps: Stamps,
    /// Start of the measurement (of the day for [`Stamps::OfDay`]) by the clock of the writer's
    /// computer, UNIX time in ns as if that clock showed UTC. `None`: not in the file.
    pub start_ns: Option<i64>,
    /// Names of the channels, in the order of their first records: an interface, or a number.
    pub channels: Vec<String>,
    /// Frames passed to the sink.
    pub frames: u64,
    /// Number of records that were left out, by kind in plain words ("objects of type 72",
    /// "event lines").
    pub left_out: BTreeMap<String, u64>,
    /// The first defects that did not stop the reader, in plain words.
    pub defects: Vec<String>,
    /// Number of all defects.
    pub defect_count: u64,
    /// Form of the lines of a candump log.
    pub style: Option<candump::Style>,
    /// Number of lines of a candump log that [`candump::Style::write`] does not write so.
    pub restyled: u64,
}

impl Summary {
    /// With these defects.
    fn with(mut self, defects: defects::Defects) -> Self {
        self.defects = defects.sentences();
        self.defect_count = self.defects.len() as u64;
        self
    }

    /// Counts a record that is left out.
    pub(crate) fn leave_out(&mut self, kind: &str) {
        match self.left_out.get_mut(kind) {
            Some(count) => *count += 1,
            None => {
                self.left_out.insert(kind.to_owned(), 1);
            }
        }
    }

    /// Counts a defect, and describes it if it is one of the first.
    pub(crate) fn defect(&mut self, text: impl FnOnce() -> String) {
        self.defect_count += 1;
        if self.defects.len() < DEFECTS_MAX {
            self.defects.push(text());
        }
    }

    /// Counts a line that cannot be read as `expected`.
    fn unreadable(&mut self, line: lines::Line<'_>, expected: &str) {
        self.leave_out("lines that cannot be read");
        self.defect(|| {
            let text = String::from_utf8_lossy(&line.bytes[..line.bytes.len().min(SHOWN_MAX)]);
            let text = text.escape_debug();
            match line.ended {
                true => format!("line {}: \"{text}\" is not {expected}", line.number),
                false => format!(
                    "line {}: \"{text}\" is not {expected}: the file ends in the middle of a line",
                    line.number
                ),
            }
        });
    }

    /// Position of a channel among [`Summary::channels`]; `None` beyond 256 channels, which no file
    /// has.
    pub(crate) fn channel(&mut self, name: &str) -> Option<u16> {
        position_of(&mut self.channels, name)
    }
}

/// Position of a value in a list, to which it is added if it is not in it.
fn position_of<T: PartialEq<U>, U: ToOwned<Owned = T> + ?Sized>(
    list: &mut Vec<T>,
    value: &U,
) -> Option<u16> {
    let found = list.iter().position(|known| known == value);
    let position = match found {
        Some(position) => position,
        None if list.len() < CHANNELS_MAX => {
            list.push(value.to_owned());
            list.len() - 1
        }
        None => return None,
    };
    u16::try_from(position).ok()
}

/// [`CanFrame::len8_dlc`] of a frame with this data length code.
fn len8_dlc(flags: CanFlags, dlc: Option<u8>) -> u8 {
    let is_longer = |code: &u8| (9..=15).contains(code) && !flags.fd && !flags.error;
    dlc.filter(is_longer).unwrap_or(0)
}

/// Reads a log of this format.
///
/// # Errors
/// As the reader of the format; [`Error::NotRead`] for a format that is not read.
pub fn read(
    format: Format,
    input: &mut (impl Read + Seek),
    sink: &mut Sink<'_>,
) -> Result<Summary, Error> {
    match format {
        Format::Candump => candump::read(input, sink),
        Format::Asc => asc::read(input, sink),
        Format::Trc => trc::read(input, sink),
        Format::Blf => blf::read(input, sink),
        Format::Mf4 => mf4::read(input, sink),
        Format::Other(found, help) => Err(Error::NotRead { found, help }),
    }
}

/// As [`read`], for a file whose summary is known: the summary has no [`Summary::style`] then, and counts
/// no [`Summary::restyled`] lines.
///
/// # Errors
/// As [`read`].
pub fn read_frames(
    format: Format,
    input: &mut (impl Read + Seek),
    sink: &mut Sink<'_>,
) -> Result<Summary, Error> {
    match format {
        Format::Candump => candump::read_frames(input, sink),
        other => read(other, input, sink),
    }
}

/// Takes the records; `Break` ends the reading.
pub type Sink<'s> = dyn FnMut(Record) -> ControlFlow<()> + 's;
