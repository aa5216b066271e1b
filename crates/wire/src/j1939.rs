//! SAE J1939: messages of several frames, as a listener on the bus sees them, and active trouble codes.
//!
//! The transport protocol (SAE J1939-21, 5.10) announces a message of 9 to 1785 bytes to all (BAM) or to
//! one address (RTS, which that address answers with CTS), and sends it in packets of seven bytes. A
//! listener sends nothing, so that a lost packet costs the message, unless the receiver asks for it again.

use sample::CanFrame;

use crate::dbc::{parameter_group, source_address};

/// Parameter groups of the transport protocol: connection management and data.
const CONNECTION: u32 = 0xEC00;
const DATA: u32 = 0xEB00;
/// Active diagnostic trouble codes (DM1, SAE J1939-73, 5.7.1).
pub const DM1: u32 = 0xFECA;
/// Control bytes of the connection management.
const REQUEST_TO_SEND: u8 = 16;
const BROADCAST: u8 = 32;
const ABORT: u8 = 255;
/// Bytes of a packet.
const PACKET: usize = 7;
/// Longest and shortest message, bytes.
const BYTES_MAX: usize = 1_785;
const BYTES_MIN: usize = 9;
/// Most messages that are in progress.
const SESSIONS_MAX: usize = 256;
/// Longest time between two packets, ns (J1939-21: T2 and T3, 1250 ms).
const PACKET_WITHIN_NS: u64 = 1_250_000_000;

/// A message that came in several frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// Identifier that a single frame of this message would have.
    pub id: u32,
    /// Its bytes.
    pub data: Vec<u8>,
}

/// A message in progress.
#[derive(Clone, Debug)]
struct Session {
    source: u8,
    destination: u8,
    group: u32,
    priority: u32,
    length: usize,
    data: Vec<u8>,
    /// Whether each packet has come.
    present: Vec<bool>,
    last_ns: u64,
}

/// Puts messages of several frames together.
#[derive(Clone, Debug, Default)]
pub struct Transport {
    sessions: Vec<Session>,
}

impl Transport {
    /// Takes a frame that arrived at a time and returns the message that it completes. `None` for frames
    /// of other parameter groups.
    pub fn push(&mut self, frame: &CanFrame, time_ns: u64) -> Option<Message> {
        if !frame.flags.extended || frame.flags.error || frame.flags.remote {
            return None;
        }
        let data: [u8; 8] = frame.bytes().try_into().ok()?;
        let addresses = (source_address(frame.id), (frame.id >> 8) as u8);
        match parameter_group(frame.id) {
            CONNECTION => {
                self.connect(addresses, frame.id >> 26 & 7, &data, time_ns);
                None
            }
            DATA => self.packet(addresses, &data, time_ns),
            _ => None,
        }
    }

    fn connect(&mut self, addresses: (u8, u8), priority: u32, data: &[u8; 8], time_ns: u64) {
        let (source, destination) = addresses;
        let [control, low, high, packets, ..] = *data;
        // An abort may come from either side.
        let is_own = |s: &Session| (s.source, s.destination) == addresses;
        let is_other = |s: &Session| (s.destination, s.source) == addresses;
        match control {
            BROADCAST | REQUEST_TO_SEND => self.sessions.retain(|s| !is_own(s)),
            ABORT => return self.sessions.retain(|s| !is_own(s) && !is_other(s)),
            _ => return,
        }
        let length = usize::from(u16::from_le_bytes([low, high]));
        let count = usize::from(packets);
        if !(BYTES_MIN..=BYTES_MAX).contains(&length) || count != length.div_ceil(PACKET) {
            return;
        }
        self.sessions
            .retain(|s| time_ns.saturating_sub(s.last_ns) <= PACKET_WITHIN_NS);
        if self.sessions.len() == SESSIONS_MAX {
            self.sessions.remove(0);
        }
        self.sessions.push(Session {
            source,
            destination,
            group: u32::from_le_bytes([data[5], data[6], data[7], 0]) & 0x3_FFFF,
            priority,
            length,
            data: vec![0xFF; count * PACKET],
            present: vec![false; count],
            last_ns: time_ns,
        });
    }

