//! Serial sources on pseudo-terminals, through the public interface.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use atvrec_acq::{
    LogClock, PortSpec, QueueSizes, Sequencer, SerialSpec, Setup, SlcanSpec, SourceKind,
    SourceSpec, Streams, Supervisor,
};
use sample::{Arrival, CanFlags, CanFrame, LossPlace, Notice, Payload, SourceId};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio_serial::{SerialPort, SerialStream};
use wire::slcan::{Command, Decoder, Event, encode_frame};

/// Only ever waited for in full when something is broken.
const PATIENCE: Duration = Duration::from_secs(30);

/// A pseudo-terminal: the device's end, and the path for the program's.
fn terminal() -> (SerialStream, PathBuf) {
    let (device, mut other) = SerialStream::pair().expect("a pseudo-terminal");
    other.set_exclusive(false).expect("a shared terminal");
    let path = other.name().expect("a path");
    (device, path.into())
}

fn serial(id: u16, path: &Path, setup: Setup) -> SourceSpec {
    SourceSpec {
        id: SourceId(id),
        name: format!("port{id}"),
        kind: SourceKind::Serial(SerialSpec {
            port: PortSpec::new(path, 115_200),
            setup,
        }),
    }
}

fn start(sizes: QueueSizes) -> (Supervisor, Sequencer, Streams) {
    let (sequencer, streams) = Sequencer::new(LogClock::start(), sizes);
    (Supervisor::new(sequencer.clone()), sequencer, streams)
}

async fn next(streams: &mut Streams) -> Arc<Arrival> {
    tokio::time::timeout(PATIENCE, streams.recorder.recv())
        .await
        .expect("an arrival in time")
        .expect("an open stream")
}

/// Waits until `count` sources have said that they are open.
async fn opened(streams: &mut Streams, count: usize) {
    let mut open = 0;
    while open < count {
        if let Payload::Notice(Notice::Opened(_)) = next(streams).await.payload {
            open += 1;
        }
    }
}

