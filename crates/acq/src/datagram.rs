//! What the kernel hands over with each datagram of a CAN socket, taken apart without `unsafe`.

use sample::{CanFlags, CanFrame};

use crate::sys::Datagram;

/// Sizes of `struct can_frame` and `struct canfd_frame`.
const CLASSIC_BYTES: usize = 16;
const FD_BYTES: usize = 72;
/// Where the data begins in both.
const DATA_OFFSET: usize = 8;

/// Flag bits of an identifier (`linux/can.h`).
const EXTENDED_FLAG: u32 = 0x8000_0000;
const REMOTE_FLAG: u32 = 0x4000_0000;
const ERROR_FLAG: u32 = 0x2000_0000;
/// Flag bits of a FD frame (`linux/can.h`).
const FD_BIT_RATE_SWITCH: u8 = 1;
const FD_ERROR_STATE: u8 = 2;
/// Error class "controller problem" and its detail "receive overflow" (`linux/can/error.h`).
const ERROR_CONTROLLER: u32 = 0x4;
const CONTROLLER_RX_OVERFLOW: u8 = 0x1;

/// Error classes "bus off" and "restarted" (`linux/can/error.h`).
const ERROR_BUS_OFF: u32 = 0x40;
const ERROR_RESTARTED: u32 = 0x100;

/// Size of a control message's header: length, level, type.
const HEADER_BYTES: usize = size_of::<usize>() + 8;

/// A frame, and the kernel's count of dropped ones so far if it told.
pub(crate) fn take_apart(datagram: &Datagram<'_>) -> (Option<CanFrame>, Option<u32>) {
    let control = Control::parse(datagram.control);
    let frame = parse_frame(datagram.data).map(|mut frame| {
        frame.flags.local_echo = datagram.flags & (libc::MSG_DONTROUTE | libc::MSG_CONFIRM) != 0;
        frame.kernel_ns = control.kernel_ns;
        frame.hardware_ns = control.hardware_ns;
        frame
    });
    (frame, control.drops)
}

/// Whether the controller says with this frame that it lost others.
pub(crate) fn is_controller_overflow(frame: &CanFrame) -> bool {
    frame.flags.error
        && frame.id & ERROR_CONTROLLER != 0
        && frame.data[1] & CONTROLLER_RX_OVERFLOW != 0
}

/// What a controller says of itself that a person should hear of.
pub(crate) fn controller_event(frame: &CanFrame) -> Option<&'static str> {
    match frame.id {
        _ if !frame.flags.error => None,
        id if id & ERROR_BUS_OFF != 0 => Some("bus off: check wiring, termination and bit rate"),
        id if id & ERROR_RESTARTED != 0 => Some("controller restarted after bus off"),
        _ => None,
    }
}

/// `struct can_frame` or `struct canfd_frame`, told apart by size.
fn parse_frame(datagram: &[u8]) -> Option<CanFrame> {
    let fd = match datagram.len() {
        CLASSIC_BYTES => false,
        FD_BYTES => true,
        _ => return None,
    };
    let raw_id = u32::from_ne_bytes(*datagram.first_chunk()?);
    let len = datagram[4];
    let fd_flags = if fd { datagram[5] } else { 0 };
    let flags = CanFlags {
        extended: raw_id & (EXTENDED_FLAG | ERROR_FLAG) == EXTENDED_FLAG,
        remote: raw_id & (REMOTE_FLAG | ERROR_FLAG) == REMOTE_FLAG && !fd,
        error: raw_id & ERROR_FLAG != 0,
        fd,
        bit_rate_switch: fd_flags & FD_BIT_RATE_SWITCH != 0,
        error_state: fd_flags & FD_ERROR_STATE != 0,
        local_echo: false,
    };
    let id = raw_id & !(EXTENDED_FLAG | REMOTE_FLAG | ERROR_FLAG);
    let data = datagram.get(DATA_OFFSET..DATA_OFFSET + usize::from(len))?;
    let frame = CanFrame::new(id, flags, if flags.remote { &[] } else { data })?;
    Some(CanFrame { len, ..frame })
}

/// What the control messages of one datagram say.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Control {
    kernel_ns: Option<i64>,
    hardware_ns: Option<i64>,
    drops: Option<u32>,
}

