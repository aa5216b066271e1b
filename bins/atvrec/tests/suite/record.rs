use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use crate::support::{ABSENT, NOTHING_RECEIVED, atvrec, stdout};

/// The virtual vehicle on its ports; ends with this.
pub struct Virtual(Child);

impl Virtual {
    pub fn start(directory: &Path) -> Self {
        Self::start_with(directory, &[])
    }

    fn start_with(directory: &Path, arguments: &[&str]) -> Self {
        let child = Self(
            Command::new(env!("CARGO_BIN_EXE_atvrec"))
                .args(["virtual", "--manoeuvre", "step-steer", "--repeat"])
                .args(["--directory", "ports"])
                .args(arguments)
                .current_dir(directory)
                .stdout(Stdio::null())
                .spawn()
                .expect("the virtual vehicle starts"),
        );
        let ready = directory.join("ports/atvrec.toml");
        for _ in 0..600 {
            if ready.exists() {
                return child;
            }
            std::thread::sleep(std::time::Duration::from_millis(50));
        }
        panic!("the virtual vehicle made no ports");
    }
}

impl Drop for Virtual {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

pub fn logs(directory: &Path) -> Vec<PathBuf> {
    let mut logs: Vec<PathBuf> = fs::read_dir(directory)
        .expect("the log directory")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|end| end == "mcap"))
        .collect();
    logs.sort();
    logs
}

#[test]
fn a_recording_of_the_virtual_vehicle_holds_every_source_and_replays_identically() {
    let directory = tempfile::tempdir().expect("a directory");
    let ports = Virtual::start(directory.path());
    let assert = atvrec(directory.path())
        .args([
            "record",
            "--config",
            "ports/atvrec.toml",
            "--for",
            "4",
            "--json",
        ])
        .assert()
        .success();
    drop(ports);
    let summary: serde_json::Value = serde_json::from_str(&stdout(&assert)).expect("JSON");
    for source in summary["sources"].as_array().expect("a list") {
        let messages = source["messages"].as_u64().unwrap_or_default();
        assert!(messages > 5, "{source:#}");
    }
    let logs = logs(&directory.path().join("ports/logs"));
    assert_eq!(logs.len(), 1, "{logs:?}");
    let assert = atvrec(directory.path())
        .arg("replay")
        .args(&logs)
        .args(["--verify", "--json"])
        .assert()
        .success();
    let result: serde_json::Value = serde_json::from_str(&stdout(&assert)).expect("JSON");
    assert_eq!(result["verify"]["identical"], true, "{result:#}");
    assert_eq!(
        result["missing"].as_array().map(Vec::len),
        Some(0),
        "{result:#}"
    );
    for topic in [
        "/imu/imu",
        "/gnss/novatel/velocity",
        "/steer",
        "/estimate/motion",
    ] {
        let compared = result["verify"]["compared"][topic].as_u64();
        assert!(
            compared.is_some_and(|count| count > 5),
            "{topic}: {compared:?}"
        );
    }
}

#[test]
fn a_missing_device_is_told_and_does_not_keep_the_others_from_recording() {
    let directory = tempfile::tempdir().expect("a directory");
    let text = "[source.imu]\nkind = \"crossbow440\"\ndevice = \"absent\"\n\
                [storage]\ndirectory = \"logs\"\n";
    fs::write(directory.path().join("atvrec.toml"), text).expect("written");
    let assert = atvrec(directory.path())
        .args(["record", "--for", "0.5"])
        .assert()
        .code(NOTHING_RECEIVED);
    let text = stdout(&assert);
    assert!(text.contains("nothing received"), "{text}");
    let last = text.lines().last();
    assert!(
        last.is_some_and(|line| line.starts_with("nothing was received")),
        "{text}"
    );
    assert_eq!(logs(&directory.path().join("logs")).len(), 1);
    let assert = atvrec(directory.path())
        .args(["check", "--listen-s", "0.3"])
        .assert()
        .code(1);
    let text = stdout(&assert);
    assert!(text.contains("not open"), "{text}");
}

