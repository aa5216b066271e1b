//! The recorder in a real Linux: SocketCAN (virtual and SJA1000) and UARTs. Needs QEMU; run by
//! `make rig`, which fetches what is missing.

mod disk;
mod drive;
mod newcomer;
mod powercut;
mod service;
mod stress;

use std::collections::BTreeMap;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use atvrec_tests::{atvrec, logs_in, project};
use sample::{CanFrame, Health, Payload, SourceHealth};
use store::Reader;

/// Boots the rig with a guest script; its output folder is made anew.
fn boot(script: &str, options: &[&str]) -> PathBuf {
    let out = atvrec_tests::rig::new_output_folder(script);
    atvrec_tests::rig::boot(script, options);
    out
}

/// Frames of each interface, in order, as candump saw them.
fn seen_by_candump(path: &Path) -> BTreeMap<String, Vec<CanFrame>> {
    let text = std::fs::read_to_string(path).expect("candump's log");
    let mut frames: BTreeMap<String, Vec<CanFrame>> = BTreeMap::new();
    for line in text.lines() {
        let line =
            wire::candump::parse_line(line).unwrap_or_else(|error| panic!("{line}: {error}"));
        frames.entry(line.interface).or_default().push(line.frame);
    }
    frames
}

/// Frames of each source, in the order of the log.
fn recorded(logs: &[PathBuf]) -> BTreeMap<String, Vec<CanFrame>> {
    let reader = Reader::open(logs).expect("the log opens");
    assert_eq!(reader.info().missing, [], "the log is whole");
    let mut frames: BTreeMap<String, Vec<CanFrame>> = BTreeMap::new();
    let mut last = None;
    for arrival in reader.arrivals() {
        let arrival = arrival.expect("readable");
        assert!(last < Some(arrival.sequence), "sequence rises");
        last = Some(arrival.sequence);
        if let Payload::Can(batch) = arrival.payload {
            let name = reader.session().source_name(arrival.source);
            frames.entry(name).or_default().extend(batch);
        }
    }
    frames
}

#[test]
fn every_frame_that_candump_sees_is_in_the_log_with_the_kernels_stamp() {
    let out = boot("can", &[]);
    let peer = seen_by_candump(&out.join("candump.log"));
    let ours = recorded(&logs_in(&out.join("logs")));
    // A controller that went off the bus and came back, as its driver tells it.
    let errors = ours["virtual0"].iter().filter(|frame| frame.flags.error);
    assert_eq!(
        errors.map(|frame| frame.id).collect::<Vec<_>>(),
        [0x40, 0x100]
    );
    let told = std::fs::read_to_string(out.join("record.log")).expect("messages");
    for text in ["bus off: check wiring", "restarted after bus off"] {
        assert!(told.contains(text), "{told}");
    }
    let sent = [
        ("vcan0", 5000),
        ("vcan1", 2000),
        ("vcan2", 2000),
        ("can1", 252),
    ];
    let names = ["virtual0", "virtual1", "virtual2", "wire"];
    for ((interface, count), name) in sent.into_iter().zip(names) {
        let (peer, ours) = (&peer[interface], without_errors(&ours[name]));
        assert_eq!(peer.len(), count, "candump on {interface}");
        assert_eq!(ours.len(), count, "recorder on {interface}");
        for (index, (seen, recorded)) in peer.iter().zip(ours).enumerate() {
            let place = format!("{interface}, frame {index}");
            assert_eq!(recorded.id, seen.id, "{place}");
            assert_eq!(recorded.bytes(), seen.bytes(), "{place}");
            assert_eq!(recorded.flags.extended, seen.flags.extended, "{place}");
            assert_eq!(recorded.flags.remote, seen.flags.remote, "{place}");
            assert_eq!(recorded.flags.fd, seen.flags.fd, "{place}");
            let microseconds = |stamp: Option<i64>| stamp.map(|ns| ns / 1000);
            assert!(recorded.kernel_ns.is_some(), "{place} has a kernel stamp");
            assert_eq!(
                microseconds(recorded.kernel_ns),
                microseconds(seen.kernel_ns),
                "{place}: both read the kernel's stamp"
            );
        }
    }
}

