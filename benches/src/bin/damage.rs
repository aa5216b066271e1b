//! Messages saved from damaged copies of a log, by recovery and by a reader that goes from record to
//! record and stops at the first damage, which is the algorithm of `mcap recover`.
//!
//! usage: `damage LOG [DAMAGES]`

#![allow(clippy::disallowed_methods, reason = "it takes arguments")]

use std::io::Cursor;

use anyhow::{Context, ensure};
use mcap::records::op;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args_os().skip(1);
    let path = arguments.next().context("usage: damage LOG [DAMAGES]")?;
    let damages: u64 = match arguments.next() {
        Some(text) => text.to_string_lossy().parse()?,
        None => 200,
    };
    let log = std::fs::read(&path)?;
    let whole = read_linearly(&log);
    ensure!(whole > 0, "no message is in the log");
    for (name, length) in [
        ("one bit", 0),
        ("a sector of 512 zeros", 512),
        ("4096 zeros", 4096),
    ] {
        let (mut ours, mut theirs) = (0, 0);
        for number in 0..damages {
            let damaged = damage(&log, length, number);
            ours += store::salvage(Cursor::new(&damaged), &[], std::io::sink())?;
            theirs += read_linearly(&damaged);
        }
        let all = (whole * damages) as f64;
        println!(
            "{damages} times {name}: atvrec recover saves {:.2} % of the messages, a linear reader {:.2} %",
            100.0 * ours as f64 / all,
            100.0 * theirs as f64 / all
        );
    }
    Ok(())
}

/// The log with one bit changed, or with `length` zeros, at a place that `number` chooses.
fn damage(log: &[u8], length: usize, number: u64) -> Vec<u8> {
    let mut damaged = log.to_vec();
    // SplitMix64, so that all machines damage the same places.
    let mut random = (number + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    random = (random ^ (random >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    random = (random ^ (random >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    let place = ((random >> 3) % log.len() as u64) as usize;
    if length == 0 {
        damaged[place] ^= 1 << (random & 7);
    } else {
        let start = place - place % length;
        let end = (start + length).min(log.len());
        damaged[start..end].fill(0);
    }
    damaged
}

/// Messages up to the first damage.
fn read_linearly(mut log: &[u8]) -> u64 {
    let options = LinearReaderOptions::default()
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(1 << 26);
    let mut reader = LinearReader::new_with_options(options);
    let mut messages = 0;
    while let Some(Ok(event)) = reader.next_event() {
        match event {
            LinearReadEvent::ReadRequest(wanted) => {
                let count = wanted.min(log.len());
                let (head, tail) = log.split_at(count);
                reader.insert(wanted)[..count].copy_from_slice(head);
                reader.notify_read(count);
                log = tail;
            }
            LinearReadEvent::Record { opcode, .. } => messages += u64::from(opcode == op::MESSAGE),
        }
    }
    messages
}
