//! Boots the rig: `tests/rig/rig`.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::{atvrec, project};

/// Where a guest script's output goes.
#[must_use]
pub fn output_folder(script: &str) -> PathBuf {
    project().join("target/rig-out").join(script)
}

/// Makes the output folder of a guest script anew, with the program in it.
///
/// # Panics
/// If the folder cannot be made.
#[must_use]
pub fn new_output_folder(script: &str) -> PathBuf {
    let out = output_folder(script);
    let _ = std::fs::remove_dir_all(&out);
    std::fs::create_dir_all(&out).expect("output folder");
    std::fs::copy(atvrec(), out.join("atvrec")).expect("the guest gets a copy of the binary");
    out
}

/// Adds what a guest script installs: the package that the environment names, or the files of which it is
/// made.
///
/// # Panics
/// If a file cannot be copied.
#[allow(
    clippy::disallowed_methods,
    reason = "the environment names the package"
)]
pub fn install_folder(out: &Path) {
    copy_folder(&project().join("packaging"), &out.join("packaging"));
    let script = project().join("tests/rig/guest/install.sh");
    std::fs::copy(script, out.join("install.sh")).expect("copied");
    if let Some(package) = std::env::var_os("ATVREC_DEB") {
        std::fs::copy(package, out.join("atvrec.deb")).expect("the package is there");
    }
}

fn copy_folder(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).expect("a folder");
    for entry in std::fs::read_dir(from).expect("readable") {
        let entry = entry.expect("readable").path();
        let target = to.join(entry.file_name().expect("a name"));
        if entry.is_dir() {
            copy_folder(&entry, &target);
        } else {
            std::fs::copy(&entry, &target).expect("copied");
        }
    }
}

/// Boots the rig with a guest script; its output folder must be there.
///
/// # Panics
/// If the script does not end with status 0; says what it said.
pub fn boot(script: &str, options: &[&str]) {
    let out = output_folder(script);
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
    println!("{output}");
}
