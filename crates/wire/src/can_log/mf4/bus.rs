//! Groups of CAN frames: which channel of a record is which field of a frame.
//!
//! Source: ASAM MDF, associated standard "Bus Logging": the channels `CAN_DataFrame`,
//! `CAN_RemoteFrame` and `CAN_ErrorFrame` with their parts `BusChannel`, `ID`, `IDE`, `DLC`,
//! `DataLength`, `DataBytes`, `Dir`, `EDL`, `BRS` and `ESI`.

use sample::{CanFlags, CanFrame, FrameData};

use super::channel::{Channel, Kind, Raw, Record};
use super::layout::Group;
use crate::can_log::{Direction, Entry, len8_dlc};

/// Bit of a 29-bit identifier in a channel of 32 bits.
const EXTENDED: u64 = 0x8000_0000;
const IDENTIFIER: u64 = 0x1FFF_FFFF;
/// Data bytes of the codes 9 to 15 of a CAN FD frame (ISO 11898-1).
const FD_LENGTHS: [u8; 7] = [12, 16, 20, 24, 32, 48, 64];

/// Kind of the frames of a group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FrameKind {
    Data,
    Remote,
    Error,
}

impl FrameKind {
    fn of(name: &str) -> Option<Self> {
        match name.split('.').next()? {
            "CAN_DataFrame" => Some(Self::Data),
            "CAN_RemoteFrame" => Some(Self::Remote),
            "CAN_ErrorFrame" => Some(Self::Error),
            _ => None,
        }
    }
}

/// Where the fields of a group's frames are.
pub(super) struct FrameGroup {
    kind: FrameKind,
    /// Bus by the group's name, for groups without a channel of the bus.
    name: Option<String>,
    master: Option<Channel>,
    /// The frame itself, for its invalidation bit.
    frame: Option<Channel>,
    bus_channel: Option<Channel>,
    id: Option<Channel>,
    ide: Option<Channel>,
    dlc: Option<Channel>,
    data_length: Option<Channel>,
    pub data_bytes: Option<Channel>,
    dir: Option<Channel>,
    edl: Option<Channel>,
    brs: Option<Channel>,
    esi: Option<Channel>,
}

/// What a record gives.
pub(super) struct Decoded {
    /// The frame without its channel.
    pub entry: Entry,
    /// Number or name of the channel.
    pub bus: Option<String>,
    /// Offset of the data in the values of their own length, if the data is there.
    pub data_offset: Option<u64>,
    /// The record has no time.
    pub timeless: bool,
}

impl FrameGroup {
    /// The frames of a group; `None` if its records are no CAN frames.
    pub fn of(group: &Group) -> Option<Self> {
        let is_frame = |channel: &Channel| {
            FrameKind::of(channel.parent.as_deref().unwrap_or(&channel.name))
                .or_else(|| FrameKind::of(&channel.name))
        };
        let kind = group.channels.iter().find_map(is_frame)?;
        let parts = || {
            group
                .channels
                .iter()
                .filter(|channel| is_frame(channel) == Some(kind))
        };
        let part = |name: &str| {
            let last = |channel: &&Channel| channel.name.rsplit('.').next() == Some(name);
            parts().find(last).cloned()
        };
        let is_master = |channel: &&Channel| {
            matches!(channel.kind, Kind::Master | Kind::VirtualMaster) && channel.is_time
        };
        Some(Self {
            kind,
            name: group.name.clone(),
            master: group.channels.iter().find(is_master).cloned(),
            frame: parts().find(|channel| !channel.name.contains('.')).cloned(),
            bus_channel: part("BusChannel"),
            id: part("ID"),
            ide: part("IDE"),
            dlc: part("DLC"),
            data_length: part("DataLength"),
            data_bytes: part("DataBytes"),
            dir: part("Dir"),
            edl: part("EDL"),
            brs: part("BRS"),
            esi: part("ESI"),
        })
    }