impl Control {
    /// Walks through the messages (cmsg(3)); stops at the first that makes no sense.
    fn parse(mut bytes: &[u8]) -> Self {
        let mut control = Self::default();
        while let Some((header, _)) = bytes.split_at_checked(HEADER_BYTES) {
            let (length, kind) = header.split_at(size_of::<usize>());
            let length = length.try_into().map_or(0, usize::from_ne_bytes);
            let level = kind
                .first_chunk()
                .map_or(0, |word| i32::from_ne_bytes(*word));
            let kind = kind
                .last_chunk()
                .map_or(0, |word| i32::from_ne_bytes(*word));
            let Some(data) = bytes.get(HEADER_BYTES..length) else {
                break;
            };
            if level == libc::SOL_SOCKET {
                control.take(kind, data);
            }
            let next = length.next_multiple_of(size_of::<usize>());
            bytes = bytes.get(next..).unwrap_or_default();
        }
        control
    }

    fn take(&mut self, kind: i32, data: &[u8]) {
        const STAMP: usize = size_of::<libc::timespec>();
        match kind {
            libc::SO_TIMESTAMPNS => self.kernel_ns = timespec_ns(data),
            // Software, an obsolete one, and the adapter's own.
            libc::SO_TIMESTAMPING => {
                let hardware = data.get(2 * STAMP..).and_then(timespec_ns);
                self.hardware_ns = hardware.filter(|ns| *ns != 0);
                let software = timespec_ns(data).filter(|ns| *ns != 0);
                self.kernel_ns = self.kernel_ns.or(software);
            }
            libc::SO_RXQ_OVFL => {
                self.drops = data.first_chunk().map(|word| u32::from_ne_bytes(*word));
            }
            _ => {}
        }
    }
}

/// `struct timespec` in ns.
fn timespec_ns(data: &[u8]) -> Option<i64> {
    const HALF: usize = size_of::<libc::timespec>() / 2;
    let word = |at: usize| {
        let bytes = data.get(at..at + HALF)?;
        match bytes.len() {
            4 => Some(i64::from(i32::from_ne_bytes(*bytes.first_chunk()?))),
            _ => Some(i64::from_ne_bytes(*bytes.first_chunk()?)),
        }
    };
    word(0)?
        .checked_mul(1_000_000_000)?
        .checked_add(word(HALF)?)
}

/// Counts what the kernel dropped, from its cumulative and wrapping counter.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DropCounter {
    seen: u32,
}

impl DropCounter {
    pub const fn new(start: u32) -> Self {
        Self { seen: start }
    }

