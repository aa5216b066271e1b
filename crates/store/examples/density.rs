//! Prints what a log costs on disk per CAN frame, and how fast it is written and read.
//!
//! The traffic is that of four strain boxes, steering and wheel speeds: ten frames of 8 bytes at
//! 100 Hz, 10-bit counts that move slowly under a noise of about one count.
//!
//! `cargo run --release -p atvrec-store --example density`

#![allow(clippy::disallowed_types, reason = "it measures time")]

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use atvrec_store::{LogWriter, Options, Reader, Session, Source, SourceKind};
use math::Random;
use sample::{Arrival, CanFlags, CanFrame, LogTime, Payload, SourceId};

const START: u64 = 1_790_000_000_000_000_000;
const FRAMES_PER_CYCLE: u32 = 10;

/// Frames of `seconds` of driving, `per_call` of them in one system call.
fn traffic(seconds: u32, per_call: u32) -> Vec<Arrival> {
    let mut random = Random::new(1);
    let mut arrivals = Vec::new();
    let mut waiting: Vec<CanFrame> = Vec::new();
    for cycle in 0..seconds * 100 {
        for box_number in 0..FRAMES_PER_CYCLE {
            // The boxes' clocks wander by tens of microseconds; a frame takes 130 us on the bus.
            let on_bus = START
                + u64::from(cycle) * 10_000_000
                + u64::from(box_number) * 250_000
                + (20_000.0 * random.normal().abs()) as u64;
            let mut data = [0_u8; 8];
            for (channel, bytes) in data.chunks_exact_mut(2).enumerate() {
                let phase = f64::from(cycle) * 0.01 + (channel as f64) + f64::from(box_number);
                let counts = 512.0 + 120.0 * math::sin(phase) + random.normal();
                bytes.copy_from_slice(&(counts as u16).to_le_bytes());
            }
            let frame = CanFrame::new(0x100 + 16 * box_number, CanFlags::default(), &data);
            let Some(mut frame) = frame else { continue };
            frame.kernel_ns = Some(on_bus as i64);
            waiting.push(frame);
            if waiting.len() < per_call as usize {
                continue;
            }
            // From the kernel's stamp to the reader: scheduling, tens of microseconds.
            let log_time = on_bus + 25_000 + (10_000.0 * random.normal().abs()) as u64;
            arrivals.push(Arrival {
                sequence: arrivals.len() as u64,
                source: SourceId(1),
                log_time: LogTime(log_time),
                realtime_ns: (log_time as i64) + 60 + (20.0 * random.normal()) as i64,
                payload: Payload::Can(std::mem::take(&mut waiting)),
            });
        }
    }
    arrivals
}

fn session() -> Session {
    Session {
        run_id: "density".to_owned(),
        started: LogTime(START),
        sources: vec![Source {
            id: SourceId(1),
            name: "can0".to_owned(),
            kind: SourceKind::Can,
        }],
        ..Session::default()
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let seconds = 60;
    println!("{seconds} s at 1000 frames/s, 8 data bytes, kernel stamps");
    println!("frames/call  group ms  level   B/frame  write Mframe/s  read Mframe/s");
    for (per_call, interval_ms, level) in [
        (1, 80, 0),
        (1, 80, 9),
        (1, 250, 0),
        (1, 1000, 0),
        (1, 1000, 9),
        (5, 80, 0),
        (10, 80, 0),
        (10, 1000, 0),
    ] {
        let arrivals = traffic(seconds, per_call);
        let frames = f64::from(seconds) * 1000.0;
        let options = Options {
            raw_interval: Duration::from_millis(interval_ms),
            compression_level: Some(level),
            ..Options::default()
        };
        let begin = Instant::now();
        let mut writer = LogWriter::new(Vec::new(), session(), options, 0)?;
        for arrival in arrivals {
            writer.push(arrival)?;
        }
        let bytes = writer.finish(&BTreeMap::new())?;
        let written = begin.elapsed().as_secs_f64();

        let path = std::env::temp_dir().join(format!("density-{}.mcap", std::process::id()));
        std::fs::write(&path, &bytes)?;
        let begin = Instant::now();
        let read = Reader::open([&path])?.arrivals().count();
        let reading = begin.elapsed().as_secs_f64();
        std::fs::remove_file(&path)?;
        assert_eq!(read as f64 * f64::from(per_call), frames);
        println!(
            "{per_call:11}  {interval_ms:8}  {level:5}  {:8.2}  {:14.2}  {:13.2}",
            bytes.len() as f64 / frames,
            frames / written / 1e6,
            frames / reading / 1e6,
        );
    }
    Ok(())
}
