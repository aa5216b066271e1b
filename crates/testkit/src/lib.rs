//! What the tests of several crates share. It is a dependency of tests only.
//!
//! - [`shared`] finds the recordings beside the project, [`report`] prints what a test found,
//!   [`assert_file`] compares with a file that `make bless` writes.
//! - Feature `truth`: `truth` loads the runs of an independent simulator, `sensing` makes the
//!   samples of the thesis's sensors on a run, `drive` a run of the virtual vehicle, and
//!   `scoring` runs the estimator and compares it with the run.
//! - Feature `controllers`: `controllers` compares frames of `output.can` with a log.

mod allocations;
#[cfg(feature = "controllers")]
pub mod controllers;
#[cfg(feature = "truth")]
pub mod drive;
mod hostile;
#[cfg(feature = "truth")]
mod once;
#[cfg(feature = "truth")]
pub mod scoring;
#[cfg(feature = "truth")]
pub mod sensing;
#[cfg(feature = "truth")]
pub mod truth;

use std::cell::Cell;
use std::io::Write;
use std::path::{Path, PathBuf};

pub use allocations::{Counting, allocations};
pub use hostile::log_of_zeros;

/// Environment variable that says whether the recordings in `../shared` must be there (`1`), are left
/// out (`0`), or are read where they are (unset).
const REQUIRE: &str = "ATVREC_REQUIRE_DATA";
/// Environment variable that makes [`assert_file`] write the file.
const BLESS: &str = "ATVREC_BLESS";

/// The project's root.
#[must_use]
pub fn project() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

#[allow(
    clippy::disallowed_methods,
    reason = "make and CI choose in the environment which tests run"
)]
fn variable(name: &str) -> Option<String> {
    std::env::var(name).ok()
}

/// Path of a file or folder of the recordings beside the project, `../shared/<name>`. Where it is
/// absent, or `ATVREC_REQUIRE_DATA` is `0`, the result is `None`, and a line of the test's output
/// says so.
///
/// # Panics
/// If it is absent and `ATVREC_REQUIRE_DATA` is `1`.
#[must_use]
pub fn shared(name: &str) -> Option<PathBuf> {
    let path = project().join("../shared").join(name);
    let required = variable(REQUIRE);
    let why = match required.as_deref() {
        Some("0") => "is not read",
        _ if path.exists() => return Some(path),
        Some(_) => panic!("../shared/{name} is missing, and {REQUIRE} is set"),
        None => "is missing",
    };
    // A test has its own thread: one line is enough where it needs several recordings.
    if !LEFT_OUT.replace(true) {
        report(&format!("left out, ../shared/{name} {why}"));
    }
    None
}

thread_local! {
    /// Whether the running test has reported that it is left out.
    static LEFT_OUT: Cell<bool> = const { Cell::new(false) };
}

/// Prints a line with the name of the running test. The line is printed also where the test passes,
/// whose output `cargo test` hides otherwise.
pub fn report(line: &str) {
    let thread = std::thread::current();
    let test = thread.name().unwrap_or("a test");
    // Only the macros of the standard library write into the hidden output.
    let _ = writeln!(std::io::stderr(), "    {test}: {line}");
}

/// Compares a text or other bytes with a file of the project, which `make bless` writes.
///
/// # Panics
/// If the file has other contents, with the first line that differs.
pub fn assert_file(path: &str, contents: impl AsRef<[u8]>) {
    let (file, contents) = (project().join(path), contents.as_ref());
    if variable(BLESS).is_some() {
        std::fs::write(&file, contents).unwrap_or_else(|error| panic!("{path}: {error}"));
        return;
    }
    let stored = std::fs::read(&file).unwrap_or_else(|error| panic!("{path}: {error}"));
    if stored == contents {
        return;
    }
    let lines = |bytes: &[u8]| {
        let text = String::from_utf8_lossy(bytes).into_owned();
        text.lines().map(str::to_owned).collect::<Vec<_>>()
    };
    let (old, new) = (lines(&stored), lines(contents));
    let same = old.iter().zip(&new).take_while(|(old, new)| old == new);
    let number = same.count();
    let [old, new] = [old, new].map(|lines| lines.get(number).cloned().unwrap_or_default());
    panic!(
        "{path}:{} is not current: run `make bless` and review the difference\n  the file has: \
         {old}\n  now it is:    {new}",
        number + 1
    );
}
