#![doc = include_str!("../README.md")]
#![allow(
    clippy::disallowed_types,
    reason = "the age of what is shown, and the pace of a replay, need a clock"
)]

mod auth;
mod foxglove;
mod hub;
mod page;
mod playback;
mod recorder;
mod server;
mod tls;
mod udp;

pub use auth::{TOKEN_MIN, random_token};
pub use hub::{Hub, SourceState, Topics};
pub use playback::{Playback, PlaybackState, Step};
pub use recorder::{Control, follow};
pub use server::{Error, Server, Settings};
pub use udp::{UdpFormat, send as send_udp};
