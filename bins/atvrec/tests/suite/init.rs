//! `atvrec init`: from a bare computer to a configuration.

use std::fs;
use std::path::Path;

use wire::nmea::encode_sentence;

use crate::inputs::Device;
use crate::record::Virtual;
use crate::support::{atvrec, names, stderr, stdout};

/// Arguments that ask nothing and listen to these ports for a short time.
fn init(here: &Path, ports: &[String], more: &[&str]) -> assert_cmd::assert::Assert {
    let mut command = atvrec(here);
    command.args(["init", "--yes"]);
    if !more.contains(&"--seconds") {
        command.args(["--seconds", "0.7"]);
    }
    for port in ports {
        command.args(["--port", port]);
    }
    command.args(more).assert()
}

fn written(here: &Path) -> String {
    fs::read_to_string(here.join("atvrec.toml")).expect("a configuration")
}

/// Table of the source of a device.
fn source_of<'t>(text: &'t str, device: &str) -> Option<&'t str> {
    let mut tables = text.split("\n[source.");
    tables.find(|table| table.contains(&format!("device = \"{device}\"\n")))
}

const NO_DEVICE: [&str; 2] = ["--can", "nocan77"];

#[test]
fn the_virtual_ports_are_recognised_and_the_files_are_accepted() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let _vehicle = Virtual::start(here);
    let port = |name: &str| here.join("ports").join(name).display().to_string();
    let kinds = [
        ("imu", "crossbow440"),
        ("novatel", "gnss"),
        ("septentrio", "gnss"),
        ("can0", "slcan"),
        ("steering", "line"),
        ("throttle", "line"),
        ("brake", "line"),
    ];
    let ports = kinds.map(|(name, _)| port(name));
    let told = stdout(&init(here, &ports, &[]).success());
    for part in [
        "BESTPOS",
        "PVTGeodetic",
        "S1 ",
        "Strain_FL",
        "37 clear, 0 to be decided, 23 of messages that did not arrive",
    ] {
        assert!(told.contains(part), "{part}: {told}");
    }
    let text = written(here);
    for (name, kind) in kinds {
        let table = source_of(&text, &port(name)).unwrap_or_else(|| panic!("{name}: {text}"));
        assert!(
            table.contains(&format!("kind = \"{kind}\"\n")),
            "{name}: {table}"
        );
    }
    assert!(text.contains("\nbitrate = 500000\n"), "{text}");
    assert!(
        text.contains("steer = \"Steering.hand_wheel_angle\""),
        "{text}"
    );
    // The virtual vehicle of these ports has no hub accelerometers.
    let silent = "\n# hub_acceleration.FL.x = \"Hub_FL.x\"  # unit count\n";
    assert!(text.contains(silent), "{text}");
    assert!(!text.contains("\nhub_acceleration"), "{text}");
    assert_eq!(
        names(here),
        ["atvrec.toml", "ports", "sensors.toml", "vehicle.toml"]
    );
    // Each device answers, and its data is understood.
    let checked = atvrec(here).args(["check", "--listen-s", "1"]).assert();
    let checked = stdout(&checked.success());
    assert_eq!(
        checked.matches(" answers ").count(),
        kinds.len(),
        "{checked}"
    );
}

#[test]
fn recordings_of_real_devices_are_recognised_at_a_port() {
    let Some(root) = testkit::shared("data/devices") else {
        return;
    };
    let expected = [
        ("nmea", "gnss", "NMEA 0183 at"),
        ("novatel", "gnss", "NovAtel logs at"),
        ("septentrio", "gnss", "Septentrio SBF at"),
        ("ubx", "gnss", "u-blox UBX at"),
        ("vectornav", "vectornav", "VectorNav at"),
        (
            "mip",
            "",
            "MicroStrain MIP, not decoded: this version does not decode MIP; let",
        ),
        (
            "sbg",
            "",
            "SBG Systems sbgECom, not decoded: this version does not decode",
        ),
        (
            "xsens",
            "",
            "Xsens MT, not decoded: this version does not decode Xsens MT; let",
        ),
    ];
    let mut devices = Vec::new();
    let mut add = |folder: std::path::PathBuf, kind, text| {
        let bytes = fs::read(folder.join("recording.bin")).expect("a recording");
        devices.push((folder, kind, text, Device::new(bytes)));
    };
    for (protocol, kind, text) in expected {
        for entry in fs::read_dir(root.join(protocol)).expect("recordings") {
            let folder = entry.expect("an entry").path();
            // Every message of this recording is damaged.
            if !folder.ends_with("vn100-bitflip-fail") {
                add(folder, kind, text);
            }
        }
    }
    let boat =
        "NMEA 2000 frames as lines of candump, not decoded: this version does not decode NMEA 2000";
    add(root.join("can/nmea2000-garmin-boat"), "", boat);
    assert!(devices.len() > 30);
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let ports: Vec<String> = devices.iter().map(|device| device.3.path.clone()).collect();
    let told = stdout(&init(here, &ports, &[]).success());
    let text = written(here);
    for (folder, kind, what, device) in &devices {
        let wanted = format!("{}: {what}", device.path);
        assert!(
            told.contains(&wanted),
            "{}: {wanted}: {told}",
            folder.display()
        );
        let table = source_of(&text, &device.path);
        assert_eq!(table.is_some(), !kind.is_empty(), "{}", folder.display());
        if let Some(table) = table {
            assert!(table.contains(&format!("kind = \"{kind}\"")), "{table}");
        }
    }
    atvrec(here)
        .args(["check", "--no-devices"])
        .assert()
        .success();
}

