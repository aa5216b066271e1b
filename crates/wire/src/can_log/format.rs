//! Formats of logs by the first bytes of a file.

use std::ops::ControlFlow;

use super::lines::each;
use super::{asc, candump, trc};

/// Bytes at the beginning of a file that are looked at.
pub const HEAD_BYTES: usize = 1 << 16;
/// Lines of text that are looked at.
const LINES_MAX: usize = 200;

/// Format of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Format {
    /// Text of candump.
    Candump,
    /// Text log of Vector's tools.
    Asc,
    /// Text log of PEAK-System's tools.
    Trc,
    /// Binary log of Vector's tools.
    Blf,
    /// MDF of version 4.
    Mf4,
    /// A format that is not read: its name, and what the user can do.
    Other(&'static str, &'static str),
}

impl Format {
    /// Name with its article, in plain words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Candump => "a log of candump",
            Self::Asc => "an ASC log",
            Self::Trc => "a TRC log",
            Self::Blf => "a BLF log",
            Self::Mf4 => "an MF4 file",
            Self::Other(name, _) => name,
        }
    }

    /// Whether this crate reads frames of the format.
    #[must_use]
    pub const fn is_read(self) -> bool {
        !matches!(self, Self::Other(..))
    }
}

const CAN_HELP: &str = "save it as ASC, BLF, TRC or candump with the program that wrote it";
const TABLE_HELP: &str =
    "it has no CAN frames; export its channels as CSV and use `atvrec import csv`";

/// Formats by their first bytes.
const MAGIC: &[(&[u8], Format)] = &[
    (b"LOGG", Format::Blf),
    (b"UnFinMF ", Format::Mf4),
    (b"MDF     4", Format::Mf4),
    (
        b"MDF     3",
        Format::Other("an MDF file of version 3", TABLE_HELP),
    ),
    (
        b"MDF     2",
        Format::Other("an MDF file of version 2", TABLE_HELP),
    ),
    (b"MATLAB ", Format::Other("a MATLAB file", TABLE_HELP)),
    (
        b"\x89HDF\r\n\x1a\n",
        Format::Other("an HDF5 file (MATLAB 7.3 or other)", TABLE_HELP),
    ),
    (
        b"\x40\0\0\0\0\0\0\0",
        Format::Other("a MoTeC log (.ld)", TABLE_HELP),
    ),
    (
        b"VBB\x02",
        Format::Other("a Racelogic VBOX log (.vbb)", TABLE_HELP),
    ),
    (
        b"\x1f\x8b",
        Format::Other("a gzip file", "decompress it with gunzip"),
    ),
    (
        b"\xfd7zXZ\0",
        Format::Other("an xz file", "decompress it with unxz"),
    ),
    (
        b"\x28\xb5\x2f\xfd",
        Format::Other("a zstd file", "decompress it with unzstd"),
    ),
    (
        b"BZh",
        Format::Other("a bzip2 file", "decompress it with bunzip2"),
    ),
    (b"PK\x03\x04", Format::Other("a ZIP archive", "unpack it")),
    (
        b"7z\xbc\xaf\x27\x1c",
        Format::Other("a 7-Zip archive", "unpack it"),
    ),
    (
        b"\x89MCAP0\r\n",
        Format::Other(
            "an MCAP log",
            "if atvrec wrote it, use it as it is, without import",
        ),
    ),
    (
        b"\x0a\x0d\x0d\x0a",
        Format::Other(
            "a pcapng capture",
            "convert it to BLF or candump with tshark",
        ),
    ),
    (
        b"\xd4\xc3\xb2\xa1",
        Format::Other("a pcap capture", "convert it to BLF or candump with tshark"),
    ),
    (
        b"\xa1\xb2\xc3\xd4",
        Format::Other("a pcap capture", "convert it to BLF or candump with tshark"),
    ),
    (
        b"\x4d\x3c\xb2\xa1",
        Format::Other("a pcap capture", "convert it to BLF or candump with tshark"),
    ),
    (
        b"SQLite format 3\0",
        Format::Other("an SQLite database", "export its CAN frames as candump"),
    ),
    (
        b"#ROSBAG",
        Format::Other("a ROS bag", "export its CAN frames as candump"),
    ),
    (b"PAR1", Format::Other("a Parquet table", TABLE_HELP)),
    (b"TDSm", Format::Other("a TDMS file", TABLE_HELP)),
    (b"ULog\x01", Format::Other("a PX4 ULog", TABLE_HELP)),
    (
        b"\xd0\xcf\x11\xe0",
        Format::Other(
            "a spreadsheet",
            "save its table as CSV and use `atvrec import csv`",
        ),
    ),
    (
        b"\xff\xfe",
        Format::Other("UTF-16 text", "save it as UTF-8"),
    ),
    (
        b"\xfe\xff",
        Format::Other("UTF-16 text", "save it as UTF-8"),
    ),
];

