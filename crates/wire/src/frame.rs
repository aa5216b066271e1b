use std::ops::Range;

/// What a decoder has seen since its start. Each count only rises.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Messages whose checksum was good, among them `malformed` and `unknown` ones.
    pub messages: u64,
    /// Byte sequences that had the form of a message but a wrong checksum.
    pub checksum_errors: u64,
    /// Bytes that belonged to no message; line ends and null bytes between messages do not count.
    pub skipped_bytes: u64,
    /// Messages missing by the device's own counter; a restarted counter counts as one.
    pub gaps: u64,
    /// Messages with a good checksum whose content makes no sense.
    pub malformed: u64,
    /// Messages with a good checksum that this crate does not decode.
    pub unknown: u64,
}

impl Statistics {
    /// The sum of two decoders' counts.
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        Self {
            messages: self.messages + other.messages,
            checksum_errors: self.checksum_errors + other.checksum_errors,
            skipped_bytes: self.skipped_bytes + other.skipped_bytes,
            gaps: self.gaps + other.gaps,
            malformed: self.malformed + other.malformed,
            unknown: self.unknown + other.unknown,
        }
    }
}

/// What a scanner says of the bytes that wait. It looks at their beginning only and decides from
/// content alone, so that the cut of the stream into reads cannot matter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scan<K> {
    /// No message begins in the first `n` (at least one) bytes.
    Skip(usize),
    /// It takes at least `n` bytes, more than there are, to tell.
    Need(usize),
    /// The first `len` bytes are a message with a good checksum.
    Frame { len: usize, kind: K },
    /// A message by form, with a wrong checksum: its first byte is skipped.
    BadChecksum,
}

/// A message found by the framer.
pub(crate) struct Frame<'a, K> {
    pub kind: K,
    pub bytes: &'a [u8],
    /// Place in the stream, in bytes from its start.
    pub range: Range<u64>,
}

/// Cuts a byte stream into messages. Holds at most twice `limit` bytes.
#[derive(Clone, Debug)]
pub(crate) struct Framer {
    buffer: Vec<u8>,
    /// Stream position of the buffer's first byte.
    position: u64,
    /// Longest message that is waited for.
    limit: usize,
}

impl Framer {
    pub fn new(limit: usize) -> Self {
        Self {
            buffer: Vec::with_capacity(2 * limit),
            position: 0,
            limit,
        }
    }

