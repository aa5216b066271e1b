//! What a recording's CAN frames cost on disk, stamps and indexes included, and what the same
//! frames cost as text.
//!
//! usage: `bytes LOG...`: the raw CAN traffic of the logs is written again as a raw recording (no
//! decoded channels, default options), and as `candump -L` would write it.

#![allow(clippy::disallowed_methods, reason = "it takes arguments")]

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use anyhow::{Context, ensure};
use sample::{Arrival, Payload};
use store::{LogWriter, Options, Reader, Session};

fn main() -> anyhow::Result<()> {
    let logs: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    ensure!(!logs.is_empty(), "usage: bytes LOG...");
    let reader = Reader::open(&logs)?;
    // The files of a configuration cost the same whatever is recorded.
    let session = Session {
        attachments: Vec::new(),
        dynamic: Vec::new(),
        ..reader.session().clone()
    };
    let mut writer = LogWriter::new(Vec::new(), session, Options::default(), 0)?;
    let mut text = String::new();
    let (mut frames, mut stamped, mut sequence) = (0_u64, 0_u64, 0);
    let mut span = None;
    for arrival in reader.arrivals() {
        let arrival = arrival?;
        let Payload::Can(list) = &arrival.payload else {
            continue;
        };
        for frame in list {
            let name = reader.session().source_name(arrival.source);
            let stamp_ns = frame.kernel_ns.unwrap_or(arrival.realtime_ns);
            let stamped_frame = sample::CanFrame {
                kernel_ns: Some(stamp_ns),
                ..frame.clone()
            };
            text += &wire::candump::format_line(&name, &stamped_frame);
            text.push('\n');
            stamped += u64::from(frame.kernel_ns.is_some());
        }
        frames += list.len() as u64;
        let (first, _) = *span.get_or_insert((arrival.log_time, arrival.log_time));
        span = Some((first, arrival.log_time));
        // Numbered as if nothing else had been recorded.
        writer.push(Arrival {
            sequence,
            ..arrival
        })?;
        sequence += 1;
    }
    let bytes = writer.finish(&BTreeMap::new())?.len();
    let seconds = span.map_or(0.0, |(first, last)| last.seconds_since(first));
    let each = |bytes: usize| bytes as f64 / frames.max(1) as f64;
    println!("{frames} frames in {seconds:.0} s, {stamped} with a kernel stamp");
    println!(
        "raw recording                 {:6.2} bytes a frame",
        each(bytes)
    );
    println!("candump -L                    {:6.2}", each(text.len()));
    println!(
        "candump -L | gzip             {:6.2}",
        each(piped("gzip", &text)?)
    );
    Ok(())
}

/// How many bytes a program makes of a text.
fn piped(program: &str, text: &str) -> anyhow::Result<usize> {
    let mut child = Command::new(program)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .with_context(|| format!("{program} does not start"))?;
    let mut input = child.stdin.take().context("it has an input")?;
    let text = text.to_owned();
    let feeding = std::thread::spawn(move || input.write_all(text.as_bytes()));
    let output = child.wait_with_output()?;
    let _ = feeding.join();
    Ok(output.stdout.len())
}
