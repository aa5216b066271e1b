//! Losses while recording, with the real program: deleted logs, a full disk, a disk that hangs.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::record::{Virtual, signal};
use crate::support::{atvrec, stdout};

/// A recorder of the virtual vehicle; its log folder is `logs`, its socket stands beside.
struct Recording {
    child: Child,
    folder: PathBuf,
    _ports: Virtual,
}

impl Recording {
    fn start(folder: &Path, storage: &str, environment: &[(&str, &Path)]) -> Self {
        let ports = Virtual::start(folder);
        let text = fs::read_to_string(folder.join("ports/atvrec.toml")).expect("configuration");
        let kept = text.lines().filter(|line| !line.starts_with("directory"));
        let text: String = kept.map(|line| format!("{line}\n")).collect();
        let logs = folder.join("logs");
        let socket = folder.join("socket");
        let text =
            format!("{text}directory = {logs:?}\n{storage}\n[control]\nsocket = {socket:?}\n");
        fs::write(folder.join("ports/atvrec.toml"), text).expect("written");
        let child = Command::new(env!("CARGO_BIN_EXE_atvrec"))
            .args(["record", "--config", "ports/atvrec.toml", "--json"])
            .current_dir(folder)
            .envs(environment.iter().copied())
            .stdout(Stdio::piped())
            .stderr(fs::File::create(folder.join("stderr")).expect("made"))
            .spawn()
            .expect("the recorder starts");
        let recording = Self {
            child,
            folder: folder.to_owned(),
            _ports: ports,
        };
        wait_until(|| std::os::unix::net::UnixStream::connect(&socket).is_ok());
        recording
    }

    /// Exit code 1 of `status` says that the disk fails.
    fn status(&self) -> Value {
        let output = atvrec(&self.folder)
            .args(["status", "--json", "--socket", "socket"])
            .output()
            .expect("it answers");
        serde_json::from_slice(&output.stdout).expect("JSON")
    }

    fn status_text(&self) -> String {
        let assert = atvrec(&self.folder)
            .args(["status", "--socket", "socket"])
            .assert();
        stdout(&assert)
    }

    /// Ends it as a service manager does; gives the exit code and the summary.
    fn stop(mut self) -> (Option<i32>, Value) {
        signal(&self.child, "-TERM");
        let mut text = String::new();
        let mut output = self.child.stdout.take().expect("piped");
        std::io::Read::read_to_string(&mut output, &mut text).expect("text");
        let status = self.child.wait().expect("it ends");
        let summary = serde_json::from_str(&text);
        let errors = fs::read_to_string(self.folder.join("stderr")).unwrap_or_default();
        (
            status.code(),
            summary.unwrap_or_else(|error| panic!("{error}: {text}\n{errors}")),
        )
    }
}

