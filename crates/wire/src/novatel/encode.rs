use super::frame::{LONG_HEADER, TIME_STATUS, checksum};
use super::{Body, Header, LOGS, Log};
use crate::codec::{AsciiWriter, BinaryWriter, Codec};

impl Log {
    /// A log of this message id, steered finely to GPS time. `None` if the id's layout is not the
    /// body's.
    #[must_use]
    pub fn new(id: u16, week: u16, milliseconds: u32, body: Body) -> Option<Self> {
        let (_, _, layout) = LOGS.iter().find(|log| log.0 == id)?;
        let short = matches!(id, 508 | 813);
        let header = Header {
            id,
            time_status: if short { 0 } else { 180 },
            week,
            milliseconds,
            short,
            ..Header::default()
        };
        (*layout == body.layout()).then_some(Self { header, body })
    }

    /// Appends this in binary.
    pub fn encode_binary(&self, out: &mut Vec<u8>) {
        let start = out.len();
        let h = self.header;
        let length_at = if h.short {
            out.extend([0xAA, 0x44, 0x13, 0]);
            out.extend(h.id.to_le_bytes());
            out.extend(h.week.to_le_bytes());
            out.extend(h.milliseconds.to_le_bytes());
            start + 3
        } else {
            out.extend([0xAA, 0x44, 0x12, LONG_HEADER as u8]);
            out.extend(h.id.to_le_bytes());
            let kind = h.antenna & 0x1F | if h.response { 0x80 } else { 0 };
            out.extend([kind, 0x20, 0, 0]);
            out.extend(h.sequence.to_le_bytes());
            out.extend([h.idle, h.time_status]);
            out.extend(h.week.to_le_bytes());
            out.extend(h.milliseconds.to_le_bytes());
            out.extend(h.receiver_status.to_le_bytes());
            out.extend([0, 0]);
            out.extend(h.software.to_le_bytes());
            start + 8
        };
        let body_at = out.len();
        let mut body = self.body;
        // A writer never ends the walk.
        let _ = body.walk(&mut BinaryWriter(out));
        // All bodies are shorter than 256 bytes.
        out[length_at] = (out.len() - body_at) as u8;
        let crc = checksum(&out[start..]);
        out.extend(crc.to_le_bytes());
    }

    /// Appends this in ASCII, with its line end.
    pub fn encode_ascii(&self, out: &mut Vec<u8>) {
        let h = self.header;
        let name = LOGS
            .iter()
            .find(|log| log.0 == h.id)
            .map_or("", |log| log.1);
        let seconds = f64::from(h.milliseconds) / 1000.0;
        let mut text = if h.short {
            format!("{name}A,{},{seconds:.3};", h.week)
        } else {
            let mut head = format!(
                "{name}A,COM1,{},{:.1},",
                h.sequence,
                f64::from(h.idle) / 2.0
            );
            let mut writer = AsciiWriter {
                out: &mut head,
                first: true,
            };
            let _ = writer.named(&mut u32::from(h.time_status), TIME_STATUS);
            let status = h.receiver_status;
            format!(
                "{head},{},{seconds:.3},{status:08x},0000,{};",
                h.week, h.software
            )
        };
        let mut body = self.body;
        let _ = body.walk(&mut AsciiWriter {
            out: &mut text,
            first: true,
        });
        let crc = checksum(text.as_bytes());
        out.push(if h.short { b'%' } else { b'#' });
        out.extend(text.as_bytes());
        out.extend(format!("*{crc:08x}\r\n").as_bytes());
    }
}
