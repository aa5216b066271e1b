//! TRC, the text log of PEAK-System's tools ("PEAK CAN TRC File Format", versions 1.0 to 2.1).

use std::io::{Read, Seek};
use std::ops::ControlFlow;

use sample::{CanFlags, CanFrame};

use super::date::ole_date;
use super::lines::{Line, each};
use super::number::{decimal, hexadecimal, length_of, unsigned, words};
use super::{Direction, Entry, Error, Record, Sink, Summary};

/// Latest version of the format.
const VERSION_MAX: [u32; 2] = [2, 1];

/// Reads a TRC file.
///
/// # Errors
/// The file cannot be read, or it has a version that this program does not know.
pub fn read(input: &mut (impl Read + Seek), sink: &mut Sink<'_>) -> Result<Summary, Error> {
    let mut reader = Reader {
        summary: Summary::default(),
        columns: columns_of([1, 0]),
        problem: None,
    };
    each(input, |line| reader.take(line, sink))?;
    match reader.problem {
        None => Ok(reader.summary),
        Some(problem) => Err(problem),
    }
}

/// A column of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Column {
    /// Number of the message; versions 1.x write `)` after it.
    Number,
    /// Time from the start, ms.
    Offset,
    /// Direction, or that the line is no frame: versions 1.x.
    TypeOrDirection,
    /// Type: versions 2.x.
    Type,
    Bus,
    Identifier,
    Direction,
    /// A word that is not used.
    Other,
    /// Data length code.
    Code,
    /// Number of bytes.
    Length,
    /// The bytes, or `RTR`.
    Data,
}

/// Columns of a version below 2.0.
fn columns_of(version: [u32; 2]) -> Vec<Column> {
    use Column::{Bus, Code, Data, Identifier, Number, Offset, Other, TypeOrDirection};
    match version {
        [1, 0] => vec![Number, Offset, Identifier, Code, Data],
        [1, 1] => vec![Number, Offset, TypeOrDirection, Identifier, Code, Data],
        [1, 2] => vec![Number, Offset, Bus, TypeOrDirection, Identifier, Code, Data],
        _ => vec![
            Number,
            Offset,
            Bus,
            TypeOrDirection,
            Identifier,
            Other,
            Code,
            Data,
        ],
    }
}

/// Columns of `$COLUMNS=N,O,T,I,d,l,D`.
fn named_columns(text: &[u8]) -> Vec<Column> {
    let names = text.split(|byte| *byte == b',').map(<[u8]>::trim_ascii);
    names
        .map(|name| match name {
            b"N" => Column::Number,
            b"O" => Column::Offset,
            b"T" => Column::Type,
            b"B" => Column::Bus,
            b"I" => Column::Identifier,
            b"d" => Column::Direction,
            b"L" => Column::Code,
            b"l" => Column::Length,
            b"D" => Column::Data,
            _ => Column::Other,
        })
        .collect()
}

struct Reader {
    summary: Summary,
    columns: Vec<Column>,
    problem: Option<Error>,
}

/// What a line contains.
enum Parsed<'l> {
    Frame(Found<'l>),
    /// Another record, by kind.
    Other(&'static str),
    Unreadable,
}

struct Found<'l> {
    stamp_ns: i64,
    bus: Option<&'l [u8]>,
    direction: Option<Direction>,
    dlc: Option<u8>,
    frame: CanFrame,
}

impl Reader {
    fn take(&mut self, line: Line<'_>, sink: &mut Sink<'_>) -> ControlFlow<()> {
        let bytes = line.bytes.trim_ascii();
        if let Some(comment) = bytes.strip_prefix(b";") {
            return self.take_comment(comment);
        }
        if bytes.is_empty() {
            return ControlFlow::Continue(());
        }
        match parse(bytes, &self.columns) {
            Parsed::Frame(found) => {
                let bus = found.bus.map(String::from_utf8_lossy);
                let channel = bus.and_then(|bus| self.summary.channel(&bus));
                self.summary.frames += 1;
                sink(Record::Frame(Entry {
                    stamp_ns: found.stamp_ns,
                    channel,
                    direction: found.direction,
                    dlc: found.dlc,
                    frame: found.frame,
                }))
            }
            Parsed::Other(kind) => {
                self.summary.leave_out(kind);
                ControlFlow::Continue(())
            }
            Parsed::Unreadable => {
                self.summary.unreadable(line, "a record of a TRC file");
                ControlFlow::Continue(())
            }
        }
    }

