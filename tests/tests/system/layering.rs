//! Imports go down only: the floors of ARCHITECTURE.md, checked against the manifests.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Floor of each crate; an edge must lead to a lower floor.
const FLOORS: [(&str, u8); 14] = [
    ("math", 0),
    ("sample", 0),
    ("wire", 1),
    ("model", 1),
    ("store", 1),
    ("estimator", 2),
    ("acq", 2),
    ("sim", 2),
    ("engine", 3),
    ("report", 3),
    ("live", 3),
    ("testkit", 3),
    ("pybind", 5),
    ("atvrec", 4),
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("tests/ stands in the project")
        .into()
}

fn manifest(path: &Path) -> toml::Table {
    let text =
        std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    text.parse()
        .unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn internal_dependencies(manifest: &toml::Table, floors: &BTreeMap<&str, u8>) -> Vec<String> {
    manifest
        .get("dependencies")
        .and_then(toml::Value::as_table)
        .map(|table| {
            table
                .keys()
                .filter(|name| floors.contains_key(name.as_str()))
                .cloned()
        })
        .into_iter()
        .flatten()
        .collect()
}

#[test]
fn imports_go_down_only() {
    let floors: BTreeMap<&str, u8> = FLOORS.into_iter().collect();
    let mut seen = 0;
    for (name, floor) in FLOORS {
        let folder = if name == "atvrec" { "bins" } else { "crates" };
        let path = root().join(folder).join(name).join("Cargo.toml");
        for dependency in internal_dependencies(&manifest(&path), &floors) {
            seen += 1;
            assert!(
                floors[dependency.as_str()] < floor,
                "{name} (floor {floor}) must not import {dependency} (floor {})",
                floors[dependency.as_str()]
            );
        }
    }
    assert!(
        seen > 10,
        "only {seen} edges found: the manifests are not being read"
    );
}

#[test]
fn every_crate_has_a_floor() {
    for entry in std::fs::read_dir(root().join("crates")).expect("crates/ exists") {
        let name = entry
            .expect("readable entry")
            .file_name()
            .into_string()
            .expect("UTF-8 name");
        assert!(
            FLOORS.iter().any(|(known, _)| *known == name),
            "{name} has no floor"
        );
    }
}

/// Clippy's lists of disallowed types and methods keep clocks and the environment out of the crates
/// below floor 4 (`clippy.toml`). Which files may allow them is said here: `acq` stamps arrivals,
/// the recorder's own threads time the disk, and the live process paces what it shows.
#[test]
fn only_three_files_below_floor_4_allow_clocks() {
    const MAY: [&str; 3] = ["acq/src/lib.rs", "live/src/lib.rs", "store/src/recorder.rs"];
    let mut found = 0;
    // `testkit` is a dependency of tests only.
    let below = FLOORS
        .into_iter()
        .filter(|(name, floor)| *floor < 4 && *name != "testkit");
    for (name, _) in below {
        for file in rust_files(&root().join("crates").join(name).join("src")) {
            let text = std::fs::read_to_string(&file).expect("readable source");
            let of_tests = file.file_name().is_some_and(|name| name == "tests.rs");
            if !of_tests && text.contains("clippy::disallowed") {
                found += 1;
                assert!(
                    MAY.iter().any(|path| file.ends_with(path)),
                    "{} allows what clippy.toml disallows",
                    file.display()
                );
            }
        }
    }
    assert_eq!(found, MAY.len(), "files that allow clocks");
}

fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).expect("source folder exists") {
        let path = entry.expect("readable entry").path();
        if path.is_dir() {
            found.extend(rust_files(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
    found
}

/// What tests share stays out of the product.
#[test]
fn testkit_is_a_dependency_of_tests_only() {
    for (name, _) in FLOORS {
        let folder = if name == "atvrec" { "bins" } else { "crates" };
        let manifest = manifest(&root().join(folder).join(name).join("Cargo.toml"));
        let dependencies = manifest.get("dependencies").and_then(toml::Value::as_table);
        assert!(
            !dependencies.is_some_and(|table| table.contains_key("testkit")),
            "{name} depends on testkit"
        );
    }
}
