//! Recordings of real devices (`../shared/data/devices`) against the decodes of independent decoders.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use atvrec_wire::gnss::Decoder;
use atvrec_wire::{Message, nmea, novatel, sbf, ubx, vectornav};
use serde_json::Value;

use crate::common;

/// A message of ours: its place, name, content and the quality of its measurements.
struct Found {
    start: u64,
    name: &'static str,
    message: Message,
}

fn decode(bytes: &[u8], of_vectornav: bool) -> Vec<Found> {
    let mut decoder = match of_vectornav {
        true => Decoder::vectornav(),
        false => Decoder::new(),
    };
    let mut found: Vec<Found> = Vec::new();
    let mut sink = |item: atvrec_wire::Item<'_>| {
        // A message of several instants is one message.
        if found
            .last()
            .is_none_or(|last| last.start != item.range.start)
        {
            found.push(Found {
                start: item.range.start,
                name: item.name,
                message: item.message,
            });
        }
    };
    decoder.push(bytes, &mut sink);
    decoder.finish(&mut sink);
    found
}

type Fields = Vec<(&'static str, f64)>;

/// Our values under the names of the reference decoders, in their units.
fn fields_of(message: &Message, want: &Value) -> Option<Fields> {
    match message {
        Message::Nmea(sentence) => Some(nmea_fields(sentence)),
        Message::Ubx(body) => Some(ubx_fields(body, want)),
        Message::Novatel(log) => novatel_fields(&log.body),
        Message::Sbf(block) => sbf_fields(block),
        Message::Vectornav(output) => Some(vectornav_fields(output)),
        _ => None,
    }
}

fn known(all: &[(&'static str, Option<f64>)]) -> Fields {
    let known = all
        .iter()
        .filter_map(|(name, value)| Some((*name, (*value)?)));
    known.collect()
}

fn nmea_fields(sentence: &nmea::Sentence) -> Fields {
    use nmea::Sentence as S;
    const KNOT: f64 = 1852.0 / 3600.0;
    let place = |p: Option<[f64; 2]>| [("lat", p.map(|p| p[0])), ("lon", p.map(|p| p[1]))];
    match *sentence {
        S::Gga {
            position_deg,
            height_msl_m,
            undulation_m,
            satellites,
            ..
        }
        | S::Gns {
            position_deg,
            height_msl_m,
            undulation_m,
            satellites,
            ..
        } => {
            let mut all = place(position_deg).to_vec();
            all.extend([
                ("alt", height_msl_m),
                ("sep", undulation_m),
                ("numSV", satellites.map(f64::from)),
            ]);
            known(&all)
        }
        S::Rmc {
            position_deg,
            speed_m_s,
            course_deg,
            ..
        } => {
            let mut all = place(position_deg).to_vec();
            all.extend([("spd", speed_m_s.map(|s| s / KNOT)), ("cog", course_deg)]);
            known(&all)
        }
        S::Vtg {
            speed_m_s,
            course_deg,
            ..
        } => known(&[("sogn", speed_m_s.map(|s| s / KNOT)), ("cogt", course_deg)]),
        S::Hdt { heading_deg } => known(&[("headingT", heading_deg)]),
        S::Ths { heading_deg, .. } => known(&[("headt", heading_deg)]),
        S::Gst { sigma_enu_m, .. } => known(&[
            ("stdLong", sigma_enu_m[0]),
            ("stdLat", sigma_enu_m[1]),
            ("stdAlt", sigma_enu_m[2]),
        ]),
        S::Zda { date, .. } => known(&[
            ("year", date.map(|d| d.0.into())),
            ("month", date.map(|d| d.1.into())),
            ("day", date.map(|d| d.2.into())),
        ]),
        _ => Vec::new(),
    }
}

fn ubx_fields(body: &ubx::Body, want: &Value) -> Fields {
    match body {
        ubx::Body::Pvt(b) => vec![
            ("iTOW", b.time_of_week_ms.into()),
            ("year", b.year.into()),
            ("second", b.month_to_second[4].into()),
            ("nano", b.nanoseconds.into()),
            ("fixType", b.fix.into()),
            ("gnssFixOk", f64::from(b.flags & 1)),
            ("carrSoln", f64::from(b.flags >> 6)),
            ("numSV", b.satellites.into()),
            ("lon", f64::from(b.longitude_1e7_deg) * 1e-7),
            ("lat", f64::from(b.latitude_1e7_deg) * 1e-7),
            ("height", b.height_mm.into()),
            ("hMSL", b.height_msl_mm.into()),
            ("hAcc", b.accuracy_mm[0].into()),
            ("vAcc", b.accuracy_mm[1].into()),
            ("velN", b.velocity_ned_mm_s[0].into()),
            ("velE", b.velocity_ned_mm_s[1].into()),
            ("velD", b.velocity_ned_mm_s[2].into()),
            ("sAcc", b.speed_accuracy_mm_s.into()),
            ("pDOP", f64::from(b.dilution_c) * 0.01),
            ("headMot", f64::from(b.course_1e5_deg) * 1e-5),
            ("headVeh", f64::from(b.heading_1e5_deg) * 1e-5),
            ("invalidLlh", f64::from(b.flags3 & 1)),
        ],
        ubx::Body::RelativePosition(b) => {
            let cm = |i: usize| f64::from(b.position_ned_cm[i]) + f64::from(b.fine_100um[i]) * 1e-2;
            let bit = |n: u32| f64::from(b.flags >> n & 1);
            let mut all = vec![
                ("version", b.version.into()),
                ("iTOW", b.time_of_week_ms.into()),
                ("relPosN", cm(0)),
                ("relPosE", cm(1)),
                ("relPosD", cm(2)),
                ("accN", f64::from(b.sigma_ned_100um[0]) * 0.1),
                ("accD", f64::from(b.sigma_ned_100um[2]) * 0.1),
                ("relPosValid", bit(2)),
                ("isMoving", bit(5)),
                ("relPosHeadingValid", bit(8)),
                ("carrSoln", f64::from(b.flags >> 3 & 3)),
            ];
            if b.version > 0 {
                let length = f64::from(b.length_cm) + f64::from(b.fine_100um[3]) * 1e-2;
                let heading = f64::from(b.heading_1e5_deg) * 1e-5;
                all.extend([("relPosLength", length), ("relPosHeading", heading)]);
            }
            all
        }
        ubx::Body::Attitude(b) => {
            let names = [
                "roll",
                "pitch",
                "heading",
                "accRoll",
                "accPitch",
                "accHeading",
            ];
            let angles = b.angles_1e5_deg.map(f64::from);
            let accuracies = b.accuracy_1e5_deg.map(f64::from);
            let all = angles.into_iter().chain(accuracies).map(|v| v * 1e-5);
            names.into_iter().zip(all).collect()
        }
        ubx::Body::Dop(b) => {
            let names = ["gDOP", "pDOP", "tDOP", "vDOP", "hDOP", "nDOP", "eDOP"];
            let all = b.dilutions_c.map(|v| f64::from(v) * 0.01);
            names.into_iter().zip(all).collect()
        }
        ubx::Body::TimeMark(b) => vec![
            ("count", b.count.into()),
            ("wnR", b.weeks[0].into()),
            ("wnF", b.weeks[1].into()),
            ("towMsR", b.rising[0].into()),
            ("towSubMsR", b.rising[1].into()),
            ("towMsF", b.falling[0].into()),
            ("towSubMsF", b.falling[1].into()),
            ("accEst", b.accuracy_ns.into()),
            ("newRisingEdge", f64::from(b.flags >> 7)),
            ("timeBase", f64::from(b.flags >> 3 & 3)),
        ],
        ubx::Body::Measured(b) => {
            for (number, reading) in b.iter().enumerate() {
                let key = |name: &str| format!("{name}_{:02}", number + 1);
                assert_eq!(want[key("dataType")], u64::from(reading.sensor), "{want}");
                assert_eq!(want[key("dataField")], u64::from(reading.bits), "{want}");
            }
            vec![("timeTag", b.time.into()), ("numMeas", b.count as f64)]
        }
        ubx::Body::Raw(b) => {
            for (number, reading) in b.iter().enumerate().take(20) {
                let word = u32::from(reading.sensor) << 24 | reading.bits;
                let hex = |word: u32| word.to_le_bytes().map(|b| format!("{b:02x}")).concat();
                let key = |name: &str| format!("{name}_{:02}", number + 1);
                assert_eq!(want[key("data")], hex(word), "{want}");
                assert_eq!(want[key("sTag")], hex(reading.time), "{want}");
            }
            vec![]
        }
        other => panic!("no reference for {other:?}"),
    }
}

fn novatel_fields(body: &novatel::Body) -> Option<Fields> {
    let heading = |b: &novatel::Heading| {
        vec![
            ("b_length", b.length_m.into()),
            ("heading", b.heading_deg.into()),
            ("pitch", b.pitch_deg.into()),
            ("heading_std_dev", b.heading_sigma_deg.into()),
            ("pitch_std_dev", b.pitch_sigma_deg.into()),
            ("num_svs", b.tail.satellites[0].into()),
        ]
    };
    Some(match body {
        novatel::Body::Position(b) => vec![
            ("latitude", b.latitude_deg),
            ("longitude", b.longitude_deg),
            ("orthometric_height", b.height_msl_m),
            ("undulation", b.undulation_m.into()),
            ("height_std_dev", b.sigma_m[2].into()),
        ],
        novatel::Body::Velocity(b) => vec![
            ("horizontal_speed", b.horizontal_m_s),
            ("ground_track", b.track_deg),
            ("z", b.vertical_m_s),
        ],
        novatel::Body::Cartesian(b) => vec![("x", b.position_m[0]), ("y_1", b.velocity_m_s[1])],
        novatel::Body::Heading(b) => heading(b),
        novatel::Body::Heading2(b) => heading(&b.heading),
        novatel::Body::Inertial(b) => vec![
            ("seconds", b.seconds),
            ("latitude", b.latitude_deg),
            ("height", b.height_m),
            ("north_vel", b.velocity_neu_m_s[0]),
            ("up_vel", b.velocity_neu_m_s[2]),
            ("roll", b.roll_deg),
            ("pitch", b.pitch_deg),
            ("azimuth", b.azimuth_deg),
        ],
        novatel::Body::InertialX(b) => vec![
            ("latitude", b.latitude_deg),
            ("longitude", b.longitude_deg),
            ("height", b.height_msl_m),
            ("undulation", b.undulation_m.into()),
            ("north_vel", b.velocity_neu_m_s[0]),
            ("east_vel", b.velocity_neu_m_s[1]),
            ("up_vel", b.velocity_neu_m_s[2]),
            ("roll", b.attitude_deg[0]),
            ("pitch", b.attitude_deg[1]),
            ("azimuth", b.attitude_deg[2]),
            ("latitude_std_dev", b.sigma[0][0].into()),
            ("up_vel_std_dev", b.sigma[1][2].into()),
            ("azimuth_std_dev", b.sigma[2][2].into()),
            ("extended_sol_stat", b.extended_status.into()),
            ("time_since_update", b.update_age_s.into()),
        ],
        novatel::Body::CorrectedImu(b) => vec![
            ("seconds", b.seconds),
            ("pitch", b.rotation_rad[0]),
            ("roll", b.rotation_rad[1]),
            ("azimuth", b.rotation_rad[2]),
            ("lateral", b.velocity_m_s[0]),
            ("longitudinal", b.velocity_m_s[1]),
            ("vertical", b.velocity_m_s[2]),
        ],
        novatel::Body::Time(b) => vec![("utc_offset", b.utc_offset_s), ("offset", b.offset_s)],
        _ => return None,
    })
}

fn sbf_fields(block: &sbf::Block) -> Option<Fields> {
    let wide = |v: Option<f32>| v.map(f64::from);
    Some(match &block.body {
        sbf::Body::InsNavGeod(b) => known(&[
            ("gnss_mode_raw", Some(b.mode.into())),
            ("sb_list", Some(b.parts.into())),
            ("latitude", b.position[0]),
            ("longitude", b.position[1]),
            ("height", b.position[2]),
            ("undulation", wide(b.undulation_m)),
            ("pos_std_dev.latitude_std_dev", wide(b.position_sigma_m[0])),
            ("pos_std_dev.height_std_dev", wide(b.position_sigma_m[2])),
            ("att.heading", wide(b.attitude_deg[0])),
            ("att.pitch", wide(b.attitude_deg[1])),
            ("att.roll", wide(b.attitude_deg[2])),
            ("att_std_dev.heading_std_dev", wide(b.attitude_sigma_deg[0])),
            ("vel.ve", wide(b.velocity_m_s[0])),
            ("vel.vn", wide(b.velocity_m_s[1])),
            ("vel.vu", wide(b.velocity_m_s[2])),
            ("vel_std_dev.vn_std_dev", wide(b.velocity_sigma_m_s[1])),
        ]),
        sbf::Body::ExtSensorMeas { count, sensors } => {
            let of = |i: usize, j: usize| sensors[i].values[j];
            known(&[
                ("n", Some((*count).into())),
                ("ext_sensor_meas_set.0.acc.ax", of(0, 0)),
                ("ext_sensor_meas_set.0.acc.az", of(0, 2)),
                ("ext_sensor_meas_set.1.ang_rate.wx", of(1, 0)),
                ("ext_sensor_meas_set.1.ang_rate.wz", of(1, 2)),
            ])
            .into_iter()
            .filter(|_| sensors[0].kind == 0)
            .collect()
        }
        sbf::Body::PvtGeodetic(b) => known(&[
            ("Latitude", b.position[0]),
            ("Height", b.position[2]),
            ("Vn", wide(b.velocity_m_s[0])),
            ("NrSV", b.satellites.map(f64::from)),
        ]),
        sbf::Body::AttEuler(b) => known(&[
            ("Heading", wide(b.heading_deg)),
            ("Pitch", wide(b.pitch_deg)),
            ("Roll", wide(b.roll_deg)),
        ]),
        _ => return None,
    })
}

fn vectornav_fields(output: &vectornav::Output) -> Fields {
    const YPR: [&str; 3] = [
        "attitude.ypr.yaw_deg",
        "attitude.ypr.pitch_deg",
        "attitude.ypr.roll_deg",
    ];
    const ACCEL: [&str; 3] = ["imu.accel.0", "imu.accel.1", "imu.accel.2"];
    const RATE: [&str; 3] = [
        "imu.angularRate.0",
        "imu.angularRate.1",
        "imu.angularRate.2",
    ];
    const LLA: [&str; 3] = [
        "ins.posLla.lat_deg",
        "ins.posLla.lon_deg",
        "ins.posLla.alt_m",
    ];
    const NED: [&str; 3] = ["ins.velNed.0", "ins.velNed.1", "ins.velNed.2"];
    let mut all = Vec::new();
    let mut add = |names: [&'static str; 3], values: Option<[f64; 3]>| {
        all.extend(names.into_iter().zip(values.into_iter().flatten()));
    };
    let wide = |v: Option<[f32; 3]>| v.map(|v| v.map(f64::from));
    match output {
        vectornav::Output::Binary(b) => {
            add(YPR, wide(b.yaw_pitch_roll_deg));
            add(ACCEL, wide(b.acceleration_m_s2));
            add(RATE, wide(b.rate_rad_s));
            add(LLA, b.ins_position);
            add(NED, wide(b.ins_velocity_ned_m_s));
            let start = b.since_start_ns.map(|ns| ns as f64);
            let temperature = b.temperature_c.map(f64::from);
            let more = [
                ("time.timeStartup_ns", start),
                ("imu.temperature", temperature),
            ];
            all.extend(known(&more));
        }
        vectornav::Output::Ascii(b) => {
            add(YPR, b.yaw_pitch_roll_deg);
            add(ACCEL, b.acceleration_m_s2);
            add(RATE, b.rate_rad_s);
            if b.fix.is_none() {
                add(LLA, b.position);
                add(NED, b.velocity_ned_m_s);
            }
        }
        other => panic!("no reference for {other:?}"),
    }
    all
}

/// The value under a path of names and numbers; a name may be followed by its unit.
fn value_of(want: &Value, path: &str) -> Option<f64> {
    if let Some(value) = want.as_object().and_then(|object| {
        let same =
            |key: &str| key == path || key.strip_prefix(path).is_some_and(|r| r.starts_with(" ["));
        object.iter().find(|(key, _)| same(key)).map(|(_, v)| v)
    }) {
        return value.as_f64();
    }
    // A name may contain dots itself.
    let cuts = path.match_indices('.').map(|(at, _)| at);
    cuts.into_iter().find_map(|at| {
        let (head, rest) = (&path[..at], &path[at + 1..]);
        let inner = match want {
            Value::Object(object) => object.get(head)?,
            Value::Array(list) => list.get(head.parse::<usize>().ok()?)?,
            _ => return None,
        };
        match rest.parse::<usize>() {
            Ok(index) => inner.get(index)?.as_f64(),
            Err(_) => value_of(inner, rest),
        }
    })
}

/// Other names of values in logs of other firmware.
fn alias(field: &str) -> Option<&'static str> {
    Some(match field {
        "height" => "orthometric_height",
        "orthometric_height" => "height",
        "pitch" => "corr_wb_ib.0",
        "roll" => "corr_wb_ib.1",
        "azimuth" => "corr_wb_ib.2",
        "lateral" => "corr_fb.0",
        "longitudinal" => "corr_fb.1",
        "vertical" => "corr_fb.2",
        _ => return None,
    })
}

/// The messages that are decoded, as the reference decoders call them.
fn decoded_name(msg: &str) -> Option<&'static str> {
    const NAMES: [&str; 28] = [
        "NAV-PVT",
        "NAV-RELPOSNED",
        "NAV-ATT",
        "NAV-DOP",
        "ESF-MEAS",
        "ESF-RAW",
        "TIM-TM2",
        "BESTPOS",
        "BESTVEL",
        "HEADING",
        "BESTGNSSPOS",
        "BESTGNSSVEL",
        "BESTXYZ",
        "INSPVAX",
        "INSPVAS",
        "INSPVA",
        "CORRIMUDATA",
        "CORRIMUDATAS",
        "HEADING2",
        "DUALANTENNAHEADING",
        "TIME",
        "INSNavGeod",
        "ExtSensorMeas",
        "PVTGeodetic",
        "AttEuler",
        "VN-BIN",
        "VNYMR",
        "VNINS",
    ];
    const SENTENCES: [&str; 8] = ["GGA", "RMC", "VTG", "HDT", "THS", "GNS", "GST", "ZDA"];
    let bare = msg.trim_start_matches("UBX-").trim_start_matches("SBF-");
    let exact = NAMES.into_iter().find(|name| *name == bare);
    exact.or_else(|| {
        let talks = msg.len() == 5 && !msg.starts_with('P') && !msg.starts_with("VN");
        SENTENCES
            .into_iter()
            .find(|name| talks && msg.ends_with(name))
    })
}

/// Messages with a right checksum in bytes that the reference skips: recording and place. The reference
/// decoders lose them behind a message that was cut (`robustness-bad-frames`), or do not list sentences
/// between logs (`ascii-examples-swri`).
const RECOVERED: [(&str, u64); 10] = [
    ("novatel/ascii-examples-swri", 645),
    ("novatel/ascii-examples-swri", 727),
    ("novatel/ascii-examples-swri", 990),
    ("ubx/robustness-bad-frames", 4146),
    ("ubx/robustness-bad-frames", 9598),
    ("ubx/robustness-bad-frames", 9632),
    ("ubx/robustness-bad-frames", 10089),
    ("ubx/robustness-bad-frames", 10149),
    ("ubx/robustness-bad-frames", 10258),
    ("ubx/robustness-bad-frames", 10318),
];

/// What a comparison found.
#[derive(Default)]
pub struct Compared {
    pub messages: usize,
    pub values: usize,
    pub differences: Vec<String>,
    /// Messages by name.
    pub names: BTreeMap<&'static str, usize>,
}

/// Compares the decoded messages of a recording with its reference; `None` without the recording.
pub fn compare(folder: &str) -> Option<Compared> {
    let bytes = common::read(&format!("devices/{folder}/recording.bin"))?;
    let reference = common::read_json_lines(&format!("devices/{folder}/reference.jsonl"))?;
    let found = decode(&bytes, folder.starts_with("vectornav"));
    let by_start: BTreeMap<u64, &Found> = found.iter().map(|f| (f.start, f)).collect();
    let mut compared = Compared::default();
    for want in &reference {
        let start = want["t_index"].as_u64().expect("a place");
        let msg = want["msg"].as_str().expect("a name");
        if want["bad_checksum"] == true {
            let ours = by_start.get(&start);
            let damaged = ours.map(|f| format!("{start}: {} is damaged", f.name));
            compared.differences.extend(damaged);
            continue;
        }
        if msg == "_skipped" {
            let end = start + want["bytes"].as_u64().expect("a length");
            let inside = by_start.range(start..end);
            let made_up = inside.filter(|(at, f)| {
                let recovered = RECOVERED.contains(&(folder, **at));
                !matches!(f.message, Message::Reply) && !recovered
            });
            let made_up = made_up.map(|(at, f)| format!("{at}: {} in skipped bytes", f.name));
            compared.differences.extend(made_up);
            continue;
        }
        let Some(name) = decoded_name(msg) else {
            continue;
        };
        let Some(ours) = by_start.get(&start) else {
            compared
                .differences
                .push(format!("{start}: {msg} is missing"));
            continue;
        };
        let Some(fields) = fields_of(&ours.message, want).filter(|_| ours.name == name) else {
            compared.differences.push(format!(
                "{start}: {msg} is {} {:?}",
                ours.name, ours.message
            ));
            continue;
        };
        compared.messages += 1;
        *compared.names.entry(name).or_default() += 1;
        // Some sentences between other messages are listed by name alone.
        let has_values = want.as_object().is_some_and(|object| object.len() > 3);
        if !has_values {
            continue;
        }
        for (field, value) in fields {
            let names = std::iter::once(field).chain(alias(field));
            let Some(theirs) = names.into_iter().find_map(|name| value_of(want, name)) else {
                compared
                    .differences
                    .push(format!("{start}: {msg} has no {field}: {want}"));
                continue;
            };
            compared.values += 1;
            // Single precision is printed with the fewest digits that read back as the same number.
            if (value - theirs).abs() > 1e-7 * theirs.abs().max(1e-2) {
                compared
                    .differences
                    .push(format!("{start}: {msg}.{field} {value}, expected {theirs}"));
            }
        }
    }
    Some(compared)
}

#[test]
fn recordings_of_real_devices_decode_as_the_reference_says() {
    let Some(root) = testkit::shared("data/devices") else {
        return;
    };
    let mut text = String::new();
    let mut all = Compared::default();
    for protocol in ["nmea", "novatel", "septentrio", "ubx", "vectornav"] {
        let mut folders: Vec<String> = std::fs::read_dir(root.join(protocol))
            .expect("recordings")
            .map(|entry| {
                entry
                    .expect("an entry")
                    .file_name()
                    .into_string()
                    .expect("UTF-8")
            })
            .collect();
        folders.sort();
        for folder in folders {
            let folder = format!("{protocol}/{folder}");
            let Some(compared) = compare(&folder) else {
                return;
            };
            let _ = writeln!(
                text,
                "{folder}: {} messages, {} values",
                compared.messages, compared.values
            );
            all.messages += compared.messages;
            all.values += compared.values;
            all.differences
                .extend(compared.differences.iter().map(|d| format!("{folder} {d}")));
        }
    }
    println!("{text}{} messages, {} values", all.messages, all.values);
    assert_eq!(
        all.differences.len(),
        0,
        "{:#?}",
        &all.differences[..all.differences.len().min(60)]
    );
    assert!(
        all.messages > 4000,
        "{} messages were compared",
        all.messages
    );
}

/// Every recording is recognised by its bytes, also where this version does not decode it.
#[test]
fn recordings_of_real_devices_are_recognised() {
    use atvrec_wire::recognise::{Format, recognise};
    let Some(root) = testkit::shared("data/devices") else {
        return;
    };
    let expected = [
        ("mip", Format::Mip),
        ("nmea", Format::Nmea),
        ("novatel", Format::Novatel),
        ("sbg", Format::Sbg),
        ("septentrio", Format::Sbf),
        ("ubx", Format::Ubx),
        ("vectornav", Format::Vectornav),
        ("xsens", Format::Xsens),
    ];
    let mut wrong = Vec::new();
    for (protocol, format) in expected {
        for entry in std::fs::read_dir(root.join(protocol)).expect("recordings") {
            let folder = entry.expect("an entry").path();
            let bytes = std::fs::read(folder.join("recording.bin")).expect("a recording");
            let found = recognise(&bytes);
            // Every message of this recording is damaged.
            let damaged = folder.ends_with("vn100-bitflip-fail");
            if found != Some(format).filter(|_| !damaged) {
                wrong.push(format!("{}: {found:?}", folder.display()));
            }
        }
    }
    for (folder, format) in [
        ("can/nmea2000-garmin-boat", Format::Nmea2000),
        ("can/canmod-gps-imu-a", Format::Candump),
    ] {
        let bytes = std::fs::read(root.join(folder).join("recording.bin")).expect("a recording");
        assert_eq!(recognise(&bytes), Some(format), "{folder}");
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// Frames of a receiver on a CAN bus, by the maker's DBC file.
#[test]
fn a_receiver_on_a_bus_decodes_as_the_reference_says() {
    let folder = "devices/can/canmod-gps-imu-a";
    let (Some(recording), Some(dbc), Some(reference)) = (
        common::read_text(&format!("{folder}/recording.bin")),
        common::read(&format!("{folder}/messages.dbc")),
        common::read_json_lines(&format!("{folder}/reference.jsonl")),
    ) else {
        return;
    };
    let database = atvrec_wire::dbc::Database::parse_usable(&dbc).expect("a DBC file");
    assert_eq!(database.left_out(), []);
    let (mut messages, mut values) = (0, 0);
    for want in &reference {
        if want["msg"] == "_skipped" {
            continue;
        }
        let at = want["t_index"].as_u64().expect("a place") as usize;
        let line = recording[at..].lines().next().expect("a line");
        let frame = atvrec_wire::candump::parse_line(line)
            .expect("a frame")
            .frame;
        let decoded = database.decode(&frame).expect("a message");
        assert_eq!(want["msg"], *decoded.message);
        messages += 1;
        for signal in &decoded.signals {
            let key = |(key, value): (&String, &Value)| {
                let name = key.split(" [").next() == Some(&*signal.name);
                name.then(|| value.clone())
            };
            let theirs = want
                .as_object()
                .and_then(|object| object.iter().find_map(key));
            let theirs = theirs.unwrap_or_else(|| panic!("{} is not in {want}", signal.name));
            // Enumerations are `name:value`.
            let text = theirs
                .as_str()
                .and_then(|text| text.rsplit(':').next()?.parse().ok());
            let theirs = theirs
                .as_f64()
                .or(text)
                .unwrap_or_else(|| panic!("{theirs}"));
            let close = (signal.value - theirs).abs() <= 1e-9 * theirs.abs().max(1.0);
            assert!(
                close,
                "{}: {}, expected {theirs}",
                signal.name, signal.value
            );
            values += 1;
        }
    }
    println!("{messages} messages, {values} values");
    assert!(
        messages > 1300 && values > 8000,
        "{messages} messages, {values} values"
    );
}
