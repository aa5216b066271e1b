use std::fmt;
use std::ops::{Deref, DerefMut};

use serde::{Deserialize, Serialize};

use crate::LogTime;

/// A source's position in the resolved configuration; written into the log beside its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct SourceId(pub u16);

impl SourceId {
    /// The recorder itself: ticks, marks and notices that belong to no device.
    pub const HOST: Self = Self(u16::MAX);
}

impl fmt::Display for SourceId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "#{}", self.0)
    }
}

/// One step of the ordered stream: what one source delivered at one instant, unaltered.
///
/// `sequence` counts all sources together, without gaps, from zero. Live, the recorder and the
/// estimator both take arrivals in this order; a replay takes them from the log in the same one.
/// `log_time` never falls as `sequence` rises.
#[derive(Clone, Debug, PartialEq)]
pub struct Arrival {
    /// Position in the stream.
    pub sequence: u64,
    /// Who delivered it.
    pub source: SourceId,
    /// Log clock when it was taken from the operating system.
    pub log_time: LogTime,
    /// Host wall clock (`CLOCK_REALTIME`) at the same instant, ns since the UNIX epoch.
    pub realtime_ns: i64,
    /// What was delivered.
    pub payload: Payload,
}

/// What an [`Arrival`] carries.
#[derive(Clone, Debug, PartialEq)]
pub enum Payload {
    /// Bytes of a serial port, as one read returned them.
    Bytes(Vec<u8>),
    /// Frames of one CAN bus, as one system call returned them.
    Can(Vec<CanFrame>),
    /// The passage of time: sent at a fixed rate so that silence is seen, live and in replay.
    Tick,
    /// Something that happened to the source itself.
    Notice(Notice),
}

/// What happened to a source.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Notice {
    /// The device was opened; the text says which and with what settings.
    Opened(String),
    /// The device failed or went away; the text says why.
    Closed(String),
    /// Items were lost before they became arrivals.
    Lost {
        /// Where they were lost.
        place: LossPlace,
        /// How many: frames on CAN; on serial ports reads, or bytes where the UART lost them.
        count: u64,
    },
    /// A mark set by a person or a program.
    Mark(String),
    /// The estimator did not see the `count` arrivals from `first_sequence` on, because its queue
    /// was full, or because it was too far behind at the stop. A replay leaves the same ones out.
    EstimatorSkipped {
        /// Sequence of the first arrival left out.
        first_sequence: u64,
        /// How many consecutive arrivals were left out.
        count: u64,
    },
}

/// Where data can be lost, from the wire to the disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LossPlace {
    /// In the device or the controller (overrun reported by the hardware or UART).
    Device,
    /// In the kernel's socket queue (`SO_RXQ_OVFL`).
    Kernel,
    /// In a queue of the recorder.
    Queue,
    /// On the way to the disk.
    Disk,
}

impl LossPlace {
    /// All places, nearest the wire first.
    pub const ALL: [Self; 4] = [Self::Device, Self::Kernel, Self::Queue, Self::Disk];

    /// Lower-case name, as in logs and messages.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Device => "device",
            Self::Kernel => "kernel",
            Self::Queue => "queue",
            Self::Disk => "disk",
        }
    }
}

/// Properties of a CAN frame beside its identifier and data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct CanFlags {
    /// 29-bit identifier.
    pub extended: bool,
    /// Remote transmission request: no data, `len` is the length asked for.
    pub remote: bool,
    /// Error frame of the controller: `id` holds the error class.
    pub error: bool,
    /// CAN FD frame.
    pub fd: bool,
    /// FD bit-rate switch.
    pub bit_rate_switch: bool,
    /// FD error-state indicator.
    pub error_state: bool,
    /// Sent by this host, seen again as an echo.
    pub local_echo: bool,
}

impl CanFlags {
    /// The flags as one byte, bit 0 first in the order of the fields.
    #[must_use]
    pub const fn to_bits(self) -> u8 {
        self.extended as u8
            | (self.remote as u8) << 1
            | (self.error as u8) << 2
            | (self.fd as u8) << 3
            | (self.bit_rate_switch as u8) << 4
            | (self.error_state as u8) << 5
            | (self.local_echo as u8) << 6
    }

    /// The inverse of [`CanFlags::to_bits`]; bit 7 is ignored.
    #[must_use]
    pub const fn from_bits(bits: u8) -> Self {
        Self {
            extended: bits & 1 != 0,
            remote: bits & 2 != 0,
            error: bits & 4 != 0,
            fd: bits & 8 != 0,
            bit_rate_switch: bits & 16 != 0,
            error_state: bits & 32 != 0,
            local_echo: bits & 64 != 0,
        }
    }
}

/// Data of a CAN frame. At most 8 bytes are in the value itself, more are on the heap: a frame of a
/// classic bus is small. It is used as a slice of 8 or of 64 bytes.
#[derive(Clone)]
pub struct FrameData(Stored);

