//! `docs/works-with.md`, which is written from the recordings of real devices.

mod setup;

use std::collections::BTreeMap;
use std::fmt::Write as _;

use atvrec_wire::recognise::recognise;

use crate::common;
use crate::devices::compare;

/// Recordings and the devices that they are of.
const DEVICES: [(&str, &str); 39] = [
    (
        "nmea/bandg-zeus-plotter-mix",
        "B&G Zeus 2 plotter, a boat's network",
    ),
    ("nmea/garmin-17n-pgrm", "Garmin GPS 17N"),
    (
        "nmea/garmin-gpsmap-76s",
        "Garmin GPSmap 76S in simulation mode",
    ),
    (
        "nmea/hemisphere-hdt-zda",
        "Hemisphere receiver with heading",
    ),
    (
        "nmea/proprietary-and-bad-mix",
        "sentences of many makers, some damaged",
    ),
    (
        "nmea/saab-r4-marine-rot",
        "Saab R4 transponder with heading",
    ),
    ("nmea/trimble-netr9-gga-gst-zda", "Trimble NetR9"),
    ("nmea/unicore-um621-gyoacc", "Unicore UM621"),
    (
        "novatel/ascii-examples-swri",
        "NovAtel OEM6 and OEM7, ASCII",
    ),
    (
        "novatel/ascii-lines-imu-ins",
        "NovAtel SPAN and compatible receivers, ASCII",
    ),
    (
        "novatel/oem7-align-heading2",
        "NovAtel OEM7, two antennas (ALIGN)",
    ),
    ("novatel/oem7-bestpos", "NovAtel OEM7"),
    ("novatel/oem7-ins1", "NovAtel OEM7 SPAN with Epson G320"),
    ("novatel/oem7-time-rxstatus", "NovAtel OEM7"),
    ("novatel/span-corrimudata-inspvax", "NovAtel SPAN"),
    (
        "septentrio/ins-navgeod-extsensormeas-a",
        "Septentrio AsteRx-i",
    ),
    (
        "septentrio/mega-test-many-blocks",
        "Septentrio receiver, 26 kinds of blocks",
    ),
    (
        "septentrio/single-blocks-coremarine",
        "Septentrio AsteRx, 23 kinds of blocks",
    ),
    ("ubx/f9p-one-of-each-fixposition", "u-blox ZED-F9P"),
    (
        "ubx/f9r-ubx-nmea-rtcm-mixed",
        "u-blox ZED-F9R, with NMEA and RTCM",
    ),
    ("ubx/m8f-startup-config-traffic", "u-blox LEA-M8F"),
    ("ubx/m8l-adr-esf-hnr", "u-blox NEO-M8L"),
    ("ubx/m8p-relposned-v0", "u-blox NEO-M8P"),
    ("ubx/m8t-rxm-rawx", "u-blox NEO-M8T"),
    ("ubx/neo-f9v-nav-pvat", "u-blox NEO-F9V"),
    (
        "ubx/robustness-bad-frames",
        "u-blox M8 and M9, with damaged messages",
    ),
    (
        "ubx/sf-calibration-nav-att-pvat",
        "u-blox receiver with inertial unit",
    ),
    (
        "ubx/single-frames-gnss-converters",
        "u-blox receivers, single messages",
    ),
    ("ubx/tim-tm2-two-real-frames", "u-blox timing receiver"),
    (
        "vectornav/ascii-lines-from-drivers",
        "VectorNav VN-100 to VN-310, ASCII",
    ),
    (
        "vectornav/vn100-arduino-gps-2016",
        "VectorNav VN-100, with NMEA",
    ),
    ("vectornav/vn100-bitflip-before", "VectorNav VN-100"),
    (
        "vectornav/vn100-both-streams",
        "VectorNav VN-100, binary and ASCII",
    ),
    (
        "vectornav/vn310-dynamic-satinfo-rawmeas",
        "VectorNav VN-310, outputs of variable length",
    ),
    ("vectornav/vn310-imu-100hz", "VectorNav VN-310"),
    ("mip/series7-imu-filter-a", "MicroStrain 7 series"),
    ("sbg/ellipse-stream-logs", "SBG Ellipse"),
    ("xsens/mti-600-gnss-nofix-a", "Xsens MTi-600"),
    (
        "can/nmea2000-garmin-boat",
        "NMEA 2000 network of a boat (Garmin)",
    ),
];

#[test]
fn the_table_of_devices_is_current() {
    let mut text = String::from(
        "# Devices that work\n\n\
         This page is written by a test from recordings of real devices. Each decoded message of each \
         recording has the values that an independent decoder gives (NovAtel EDIE, pyubx2, pynmeagps, \
         libsbf, VectorNav's library). Differences: messages with a right checksum behind a damaged message \
         are decoded here and not listed by the other decoder (10 messages in 2 recordings).\n\n\
         Other devices with these protocols work too. `atvrec check` shows what a device sends, and \
         whether it is decoded.\n\n\
         | device | protocol | source | decoded messages that were compared |\n|---|---|---|---|\n",
    );
    let (mut total, mut used) = ((0, 0), Vec::new());
    for (folder, device) in DEVICES {
        let Some(bytes) = common::read(&format!("devices/{folder}/recording.bin")) else {
            return;
        };
        let format = recognise(&bytes).expect("a known format");
        used.push(format);
        let kind = match (folder, format.kind()) {
            (_, None) => "recognised, not decoded".to_owned(),
            (_, Some(kind)) => format!("`{kind}`"),
        };
        let decoded = matches!(format.kind(), Some("gnss" | "vectornav"));
        let compared = decoded.then(|| compare(folder)).flatten();
        let names = compared.as_ref().map(|compared| {
            let names: BTreeMap<_, _> = compared.names.iter().collect();
            let each = names.iter().map(|(name, count)| format!("{name} {count}"));
            each.collect::<Vec<_>>().join(", ")
        });
        if let Some(compared) = &compared {
            assert!(compared.differences.is_empty(), "{folder}");
            total = (total.0 + compared.messages, total.1 + compared.values);
        }
        let names = names.filter(|names| !names.is_empty());
        let names = names.unwrap_or_else(|| "–".to_owned());
        let _ = writeln!(text, "| {device} | {format} | {kind} | {names} |");
    }
    let _ = write!(
        text,
        "\nIn all {} messages and {} values. Without a row: CAN buses with any DBC file (`can`, `slcan`), \
         Crossbow 440 (`crossbow440`), devices that write lines of numbers (`line`, `csv`).\n",
        total.0, total.1
    );
    text += &setup::section(&used);
    testkit::assert_file("docs/works-with.md", text);
}
