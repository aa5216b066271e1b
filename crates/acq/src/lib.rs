#![doc = include_str!("../README.md")]
//!
//! # Data flow
//!
//! A [`Supervisor`] runs one task for each [`SourceSpec`]. A task pushes the bytes or frames that the
//! operating system returns into the [`Sequencer`], unaltered. The sequencer stamps and numbers each
//! arrival and gives it to the recorder and to the estimator through bounded queues. The crate
//! interprets bytes in two cases only: the text of SLCAN, which becomes frames, and the dialogues that
//! set up a device.
//!
//! Devices are opened on Linux alone. On other systems, the crate has the resolved configuration of
//! sources, so that logs can be read and replayed there.

#![allow(
    clippy::disallowed_types,
    reason = "arrivals are stamped here, and nowhere else"
)]

#[cfg(target_os = "linux")]
mod can;
#[cfg(target_os = "linux")]
mod can_sender;
#[cfg(target_os = "linux")]
mod clock;
#[cfg(target_os = "linux")]
mod context;
#[cfg(target_os = "linux")]
mod datagram;
#[cfg(target_os = "linux")]
mod dialogue;
#[cfg(target_os = "linux")]
mod found;
#[cfg(target_os = "linux")]
mod frame_sender;
#[cfg(target_os = "linux")]
pub mod link;
#[cfg(target_os = "linux")]
mod pace;
#[cfg(target_os = "linux")]
mod port;
#[cfg(target_os = "linux")]
mod protocol;
#[cfg(target_os = "linux")]
mod ring;
#[cfg(target_os = "linux")]
mod sequencer;
#[cfg(target_os = "linux")]
mod serial;
#[cfg(target_os = "linux")]
mod slcan;
mod spec;
#[cfg(target_os = "linux")]
mod supervisor;
#[cfg(target_os = "linux")]
mod sys;
#[cfg(target_os = "linux")]
mod virtual_port;

pub use sample;

#[cfg(target_os = "linux")]
pub use {
    can_sender::CanSender,
    clock::{LogClock, Reading},
    found::{FoundInterface, FoundPort, can_interface, can_interfaces, serial_ports},
    frame_sender::FrameSender,
    sequencer::{QueueSizes, Sequencer, SourceCounters, Streams},
    supervisor::{StuckTasks, Supervisor},
    sys::{DiskSpace, clock_is_synchronised, disk_space, run_at_idle_priority},
    virtual_port::{Heard, VirtualPort},
};

pub use spec::{
    CanFilter, CanSpec, LinkSpec, Parity, PortSpec, RingLimits, SerialSpec, Setup, SlcanSpec,
    SourceKind, SourceSpec,
};
