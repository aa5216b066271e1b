//! Helpers shared by the cross-crate tests.

pub mod rig;

use std::path::{Path, PathBuf};

use sample::Health;
use store::{Reader, Record, Selection};

/// The project's root.
#[must_use]
pub fn project() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("tests/ stands in the project")
        .to_owned()
}

/// The binary that was built beside these tests.
///
/// # Panics
/// If there is none: `cargo build --bin atvrec` makes it.
#[must_use]
pub fn atvrec() -> PathBuf {
    let test = std::env::current_exe().expect("a test knows its own path");
    let folder = test
        .parent()
        .and_then(Path::parent)
        .expect("target/<profile>/deps/<test>");
    let binary = folder.join("atvrec");
    assert!(
        binary.exists(),
        "{} is missing: cargo build --bin atvrec",
        binary.display()
    );
    binary
}

/// The logs in a folder, in order.
///
/// # Panics
/// If there are none.
#[must_use]
pub fn logs_in(folder: &Path) -> Vec<PathBuf> {
    let entries =
        std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut logs: Vec<PathBuf> = entries
        .map(|entry| entry.expect("readable").path())
        .collect();
    // Kept originals and damaged journals stand beside them.
    let ends = |path: &PathBuf, end: &str| path.to_string_lossy().ends_with(end);
    logs.retain(|path| ends(path, ".mcap") || ends(path, ".mcap.active"));
    logs.sort();
    assert!(!logs.is_empty(), "no log in {}", folder.display());
    logs
}

/// All health reports of a log, in order.
///
/// # Panics
/// If the log cannot be read.
#[must_use]
pub fn health_reports(logs: &[PathBuf]) -> Vec<Health> {
    let reader = Reader::open(logs).expect("the log opens");
    let messages = reader.messages(Selection::topics(["/health"]));
    messages
        .filter_map(
            |message| match message.expect("readable").record().expect("valid") {
                Some(Record::Health(health)) => Some(health),
                _ => None,
            },
        )
        .collect()
}