#[test]
fn parts_of_a_run_replay_as_one_log() {
    let directory = tempfile::tempdir().expect("a directory");
    let ports = Virtual::start(directory.path());
    let config = directory.path().join("ports/atvrec.toml");
    let text = fs::read_to_string(&config).expect("the configuration");
    fs::write(&config, format!("{text}rotate_after_s = 1\n")).expect("written");
    atvrec(directory.path())
        .args(["record", "--config", "ports/atvrec.toml", "--for", "3.5"])
        .assert()
        .success();
    drop(ports);
    let logs = logs(&directory.path().join("ports/logs"));
    assert!(logs.len() >= 3, "{logs:?}");
    // Each part begins where it was begun, though it repeats what lasts from the run's start.
    let begin_s = logs.iter().map(|log| {
        let info = atvrec(directory.path())
            .args(["info", "--json"])
            .arg(log)
            .assert()
            .success();
        let info: serde_json::Value = serde_json::from_str(&stdout(&info)).expect("JSON");
        1e-9 * info["start_ns"].as_f64().expect("a time")
    });
    let begin_s: Vec<f64> = begin_s.collect();
    assert!(
        begin_s.windows(2).all(|pair| pair[1] > pair[0] + 0.5),
        "{begin_s:?}"
    );
    let assert = atvrec(directory.path())
        .arg("replay")
        .args(&logs)
        .args(["--verify", "--json"])
        .assert()
        .success();
    let result: serde_json::Value = serde_json::from_str(&stdout(&assert)).expect("JSON");
    assert_eq!(result["verify"]["identical"], true, "{result:#}");
    assert_eq!(
        result["missing"].as_array().map(Vec::len),
        Some(0),
        "{result:#}"
    );
}

