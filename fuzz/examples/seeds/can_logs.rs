//! Logs of CAN frames of other programs.

use miniz_oxide::deflate::compress_to_vec_zlib;
use sample::{CanFlags, CanFrame};
use wire::can_log::candump::Style;
use wire::can_log::{Direction, asc};

use super::{Result, Seeds};

/// Frames of a log.
const FRAMES: u8 = 6;
/// Start of the logs, UNIX time, ns.
const START_NS: i64 = 1_239_814_785_000_000_000;

/// Writes a log of each format, and the signals of an MF4 file.
pub fn write(seeds: &Seeds) -> Result<()> {
    let frame = |n| {
        let data = [n, 2, 0xF0, 1, 0xAA, 2, 0, 2];
        CanFrame::new(0x110 + u32::from(n), CanFlags::default(), &data)
    };
    let mut frames: Vec<CanFrame> = (0..FRAMES).filter_map(frame).collect();
    frames.extend(CanFrame::new(0x123, CanFlags::from_bits(3), &[]));
    let mut candump = Vec::new();
    let mut text = Vec::new();
    asc::write_head(&mut text, START_NS);
    for (at, frame) in frames.iter().enumerate() {
        let stamp_ns = at as i64 * 1_000_000;
        let direction = Some(Direction::Received);
        let style = Style::default();
        style.write(&mut candump, START_NS + stamp_ns, "can0", frame, direction);
        asc::write_frame(&mut text, stamp_ns, 1, frame, direction);
    }
    text.extend_from_slice(asc::END.as_bytes());
    candump.extend(b"DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 3)\n");
    seeds.write("can_log_candump", "log", &candump)?;
    let screen =
        b" (1641469577.024400) can1  RX B E  1FFFFFFF  [12]  00 11 22 33 44 55 66 77 88 99 AA BB\n";
    seeds.write("can_log_candump", "screen", screen)?;
    let dates = b" (2023-01-03 20:08:44.573555) can0  123   [2]  01 02\n (000.000000) can0 123 [0] remote\n";
    seeds.write("can_log_candump", "dates", dates)?;
    seeds.write("can_log_asc", "log", &text)?;
    let fd = b"date Sat Sep 30 15:06:13.191 2017\nbase hex  timestamps relative\n 0.1 CANFD 1 Rx 300 N 1 0 9 12 1 2 3 4 5 6 7 8 9 a b c 1 2 303000 0 0 0 0 0\n 0.3 1 1 Tx r 3\n";
    seeds.write("can_log_asc", "fd", fd)?;
    let trc = b";$FILEVERSION=2.1\n;$STARTTIME=45230.5\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n 1 1.0 FD 1 0100 Rx - 2 00 01\n";
    seeds.write("can_log_trc", "columns", trc)?;
    let old = b";$FILEVERSION=1.1\n 1) 1.0 Rx 0100 2 00 01\n 2) 2.0 Rx 0100 2 RTR\n";
    seeds.write("can_log_trc", "version-1", old)?;
    blf(seeds)?;
    seeds.write("can_log_mf4", "log", &mf4())?;
    seeds.write("mf4_signals", "log", &mf4())
}

/// Objects alone, in a plain and in a compressed container.
fn blf(seeds: &Seeds) -> Result<()> {
    let objects = [object(1), object(2)].concat();
    let packed = compress_to_vec_zlib(&objects, 6);
    let contents = [
        ("objects", objects.clone()),
        ("plain", container(0, &objects)),
        ("compressed", container(2, &packed)),
    ];
    for (name, content) in contents {
        let mut file = b"LOGG".to_vec();
        file.extend(144_u32.to_le_bytes());
        file.resize(144, 0);
        file.extend(content);
        seeds.write("can_log_blf", name, &file)?;
    }
    Ok(())
}

/// A classic frame.
fn object(id: u32) -> Vec<u8> {
    let mut object = b"LOBJ\x20\0\x01\0".to_vec();
    object.extend([48_u32, 1, 2, 0].iter().flat_map(|n| n.to_le_bytes()));
    object.extend(u64::from(id).to_le_bytes());
    object.extend([1, 0, 0, 2]);
    object.extend(id.to_le_bytes());
    object.extend([0xAA; 8]);
    object
}

fn container(method: u16, content: &[u8]) -> Vec<u8> {
    let mut object = b"LOBJ\x10\0\x01\0".to_vec();
    object.extend((32 + content.len() as u32).to_le_bytes());
    object.extend(10_u32.to_le_bytes());
    object.extend(method.to_le_bytes());
    object.resize(32, 0);
    object.extend(content);
    object
}

/// A group with frames of CAN: times, identifiers, lengths and data.
fn mf4() -> Vec<u8> {
    let mut file = b"MDF     4.10    ".to_vec();
    file.resize(64, 0);
    file[28] = 0x9A;
    file[29] = 1;
    block(&mut file, b"HD", &[0; 6], &[0; 32]);
    let mut next = 0;
    let channels = [
        ("CAN_DataFrame.DataBytes", 0, 10, 13, 64),
        ("CAN_DataFrame.DLC", 0, 0, 12, 8),
        ("CAN_DataFrame.ID", 0, 0, 8, 32),
        ("t", 2, 4, 0, 64),
    ];
    for (name, kind, data_type, byte, bits) in channels {
        let name = block(&mut file, b"TX", &[], &[name.as_bytes(), b"\0"].concat());
        let sync = u8::from(kind == 2);
        let mut data = vec![kind, sync, data_type, 0];
        data.extend([byte, bits].iter().flat_map(|n: &u32| n.to_le_bytes()));
        data.resize(72, 0);
        next = block(&mut file, b"CN", &[next, 0, name, 0, 0, 0, 0, 0], &data);
    }
    let mut counts = [0_u64, u64::from(FRAMES)].map(u64::to_le_bytes).concat();
    // Flags of a bus event, and 21 bytes a record.
    counts.extend([2, 0, 0, 0, 0, 0, 0, 0, 21, 0, 0, 0, 0, 0, 0, 0]);
    let group = block(&mut file, b"CG", &[0, next, 0, 0, 0, 0], &counts);
    let mut records = Vec::new();
    for number in 0..FRAMES {
        records.extend((f64::from(number) * 0.01).to_le_bytes());
        records.extend([number, 1, 0, 0, 8, 1, 2, 3, 4, 5, 6, 7, 8]);
    }
    let data = block(&mut file, b"DT", &[], &records);
    let place = block(&mut file, b"DG", &[0, group, data, 0], &[0; 8]);
    file[88..96].copy_from_slice(&place.to_le_bytes());
    file
}

/// Appends a block; its place.
fn block(file: &mut Vec<u8>, id: &[u8; 2], links: &[u64], data: &[u8]) -> u64 {
    file.resize(file.len().next_multiple_of(8), 0);
    let place = file.len() as u64;
    let length = 24 + 8 * links.len() + data.len();
    file.extend([b"##", &id[..], &[0; 4]].concat());
    for number in [length as u64, links.len() as u64].iter().chain(links) {
        file.extend(number.to_le_bytes());
    }
    file.extend(data);
    place
}
