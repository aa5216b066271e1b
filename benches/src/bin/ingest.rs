//! Four full CAN buses, an inertial unit and two receivers into `atvrec record`, for a while:
//! what is lost, what it costs, whether memory grows.
//!
//! usage: `ingest PATH-OF-ATVREC [SECONDS]`, or `ingest --log LOG...` for how far behind the
//! kernel's stamps the frames of a recording were taken, and when raw and decoded data was written.
//!
//! The buses are SLCAN adapters on pseudo-terminals, because those exist on every machine; a
//! SocketCAN frame costs the recorder less, having no text to parse.

#![allow(
    clippy::disallowed_types,
    clippy::disallowed_methods,
    reason = "it measures time and takes arguments"
)]

use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::{Context, ensure};
use sample::{CanFlags, CanFrame, Payload};
use serialport::{SerialPort, TTYPort};
use store::Reader;

const BUSES: usize = 4;
const FRAMES_PER_SECOND: u64 = 8_000;
/// Each write carries this much time, as a USB adapter's transfers do.
const WRITE_INTERVAL: Duration = Duration::from_millis(2);
/// Files are changed this often, so that what that costs is seen.
const ROTATE_S: u32 = 2;

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let atvrec = arguments
        .next()
        .context("usage: ingest PATH-OF-ATVREC [SECONDS]")?;
    if atvrec == "--log" {
        let logs: Vec<PathBuf> = arguments.map(PathBuf::from).collect();
        return print_kernel_delays(&logs);
    }
    let seconds: u64 = arguments.next().map_or(Ok(30), |text| text.parse())?;
    let folder = tempfile::tempdir()?;
    let virtual_vehicle = start_virtual_vehicle(&atvrec, folder.path())?;
    let stop = Arc::new(AtomicBool::new(false));
    let buses = (0..BUSES)
        .map(|_| Bus::start(&stop))
        .collect::<anyhow::Result<Vec<_>>>()?;
    write_configuration(folder.path(), &buses)?;

    let recorder = Command::new(&atvrec)
        .arg("record")
        .arg("--config")
        .arg(folder.path().join("atvrec.toml"))
        .args(["--quiet", "--for", &seconds.to_string()])
        .spawn()
        .context("the recorder does not start")?;
    let cost = watch(recorder, seconds, &stop)?;
    drop(virtual_vehicle);
    let sent: Vec<Vec<Burst>> = buses.into_iter().map(Bus::finish).collect();
    print_result(folder.path(), &sent, &cost)
}

/// Ends the process when it goes out of scope.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn start_virtual_vehicle(atvrec: &str, folder: &Path) -> anyhow::Result<Running> {
    let child = Command::new(atvrec)
        .args([
            "virtual",
            "--manoeuvre",
            "slow-sine",
            "--repeat",
            "--quiet",
            "--directory",
        ])
        .arg(folder.join("ports"))
        .stdout(Stdio::null())
        .spawn()
        .context("the virtual vehicle does not start")?;
    let running = Running(child);
    for _ in 0..100 {
        if folder.join("ports/septentrio").exists() {
            return Ok(running);
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    anyhow::bail!("the virtual vehicle made no ports in {}", folder.display())
}

/// One SLCAN adapter: a pseudo-terminal and the thread that speaks on it while the channel is open.
struct Bus {
    device: String,
    thread: JoinHandle<Vec<Burst>>,
    slave: TTYPort,
}

/// What an adapter sent in one write.
struct Burst {
    /// Frames sent after it.
    count: u64,
    /// Wall clock before it, ns: what waits for room on the line is late, too.
    realtime_ns: i64,
}

fn realtime_ns() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(0, |since| since.as_nanos() as i64)
}

impl Bus {
    fn start(stop: &Arc<AtomicBool>) -> anyhow::Result<Self> {
        let (master, slave) = TTYPort::pair()?;
        let device = slave.name().context("a pseudo-terminal has a name")?;
        let thread = std::thread::spawn({
            let stop = Arc::clone(stop);
            move || speak(master, &stop)
        });
        Ok(Self {
            device,
            thread,
            slave,
        })
    }

