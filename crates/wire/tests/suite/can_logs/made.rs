//! MDF 4 files that the tests write themselves: layouts that the real files do not have.

use atvrec_wire::can_log::{Direction, Entry, Summary, mf4};
use miniz_oxide::deflate::compress_to_vec_zlib;

use super::reference::{cursor, entries};

/// Number of frames of a file.
const FRAMES: u64 = 40;

/// A file that grows by blocks.
struct File(Vec<u8>);

impl File {
    fn new(id: &[u8; 8]) -> Self {
        let mut bytes = id.to_vec();
        bytes.extend_from_slice(b"4.10    ");
        bytes.resize(64, 0);
        bytes[28..30].copy_from_slice(&410_u16.to_le_bytes());
        let mut file = Self(bytes);
        let mut data = 1_700_000_000_000_000_000_u64.to_le_bytes().to_vec();
        data.resize(32, 0);
        file.block(b"HD", &[0; 6], &data);
        file
    }

    fn block(&mut self, id: &[u8; 2], links: &[u64], data: &[u8]) -> u64 {
        self.0.resize(self.0.len().next_multiple_of(8), 0);
        let place = self.0.len() as u64;
        let length = 24 + 8 * links.len() + data.len();
        self.0.extend_from_slice(b"##");
        self.0.extend_from_slice(id);
        self.0.extend_from_slice(&[0; 4]);
        for number in [length as u64, links.len() as u64].iter().chain(links) {
            self.0.extend_from_slice(&number.to_le_bytes());
        }
        self.0.extend_from_slice(data);
        place
    }

    fn text(&mut self, text: &str) -> u64 {
        let mut bytes = text.as_bytes().to_vec();
        bytes.push(0);
        self.block(b"TX", &[], &bytes)
    }

    /// A link of a block that was written before.
    fn link(&mut self, block: u64, index: usize, place: u64) {
        let at = block as usize + 24 + 8 * index;
        self.0[at..at + 8].copy_from_slice(&place.to_le_bytes());
    }

    fn compressed(&mut self, content: &[u8], row: Option<u32>) -> u64 {
        let stored = row.map_or_else(|| content.to_vec(), |row| transposed(content, row as usize));
        let zlib = compress_to_vec_zlib(&stored, 6);
        let mut data = b"DT".to_vec();
        data.extend_from_slice(&[u8::from(row.is_some()), 0]);
        data.extend_from_slice(&row.unwrap_or_default().to_le_bytes());
        data.extend_from_slice(&(content.len() as u64).to_le_bytes());
        data.extend_from_slice(&(zlib.len() as u64).to_le_bytes());
        data.extend_from_slice(&zlib);
        self.block(b"DZ", &[], &data)
    }

    /// A channel: name, kind, bytes of its start, bits, number of its invalidation bit.
    fn channel(&mut self, channel: &Channel, next: u64) -> u64 {
        let name = self.text(channel.name);
        let rule = if channel.name == "t" {
            let mut data = vec![1, 0, 0, 0, 0, 0, 2, 0];
            data.resize(24, 0);
            data.extend_from_slice(&0_f64.to_le_bytes());
            data.extend_from_slice(&1e-9_f64.to_le_bytes());
            self.block(b"CC", &[0; 4], &data)
        } else {
            0
        };
        let is_bytes = channel.name.ends_with("DataBytes");
        let data_type = if is_bytes && channel.kind != 1 { 10 } else { 0 };
        let sync = u8::from(channel.kind == 2);
        let mut data = vec![channel.kind, sync, data_type, 0];
        data.extend_from_slice(&channel.byte.to_le_bytes());
        data.extend_from_slice(&channel.bits.to_le_bytes());
        let flags = if channel.invalid.is_some() { 2_u32 } else { 0 };
        data.extend_from_slice(&flags.to_le_bytes());
        data.extend_from_slice(&channel.invalid.unwrap_or_default().to_le_bytes());
        data.resize(72, 0);
        self.block(b"CN", &[next, 0, name, 0, rule, channel.data, 0, 0], &data)
    }

