//! What to open and how: the resolved form of a configuration's sources. It compiles on every system.

use std::path::PathBuf;
use std::time::Duration;

use sample::SourceId;
use wire::crossbow440;

/// One source.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceSpec {
    /// Number that its arrivals carry.
    pub id: SourceId,
    /// Name in topics, messages and counters.
    pub name: String,
    /// What it is.
    pub kind: SourceKind,
}

impl SourceSpec {
    /// Whether both open the same device in the same way under the same name.
    #[cfg(target_os = "linux")]
    pub(crate) fn is_same_device(&self, other: &Self) -> bool {
        self.name == other.name && self.kind == other.kind
    }
}

/// The kinds of sources.
#[derive(Clone, Debug, PartialEq)]
pub enum SourceKind {
    /// A SocketCAN interface: arrivals are frames.
    Can(CanSpec),
    /// A CAN adapter that speaks SLCAN on a serial port: arrivals are frames.
    Slcan(SlcanSpec),
    /// A serial port: arrivals are bytes.
    Serial(SerialSpec),
}

/// A SocketCAN interface.
#[derive(Clone, Debug, PartialEq)]
pub struct CanSpec {
    /// Name of the interface, such as `can0`.
    pub interface: String,
    /// Take CAN FD frames too, where the interface has them.
    pub fd: bool,
    /// Frames to take; empty takes all.
    pub filters: Vec<CanFilter>,
    /// Take error frames.
    pub errors: bool,
    /// Ask the adapter for its own stamps.
    pub hardware_stamps: bool,
    /// Size of the kernel's receive queue, bytes (the kernel doubles it). One classic frame takes
    /// about 1 KiB of it, bookkeeping included.
    pub receive_buffer_bytes: usize,
    /// How long a frame of a busy bus may wait to be read; its stamp is the kernel's all the same.
    pub read_within: Duration,
    /// Bring the interface up like this whenever it is found down, replugged ones included; `None`
    /// leaves that to the system.
    pub link: Option<LinkSpec>,
}

impl CanSpec {
    /// All frames of `interface`, with errors and hardware stamps and a queue of about a second of
    /// a full bus, read within what the estimator waits for a sample.
    #[must_use]
    pub fn new(interface: impl Into<String>) -> Self {
        Self {
            interface: interface.into(),
            fd: true,
            filters: Vec::new(),
            errors: true,
            hardware_stamps: true,
            receive_buffer_bytes: 8 << 20,
            read_within: Duration::from_millis(4),
            link: None,
        }
    }
}

/// How a CAN interface is brought up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LinkSpec {
    /// Bit rate, bit/s. `None` for interfaces without one (vcan).
    pub bit_rate: Option<u32>,
    /// Bit rate of the data phase of CAN FD, bit/s; `None` leaves FD off.
    pub data_bit_rate: Option<u32>,
    /// Time after bus-off before the controller goes on the bus again, ms.
    pub restart_ms: u32,
    /// Do not acknowledge frames.
    pub listen_only: bool,
}

impl LinkSpec {
    /// Classic CAN at `bit_rate`, restarted 100 ms after bus-off.
    #[must_use]
    pub const fn new(bit_rate: u32) -> Self {
        Self {
            bit_rate: Some(bit_rate),
            data_bit_rate: None,
            restart_ms: 100,
            listen_only: false,
        }
    }
}

/// Frames whose identifier equals `id` in all bits of `mask`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CanFilter {
    /// Identifier, without flag bits.
    pub id: u32,
    /// Bits of the identifier that count.
    pub mask: u32,
    /// Whether 29-bit identifiers are meant (`true`) or 11-bit ones.
    pub extended: bool,
}

/// A SLCAN adapter.
#[derive(Clone, Debug, PartialEq)]
pub struct SlcanSpec {
    /// The serial port that it appears as.
    pub port: PortSpec,
    /// Bit rate of the bus, bit/s; `None` leaves the adapter as it is.
    pub bit_rate: Option<u32>,
    /// Do not acknowledge frames.
    pub listen_only: bool,
    /// Ask for millisecond stamps.
    pub timestamps: bool,
}

/// A device on a serial port.
#[derive(Clone, Debug, PartialEq)]
pub struct SerialSpec {
    /// The port.
    pub port: PortSpec,
    /// What to tell the device each time the port is opened.
    pub setup: Setup,
}

/// A serial port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PortSpec {
    /// Device file; a stable name under `/dev/serial/by-id` survives replugging.
    pub path: PathBuf,
    /// Bits a second.
    pub baud: u32,
    /// Parity bit.
    pub parity: Parity,
    /// Two stop bits instead of one.
    pub two_stop_bits: bool,
    /// Ask the driver to hand bytes over at once (USB adapters else hold them for up to 16 ms).
    pub low_latency: bool,
}

impl PortSpec {
    /// `path` at `baud`, 8N1, low latency.
    #[must_use]
    pub fn new(path: impl Into<PathBuf>, baud: u32) -> Self {
        Self {
            path: path.into(),
            baud,
            parity: Parity::None,
            two_stop_bits: false,
            low_latency: true,
        }
    }
}

/// Parity bit of a serial port.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Parity {
    /// None.
    #[default]
    None,
    /// Odd.
    Odd,
    /// Even.
    Even,
}

/// What to tell a device each time its port is opened.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Setup {
    /// Nothing.
    #[default]
    None,
    /// Commands of a receiver, sent one after the other as they are (line ends included).
    Commands {
        /// The commands.
        commands: Vec<Vec<u8>>,
        /// Time between two of them.
        pause: Duration,
    },
    /// Crossbow 440: find the line speed, then ask for packets. A unit that falls silent is set up
    /// again; one that takes no commands is listened to at the port's own speed.
    Crossbow440(crossbow440::SetupOptions),
}

/// How much of the stream is kept in memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RingLimits {
    /// Time on the log clock.
    pub duration: Duration,
    /// Memory, bytes; where it does not hold the time, the oldest goes.
    pub bytes: usize,
}
