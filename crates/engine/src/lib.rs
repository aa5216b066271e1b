#![doc = include_str!("../README.md")]
//!
//! # Parts
//!
//! [`Config`] reads `atvrec.toml` and every file that it names, and reports all of their errors
//! together. [`Engine`] computes records from arrivals: the same configuration and the same arrivals
//! give the same records, bit for bit. [`Replay`] runs an engine with the arrivals of a log and compares
//! its records with those in the log; [`simulate`](fn@simulate) runs an engine with the bytes of a
//! virtual vehicle. [`read_recording`] and [`read_drive`] read the data of a calibration step and of an
//! identification. [`judge_log`] compares a configuration with a log. [`Excerpt`] and
//! [`Merge`] make logs of parts of logs and of several logs. This crate reads no clock, no device and no environment.

mod behind;
pub mod config;
mod engine;
mod error;
mod excerpt;
mod feed;
mod fit;
mod handling;
mod latency;
mod left_out;
mod listened;
mod merge;
pub mod missing;
mod mistakes;
pub mod output;
mod read_ahead;
mod recorded;
mod recording;
mod replay;
mod road;
mod scene;
pub mod scope;
pub mod session;
mod simple;
mod simulate;
mod verify;
mod virtual_drive;

pub use {estimator, sample, sim, store};

pub use config::Config;
pub use engine::{DM1, Engine, MessageCounts, Reception, SILENCE_NS, Skipped};
pub use error::{Error, Result};
pub use excerpt::{Copied, Excerpt};
pub use feed::{Entry, Feed};
pub use fit::{Fit, Judgement, Misfit, Undecided, judge_log};
pub use handling::{Handling, identify_handling};
pub use latency::{describe_latency, find_latencies, latencies_as_json, with_latencies};
pub use left_out::LeftOut;
pub use listened::{Listened, bus_warnings};
pub use merge::{Merge, Merged};
pub use mistakes::{find_mistakes, mistakes_as_json};
pub use recorded::{Window, read_drive, read_swing, sensors_file, vehicle_file, vehicle_of};
pub use recording::read_recording;
pub use replay::{Changes, FileSource, Replay, ReplayOptions, Replayed};
pub use simple::simple_methods_of;
pub use simulate::simulate;
pub use verify::Verification;
pub use virtual_drive::{Course, Drive, Ports, VirtualDrive, read_options};
