use std::fs;

use crate::support::{atvrec, stderr, stdout};

const FAULTY: &str = r#"
[source.imu]
kind = "crossbow440"
baud = "fast"
rate_hz = 33

[source."can 0"]
kind = "canbus"

[source.can1]
kind = "can"
interface = "can1"
bitrat = 500000
[source.can1.roles]
steer = "Steering.handwheel"
deflection.FL = "nonsense"

[source.gps]
kind = "gnss"
device = "/dev/ttyS7"
velocity_latency_s = -1

[source.gps2]
kind = "gnss"
device = "/dev/ttyS7"

[vehicle]
file = "prowlr.toml"

[estimator]
method = "fushion"
ignore = ["strian"]

[storage]
rotate_after_s = -1
compresion = "zstd"
"#;

#[test]
fn all_errors_are_told_at_once_with_place_and_next_step() {
    let directory = tempfile::tempdir().expect("a directory");
    fs::write(directory.path().join("atvrec.toml"), FAULTY).expect("written");
    let assert = atvrec(directory.path()).arg("check").assert().code(2);
    insta::assert_snapshot!(stderr(&assert));
    // The recorder refuses it with the same words.
    let recorded = atvrec(directory.path()).arg("record").assert().code(2);
    assert_eq!(stderr(&assert), stderr(&recorded));
}

#[test]
fn errors_are_told_as_json_too() {
    let directory = tempfile::tempdir().expect("a directory");
    fs::write(directory.path().join("atvrec.toml"), FAULTY).expect("written");
    let assert = atvrec(directory.path())
        .args(["check", "--json"])
        .assert()
        .code(2);
    let result: serde_json::Value = serde_json::from_str(&stdout(&assert)).expect("JSON");
    let errors = result["errors"].as_array().expect("a list");
    assert!(errors.len() >= 12, "{errors:#?}");
    assert!(
        errors
            .iter()
            .any(|e| e["field"] == "source.imu.baud" && e["line"] == 4)
    );
}

#[test]
fn syntax_errors_have_their_line() {
    let directory = tempfile::tempdir().expect("a directory");
    fs::write(
        directory.path().join("atvrec.toml"),
        "[source.imu]\nkind = \"crossbow440\ndevice = 3\n",
    )
    .expect("written");
    let assert = atvrec(directory.path()).arg("check").assert().code(2);
    let text = stderr(&assert);
    assert!(text.contains("atvrec.toml:2:"), "{text}");
}

#[test]
fn a_missing_configuration_says_where_to_get_one() {
    let directory = tempfile::tempdir().expect("a directory");
    for verb in ["record", "check"] {
        let assert = atvrec(directory.path()).arg(verb).assert().code(2);
        let text = stderr(&assert);
        assert!(
            text.contains("cannot read the configuration atvrec.toml"),
            "{text}"
        );
        assert!(text.contains("docs/configuration.md"), "{text}");
    }
}

#[test]
fn errors_of_the_vehicle_file_stand_beside_those_of_the_configuration() {
    let directory = tempfile::tempdir().expect("a directory");
    fs::write(directory.path().join("mine.toml"), "name = 3\nmas_kg = 4\n").expect("written");
    fs::write(
        directory.path().join("atvrec.toml"),
        "[vehicle]\nfile = \"mine.toml\"\n[storage]\ndirectry = \"x\"\n",
    )
    .expect("written");
    let assert = atvrec(directory.path()).arg("check").assert().code(2);
    let text = stderr(&assert);
    assert!(text.contains("atvrec.toml:4"), "{text}");
    assert!(text.contains("mine.toml:"), "{text}");
}

#[test]
fn wrong_usage_is_exit_code_2() {
    let directory = tempfile::tempdir().expect("a directory");
    atvrec(directory.path()).arg("recrod").assert().code(2);
    atvrec(directory.path())
        .args(["record", "--for", "-3"])
        .assert()
        .code(2);
    let assert = atvrec(directory.path())
        .args(["simulate", "--manoeuvre", "moonwalk", "-o", "x.mcap"])
        .assert()
        .code(2);
    assert!(stderr(&assert).contains("step-steer"));
}

/// As under `| head -1` once `head` has its line.
#[test]
fn a_reader_that_leaves_is_no_failure() {
    let directory = tempfile::tempdir().expect("a directory");
    crate::support::simulate(directory.path(), "drive.mcap", 1);
    for arguments in [
        &["info", "drive.mcap"][..],
        &["export", "drive.mcap", "--topic", "/estimate/tyre_forces"],
        &["completions", "bash"],
    ] {
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        let ended = std::process::Command::new(env!("CARGO_BIN_EXE_atvrec"))
            .args(arguments)
            .current_dir(directory.path())
            .stdout(writer)
            .output()
            .expect("the program runs");
        let told = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(
            (ended.status.code(), &*told),
            (Some(0), ""),
            "{arguments:?}"
        );
    }
}

