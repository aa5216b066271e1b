//! From a configuration and arrivals to records: the engine that recording, replay, simulation and
//! import share.
//!
//! [`Config`] reads `atvrec.toml` and every file that it names, and reports all of their errors at
//! once. [`Engine`] turns arrivals into records: the same configuration and the same arrivals give
//! the same records, bit for bit. [`Replay`] feeds an engine with the arrivals of a log and compares
//! what follows with what the log holds; [`simulate`](fn@simulate) feeds one with the bytes of a
//! virtual vehicle. Nothing here reads a clock, a device or the environment.

pub mod config;
mod engine;
mod error;
mod feed;
mod handling;
pub mod missing;
mod read_ahead;
mod recorded;
mod recording;
mod replay;
mod rig;
pub mod session;
mod simulate;
mod verify;

pub use config::Config;
pub use engine::{Engine, SILENCE_NS, Skipped};
pub use error::{Error, Result};
pub use feed::{Entry, Feed};
pub use handling::{Handling, identify_handling};
pub use recorded::{Window, read_drive, read_swing, vehicle_file, vehicle_of};
pub use recording::read_recording;
pub use replay::{Changes, FileSource, Replay, ReplayOptions, Replayed};
pub use rig::{Course, Drive, Ports, Rig, read_options};
pub use simulate::simulate;
pub use verify::Verification;