    fn group(&mut self, group: [u64; 2], id: u64, flags: u16, lengths: [u32; 2]) -> u64 {
        let [next, channels] = group;
        let mut data = id.to_le_bytes().to_vec();
        data.extend_from_slice(&FRAMES.to_le_bytes());
        data.extend_from_slice(&flags.to_le_bytes());
        data.extend_from_slice(&[0; 6]);
        for length in lengths {
            data.extend_from_slice(&length.to_le_bytes());
        }
        self.block(b"CG", &[next, channels, 0, 0, 0, 0], &data)
    }

    fn data_group(&mut self, group: u64, data: u64, id_len: u8) {
        let place = self.block(b"DG", &[0, group, data, 0], &[id_len, 0, 0, 0, 0, 0, 0, 0]);
        self.link(64, 0, place);
    }

    fn frames(&self) -> (Vec<Entry>, Summary) {
        entries(|sink| mf4::read(&mut cursor(&self.0), sink)).expect("a file")
    }
}

struct Channel {
    name: &'static str,
    kind: u8,
    byte: u32,
    bits: u32,
    invalid: Option<u32>,
    data: u64,
}

fn transposed(content: &[u8], row: usize) -> Vec<u8> {
    let rows = content.len() / row;
    let mut columns = Vec::new();
    for column in 0..row {
        columns.extend((0..rows).map(|number| content[number * row + column]));
    }
    columns.extend_from_slice(&content[rows * row..]);
    columns
}

/// Channels of a record without the data: time, identifier, code, direction.
fn channels(kind: u8, bits: u32, data: u64) -> Vec<Channel> {
    let field = |name, kind, byte, bits| Channel {
        name,
        kind,
        byte,
        bits,
        invalid: None,
        data: 0,
    };
    vec![
        field("t", 2, 0, 64),
        field("CAN_DataFrame.ID", 0, 8, 32),
        field("CAN_DataFrame.DLC", 0, 12, 8),
        Channel {
            invalid: Some(0),
            ..field("CAN_DataFrame.Dir", 0, 13, 8)
        },
        Channel {
            data,
            ..field("CAN_DataFrame.DataBytes", kind, 14, bits)
        },
    ]
}

/// A record without data: every third direction is not valid, every second identifier has 29 bits.
fn head(number: u64) -> Vec<u8> {
    let mut bytes = (number * 1_000_001).to_le_bytes().to_vec();
    let id = number as u32 | if number % 2 == 1 { 0x8000_0000 } else { 0 };
    bytes.extend_from_slice(&id.to_le_bytes());
    bytes.extend_from_slice(&[(number % 9) as u8, 1]);
    bytes
}

fn data(number: u64) -> Vec<u8> {
    vec![number as u8; (number % 9) as usize]
}

fn assert_frames(entries: &[Entry]) {
    assert_eq!(entries.len() as u64, FRAMES);
    for (number, entry) in (0..).zip(entries) {
        assert_eq!(entry.stamp_ns, number as i64 * 1_000_001);
        assert_eq!(u64::from(entry.frame.id), number);
        assert_eq!(entry.frame.flags.extended, number % 2 == 1);
        let valid = (number % 3 != 0).then_some(Direction::Sent);
        assert_eq!(entry.direction, valid);
        assert_eq!(entry.frame.bytes(), data(number), "frame {number}");
        assert_eq!(entry.channel, None);
    }
}

#[test]
fn lists_of_plain_compressed_and_transposed_blocks_are_read() {
    let mut file = File::new(b"MDF     ");
    let mut next = 0;
    for channel in channels(0, 64, 0).iter().rev() {
        next = file.channel(channel, next);
    }
    let group = file.group([0, next], 0, 2, [22, 1]);
    let mut records = Vec::new();
    for number in 0..FRAMES {
        let mut record = head(number);
        record.extend(data(number));
        record.resize(22, 0xEE);
        record.push(u8::from(number % 3 == 0));
        records.extend(record);
    }
    // Records cross the borders of the blocks.
    let (first, rest) = records.split_at(100);
    let (second, third) = rest.split_at(301);
    let blocks = [
        file.block(b"DT", &[], first),
        file.compressed(second, Some(23)),
        file.compressed(third, None),
    ];
    let last = file.block(b"DL", &[0, blocks[2]], &[0; 16]);
    let list = file.block(b"DL", &[last, blocks[0], blocks[1]], &[0; 24]);
    let head = file.block(b"HL", &[list], &[0; 8]);
    file.data_group(group, head, 0);
    let (entries, summary) = file.frames();
    assert_frames(&entries);
    assert_eq!(summary.defects, Vec::<String>::new());
    assert_eq!(summary.start_ns, Some(1_700_000_000_000_000_000));
}

