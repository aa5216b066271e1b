use std::fs::{self, File};
use std::ops::ControlFlow;
use std::path::Path;

use atvrec_wire::can_log::{self, Direction, Entry, Error, Record, Sink, Stamps, Summary};
use proptest::prelude::*;
use sample::{CanFlags, CanFrame};

use super::reference::{assert_rows, cursor, date_ns, entries, folders, rows};

type Read = fn(&mut File, &mut Sink<'_>) -> Result<Summary, Error>;

fn read_all(path: &Path, read: Read) -> (Vec<Entry>, Summary) {
    let mut file = File::open(path).expect("the log");
    let read = entries(|sink| read(&mut file, sink));
    read.unwrap_or_else(|error| panic!("{} {error}", path.display()))
}

/// Compares all logs of a format.
fn compare(format: &str, read: Read) {
    let mut count = 0;
    for folder in folders(format) {
        let meta = fs::read_to_string(folder.join("meta.json")).expect("meta.json");
        let meta: serde_json::Value = serde_json::from_str(&meta).expect("JSON");
        if meta["kind"] != "frames" {
            continue;
        }
        let file = folder.join(meta["file"].as_str().expect("a name"));
        let (entries, summary) = read_all(&file, read);
        let name = folder.display().to_string();
        assert_rows(&name, (&entries, &summary), &rows(&folder));
        count += entries.len();
    }
    testkit::report(&format!("{count} frames of {format} agree"));
}

#[test]
fn candump() {
    compare("candump", can_log::candump::read);
}

#[test]
fn asc() {
    compare("asc", can_log::asc::read);
}

#[test]
fn trc() {
    compare("trc", can_log::trc::read);
}

/// A summary of one log.
fn summary(name: &str, file: &str, read: Read) -> Option<Summary> {
    let path = testkit::shared(&format!("data/can-logs/{name}/{file}"))?;
    Some(read_all(&path, read).1)
}

#[test]
fn stamps_have_the_meaning_that_the_file_gives_them() {
    let candump = can_log::candump::read;
    let (asc, trc) = (can_log::asc::read, can_log::trc::read);
    let cases: [(&str, &str, Read, Stamps, Option<i64>); 9] = [
        (
            "candump/car-noecu-can0",
            "capture.log",
            candump,
            Stamps::Unix,
            None,
        ),
        (
            "candump/bug-view-delta",
            "view.txt",
            candump,
            Stamps::Differences,
            None,
        ),
        (
            "candump/bug-view-zero",
            "view.txt",
            candump,
            Stamps::SinceStart,
            None,
        ),
        (
            "candump/bug-view-date-extra",
            "view.txt",
            candump,
            Stamps::LocalDate,
            None,
        ),
        (
            "candump/vcan0-written-by-savvycan",
            "capture.log",
            candump,
            Stamps::SinceStart,
            None,
        ),
        (
            "asc/bug-relative-stamps",
            "trace.asc",
            asc,
            Stamps::Differences,
            Some(1_580_725_230_400),
        ),
        (
            "asc/busmaster-seconds-of-day",
            "trace.asc",
            asc,
            Stamps::OfDay,
            Some(1_337_299_200_000),
        ),
        (
            "asc/classic-2014-pm",
            "trace.asc",
            asc,
            Stamps::SinceStart,
            Some(1_401_206_975_000),
        ),
        (
            "trc/bug-v2_1-all-types",
            "trace.trc",
            trc,
            Stamps::SinceStart,
            Some(1_698_753_600_000),
        ),
    ];
    for (name, file, read, stamps, start_ms) in cases {
        let Some(found) = summary(name, file, read) else {
            return;
        };
        let start_ms = start_ms.map(|ms| ms * 1_000_000);
        assert_eq!((found.stamps, found.start_ns), (stamps, start_ms), "{name}");
    }
}

#[test]
fn lines_that_are_no_frames_are_counted() {
    let name = "candump/bug-zero-stamps-dropcount-cut";
    let Some(found) = summary(name, "capture.log", can_log::candump::read) else {
        return;
    };
    assert_eq!(found.left_out["lines that cannot be read"], 3);
    assert!(
        found.defects[2].ends_with("the file ends in the middle of a line"),
        "{found:?}"
    );
    let found = summary("trc/bug-v2_1-all-types", "trace.trc", can_log::trc::read);
    let found = found.expect("the same folder");
    let kinds: Vec<(&str, u64)> = found
        .left_out
        .iter()
        .map(|(kind, n)| (&**kind, *n))
        .collect();
    let expected = [
        ("event records", 1),
        ("records of error counters", 1),
        ("status records", 1),
    ];
    assert_eq!(kinds, expected);
    let found = summary("asc/mixed-logfile", "trace.asc", can_log::asc::read);
    let found = found.expect("the same folder");
    assert_eq!(found.left_out["J1939TP lines"], 2);
    assert_eq!(found.defect_count, 0, "{found:?}");
}

#[test]
fn dates_of_several_languages_are_read() {
    let Some(folder) = testkit::shared("data/can-logs/asc/bug-date-lines") else {
        return;
    };
    let text = fs::read_to_string(folder.join("reference.jsonl")).expect("the reference");
    for line in text.lines() {
        let row: serde_json::Value = serde_json::from_str(line).expect("JSON");
        let want = row["local_time"].as_str().map(date_ns);
        let line = row["line"].as_str().expect("a line");
        assert_eq!(can_log::asc::date_of(line), want, "{line}");
    }
}

/// Everything that `candump -l` writes is written again from its frames.
#[test]
fn lines_of_candump_are_written_as_they_were_read() {
    for name in [
        "bug-logfile-all-kinds",
        "bug-logfile-no-suffix",
        "car-noecu-can0",
        "race-can0-with-dbc",
        "vcan0-written-by-savvycan",
    ] {
        let Some(path) = testkit::shared(&format!("data/can-logs/candump/{name}/capture.log"))
        else {
            return;
        };
        let (entries, summary) = read_all(&path, can_log::candump::read);
        let style = summary.style.expect("a log");
        let written: can_log::candump::Style = style.to_string().parse().expect("a style");
        let mut text = Vec::new();
        for entry in &entries {
            let channel = usize::from(entry.channel.expect("a channel"));
            let channel = &summary.channels[channel];
            written.write(
                &mut text,
                entry.stamp_ns,
                channel,
                &entry.frame,
                entry.direction,
            );
        }
        assert_eq!(summary.restyled, 0, "{name}");
        assert!(text == fs::read(&path).expect("the log"), "{name}");
    }
}

/// Each file is recognised by its bytes, as what it is.
#[test]
fn formats_are_recognised_by_their_bytes() {
    use can_log::{Format, recognise};
    let Some(root) = testkit::shared("data/can-logs") else {
        return;
    };
    let cases = [
        ("asc", "ASC"),
        ("blf", "BLF"),
        ("busmaster", "BUSMASTER"),
        ("candump", "candump"),
        ("canking", "CanKing"),
        ("gpx", "GPX"),
        ("gvret-csv", "GVRET"),
        ("mat", "MATLAB"),
        ("mdf3", "MDF file of version 3"),
        ("mf4-bus", "MF4"),
        ("mf4-signal", "MF4"),
        ("motec-ld", "gzip"),
        ("trc", "TRC"),
        ("vbb", "xz"),
        ("vbo", "VBO"),
    ];
    for (format, name) in cases {
        for entry in fs::read_dir(root.join(format)).expect("the folder") {
            let folder = entry.expect("an entry").path();
            if folder.ends_with("bug-date-lines") {
                continue;
            }
            let meta = fs::read_to_string(folder.join("meta.json")).expect("meta.json");
            let meta: serde_json::Value = serde_json::from_str(&meta).expect("JSON");
            let file = folder.join(meta["file"].as_str().expect("a name"));
            let bytes = fs::read(&file).expect("the file");
            let head = &bytes[..bytes.len().min(can_log::HEAD_BYTES)];
            let found = recognise(head);
            let found = found.unwrap_or_else(|| panic!("{}", file.display()));
            assert!(found.name().contains(name), "{}: {found:?}", file.display());
            let reader = match format {
                "asc" => Some(Format::Asc),
                "blf" => Some(Format::Blf),
                "candump" => Some(Format::Candump),
                "mf4-bus" | "mf4-signal" => Some(Format::Mf4),
                "trc" => Some(Format::Trc),
                _ => None,
            };
            assert_eq!(
                found.is_read().then_some(found),
                reader,
                "{}",
                file.display()
            );
        }
    }
}

/// Reads bytes with every reader.
fn read_bytes(bytes: &[u8]) {
    let _ = can_log::recognise(bytes);
    let _ = entries(|sink| can_log::candump::read(&mut cursor(bytes), sink));
    let _ = entries(|sink| can_log::asc::read(&mut cursor(bytes), sink));
    let _ = entries(|sink| can_log::trc::read(&mut cursor(bytes), sink));
}

/// A byte of a log is replaced, or the log is cut.
fn damaged() -> impl Strategy<Value = Vec<u8>> {
    let texts = [
        "(1672776524.573555) can0 123##4000102030405060708090A0B R\n (0.0) can1  RX B E  1FFFFFFF  [20]  AA",
        "date Sat Sep 30 15:06:13.191 2017\nbase hex  timestamps relative\n 0.1 CANFD 1 Rx 300 N 1 0 9 12 1 2 3 \
         4 5 6 7 8 9 a b c 1 2 303000 0 0 0 0 0\n 0.2 1 123x Rx d 2 01 02\n 0.3 1 1 Tx r 3\n",
        ";$FILEVERSION=2.1\n;$STARTTIME=45230.5\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n 1 1.0 FD 1 0100 Rx - 2 00 01\n",
        ";$FILEVERSION=1.1\n 1) 1.0 Rx 0100 2 00 01\n 2) 2.0 Rx 0100 2 RTR\n",
    ];
    let index = any::<prop::sample::Index>();
    let changes = prop::collection::vec((index, any::<u8>()), 0..4);
    (0..texts.len(), changes, any::<prop::sample::Index>()).prop_map(move |(text, changes, cut)| {
        let mut bytes = texts[text].as_bytes().to_vec();
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        let length = cut.index(bytes.len());
        bytes.truncate(bytes.len() - length / 4);
        bytes
    })
}

/// Frames that a text log can have: an error frame of ASC has no content.
fn frames() -> impl Strategy<Value = CanFrame> {
    let data = prop::collection::vec(any::<u8>(), 0..=8);
    (any::<u32>(), 0_u8..64, data, 9_u8..16).prop_map(|(id, bits, data, code)| {
        let mut flags = CanFlags::from_bits(bits);
        if flags.error {
            flags = CanFlags {
                error: true,
                fd: flags.fd,
                ..CanFlags::default()
            };
            return CanFrame::new(0, flags, &[]).expect("no data");
        }
        flags.remote &= !flags.fd;
        flags.bit_rate_switch &= flags.fd;
        flags.error_state &= flags.fd;
        let id = id & if flags.extended { 0x1FFF_FFFF } else { 0x7FF };
        let stored: &[u8] = if flags.remote { &[] } else { &data };
        let mut frame = CanFrame::new(id, flags, stored).expect("the data fits");
        frame.len = data.len() as u8;
        if frame.len == 8 && !flags.fd && bits & 32 != 0 {
            frame.len8_dlc = code;
        }
        frame
    })
}

proptest! {
    #[test]
    fn an_asc_file_is_read_as_it_was_written(
        frames in prop::collection::vec((frames(), 0_i64..5_000_000_000, any::<bool>()), 1..20),
    ) {
        let mut text = Vec::new();
        can_log::asc::write_head(&mut text, 1_506_783_973_191_000_000);
        for (frame, stamp_ns, sent) in &frames {
            let direction = if *sent { Direction::Sent } else { Direction::Received };
            can_log::asc::write_frame(&mut text, *stamp_ns, 3, frame, Some(direction));
        }
        text.extend_from_slice(can_log::asc::END.as_bytes());
        let mut found = Vec::new();
        let summary = can_log::asc::read(&mut cursor(&text), &mut |record| {
            found.push(record);
            ControlFlow::Continue(())
        });
        let summary = summary.expect("an ASC file");
        prop_assert_eq!(summary.start_ns, Some(1_506_783_973_191_000_000));
        prop_assert_eq!(summary.defect_count, 0);
        prop_assert_eq!(summary.channels, ["3"]);
        prop_assert_eq!(found.len(), frames.len());
        for (record, (frame, stamp_ns, sent)) in found.iter().zip(&frames) {
            let Record::Frame(entry) = record else {
                panic!("{record:?}");
            };
            prop_assert_eq!((&entry.frame, entry.stamp_ns), (frame, *stamp_ns));
            let is_told = !frame.flags.error || frame.flags.fd;
            let direction = if *sent { Direction::Sent } else { Direction::Received };
            prop_assert_eq!(entry.direction, is_told.then_some(direction));
        }
    }

    #[test]
    fn no_bytes_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        read_bytes(&bytes);
    }

    #[test]
    fn no_damaged_log_panics(bytes in damaged()) {
        read_bytes(&bytes);
    }
}
