//! Logs of CAN frames that other programs write: what all formats have in common.
//!
//! A reader passes the frames to a sink in the order of the file. A reader never needs memory in
//! proportion to the length of the file. Defects that leave the rest of the file readable (an
//! object of an unknown type, a file that ends in the middle of a record) are counted in a
//! [`Summary`]; a defect that makes the rest unreadable is an error.

mod bytes;
mod defects;
mod error;
mod inflate;

pub mod blf;
pub mod mf4;

use std::ops::ControlFlow;

use sample::CanFrame;

pub use error::Error;

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
    /// Stamp, ns. What time zero is, and whether stamps are differences, is in the [`Summary`].
    pub stamp_ns: i64,
    /// Channel as it is in the file: a number or the name of an interface. `None`: not in the file.
    pub channel: Option<String>,
    /// `None`: not in the file.
    pub direction: Option<Direction>,
    /// Data length code (0 to 15), if the file has it.
    pub dlc: Option<u8>,
    /// Frame. Its `kernel_ns` is `None`.
    pub frame: CanFrame,
}

/// What the stamps of a log mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stamps {
    /// UNIX time.
    Unix,
    /// Time since the start of the measurement.
    SinceStart,
    /// Time of day.
    OfDay,
    /// Each stamp is the time since the frame before it.
    Differences,
}

/// What a reader has found besides the frames.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// Meaning of the stamps.
    pub stamps: Stamps,
    /// Start of the measurement by the clock of the writer's computer, UNIX time in ns as if that
    /// clock showed UTC. `None`: not in the file.
    pub start_ns: Option<i64>,
    /// Frames passed to the sink.
    pub frames: u64,
    /// Number of records that were left out, by kind in plain words ("objects of type 72",
    /// "event lines").
    pub left_out: std::collections::BTreeMap<String, u64>,
    /// Defects that did not stop the reader, in plain words.
    pub defects: Vec<String>,
}

/// Takes the frames; `Break` ends the reading.
pub type Sink<'s> = dyn FnMut(Entry) -> ControlFlow<()> + 's;
