use sample::CanFrame;
use serde::{Deserialize, Serialize};

/// One message leaving a device.
#[derive(Clone, Debug, PartialEq)]
pub struct Emission {
    /// When its last byte (CAN: the end of the frame) leaves, seconds since the motion's start.
    pub time_s: f64,
    /// Where it leaves.
    pub port: Port,
    /// What leaves.
    pub output: Output,
}

/// What an [`Emission`] carries.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// Bytes on a serial line.
    Bytes(Vec<u8>),
    /// A frame on a CAN bus.
    Can(CanFrame),
}

/// The virtual vehicle's ports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Port {
    /// Crossbow 440, S1 packets.
    Imu,
    /// NovAtel receiver: BESTPOS, BESTVEL and TIME, binary.
    Novatel,
    /// Septentrio receiver: PVTGeodetic, VelCov, AttEuler and AttCovEuler, SBF.
    Septentrio,
    /// CAN bus of the strain boxes, wheel speeds and steering, as the project's DBC has it.
    Can0,
    /// Steering controller: the steering wheel's encoder, a line a reading.
    Steering,
    /// Throttle controller: its step motor's position, a line a reading.
    Throttle,
    /// Brake controller: its actuator's encoder, a line a reading.
    Brake,
}

impl Port {
    /// All ports, in the order in which simultaneous emissions come.
    pub const ALL: [Self; 7] = [
        Self::Imu,
        Self::Novatel,
        Self::Septentrio,
        Self::Can0,
        Self::Steering,
        Self::Throttle,
        Self::Brake,
    ];

    /// How the names of the channels behind the port begin in an estimator's events.
    pub(crate) const fn sensors(self) -> &'static [&'static str] {
        match self {
            Self::Imu => &["inertial unit"],
            Self::Novatel => &["GNSS velocity"],
            Self::Septentrio => &["GNSS attitude", "GNSS velocity of the attitude receiver"],
            Self::Can0 => &["FL ", "FR ", "RL ", "RR ", "steering wheel"],
            Self::Steering => &["steering wheel"],
            Self::Throttle | Self::Brake => &[],
        }
    }

    /// The name that sources have in configurations and logs.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Imu => "imu",
            Self::Novatel => "novatel",
            Self::Septentrio => "septentrio",
            Self::Can0 => "can0",
            Self::Steering => "steering",
            Self::Throttle => "throttle",
            Self::Brake => "brake",
        }
    }

    /// Whether frames, not bytes, leave here.
    #[must_use]
    pub const fn is_can(self) -> bool {
        matches!(self, Self::Can0)
    }
}
