//! Kills of the recorder while two buses send: what is lost, and whether what is left can be read.

#![allow(
    clippy::disallowed_types,
    clippy::disallowed_methods,
    reason = "it kills the program at known times, as often as the environment says"
)]

use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use acq::{Heard, VirtualPort};
use atvrec_tests::atvrec;
use math::Random;
use sample::Payload;
use store::Reader;

const BUSES: usize = 2;
/// Frames of one write, and the time between two: 4,000 frames/s, half of a full bus.
const FRAMES_PER_WRITE: u64 = 8;
const WRITE_INTERVAL: Duration = Duration::from_millis(2);
/// What a kill may cost.
const LOST_MAX: Duration = Duration::from_millis(100);

/// Frames written so far, after each write.
type Writes = Arc<Mutex<Vec<(u64, Instant)>>>;

/// An SLCAN adapter that numbers its frames.
struct Adapter {
    path: PathBuf,
    writes: Writes,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Adapter {
    fn start() -> Self {
        let port = VirtualPort::new().expect("a pseudo-terminal");
        let path = port.path().to_owned();
        let writes = Writes::default();
        let stop = Arc::new(AtomicBool::new(false));
        let thread = std::thread::spawn({
            let (writes, stop) = (Arc::clone(&writes), Arc::clone(&stop));
            move || speak(port, &writes, &stop)
        });
        Self {
            path,
            writes,
            stop,
            thread: Some(thread),
        }
    }

    fn written(&self) -> Vec<(u64, Instant)> {
        self.writes.lock().expect("the adapter runs").clone()
    }
}

impl Drop for Adapter {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().map(JoinHandle::join);
    }
}

/// Sends from the open command on. A queue that is full is waited for: no frame is skipped.
fn speak(mut port: VirtualPort, writes: &Mutex<Vec<(u64, Instant)>>, stop: &AtomicBool) {
    let mut open = false;
    let mut count = 0_u64;
    let mut waiting = Vec::new();
    let mut command = [0; 64];
    while !stop.load(Ordering::Relaxed) {
        if let Ok(Heard::Bytes(length @ 1..)) = port.read(&mut command) {
            open |= command[..length].contains(&b'O');
            // Behind what waits: not into the middle of a frame.
            waiting.push(b'\r');
        }
        if open && waiting.len() < 2 {
            for number in count..count + FRAMES_PER_WRITE {
                waiting.extend(format!("t1008{number:016X}\r").into_bytes());
            }
            count += FRAMES_PER_WRITE;
        }
        if !waiting.is_empty() {
            let taken = port.write(&waiting).unwrap_or(0);
            waiting.drain(..taken);
            if open && waiting.is_empty() {
                let mut writes = writes.lock().expect("the test reads it only");
                writes.push((count, Instant::now()));
            }
        }
        std::thread::sleep(WRITE_INTERVAL);
    }
}

/// Ends the recorder when the test fails.
struct Victim(Child);

impl Drop for Victim {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn record(folder: &Path, adapters: &[Adapter]) -> Victim {
    let mut text = String::from("[storage]\ndirectory = \"logs\"\nrotate_after_s = 1\n");
    for (bus, adapter) in adapters.iter().enumerate() {
        let device = adapter.path.display();
        text += &format!("[source.bus{bus}]\nkind = \"slcan\"\ndevice = \"{device}\"\n");
    }
    let config = folder.join("atvrec.toml");
    std::fs::write(&config, text).expect("written");
    let child = Command::new(atvrec())
        .args(["--quiet", "record", "--config"])
        .arg(&config)
        .spawn();
    Victim(child.expect("the recorder starts"))
}

/// Kills one recorder at a moment that chance chooses. Gives the data time lost by the bus that
/// lost most, and the logs that recovery left.
fn kill_once(random: &mut Random, folder: &Path) -> (Duration, Vec<PathBuf>) {
    let adapters: Vec<Adapter> = (0..BUSES).map(|_| Adapter::start()).collect();
    let mut victim = record(folder, &adapters);
    let begin = Instant::now();
    while adapters.iter().any(|adapter| adapter.written().is_empty()) {
        assert!(begin.elapsed() < Duration::from_secs(60), "nobody listens");
        std::thread::sleep(Duration::from_millis(5));
    }
    std::thread::sleep(Duration::from_millis(100 + random.below(2_400)));
    let killed = Instant::now();
    victim.0.kill().expect("killed");
    victim.0.wait().expect("gone");
    let written: Vec<_> = adapters.iter().map(Adapter::written).collect();
    drop(adapters);

    let logs = folder.join("logs");
    for (path, result) in store::recover_directory(&logs).expect("readable") {
        result.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    }
    let logs = recovered_logs(&logs);
    let recorded = count_frames(&logs);
    let lost = written.iter().zip(recorded).map(|(written, recorded)| {
        // The first write that the log does not hold in full.
        let missing = written.iter().find(|(count, _)| *count > recorded);
        missing.map_or(Duration::ZERO, |(_, at)| {
            killed.saturating_duration_since(*at)
        })
    });
    (lost.max().unwrap_or_default(), logs)
}

/// What lies in a folder of logs after recovery; nothing else may be there but the control socket.
fn recovered_logs(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("readable");
    let mut logs: Vec<PathBuf> = entries
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.is_file())
        .collect();
    logs.sort();
    for log in &logs {
        assert_eq!(log.extension(), Some("mcap".as_ref()), "{log:?}");
        let bytes = std::fs::read(log).expect("readable");
        let summary = mcap::Summary::read(&bytes).expect("sound");
        let statistics = summary.and_then(|s| s.stats).expect("finished");
        let stream = mcap::MessageStream::new(&bytes).expect("MCAP");
        let messages = stream.inspect(|m| assert!(m.is_ok(), "{log:?}")).count();
        assert_eq!(statistics.message_count, messages as u64, "{log:?}");
    }
    logs
}

