//! Gives the crate the commit that it is built from, and a date that no later run can be before.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    reason = "a build script is given its inputs in the environment"
)]

use std::path::Path;
use std::process::Command;

/// Date of a source without history: 2026-01-01.
const UNKNOWN_BUILD_UNIX_S: u64 = 1_767_225_600;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    // In a linked work tree these files are not below `.git`.
    for name in ["HEAD", "logs/HEAD"] {
        let path = git(&["rev-parse", "--path-format=absolute", "--git-path", name]);
        if let Some(path) = path.filter(|path| Path::new(path).exists()) {
            println!("cargo::rerun-if-changed={path}");
        }
    }
    let hash = git(&["rev-parse", "--short=12", "HEAD"]).unwrap_or_else(|| "unknown".to_owned());
    println!("cargo::rustc-env=ATVREC_GIT_HASH={hash}");
    println!("cargo::rerun-if-env-changed=SOURCE_DATE_EPOCH");
    println!("cargo::rustc-env=ATVREC_BUILD_UNIX_S={}", build_unix_s());
}

/// Date of the source, s since 1970: reproducible, unlike the time of the build itself.
fn build_unix_s() -> u64 {
    let given = std::env::var("SOURCE_DATE_EPOCH").ok();
    given
        .or_else(|| git(&["log", "-1", "--format=%ct"]))
        .and_then(|text| text.trim().parse().ok())
        .unwrap_or(UNKNOWN_BUILD_UNIX_S)
}

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = output.status.success().then_some(output.stdout)?;
    Some(String::from_utf8(text).ok()?.trim().to_owned())
}
