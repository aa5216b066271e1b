use std::fs;
use std::path::{Path, PathBuf};

use crate::support::{atvrec, simulate, stderr, stdout};

const MAGIC: &[u8; 8] = b"\x89MCAP0\r\n";
/// An empty header record.
const HEADER: [u8; 17] = [1, 8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
/// Address space that a command on a hostile file may take, kB; the program alone takes a tenth.
const ADDRESS_SPACE_KB: u64 = 1_000_000;

/// The chunk that a damaged log loses is named, and costs no other; nothing is given out of it.
#[test]
fn a_damaged_log_is_read_and_recovered_without_the_damaged_chunk() {
    let directory = tempfile::tempdir().expect("a directory");
    let log = simulate(directory.path(), "drive.mcap", 1);
    let mut bytes = fs::read(&log).expect("a log");
    let chunks: Vec<usize> = bytes
        .windows(8)
        .enumerate()
        .filter(|(_, window)| *window == b"\x04\0\0\0zstd")
        .map(|(place, _)| place - 37)
        .filter(|place| bytes[*place] == 6)
        .collect();
    let length = |start: usize| {
        let length = bytes[start + 1..start + 9].try_into().expect("eight");
        u64::from_le_bytes(length) as usize
    };
    let middle = chunks[chunks.len() / 2];
    let damaged = middle + length(middle) / 2;
    bytes[damaged] ^= 1;
    fs::write(&log, &bytes).expect("written");
    let run = |arguments: &[&str]| atvrec(directory.path()).args(arguments).assert();

    let text = stdout(&run(&["info", "drive.mcap"]).success());
    let place = format!("chunk at byte {middle} cannot be read");
    assert!(text.contains(&place), "{text}");
    run(&["report", "drive.mcap", "-o", "drive.html"]).success();
    let report = fs::read_to_string(directory.path().join("drive.html")).expect("a report");
    assert!(report.contains(&place));

    let assert = run(&["recover", "drive.mcap"]).code(3);
    let text = stdout(&assert);
    assert!(
        text.contains(&place) && text.contains("with 1 chunks"),
        "{text}"
    );
    let original = directory.path().join("drive.mcap.damaged");
    assert!(text.contains("kept as drive.mcap.damaged"), "{text}");
    assert_eq!(fs::read(original).expect("kept"), bytes);
    let text = stdout(&run(&["recover", "drive.mcap"]).success());
    assert!(text.contains("the log is complete"), "{text}");
}

/// The path stands once in the message, and the other paths are still recovered.
#[test]
fn an_error_names_its_path_once_and_other_paths_are_recovered() {
    let directory = tempfile::tempdir().expect("a directory");
    simulate(directory.path(), "drive.mcap", 1);
    let assert = atvrec(directory.path())
        .args(["recover", "absent.mcap", "drive.mcap"])
        .assert()
        .code(1);
    let text = stderr(&assert);
    assert_eq!(text.matches("absent.mcap").count(), 1, "{text}");
    assert!(stdout(&assert).contains("drive.mcap: the log is complete"));
}

/// A name that is no log's, and a chunk above the bound: the exit code is 1, and a larger bound helps.
#[test]
fn what_is_too_large_is_set_aside_and_recovered_with_a_larger_bound() {
    let directory = tempfile::tempdir().expect("a directory");
    let active = directory.path().join("log.mcap.active");
    fs::write(&active, testkit::log_of_zeros(80 << 20)).expect("written");
    let assert = atvrec(directory.path())
        .args(["recover", "."])
        .assert()
        .code(1);
    let text = stderr(&assert);
    assert!(
        text.contains("--max-chunk") && text.contains("unrecoverable"),
        "{text}"
    );
    assert!(!active.exists());
    let aside = "log.mcap.active.unrecoverable";
    atvrec(directory.path())
        .args(["recover", "--max-chunk", "100", aside])
        .assert()
        .code(3);
    assert!(directory.path().join("log.mcap.damaged").exists());
}

/// Files of a few bytes that declare sizes of gigabytes used to take that much memory.
#[cfg(target_os = "linux")]
#[test]
fn declared_sizes_cost_no_memory() {
    let directory = tempfile::tempdir().expect("a directory");
    let bombs: [(&str, Vec<u8>, u64); 4] = [
        ("inflates", testkit::log_of_zeros(1_000_000_000), 0),
        ("name", record_that_claims_a_long_name(), 0),
        ("record", record_that_claims_its_length(6, 1 << 40), 1 << 40),
        ("summary", footer_of_a_long_summary(), 1 << 40),
    ];
    for (name, bytes, length) in bombs {
        let path = directory.path().join(format!("{name}.mcap"));
        write_sparse(&path, &bytes, length);
        for command in ["info", "recover"] {
            let output = limited(directory.path(), &[command, &format!("{name}.mcap")]);
            assert!(
                output.status.code().is_some_and(|code| code <= 3),
                "{name}: {output:?}"
            );
        }
    }
}

fn limited(directory: &Path, arguments: &[&str]) -> std::process::Output {
    let program = assert_cmd::cargo::cargo_bin("atvrec");
    std::process::Command::new("sh")
        .current_dir(directory)
        .arg("-c")
        .arg(format!(
            "ulimit -v {ADDRESS_SPACE_KB} && exec \"$0\" \"$@\""
        ))
        .arg(program)
        .args(arguments)
        .output()
        .expect("sh runs")
}

/// Writes `bytes`, the last of them at the end of a file of `length` bytes if that is longer.
fn write_sparse(path: &PathBuf, bytes: &[u8], length: u64) {
    use std::os::unix::fs::FileExt as _;
    let file = fs::File::create(path).expect("made");
    let (head, tail) = bytes.split_at(bytes.len().min(64));
    file.write_all_at(head, 0).expect("written");
    let place = length
        .saturating_sub(tail.len() as u64)
        .max(head.len() as u64);
    file.write_all_at(tail, place).expect("written");
    if file.metadata().expect("there").len() < length {
        file.set_len(length).expect("sparse");
    }
}

fn record(opcode: u8, body: &[u8]) -> Vec<u8> {
    let mut record = vec![opcode];
    record.extend((body.len() as u64).to_le_bytes());
    record.extend(body);
    record
}

fn record_that_claims_a_long_name() -> Vec<u8> {
    let mut body = u32::MAX.to_le_bytes().to_vec();
    body.extend(b"name");
    [&MAGIC[..], &HEADER, &record(12, &body)].concat()
}

fn record_that_claims_its_length(opcode: u8, length: u64) -> Vec<u8> {
    let mut bytes = [&MAGIC[..], &HEADER].concat();
    bytes.push(opcode);
    bytes.extend((length - bytes.len() as u64 - 8).to_le_bytes());
    bytes.extend([0; 64]);
    bytes
}

/// A footer at the end of the file that says that its summary begins at byte 25.
fn footer_of_a_long_summary() -> Vec<u8> {
    let mut bytes = [&MAGIC[..], &HEADER].concat();
    bytes.resize(64, 0);
    let mut footer = 25_u64.to_le_bytes().to_vec();
    footer.extend([0; 12]);
    bytes.extend(record(2, &footer));
    bytes.extend(MAGIC);
    bytes
}