/// Frames of each bus in the logs: all from the first on, in order, and nothing else.
fn count_frames(logs: &[PathBuf]) -> [u64; BUSES] {
    let mut counts = [0; BUSES];
    let reader = Reader::open(logs).expect("a run");
    assert_eq!(reader.info().missing, []);
    for arrival in reader.arrivals() {
        let arrival = arrival.expect("readable");
        if let Payload::Can(frames) = &arrival.payload {
            let count = &mut counts[usize::from(arrival.source.0)];
            for frame in frames {
                let number = u64::from_be_bytes(frame.bytes().try_into().expect("8 bytes"));
                assert_eq!(number, *count, "frames are missing or out of place");
                *count += 1;
            }
        }
    }
    counts
}

fn campaign(kills: u64, seed: u64, keep: Option<&Path>) -> Vec<Duration> {
    let mut random = Random::new(seed);
    let mut losses = Vec::new();
    for number in 0..kills {
        let folder = tempfile::tempdir().expect("a folder");
        let (lost, logs) = kill_once(&mut random, folder.path());
        losses.push(lost);
        for log in logs.iter().filter(|_| keep.is_some()) {
            let name = log.file_name().expect("a name").to_string_lossy();
            let kept = keep.map(|keep| keep.join(format!("{number:03}-{name}")));
            std::fs::copy(log, kept.expect("a folder")).expect("copied");
        }
    }
    losses.sort();
    losses
}

/// The time lost is not looked at here: on a machine that has other work, the recorder may not have
/// run for a while before it was killed. The campaign below does that.
#[test]
fn a_killed_recorder_leaves_logs_that_are_whole_up_to_their_end() {
    campaign(2, 1, None);
}

/// `make kills`. `ATVREC_KILLS` says how many, `ATVREC_SEED` which, `ATVREC_KEEP` where the recovered
/// logs go.
#[test]
#[ignore = "minutes of an idle machine: `make kills`"]
fn kills_cost_less_than_a_tenth_of_a_second() {
    let number = |name: &str, usual| {
        let text = std::env::var(name).ok();
        text.map_or(usual, |text| text.parse().expect("a number"))
    };
    let keep = std::env::var_os("ATVREC_KEEP").map(PathBuf::from);
    let losses = campaign(
        number("ATVREC_KILLS", 200),
        number("ATVREC_SEED", 1),
        keep.as_deref(),
    );
    let at = |share: f64| losses[((losses.len() - 1) as f64 * share) as usize].as_secs_f64() * 1e3;
    println!(
        "{} kills: lost {:.0} ms in the middle, {:.0} ms at 95 %, {:.0} ms at most",
        losses.len(),
        at(0.5),
        at(0.95),
        at(1.0)
    );
    let over = losses.iter().filter(|lost| **lost > LOST_MAX).count();
    assert_eq!(
        over, 0,
        "kills that cost more than {LOST_MAX:?}: {losses:?}"
    );
}
