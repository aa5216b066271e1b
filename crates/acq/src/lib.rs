#![doc = include_str!("../README.md")]
//!
//! # Data flow
//!
//! A [`Supervisor`] runs one task for each [`SourceSpec`]. A task pushes the bytes or frames that the
//! operating system returns into the [`Sequencer`], unaltered. The sequencer stamps and numbers each
//! arrival and gives it to the recorder and to the estimator through bounded queues. The crate
//! interprets bytes in two cases only: the text of SLCAN, which becomes frames, and the dialogues that
//! set up a device.

#![allow(
    clippy::disallowed_types,
    reason = "arrivals are stamped here, and nowhere else"
)]

mod can;
mod can_sender;
mod clock;
mod context;
mod datagram;
mod dialogue;
mod found;
mod frame_sender;
pub mod link;
mod pace;
mod port;
mod protocol;
mod ring;
mod sequencer;
mod serial;
mod slcan;
mod spec;
mod supervisor;
mod sys;
mod virtual_port;

pub use sample;

pub use can_sender::CanSender;
pub use clock::{LogClock, Reading};
pub use found::{FoundInterface, FoundPort, can_interface, can_interfaces, serial_ports};
pub use frame_sender::FrameSender;
pub use link::LinkSpec;
pub use sequencer::{QueueSizes, RingLimits, Sequencer, SourceCounters, Streams};
pub use spec::{
    CanFilter, CanSpec, Parity, PortSpec, SerialSpec, Setup, SlcanSpec, SourceKind, SourceSpec,
};
pub use supervisor::{StuckTasks, Supervisor};
pub use sys::{DiskSpace, clock_is_synchronised, disk_space, run_at_idle_priority};
pub use virtual_port::{Heard, VirtualPort};
