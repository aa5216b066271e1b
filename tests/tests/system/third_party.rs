//! Licences of the packages in the program.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

/// Every package that is linked into the program is named with its licence and with texts that are there.
#[test]
fn every_package_in_the_program_has_its_licence_text() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let directory = tempfile::tempdir().expect("a directory");
    let output = directory.path().join("THIRD-PARTY");
    let made = Command::new(root.join("scripts/third-party"))
        .arg("atvrec")
        .arg(&output)
        .output();
    let Ok(made) = made else {
        println!("python3 is not installed: the licences are not tested");
        return;
    };
    assert!(
        made.status.success(),
        "{}",
        String::from_utf8_lossy(&made.stderr)
    );
    let text = std::fs::read_to_string(&output).expect("written");
    let (head, texts) = text.split_once("\n====").expect("texts");
    let numbers: BTreeSet<&str> = texts
        .lines()
        .filter_map(|line| line.strip_prefix("Text "))
        .collect();
    let mut named = BTreeSet::new();
    for line in head.lines().filter(|line| line.contains("(texts ")) {
        let (name, own) = line.split_once(": ").expect("a licence");
        let (licence, own) = own.split_once(" (texts ").expect("texts");
        assert!(licence.len() > 2, "{line}");
        let own = own.trim_end_matches(')');
        assert!(
            own.split(", ").all(|number| numbers.contains(number)),
            "{line}"
        );
        named.insert(name.to_owned());
    }
    // Packages of all kinds: on the processor alone, with C code, under MPL-2.0.
    let lock = std::fs::read_to_string(root.join("Cargo.lock")).expect("the lock file");
    let lock: toml::Table = lock.parse().expect("TOML");
    let packages = lock["package"].as_array().expect("packages");
    let version = |name: &str| {
        let found = packages
            .iter()
            .find(|package| package["name"].as_str() == Some(name));
        found.expect(name)["version"]
            .as_str()
            .expect("a version")
            .to_owned()
    };
    for name in ["mcap", "nalgebra", "zstd-sys", "clap", "tokio"] {
        let named_so = format!("{name} {}", version(name));
        assert!(named.contains(&named_so), "{named_so}");
    }
    for foreign in ["atvrec", "tempfile ", "insta "] {
        assert!(
            !named.iter().any(|name| name.starts_with(foreign)),
            "{foreign}"
        );
    }
    assert!(texts.contains("Apache License") && texts.contains("Permission is hereby granted"));
}
