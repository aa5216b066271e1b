//! What arrived from a source, and what the decoders made of it.

use sample::SourceId;
use wire::recognise::{BYTES_MAX, Format, is_nmea2000, recognise};

use super::counts::MessageCounts;

/// What arrived from a source since the start.
#[derive(Clone, Debug)]
pub struct Reception {
    /// Number of the source.
    pub source: SourceId,
    /// Its name.
    pub name: String,
    /// Kind of the source in the configuration.
    pub kind: &'static str,
    /// Whether data that no decoder understands is a mistake. A bus without a DBC file is only recorded.
    pub is_decoded: bool,
    /// Bytes that arrived.
    pub bytes: u64,
    /// Frames that arrived.
    pub frames: u64,
    /// Messages by name.
    pub messages: MessageCounts,
    /// What the first bytes look like, if nothing was understood.
    pub format: Option<Format>,
}

impl Reception {
    /// What is wrong, and what to do, if nothing came or nothing was understood.
    #[must_use]
    pub fn problem(&self) -> Option<String> {
        if self.bytes == 0 && self.frames == 0 {
            return Some(
                "nothing received; check power, cable and settings of the device".to_owned(),
            );
        }
        if !self.is_decoded || self.messages.understood() > 0 {
            return None;
        }
        if self.frames > 0 {
            let (frames, kind) = (grouped(self.frames), self.format);
            let advice = kind.map_or(
                "set dbc to the files of this bus, or dbc = [] to record its frames alone",
                Format::advice,
            );
            let looks = kind.map_or(String::new(), |format| format!("; they look like {format}"));
            return Some(format!(
                "{frames} frames, none of a message in its DBC files{looks}: {advice}"
            ));
        }
        let bytes = grouped(self.bytes);
        let known: Vec<String> = self
            .messages
            .not_decoded()
            .map(|(name, count)| format!("{name} {count}"))
            .collect();
        Some(match self.format {
            None => format!(
                "{bytes} bytes, none understood, of no known protocol; check the kind of the source and \
                 its baud rate"
            ),
            Some(format) if format.kind() == Some(self.kind) && !known.is_empty() => format!(
                "{bytes} bytes of {format}, but no message that is decoded ({}): {}",
                known.join(", "),
                format.advice()
            ),
            Some(format) => format!(
                "{bytes} bytes, none understood; they look like {format}: {}",
                format.advice()
            ),
        })
    }
}

/// The first bytes, or identifiers, of a source from which nothing was understood.
#[derive(Clone, Debug, Default)]
pub(super) struct Unread {
    bytes: Vec<u8>,
    /// Frames of NMEA 2000 among those without a DBC message, and all of those.
    boat: [u64; 2],
}

impl Unread {
    pub fn push_bytes(&mut self, bytes: &[u8]) {
        let free = BYTES_MAX - self.bytes.len();
        self.bytes
            .extend_from_slice(&bytes[..bytes.len().min(free)]);
    }

    pub fn push_frame(&mut self, id: u32, extended: bool) {
        self.boat[0] += u64::from(extended && is_nmea2000(id));
        self.boat[1] += 1;
    }

    pub fn clear(&mut self) {
        *self = Self::default();
    }

    pub fn format(&self) -> Option<Format> {
        let [boat, all] = self.boat;
        if 2 * boat > all {
            return Some(Format::Nmea2000);
        }
        recognise(&self.bytes)
    }
}

/// A count with separators: `3,200`.
fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let mut text = String::with_capacity(digits.len() + digits.len() / 3);
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_have_separators() {
        let text = [0, 12, 999, 1_000, 3_200, 1_234_567].map(grouped);
        assert_eq!(text, ["0", "12", "999", "1,000", "3,200", "1,234,567"]);
    }
}
