//! What a receiver sent becomes a log, and comes out as it was.

use std::fs;
use std::path::Path;

use crate::support::{atvrec, names, stderr, stdout};

/// A sentence with its checksum.
fn sentence(body: &str) -> String {
    let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
    format!("${body}*{sum:02X}\r\n")
}

/// Imports a file; what was printed.
fn import(here: &Path, file: &Path) -> String {
    let assert = atvrec(here)
        .args(["import", "gnss"])
        .arg(file)
        .args(["-o", "a.mcap", "--force"])
        .assert()
        .success();
    stdout(&assert)
}

/// The bytes of the source of the log.
fn bytes_of(here: &Path, source: &str) -> Vec<u8> {
    atvrec(here)
        .args(["replay", "a.mcap", "--verify"])
        .assert()
        .success();
    atvrec(here)
        .args(["export", "a.mcap", "--raw", "bytes", "--source", source])
        .args(["-o", "out.bin", "--force"])
        .assert()
        .success();
    fs::read(here.join("out.bin")).expect("the bytes")
}

/// The file begins before midnight, its first date comes after midnight, and its last bytes are cut.
#[test]
fn sentences_arrive_at_their_own_time() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let mut text = String::new();
    for n in 0..40 {
        // 23:59:58.0 and on, in steps of 0.1 s.
        let tenths = (86_398 * 10 + n) % 864_000;
        let (seconds, tenth) = (tenths / 10, tenths % 10);
        let (h, m, s) = (seconds / 3600, seconds / 60 % 60, seconds % 60);
        let time = format!("{h:02}{m:02}{s:02}.{tenth}0");
        text.push_str(&sentence(&format!(
            "GPGGA,{time},3236.0000,N,08529.0000,W,4,12,0.8,200.0,M,-29.0,M,1.0,0000"
        )));
        if n >= 25 {
            text.push_str(&sentence(&format!(
                "GPRMC,{time},A,3236.0000,N,08529.0000,W,10.0,90.0,020326,,,R"
            )));
        }
    }
    text.push_str("$GPGGA,0000");
    fs::write(here.join("rover.nmea"), &text).expect("written");
    let told = import(here, Path::new("rover.nmea"));
    assert!(told.contains("in 3.900 s, messages: 55 nmea"), "{told}");
    assert!(told.contains("11 bytes belong to no message"), "{told}");
    assert!(
        !told.contains("jumps") && !told.contains("earlier"),
        "{told}"
    );
    assert!(bytes_of(here, "rover") == text.as_bytes());
    let assert = atvrec(here).args(["info", "a.mcap"]).assert().success();
    let info = stdout(&assert);
    assert!(info.contains("20260301T235958Z"), "{info}");
    assert!(info.contains("/gnss/rover/position"), "{info}");
}

#[test]
fn recordings_of_real_receivers_come_out_as_they_were() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let Some(root) = testkit::shared("data/devices") else {
        return;
    };
    let mut count = 0;
    for maker in ["novatel", "septentrio", "ubx", "nmea"] {
        for device in names(&root.join(maker)) {
            let path = root.join(maker).join(device).join("recording.bin");
            let bytes = fs::read(&path).expect("a file");
            let command = atvrec(here)
                .args(["import", "gnss"])
                .arg(&path)
                .args(["-o", "a.mcap", "--force"])
                .output()
                .expect("the program runs");
            if !command.status.success() {
                // A file of messages without a time cannot be imported.
                let told = String::from_utf8_lossy(&command.stderr);
                let is_known = told.contains("no message has the receiver's time");
                assert!(is_known, "{}: {told}", path.display());
                testkit::report(&format!("{}: {}", path.display(), told.trim_end()));
                continue;
            }
            assert!(bytes_of(here, "recording") == bytes, "{}", path.display());
            count += 1;
        }
    }
    assert!(count > 3, "{count} files");
    testkit::report(&format!("{count} files come out as they were"));
}

#[test]
fn files_without_a_time_are_refused() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let heading = sentence("GPHDT,90.0,T");
    for (text, part) in [
        ("", "is empty"),
        (heading.as_str(), "no message has the receiver's time"),
        (
            "(1672776524.573555) can0 123#11\n",
            "is a log of candump and has no message",
        ),
        ("no receiver", "was it recorded at another baud rate?"),
    ] {
        fs::write(here.join("a.bin"), text).expect("written");
        let mut command = atvrec(here);
        command.args(["import", "gnss", "a.bin", "-o", "a.mcap"]);
        let told = stderr(&command.assert().code(2));
        assert!(told.contains(part), "{told}");
        assert!(!here.join("a.mcap").exists());
    }
}