    /// What it sent. Reads in the recorder's place until a write that found no room ends.
    fn finish(mut self) -> Vec<Burst> {
        while !self.thread.is_finished() {
            let _ = self.slave.read(&mut [0; 4096]);
        }
        self.thread.join().unwrap_or_default()
    }
}

/// Sends frames at the bus's rate from the open command on, without waiting for anybody, as an
/// adapter does. What does not fit into the terminal's queue is sent later: nothing is dropped
/// here, so a recorder that is too slow shows as frames that were never sent in time.
fn speak(mut master: TTYPort, stop: &AtomicBool) -> Vec<Burst> {
    let mut writes = Vec::new();
    let _ = master.set_timeout(Duration::from_millis(1));
    let mut opened: Option<Instant> = None;
    let mut command = [0; 64];
    let mut count = 0_u64;
    while !stop.load(Ordering::Relaxed) {
        if let Ok(length) = master.read(&mut command) {
            let open = command[..length].contains(&b'O') || command[..length].contains(&b'L');
            opened = opened.or_else(|| open.then(Instant::now));
            if command[..length].contains(&b'C') && count > 0 {
                break;
            }
            let _ = master.write_all(b"\r");
        }
        let Some(start) = opened else { continue };
        let due = (start.elapsed().as_secs_f64() * FRAMES_PER_SECOND as f64) as u64;
        let mut text = String::new();
        while count < due {
            text.push_str(&frame_text(count));
            count += 1;
        }
        let realtime_ns = realtime_ns();
        if write_all(&mut master, text.as_bytes(), stop).is_err() {
            break;
        }
        writes.push(Burst { count, realtime_ns });
        std::thread::sleep(WRITE_INTERVAL);
    }
    writes
}