#[test]
fn an_existing_file_is_refused_before_a_device_is_opened() {
    for name in ["atvrec.toml", "vehicle.toml", "sensors.toml"] {
        let directory = tempfile::tempdir().expect("a directory");
        let here = directory.path();
        fs::write(here.join(name), "own").expect("written");
        let refused = init(here, &[], &NO_DEVICE).code(2);
        let told = stderr(&refused);
        assert!(told.contains(&format!("{name} exists already")), "{told}");
        assert_eq!(stdout(&refused), "");
        assert_eq!(names(here), [name]);
        assert_eq!(fs::read_to_string(here.join(name)).expect("read"), "own");
        init(here, &[], &[&NO_DEVICE[..], &["--force"]].concat()).success();
        assert_ne!(fs::read_to_string(here.join(name)).expect("read"), "own");
    }
}

#[test]
fn own_files_are_named_and_not_copied() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let show = atvrec(here).args(["vehicle", "show", "prowler"]).assert();
    fs::write(here.join("buggy.toml"), stdout(&show)).expect("written");
    let dbc = "VERSION \"\"\nBU_: A\nBO_ 256 Sas: 8 A\n SG_ SteeringAngle : 0|16@1- (0.1,0) [0|0] \"deg\" A\n\
               \x20SG_ WheelSpeed : 16|16@1- (0.1,0) [0|0] \"rpm\" A\n";
    fs::write(here.join("own.dbc"), dbc).expect("written");
    let more = [
        "--dbc",
        "own.dbc",
        "--vehicle",
        "buggy.toml",
        "-d",
        "out",
        "--storage",
        "drives",
        "--bitrate",
        "250000",
    ];
    let told = stdout(&init(here, &[], &[&NO_DEVICE[..], &more].concat()).success());
    assert!(told.contains("1 clear, 1 to be decided"), "{told}");
    assert_eq!(names(&here.join("out")), ["atvrec.toml", "sensors.toml"]);
    let text = written(&here.join("out"));
    for part in [
        format!("file = \"{}\"", here.join("buggy.toml").display()),
        format!("dbc = [\"{}\"]", here.join("own.dbc").display()),
        "directory = \"drives\"".to_owned(),
        "\nlink.bitrate = 250000".to_owned(),
        "\nsteer = \"Sas.SteeringAngle\"  # unit deg\n".to_owned(),
        "# wheel_speed.{wheel} = \"Sas.WheelSpeed\"  # unit rpm: its name does not say which wheel"
            .to_owned(),
    ] {
        assert!(text.contains(&part), "{part}: {text}");
    }
    let check = ["check", "--no-devices", "out/atvrec.toml"];
    atvrec(here).args(check).assert().success();
}

#[test]
fn without_a_device_the_next_step_is_named_and_a_template_is_written() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let gone = ["/dev/no-such-port".to_owned()];
    let told = stdout(&init(here, &gone, &[]).success());
    for part in [
        "no-such-port: the device does not exist",
        "run `atvrec init` again",
        "atvrec demo",
    ] {
        assert!(told.contains(part), "{part}: {told}");
    }
    let checked = atvrec(here)
        .args(["check", "--no-devices"])
        .assert()
        .success();
    assert!(stdout(&checked).contains("0 sources, no errors"));
    let text = written(here);
    assert!(text.contains("# kind = \"gnss\""), "{text}");
    // A port without data, and one with bytes that mean nothing.
    let noise = (0..4_000_u32).map(|k| (k.wrapping_mul(2_654_435_761) >> 24) as u8);
    let (silent, noise) = (Device::new(Vec::new()), Device::new(noise.collect()));
    let ports = [silent.path.clone(), noise.path.clone()];
    let told = stdout(&init(here, &ports, &["--force", "--seconds", "0.2"]).success());
    assert!(told.contains("no byte arrived; check power"), "{told}");
    assert!(
        told.contains("of no known protocol at any usual baud rate"),
        "{told}"
    );
}

