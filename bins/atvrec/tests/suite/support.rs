use std::path::{Path, PathBuf};

use assert_cmd::Command;

/// The program, in `directory`.
pub fn atvrec(directory: &Path) -> Command {
    let mut command = Command::cargo_bin("atvrec").expect("the program is built");
    command.current_dir(directory).env_remove("ATVREC_LOG");
    command
}

/// Sorted names in a directory; none if it does not exist.
pub fn names(directory: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(directory).into_iter().flatten();
    let mut names: Vec<_> = entries
        .map(|entry| entry.expect("an entry").file_name())
        .map(|name| name.to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// A source whose device does not exist: a recording needs a source.
pub const ABSENT: &str = "[source.imu]\nkind = \"crossbow440\"\ndevice = \"absent\"\n";
/// Exit code of a recording that received nothing.
pub const NOTHING_RECEIVED: i32 = 3;

/// A simulated drive of two seconds.
pub fn simulate(directory: &Path, name: &str, seed: u32) -> PathBuf {
    let path = directory.join(name);
    atvrec(directory)
        .args([
            "--quiet",
            "simulate",
            "--manoeuvre",
            "step-steer",
            "--for",
            "2",
        ])
        .args(["--seed", &seed.to_string(), "--output", name])
        .assert()
        .success();
    path
}

/// What a run printed on standard output.
pub fn stdout(assert: &assert_cmd::assert::Assert) -> String {
    String::from_utf8_lossy(&assert.get_output().stdout).into_owned()
}

/// What a run printed on standard error.
pub fn stderr(assert: &assert_cmd::assert::Assert) -> String {
    String::from_utf8_lossy(&assert.get_output().stderr).into_owned()
}