    /// Takes bytes and hands on each message that they complete.
    pub fn push<K>(
        &mut self,
        bytes: &[u8],
        statistics: &mut Statistics,
        scan: impl Fn(&[u8]) -> Scan<K>,
        mut deliver: impl FnMut(Frame<'_, K>, &mut Statistics),
    ) {
        for chunk in bytes.chunks(self.limit) {
            self.buffer.extend_from_slice(chunk);
            self.drain(statistics, false, &scan, &mut deliver);
        }
    }

    /// The stream is over: what waits for more bytes will not get them. Intact messages behind an
    /// unfinished one still come out.
    pub fn finish<K>(
        &mut self,
        statistics: &mut Statistics,
        scan: impl Fn(&[u8]) -> Scan<K>,
        mut deliver: impl FnMut(Frame<'_, K>, &mut Statistics),
    ) {
        self.drain(statistics, true, &scan, &mut deliver);
    }

    fn drain<K>(
        &mut self,
        statistics: &mut Statistics,
        at_end: bool,
        scan: &impl Fn(&[u8]) -> Scan<K>,
        deliver: &mut impl FnMut(Frame<'_, K>, &mut Statistics),
    ) {
        let mut start = 0;
        while start < self.buffer.len() {
            let waiting = &self.buffer[start..];
            let skip = match scan(waiting) {
                Scan::Frame { len, kind } => {
                    let begin = self.position + start as u64;
                    statistics.messages += 1;
                    let frame = Frame {
                        kind,
                        bytes: &waiting[..len],
                        range: begin..begin + len as u64,
                    };
                    deliver(frame, statistics);
                    start += len;
                    continue;
                }
                Scan::Need(needed) if !at_end && needed <= self.limit => break,
                Scan::Need(_) => 1,
                Scan::BadChecksum => {
                    statistics.checksum_errors += 1;
                    1
                }
                Scan::Skip(count) => count.clamp(1, waiting.len()),
            };
            statistics.skipped_bytes +=
                waiting[..skip].iter().filter(|b| !is_filler(**b)).count() as u64;
            start += skip;
        }
        self.buffer.drain(..start);
        self.position += start as u64;
    }
}

/// Bytes that receivers put between messages.
fn is_filler(byte: u8) -> bool {
    matches!(byte, b'\r' | b'\n' | 0)
}

/// Looks for a line of at most `MAX` bytes. Lines end at `\n` or `\r`; only the text belongs to the
/// frame, leading ends are filler.
pub(crate) fn scan_line<const MAX: usize>(bytes: &[u8]) -> Scan<()> {
    if matches!(bytes[0], b'\r' | b'\n') {
        return Scan::Skip(1);
    }
    let window = &bytes[..bytes.len().min(MAX)];
    match window.iter().position(|b| matches!(b, b'\r' | b'\n')) {
        Some(end) => Scan::Frame { len: end, kind: () },
        None if bytes.len() < MAX => Scan::Need(bytes.len() + 1),
        None => Scan::Skip(MAX),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Toy protocol: 0xA5, length of the whole, payload, sum of all before.
    fn scan(bytes: &[u8]) -> Scan<()> {
        if bytes[0] != 0xA5 {
            return Scan::Skip(bytes.iter().position(|b| *b == 0xA5).unwrap_or(bytes.len()));
        }
        let Some(&len) = bytes.get(1) else {
            return Scan::Need(2);
        };
        let len = usize::from(len);
        if len < 3 {
            return Scan::Skip(1);
        }
        if bytes.len() < len {
            return Scan::Need(len);
        }
        let sum = bytes[..len - 1].iter().fold(0u8, |a, b| a.wrapping_add(*b));
        if sum == bytes[len - 1] {
            Scan::Frame { len, kind: () }
        } else {
            Scan::BadChecksum
        }
    }

    const GOOD: [u8; 4] = [0xA5, 4, 7, 0xB0];

    #[test]
    fn a_false_header_costs_one_byte() {
        let mut framer = Framer::new(16);
        let mut statistics = Statistics::default();
        let mut found = Vec::new();
        // 0xA5 0xA5 asks for 165 bytes, more than the limit; 0xA5 0x05 would use up the good
        // message if its length were accepted.
        let mut stream = vec![0xA5, 0xA5, 0x05];
        stream.extend(GOOD);
        framer.push(&stream, &mut statistics, scan, |f, _| found.push(f.range));
        assert_eq!(found.len(), 1);
        assert_eq!(found[0], 3..7);
        assert_eq!(statistics.checksum_errors, 1);
        assert_eq!(statistics.skipped_bytes, 3);
    }

    #[test]
    fn the_end_frees_what_waits_behind_an_unfinished_message() {
        let mut framer = Framer::new(16);
        let mut statistics = Statistics::default();
        let mut found = 0;
        let mut stream = vec![0xA5, 9];
        stream.extend(GOOD);
        framer.push(&stream, &mut statistics, scan, |_, _| found += 1);
        assert_eq!(found, 0);
        framer.finish(&mut statistics, scan, |_, _| found += 1);
        assert_eq!(found, 1);
    }

    #[test]
    fn memory_is_bounded() {
        let mut framer = Framer::new(16);
        let mut statistics = Statistics::default();
        framer.push(&[0xA5; 10_000], &mut statistics, scan, |_, _| {});
        assert!(framer.buffer.capacity() <= 32);
    }
}
