//! Latency of `output.udp`: from the arrival that completes an estimate to the arrival of its
//! datagram.
//!
//! usage: `datagrams receive ADDRESS SECONDS >RECEIVED` notes when each valid datagram arrives, and
//! `datagrams latency RECEIVED LOG...` compares these times with the log of the same drive. Its replay
//! says which arrival completed each estimate. Both times are of the wall clock of this computer.

#![allow(
    clippy::disallowed_types,
    clippy::disallowed_methods,
    reason = "it measures time and takes arguments"
)]

use std::collections::BTreeMap;
use std::net::UdpSocket;
use std::path::PathBuf;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::{Context, bail, ensure};
use engine::{Config, Entry, Replay, ReplayOptions};
use sample::LogTime;
use store::{Reader, Record};
use wire::output::{DATAGRAM_BYTES, Validity, decode_datagram};

const USAGE: &str =
    "usage: datagrams receive ADDRESS SECONDS, or datagrams latency RECEIVED LOG...";
/// Upper ends of the classes of the histogram, ms, as those of `output.can` in `atvrec status`.
const CLASSES_MS: [f64; 11] = [1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0, 50.0, 100.0];
/// Width of a bar of all datagrams, characters.
const BAR: f64 = 60.0;
/// Pause after which the receiver looks at the clock.
const TIMEOUT: Duration = Duration::from_millis(100);

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments[..] {
        ["receive", address, seconds] => receive(address, seconds.parse()?),
        ["latency", received, ref logs @ ..] if !logs.is_empty() => {
            let received = std::fs::read_to_string(received)?;
            print_latency(&received, logs)
        }
        _ => bail!(USAGE),
    }
}

/// Prints the wall clock, ns, and the instant of the estimate, ns, of each valid datagram.
fn receive(address: &str, seconds: f64) -> anyhow::Result<()> {
    let socket = UdpSocket::bind(address).with_context(|| format!("cannot open {address}"))?;
    socket.set_read_timeout(Some(TIMEOUT))?;
    let end = Instant::now() + Duration::from_secs_f64(seconds);
    let mut received = String::new();
    let mut bytes = [0; 2 * DATAGRAM_BYTES];
    while Instant::now() < end {
        // Fails after the timeout.
        let Ok(length) = socket.recv(&mut bytes) else {
            continue;
        };
        let now_ns = SystemTime::now().duration_since(UNIX_EPOCH)?.as_nanos();
        let decoded = decode_datagram(&bytes[..length]);
        let (output, _) = decoded.context("a datagram is not a record of output.udp")?;
        if output.validity == Validity::Valid {
            received += &format!("{now_ns} {}\n", output.time.0);
        }
    }
    print!("{received}");
    Ok(())
}

fn print_latency(received: &str, logs: &[&str]) -> anyhow::Result<()> {
    let completed = completed(logs)?;
    let mut latencies_ms = Vec::new();
    for line in received.lines() {
        let (now_ns, time_ns) = line.split_once(' ').context("two numbers in each line")?;
        // The recording may end before the last datagrams.
        if let Some(arrived_ns) = completed.get(&LogTime(time_ns.parse()?)) {
            latencies_ms.push((now_ns.parse::<i64>()? - arrived_ns) as f64 * 1e-6);
        }
    }
    latencies_ms.sort_by(f64::total_cmp);
    let count = latencies_ms.len();
    ensure!(count > 0, "no datagram is of an estimate of the log");
    let quantile = |part: f64| latencies_ms[((count - 1) as f64 * part).round() as usize];
    println!(
        "{count} datagrams: median {:.1} ms, 99 % {:.1} ms, largest {:.1} ms",
        quantile(0.5),
        quantile(0.99),
        quantile(1.0)
    );
    let mut below_ms = 0.0;
    for (n, upper_ms) in CLASSES_MS.into_iter().enumerate() {
        // The last class has no upper end.
        let is_in = |ms: &&f64| **ms >= below_ms && (**ms < upper_ms || n + 1 == CLASSES_MS.len());
        let share = latencies_ms.iter().filter(is_in).count() as f64 / count as f64;
        if share > 0.0 {
            println!(
                "  {below_ms:5.1} to {upper_ms:5.1} ms {:6.2} % {}",
                100.0 * share,
                "#".repeat((BAR * share).round() as usize)
            );
        }
        below_ms = upper_ms;
    }
    Ok(())
}

/// Instants of the estimates of a recording, and the wall clock, ns, at the arrivals that completed
/// them.
fn completed(logs: &[&str]) -> anyhow::Result<BTreeMap<LogTime, i64>> {
    let logs: Vec<PathBuf> = logs.iter().map(PathBuf::from).collect();
    let reader = Reader::open(&logs)?;
    let config = Config::from_attachments(&reader.attachments()?)?;
    let mut completed = BTreeMap::new();
    let mut arrived_ns = 0;
    Replay::new(&reader, &config, ReplayOptions::default())?.run(|entry| {
        match entry {
            Entry::Arrival(arrival) => arrived_ns = arrival.realtime_ns,
            Entry::Record(Record::Estimate(estimate)) => {
                completed.insert(estimate.time, arrived_ns);
            }
            Entry::Record(_) => {}
        }
        anyhow::Ok(())
    })?;
    Ok(completed)
}