/// A SLCAN adapter whose queue overran: it says so whenever it is asked.
fn overrun_adapter(stop: Arc<AtomicBool>) -> (PathBuf, JoinHandle<()>) {
    let mut port = acq::VirtualPort::new().expect("a pseudo-terminal");
    let path = port.path().to_owned();
    let thread = std::thread::spawn(move || {
        let mut buffer = [0; 64];
        while !stop.load(Ordering::Relaxed) {
            if let acq::Heard::Bytes(count) = port.read(&mut buffer).expect("read")
                && buffer[..count].contains(&b'F')
            {
                port.write(b"t1102ABCD\rF01\r").expect("write");
            }
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
    });
    (path, thread)
}

#[test]
fn loss_in_a_device_is_counted_by_place_and_gives_exit_code_3() {
    let directory = tempfile::tempdir().expect("a directory");
    let stop = Arc::new(AtomicBool::new(false));
    let (device, adapter) = overrun_adapter(Arc::clone(&stop));
    let text = format!(
        "[source.can0]\nkind = \"slcan\"\ndevice = \"{}\"\n",
        device.display()
    );
    fs::write(directory.path().join("atvrec.toml"), text).expect("written");
    let assert = atvrec(directory.path())
        .args(["record", "--for", "2", "--json"])
        .assert()
        .code(3);
    stop.store(true, Ordering::Relaxed);
    adapter.join().expect("the adapter ends");
    let summary: serde_json::Value = serde_json::from_str(&stdout(&assert)).expect("JSON");
    let lost = summary["lost"]["device"].as_u64().unwrap_or_default();
    assert!(lost > 0, "{summary:#}");
    assert_eq!(summary["lost"]["queue"], 0, "{summary:#}");
    // The count is in the file, too.
    let logs = logs(&directory.path().join("logs"));
    let assert = atvrec(directory.path())
        .arg("info")
        .args(&logs)
        .arg("--json")
        .assert()
        .success();
    let info: serde_json::Value = serde_json::from_str(&stdout(&assert)).expect("JSON");
    assert_eq!(info["counters"]["lost.can0.device"], lost, "{info:#}");
}

#[test]
fn an_unfinished_log_is_made_whole_by_the_next_start() {
    let directory = tempfile::tempdir().expect("a directory");
    let whole = crate::support::simulate(directory.path(), "drive.mcap", 1);
    let bytes = fs::read(&whole).expect("a log");
    fs::create_dir(directory.path().join("logs")).expect("a directory");
    let unfinished = directory.path().join("logs/old.mcap.active");
    fs::write(&unfinished, &bytes[..bytes.len() / 2]).expect("written");
    fs::write(directory.path().join("atvrec.toml"), ABSENT).expect("written");
    // Beside the recording, which a stop does not wait for.
    for _ in 0..20 {
        atvrec(directory.path())
            .args(["record", "--for", "1"])
            .assert()
            .code(NOTHING_RECEIVED);
        if !unfinished.exists() {
            break;
        }
    }
    assert!(!unfinished.exists());
    atvrec(directory.path())
        .args(["replay", "logs/old.mcap", "--verify"])
        .assert()
        .success();
}

#[test]
fn marks_and_state_go_through_the_control_socket() {
    let directory = tempfile::tempdir().expect("a directory");
    fs::write(directory.path().join("atvrec.toml"), ABSENT).expect("written");
    let assert = atvrec(directory.path())
        .args(["mark", "nobody"])
        .assert()
        .code(1);
    let text = crate::support::stderr(&assert);
    assert!(text.contains("cannot connect to a recorder"), "{text}");

    let mut recorder = Recorder::start(directory.path());
    atvrec(directory.path())
        .args(["mark", "gravel begins"])
        .assert()
        .success();
    let assert = atvrec(directory.path())
        .args(["status", "--json"])
        .assert()
        .success();
    let status: serde_json::Value = serde_json::from_str(&stdout(&assert)).expect("JSON");
    assert_eq!(status["disk"]["state"], "writing");
    recorder.terminate();
    let logs = logs(&directory.path().join("logs"));
    let reader = store::Reader::open(&logs).expect("the log opens");
    let marks: Vec<String> = reader
        .messages(store::Selection::topics(["/mark"]))
        .filter_map(|message| message.expect("a message").record().expect("a record"))
        .filter_map(|record| match record {
            store::Record::Mark { text, .. } => Some(text),
            _ => None,
        })
        .collect();
    assert_eq!(marks, ["gravel begins"]);
    atvrec(directory.path()).arg("status").assert().code(1);
}

/// Every arrival of a log, and what its parts lack.
fn arrivals(log: &Path) -> Vec<sample::Arrival> {
    let reader = store::Reader::open([log]).expect("the log opens");
    assert_eq!(reader.info().missing, []);
    reader
        .arrivals()
        .collect::<Result<_, _>>()
        .expect("readable")
}

/// Every packet of an inertial unit that counts them: a byte that rises with each read.
struct Counting {
    device: PathBuf,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<u32>>,
}

impl Counting {
    fn start() -> Self {
        let mut port = acq::VirtualPort::new().expect("a pseudo-terminal");
        let device = port.path().to_owned();
        let stop = Arc::new(AtomicBool::new(false));
        let ended = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            let (mut buffer, mut count) = ([0; 64], 0_u32);
            while !ended.load(Ordering::Relaxed) {
                let attended = !matches!(port.read(&mut buffer), Ok(acq::Heard::Nobody));
                if attended && port.write(&count.to_be_bytes()).is_ok_and(|n| n == 4) {
                    count += 1;
                }
                std::thread::sleep(std::time::Duration::from_millis(1));
            }
            // What nobody has read yet goes with the terminal.
            std::thread::sleep(std::time::Duration::from_millis(300));
            count
        });
        Self {
            device,
            stop,
            thread: Some(thread),
        }
    }

    /// Ends it; gives the number of counts that were sent.
    fn end(&mut self) -> u32 {
        self.stop.store(true, Ordering::Relaxed);
        let thread = self.thread.take().expect("ended once");
        thread.join().expect("it ends")
    }

    /// The counts in the logs' bytes of the source with this name.
    fn counts(logs: &[PathBuf], name: &str) -> Vec<u32> {
        let mut bytes = Vec::new();
        for log in logs {
            let reader = store::Reader::open([log]).expect("the log opens");
            for arrival in arrivals(log) {
                if let sample::Payload::Bytes(read) = &arrival.payload
                    && reader.session().source_name(arrival.source) == name
                {
                    bytes.extend(read);
                }
            }
        }
        let words = bytes.chunks_exact(4);
        words
            .map(|word| u32::from_be_bytes(word.try_into().expect("four")))
            .collect()
    }

    fn configuration(&self, name: &str) -> String {
        format!(
            "[source.{name}]\nkind = \"gnss\"\ndevice = \"{}\"\n",
            self.device.display()
        )
    }
}

