//! Input that is broken or hostile must not stop, mislead or exhaust the recorder.

use std::fs;
use std::io::{Read, Write};
use std::os::unix::fs::{FileTypeExt, PermissionsExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::support::{ABSENT, NOTHING_RECEIVED, atvrec, stderr, stdout};

/// A recorder of one absent device; killed with this.
pub struct Recorder {
    child: Child,
    directory: PathBuf,
}

impl Recorder {
    pub fn start(directory: &Path, config: &str) -> Self {
        Self::start_until(directory, config, "recording;")
    }

    /// Starts it and waits for a message.
    fn start_until(directory: &Path, config: &str, message: &str) -> Self {
        fs::write(directory.join("atvrec.toml"), config).expect("written");
        let runtime = directory.join("run");
        fs::create_dir_all(&runtime).expect("made");
        let errors = fs::File::create(directory.join("stderr")).expect("made");
        let child = Command::new(env!("CARGO_BIN_EXE_atvrec"))
            .args(["record", "--for", "60"])
            .current_dir(directory)
            .env("XDG_RUNTIME_DIR", runtime)
            .env_remove("ATVREC_LOG")
            .stdout(Stdio::null())
            .stderr(errors)
            .spawn()
            .expect("the recorder starts");
        let recorder = Self {
            child,
            directory: directory.to_owned(),
        };
        recorder.wait_for(message);
        recorder.wait_for("control socket");
        recorder
    }

    fn errors(&self) -> String {
        let bytes = fs::read(self.directory.join("stderr")).expect("there");
        String::from_utf8_lossy(&bytes).into_owned()
    }

    pub fn wait_for(&self, text: &str) {
        let start = Instant::now();
        while !self.errors().contains(text) {
            let waited = start.elapsed();
            assert!(
                waited < Duration::from_secs(20),
                "{text}: {}",
                self.errors()
            );
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    pub fn ask(&self, arguments: &[&str]) -> assert_cmd::Command {
        let mut command = atvrec(&self.directory);
        command
            .args(arguments)
            .env("XDG_RUNTIME_DIR", self.directory.join("run"));
        command
    }

    /// Ends it as systemd does and gives the exit code.
    pub fn stop(mut self) -> Option<i32> {
        let id = self.child.id().to_string();
        let kill = Command::new("kill").args(["-TERM", &id]).status();
        assert!(kill.expect("kill runs").success());
        self.child.wait().expect("it ends").code()
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

const SOURCE: &str = ABSENT;

fn with_socket(path: &str) -> String {
    format!("{SOURCE}[control]\nsocket = \"{path}\"\n")
}

#[test]
fn the_control_socket_replaces_no_file_and_recording_goes_on_without_it() {
    let long = format!("{}/control", "d".repeat(120));
    for (socket, reason) in [
        ("atvrec.toml", "not a socket"),
        ("notes", "not a socket"),
        (long.as_str(), "too long"),
        ("absent/control", "cannot create"),
        ("/proc/control", "cannot create"),
    ] {
        let directory = tempfile::tempdir().expect("a directory");
        let config = with_socket(socket);
        fs::write(directory.path().join("notes"), "of a person").expect("written");
        let recorder = Recorder::start(directory.path(), &config);
        let errors = recorder.errors();
        assert!(
            errors.contains("WARN") && errors.contains(reason),
            "{socket}: {errors}"
        );
        assert_eq!(recorder.stop(), Some(NOTHING_RECEIVED));
        let left = fs::read_to_string(directory.path().join("atvrec.toml")).expect("there");
        assert_eq!(left, config);
        let left = fs::read_to_string(directory.path().join("notes")).expect("there");
        assert_eq!(left, "of a person");
    }
}

#[test]
fn recorders_find_their_own_sockets_and_a_live_one_is_not_stolen() {
    let directories = [(); 2].map(|()| tempfile::tempdir().expect("a directory"));
    let recorders = directories
        .each_ref()
        .map(|directory| Recorder::start(directory.path(), SOURCE));
    for recorder in &recorders {
        let status = recorder.ask(&["status", "--json"]).assert().success();
        let status: serde_json::Value = serde_json::from_str(&stdout(&status)).expect("JSON");
        let file = status["disk"]["detail"].as_str().expect("a file");
        assert!(
            recorder
                .directory
                .join(file)
                .parent()
                .is_some_and(Path::exists)
        );
    }
    // One socket for several recorders: the first keeps it, the others record without one.
    let third = tempfile::tempdir().expect("a directory");
    let socket = third.path().join("shared");
    let first = Recorder::start(third.path(), &with_socket("shared"));
    let mode = socket.metadata().expect("there").permissions().mode();
    assert_eq!(mode & 0o777, 0o660);
    for _ in 0..2 {
        let other = tempfile::tempdir().expect("a directory");
        let config = with_socket(&socket.display().to_string());
        let other = Recorder::start(other.path(), &config);
        assert!(
            other.errors().contains("another recorder"),
            "{}",
            other.errors()
        );
        drop(other);
    }
    first.ask(&["mark", "still there"]).assert().success();
    assert_eq!(first.stop(), Some(NOTHING_RECEIVED));
    assert!(!socket.exists());
    for recorder in recorders {
        assert_eq!(recorder.stop(), Some(NOTHING_RECEIVED));
    }
}

#[test]
fn a_socket_without_a_recorder_is_replaced() {
    let directory = tempfile::tempdir().expect("a directory");
    drop(UnixListener::bind(directory.path().join("control")).expect("bound"));
    let recorder = Recorder::start(directory.path(), &with_socket("control"));
    recorder.ask(&["mark", "here"]).assert().success();
    let found = directory.path().join("control").metadata().expect("there");
    assert!(found.file_type().is_socket());
    assert_eq!(recorder.stop(), Some(NOTHING_RECEIVED));
}

#[test]
fn clients_that_ask_nothing_or_read_nothing_do_not_stop_marks() {
    let directory = tempfile::tempdir().expect("a directory");
    let recorder = Recorder::start(directory.path(), &with_socket("control"));
    let socket = directory.path().join("control");
    let mut clients = Vec::new();
    for number in 0..900 {
        let Ok(mut client) = UnixStream::connect(&socket) else {
            continue;
        };
        if number % 3 == 1 {
            client.write_all(b"{\"command\":").expect("written");
        }
        clients.push(client);
    }
    recorder.ask(&["mark", "among many"]).assert().success();
    let open = fs::read_dir(format!("/proc/{}/fd", recorder.child.id())).expect("there");
    let open = open.count();
    assert!(open < 64 + 60, "{open} files are open");
    // A request without an end is refused, one of another kind is answered.
    let mut client = UnixStream::connect(&socket).expect("connected");
    client
        .set_read_timeout(Some(Duration::from_secs(5)))
        .expect("set");
    let _ = client.write_all(&vec![b'x'; 1 << 20]);
    let mut answer = String::new();
    let _ = client.read_to_string(&mut answer);
    assert!(answer.contains("longer than"), "{answer}");
    let mut client = UnixStream::connect(&socket).expect("connected");
    client
        .set_read_timeout(Some(Duration::from_secs(5)))
        .expect("set");
    client.write_all(b"\xff\xfe{}\n").expect("written");
    let mut answer = String::new();
    client.read_to_string(&mut answer).expect("an answer");
    assert!(answer.contains("not valid"), "{answer}");
    // An idle client is closed after 10 s.
    let mut idle = UnixStream::connect(&socket).expect("connected");
    let start = Instant::now();
    idle.set_read_timeout(Some(Duration::from_secs(15)))
        .expect("set");
    let read = idle.read(&mut [0; 8]).expect("closed, not timed out");
    let waited = start.elapsed();
    assert_eq!(read, 0);
    assert!((8.0..14.0).contains(&waited.as_secs_f64()), "{waited:?}");
    drop(clients);
    assert_eq!(recorder.stop(), Some(NOTHING_RECEIVED));
}

/// Marks with control characters, which a trigger puts into messages.
const HOSTILE_MARK: &str = "go\n<0>forged \u{1b}[31mred\u{9b}2J \u{202e}back";

#[test]
fn marks_reach_neither_journal_nor_terminal_as_control_characters() {
    let directory = tempfile::tempdir().expect("a directory");
    let config = format!(
        "{SOURCE}[storage]\ndirectory = \"logs\"\n[storage.trigger]\nmark = true\n\
         [control]\nsocket = \"control\"\n"
    );
    let recorder = Recorder::start_until(directory.path(), &config, "waiting for a trigger");
    recorder.ask(&["mark", HOSTILE_MARK]).assert().success();
    recorder.wait_for("triggered");
    let status = recorder.ask(&["status"]).assert().success();
    for text in [recorder.errors(), stdout(&status)] {
        assert!(text.contains("forged"), "{text}");
        assert!(!text.lines().any(|line| line.starts_with("<0>")), "{text}");
        assert!(!text.contains(['\u{1b}', '\u{9b}', '\u{202e}']), "{text}");
    }
    // The log keeps the original text.
    assert_eq!(recorder.stop(), Some(NOTHING_RECEIVED));
    let log = fs::read_dir(directory.path().join("logs")).expect("there");
    let log = log
        .map(|entry| entry.expect("an entry").path())
        .find(|path| path.extension().is_some_and(|end| end == "mcap"))
        .expect("a log");
    let exported = atvrec(directory.path())
        .arg("export")
        .arg(&log)
        .args(["--topic", "/mark", "--output", "mark.csv"])
        .assert();
    let errors = stderr(&exported);
    exported.success();
    let cells = fs::read_to_string(directory.path().join("mark.csv")).expect("there");
    assert!(!cells.contains(['\u{1b}', '\u{202e}']), "{cells} {errors}");
    let reader = store::Reader::open([&log]).expect("the log opens");
    let marks: Vec<String> = reader
        .messages(store::Selection::topics(["/mark"]))
        .filter_map(|message| message.expect("a message").record().expect("a record"))
        .filter_map(|record| match record {
            store::Record::Mark { text, .. } => Some(text),
            _ => None,
        })
        .collect();
    assert_eq!(marks, [HOSTILE_MARK]);
}

#[test]
fn reload_of_an_empty_or_broken_file_or_a_fifo_changes_nothing() {
    let directory = tempfile::tempdir().expect("a directory");
    let recorder = Recorder::start(directory.path(), &with_socket("control"));
    let config = directory.path().join("atvrec.toml");
    let good = fs::read_to_string(&config).expect("there");
    let huge = format!("{good}\n#{}\n", "x".repeat(32 << 20));
    for (text, reason) in [
        ("", "empty"),
        ("  \n# only a comment\n", "empty"),
        ("[source.imu\n", "error"),
        (&huge, "longer than"),
    ] {
        fs::write(&config, text).expect("written");
        let reload = recorder.ask(&["reload", "--socket", "control"]).assert();
        let text = stderr(&reload);
        assert!(text.contains(reason), "{reason}: {text}");
        reload.failure();
    }
    fs::remove_file(&config).expect("removed");
    let made = Command::new("mkfifo").arg(&config).status();
    assert!(made.expect("mkfifo runs").success());
    let start = Instant::now();
    let reload = recorder.ask(&["reload", "--socket", "control"]).assert();
    assert!(start.elapsed() < Duration::from_secs(5));
    assert!(
        stderr(&reload).contains("not a regular file"),
        "{}",
        stderr(&reload)
    );
    fs::remove_file(&config).expect("removed");
    let id = recorder.child.id().to_string();
    let hangup = Command::new("kill").args(["-HUP", &id]).status();
    assert!(hangup.expect("kill runs").success());
    recorder.wait_for("ERROR");
    let status = recorder
        .ask(&["status", "--socket", "control"])
        .assert()
        .success();
    assert!(
        stdout(&status).starts_with("recording"),
        "{}",
        stdout(&status)
    );
    assert!(stdout(&status).contains("imu"), "{}", stdout(&status));
    assert_eq!(recorder.stop(), Some(NOTHING_RECEIVED));
}

/// The program's unit for one interface, as systemd expands it.
fn can_unit(instance: &str, program: &str) -> String {
    let unit = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../packaging/atvrec-can@.service");
    let unit = fs::read_to_string(unit).expect("the unit");
    let slashed = instance.replace('-', "/");
    unit.replace("%i", instance)
        .replace("%I", &slashed)
        .replace("/usr/bin/atvrec", program)
}

#[test]
fn the_unit_of_a_can_interface_with_a_dash_names_it() {
    let program = env!("CARGO_BIN_EXE_atvrec");
    let unit = can_unit("can-left", program);
    let start = unit
        .lines()
        .find_map(|line| line.strip_prefix("ExecStart="));
    let start = start.expect("a command");
    assert!(start.ends_with(" can-left"), "{start}");
    assert!(
        !unit.contains("net-devices"),
        "its name would have to be escaped"
    );

    let directory = tempfile::tempdir().expect("a directory");
    let config = "[source.left]\nkind = \"can\"\ninterface = \"can-left\"\nlink.bitrate = 500000\n";
    fs::write(directory.path().join("atvrec.toml"), config).expect("written");
    // The interface is not there: whoever tries it says so.
    for (name, code) in [("can-left", 1), ("can\\x2dleft", 1), ("can-right", 0)] {
        let link = atvrec(directory.path())
            .args(["link", name])
            .assert()
            .code(code);
        assert_eq!(stderr(&link).contains("can-left"), code == 1, "{name}");
    }

    fs::write(directory.path().join("atvrec-can@can-left.service"), unit).expect("written");
    let verify = Command::new("systemd-analyze")
        .args(["verify", "--man=no", "./atvrec-can@can-left.service"])
        .current_dir(directory.path())
        .output();
    match verify {
        Ok(output) => {
            let text = String::from_utf8_lossy(&output.stderr);
            assert!(!text.contains("atvrec-can@"), "{text}");
        }
        Err(error) => eprintln!("SKIPPED: systemd-analyze: {error}"),
    }
}

/// A device that repeats the same error is limited, and what is left out is counted.
#[test]
fn equal_messages_are_limited_and_counted() {
    let directory = tempfile::tempdir().expect("a directory");
    let config = format!(
        "{SOURCE}[storage]\ndirectory = \"logs\"\n[storage.trigger]\nmark = true\npost_s = 0.1\n\
         [control]\nsocket = \"control\"\n"
    );
    let recorder = Recorder::start_until(directory.path(), &config, "waiting for a trigger");
    for number in 0..12 {
        let text = format!("number {number}");
        recorder.ask(&["mark", &text]).assert().success();
        std::thread::sleep(Duration::from_millis(400));
    }
    let during = recorder.errors();
    let printed = during
        .lines()
        .filter(|line| line.contains("triggered reason"))
        .count();
    assert!((1..=5).contains(&printed), "{during}");
    recorder.wait_for("more times in 10 s");
}

/// A log whose texts are hostile, as a person or another program could have made it.
fn hostile_log(directory: &Path) -> PathBuf {
    let config =
        format!("{SOURCE}[storage]\ndirectory = \"logs\"\n[control]\nsocket = \"control\"\n");
    let recorder = Recorder::start(directory, &config);
    for text in [
        HOSTILE_MARK,
        "=HYPERLINK(\"http://x\")",
        "</script><!--<script>alert(1)",
    ] {
        recorder.ask(&["mark", text]).assert().success();
    }
    assert_eq!(recorder.stop(), Some(NOTHING_RECEIVED));
    let mut logs = fs::read_dir(directory.join("logs")).expect("there");
    let log = logs.find_map(|entry| {
        let path = entry.expect("an entry").path();
        path.extension()
            .is_some_and(|end| end == "mcap")
            .then_some(path)
    });
    log.expect("a log")
}

#[test]
fn texts_of_a_log_run_neither_in_a_spreadsheet_nor_in_a_browser() {
    let directory = tempfile::tempdir().expect("a directory");
    let log = hostile_log(directory.path());
    let export = atvrec(directory.path())
        .args(["export", "--topic", "/mark"])
        .arg(&log)
        .assert()
        .success();
    let text = stdout(&export);
    assert!(text.contains("'=HYPERLINK"), "{text}");
    assert!(
        !text.contains('\u{1b}') && text.lines().count() == 4,
        "{text}"
    );
    atvrec(directory.path())
        .arg("report")
        .arg(&log)
        .args(["--output", "page.html"])
        .assert()
        .success();
    let page = fs::read_to_string(directory.path().join("page.html")).expect("there");
    assert!(page.contains("&lt;/script&gt;&lt;!--&lt;script&gt;alert(1)"));
    assert!(!page.contains("<script>alert(1)") && !page.contains('\u{202e}'));
}

#[test]
fn absurd_files_that_a_configuration_names_are_refused_in_time() {
    let directory = tempfile::tempdir().expect("a directory");
    let signals: String = (0..1_000_000)
        .map(|n| format!(" SG_ s{n} : 0|8@1+ (1,0) [0|0] \"\" Node\n"))
        .collect();
    let dbc = format!("VERSION \"\"\nBS_:\nBU_: Node\nBO_ 5 Sample: 8 Node\n{signals}");
    fs::write(directory.path().join("signals.dbc"), dbc).expect("written");
    let keys: String = (0..90_000).map(|n| format!("k{n} = 1\n")).collect();
    fs::write(directory.path().join("keys.toml"), &keys).expect("written");
    let nested = format!("a = {}\n", "[".repeat(1_000_000));
    fs::write(directory.path().join("nested.toml"), &nested).expect("written");
    let made = Command::new("mkfifo")
        .arg(directory.path().join("fifo"))
        .status();
    assert!(made.expect("mkfifo runs").success());
    let can = "[source.can0]\nkind = \"can\"\ninterface = \"can0\"\n";
    for config in [
        format!("{can}dbc = [\"signals.dbc\"]\n"),
        format!("{can}dbc = [\"fifo\"]\n"),
        "[vehicle]\nfile = \"keys.toml\"\n".to_owned(),
        "[vehicle]\nfile = \"nested.toml\"\n".to_owned(),
        "[vehicle]\nfile = \"fifo\"\n".to_owned(),
        keys,
        nested,
    ] {
        fs::write(directory.path().join("atvrec.toml"), &config).expect("written");
        let start = Instant::now();
        let check = atvrec(directory.path())
            .args(["check", "--no-devices"])
            .timeout(Duration::from_secs(30))
            .assert();
        let text = stderr(&check);
        let shown = &config[..config.len().min(80)];
        assert!(
            text.lines().count() < 250 && text.len() < 100_000,
            "{shown}: {}",
            text.len()
        );
        assert!(!text.contains("panicked"), "{shown}: {text}");
        check.code(2);
        println!("{:.2} s: {shown}", start.elapsed().as_secs_f64());
    }
}

#[test]
fn a_recorder_of_another_directory_is_found_without_it() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    fs::write(here.join("atvrec.toml"), SOURCE).expect("written");
    let runtime = here.join("run");
    fs::create_dir_all(&runtime).expect("made");
    let mut child = Command::new(env!("CARGO_BIN_EXE_atvrec"))
        .args(["record", "--for", "60", "--directory", "elsewhere"])
        .current_dir(here)
        .env("XDG_RUNTIME_DIR", &runtime)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the recorder starts");
    let ask = |arguments: &[&str]| {
        let mut command = atvrec(here);
        command.args(arguments).env("XDG_RUNTIME_DIR", &runtime);
        command
    };
    let start = Instant::now();
    while ask(&["status"])
        .output()
        .is_ok_and(|output| !output.status.success())
    {
        assert!(start.elapsed() < Duration::from_secs(20), "no status");
        std::thread::sleep(Duration::from_millis(50));
    }
    let assert = ask(&["status"]).assert().success();
    assert!(stdout(&assert).contains("elsewhere"), "{}", stdout(&assert));
    ask(&["mark", "gravel"]).assert().success();
    ask(&["status", "--directory", "elsewhere"])
        .assert()
        .success();
    child.kill().expect("killed");
    child.wait().expect("ended");
}
