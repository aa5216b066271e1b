//! Disks that fill up, fail, turn read-only or are pulled out during a drive.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use atvrec_tests::{atvrec, logs_in, project};
use store::Reader;

use super::{boot, recorded, seen_by_candump};

/// A file system of this size in a file, made anew.
fn disk_image(bytes: u64, options: &[&str]) -> PathBuf {
    let image = project().join("target/rig-out/disk.img");
    std::fs::create_dir_all(image.parent().expect("a folder")).expect("made");
    let _ = std::fs::remove_file(&image);
    let file = std::fs::File::create(&image).expect("created");
    file.set_len(bytes).expect("of this size");
    let made = Command::new("mkfs.ext4")
        .args(["-q", "-F", "-m", "0"])
        .args(options)
        .arg(&image)
        .env("PATH", "/usr/sbin:/sbin:/usr/bin:/bin")
        .status();
    assert!(made.expect("mkfs.ext4 starts").success());
    image
}

#[test]
fn a_full_disk_is_told_costs_nothing_and_is_written_again_when_there_is_room() {
    let image = disk_image(8 << 20, &[]);
    let out = boot("disk", &["--disk", &image.display().to_string()]);
    let text = |name: &str| std::fs::read_to_string(out.join(name)).expect("from the guest");
    assert!(
        text("status-full").contains("No space left on device"),
        "{}",
        text("status-full")
    );
    assert!(text("record.log").contains("the log can be written again"));
    let summary = text("summary.json");
    assert!(summary.contains("\"disk\": 0"), "{summary}");

    let logs = recovered_logs(&out.join("logs"));
    every_frame_is_there(&logs, &out.join("candump.log"), 2000);
    estimates_went_on(&logs, &out.join("again.mcap"));
}

/// An ext4 disk that answers each write with an error, turns read-only, and is pulled out and plugged
/// in again, while the recorder runs.
#[test]
fn a_disk_that_fails_is_told_costs_nothing_and_is_written_again_when_it_is_back() {
    // Without a journal, whose abort would ask for a person.
    let image = disk_image(64 << 20, &["-O", "^has_journal"]);
    let out = boot("trouble", &["--disk", &image.display().to_string()]);
    let text = |name: &str| std::fs::read_to_string(out.join(name)).expect("from the guest");
    println!("{}", text("output"));
    for (trouble, answer) in [
        ("error", "Input/output error"),
        ("read-only", "Read-only file system"),
        ("pulled", "No such file or directory"),
    ] {
        let status = text(&format!("status-{trouble}"));
        assert!(status.contains(answer), "{trouble}: {status}");
    }
    let told = text("record.log");
    assert_eq!(
        told.matches("the log can be written again").count(),
        3,
        "{told}"
    );
    let summary = text("summary.json");
    assert!(summary.contains("\"disk\": 0"), "{summary}");
    let logs = recovered_logs(&out.join("logs"));
    every_frame_is_there(&logs, &out.join("candump.log"), 2500);
    estimates_went_on(&logs, &out.join("again.mcap"));
}

/// The logs of a folder; the file that was being written when the disk failed waits for recovery.
fn recovered_logs(folder: &Path) -> Vec<PathBuf> {
    for (path, result) in store::recover_directory(folder).expect("readable") {
        result.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    }
    let logs = logs_in(folder);
    assert!(logs.len() >= 2, "{logs:?}");
    logs
}

/// All frames that candump saw are in the logs, in order and once.
fn every_frame_is_there(logs: &[PathBuf], candump: &Path, count: usize) {
    let (ours, peer) = (recorded(logs), seen_by_candump(candump));
    let bytes = |frames: &[sample::CanFrame]| -> Vec<Vec<u8>> {
        frames.iter().map(|frame| frame.bytes().to_vec()).collect()
    };
    assert_eq!(peer["vcan0"].len(), count);
    assert_eq!(
        bytes(&ours["bus"]),
        bytes(&peer["vcan0"]),
        "every frame, in order"
    );
}

/// Estimates went on while the disk failed: those in the log are those of a replay, which has no gap.
fn estimates_went_on(logs: &[PathBuf], again: &Path) {
    let replayed = Command::new(atvrec())
        .args(["-q", "replay", "--force", "-o"])
        .arg(again)
        .args(logs)
        .status();
    assert!(replayed.expect("the replay starts").success());
    let estimates = |logs: &[PathBuf]| -> BTreeMap<u64, String> {
        let reader = Reader::open(logs).expect("the log opens");
        let all = reader
            .estimates()
            .map(|estimate| estimate.expect("readable"));
        all.map(|estimate| (estimate.time.0, format!("{estimate:?}")))
            .collect()
    };
    let (written, made) = (estimates(logs), estimates(&[again.to_owned()]));
    assert!(written.len() > 300 && made.len() > written.len());
    for (time, estimate) in &written {
        assert_eq!(Some(estimate), made.get(time));
    }
}
