//! Lines of a file of any length.

use std::io::{self, Read};
use std::ops::ControlFlow;

/// Bytes that are in memory, and longest line.
const BUFFER: usize = 1 << 18;
/// Mark at the beginning of a UTF-8 file.
const BYTE_ORDER_MARK: &[u8] = b"\xEF\xBB\xBF";

/// A line of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Line<'l> {
    /// Number in the file, from one.
    pub number: u64,
    /// Bytes without the end of the line.
    pub bytes: &'l [u8],
    /// The line ends with a carriage return and a line feed.
    pub carriage_return: bool,
    /// The line has an end: it is not the last line of a file that was cut.
    pub ended: bool,
}

/// Calls `take` with each line until it breaks. Of a line of more than [`BUFFER`] bytes, the beginning
/// is taken.
pub(super) fn each(
    input: &mut (impl Read + ?Sized),
    mut take: impl FnMut(Line<'_>) -> ControlFlow<()>,
) -> io::Result<()> {
    let mut buffer = vec![0; BUFFER];
    let (mut begin, mut end, mut number) = (0, 0, 0);
    let mut skipping = false;
    loop {
        while let Some(length) = memchr::memchr(b'\n', &buffer[begin..end]) {
            let bytes = &buffer[begin..begin + length];
            begin += length + 1;
            if !std::mem::take(&mut skipping) {
                number += 1;
                if take(line(number, bytes, true)).is_break() {
                    return Ok(());
                }
            }
        }
        buffer.copy_within(begin..end, 0);
        (begin, end) = (0, end - begin);
        if end == buffer.len() {
            if !std::mem::replace(&mut skipping, true) {
                number += 1;
                if take(line(number, &buffer, true)).is_break() {
                    return Ok(());
                }
            }
            end = 0;
        }
        let count = match input.read(&mut buffer[end..]) {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            count => count?,
        };
        end += count;
        if count == 0 {
            // A file whose space was reserved before it was written can end with null bytes.
            let written = buffer[..end].iter().rposition(|byte| *byte != 0);
            let last = &buffer[..written.map_or(0, |at| at + 1)];
            if !last.is_empty() && !skipping {
                let _ = take(line(number + 1, last, false));
            }
            return Ok(());
        }
    }
}

fn line(number: u64, mut bytes: &[u8], ended: bool) -> Line<'_> {
    if number == 1 {
        bytes = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes);
    }
    let without = bytes.strip_suffix(b"\r");
    Line {
        number,
        bytes: without.unwrap_or(bytes),
        carriage_return: without.is_some(),
        ended,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gives a few bytes at a time.
    struct Slow<'b>(&'b [u8], usize);

    impl Read for Slow<'_> {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            let count = self.1.min(self.0.len()).min(buffer.len());
            buffer[..count].copy_from_slice(&self.0[..count]);
            self.0 = &self.0[count..];
            Ok(count)
        }
    }

    fn lines(bytes: &[u8], at_a_time: usize) -> Vec<(u64, usize, bool, bool)> {
        let mut found = Vec::new();
        each(&mut Slow(bytes, at_a_time), |line| {
            found.push((
                line.number,
                line.bytes.len(),
                line.carriage_return,
                line.ended,
            ));
            ControlFlow::Continue(())
        })
        .expect("read");
        found
    }

    #[test]
    fn lines_do_not_depend_on_the_reads() {
        let text = b"\xEF\xBB\xBFab\r\n\n123\ncut\0\0";
        let expected = [
            (1, 2, true, true),
            (2, 0, false, true),
            (3, 3, false, true),
            (4, 3, false, false),
        ];
        assert_eq!(lines(text, 1), expected);
        assert_eq!(lines(text, 100), expected);
    }

    #[test]
    fn a_line_without_end_needs_no_memory() {
        let mut text = vec![b'x'; 3 * BUFFER];
        text.extend(b"\nnext\n");
        assert_eq!(
            lines(&text, 4096),
            [(1, BUFFER, false, true), (2, 4, false, true)]
        );
    }
}
