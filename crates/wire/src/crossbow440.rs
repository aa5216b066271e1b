//! Crossbow IMU440.
/// A packet.
#[derive(Clone, Debug, PartialEq)]
pub struct Packet;