    fn take_comment(&mut self, comment: &[u8]) -> ControlFlow<()> {
        let comment = comment.trim_ascii();
        if let Some(text) = comment.strip_prefix(b"$FILEVERSION=") {
            return self.take_version(text.trim_ascii());
        }
        if let Some(text) = comment.strip_prefix(b"$STARTTIME=") {
            self.summary.start_ns = ole_date(text.trim_ascii());
        }
        if let Some(text) = comment.strip_prefix(b"$COLUMNS=") {
            self.columns = named_columns(text);
        }
        ControlFlow::Continue(())
    }

    fn take_version(&mut self, text: &[u8]) -> ControlFlow<()> {
        let mut parts = text.split(|byte| *byte == b'.').map(unsigned);
        let version = [parts.next(), parts.next()].map(Option::flatten);
        if let [Some(major), Some(minor)] = version
            && (1..=VERSION_MAX[0]).contains(&major)
            && [major, minor] <= VERSION_MAX
        {
            if major == 1 {
                self.columns = columns_of([major, minor]);
            }
            return ControlFlow::Continue(());
        }
        self.problem = Some(Error::OtherVersion {
            expected: "versions 1.0 to 2.1",
            found: format!("a TRC log of version {}", String::from_utf8_lossy(text)),
            advice: "save it with PCAN-View or PEAK-Converter in version 2.1",
        });
        ControlFlow::Break(())
    }
}

/// Whether the line is a record of version 1.0, which has no head.
pub(super) fn is_record(line: &[u8]) -> bool {
    let first = words(line).next().and_then(|word| word.strip_suffix(b")"));
    first.and_then(unsigned).is_some()
        && !matches!(parse(line, &columns_of([1, 0])), Parsed::Unreadable)
}

/// The words of a line, by column.
#[derive(Default)]
struct Words<'l> {
    offset: &'l [u8],
    kind: Option<&'l [u8]>,
    type_or_direction: Option<&'l [u8]>,
    direction: Option<&'l [u8]>,
    bus: Option<&'l [u8]>,
    identifier: Option<&'l [u8]>,
    code: Option<&'l [u8]>,
    length: Option<&'l [u8]>,
}

fn parse<'l>(line: &'l [u8], columns: &[Column]) -> Parsed<'l> {
    let mut rest = words(line);
    let mut found = Words::default();
    for column in columns {
        if *column == Column::Data {
            break;
        }
        let Some(word) = rest.next() else {
            return Parsed::Unreadable;
        };
        match column {
            Column::Offset => found.offset = word,
            Column::Type => found.kind = Some(word),
            Column::TypeOrDirection => found.type_or_direction = Some(word),
            Column::Direction => found.direction = Some(word),
            Column::Bus => found.bus = Some(word),
            Column::Identifier => found.identifier = Some(word),
            Column::Code => found.code = Some(word),
            Column::Length => found.length = Some(word),
            Column::Number | Column::Other | Column::Data => {}
        }
        // The columns of lines that are no frames differ.
        if let Some(parsed) = other(&found) {
            return parsed;
        }
    }
    frame(&found, rest).map_or(Parsed::Unreadable, Parsed::Frame)
}

/// What the words of a line say if it is no frame with an identifier.
fn other<'l>(found: &Words<'l>) -> Option<Parsed<'l>> {
    let is_error = matches!(found.kind, Some(b"ER")) || found.type_or_direction == Some(b"Error");
    if is_error && (found.identifier.is_some() || found.direction.is_some()) {
        let parsed = error_frame(found).map_or(Parsed::Unreadable, Parsed::Frame);
        return Some(parsed);
    }
    let kind = match (found.kind, found.type_or_direction) {
        (Some(b"ST"), _) | (_, Some(b"Warng")) => "status records",
        (Some(b"EC"), _) => "records of error counters",
        (Some(b"EV"), _) => "event records",
        (Some(b"DT" | b"FD" | b"FB" | b"FE" | b"BI" | b"RR" | b"ER"), _) => return None,
        (Some(_), _) => "records of unknown types",
        // Version 1.0 has no types: a status has the identifier of all ones.
        _ if found.identifier == Some(b"FFFFFFFF") && found.type_or_direction.is_none() => {
            "status records"
        }
        _ => return None,
    };
    Some(Parsed::Other(kind))
}

