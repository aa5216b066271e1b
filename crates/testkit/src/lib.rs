//! What the tests of several crates share. It is a dependency of tests only.

use std::path::{Path, PathBuf};

/// Environment variable that makes absent test data a failure.
const REQUIRE: &str = "ATVREC_REQUIRE_DATA";

/// Path of a file or folder of the test data beside the project, `../shared/<name>`. Where it is
/// absent the result is `None`, and a message says so.
///
/// # Panics
/// If it is absent and the environment variable `ATVREC_REQUIRE_DATA` is set to anything but `0`.
#[must_use]
#[allow(
    clippy::disallowed_methods,
    reason = "CI says in the environment that the data must be there"
)]
pub fn shared(name: &str) -> Option<PathBuf> {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared");
    let path = Path::new(root).join(name);
    if path.exists() {
        return Some(path);
    }
    let required = std::env::var(REQUIRE).is_ok_and(|value| value != "0");
    assert!(
        !required,
        "test data is missing: {}, and {REQUIRE} is set",
        path.display()
    );
    eprintln!("SKIPPED: test data is missing: {}", path.display());
    None
}