/// A source is added, whose name changes the numbers of the others, while one goes on sending: its
/// bytes stand in the run of before or in the run of after, each once.
#[test]
fn a_reload_loses_nothing_of_what_runs_on() {
    let directory = tempfile::tempdir().expect("a directory");
    let (mut first, mut second) = (Counting::start(), Counting::start());
    let config = directory.path().join("atvrec.toml");
    let control = "[control]\nsocket = \"control\"\n";
    fs::write(&config, first.configuration("middle") + control).expect("written");
    let mut recorder = Recorder::start(directory.path());
    std::thread::sleep(std::time::Duration::from_millis(500));
    fs::write(&config, "[source.middle]\nkind = \"wrong\"\n").expect("written");
    let refused = atvrec(directory.path())
        .arg("reload")
        .args(["--socket", "control"])
        .assert()
        .code(1);
    assert!(crate::support::stderr(&refused).contains("is not a kind of source"));
    let both = first.configuration("middle") + &second.configuration("added") + control;
    fs::write(&config, both).expect("written");
    atvrec(directory.path()).arg("reload").assert().success();
    std::thread::sleep(std::time::Duration::from_millis(500));
    // The same again by signal.
    signal(&recorder.0, "-HUP");
    std::thread::sleep(std::time::Duration::from_millis(700));
    let (sent, _) = (first.end(), second.end());
    std::thread::sleep(std::time::Duration::from_millis(300));
    recorder.terminate();
    let logs = logs(&directory.path().join("logs"));
    assert_eq!(logs.len(), 3, "{logs:?}");
    let counts = Counting::counts(&logs, "middle");
    let in_order = counts.iter().copied().eq(0..sent);
    assert!(in_order, "{} of {sent}, or in another order", counts.len());
    assert!(!Counting::counts(&logs[1..], "added").is_empty());
    for log in &logs {
        atvrec(directory.path())
            .args(["replay", "--verify"])
            .arg(log)
            .assert()
            .success();
    }
}

#[test]
fn writing_stops_and_starts_while_the_sources_go_on() {
    let directory = tempfile::tempdir().expect("a directory");
    let mut source = Counting::start();
    let config = directory.path().join("atvrec.toml");
    fs::write(&config, source.configuration("port")).expect("written");
    let mut recorder = Recorder::start(directory.path());
    let order = |verb: &str| atvrec(directory.path()).arg(verb).assert().success();
    std::thread::sleep(std::time::Duration::from_millis(300));
    assert_eq!(stdout(&order("stop")), "stopped\n");
    // The file is whole as soon as the order is obeyed.
    let first = logs(&directory.path().join("logs"));
    assert_eq!(first.len(), 1, "{first:?}");
    let items = || {
        let status: serde_json::Value = serde_json::from_str(&stdout(
            &atvrec(directory.path())
                .args(["status", "--json"])
                .assert()
                .success(),
        ))
        .expect("JSON");
        status["sources"][0]["items"].as_u64().expect("a count")
    };
    let before = items();
    std::thread::sleep(std::time::Duration::from_millis(300));
    assert!(items() > before, "the source goes on");
    assert_eq!(stdout(&order("start")), "recording\n");
    std::thread::sleep(std::time::Duration::from_millis(300));
    recorder.terminate();
    source.end();
    let all = logs(&directory.path().join("logs"));
    assert_eq!(all.len(), 2, "{all:?}");
    let (first, second) = (
        Counting::counts(&all[..1], "port"),
        Counting::counts(&all[1..], "port"),
    );
    assert!(first.last() < second.first(), "{first:?} {second:?}");
    assert!(second.windows(2).all(|pair| pair[0] + 1 == pair[1]));
    atvrec(directory.path())
        .args(["replay", "--verify"])
        .arg(&all[1])
        .assert()
        .success();
}