#[derive(Clone)]
enum Stored {
    Inline([u8; 8]),
    Heap(Box<[u8; 64]>),
}

impl FrameData {
    /// Zeros, with space for `len` bytes, at most 64.
    #[must_use]
    pub fn zeros(len: u8) -> Self {
        Self(if len <= 8 {
            Stored::Inline([0; 8])
        } else {
            Stored::Heap(Box::new([0; 64]))
        })
    }

    /// These bytes, with zeros behind them. Returns `None` if there are more than 64.
    #[must_use]
    pub fn new(bytes: &[u8]) -> Option<Self> {
        let len = u8::try_from(bytes.len()).ok().filter(|len| *len <= 64)?;
        let mut data = Self::zeros(len);
        data[..bytes.len()].copy_from_slice(bytes);
        Some(data)
    }
}

impl Deref for FrameData {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match &self.0 {
            Stored::Inline(bytes) => bytes,
            Stored::Heap(bytes) => &**bytes,
        }
    }
}

impl DerefMut for FrameData {
    fn deref_mut(&mut self) -> &mut [u8] {
        match &mut self.0 {
            Stored::Inline(bytes) => bytes,
            Stored::Heap(bytes) => &mut **bytes,
        }
    }
}

impl PartialEq for FrameData {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

/// One frame of a CAN bus.
#[derive(Clone, PartialEq)]
pub struct CanFrame {
    /// 11- or 29-bit identifier without flag bits; the error class of an error frame.
    pub id: u32,
    /// Kind of the frame.
    pub flags: CanFlags,
    /// Number of valid bytes in `data` (of a remote frame: bytes asked for).
    pub len: u8,
    /// Data: 8 bytes, or 64 if `len` is larger than 8. Bytes from `len` on are zero.
    pub data: FrameData,
    /// Data length code, 9 to 15, of a classic frame with 8 bytes; 0 if the code follows from `len`
    /// (`len8_dlc` of `linux/can.h`).
    pub len8_dlc: u8,
    /// Kernel's receive stamp, ns since the UNIX epoch on the host's wall clock.
    pub kernel_ns: Option<i64>,
    /// Adapter's own stamp, ns on the adapter's clock.
    pub hardware_ns: Option<i64>,
}

impl CanFrame {
    /// A frame without stamps. Returns `None` if `data` has more than 64 bytes, or more than
    /// 8 without the FD flag.
    #[must_use]
    pub fn new(id: u32, flags: CanFlags, data: &[u8]) -> Option<Self> {
        if data.len() > if flags.fd { 64 } else { 8 } {
            return None;
        }
        Some(Self {
            id,
            flags,
            len: data.len() as u8,
            data: FrameData::new(data)?,
            len8_dlc: 0,
            kernel_ns: None,
            hardware_ns: None,
        })
    }

    /// The valid bytes; empty for a remote frame.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        if self.flags.remote {
            &[]
        } else {
            &self.data[..usize::from(self.len).min(self.data.len())]
        }
    }
}

impl fmt::Debug for CanFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("CanFrame")
            .field("id", &format_args!("{:#x}", self.id))
            .field("flags", &self.flags)
            .field("bytes", &format_args!("{:02x?}", self.bytes()))
            .field("kernel_ns", &self.kernel_ns)
            .field("hardware_ns", &self.hardware_ns)
            .finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_round_trip() {
        for bits in 0..128 {
            assert_eq!(CanFlags::from_bits(bits).to_bits(), bits);
        }
    }

    /// Frames are copied and moved several times between a bus and the log.
    #[test]
    fn frames_and_arrivals_are_small() {
        assert!(size_of::<CanFrame>() <= 64);
        assert!(size_of::<Arrival>() <= 64);
    }

    #[test]
    fn long_data_is_kept_whole() {
        let bytes: Vec<u8> = (1..=64).collect();
        for len in [0, 7, 8, 9, 48, 64] {
            let data = FrameData::new(&bytes[..len]).expect("64 bytes at most");
            assert_eq!(data.len(), if len <= 8 { 8 } else { 64 });
            assert_eq!(data[..len], bytes[..len]);
            assert!(data[len..].iter().all(|byte| *byte == 0));
            assert!(data == data.clone());
        }
        assert!(FrameData::new(&[0; 65]).is_none());
    }

    #[test]
    fn classic_frames_hold_eight_bytes() {
        assert!(CanFrame::new(1, CanFlags::default(), &[0; 9]).is_none());
        let fd = CanFlags {
            fd: true,
            ..CanFlags::default()
        };
        assert_eq!(
            CanFrame::new(1, fd, &[7; 64])
                .expect("64 bytes fit")
                .bytes(),
            &[7; 64]
        );
    }
}
