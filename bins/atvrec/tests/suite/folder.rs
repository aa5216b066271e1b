//! The log folder: start beside unfinished logs, its one owner, retention, names by a receiver.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::support::{ABSENT, NOTHING_RECEIVED, atvrec, names, simulate, stdout};

/// How long a test waits for what must happen.
const PATIENCE: Duration = Duration::from_secs(60);

fn wait_for(what: &str, mut is_so: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !is_so() {
        assert!(begin.elapsed() < PATIENCE, "{what} did not happen");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Reads messages until `is_it` is true for one.
fn wait_for_message(messages: &mpsc::Receiver<String>, mut is_it: impl FnMut(&str) -> bool) {
    let deadline = Instant::now() + PATIENCE;
    loop {
        let left = deadline.saturating_duration_since(Instant::now());
        let text = messages.recv_timeout(left).expect("the message is printed");
        if is_it(&text) {
            return;
        }
    }
}

/// A recorder in the background; killed when dropped.
struct Background(Child);

impl Background {
    fn start(directory: &Path) -> Self {
        Self(
            Command::new(env!("CARGO_BIN_EXE_atvrec"))
                .arg("record")
                .current_dir(directory)
                .env_remove("ATVREC_LOG")
                .stdout(Stdio::null())
                .stderr(Stdio::piped())
                .spawn()
                .expect("the recorder starts"),
        )
    }

    /// Queue of the recorder's messages, which a thread reads.
    fn messages(&mut self) -> mpsc::Receiver<String> {
        let stderr = self.0.stderr.take().expect("a pipe");
        let (send, messages) = mpsc::channel();
        std::thread::spawn(move || {
            let lines = BufReader::new(stderr).lines().map_while(Result::ok);
            // Messages after the end of the test are not needed.
            lines.for_each(|line| send.send(line).unwrap_or_default());
        });
        messages
    }

    /// Kills it without any warning.
    fn kill(mut self) {
        self.0.kill().expect("killed");
        self.0.wait().expect("ended");
    }

    fn terminate(mut self) {
        let id = self.0.id().to_string();
        let status = Command::new("kill").args(["-TERM", &id]).status();
        assert!(status.expect("kill runs").success());
        let code = self.0.wait().expect("ended").code();
        // 3 where no device sends.
        assert!(matches!(code, Some(0 | NOTHING_RECEIVED)), "{code:?}");
    }
}

impl Drop for Background {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A log that was not closed, of at least `bytes`: the chunks of a drive again and again.
fn unfinished(directory: &Path, name: &str, bytes: usize) -> PathBuf {
    const CHUNK: u8 = 0x06;
    const DATA_END: u8 = 0x0F;
    let log = fs::read(simulate(directory, "drive.mcap", 1)).expect("a log");
    let (mut at, mut chunks) = (8, Vec::new());
    let mut long = Vec::new();
    while log[at] != DATA_END {
        let length = log[at + 1..at + 9].try_into().expect("eight bytes");
        let end = at + 9 + u64::from_le_bytes(length) as usize;
        if log[at] == CHUNK {
            chunks.extend_from_slice(&log[at..end]);
        }
        if long.is_empty() && log[at] == CHUNK {
            long.extend_from_slice(&log[..at]);
        }
        at = end;
    }
    assert!(!chunks.is_empty(), "the simulated log has no chunk");
    while long.len() < bytes {
        long.extend_from_slice(&chunks);
    }
    let path = directory.join("logs").join(name);
    fs::create_dir_all(directory.join("logs")).expect("a directory");
    fs::write(&path, long).expect("written");
    path
}

/// Half a minute of work for the recovery must not cost half a minute of the drive.
#[test]
fn recording_starts_before_an_unfinished_log_is_recovered() {
    let directory = tempfile::tempdir().expect("a directory");
    let old = unfinished(directory.path(), "old.mcap.active", 40_000_000);
    fs::write(directory.path().join("atvrec.toml"), ABSENT).expect("written");
    let mut recorder = Background::start(directory.path());
    let messages = recorder.messages();
    wait_for_message(&messages, |text| {
        assert!(!text.contains("recovered"), "{text}");
        text.contains("recording")
    });
    assert!(old.exists(), "the log was recovered before");
    let logs = directory.path().join("logs");
    let active = |name: &String| name.contains("-r000001-") && name.ends_with(".mcap.active");
    assert!(names(&logs).iter().any(active), "{:?}", names(&logs));
    // After a failed recovery, for example on a full disk, the recording continues.
    wait_for_message(&messages, |text| {
        assert!(!text.contains("cannot recover"), "{text}");
        text.contains("recovered an unfinished log")
    });
    assert!(!old.exists() && logs.join("old.mcap").exists());
    recorder.terminate();
}

/// A stop does not wait, a kill loses nothing, and the next start goes on.
#[test]
fn an_interrupted_recovery_leaves_the_original_whole() {
    let directory = tempfile::tempdir().expect("a directory");
    let old = unfinished(directory.path(), "old.mcap.active", 30_000_000);
    let before = fs::read(&old).expect("a log");
    fs::write(directory.path().join("atvrec.toml"), ABSENT).expect("written");
    let logs = directory.path().join("logs");
    let recovered = logs.join("old.mcap");
    for round in 0..6 {
        let recorder = Background::start(directory.path());
        wait_for("the start", || {
            names(&logs).iter().any(|name| name.contains("-r0"))
        });
        std::thread::sleep(Duration::from_millis(40 * round));
        if round % 2 == 0 {
            recorder.kill();
        } else {
            recorder.terminate();
        }
        if !old.exists() {
            break;
        }
        assert_eq!(fs::read(&old).expect("a log"), before);
    }
    let recorder = Background::start(directory.path());
    wait_for("the recovery", || recovered.exists() && !old.exists());
    recorder.terminate();
    let reader = store::Reader::open([&recovered]).expect("the log opens");
    assert_eq!(reader.info().missing, []);
    let left = |name: &String| name.ends_with(".active") || name.ends_with(".recovering");
    assert!(!names(&logs).iter().any(left), "{:?}", names(&logs));
}

#[test]
fn of_three_recorders_in_one_folder_two_stop_and_leave_nothing() {
    let directory = tempfile::tempdir().expect("a directory");
    for name in ["one", "two", "three"] {
        let text =
            format!("{ABSENT}[storage]\ndirectory = \"logs\"\n[control]\nsocket = \"{name}\"\n");
        fs::write(directory.path().join(format!("{name}.toml")), text).expect("written");
    }
    let start = |name: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_atvrec"));
        let command = command.args(["record", "--for", "3", "--config"]);
        let command = command.arg(format!("{name}.toml"));
        let command = command.current_dir(directory.path()).stderr(Stdio::piped());
        command.stdout(Stdio::null()).spawn().expect("started")
    };
    let recorders = ["one", "two", "three"].map(start);
    let ended = recorders.map(|child| child.wait_with_output().expect("ended"));
    let codes: Vec<_> = ended.iter().map(|output| output.status.code()).collect();
    assert_eq!(
        codes
            .iter()
            .filter(|code| **code == Some(NOTHING_RECEIVED))
            .count(),
        1
    );
    assert_eq!(codes.iter().filter(|code| **code == Some(1)).count(), 2);
    for output in ended
        .iter()
        .filter(|output| output.status.code() == Some(1))
    {
        let text = String::from_utf8_lossy(&output.stderr);
        assert!(text.contains("another recorder"), "{text}");
    }
    let logs = names(&directory.path().join("logs"));
    let of_runs: Vec<_> = logs.iter().filter(|name| name.contains(".mcap")).collect();
    assert_eq!(of_runs.len(), 1, "{logs:?}");
    assert!(of_runs[0].contains("-r000001-") && of_runs[0].ends_with(".mcap"));
}

#[test]
fn status_says_what_retention_removed_and_the_modification_time_has_no_say() {
    let directory = tempfile::tempdir().expect("a directory");
    let drive = simulate(directory.path(), "drive.mcap", 1);
    let bytes = fs::metadata(&drive).expect("a log").len();
    let logs = directory.path().join("logs");
    fs::create_dir(&logs).expect("made");
    let name = |run: u32| format!("drive-r{run:06}-20260101T000000Z_0000.mcap");
    for run in [1, 2, 3] {
        fs::copy(&drive, logs.join(name(run))).expect("copied");
    }
    // The newest drive is the oldest by its time.
    let newest = fs::File::options().append(true).open(logs.join(name(3)));
    let long_ago = std::time::SystemTime::UNIX_EPOCH;
    newest.expect("a log").set_modified(long_ago).expect("set");
    let quota_mb = 2.5 * bytes as f64 / 1_048_576.0;
    let text = format!("{ABSENT}[storage]\nquota_mb = {quota_mb}\nrotate_after_mb = 0.1\n");
    fs::write(directory.path().join("atvrec.toml"), text).expect("written");
    let recorder = Background::start(directory.path());
    let status = || {
        let output = atvrec(directory.path()).args(["status", "--json"]).output();
        let output = output.expect("it runs");
        serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap_or_default()
    };
    wait_for("the removal", || status()["retention"]["removed"] == 1);
    let retention = status()["retention"].clone();
    assert_eq!(retention["removed_bytes"], bytes);
    assert_eq!(retention["reason"], "quota_mb");
    let last = retention["last"].as_str().unwrap_or_default().to_owned();
    assert!(last.ends_with(&name(1)), "{last}");
    let text = stdout(&atvrec(directory.path()).arg("status").assert().success());
    assert!(text.contains("removed 1 logs"), "{text}");
    recorder.terminate();
    let left = names(&logs);
    assert!(
        left.contains(&name(2)) && left.contains(&name(3)),
        "{left:?}"
    );
    assert!(
        left.iter().any(|name| name.contains("-r000004-")),
        "{left:?}"
    );
}

#[test]
fn check_warns_of_limits_that_cannot_hold() {
    let directory = tempfile::tempdir().expect("a directory");
    let text = format!("{ABSENT}[storage]\nkeep_free_mb = 1e9\nquota_mb = 100\n");
    fs::write(directory.path().join("atvrec.toml"), text).expect("written");
    let check = atvrec(directory.path())
        .args(["check", "--no-devices"])
        .assert()
        .success();
    let text = stdout(&check);
    assert!(text.contains("keep_free_mb cannot be met"), "{text}");
    assert!(text.contains("quota_mb may be exceeded"), "{text}");
    let check = atvrec(directory.path())
        .args(["check", "--no-devices", "--json"])
        .assert();
    let check: serde_json::Value = serde_json::from_str(&stdout(&check)).expect("JSON");
    assert_eq!(check["warnings"].as_array().map(Vec::len), Some(2));
}

/// A receiver that sends an RMC sentence ten times a second, from 2041-02-03 04:05:06 UTC on.
struct GnssReceiver {
    device: PathBuf,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

/// 2041-02-03 04:05:06 UTC.
const RECEIVER_UNIX_S: i64 = 2_243_477_106;

impl GnssReceiver {
    fn start() -> Self {
        let mut port = acq::VirtualPort::new().expect("a pseudo-terminal");
        let device = port.path().to_owned();
        let stop = Arc::new(AtomicBool::new(false));
        let ended = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            let begin = Instant::now();
            let mut buffer = [0; 64];
            while !ended.load(Ordering::Relaxed) {
                let attended = !matches!(port.read(&mut buffer), Ok(acq::Heard::Nobody));
                let now_s = begin.elapsed().as_secs_f64();
                let text = format!(
                    "GPRMC,0405{:05.2},A,4807.038,N,01131.000,E,0.1,084.4,030241,,,A",
                    6.0 + now_s % 50.0
                );
                let mut sentence = Vec::new();
                wire::nmea::encode_sentence(&text, &mut sentence);
                if attended {
                    let _ = port.write(&sentence);
                }
                std::thread::sleep(Duration::from_millis(100));
            }
        });
        Self {
            device,
            stop,
            thread: Some(thread),
        }
    }
}

impl Drop for GnssReceiver {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn logs_of(directory: &Path, start: &str) -> Vec<PathBuf> {
    let names = names(directory).into_iter();
    let of_run = names.filter(|name| name.starts_with(start) && name.ends_with(".mcap"));
    of_run.map(|name| directory.join(name)).collect()
}

fn info(log: &Path) -> serde_json::Value {
    let directory = log.parent().expect("a directory");
    let assert = atvrec(directory).args(["info", "--json"]).arg(log).assert();
    serde_json::from_str(&stdout(&assert.success())).expect("JSON")
}

/// The names of all parts, `info` and `export` say 2041, `log_time` says what the computer said.
#[test]
fn a_receiver_gives_the_date_to_names_metadata_info_and_export() {
    let directory = tempfile::tempdir().expect("a directory");
    let receiver = GnssReceiver::start();
    let text = format!(
        "[source.gnss]\nkind = \"gnss\"\ndevice = \"{}\"\n[storage]\nrotate_after_s = 2\n",
        receiver.device.display()
    );
    fs::write(directory.path().join("atvrec.toml"), text).expect("written");
    let assert = atvrec(directory.path())
        .args(["record", "--for", "5", "--json"])
        .assert()
        .success();
    let summary: serde_json::Value = serde_json::from_str(&stdout(&assert)).expect("JSON");
    let logs = logs_of(
        &directory.path().join("logs"),
        "drive-r000001-20410203T0405",
    );
    assert!(
        logs.len() >= 2,
        "{:?}",
        names(&directory.path().join("logs"))
    );
    let told = summary["files"].as_array().expect("a list");
    assert_eq!(told.len(), logs.len());
    for log in told {
        let path = directory.path().join(log.as_str().expect("a path"));
        assert!(path.exists(), "{path:?}");
    }
    let info = info(&logs[1]);
    let offset_ns = info["utc_offset"]["offset_ns"].as_i64().expect("an offset");
    let start_ns = info["start_ns"].as_i64().expect("a time");
    let utc_s = (start_ns + offset_ns) / 1_000_000_000;
    assert!(
        (RECEIVER_UNIX_S..RECEIVER_UNIX_S + 30).contains(&utc_s),
        "{utc_s}"
    );
    assert_eq!(info["utc_start_ns"].as_i64(), Some(start_ns + offset_ns));
    let now_s = std::time::SystemTime::UNIX_EPOCH
        .elapsed()
        .expect("after 1970");
    assert!((start_ns / 1_000_000_000 - now_s.as_secs() as i64).abs() < 600);
    let export = atvrec(directory.path())
        .args(["export", "--topic", "/gnss/gnss/velocity"])
        .args(&logs)
        .assert()
        .success();
    let text = stdout(&export);
    assert!(
        text.lines()
            .next()
            .is_some_and(|heads| heads.ends_with(",utc_ns")),
        "{text}"
    );
    atvrec(directory.path())
        .args(["replay", "--verify"])
        .args(&logs)
        .assert()
        .success();
}

#[test]
fn a_killed_run_gets_its_date_at_the_next_start() {
    let directory = tempfile::tempdir().expect("a directory");
    let receiver = GnssReceiver::start();
    let config = directory.path().join("atvrec.toml");
    let text = format!(
        "[source.gnss]\nkind = \"gnss\"\ndevice = \"{}\"\n[storage]\nrotate_after_s = 2\n",
        receiver.device.display()
    );
    fs::write(&config, text).expect("written");
    let recorder = Background::start(directory.path());
    let logs = directory.path().join("logs");
    wait_for("the second part", || {
        names(&logs).iter().any(|name| name.contains("_0002.mcap"))
    });
    recorder.kill();
    drop(receiver);
    assert!(!names(&logs).iter().any(|name| name.contains("20410203")));
    fs::write(&config, ABSENT).expect("written");
    let recorder = Background::start(directory.path());
    wait_for("the renaming", || {
        logs_of(&logs, "drive-r000001-20410203T0405").len() >= 2
            && !names(&logs).iter().any(|name| name.ends_with(".rename"))
    });
    recorder.terminate();
    let own = names(&logs)
        .into_iter()
        .filter(|name| name.contains("-r000001-"));
    let own: Vec<_> = own.collect();
    assert!(
        own.iter().all(|name| name.contains("-20410203T0405")),
        "{own:?}"
    );
}
