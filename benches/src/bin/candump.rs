//! Makes a candump file, and reads one with a plain loop, as a peer of `atvrec import candump`.
//!
//!   candump make FILE MEGABYTES
//!   candump loop FILE

#![allow(
    clippy::disallowed_types,
    clippy::disallowed_methods,
    reason = "it takes arguments and measures time"
)]

use std::error::Error;
use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::time::Instant;

/// A frame as the loop keeps it.
struct Frame {
    time_us: u64,
    id: u32,
    length: usize,
    data: [u8; 8],
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["make", path, megabytes] => make(path, megabytes.parse()?),
        ["loop", path] => read(path),
        _ => Err("usage: candump make FILE MEGABYTES | candump loop FILE".into()),
    }
}

/// Four buses with frames of eight bytes, 8,000 each second.
fn make(path: &str, megabytes: u64) -> Result<(), Box<dyn Error>> {
    let mut file = BufWriter::new(File::create(path)?);
    let (mut written, mut number) = (0_u64, 0_u64);
    while written < megabytes * 1_000_000 {
        let time_us = 1_790_000_000_000_000 + number * 31;
        let line = format!(
            "({}.{:06}) can{} {:03X}#{:016X}\n",
            time_us / 1_000_000,
            time_us % 1_000_000,
            number % 4,
            0x100 + number % 64,
            number.wrapping_mul(0x9E37_79B9_7F4A_7C15)
        );
        file.write_all(line.as_bytes())?;
        written += line.len() as u64;
        number += 1;
    }
    file.flush()?;
    println!("{number} frames, {:.0} MB", written as f64 / 1e6);
    Ok(())
}

/// Reads every line into a frame, and keeps a sum, so that no work is left out.
fn read(path: &str) -> Result<(), Box<dyn Error>> {
    let begin = Instant::now();
    let mut reader = BufReader::new(File::open(path)?);
    let (mut line, mut bytes, mut frames, mut sum) = (String::new(), 0, 0_u64, 0_u64);
    while reader.read_line(&mut line)? > 0 {
        bytes += line.len();
        let frame = parse(&line).ok_or_else(|| format!("line {}: {line}", frames + 1))?;
        sum = sum
            .wrapping_add(frame.time_us)
            .wrapping_add(u64::from(frame.id))
            .wrapping_add(u64::from_le_bytes(frame.data))
            .wrapping_add(frame.length as u64);
        frames += 1;
        line.clear();
    }
    let seconds = begin.elapsed().as_secs_f64();
    println!(
        "plain loop: {frames} frames in {seconds:.2} s, {:.0} MB/s (sum {sum:x})",
        bytes as f64 / 1e6 / seconds
    );
    Ok(())
}

fn parse(line: &str) -> Option<Frame> {
    let (time, rest) = line.strip_prefix('(')?.split_once(") ")?;
    let (seconds, fraction) = time.split_once('.')?;
    let (_, frame) = rest.trim_end().split_once(' ')?;
    let (id, text) = frame.split_once('#')?;
    let mut data = [0; 8];
    let length = text.len() / 2;
    for (place, byte) in data.iter_mut().enumerate().take(length) {
        *byte = u8::from_str_radix(text.get(2 * place..2 * place + 2)?, 16).ok()?;
    }
    Some(Frame {
        time_us: seconds.parse::<u64>().ok()? * 1_000_000 + fraction.parse::<u64>().ok()?,
        id: u32::from_str_radix(id, 16).ok()?,
        length,
        data,
    })
}
