//! Bytes to samples and back, one protocol a file.
//!
//! Every decoder is an incremental machine without I/O and without a clock: bytes go in, [`Item`]s
//! come out of a sink in stream order, and the same bytes give the same items however they are cut
//! into reads. Memory is bounded. After noise a decoder finds the next intact message: a false
//! header costs its first byte only, never what follows it. [`Statistics`] counts what was lost.
//!
//! - [`crossbow440`]: Crossbow IMU440, with its set-up dialogue.
//! - [`gnss`]: what one receiver port carries, [`novatel`], [`sbf`] and [`nmea`] mixed.
//! - [`csv`], [`alog`]: tables that others recorded, their columns told by [`mod@column`].
//! - [`mod@line`]: text devices described by the configuration (steering, throttle, brake).
//! - [`dbc`]: CAN frames to named signals and back, through any DBC file.
//! - [`slcan`], [`candump`]: CAN frames as text.
//! - [`geodesy`], [`gps_time`]: WGS 84 and GPS time.
//!
//! Encoders stand beside the decoders; the virtual vehicle speaks through them.

mod codec;
mod error;
mod frame;
mod item;

pub mod alog;
pub mod candump;
pub mod column;
pub mod crossbow440;
pub mod csv;
pub mod dbc;
pub mod geodesy;
pub mod gnss;
pub mod gps_time;
pub mod line;
pub mod nmea;
pub mod novatel;
pub mod sbf;
pub mod slcan;

pub use error::WireError;
pub use frame::Statistics;
pub use item::{Item, Measurements, Message, Protocol};
