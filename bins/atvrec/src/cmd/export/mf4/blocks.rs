//! Blocks of an MF4 file. Numbers are little endian, and links are positions in the file.
//!
//! The file is sorted: each data group has one channel group. Its records are in data blocks, which a list
//! of blocks (DL) combines. The blocks that describe the data follow at the end, and the header at the
//! begin is written again with its links.

use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};

use miniz_oxide::deflate::compress_to_vec_zlib;

/// Bytes of a block before its links.
const HEAD: u64 = 24;
/// Position of the header block.
const HD: u64 = 64;
/// Version of the format, 4.10.
const VERSION: u16 = 410;
/// Blocks begin at multiples of this number of bytes.
const ALIGNMENT: u64 = 8;
/// Value-to-text conversion.
const VALUE_TO_TEXT: u8 = 7;
/// Most bytes of a compressed block before compression, by the standard.
const COMPRESSED_MAX: usize = 4 << 20;
/// Data that is transposed, so that the bytes of a column follow each other, and then deflated.
const TRANSPOSED: u8 = 1;
/// Level of deflate.
const LEVEL: u8 = 1;

/// How values are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Unsigned integer.
    Unsigned = 0,
    /// Signed integer.
    Signed = 2,
    /// Floating-point number.
    Float = 4,
}

/// A channel.
pub struct Channel {
    pub name: String,
    pub unit: String,
    pub comment: String,
    /// Names of values.
    pub names: Vec<(i32, String)>,
    pub kind: Kind,
    /// Whether it is the time of the records.
    pub is_master: bool,
    /// Position in the record.
    pub offset: u32,
    pub bytes: u32,
    /// Number of the bit that marks an absent value.
    pub absent_bit: Option<u32>,
}

impl Channel {
    /// A channel of times in seconds.
    pub fn time(name: &str, is_master: bool, offset: u32) -> Self {
        Self {
            name: name.to_owned(),
            unit: "s".to_owned(),
            comment: String::new(),
            names: Vec::new(),
            kind: Kind::Float,
            is_master,
            offset,
            bytes: 8,
            absent_bit: None,
        }
    }
}

/// A channel group.
pub struct Group {
    pub topic: String,
    pub source: String,
    pub channels: Vec<Channel>,
    pub data_bytes: u32,
    pub absent_bytes: u32,
    pub rows: u64,
    /// Positions of the data blocks in the file, and in the data.
    pub data: Vec<(u64, u64)>,
}

impl Group {
    /// Bytes of a record.
    pub fn record_bytes(&self) -> usize {
        (self.data_bytes + self.absent_bytes) as usize
    }
}

/// What the file states about itself.
pub struct Header {
    /// Log time of time zero, ns.
    pub begin_ns: i64,
    /// UTC of time zero, ns since 1970.
    pub start_ns: u64,
    pub run: String,
}

/// A file that is being written.
pub struct Blocks {
    file: BufWriter<File>,
    position: u64,
    is_compressed: bool,
}

impl Blocks {
    /// Writes the identification and reserves the header.
    pub fn new(file: File, is_compressed: bool) -> io::Result<Self> {
        let mut blocks = Self {
            file: BufWriter::new(file),
            position: 0,
            is_compressed,
        };
        let mut id = b"MDF     4.10    atvrec  ".to_vec();
        id.extend([0; 4]);
        id.extend(VERSION.to_le_bytes());
        id.resize(HD as usize, 0);
        blocks.put(&id)?;
        blocks.header([0; 3], 0)?;
        Ok(blocks)
    }

    /// Writes records of a group.
    pub fn data(&mut self, group: &mut Group, records: &[u8]) -> io::Result<()> {
        let size = group.record_bytes();
        let most = match self.is_compressed {
            true => (COMPRESSED_MAX / size).max(1) * size,
            false => records.len().max(1),
        };
        for records in records.chunks(most) {
            let position = match self.is_compressed {
                true => self.compressed(records, size)?,
                false => self.block(b"DT", &[], records)?,
            };
            group.data.push((position, group.rows * size as u64));
            group.rows += (records.len() / size) as u64;
        }
        Ok(())
    }

