//! The recorder in a real Linux: SocketCAN (virtual and SJA1000) and UARTs. Needs QEMU; run by
//! `make rig`, which fetches what is missing.
#![cfg(feature = "rig")]

#[path = "rig/disk.rs"]
mod disk;
#[path = "rig/drive.rs"]
mod drive;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use atvrec_tests::{atvrec, logs_in, project};
use sample::{CanFrame, Health, Payload, SourceHealth};
use store::Reader;

/// Boots the rig with a guest script; its output folder is made anew.
fn boot(script: &str, options: &[&str]) -> PathBuf {
    let out = project().join("target/rig-out").join(script);
    let _ = std::fs::remove_dir_all(&out);
    std::fs::create_dir_all(&out).expect("output folder");
    std::fs::copy(atvrec(), out.join("atvrec")).expect("the guest gets a copy of the binary");
    let status = Command::new(project().join("tests/rig/rig"))
        .arg("boot")
        .arg(project().join(format!("tests/rig/guest/{script}.sh")))
        .arg("--out")
        .arg(&out)
        .args(options)
        .status()
        .expect("the rig starts");
    let output = std::fs::read_to_string(out.join("output")).unwrap_or_default();
    let log = std::fs::read_to_string(out.join("record.log")).unwrap_or_default();
    assert!(status.success(), "{script}: {status}\n{output}\n{log}");
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

/// Ends the virtual vehicle when the test ends, however it ends.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn bytes_through_real_uarts_decode_without_an_error() {
    let ports = project().join("target/rig-out/ports");
    let _ = std::fs::remove_dir_all(&ports);
    let vehicle = Command::new(atvrec())
        .args([
            "virtual",
            "--manoeuvre",
            "slow-sine",
            "--repeat",
            "-q",
            "--directory",
        ])
        .arg(&ports)
        .stdout(Stdio::null())
        .spawn()
        .expect("the virtual vehicle starts");
    let _vehicle = Running(vehicle);
    let port = |name: &str| ports.join(name).display().to_string();
    for name in ["imu", "novatel", "septentrio"] {
        wait_for(&ports.join(name));
    }
    let out = boot(
        "uart",
        &[
            "--uart",
            &port("imu"),
            "--uart",
            &port("novatel"),
            "--uart",
            &port("septentrio"),
        ],
    );
    let logs = logs_in(&out.join("logs"));
    let reports = atvrec_tests::health_reports(&logs);
    // What the ports held before they were opened is old and cut: it ends within the first seconds.
    let (settled, last) = (&reports[4], &reports[reports.len() - 1]);
    for (name, least_messages) in [("imu", 500), ("novatel", 200), ("septentrio", 200)] {
        let of = |report: &Health| -> SourceHealth {
            let found = report.sources.iter().find(|source| source.name == name);
            found
                .unwrap_or_else(|| panic!("{name} reports its health"))
                .clone()
        };
        let (settled, last) = (of(settled), of(last));
        assert!(
            last.messages > settled.messages + least_messages,
            "{settled:?} {last:?}"
        );
        // While the emulated port stands still the virtual vehicle leaves messages out and the
        // guest may lose bytes: each such place may cost a message, and none is damaged elsewhere.
        let gaps = last.gaps - settled.gaps;
        let errors = last.checksum_errors - settled.checksum_errors;
        assert!(gaps <= 5 && errors <= gaps, "{settled:?} {last:?}");
        if errors == 0 {
            assert_eq!(last.skipped_bytes, settled.skipped_bytes, "{last:?}");
        }
        assert_eq!(last.lost, [0; 4], "{last:?}");
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