    /// Drops since the highest count so far. A count that is behind it is an older one: datagrams
    /// carry the count of the time they were queued.
    pub const fn since(&mut self, now: u32) -> u64 {
        let difference = now.wrapping_sub(self.seen);
        if difference > i32::MAX as u32 {
            return 0;
        }
        self.seen = now;
        difference as u64
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn message(level: i32, kind: i32, data: &[u8]) -> Vec<u8> {
        let mut bytes = (HEADER_BYTES + data.len()).to_ne_bytes().to_vec();
        bytes.extend(level.to_ne_bytes());
        bytes.extend(kind.to_ne_bytes());
        bytes.extend(data);
        bytes.resize(bytes.len().next_multiple_of(size_of::<usize>()), 0xEE);
        bytes
    }

    fn timespec(seconds: i64, nanos: i64) -> Vec<u8> {
        if size_of::<libc::timespec>() == 16 {
            [seconds.to_ne_bytes(), nanos.to_ne_bytes()].concat()
        } else {
            [(seconds as i32).to_ne_bytes(), (nanos as i32).to_ne_bytes()].concat()
        }
    }

    fn classic(id: u32, data: &[u8]) -> Vec<u8> {
        let mut bytes = id.to_ne_bytes().to_vec();
        bytes.extend([data.len() as u8, 0, 0, 0]);
        bytes.extend(data);
        bytes.resize(CLASSIC_BYTES, 0);
        bytes
    }

    fn fd(id: u32, flags: u8, data: &[u8]) -> Vec<u8> {
        let mut bytes = id.to_ne_bytes().to_vec();
        bytes.extend([data.len() as u8, flags, 0, 0]);
        bytes.extend(data);
        bytes.resize(FD_BYTES, 0);
        bytes
    }

    #[test]
    fn stamps_and_drops_are_found_among_other_messages() {
        let stamping = [timespec(0, 0), timespec(0, 0), timespec(7, 8)].concat();
        let control = [
            message(libc::SOL_IP, 2, &[1, 2, 3]),
            message(
                libc::SOL_SOCKET,
                libc::SO_TIMESTAMPNS,
                &timespec(1_700_000_000, 5),
            ),
            message(libc::SOL_SOCKET, libc::SO_RXQ_OVFL, &42_u32.to_ne_bytes()),
            message(libc::SOL_SOCKET, libc::SO_TIMESTAMPING, &stamping),
        ]
        .concat();
        let data = classic(0x123, &[1, 2]);
        let (frame, drops) = take_apart(&Datagram {
            data: &data,
            control: &control,
            flags: libc::MSG_DONTROUTE,
        });
        let frame = frame.expect("a frame");
        assert_eq!(frame.kernel_ns, Some(1_700_000_000_000_000_005));
        assert_eq!(frame.hardware_ns, Some(7_000_000_008));
        assert_eq!(drops, Some(42));
        assert!(frame.flags.local_echo);
        assert_eq!((frame.id, frame.bytes()), (0x123, &[1, 2][..]));
    }

    #[test]
    fn cut_and_absurd_control_messages_are_passed_over() {
        let good = message(libc::SOL_SOCKET, libc::SO_RXQ_OVFL, &9_u32.to_ne_bytes());
        let mut absurd = good.clone();
        absurd[..size_of::<usize>()].copy_from_slice(&usize::MAX.to_ne_bytes());
        for (control, drops) in [
            (good.clone(), Some(9)),
            (good[..good.len() - 5].to_vec(), None),
            (absurd, None),
            (vec![0; 64], None),
        ] {
            assert_eq!(Control::parse(&control).drops, drops);
        }
        let short = message(libc::SOL_SOCKET, libc::SO_TIMESTAMPNS, &[0; 8]);
        assert_eq!(Control::parse(&short).kernel_ns, None);
    }

    #[test]
    fn kinds_of_frames_are_told_apart() {
        let extended = parse_frame(&classic(0x9234_5678, &[])).expect("a frame");
        assert!(extended.flags.extended && extended.id == 0x1234_5678);
        let mut remote = classic(0x4000_0123, &[]);
        remote[4] = 5;
        let remote = parse_frame(&remote).expect("a frame");
        assert!(remote.flags.remote && remote.len == 5 && remote.bytes().is_empty());
        let error = parse_frame(&classic(0x2000_0004, &[0, 1, 0, 0, 0, 0, 0, 0])).expect("a frame");
        assert!(error.flags.error && !error.flags.extended && error.id == 4);
        assert!(is_controller_overflow(&error));
        let bus_off = parse_frame(&classic(0x2000_0040, &[0; 8])).expect("a frame");
        assert!(controller_event(&bus_off).is_some_and(|text| text.starts_with("bus off")));
        assert_eq!(controller_event(&error), None);
        let data: Vec<u8> = (0..64).collect();
        let long = parse_frame(&fd(0x8000_0001, 0x07, &data)).expect("a frame");
        assert!(long.flags.fd && long.flags.bit_rate_switch && long.flags.error_state);
        assert_eq!(long.bytes(), data);
        assert!(!is_controller_overflow(&long));
        assert_eq!(parse_frame(&[0; 15]), None);
        let mut overlong = classic(1, &[]);
        overlong[4] = 9;
        assert_eq!(parse_frame(&overlong), None);
    }

    #[test]
    fn drops_are_counted_once_through_the_wrap() {
        let mut counter = DropCounter::new(u32::MAX - 1);
        assert_eq!(counter.since(u32::MAX), 1);
        assert_eq!(counter.since(4), 5);
        assert_eq!(counter.since(2), 0);
        assert_eq!(counter.since(4), 0);
    }

    proptest! {
        #[test]
        fn no_datagram_panics(
            data in proptest::collection::vec(any::<u8>(), 0..80),
            control in proptest::collection::vec(any::<u8>(), 0..128),
            flags in any::<i32>(),
        ) {
            take_apart(&Datagram { data: &data, control: &control, flags });
        }
    }
}