fn without_errors(frames: &[CanFrame]) -> Vec<&CanFrame> {
    frames.iter().filter(|frame| !frame.flags.error).collect()
}

/// A virtual vehicle on this machine. It ends when the test ends, however that ends.
struct Vehicle(Child);

impl Vehicle {
    /// Drives with its ports in `directory`, for longer than a test takes.
    fn start(directory: &Path) -> Self {
        let vehicle = Command::new(atvrec())
            .args([
                "virtual",
                "--manoeuvre",
                "mixed-driving",
                "--for",
                "1200",
                "-q",
            ])
            .arg("--directory")
            .arg(directory)
            .stdout(Stdio::piped())
            .spawn();
        Self(vehicle.expect("the virtual vehicle starts"))
    }

    /// Ends the drive. For each port, the messages that it left out while its line had no room.
    fn stop(mut self) -> BTreeMap<String, u64> {
        let id = self.0.id().to_string();
        let told = Command::new("kill").args(["-TERM", &id]).status();
        assert!(told.expect("kill starts").success());
        let mut text = String::new();
        let mut output = self.0.stdout.take().expect("piped");
        output.read_to_string(&mut text).expect("what it says");
        let counts = text.lines().filter_map(|line| {
            let (sent, left_out) = line.split_once(" messages sent, ")?;
            let left_out = left_out.split_once(' ')?.0.parse().ok()?;
            Some((sent.split_whitespace().next()?.to_owned(), left_out))
        });
        counts.collect()
    }
}

impl Drop for Vehicle {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn bytes_through_real_uarts_decode_without_an_error() {
    let ports = project().join("target/rig-out/ports");
    let _ = std::fs::remove_dir_all(&ports);
    let vehicle = Vehicle::start(&ports);
    let names = ["imu", "novatel", "septentrio"];
    let mut uarts = Vec::new();
    for name in names {
        wait_for(&ports.join(name));
        uarts.extend(["--uart".to_owned(), ports.join(name).display().to_string()]);
    }
    let uarts: Vec<&str> = uarts.iter().map(String::as_str).collect();
    let out = boot("uart", &uarts);
    let left_out = vehicle.stop();
    let logs = logs_in(&out.join("logs"));
    let reports = atvrec_tests::health_reports(&logs);
    // What the ports held before they were opened is old, cut and full of holes: it ends within the
    // first seconds, and what is asked below is asked of all that came after.
    let (settled, last) = (&reports[4], &reports[reports.len() - 1]);
    for (name, least_messages) in names.into_iter().zip([500, 200, 200]) {
        let of = |report: &Health| -> SourceHealth {
            let found = report.sources.iter().find(|source| source.name == name);
            found
                .unwrap_or_else(|| panic!("{name} reports its health"))
                .clone()
        };
        let (settled, last) = (of(settled), of(last));
        let case = format!("{} left out: {settled:?} {last:?}", left_out[name]);
        let messages = last.messages - settled.messages;
        assert!(messages >= least_messages, "{case}");
        // While this machine leaves the guest no time, a device leaves messages out and the guest's
        // UART may be overrun. Both are counted, and nothing is missing or damaged besides.
        let [overrun, kernel, queue, disk] = last.lost;
        assert_eq!([kernel, queue, disk], [0; 3], "{case}");
        let gaps = last.gaps - settled.gaps;
        assert!(gaps <= left_out[name] + overrun, "{case}");
        let errors = last.checksum_errors - settled.checksum_errors;
        assert!(errors <= overrun, "{case}");
        if overrun == 0 {
            assert_eq!(last.skipped_bytes, settled.skipped_bytes, "{case}");
        }
    }
    let verified = Command::new(atvrec())
        .args(["replay", "--verify"])
        .args(&logs)
        .status();
    assert!(
        verified.expect("replay starts").success(),
        "the guest's log replays bit by bit"
    );
}

fn wait_for(path: &Path) {
    for _ in 0..200 {
        if path.exists() {
            return;
        }
        std::thread::sleep(std::time::Duration::from_millis(100));
    }
    panic!("{} did not appear", path.display());
}