    /// Writes a compressed data block of records of `size` bytes.
    fn compressed(&mut self, records: &[u8], size: usize) -> io::Result<u64> {
        let mut columns = Vec::with_capacity(records.len());
        for byte in 0..size {
            columns.extend(records.iter().skip(byte).step_by(size));
        }
        let zlib = compress_to_vec_zlib(&columns, LEVEL);
        let mut data = b"DT".to_vec();
        data.extend([TRANSPOSED, 0]);
        data.extend(u32::try_from(size).map_err(io::Error::other)?.to_le_bytes());
        data.extend((records.len() as u64).to_le_bytes());
        data.extend((zlib.len() as u64).to_le_bytes());
        data.extend(zlib);
        self.block(b"DZ", &[], &data)
    }

    /// Writes the descriptions of all groups, and the links to them.
    pub fn finish(&mut self, header: &Header, groups: &[Group]) -> io::Result<()> {
        let mut first = 0;
        for group in groups.iter().rev() {
            first = self.group(group, first)?;
        }
        let history = self.history(header.start_ns)?;
        let comment = format!(
            "<HDcomment><TX>run {}; times are seconds since the log time {} ns</TX></HDcomment>",
            escaped(&header.run),
            header.begin_ns
        );
        let comment = self.text(b"MD", &comment)?;
        self.file.seek(SeekFrom::Start(HD))?;
        self.position = HD;
        self.header([first, history, comment], header.start_ns)?;
        self.file.flush()
    }

    fn header(&mut self, [group, history, comment]: [u64; 3], start_ns: u64) -> io::Result<u64> {
        let mut data = start_ns.to_le_bytes().to_vec();
        // No offset to local time, no flag, no angle, no distance.
        data.resize(32, 0);
        self.block(b"HD", &[group, history, 0, 0, 0, comment], &data)
    }

    fn history(&mut self, start_ns: u64) -> io::Result<u64> {
        let comment = format!(
            "<FHcomment><TX>exported from a log</TX><tool_id>atvrec</tool_id>\
             <tool_vendor>atvrec</tool_vendor><tool_version>{}</tool_version></FHcomment>",
            env!("CARGO_PKG_VERSION")
        );
        let comment = self.text(b"MD", &comment)?;
        let mut data = start_ns.to_le_bytes().to_vec();
        data.resize(16, 0);
        self.block(b"FH", &[0, comment], &data)
    }

    /// Writes a data group before the group at `next`.
    fn group(&mut self, group: &Group, next: u64) -> io::Result<u64> {
        let mut channel = 0;
        for one in group.channels.iter().rev() {
            channel = self.channel(one, channel)?;
        }
        let name = self.text(b"TX", &group.topic)?;
        let source_name = self.text(b"TX", &group.source)?;
        // Source of another kind, without a bus.
        let source = self.block(b"SI", &[source_name, 0, 0], &[0; 8])?;
        let mut data = 0_u64.to_le_bytes().to_vec();
        data.extend(group.rows.to_le_bytes());
        // No flags, no separator of paths.
        data.extend([0; 8]);
        data.extend(group.data_bytes.to_le_bytes());
        data.extend(group.absent_bytes.to_le_bytes());
        let channels = self.block(b"CG", &[0, channel, name, source, 0, 0], &data)?;
        let data = self.list(&group.data)?;
        self.block(b"DG", &[next, channels, data, 0], &[0; 8])
    }

