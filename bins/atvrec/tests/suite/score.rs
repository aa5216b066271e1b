//! The keys of `atvrec score --json` are those that `docs/score.md` promises.

use std::collections::BTreeSet;

use serde_json::Value;

use crate::support::{atvrec, stdout};

/// Keys of one section's table; those of list entries begin with a dot.
fn promised(section: &str) -> BTreeSet<String> {
    let document = include_str!("../../../../docs/score.md");
    let section = document
        .split("\n## ")
        .find(|part| part.starts_with(section));
    let rows = section.expect("the section").lines();
    let rows = rows.filter(|line| line.starts_with("| `"));
    let keys = rows.flat_map(|row| row.split('|').nth(1).unwrap_or_default().split(','));
    keys.map(|key| key.trim().trim_matches('`').to_owned())
        .collect()
}

fn keys(value: &Value) -> BTreeSet<String> {
    let object = value.as_object().expect("an object");
    object.keys().cloned().collect()
}

fn scored(directory: &std::path::Path, arguments: &[&str]) -> Value {
    let assert = atvrec(directory)
        .args(["score", "drive.mcap", "--json"])
        .args(arguments)
        .assert()
        .success();
    serde_json::from_str(&stdout(&assert)).expect("JSON")
}

#[test]
fn every_key_is_promised_and_every_promise_kept() {
    let directory = tempfile::tempdir().expect("a directory");
    atvrec(directory.path())
        .args([
            "-q",
            "simulate",
            "--manoeuvre",
            "circle",
            "-o",
            "drive.mcap",
        ])
        .assert()
        .success();
    for (section, arguments) in [
        ("Against the truth", vec![]),
        ("Against another log", vec!["--against", "drive.mcap"]),
    ] {
        let promised = promised(section);
        let found = scored(directory.path(), &arguments);
        let mut all = keys(&found);
        for row in found["signals"].as_array().expect("a list") {
            let mut of_row: BTreeSet<_> = keys(row).iter().map(|key| format!(".{key}")).collect();
            all.append(&mut of_row);
        }
        assert_eq!(all, promised, "{section}");
    }
    let promised = promised("Innovations");
    let alone = scored(directory.path(), &["--innovations"]);
    let found = scored(directory.path(), &[]);
    assert_eq!(alone["innovations"], found["innovations"]);
    for row in found["innovations"].as_array().expect("a list") {
        assert_eq!(keys(row), promised);
        let mean = row["mean"].as_f64().expect("a number");
        assert!((0.1..2.0).contains(&mean), "{row}");
    }
    let lift = &found["lifts"][0];
    let promised = ["wheel", "at_s", "declared_after_s", "warned_before_s"];
    assert_eq!(keys(lift), promised.map(str::to_owned).into());
}