#[test]
fn completions_are_printed_for_each_shell() {
    let directory = tempfile::tempdir().expect("a directory");
    for shell in ["bash", "zsh", "fish"] {
        let assert = atvrec(directory.path())
            .args(["completions", shell])
            .assert()
            .success();
        assert!(stdout(&assert).contains("replay"), "{shell}");
    }
}

#[test]
fn every_command_has_a_manual_page() {
    let directory = tempfile::tempdir().expect("a directory");
    atvrec(directory.path())
        .args(["man", "pages"])
        .assert()
        .success();
    let pages = directory.path().join("pages");
    let read = |page: &str| fs::read_to_string(pages.join(page)).expect(page);
    let names = crate::support::names(&pages);
    let commands = names.iter().filter(|name| name.ends_with(".1"));
    let mut count = 0;
    for page in commands {
        let text = read(page);
        for part in [
            ".SH SYNOPSIS",
            ".SH EXAMPLES\n.TP\n\\fBatvrec",
            ".SH \"EXIT STATUS\"\n.TP\n\\fB0\\fR",
            "finished, but data was lost",
        ] {
            assert_eq!(text.matches(part).count(), 1, "{page}: {part}: {text}");
        }
        count += 1;
    }
    assert!(count > 50, "{names:?}");
    // The pages of the files have every field of the documentation.
    for (page, document) in [
        ("atvrec.toml.5", "configuration"),
        ("atvrec-vehicle.5", "vehicle-file"),
        ("atvrec-sensors.5", "sensors-file"),
    ] {
        let (text, path) = (read(page), format!("docs/{document}.md"));
        let markdown = fs::read_to_string(testkit::project().join(path)).expect("a document");
        let fields = markdown.lines().filter_map(|line| line.strip_prefix("| `"));
        let mut fields = fields.filter_map(|line| line.split('`').next());
        assert!(text.contains(".SH NAME\natvrec"), "{page}");
        let escaped = |field: &str| field.replace('.', "\\&.").replace('-', "\\-");
        let has = |field: &str| text.contains(&format!("\\fB{field}\\fR"));
        let absent = fields.find(|field| !has(field) && !has(&escaped(field)));
        assert_eq!(absent, None, "{page}");
    }
}

#[test]
fn a_vehicle_file_is_made_from_a_simulators_parameters() {
    let parameters = testkit::project().join("testdata/truth/params.json");
    let parameters = parameters.to_str().expect("UTF-8");
    let directory = tempfile::tempdir().expect("a directory");
    atvrec(directory.path())
        .args(["import", "vehicle", parameters, "-o", "vehicle.toml"])
        .assert()
        .success();
    fs::write(
        directory.path().join("atvrec.toml"),
        "[vehicle]\nfile = \"vehicle.toml\"\n",
    )
    .expect("written");
    atvrec(directory.path())
        .args(["check", "--no-devices"])
        .assert()
        .success();
}

#[test]
fn who_brings_an_interface_up_is_checked() {
    let directory = tempfile::tempdir().expect("a directory");
    let check = |text: &str| {
        fs::write(directory.path().join("other.toml"), text).expect("written");
        let mut command = atvrec(directory.path());
        command.args(["check", "--no-devices", "-c", "other.toml"]);
        command.assert()
    };
    let source = "[source.can0]\nkind = \"can\"\ninterface = \"can0\"\n";
    check(&format!(
        "{source}[source.can0.link]\nbitrate = 500000\ndata_bitrate = 2000000\nrestart_ms = 0\n"
    ))
    .success();
    check(&format!("{source}[source.can0.link]\n")).success();
    for (link, told) in [
        ("bitrate = 50\n", "5000 to 1000000"),
        (
            "bitrate = 500000\ndata_bitrate = 250000\n",
            "is below bitrate = 500000",
        ),
        ("restart_ms = 100\n", "has no effect without bitrate"),
        (
            "bitrate = 500000\nrestart = 100\n",
            "did you mean `restart_ms`?",
        ),
    ] {
        let assert = check(&format!("{source}[source.can0.link]\n{link}")).code(2);
        let text = stderr(&assert);
        assert!(text.contains(told), "{link}: {text}");
        assert!(text.contains("source.can0.link."), "{text}");
    }
    let classic = format!(
        "{source}fd = false\n[source.can0.link]\nbitrate = 500000\ndata_bitrate = 2000000\n"
    );
    let assert = check(&classic).code(2);
    assert!(stderr(&assert).contains("without CAN FD"));
}

#[test]
fn check_takes_its_file_either_way_and_tells_silent_devices_by_its_exit_code() {
    let directory = tempfile::tempdir().expect("a directory");
    fs::write(
        directory.path().join("mine.toml"),
        "[source.imu]\nkind = \"crossbow440\"\ndevice = \"absent\"\n",
    )
    .expect("written");
    for arguments in [["check", "mine.toml"], ["check", "--config=mine.toml"]] {
        let assert = atvrec(directory.path())
            .args(arguments)
            .args(["--listen-s", "0.3"])
            .assert()
            .code(1);
        assert!(stdout(&assert).contains("not open"));
    }
    atvrec(directory.path())
        .args(["check", "mine.toml", "-c", "mine.toml"])
        .assert()
        .code(2);
}