    /// Writes the list of the data blocks of a group.
    fn list(&mut self, blocks: &[(u64, u64)]) -> io::Result<u64> {
        if blocks.is_empty() {
            return Ok(0);
        }
        let mut links = vec![0];
        links.extend(blocks.iter().map(|(position, _)| position));
        let count = u32::try_from(blocks.len()).map_err(io::Error::other)?;
        let mut data = vec![0; 4];
        data.extend(count.to_le_bytes());
        data.extend(blocks.iter().flat_map(|(_, offset)| offset.to_le_bytes()));
        let list = self.block(b"DL", &links, &data)?;
        if !self.is_compressed {
            return Ok(list);
        }
        // The blocks have different lengths.
        self.block(b"HL", &[list], &[0, 0, TRANSPOSED, 0, 0, 0, 0, 0])
    }

    /// Writes a channel before the channel at `next`.
    fn channel(&mut self, channel: &Channel, next: u64) -> io::Result<u64> {
        let name = self.text(b"TX", &channel.name)?;
        let unit = match &*channel.unit {
            "" => 0,
            unit => self.text(b"TX", unit)?,
        };
        let comment = match &*channel.comment {
            "" => 0,
            text => self.text(b"TX", text)?,
        };
        let conversion = self.names(&channel.names)?;
        let is_master = u8::from(channel.is_master);
        // Master channel, synchronised by time.
        let mut data = vec![2 * is_master, is_master, channel.kind as u8, 0];
        data.extend(channel.offset.to_le_bytes());
        data.extend((8 * channel.bytes).to_le_bytes());
        // The flag that the invalidation bit is valid.
        let flags = u32::from(channel.absent_bit.is_some()) << 1;
        data.extend(flags.to_le_bytes());
        data.extend(channel.absent_bit.unwrap_or_default().to_le_bytes());
        // No precision, attachments, ranges or limits.
        data.resize(72, 0);
        let links = [next, 0, name, 0, conversion, 0, unit, comment];
        self.block(b"CN", &links, &data)
    }

    /// Writes the conversion of values to their names.
    fn names(&mut self, names: &[(i32, String)]) -> io::Result<u64> {
        if names.is_empty() {
            return Ok(0);
        }
        let mut links = vec![0; 4];
        for (_, name) in names {
            links.push(self.text(b"TX", name)?);
        }
        // A value without a name stays a number.
        links.push(0);
        let counts = [names.len() + 1, names.len()];
        let mut data = vec![VALUE_TO_TEXT, 0, 0, 0];
        for count in counts {
            data.extend(
                u16::try_from(count)
                    .map_err(io::Error::other)?
                    .to_le_bytes(),
            );
        }
        // No range.
        data.extend([0; 16]);
        let values = names.iter().map(|(value, _)| f64::from(*value));
        data.extend(values.flat_map(f64::to_le_bytes));
        self.block(b"CC", &links, &data)
    }

    /// Writes a text (TX) or XML (MD).
    fn text(&mut self, kind: &[u8; 2], text: &str) -> io::Result<u64> {
        let mut data = text.as_bytes().to_vec();
        data.resize((data.len() + 1).next_multiple_of(ALIGNMENT as usize), 0);
        self.block(kind, &[], &data)
    }

    /// Writes a block; its position.
    fn block(&mut self, kind: &[u8; 2], links: &[u64], data: &[u8]) -> io::Result<u64> {
        let position = self.position;
        let length = HEAD + 8 * links.len() as u64 + data.len() as u64;
        let mut head = [b"##", &kind[..], &[0; 4]].concat();
        head.extend(length.to_le_bytes());
        head.extend((links.len() as u64).to_le_bytes());
        head.extend(links.iter().flat_map(|link| link.to_le_bytes()));
        self.put(&head)?;
        self.put(data)?;
        let fill = self.position.next_multiple_of(ALIGNMENT) - self.position;
        self.put(&[0; ALIGNMENT as usize][..fill as usize])?;
        Ok(position)
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.position += bytes.len() as u64;
        self.file.write_all(bytes)
    }
}

/// A text in XML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}