impl Drop for Recording {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn wait_until(mut done: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !done() {
        assert!(begin.elapsed() < Duration::from_secs(60), "it never came");
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn pause(seconds: f64) {
    std::thread::sleep(Duration::from_secs_f64(seconds));
}

fn logs(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("the log folder");
    let mut logs: Vec<PathBuf> = entries
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|end| end == "mcap"))
        .collect();
    logs.sort();
    logs
}

/// What the logs of a folder hold: arrivals, and arrivals that they state as lost.
fn arrivals(folder: &Path) -> (u64, u64) {
    let reader = store::Reader::open(logs(folder)).expect("logs");
    let held = reader.arrivals().filter(Result::is_ok).count() as u64;
    let stated = reader.info().counters.get("lost_arrivals").copied();
    (held, stated.unwrap_or_default())
}

/// Status said "writing", the exit code was 0: 27,000 arrivals, 0 recorded, 0 lost.
#[test]
fn a_deleted_log_folder_is_reported_and_its_arrivals_are_counted() {
    let directory = tempfile::tempdir().expect("a directory");
    let folder = directory.path();
    let recording = Recording::start(folder, "rotate_after_s = 1", &[]);
    pause(3.3);
    fs::remove_dir_all(folder.join("logs")).expect("removed");
    let begin = Instant::now();
    wait_until(|| folder.join("logs").exists());
    assert!(begin.elapsed() < Duration::from_secs(1));
    wait_until(|| {
        let status = recording.status();
        status["disk"]["gone"]
            .as_array()
            .is_some_and(|gone| !gone.is_empty())
    });
    let text = recording.status_text();
    assert!(
        text.contains("was deleted while it was being written"),
        "{text}"
    );
    assert!(text.contains("lost (disk): "), "{text}");
    pause(1.5);
    let (code, summary) = recording.stop();
    assert_eq!(code, Some(3), "{summary:#}");
    let lost = summary["lost"]["disk"].as_u64().expect("a number");
    let (held, stated) = arrivals(&folder.join("logs"));
    assert!(lost > 0 && held > 0, "{summary:#}");
    assert_eq!(stated, lost);
    assert_eq!(held + lost, summary["arrivals"].as_u64().expect("a number"));
    let errors = fs::read_to_string(folder.join("stderr")).expect("text");
    assert!(
        errors.contains("deleted while it was being written"),
        "{errors}"
    );
}

/// A tmpfs, as long as this lives; `None`, and said, without the right to mount one.
struct SmallDisk(PathBuf);

impl SmallDisk {
    fn mount(at: &Path, size: &str) -> Option<Self> {
        fs::create_dir_all(at).expect("made");
        let mounted = Command::new("mount")
            .args(["-t", "tmpfs", "-o", &format!("size={size}"), "tmpfs"])
            .arg(at)
            .stderr(Stdio::null())
            .status();
        if mounted.is_ok_and(|status| status.success()) {
            return Some(Self(at.to_owned()));
        }
        eprintln!("SKIPPED: a small disk needs the right to mount a tmpfs");
        None
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg("-l").arg(&self.0).status();
    }
}

/// Parts after the disk had been full carried channels without a schema, and a verification called
/// 18,484 of 69,106 messages different, because it compared them by position.
#[test]
fn a_full_disk_costs_decoded_records_first_and_its_logs_verify() {
    let directory = tempfile::tempdir().expect("a directory");
    let folder = directory.path();
    let Some(_disk) = SmallDisk::mount(&folder.join("logs"), "5m") else {
        return;
    };
    let recording = Recording::start(folder, "rotate_after_s = 4", &[]);
    pause(5.0);
    let filler = folder.join("logs/filler");
    // What does not fit is cut off: the disk is full then.
    let _ = fs::write(&filler, vec![1; 6 << 20]);
    wait_until(|| recording.status()["disk"]["state"] == "failing");
    pause(3.0);
    fs::remove_file(&filler).expect("removed");
    wait_until(|| recording.status()["disk"]["state"] == "writing");
    pause(3.0);
    let (code, summary) = recording.stop();
    assert_eq!(code, Some(0), "{summary:#}");
    assert_eq!(summary["lost"]["disk"], 0, "{summary:#}");
    assert!(summary["lost_records"].as_u64() > Some(0), "{summary:#}");
    for (path, recovered) in store::recover_directory(&folder.join("logs")).expect("readable") {
        recovered.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    }
    let logs = logs(&folder.join("logs"));
    assert!(logs.len() >= 3, "{logs:?}");
    let reader = store::Reader::open(&logs).expect("a run");
    for channel in reader.channels() {
        assert!(!channel.schema_data.is_empty(), "{}", channel.topic);
    }
    let held = reader.arrivals().filter(Result::is_ok).count() as u64;
    assert_eq!(Some(held), summary["arrivals"].as_u64());
    let assert = atvrec(folder)
        .args(["replay", "--verify", "--json"])
        .args(&logs)
        .assert()
        .success();
    let result: Value = serde_json::from_str(&stdout(&assert)).expect("JSON");
    assert_eq!(result["verify"]["identical"], true, "{result:#}");
    assert_eq!(result["verify"]["different"], 0, "{result:#}");
}

/// Stands in for a disk that hangs: once the file `HANG` names is there, no byte of a log or of its
/// journals is taken, and no sync ends.
const SHIM: &str = r#"
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
static void wait_for_disk(int fd) {
    const char *flag = getenv("HANG");
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length <= 0) return;
    path[length] = 0;
    if (!strstr(path, ".mcap.active") && !strstr(path, ".journal-")) return;
    while (flag && access(flag, F_OK) == 0) usleep(10000);
}
ssize_t write(int fd, const void *data, size_t size) {
    static ssize_t (*next)(int, const void *, size_t);
    if (!next) next = dlsym(RTLD_NEXT, "write");
    wait_for_disk(fd);
    return next(fd, data, size);
}
int fdatasync(int fd) {
    static int (*next)(int);
    if (!next) next = dlsym(RTLD_NEXT, "fdatasync");
    wait_for_disk(fd);
    return next(fd);
}
"#;

/// A stop on a slow disk took 36 s, the service manager killed the recorder after 5 s, and the loss
/// was counted nowhere.
#[test]
fn a_stop_while_the_disk_hangs_ends_in_time_and_states_what_is_lost() {
    let directory = tempfile::tempdir().expect("a directory");
    let folder = directory.path();
    let (source, shim, hang) = (
        folder.join("shim.c"),
        folder.join("shim.so"),
        folder.join("hang"),
    );
    fs::write(&source, SHIM).expect("written");
    let compiled = Command::new("cc")
        .args(["-shared", "-fPIC", "-O1", "-o"])
        .args([&shim, &source])
        .arg("-ldl")
        .status();
    if !compiled.is_ok_and(|status| status.success()) {
        eprintln!("SKIPPED: a disk that hangs needs the C compiler cc");
        return;
    }
    let environment = [("LD_PRELOAD", shim.as_path()), ("HANG", hang.as_path())];
    let recording = Recording::start(folder, "stop_within_s = 2", &environment);
    pause(2.5);
    fs::write(&hang, "").expect("written");
    // The backlog is a warning and in the status long before anything is lost.
    wait_until(|| recording.status()["disk"]["backlog"]["seconds"].as_f64() > Some(4.0));
    let text = recording.status_text();
    assert!(text.contains("the disk is slow: "), "{text}");
    let errors = fs::read_to_string(folder.join("stderr")).expect("text");
    assert!(errors.contains("the disk is too slow"), "{errors}");
    assert_eq!(recording.status()["lost"]["disk"], 0);
    let begin = Instant::now();
    let (code, summary) = recording.stop();
    let took = begin.elapsed();
    assert!(took < Duration::from_millis(3_500), "{took:?}");
    assert_eq!(code, Some(3), "{summary:#}");
    let lost = summary["lost"]["disk"].as_u64().expect("a number");
    assert!(lost > 0, "{summary:#}");
    assert!(summary["cut_off"].is_string(), "{summary:#}");
    fs::remove_file(&hang).expect("removed");
    for (path, recovered) in store::recover_directory(&folder.join("logs")).expect("readable") {
        recovered.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    }
    let (held, stated) = arrivals(&folder.join("logs"));
    assert_eq!(stated, lost);
    assert_eq!(held + lost, summary["arrivals"].as_u64().expect("a number"));
}
