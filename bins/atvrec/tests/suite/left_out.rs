//! Decoded CAN messages that are not written: `record.decoded`.

use std::fs;
use std::path::Path;

use store::Reader;

use crate::support::{atvrec, simulate, stderr, stdout};

/// A DBC file whose message replaces that of the wheel speeds, without a role.
const OTHER: &str = "VERSION \"\"\nNS_ :\nBS_:\nBU_: A\n\nBO_ 528 Wheels: 8 A\n \
    SG_ left : 0|16@1- (0.5,1) [0|0] \"rpm\" A\n SG_ right : 16|16@1- (0.5,1) [0|0] \"rpm\" A\n";
/// Topic of its message.
const WHEELS: &str = "/can/can0/Wheels";
/// Topic of a message with a role.
const STEERING: &str = "/can/can0/Steering";

/// Logs of the same drive that write all decoded messages, those with a role, and none.
fn logs(directory: &Path) -> [&'static str; 3] {
    let drive = simulate(directory, "drive.mcap", 1);
    let reader = Reader::open([drive]).expect("a log");
    for attachment in reader.attachments().expect("attachments") {
        fs::write(directory.join(&attachment.name), &attachment.data).expect("written");
    }
    fs::write(directory.join("other.dbc"), OTHER).expect("written");
    let text = fs::read_to_string(directory.join("atvrec.toml")).expect("a configuration");
    let (before, after) = text
        .split_once("[source.can0]\n")
        .unwrap_or_else(|| panic!("{text}"));
    let text = format!(
        "{before}[source.can0]\ndbc = [\"other.dbc\", \"prowler.dbc\"]\n{}",
        after.replace("dbc = [\"prowler.dbc\"]\n", "")
    );
    [
        ("all.mcap", "all"),
        ("roles.mcap", "roles"),
        ("none.mcap", "none"),
    ]
    .map(|(log, decoded)| {
        let record = match decoded {
            "roles" => String::new(),
            other => format!("\n[record]\ndecoded = \"{other}\"\n"),
        };
        fs::write(directory.join("written.toml"), format!("{text}{record}")).expect("written");
        atvrec(directory)
            .args([
                "--quiet",
                "simulate",
                "--manoeuvre",
                "step-steer",
                "--for",
                "2",
            ])
            .args(["--config", "written.toml", "--output", log])
            .assert()
            .success();
        log
    })
}

fn topics(directory: &Path, log: &str) -> Vec<String> {
    let reader = Reader::open([directory.join(log)]).expect("a log");
    reader.info().channels.into_keys().collect()
}

fn export(directory: &Path, log: &str, topic: &str, span: &[&str]) -> String {
    let assert = atvrec(directory)
        .args(["export", log, "--topic", topic])
        .args(span)
        .assert()
        .success();
    stdout(&assert)
}

#[test]
fn messages_without_a_role_are_not_written_and_still_exported() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let [all, roles, none] = logs(here);
    let written = [all, roles, none].map(|log| {
        let topics = topics(here, log);
        [WHEELS, STEERING].map(|topic| topics.iter().any(|known| known == topic))
    });
    assert_eq!(written, [[true, true], [false, true], [false, false]]);
    let steer = [all, none].map(|log| topics(here, log).contains(&"/steer".to_owned()));
    assert_eq!(steer, [true; 2], "measurements are always written");
    for topic in [WHEELS, STEERING] {
        for span in [&[][..], &["--from", "0.5", "--to", "1.25"]] {
            let expected = export(here, all, topic, span);
            assert!(expected.lines().count() > 20, "{expected}");
            for log in [roles, none] {
                assert!(
                    export(here, log, topic, span) == expected,
                    "{topic} of {log}"
                );
            }
        }
    }
    assert!(export(here, roles, WHEELS, &[]).contains("left[rpm]"));
    let sizes = [all, roles, none].map(|log| fs::metadata(here.join(log)).expect("a log").len());
    assert!(sizes.is_sorted_by(|a, b| a > b), "{sizes:?}");
}

#[test]
fn a_log_that_leaves_messages_out_is_verified_and_its_replay_has_them() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let [all, roles, none] = logs(here);
    for log in [all, roles, none] {
        let output = format!("again-{log}");
        let assert = atvrec(here)
            .args(["replay", log, "--verify", "-o", &output])
            .assert()
            .success();
        assert!(stdout(&assert).contains("are bit-identical"), "{log}");
        let has = topics(here, &output);
        assert!(
            [WHEELS, STEERING]
                .iter()
                .all(|topic| has.iter().any(|known| known == topic)),
            "{has:?}"
        );
        assert!(export(here, &output, WHEELS, &[]) == export(here, all, WHEELS, &[]));
        atvrec(here)
            .args(["replay", &output, "--verify"])
            .assert()
            .success();
        let report = format!("{log}.html");
        atvrec(here)
            .args(["report", log, "-o", &report])
            .assert()
            .success();
    }
    let assert = atvrec(here)
        .args(["info", roles, "--json"])
        .assert()
        .success();
    let info: serde_json::Value = serde_json::from_str(&stdout(&assert)).expect("JSON");
    let left_out = info["left_out"].as_array().expect("a list");
    assert!(left_out.contains(&WHEELS.into()), "{left_out:?}");
    assert!(!left_out.contains(&STEERING.into()), "{left_out:?}");
    let text = stdout(&atvrec(here).args(["info", roles]).assert().success());
    assert!(
        text.contains(&format!("(record.decoded)\n{WHEELS}\n")),
        "{text}"
    );
    let wrong = atvrec(here)
        .args(["export", roles, "--topic", "/can/can0/Wheel"])
        .assert()
        .failure();
    assert!(stderr(&wrong).contains("did you mean /can/can0/Wheels?"));
}

#[test]
fn an_unknown_value_is_an_error_with_the_known_ones() {
    let directory = tempfile::tempdir().expect("a directory");
    let text =
        "[source.can0]\nkind = \"can\"\ninterface = \"can0\"\n[record]\ndecoded = \"signals\"\n";
    fs::write(directory.path().join("atvrec.toml"), text).expect("written");
    let assert = atvrec(directory.path())
        .args(["check", "--no-devices"])
        .assert()
        .code(2);
    let text = stderr(&assert);
    assert!(
        text.contains("record.decoded") && text.contains("all, roles, none"),
        "{text}"
    );
}
