//! From the installed program to the report of a first drive.

use std::fs;
use std::process::Command;

use atvrec_tests::rig::{boot, install_folder, new_output_folder};
use atvrec_tests::{atvrec, logs_in};
use store::Reader;

use super::service::inertial_unit;

#[test]
fn init_check_record_and_report_need_nothing_else() {
    let out = new_output_folder("newcomer");
    install_folder(&out);
    let (_vehicle, imu) = inertial_unit(&out);
    let imu = imu.display().to_string();
    let options = ["--init", "systemd", "--timeout", "900", "--uart", &imu];
    boot("newcomer", &options);

    // Every device of the computer: an interface that is up and silent, one that is down, the bus of the
    // vehicle, and the inertial unit at a UART.
    let told = fs::read_to_string(out.join("all.log")).expect("told");
    for part in [
        "can0 (kvaser_pci, up, 500000 bit/s)",
        "can1 (kvaser_pci, down",
        "vcan0 (virtual, up)",
        "10 of 10 identifiers are those of prowler.dbc",
        "Crossbow 440 packets at 115200 baud",
    ] {
        assert!(told.contains(part), "{part}: {told}");
    }
    let text = fs::read_to_string(out.join("all.toml")).expect("a configuration");
    assert!(
        text.contains("kind = \"crossbow440\"\ndevice = \"/dev/ttyS1\""),
        "{text}"
    );
    let page = fs::read_to_string(out.join("drive.html")).expect("a report");
    assert!(page.contains("</html>"));
    let logs = logs_in(&out.join("logs"));
    let reader = Reader::open(&logs).expect("a log");
    assert!(reader.estimates().count() > 100, "estimates");
    let verified = Command::new(atvrec())
        .args(["replay", "--verify"])
        .args(&logs)
        .status();
    assert!(verified.expect("the replay starts").success());
}
