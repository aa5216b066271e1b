//! The report of a drive as a page.

use crate::support::{atvrec, simulate};

#[test]
fn a_report_shows_the_drive_and_what_was_learnt_in_one_file() {
    let directory = tempfile::tempdir().expect("a directory");
    simulate(directory.path(), "drive.mcap", 1);
    atvrec(directory.path())
        .args(["report", "drive.mcap", "--output", "page.html"])
        .assert()
        .success();
    let page = std::fs::read_to_string(directory.path().join("page.html")).expect("a page");
    let sections = [
        "speed", "sideslip", "lateral", "vertical", "grip", "track", "events", "learnt", "sources",
        "files",
    ];
    for section in sections {
        assert!(
            page.contains(&format!("<h2 id=\"{section}\">")),
            "{section}"
        );
    }
    assert!(page.contains("accelerometer bias, x") && page.contains("stiffness factor, rear"));
    let (_, body) = page.rsplit_once("<body>").expect("a body");
    assert!(!body.contains("NaN"), "a number that is none");
}