/// An unsorted file: records of frames (number 1), their data (2) and others (3). `before`: the data
/// comes before its frame.
fn unsorted(id: &[u8; 8], before: bool) -> File {
    let mut file = File::new(id);
    let other = file.group([0, 0], 3, 0, [5, 0]);
    let values = file.group([other, 0], 2, 1, [0, 0]);
    let mut next = 0;
    for channel in channels(1, 64, values).iter().rev() {
        next = file.channel(channel, next);
    }
    let group = file.group([values, next], 1, 2, [22, 1]);
    let (mut records, mut offset) = (Vec::new(), 0_u64);
    for number in 0..FRAMES {
        let mut frame = vec![1];
        frame.extend(head(number));
        frame.extend(offset.to_le_bytes());
        frame.push(u8::from(number % 3 == 0));
        let mut value = vec![2];
        value.extend(
            u32::try_from(data(number).len())
                .expect("small")
                .to_le_bytes(),
        );
        value.extend(data(number));
        offset += value.len() as u64 - 1;
        records.extend(
            if before {
                [value, frame]
            } else {
                [frame, value]
            }
            .concat(),
        );
        records.extend([3, 9, 9, 9, 9, 9]);
    }
    file.data_group(group, 0, 1);
    let data_group = file.0.len() as u64 - 64;
    let data = file.block(b"DT", &[], &records);
    file.link(data_group, 2, data);
    if id == b"UnFinMF " {
        let at = data as usize + 8;
        file.0[at..at + 8].copy_from_slice(&24_u64.to_le_bytes());
    }
    file
}

#[test]
fn data_in_records_of_its_own_is_found_before_and_behind_its_frame() {
    for id in [b"MDF     ", b"UnFinMF "] {
        for before in [false, true] {
            let (entries, summary) = unsorted(id, before).frames();
            assert_frames(&entries);
            assert_eq!(summary.defects, Vec::<String>::new());
            let left_out: Vec<_> = summary.left_out.into_iter().collect();
            assert_eq!(
                left_out,
                [("records of a group without name".to_owned(), FRAMES)]
            );
        }
    }
}

#[test]
fn data_without_valid_offsets_is_found_by_its_order() {
    let mut file = unsorted(b"UnFinMF ", false);
    file.0[60] = 1 << 6;
    // The offset of a record is behind its number and 14 bytes.
    let records = file
        .0
        .windows(24)
        .position(|bytes| bytes.starts_with(b"##DT"));
    let mut at = records.expect("a data block") + 24;
    for number in 0..FRAMES {
        file.0[at + 15..at + 23].fill(0);
        at += 24 + 5 + data(number).len() + 6;
    }
    let (entries, summary) = file.frames();
    assert_frames(&entries);
    assert_eq!(summary.defects, Vec::<String>::new());
}

#[test]
fn a_file_that_ends_in_a_record_gives_the_frames_before() {
    let mut file = unsorted(b"UnFinMF ", false);
    file.0.truncate(file.0.len() - 20);
    let (entries, summary) = file.frames();
    assert_eq!(entries.len() as u64, FRAMES - 1);
    assert!(!summary.defects.is_empty());
}

#[test]
fn a_list_that_leads_to_itself_ends() {
    let mut file = unsorted(b"MDF     ", false);
    let data_group = u64::from_le_bytes(file.0[88..96].try_into().expect("8 bytes"));
    let data = u64::from_le_bytes(
        file.0[data_group as usize + 40..data_group as usize + 48]
            .try_into()
            .expect("8 bytes"),
    );
    let list = file.block(b"DL", &[0, data], &[0; 16]);
    file.link(list, 0, list);
    file.link(data_group, 2, list);
    file.link(data_group, 0, data_group);
    let (entries, summary) = file.frames();
    assert_frames(&entries);
    assert_eq!(summary.defects.len(), 2, "{:?}", summary.defects);
}