fn error_frame<'l>(found: &Words<'l>) -> Option<Found<'l>> {
    let flags = CanFlags {
        error: true,
        ..CanFlags::default()
    };
    Some(Found {
        stamp_ns: decimal(found.offset, 6)?,
        bus: found.bus,
        direction: None,
        dlc: None,
        frame: CanFrame::new(0, flags, &[])?,
    })
}

fn frame<'l>(found: &Words<'l>, data: impl Iterator<Item = &'l [u8]>) -> Option<Found<'l>> {
    let word = found.identifier?;
    let mut flags = CanFlags::default();
    let id = hexadecimal(word)?;
    // Eight digits are 29 bits. Some writers leave out the zeros in front of them.
    flags.extended = word.len() > 4 || id > 0x7FF;
    let most = if flags.extended { 0x1FFF_FFFF } else { 0x7FF };
    let direction = match found.direction.or(found.type_or_direction) {
        Some(b"Rx") => Some(Direction::Received),
        Some(b"Tx") => Some(Direction::Sent),
        None => None,
        Some(_) => return None,
    };
    let kind = found.kind.unwrap_or(b"DT");
    flags.remote = kind == b"RR";
    flags.fd = matches!(kind, b"FD" | b"FB" | b"FE" | b"BI");
    flags.bit_rate_switch = matches!(kind, b"FB" | b"BI");
    flags.error_state = matches!(kind, b"FE" | b"BI");
    let (dlc, length) = length(found, flags.fd)?;
    let mut bytes = [0; 64];
    let mut count = 0;
    for word in data {
        if word.starts_with(b"RTR") {
            flags.remote = true;
            break;
        }
        if count == length {
            break;
        }
        *bytes.get_mut(usize::from(count))? = u8::try_from(hexadecimal(word)?).ok()?;
        count += 1;
    }
    let is_whole = flags.remote || count == length;
    let data = if flags.remote {
        &[]
    } else {
        &bytes[..usize::from(length)]
    };
    let mut frame = CanFrame::new(id, flags, data)?;
    frame.len = length;
    frame.len8_dlc = if dlc > 8 && !flags.fd { dlc } else { 0 };
    (is_whole && id <= most).then_some(Found {
        stamp_ns: decimal(found.offset, 6)?,
        bus: found.bus,
        direction,
        dlc: Some(dlc),
        frame,
    })
}

/// Data length code and number of bytes.
fn length(found: &Words<'_>, fd: bool) -> Option<(u8, u8)> {
    if let Some(word) = found.code {
        let code = u8::try_from(unsigned(word)?)
            .ok()
            .filter(|code| *code <= 15)?;
        return Some((code, length_of(code, fd)));
    }
    let length = u8::try_from(unsigned(found.length?)?).ok()?;
    let code = super::number::code_of(length);
    (length_of(code, fd) == length).then_some((code, length))
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;
    use std::ops::ControlFlow;

    use super::*;
    use crate::can_log::Record;

    /// The writer of python-can leaves out the zeros in front of a 29-bit identifier.
    #[test]
    fn identifiers_of_five_digits_and_more_have_29_bits() {
        let text = ";$FILEVERSION=2.1\n;$STARTTIME=45244.5\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n\
                    1 0.000 DT 1 0076 Rx - 1 7F\n\
                    2 1.000 DT 1 D407822 Rx - 1 43\n\
                    3 2.000 DT 1 8A3 Rx - 0\n\
                    4 3.000 DT 1 00000076 Rx - 0\n";
        let mut found = Vec::new();
        let mut sink = |record| {
            if let Record::Frame(entry) = record {
                found.push((entry.frame.id, entry.frame.flags.extended));
            }
            ControlFlow::Continue(())
        };
        read(&mut Cursor::new(text), &mut sink).unwrap();
        let want = [
            (0x76, false),
            (0xD40_7822, true),
            (0x8A3, true),
            (0x76, true),
        ];
        assert_eq!(found, want);
    }
}
