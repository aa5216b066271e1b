#![doc = include_str!("../README.md")]
//!
//! # Decoders
//!
//! A decoder is incremental. It takes bytes and gives [`Item`]s to a sink, in the order of the
//! stream. Its memory is bounded. After noise, a decoder finds the next intact message: if a header
//! is false, the decoder discards the first byte of the header and searches on from the second
//! byte. [`Statistics`] counts the lost bytes and messages.
//!
//! - [`crossbow440`]: Crossbow IMU440, with its set-up dialogue.
//! - [`gnss`]: the port of a receiver, which carries [`novatel`], [`sbf`], [`ubx`] and [`nmea`] in any
//!   mixture; the port of a [`vectornav`] unit carries its outputs too.
//! - [`csv`], [`alog`]: tables of other programs; [`mod@column`] describes their columns.
//! - [`mod@line`]: text devices that the configuration describes (steering, throttle, brake).
//! - [`dbc`]: CAN frames to named signals and back, by any DBC file.
//! - [`j1939`]: messages of several CAN frames.
//! - [`slcan`], [`candump`]: CAN frames as text.
//! - [`can_log`]: logs of CAN frames that other programs write.
//! - [`output`]: estimates for controllers, as CAN frames with [`e2e`] and as datagrams.
//! - [`mod@recognise`]: which protocol bytes are of.
//! - [`mod@unit`]: units of quantities and their factors to SI.
//! - [`geodesy`], [`gps_time`]: WGS 84 and GPS time.
//!
//! Each protocol has its encoder in the module of its decoder. The virtual vehicle uses the encoders.

mod codec;
mod error;
mod frame;
mod item;
mod rtcm;
mod text;

pub mod alog;
pub mod can_log;
pub mod candump;
pub mod column;
pub mod crossbow440;
pub mod csv;
pub mod dbc;
pub mod e2e;
pub mod geodesy;
pub mod gnss;
pub mod gps_time;
pub mod j1939;
pub mod line;
pub mod nmea;
pub mod novatel;
pub mod output;
pub mod recognise;
pub mod sbf;
pub mod slcan;
pub mod ubx;
pub mod unit;
pub mod vectornav;

pub use error::WireError;
pub use frame::Statistics;
pub use item::{Item, Measurements, Message, Protocol};
pub use text::nanos;
