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
    let section = section.and_then(|part| part.split("\n### ").next());
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
        let lists = ["signals", "forces"].map(|list| found[list].as_array());
        for row in lists.into_iter().flatten().flatten() {
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
    let promised = [
        "wheel",
        "at_s",
        "duration_s",
        "declared_after_s",
        "warned_before_s",
        "fall_s",
        "warning_due_s",
    ];
    assert_eq!(keys(lift), promised.map(str::to_owned).into());
}

/// A flat and a rough excerpt of an independent simulator's runs, with the largest errors in per cent
/// (10 bit, worst wheel): F_x, F_y, F_z in the wheel-carrier frame, and the same in the contact frame.
const EXCERPTS: [(&str, [[f64; 3]; 2]); 2] = [
    ("c_sine03", [[0.8; 3], [0.8; 3]]),
    ("r2_iso_e_a", [[4.5, 6.5, 13.0], [9.0, 9.0, 13.0]]),
];

/// Forces are scored in both frames, each with its own truth, and on flat ground they are better than by
/// each simple method.
#[test]
fn forces_of_excerpts_are_scored_in_both_frames() {
    for (name, most) in EXCERPTS {
        let directory = tempfile::tempdir().expect("a directory");
        let truth = testkit::project().join(format!("testdata/truth/{name}.parquet"));
        let truth = truth.to_str().expect("UTF-8");
        atvrec(directory.path())
            .args([
                "-q",
                "simulate",
                "--truth",
                truth,
                "--seed",
                "11",
                "-o",
                "drive.mcap",
            ])
            .assert()
            .success();
        let found = scored(directory.path(), &["--methods"]);
        let forces = found["forces"].as_array().expect("a list");
        for (row, (frame, most)) in forces
            .iter()
            .zip(["wheel_carrier", "contact"].iter().zip(most))
        {
            testkit::report(&format!("{name}, {frame}: {}", row["worst_percent"]));
            assert_eq!(
                [&row["frame"], &row["estimate_frame"]],
                [frame, frame],
                "{row}"
            );
            for (axis, most) in most.into_iter().enumerate() {
                let percent = row["worst_percent"][axis].as_f64().expect("a number");
                assert!(percent < most, "{name}: {row}");
            }
        }
        let methods = found["methods"].as_array().expect("a list");
        let names: BTreeSet<_> = methods
            .iter()
            .filter_map(|row| row["output"].as_str())
            .collect();
        assert_eq!(names, ["deflection", "model", "statics"].into());
        for row in methods.iter().filter(|row| row["frame"] == "wheel_carrier") {
            testkit::report(&format!(
                "{name}, {}: {}",
                row["output"], row["worst_percent"]
            ));
            let [simple, own] = [row, &forces[0]].map(|row| row["worst_percent"][2].as_f64());
            // On level ground the statics tell the load as well as the filter does.
            let most = own.map(|own| 0.7 * own);
            assert!(simple > most || name.starts_with('r'), "{row}");
        }
        assert_eq!(found["channels"]["injected_faults"], 0);
    }
}