#[test]
fn wrong_input_is_refused_by_name() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    fs::write(here.join("bad.dbc"), "BO_ x").expect("written");
    fs::write(here.join("bad.toml"), "name = 1\n").expect("written");
    for (more, part) in [
        (&["--vehicle", "prowlr"][..], "prowlr is neither a file nor"),
        (&["--sensors", "thesis"], "thesis is neither a file nor"),
        (&["--vehicle", "bad.toml"], "bad.toml"),
        (&["--dbc", "bad.dbc"], "bad.dbc"),
        (&["--dbc", "absent.dbc"], "absent.dbc"),
        (&["--bitrate", "7"], "--bitrate"),
        (&["--seconds", "-1"], "--seconds"),
        (&["-d", "bad.toml/x"], "bad.toml/x"),
    ] {
        let arguments = [&NO_DEVICE[..], more].concat();
        let refused = init(here, &[], &arguments).failure();
        let told = stderr(&refused);
        assert!(told.contains(part), "{more:?}: {told}");
        assert_eq!(names(here), ["bad.dbc", "bad.toml"], "{more:?}");
    }
    // Nobody can answer: the input of a test is no terminal.
    let asked = atvrec(here).arg("init").args(NO_DEVICE).assert().code(2);
    assert!(stderr(&asked).contains("use --yes"), "{}", stderr(&asked));
}

#[test]
fn a_protocol_without_a_decoded_message_has_its_remedy() {
    let mut bytes = Vec::new();
    encode_sentence("GPGSV,1,1,01,10,63,137,17", &mut bytes);
    let device = Device::new(bytes);
    let directory = tempfile::tempdir().expect("a directory");
    let told = stdout(&init(directory.path(), std::slice::from_ref(&device.path), &[]).success());
    // Recognised, but without a message that is decoded: the remedy is named.
    assert!(told.contains("not decoded: GSV"), "{told}");
    assert!(told.contains("let the receiver send GGA and RMC"), "{told}");
    let text = written(directory.path());
    let table = source_of(&text, &device.path).expect("a source");
    assert!(table.contains("baud = 115200"), "{table}");
}

/// A command of a unit, with the program of this build and the configuration in `here`.
fn of_unit(here: &Path, key: &str) -> Vec<String> {
    let unit = testkit::project().join("packaging/atvrec.service");
    let unit = fs::read_to_string(unit).expect("the unit");
    let mut lines = unit.lines();
    let line = lines.find_map(|line| line.strip_prefix(&format!("{key}=/usr/bin/atvrec ")));
    let here = here.display().to_string();
    let words = line.expect("a command").split(' ');
    words
        .map(|word| word.replace("/etc/atvrec", &here))
        .collect()
}

/// `systemctl reload` reaches the recorder of each configuration, also of one without `[control]`.
#[test]
fn the_reload_of_the_unit_reaches_the_recorder_of_a_written_configuration() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let silent = Device::new(Vec::new());
    init(
        here,
        &[],
        &[&NO_DEVICE[..], &["--bitrate", "500000"]].concat(),
    )
    .success();
    let source = format!(
        "\n[source.imu]\nkind = \"crossbow440\"\nconfigure = false\ndevice = \"{}\"\n",
        silent.path
    );
    fs::write(here.join("atvrec.toml"), written(here) + &source).expect("written");
    let record = of_unit(here, "ExecStart");
    assert_eq!(record[..2], ["record".to_owned(), "--config".to_owned()]);
    let mut recorder = std::process::Command::new(env!("CARGO_BIN_EXE_atvrec"))
        .args(&record[..3])
        .current_dir(here)
        .stdout(std::process::Stdio::null())
        .spawn()
        .expect("the recorder starts");
    let reload = of_unit(here, "ExecReload");
    let reloads = || {
        let done = atvrec(here).args(&reload).output().expect("it starts");
        (
            done.status.success(),
            String::from_utf8_lossy(&done.stderr).into_owned(),
        )
    };
    let mut reloaded = reloads();
    for _ in 0..100 {
        if reloaded.0 {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(100));
        reloaded = reloads();
    }
    let stopped = recorder.kill().and_then(|()| recorder.wait());
    stopped.expect("the recorder was running");
    assert!(reloaded.0, "{}", reloaded.1);
}