    /// Reads a record; `None` if it is marked as invalid.
    pub fn decode(&self, record: Record<'_>) -> Option<Decoded> {
        if self
            .frame
            .as_ref()
            .is_some_and(|frame| !frame.is_valid(record))
        {
            return None;
        }
        let stamp_ns = self
            .master
            .as_ref()
            .and_then(|master| master.time_ns(record));
        let id = number(self.id.as_ref(), record).unwrap_or_default();
        let dlc = number(self.dlc.as_ref(), record).and_then(|dlc| u8::try_from(dlc).ok());
        let set = |channel: &Option<Channel>| {
            number(channel.as_ref(), record).is_some_and(|number| number != 0)
        };
        let fd = match &self.edl {
            Some(_) => set(&self.edl),
            None => self.is_fd_by_length(record, dlc),
        };
        let flags = CanFlags {
            extended: set(&self.ide) || id & EXTENDED != 0,
            remote: self.kind == FrameKind::Remote,
            error: self.kind == FrameKind::Error,
            fd,
            bit_rate_switch: set(&self.brs),
            error_state: set(&self.esi),
            ..CanFlags::default()
        };
        let bus = number(self.bus_channel.as_ref(), record).map(|number| number.to_string());
        let len = self.data_len(record, dlc, fd);
        let mut frame = CanFrame {
            id: (id & IDENTIFIER) as u32,
            flags,
            len,
            data: FrameData::zeros(len),
            len8_dlc: len8_dlc(flags, dlc),
            kernel_ns: None,
            hardware_ns: None,
        };
        let data_offset = self.data(record, &mut frame);
        let direction = number(self.dir.as_ref(), record).map(|direction| match direction {
            0 => Direction::Received,
            _ => Direction::Sent,
        });
        Some(Decoded {
            entry: Entry {
                stamp_ns: stamp_ns.unwrap_or_default(),
                channel: None,
                direction,
                dlc,
                frame,
            },
            bus: bus.or_else(|| self.name.clone()),
            data_offset,
            timeless: stamp_ns.is_none(),
        })
    }

    /// Copies the data of the record, or gives its offset in the values of their own length.
    fn data(&self, record: Record<'_>, frame: &mut CanFrame) -> Option<u64> {
        let channel = self
            .data_bytes
            .as_ref()
            .filter(|_| self.kind != FrameKind::Remote)?;
        match channel.raw(record) {
            Some(Raw::Unsigned(offset)) if channel.kind == Kind::VariableLength => {
                return Some(offset);
            }
            Some(Raw::Bytes(bytes)) => put_data(frame, bytes),
            // The bytes of a field that is declared as a number of at most 64 bits.
            Some(Raw::Unsigned(number)) => put_data(frame, &number.to_le_bytes()),
            _ => {}
        }
        None
    }

    /// A record that does not say which kind of frame it has is of a CAN FD frame if its data is
    /// longer than that of a classic frame.
    fn is_fd_by_length(&self, record: Record<'_>, dlc: Option<u8>) -> bool {
        let wide = |channel: &Channel| channel.bit_count > 64;
        match number(self.data_length.as_ref(), record) {
            Some(len) => len > 8,
            None => dlc.is_some_and(|dlc| dlc > 8) && self.data_bytes.as_ref().is_some_and(wide),
        }
    }

    fn data_len(&self, record: Record<'_>, dlc: Option<u8>, fd: bool) -> u8 {
        let by_code = dlc.map(|dlc| match dlc.checked_sub(9) {
            Some(over) if fd => FD_LENGTHS[usize::from(over).min(6)],
            Some(_) => 8,
            None => dlc,
        });
        let stated = number(self.data_length.as_ref(), record);
        let stated = stated.map(|len| u8::try_from(len).unwrap_or(u8::MAX));
        let in_record = self
            .data_bytes
            .as_ref()
            .map(|data| (data.bit_count / 8).min(64) as u8);
        let len = stated.or(by_code).or(in_record).unwrap_or_default();
        len.min(if fd { 64 } else { 8 })
    }
}

/// A field as a whole number, through its conversion; `None` if it is absent or marked as invalid.
fn number(channel: Option<&Channel>, record: Record<'_>) -> Option<u64> {
    let channel = channel.filter(|channel| channel.is_valid(record))?;
    let value = channel.value(record)?;
    (value >= 0.0 && value < 2_f64.powi(53)).then_some(value as u64)
}

/// Puts data into a frame, up to the frame's length.
pub(super) fn put_data(frame: &mut CanFrame, bytes: &[u8]) {
    let len = bytes.len().min(usize::from(frame.len));
    frame.data[..len].copy_from_slice(&bytes[..len]);
}
