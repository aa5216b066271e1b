//! The only crate that touches devices and clocks: sources, stamps, supervision.
//!
//! A [`Supervisor`] runs one task for each [`SourceSpec`]. The tasks push what the operating
//! system gives them, unaltered, into the [`Sequencer`], which stamps and numbers it and hands it
//! to the recorder and to the estimator through bounded queues. Nothing here knows what the bytes
//! mean, save for SLCAN, whose text is turned into frames, and the dialogues that set a device up.

#![allow(
    clippy::disallowed_types,
    reason = "arrivals are stamped here, and nowhere else"
)]

mod can;
mod can_sender;
pub mod clock;
mod context;
mod datagram;
mod dialogue;
pub mod link;
mod pace;
mod port;
mod protocol;
mod ring;
pub mod sequencer;
mod serial;
mod slcan;
pub mod spec;
pub mod supervisor;
mod sys;
mod virtual_port;

pub use can_sender::CanSender;
pub use clock::{LogClock, Reading};
pub use link::LinkSpec;
pub use sequencer::{QueueSizes, RingLimits, Sequencer, SourceCounters, Streams};
pub use spec::{
    CanFilter, CanSpec, Parity, PortSpec, SerialSpec, Setup, SlcanSpec, SourceKind, SourceSpec,
};
pub use supervisor::{StuckTasks, Supervisor};
pub use sys::{DiskSpace, clock_is_synchronised, disk_space, run_at_idle_priority};
pub use virtual_port::{Heard, VirtualPort};