#[test]
fn a_trigger_keeps_what_was_before_it_and_what_comes_after() {
    let directory = tempfile::tempdir().expect("a directory");
    let mut source = Counting::start();
    let config = directory.path().join("atvrec.toml");
    let trigger = "[storage.trigger]\npre_s = 3.0\npost_s = 0.5\n";
    fs::write(&config, source.configuration("port") + trigger).expect("written");
    let mut recorder = Recorder::start(directory.path());
    let logs_there = directory.path().join("logs");
    // The source must be open for longer than what a log keeps before its trigger.
    std::thread::sleep(std::time::Duration::from_secs(6));
    assert_eq!(logs(&logs_there).len(), 0);
    let mark = || {
        atvrec(directory.path())
            .args(["mark", "here"])
            .assert()
            .success()
    };
    mark();
    for _ in 0..100 {
        if !logs(&logs_there).is_empty() {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(100));
    }
    mark();
    std::thread::sleep(std::time::Duration::from_millis(100));
    recorder.terminate();
    source.end();
    let logs = logs(&logs_there);
    assert_eq!(logs.len(), 2, "{logs:?}");
    for log in &logs {
        let arrivals = arrivals(log);
        let is_mark = |a: &&sample::Arrival| {
            matches!(a.payload, sample::Payload::Notice(sample::Notice::Mark(_)))
        };
        let mark = arrivals.iter().find(is_mark).expect("the mark is in it");
        let (first, last) = (&arrivals[0], &arrivals[arrivals.len() - 1]);
        let before_s = mark.log_time.seconds_since(first.log_time);
        // On a busy machine, nothing arrives for a while, and what arrived before is older than 3 s.
        assert!((1.0..=3.0).contains(&before_s), "{before_s} s before");
        if log == &logs[0] {
            let after_s = last.log_time.seconds_since(mark.log_time);
            assert!((0.4..5.0).contains(&after_s), "{after_s} s after");
        }
        let opened = matches!(
            &first.payload,
            sample::Payload::Notice(sample::Notice::Opened(_))
        );
        assert!(opened, "the source is known to be open: {first:?}");
        let counts = Counting::counts(std::slice::from_ref(log), "port");
        assert!(counts.len() > 100, "{}", counts.len());
        assert!(
            counts.windows(2).all(|pair| pair[0] + 1 == pair[1]),
            "{counts:?}"
        );
        atvrec(directory.path())
            .args(["replay", "--verify"])
            .arg(log)
            .assert()
            .success();
    }
}

/// A SLCAN adapter that sends a frame every few milliseconds, and one that is asked for.
struct Bus {
    device: PathBuf,
    ask: std::sync::mpsc::Sender<&'static [u8]>,
    thread: JoinHandle<()>,
}

impl Bus {
    fn start() -> Self {
        let mut port = acq::VirtualPort::new().expect("a pseudo-terminal");
        let device = port.path().to_owned();
        let (ask, asked) = std::sync::mpsc::channel::<&'static [u8]>();
        let thread = std::thread::spawn(move || {
            let mut buffer = [0; 64];
            loop {
                let attended = !matches!(port.read(&mut buffer), Ok(acq::Heard::Nobody));
                let line = match asked.recv_timeout(std::time::Duration::from_millis(4)) {
                    Ok(line) => line,
                    Err(std::sync::mpsc::RecvTimeoutError::Timeout) => b"t1232ABCD\r",
                    Err(std::sync::mpsc::RecvTimeoutError::Disconnected) => return,
                };
                if attended {
                    port.write(line).expect("write");
                }
            }
        });
        Self {
            device,
            ask,
            thread,
        }
    }

    fn send(&self, line: &'static [u8]) {
        self.ask.send(line).expect("the adapter runs");
    }

    fn end(self) {
        drop(self.ask);
        self.thread.join().expect("the adapter ends");
    }
}

/// Waits for the first log of a directory.
fn first_log(directory: &Path) -> PathBuf {
    for _ in 0..300 {
        if let Some(log) = logs(directory).first() {
            return log.clone();
        }
        std::thread::sleep(std::time::Duration::from_millis(100));
    }
    panic!("the trigger wrote no log");
}