    fn packet(&mut self, addresses: (u8, u8), data: &[u8; 8], time_ns: u64) -> Option<Message> {
        let own = |s: &Session| (s.source, s.destination) == addresses;
        let index = self.sessions.iter().position(own)?;
        let session = &mut self.sessions[index];
        if time_ns.saturating_sub(session.last_ns) > PACKET_WITHIN_NS {
            self.sessions.remove(index);
            return None;
        }
        let packet = usize::from(data[0]).checked_sub(1)?;
        let at = packet * PACKET;
        session
            .data
            .get_mut(at..at + PACKET)?
            .copy_from_slice(&data[1..]);
        session.present[packet] = true;
        session.last_ns = time_ns;
        if session.present.iter().any(|present| !present) {
            return None;
        }
        let mut done = self.sessions.remove(index);
        done.data.truncate(done.length);
        // Below the format 240, the low byte of the group is the destination.
        let is_addressed = done.group & 0xFF00 < 0xF000;
        let group = if is_addressed {
            done.group & 0x3_FF00 | u32::from(done.destination)
        } else {
            done.group
        };
        Some(Message {
            id: done.priority << 26 | group << 8 | u32::from(done.source),
            data: done.data,
        })
    }
}

/// State of a lamp: off, on, or not known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lamps {
    /// Malfunction indicator, red stop, amber warning, protect; 0 off, 1 on, 2 and 3 not known.
    pub states: [u8; 4],
}

impl Lamps {
    /// Names of the lamps, in their order.
    pub const NAMES: [&str; 4] = ["malfunction", "red_stop", "amber_warning", "protect"];
}

/// An active trouble code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TroubleCode {
    /// Suspect parameter number.
    pub parameter: u32,
    /// Failure mode identifier.
    pub failure: u8,
    /// Occurrences; 127 is not known.
    pub occurrences: u8,
}

/// Lamps and trouble codes of a DM1; `None` if the data is too short. The code 0 with failure 0 stands for
/// none.
#[must_use]
pub fn trouble_codes(data: &[u8]) -> Option<(Lamps, Vec<TroubleCode>)> {
    let (lamps, codes) = data.split_first_chunk::<2>()?;
    let codes = codes.chunks_exact(4).map(|code| TroubleCode {
        parameter: u32::from(code[0]) | u32::from(code[1]) << 8 | u32::from(code[2] >> 5) << 16,
        failure: code[2] & 0x1F,
        occurrences: code[3] & 0x7F,
    });
    // A single frame is filled with ones; a filled or empty code is none.
    let is_code =
        |code: &TroubleCode| !matches!((code.parameter, code.failure), (0, 0) | (0x7_FFFF, 0x1F));
    let state = |shift: u8| lamps[0] >> shift & 3;
    Some((
        Lamps {
            states: [state(6), state(4), state(2), state(0)],
        },
        codes.filter(is_code).collect(),
    ))
}

#[cfg(test)]
mod tests {
    use sample::CanFlags;

    use super::*;

    fn frame(id: u32, data: &[u8]) -> CanFrame {
        let flags = CanFlags {
            extended: true,
            ..CanFlags::default()
        };
        CanFrame::new(id, flags, data).expect("eight bytes")
    }

    /// The frames of a message; `destination` 255 is a broadcast.
    fn frames(group: u32, source: u8, destination: u8, data: &[u8]) -> Vec<CanFrame> {
        let addresses = u32::from(destination) << 8 | u32::from(source);
        let control = if destination == 255 {
            BROADCAST
        } else {
            REQUEST_TO_SEND
        };
        let [low, high] = (data.len() as u16).to_le_bytes();
        let [g0, g1, g2, _] = group.to_le_bytes();
        let count = data.len().div_ceil(PACKET) as u8;
        let head = [control, low, high, count, 0xFF, g0, g1, g2];
        let packets = data.chunks(PACKET).zip(1_u8..).map(|(part, number)| {
            let mut bytes = [0xFF; 8];
            bytes[0] = number;
            bytes[1..=part.len()].copy_from_slice(part);
            frame(0x1CEB_0000 | addresses, &bytes)
        });
        std::iter::once(frame(0x1CEC_0000 | addresses, &head))
            .chain(packets)
            .collect()
    }