/// Writes all of the bytes, however long the line is full.
fn write_all(line: &mut TTYPort, mut bytes: &[u8], stop: &AtomicBool) -> std::io::Result<()> {
    while !bytes.is_empty() && !stop.load(Ordering::Relaxed) {
        match line.write(bytes) {
            Ok(written) => bytes = &bytes[written..],
            Err(error) if error.kind() == ErrorKind::TimedOut => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Identifiers of the project's DBC, so that the recorder decodes every frame and feeds the
/// estimator as well.
const IDS: [u32; 8] = [0x110, 0x111, 0x130, 0x131, 0x140, 0x141, 0x150, 0x151];

/// Eight bytes that look like converter counts: slow, with a few noisy bits.
fn frame_text(count: u64) -> String {
    let noise = count.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 60;
    let value = 512 + (count / 64) % 64 + noise % 4;
    format!(
        "t{:03X}8{value:04X}{:04X}{value:04X}{:04X}\r",
        IDS[count as usize % IDS.len()],
        value ^ 1,
        value ^ 3
    )
}

fn write_configuration(folder: &Path, buses: &[Bus]) -> anyhow::Result<()> {
    let ports = folder.join("ports");
    let mut text = format!(
        "[storage]\ndirectory = \"{}\"\nrotate_after_s = {ROTATE_S}\n",
        folder.join("logs").display()
    );
    for (index, bus) in buses.iter().enumerate() {
        text += &format!(
            "[source.bus{index}]\nkind = \"slcan\"\ndevice = \"{}\"\nbitrate = 1000000\n\
             timestamps = false\n",
            bus.device
        );
    }
    for (name, kind) in [
        ("imu", "crossbow440"),
        ("novatel", "gnss"),
        ("septentrio", "gnss"),
    ] {
        let device = ports.join(name);
        text += &format!(
            "[source.{name}]\nkind = \"{kind}\"\ndevice = \"{}\"\n",
            device.display()
        );
    }
    std::fs::write(folder.join("atvrec.toml"), text).context("cannot write the configuration")
}

/// What the recorder used.
struct Cost {
    cpu_s: f64,
    wall_s: f64,
    resident_mb: Vec<f64>,
}

fn watch(mut recorder: Child, seconds: u64, stop: &AtomicBool) -> anyhow::Result<Cost> {
    let start = Instant::now();
    let mut cost = Cost {
        cpu_s: 0.0,
        wall_s: 0.0,
        resident_mb: Vec::new(),
    };
    loop {
        if let Some(status) = recorder.try_wait()? {
            stop.store(true, Ordering::Relaxed);
            println!("recorder ended with {status}");
            return Ok(cost);
        }
        if let Some((cpu_s, resident_mb)) = usage(recorder.id()) {
            cost.cpu_s = cpu_s;
            cost.wall_s = start.elapsed().as_secs_f64();
            cost.resident_mb.push(resident_mb);
        }
        ensure!(
            start.elapsed() < Duration::from_secs(seconds + 60),
            "the recorder does not end"
        );
        std::thread::sleep(Duration::from_millis(500));
    }
}

/// CPU seconds and resident megabytes of a process, from /proc.
fn usage(process: u32) -> Option<(f64, f64)> {
    const TICKS_PER_SECOND: f64 = 100.0;
    const PAGE_MB: f64 = 4096.0 / 1e6;
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks: f64 = fields.get(11)?.parse::<f64>().ok()? + fields.get(12)?.parse::<f64>().ok()?;
    let pages: f64 = fields.get(21)?.parse().ok()?;
    Some((ticks / TICKS_PER_SECOND, pages * PAGE_MB))
}

fn print_result(folder: &Path, sent: &[Vec<Burst>], cost: &Cost) -> anyhow::Result<()> {
    let logs = log_paths(&folder.join("logs"))?;
    let bytes: u64 = logs
        .iter()
        .filter_map(|path| Some(path.metadata().ok()?.len()))
        .sum();
    let reader = Reader::open(&logs)?;
    let mut recorded = vec![0_u64; BUSES];
    let mut disordered = 0_u64;
    let mut delays = Vec::new();
    let mut writes: Vec<_> = sent.iter().map(|writes| writes.iter().peekable()).collect();
    for arrival in reader.arrivals() {
        let arrival = arrival?;
        let name = reader.session().source_name(arrival.source);
        let Some(bus) = name
            .strip_prefix("bus")
            .and_then(|n| n.parse::<usize>().ok())
        else {
            continue;
        };
        if let Payload::Can(frames) = arrival.payload {
            for frame in frames {
                if frame.bytes() != expected(recorded[bus]).bytes() {
                    disordered += 1;
                }
                recorded[bus] += 1;
                while writes[bus]
                    .next_if(|write| write.count < recorded[bus])
                    .is_some()
                {}
                if let Some(write) = writes[bus].peek() {
                    delays.push(arrival.realtime_ns - write.realtime_ns);
                }
            }
        }
    }
    let total: u64 = recorded.iter().sum();
    let sent: Vec<u64> = sent
        .iter()
        .map(|writes| writes.last().map_or(0, |write| write.count))
        .collect();
    println!("frames sent by the adapters   {sent:?}");
    println!("frames in the log             {recorded:?}, {disordered} out of place");
    println!(
        "rate                          {:.0} frames/s",
        total as f64 / cost.wall_s
    );
    println!(
        "processor                     {:.2} cores",
        cost.cpu_s / cost.wall_s
    );
    let settled = &cost.resident_mb[cost.resident_mb.len() / 4..];
    let least = settled.iter().copied().fold(f64::INFINITY, f64::min);
    let greatest = settled.iter().copied().fold(0.0, f64::max);
    println!(
        "resident memory               {least:.1} to {greatest:.1} MB after the first quarter"
    );
    println!(
        "on disk                       {:.2} bytes a frame, all channels",
        bytes as f64 / total as f64
    );
    print_delays("taken behind its write", &mut delays);
    print_writing(&logs)?;
    println!(
        "                              ({} files, one each {ROTATE_S} s, synced each 0.5 s)",
        logs.len()
    );
    Ok(())
}

/// The distribution of how late something was.
fn print_delays(what: &str, delays_ns: &mut [i64]) {
    delays_ns.sort_unstable();
    let Some(last) = delays_ns.len().checked_sub(1) else {
        return println!("{what:<30}nothing");
    };
    let at = |share: f64| delays_ns[(last as f64 * share) as usize] as f64 * 1e-6;
    println!(
        "{what:<30}{:.3} ms in the middle, {:.3} at 99 %, {:.3} at 99.99 %, {:.3} at most",
        at(0.5),
        at(0.99),
        at(0.9999),
        at(1.0)
    );
}

/// How far behind the kernel's stamp each frame of a recording was taken.
fn print_kernel_delays(logs: &[PathBuf]) -> anyhow::Result<()> {
    let mut delays = Vec::new();
    for arrival in Reader::open(logs)?.arrivals() {
        let arrival = arrival?;
        if let Payload::Can(frames) = &arrival.payload {
            let stamps = frames.iter().filter_map(|frame| frame.kernel_ns);
            delays.extend(stamps.map(|stamp| arrival.realtime_ns - stamp));
        }
    }
    print_delays("taken behind kernel's stamp", &mut delays);
    print_writing(logs)
}

/// How long after its arrival data was written into the log: raw arrivals, and decoded messages.
///
/// Times are those of the log clock. A group of raw data is written when the first arrival of the next group
/// is there. A chunk of decoded messages is written after the group before it in the file, and not before
/// its own last message.
fn print_writing(logs: &[PathBuf]) -> anyhow::Result<()> {
    let (mut raw, mut decoded) = (Vec::new(), Vec::new());
    for log in logs {
        let data = std::fs::read(log)?;
        let summary = mcap::Summary::read(&data)?.context("the log has no summary")?;
        let mut chunks = Vec::new();
        for index in &summary.chunk_indexes {
            let mut times = Vec::new();
            let mut is_raw = false;
            for message in summary.stream_chunk(&data, index)? {
                let message = message?;
                let schema = message.channel.schema.as_ref();
                is_raw |= schema.is_some_and(|schema| schema.name.starts_with("atvrec.Raw"));
                times.push(message.log_time as i64);
            }
            chunks.push((index.chunk_start_offset, is_raw, times));
        }
        chunks.sort_by_key(|(offset, _, _)| *offset);
        let first = |(_, _, times): &&(u64, bool, Vec<i64>)| times.iter().min().copied();
        let starts: Vec<i64> = chunks
            .iter()
            .filter(|chunk| chunk.1)
            .filter_map(|c| first(&c))
            .collect();
        for arrival in Reader::open([log])?.arrivals() {
            let time = arrival?.log_time.0 as i64;
            let next = starts.partition_point(|start| *start <= time);
            raw.extend(starts.get(next).map(|written| written - time));
        }
        let mut groups = 0;
        for (_, is_raw, times) in &chunks {
            groups += usize::from(*is_raw);
            if let (false, Some(group)) = (*is_raw, starts.get(groups)) {
                let written = times.iter().fold(*group, |last, time| last.max(*time));
                decoded.extend(times.iter().map(|time| written - time));
            }
        }
    }
    print_delays("raw data written", &mut raw);
    print_delays("decoded messages written", &mut decoded);
    Ok(())
}

fn expected(count: u64) -> CanFrame {
    let text = frame_text(count);
    let data: Vec<u8> = (0..8)
        .filter_map(|index| u8::from_str_radix(text.get(5 + 2 * index..7 + 2 * index)?, 16).ok())
        .collect();
    CanFrame::new(IDS[count as usize % IDS.len()], CanFlags::default(), &data)
        .expect("eight bytes fit into a frame")
}

fn log_paths(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        paths.push(entry?.path());
    }
    // The folder has the counter of the runs too.
    paths.retain(|path| path.extension().is_some_and(|end| end == "mcap"));
    paths.sort();
    Ok(paths)
}