/// The format of a file with this beginning, of which [`HEAD_BYTES`] are enough.
#[must_use]
pub fn recognise(head: &[u8]) -> Option<Format> {
    let magic = MAGIC.iter().find(|(magic, _)| head.starts_with(magic));
    if let Some((_, format)) = magic {
        return Some(*format);
    }
    if is_matlab_4(head, u32::from_le_bytes) || is_matlab_4(head, u32::from_be_bytes) {
        return Some(Format::Other("a MATLAB file of version 4", TABLE_HELP));
    }
    of_text(head)
}

/// The header of a MATLAB file of version 4 ("MAT-File Format", chapter 2): type, rows, columns,
/// whether there is an imaginary part, length of the name; then the name.
fn is_matlab_4(head: &[u8], from_bytes: fn([u8; 4]) -> u32) -> bool {
    let mut words = head.as_chunks::<4>().0.iter().map(|word| from_bytes(*word));
    let mut next = || words.next().unwrap_or(u32::MAX);
    let [kind, rows, columns, imaginary, name] = std::array::from_fn(|_| next());
    let digits = [kind / 1000, kind / 100 % 10, kind / 10 % 10, kind % 10];
    let is_kind = digits[0] <= 4 && digits[1] == 0 && digits[2] <= 5 && digits[3] <= 2;
    let is_name = |end: usize| {
        let name = head.get(20..20 + end);
        name.is_some_and(|name| {
            let (last, first) = name.split_last().unwrap_or((&1, &[]));
            *last == 0 && first.iter().all(u8::is_ascii_graphic)
        })
    };
    let sizes = rows > 0 && columns > 0 && imaginary <= 1 && (2..=64).contains(&name);
    is_kind && sizes && is_name(name as usize)
}

/// What lines of text are.
fn of_text(head: &[u8]) -> Option<Format> {
    let mut found = None;
    let mut comments = false;
    let mut count = 0;
    let _ = each(&mut &head[..head.len().min(HEAD_BYTES)], |line| {
        let text = line.bytes.trim_ascii();
        count += usize::from(!text.is_empty());
        found = match text {
            _ if text.starts_with(b";$FILEVERSION") => Some(Format::Trc),
            [b';', ..] => {
                comments = true;
                None
            }
            _ if comments && trc::is_record(text) => Some(Format::Trc),
            _ if candump::is_line(line) => Some(Format::Candump),
            _ if asc::is_line(text) => Some(Format::Asc),
            _ if count <= 2 => of_first_line(text),
            _ => None,
        };
        match found.is_none() && count < LINES_MAX {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(()),
        }
    });
    found
}

/// What a file is whose first lines begin so.
fn of_first_line(line: &[u8]) -> Option<Format> {
    let contains = |part: &[u8]| line.windows(part.len()).any(|window| window == part);
    let known: &[(bool, Format)] = &[
        (
            line.starts_with(b"***BUSMASTER"),
            Format::Other(
                "a BUSMASTER log",
                "convert it to ASC with BUSMASTER's format converters",
            ),
        ),
        (
            line.starts_with(b"Time Stamp,ID,Extended"),
            Format::Other("a GVRET table of SavvyCAN", CAN_HELP),
        ),
        (
            line.starts_with(b"Chn ") && contains(b"Identifier"),
            Format::Other("a log of Kvaser CanKing", CAN_HELP),
        ),
        (
            contains(b"<gpx"),
            Format::Other("a GPX track", "it has no CAN frames"),
        ),
        (
            line.starts_with(b"File created on "),
            Format::Other("a Racelogic VBO log", TABLE_HELP),
        ),
        (
            line.starts_with(b"VERSION \""),
            Format::Other("a DBC file", "give it with --dbc, and the log as FILE"),
        ),
        (
            line.starts_with(b"%%"),
            Format::Other("a MOOS log", "use `atvrec import alog`"),
        ),
        (
            line.starts_with(b"$G") || line.starts_with(b"#BEST"),
            Format::Other("output of a GNSS receiver", "it has no CAN frames"),
        ),
    ];
    let found = known.iter().find(|(is, _)| *is);
    found.map(|(_, format)| *format)
}