    fn pushed(frames: &[CanFrame], step_ns: u64) -> Vec<Message> {
        let mut transport = Transport::default();
        let times = (0..).map(|n| n * step_ns);
        let messages = frames.iter().zip(times);
        messages
            .filter_map(|(frame, time)| transport.push(frame, time))
            .collect()
    }

    #[test]
    fn broadcasts_and_connections_are_put_together() {
        let data: Vec<u8> = (0..38).collect();
        let all = frames(0xFEE3, 0x17, 255, &data);
        let found = pushed(&all, 50_000_000);
        let expected = Message {
            id: 0x1CFE_E317,
            data: data.clone(),
        };
        assert_eq!(found, [expected]);
        // To one address, of a group whose low byte is that address, with a packet twice.
        let mut all = frames(0xEF00, 0x17, 0x21, &data);
        all.insert(3, all[2].clone());
        assert_eq!(pushed(&all, 50_000_000)[0].id, 0x1CEF_2117);
        // Two senders at once.
        let other = frames(0xFEE3, 0x18, 255, &data[..20]);
        let mut mixed = Vec::new();
        for index in 0..7 {
            mixed.extend(frames(0xFEE3, 0x17, 255, &data).get(index).cloned());
            mixed.extend(other.get(index).cloned());
        }
        let lengths: Vec<usize> = pushed(&mixed, 1_000_000)
            .iter()
            .map(|m| m.data.len())
            .collect();
        assert_eq!(lengths, [20, 38]);
    }

    #[test]
    fn what_is_lost_aborted_or_late_gives_nothing() {
        let data = [7; 38];
        let all = frames(0xFEE3, 0x17, 255, &data);
        let mut cut = all.clone();
        cut.remove(2);
        assert_eq!(pushed(&cut, 1_000_000), []);
        assert_eq!(pushed(&all, 2_000_000_000), [], "too slow");
        let mut aborted = all.clone();
        aborted.insert(
            2,
            frame(0x1CEC_FF17, &[ABORT, 1, 0xFF, 0xFF, 0xFF, 0xE3, 0xFE, 0]),
        );
        assert_eq!(pushed(&aborted, 1_000_000), []);
        // After a cut message, the next one is whole.
        cut.extend(all);
        assert_eq!(pushed(&cut, 1_000_000).len(), 1);
        let wrong = frame(0x1CEC_FF17, &[BROADCAST, 38, 0, 3, 0xFF, 0xE3, 0xFE, 0]);
        assert_eq!(pushed(&[wrong], 1_000_000), []);
    }

    #[test]
    fn trouble_codes_have_parameter_failure_and_count() {
        // SPN 1208, FMI 3, ten occurrences; the amber lamp is on.
        let (lamps, codes) =
            trouble_codes(&[0x04, 0xFF, 0xB8, 0x04, 0x03, 0x0A, 0xFF, 0xFF]).expect("a DM1");
        assert_eq!(lamps.states, [0, 0, 1, 0]);
        let code = TroubleCode {
            parameter: 1208,
            failure: 3,
            occurrences: 10,
        };
        assert_eq!(codes, [code]);
        let none = trouble_codes(&[0, 0xFF, 0, 0, 0, 0, 0xFF, 0xFF]).expect("a DM1");
        assert!(none.1.is_empty());
        // A parameter of more than sixteen bits: 520,192 = 0x7F000.
        let (_, codes) = trouble_codes(&[0, 0, 0x00, 0xF0, 0xE4, 0x81]).expect("a DM1");
        assert_eq!((codes[0].parameter, codes[0].failure), (0x7_F000, 4));
    }
}
