//! A disk that somebody else fills up during a drive.

use std::collections::BTreeMap;
use std::process::Command;

use atvrec_tests::{atvrec, logs_in, project};
use store::Reader;

use super::{boot, recorded, seen_by_candump};

/// A file system of this size in a file, made anew.
fn disk_image(bytes: u64) -> std::path::PathBuf {
    let image = project().join("target/rig-out/disk.img");
    std::fs::create_dir_all(image.parent().expect("a folder")).expect("made");
    let _ = std::fs::remove_file(&image);
    let file = std::fs::File::create(&image).expect("created");
    file.set_len(bytes).expect("of this size");
    let made = Command::new("mkfs.ext4")
        .args(["-q", "-F", "-m", "0"])
        .arg(&image)
        .env("PATH", "/usr/sbin:/sbin:/usr/bin:/bin")
        .status();
    assert!(made.expect("mkfs.ext4 starts").success());
    image
}

#[test]
fn a_full_disk_is_told_costs_nothing_and_is_written_again_when_there_is_room() {
    let image = disk_image(8 << 20);
    let out = boot("disk", &["--disk", &image.display().to_string()]);
    let text = |name: &str| std::fs::read_to_string(out.join(name)).expect("from the guest");
    assert!(
        text("status-full").contains("No space left on device"),
        "{}",
        text("status-full")
    );
    assert!(text("record.log").contains("the disk takes the log again"));
    let summary = text("summary.json");
    assert!(summary.contains("\"disk\": 0"), "{summary}");

    // The file that was being written when the disk filled up waits for recovery.
    let folder = out.join("logs");
    for (path, result) in store::recover_directory(&folder).expect("readable") {
        result.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    }
    let logs = logs_in(&folder);
    assert!(logs.len() >= 2, "{logs:?}");
    let (ours, peer) = (recorded(&logs), seen_by_candump(&out.join("candump.log")));
    let bytes = |frames: &[sample::CanFrame]| -> Vec<Vec<u8>> {
        frames.iter().map(|frame| frame.bytes().to_vec()).collect()
    };
    assert_eq!(peer["vcan0"].len(), 2000);
    assert_eq!(
        bytes(&ours["bus"]),
        bytes(&peer["vcan0"]),
        "every frame, in order"
    );

    // Estimates went on while the disk was full: those in the log are those of a replay, which has
    // no gap.
    let again = out.join("again.mcap");
    let replayed = Command::new(atvrec())
        .args(["-q", "replay", "-o"])
        .arg(&again)
        .args(&logs)
        .status();
    assert!(replayed.expect("the replay starts").success());
    let estimates = |logs: &[std::path::PathBuf]| -> BTreeMap<u64, String> {
        let reader = Reader::open(logs).expect("the log opens");
        let all = reader
            .estimates()
            .map(|estimate| estimate.expect("readable"));
        all.map(|estimate| (estimate.time.0, format!("{estimate:?}")))
            .collect()
    };
    let (written, made) = (estimates(&logs), estimates(&[again]));
    assert!(written.len() > 300 && made.len() > written.len());
    for (time, estimate) in &written {
        assert_eq!(Some(estimate), made.get(time));
    }
}