fn recordings() -> Vec<(PathBuf, Vec<u8>)> {
    let mut files = Vec::new();
    for folder in [
        "novatel-gavlab",
        "novatel-edie",
        "mixed-fixposition",
        "sbf-pysbf2",
        "crossbow-440",
    ] {
        let Some(folder) = testkit::shared(&format!("data/{folder}")) else {
            continue;
        };
        let entries = fs::read_dir(&folder).expect("readable");
        for entry in entries {
            let path = entry.expect("an entry").path();
            let is_text = path
                .extension()
                .is_some_and(|ending| ending == "jsonl" || ending == "md");
            if path.is_file() && !is_text {
                let mut bytes = fs::read(&path).expect("the file can be read");
                bytes.truncate(200_000);
                files.push((path, bytes));
            }
        }
    }
    files.sort();
    files
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn real_recordings_arrive_byte_for_byte_in_one_order() {
    let files = recordings();
    let total: usize = files.iter().map(|(_, bytes)| bytes.len()).sum();
    let (mut supervisor, sequencer, mut streams) = start(QueueSizes {
        recorder: 1 << 20,
        estimator: 0,
    });
    let mut devices = Vec::new();
    for index in 0..files.len() {
        let (device, path) = terminal();
        supervisor.spawn(serial(index as u16, &path, Setup::None));
        devices.push(device);
    }
    opened(&mut streams, files.len()).await;
    for (mut device, (_, bytes)) in devices.into_iter().zip(files.clone()) {
        tokio::spawn(async move {
            for chunk in bytes.chunks(777) {
                device
                    .write_all(chunk)
                    .await
                    .expect("the terminal takes bytes");
            }
            // Held open: the far end must read all of it first.
            std::future::pending::<()>().await;
        });
    }
    let mut received = vec![Vec::new(); files.len()];
    let (mut count, mut last) = (0, None::<Arc<Arrival>>);
    while count < total {
        let arrival = next(&mut streams).await;
        if let Some(last) = &last {
            assert_eq!(arrival.sequence, last.sequence + 1);
            assert!(arrival.log_time >= last.log_time);
        }
        if let Payload::Bytes(bytes) = &arrival.payload {
            received[usize::from(arrival.source.0)].extend_from_slice(bytes);
            count += bytes.len();
        }
        last = Some(arrival);
    }
    for ((path, sent), received) in files.iter().zip(&received) {
        assert!(sent == received, "{} arrived altered", path.display());
    }
    println!("{} files, {total} bytes equal", files.len());
    supervisor.stop(PATIENCE).await.expect("the sources stop");
    sequencer.finish();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_a_full_queue_costs_is_counted_to_the_last_read() {
    let (mut supervisor, sequencer, mut streams) = start(QueueSizes {
        recorder: 8,
        estimator: 4,
    });
    let (mut device, path) = terminal();
    supervisor.spawn(serial(0, &path, Setup::None));
    opened(&mut streams, 1).await;
    let source = SourceId(0);
    // Nobody takes arrivals meanwhile.
    let mut sent = 0;
    while sequencer.ledger().losses().of(source)[LossPlace::Queue as usize] < 5 {
        device
            .write_all(&[0x55; 64])
            .await
            .expect("the terminal takes bytes");
        sent += 64;
    }
    while sequencer.counters()[&source].bytes < sent {
        tokio::time::sleep(Duration::from_millis(1)).await;
    }
    supervisor.stop(PATIENCE).await.expect("the source stops");
    let counters = sequencer.counters()[&source].clone();
    sequencer.finish();
    let (mut kept, mut lost, mut skipped) = (0, 0, 0);
    let mut last_sequence = 0;
    while let Some(arrival) = streams.recorder.recv().await {
        last_sequence = arrival.sequence;
        match &arrival.payload {
            Payload::Bytes(_) => kept += 1,
            Payload::Notice(Notice::Lost { count, .. }) => lost += count,
            Payload::Notice(Notice::EstimatorSkipped { count, .. }) => skipped += count,
            _ => {}
        }
    }
    assert_eq!(kept + lost, counters.items);
    let entered = sequencer.ledger().losses().of(source);
    assert_eq!(lost, entered[LossPlace::Queue as usize]);
    assert!(skipped >= lost);
    assert!(last_sequence >= kept + lost);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_second_program_is_kept_off_the_port() {
    let (mut supervisor, _sequencer, mut streams) = start(QueueSizes::default());
    let (_device, path) = terminal();
    supervisor.spawn(serial(0, &path, Setup::None));
    opened(&mut streams, 1).await;
    supervisor.spawn(serial(1, &path, Setup::None));
    loop {
        let arrival = next(&mut streams).await;
        if let Payload::Notice(Notice::Closed(_)) = &arrival.payload {
            assert_eq!(arrival.source, SourceId(1));
            break;
        }
    }
    supervisor.stop(PATIENCE).await.expect("the sources stop");
}

/// An adapter that obeys every command until it has left the bus.
async fn adapter(mut device: SerialStream, frames: Vec<CanFrame>) -> Vec<Command> {
    let mut decoder = Decoder::new();
    let mut told = Vec::new();
    let mut buffer = [0; 256];
    let mut on_bus = false;
    loop {
        let count = device.read(&mut buffer).await.expect("commands");
        let before = told.len();
        decoder.push(&buffer[..count], &mut |event| {
            if let Event::Command(command) = event {
                told.push(command);
            }
        });
        for command in told[before..].iter().copied() {
            device.write_all(b"\r").await.expect("an answer");
            match command {
                Command::Close if on_bus => return told,
                Command::Open => {
                    on_bus = true;
                    for (index, frame) in frames.iter().enumerate() {
                        let line = encode_frame(frame, Some(index as u64)).expect("a frame");
                        device.write_all(&line).await.expect("a line");
                    }
                }
                _ => {}
            }
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_slcan_adapter_is_opened_read_and_closed() {
    let frames: Vec<CanFrame> = (0..2000_u32)
        .map(|index| {
            let flags = CanFlags {
                extended: index % 3 == 0,
                ..CanFlags::default()
            };
            let data = index.to_be_bytes();
            let frame = CanFrame::new(index % 2048, flags, &data[..(index % 5) as usize]);
            frame.expect("data fits")
        })
        .collect();
    let (mut supervisor, _sequencer, mut streams) = start(QueueSizes::default());
    let (device, path) = terminal();
    supervisor.spawn(SourceSpec {
        id: SourceId(7),
        name: "can".to_owned(),
        kind: SourceKind::Slcan(SlcanSpec {
            port: PortSpec::new(&path, 115_200),
            bit_rate: Some(500_000),
            listen_only: false,
            timestamps: true,
        }),
    });
    opened(&mut streams, 1).await;
    let adapter = tokio::spawn(adapter(device, frames.clone()));
    let mut received = Vec::new();
    while received.len() < frames.len() {
        match &next(&mut streams).await.payload {
            Payload::Can(frames) => received.extend_from_slice(frames),
            Payload::Notice(Notice::Lost { count, .. }) => panic!("{count} lost"),
            _ => {}
        }
    }
    for (index, (got, sent)) in received.iter().zip(&frames).enumerate() {
        let expected = CanFrame {
            hardware_ns: Some(index as i64 * 1_000_000),
            ..sent.clone()
        };
        assert_eq!(*got, expected);
    }
    supervisor.stop(PATIENCE).await.expect("the source stops");
    let told = adapter.await.expect("the adapter does not panic");
    let asked = |command| told.contains(&command);
    assert!(asked(Command::BitRate(500_000)) && asked(Command::Timestamps(true)));
    assert_eq!(told.last(), Some(&Command::Close));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_changed_configuration_leaves_the_other_sources_running() {
    let (mut supervisor, sequencer, mut streams) = start(QueueSizes::default());
    let terminals: Vec<_> = (0..3).map(|_| terminal()).collect();
    let specs: Vec<_> = (0..3_u16)
        .map(|index| serial(index, &terminals[usize::from(index)].1, Setup::None))
        .collect();
    supervisor.spawn(specs[0].clone());
    supervisor.spawn(specs[1].clone());
    opened(&mut streams, 2).await;
    let wanted = vec![specs[1].clone(), specs[2].clone()];
    supervisor
        .apply(wanted, PATIENCE)
        .await
        .expect("the source stops");
    opened(&mut streams, 1).await;
    let counters = sequencer.counters();
    assert!(!counters[&SourceId(0)].open);
    // Its opening is all that the source in both has ever said.
    assert!(counters[&SourceId(1)].open);
    assert_eq!(counters[&SourceId(1)].arrivals, 1);
    assert!(counters[&SourceId(2)].open);
    supervisor.stop(PATIENCE).await.expect("the sources stop");
}

/// A packet of a Crossbow 440.
fn packet(kind: &[u8; 2], payload: &[u8]) -> Vec<u8> {
    let body = [&kind[..], &[payload.len() as u8], payload].concat();
    let crc = body.iter().fold(0x1D0F_u16, |crc, byte| {
        (0..8).fold(crc ^ u16::from(*byte) << 8, |crc, _| {
            crc << 1 ^ if crc & 0x8000 != 0 { 0x1021 } else { 0 }
        })
    });
    [&[0x55, 0x55], &body[..], &crc.to_be_bytes()].concat()
}

/// A unit that hears and answers at one line speed only; it ends after the command to send.
async fn unit(mut device: SerialStream, baud: u32) {
    let mut waiting = Vec::new();
    let mut buffer = [0; 256];
    let mut kind = [0; 2];
    loop {
        let count = device.read(&mut buffer).await.expect("commands");
        // Both ends of a pseudo-terminal have one set of settings.
        if device.baud_rate().expect("a line speed") != baud {
            waiting.clear();
            continue;
        }
        waiting.extend_from_slice(&buffer[..count]);
        while waiting.len() >= 7 && waiting.len() >= 7 + usize::from(waiting[4]) {
            let command: Vec<u8> = waiting.drain(..7 + usize::from(waiting[4])).collect();
            let field = command.get(6..8).unwrap_or_default();
            let answer = match &command[2..4] {
                b"PK" => packet(b"PK", &[]),
                b"SF" if field == [0, 3] => {
                    kind.copy_from_slice(&command[8..10]);
                    packet(b"SF", &[1, 0, 3])
                }
                b"SF" => packet(b"SF", &[1, 0, 1]),
                b"GF" => packet(b"GF", &[1, 0, 3, kind[0], kind[1]]),
                other => panic!("unexpected command {other:?}"),
            };
            device.write_all(&answer).await.expect("an answer");
            if &command[2..4] == b"SF" && field == [0, 1] && command[8..10] == [0, 1] {
                assert_eq!(&kind, b"S1");
                let data = packet(b"S1", &[0x5A; 24]);
                device.write_all(&data).await.expect("a packet");
            }
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_crossbow_is_found_at_its_line_speed_and_set_up() {
    let (mut supervisor, _sequencer, mut streams) = start(QueueSizes::default());
    let (device, path) = terminal();
    let options = wire::crossbow440::SetupOptions::default();
    supervisor.spawn(serial(0, &path, Setup::Crossbow440(options)));
    // A terminal whose other end is not open yet cannot be read.
    opened(&mut streams, 1).await;
    let unit = tokio::spawn(unit(device, 38_400));
    let sought = packet(b"S1", &[0x5A; 24]);
    let mut received = Vec::new();
    while !received
        .windows(sought.len())
        .any(|window| window == sought)
    {
        if let Payload::Bytes(bytes) = &next(&mut streams).await.payload {
            received.extend_from_slice(bytes);
        }
    }
    // The answers of the dialogue are part of the recording.
    assert!(
        received.starts_with(&packet(b"SF", &[1, 0, 1])),
        "{received:02x?}"
    );
    supervisor.stop(PATIENCE).await.expect("the source stops");
    unit.abort();
}