#[test]
fn a_frame_with_the_right_identifier_and_data_is_a_trigger() {
    let directory = tempfile::tempdir().expect("a directory");
    let bus = Bus::start();
    let config = format!(
        "[source.can0]\nkind = \"slcan\"\ndevice = \"{}\"\n\
         [storage.trigger]\npre_s = 0.6\npost_s = 0.5\n\
         [storage.trigger.can.brake]\nsource = \"can0\"\nid = 0x321\ndata = \"01\"\n",
        bus.device.display()
    );
    fs::write(directory.path().join("atvrec.toml"), config).expect("written");
    let mut recorder = Recorder::start(directory.path());
    let logs_there = directory.path().join("logs");
    bus.send(b"t321102\r");
    std::thread::sleep(std::time::Duration::from_millis(1_500));
    assert_eq!(logs(&logs_there).len(), 0, "other data is no trigger");
    bus.send(b"t321101\r");
    let log = first_log(&logs_there);
    recorder.terminate();
    bus.end();
    let arrivals = arrivals(&log);
    let brake = |arrival: &sample::Arrival| match &arrival.payload {
        sample::Payload::Can(frames) => frames.iter().any(|frame| frame.id == 0x321),
        _ => false,
    };
    let met: Vec<_> = arrivals.iter().filter(|arrival| brake(arrival)).collect();
    assert_eq!(met.len(), 1, "{met:?}");
    let before_s = met[0].log_time.seconds_since(arrivals[0].log_time);
    let after_s = arrivals[arrivals.len() - 1]
        .log_time
        .seconds_since(met[0].log_time);
    assert!((0.5..=0.6).contains(&before_s), "{before_s} s before");
    assert!((0.4..5.0).contains(&after_s), "{after_s} s after");
    assert_eq!(logs(&logs_there), [log]);
}

#[test]
fn an_event_of_the_estimator_is_a_trigger() {
    let directory = tempfile::tempdir().expect("a directory");
    let options =
        "[[faults.channel]]\nwheel = \"front_left\"\nchannel = \"upper_front\"\nkind = \"dead\"\n";
    fs::write(directory.path().join("faults.toml"), options).expect("written");
    let ports = Virtual::start_with(directory.path(), &["--options", "faults.toml"]);
    let config = fs::read_to_string(directory.path().join("ports/atvrec.toml")).expect("text");
    let trigger = "[storage.trigger]\npre_s = 0.6\npost_s = 3\nevents = [\"sensor_fault\"]\n";
    // Devices stand beside the configuration.
    let folder = directory.path().join("ports");
    fs::write(folder.join("atvrec.toml"), config + trigger).expect("written");
    let mut recorder = Recorder::start(&folder);
    let mut writing = String::new();
    for _ in 0..300 {
        let status = atvrec(&folder).arg("status").assert().success();
        writing = stdout(&status);
        if writing.contains("triggered by channel") {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(100));
    }
    // On a busy machine the late bytes of another device can be a fault before the dead channel is.
    assert!(writing.contains("triggered by channel"), "{writing}");
    recorder.terminate();
    drop(ports);
    let logs = logs(&folder.join("logs"));
    let run = arrivals(&logs[0]);
    let span_s = run[run.len() - 1].log_time.seconds_since(run[0].log_time);
    assert!(span_s > 0.5, "{span_s} s");
    atvrec(&folder)
        .args(["replay", "--verify"])
        .arg(&logs[0])
        .assert()
        .success();
}

pub fn signal(child: &Child, signal: &str) {
    let status = Command::new("kill")
        .args([signal, &child.id().to_string()])
        .status()
        .expect("kill runs");
    assert!(status.success());
}

/// A recorder in the background.
struct Recorder(Child);

impl Recorder {
    fn start(directory: &Path) -> Self {
        let recorder = Self(
            Command::new(env!("CARGO_BIN_EXE_atvrec"))
                .args(["--quiet", "record"])
                .current_dir(directory)
                .stdout(Stdio::null())
                .spawn()
                .expect("the recorder starts"),
        );
        for _ in 0..600 {
            let status = atvrec(directory).arg("status").output().expect("it runs");
            if status.status.success() {
                return recorder;
            }
            std::thread::sleep(std::time::Duration::from_millis(50));
        }
        panic!("the recorder does not listen");
    }

    /// Ends it as a service manager does.
    fn terminate(&mut self) {
        signal(&self.0, "-TERM");
        let status = self.0.wait().expect("the recorder ends");
        // 3 where no device sends.
        let code = status.code();
        assert!(matches!(code, Some(0 | NOTHING_RECEIVED)), "{code:?}");
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_log_directory_that_cannot_be_made_is_named() {
    let directory = tempfile::tempdir().expect("a directory");
    fs::write(directory.path().join("file"), "").expect("written");
    fs::write(
        directory.path().join("atvrec.toml"),
        format!("{ABSENT}[storage]\ndirectory = \"file/logs\"\n"),
    )
    .expect("written");
    let assert = atvrec(directory.path()).arg("record").assert().code(1);
    let text = crate::support::stderr(&assert);
    assert!(text.contains("file/logs"), "{text}");
    assert!(text.contains("storage.directory"), "{text}");
}
