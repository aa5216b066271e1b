//! The receiver decoder against reference decodes, mixtures and noise.

use atvrec_wire::gnss::Decoder;
use atvrec_wire::novatel::{self, Log};
use atvrec_wire::sbf::{self, Block};
use atvrec_wire::{Message, Protocol, Statistics, nmea, ubx};
use proptest::prelude::*;
use serde_json::Value;

use crate::common;

type Found = (Protocol, &'static str, Message, std::ops::Range<u64>);

fn decode(bytes: &[u8]) -> (Vec<Found>, Statistics) {
    let mut decoder = Decoder::new();
    let mut found = Vec::new();
    let mut sink = |i: atvrec_wire::Item<'_>| found.push((i.protocol, i.name, i.message, i.range));
    decoder.push(bytes, &mut sink);
    decoder.finish(&mut sink);
    (found, decoder.statistics())
}

/// Our fields of a log under the reference decoder's names.
fn novatel_fields(log: &Log) -> Vec<(&'static str, f64)> {
    let tail = |t: &novatel::Tail, ages: bool| {
        let mut v = vec![
            ("num_svs", f64::from(t.satellites[0])),
            ("num_soln_svs", f64::from(t.satellites[1])),
        ];
        if ages {
            v.push(("diff_age", t.differential_age_s.into()));
            v.push(("solution_age", t.solution_age_s.into()));
        }
        v
    };
    match &log.body {
        novatel::Body::Position(b) => {
            let mut v = vec![
                ("latitude", b.latitude_deg),
                ("longitude", b.longitude_deg),
                ("orthometric_height", b.height_msl_m),
                ("undulation", b.undulation_m.into()),
                ("latitude_std_dev", b.sigma_m[0].into()),
                ("longitude_std_dev", b.sigma_m[1].into()),
                ("height_std_dev", b.sigma_m[2].into()),
                ("ext_sol_stat", b.tail.masks[1].into()),
                ("gps_and_glo_mask", b.tail.masks[3].into()),
            ];
            v.extend(tail(&b.tail, true));
            v
        }
        novatel::Body::Velocity(b) => vec![
            ("latency", b.latency_s.into()),
            ("diff_age", b.age_s.into()),
            ("horizontal_speed", b.horizontal_m_s),
            ("ground_track", b.track_deg),
            ("z", b.vertical_m_s),
        ],
        novatel::Body::Cartesian(b) => {
            let mut v = vec![
                ("x", b.position_m[0]),
                ("y", b.position_m[1]),
                ("z", b.position_m[2]),
                ("x_std_dev", b.position_sigma_m[0].into()),
                ("y_std_dev", b.position_sigma_m[1].into()),
                ("z_std_dev", b.position_sigma_m[2].into()),
                ("x_1", b.velocity_m_s[0]),
                ("y_1", b.velocity_m_s[1]),
                ("z_1", b.velocity_m_s[2]),
                ("x_std_dev_1", b.velocity_sigma_m_s[0].into()),
                ("y_std_dev_1", b.velocity_sigma_m_s[1].into()),
                ("z_std_dev_1", b.velocity_sigma_m_s[2].into()),
                ("latency", b.latency_s.into()),
            ];
            v.extend(tail(&b.tail, true));
            v
        }
        novatel::Body::Utm(b) => {
            let mut v = vec![
                ("zone_number", b.zone.into()),
                ("zone_letter", b.letter.into()),
                ("northing", b.northing_m),
                ("easting", b.easting_m),
                ("height", b.height_msl_m),
                ("undulation", b.undulation_m.into()),
            ];
            v.extend(tail(&b.tail, true));
            v
        }
        other => panic!("no reference for {other:?}"),
    }
}

const NOVATEL: [&str; 7] = [
    "BESTPOS", "PSRPOS", "BESTVEL", "PSRVEL", "BESTXYZ", "PSRXYZ", "BESTUTM",
];

/// Logs and fields that are equal to those of the reference decoder; `None` without the recording.
fn compare_novatel(name: &str) -> Option<(usize, usize)> {
    let (Some(bytes), Some(reference)) = (
        common::read(name),
        common::read_json_lines(&format!("{name}.edie.jsonl")),
    ) else {
        return None;
    };
    let (found, _) = decode(&bytes);
    let ours: Vec<(&str, &Log)> = found
        .iter()
        .filter_map(|(_, name, message, _)| match message {
            Message::Novatel(log) if NOVATEL.contains(name) => Some((*name, log)),
            _ => None,
        })
        .collect();
    let theirs: Vec<&Value> = reference
        .iter()
        .filter(|v| NOVATEL.contains(&v["msg"].as_str().unwrap_or("")))
        .filter(|v| v.get("response_id").is_none())
        // Abbreviated ASCII (format bits 10 in the message type) has no checksum: not decoded.
        .filter(|v| v["header"]["message_type"].as_u64().unwrap_or(0) & 0x60 != 0x40)
        .collect();
    // The reference decoder gives up on some frames behind noise; every one of its own is ours.
    let mut fields = 0;
    let mut rest = ours.iter();
    for want in &theirs {
        let header = &want["header"];
        let (_, log) = rest
            .find(|(name, log)| {
                *name == want["msg"]
                    && header["milliseconds"] == f64::from(log.header.milliseconds)
                    && header["week"] == log.header.week
            })
            .unwrap_or_else(|| panic!("{name}: missing {want}"));
        assert_eq!(header["time_status"], log.header.time_status);
        for (field, value) in novatel_fields(log) {
            let expected = want[field]
                .as_f64()
                .unwrap_or_else(|| panic!("{field} in {want}"));
            let close = (value - expected).abs() <= 1e-14 * expected.abs();
            assert!(close, "{name} {field}: {value}, expected {expected}");
            fields += 1;
        }
    }
    eprintln!(
        "{name}: {} logs compared, {} decoded",
        theirs.len(),
        ours.len()
    );
    Some((theirs.len(), fields))
}

#[test]
fn novatel_reference_decodes() {
    let stems = [
        "MorePropak",
        "OnceEachAgain",
        "OneEach",
        "ParsingData",
        "ParsingData2",
        "PropakWithGlonass",
    ];
    let mut names: Vec<String> = stems
        .iter()
        .flat_map(|s| {
            [
                format!("novatel-gavlab/{s}.GPS"),
                format!("novatel-gavlab/{s}.ASC"),
            ]
        })
        .collect();
    names.push("novatel-edie/BESTUTMBIN.GPS".to_owned());
    names.push("mixed-fixposition/test_data_novb.bin".to_owned());
    let (mut logs, mut fields) = (0, 0);
    for name in &names {
        let Some(counts) = compare_novatel(name) else {
            return;
        };
        logs += counts.0;
        fields += counts.1;
    }
    eprintln!("NovAtel: {logs} logs, {fields} fields compared");
    assert!(logs > 0 && fields > 0, "nothing was compared");
}

#[test]
fn a_thousand_positions_in_ascii() {
    let Some(bytes) = common::read("novatel-edie/BESTPOS.GPS") else {
        return;
    };
    let (found, statistics) = decode(&bytes);
    let positions = found.iter().filter(|f| f.1 == "BESTPOS").count();
    eprintln!("BESTPOS.GPS: {positions} positions, {statistics:?}");
    assert_eq!(positions, 1000);
    assert_eq!((statistics.checksum_errors, statistics.malformed), (0, 0));
}

fn sbf_fields(block: &Block) -> Vec<(&'static str, Option<f64>)> {
    let f = |v: Option<f32>| v.map(f64::from);
    match &block.body {
        sbf::Body::PvtCartesian(b) | sbf::Body::PvtGeodetic(b) => {
            let geodetic = matches!(block.body, sbf::Body::PvtGeodetic(_));
            let p = if geodetic {
                ["Latitude", "Longitude", "Height"]
            } else {
                ["X", "Y", "Z"]
            };
            let v = if geodetic {
                ["Vn", "Ve", "Vu"]
            } else {
                ["Vx", "Vy", "Vz"]
            };
            let scaled = |v: Option<u16>, s: f64| Some(f64::from(v.unwrap_or(u16::MAX)) * s);
            let mut all = vec![
                ("Type", Some(f64::from(b.mode & 15))),
                ("Error", Some(b.error.into())),
                ("Undulation", f(b.undulation_m)),
                ("COG", f(b.course_deg)),
                ("RxClkBias", b.clock_bias_ms),
                ("RxClkDrift", f(b.clock_drift_ppm)),
                ("NrSV", b.satellites.map(f64::from)),
                ("SignalInfo", Some(b.signal_info.into())),
                ("MeanCorrAge", scaled(b.correction_age_cs, 0.01)),
                ("Latency", scaled(b.latency_100us, 1e-4)),
                ("HAccuracy", scaled(b.horizontal_accuracy_cm, 0.01)),
                ("VAccuracy", scaled(b.vertical_accuracy_cm, 0.01)),
            ];
            all.extend([0, 1, 2].map(|i| (p[i], b.position[i])));
            all.extend([0, 1, 2].map(|i| (v[i], f(b.velocity_m_s[i]))));
            all
        }
        sbf::Body::PosCovCartesian(b) | sbf::Body::VelCovCartesian(b) => {
            let position = matches!(block.body, sbf::Body::PosCovCartesian(_));
            let names = if position {
                [
                    "Cov_xx", "Cov_yy", "Cov_zz", "Cov_bb", "Cov_xy", "Cov_xz", "Cov_xb", "Cov_yz",
                    "Cov_yb", "Cov_zb",
                ]
            } else {
                [
                    "Cov_VxVx", "Cov_VyVy", "Cov_VzVz", "Cov_DtDt", "Cov_VxVy", "Cov_VxVz",
                    "Cov_VxDt", "Cov_VyVz", "Cov_VyDt", "Cov_VzDt",
                ]
            };
            names.into_iter().zip(b.elements.map(f)).collect()
        }
        sbf::Body::PosCovGeodetic(b) => {
            let names = [
                "Cov_latlat",
                "Cov_lonlon",
                "Cov_hgthgt",
                "Cov_bb",
                "Cov_latlon",
                "Cov_lathgt",
                "Cov_latb",
                "Cov_lonhgt",
                "Cov_lonb",
                "Cov_hb",
            ];
            names.into_iter().zip(b.elements.map(f)).collect()
        }
        sbf::Body::VelCovGeodetic(b) => {
            let names = [
                "Cov_VnVn", "Cov_VeVe", "Cov_VuVu", "Cov_DtDt", "Cov_VnVe", "Cov_VnVu", "Cov_VnDt",
                "Cov_VeVu", "Cov_VeDt", "Cov_VuDt",
            ];
            names.into_iter().zip(b.elements.map(f)).collect()
        }
        sbf::Body::AttEuler(b) => vec![
            ("Heading", f(b.heading_deg)),
            ("Pitch", f(b.pitch_deg)),
            ("Roll", f(b.roll_deg)),
            ("Error", Some(b.error.into())),
        ],
        sbf::Body::AttCovEuler(b) => vec![("Error", Some(b.error.into()))],
        sbf::Body::ReceiverTime {
            utc,
            leap_seconds,
            sync_level,
        } => vec![
            ("UTCYear", Some(utc[0].into())),
            ("UTCMonth", Some(utc[1].into())),
            ("UTCDay", Some(utc[2].into())),
            ("UTCHour", Some(utc[3].into())),
            ("UTCMin", Some(utc[4].into())),
            ("UTCSec", Some(utc[5].into())),
            ("DeltaLS", Some((*leap_seconds).into())),
            ("SyncLevel", Some((*sync_level).into())),
        ],
        sbf::Body::XppsOffset {
            sync_age,
            time_scale,
            ..
        } => vec![
            ("SyncAge", Some((*sync_age).into())),
            ("TimeScale", Some((*time_scale).into())),
        ],
        other => panic!("no reference for {other:?}"),
    }
}

#[test]
fn sbf_reference_decodes() {
    let names = [
        "sbf-pysbf2/sbfdata.log",
        "sbf-pysbf2/pygpsdata_x5pvt.log",
        "sbf-pysbf2/pygpsdata_mixed.log",
        "sbf-pysbf2/pygpsdata_x5_attitude.log",
        "sbf-pysbf2/pygpsdata_x5_pvtcart.log",
        "sbf-pysbf2/pygpsdata_x5_pvtgeod.log",
        "sbf-pysbf2/pygpsdata_x5_time.log",
        "sbf-pysbf2/pygpsdata_x5_pvttruncated.log",
        "sbf-pysbf2/pygpsdata_x5status.log",
        "sbf-pysbf2/pygpsdata_x5nav.log",
        "sbf-pysbf2/pygpsdata_bad.log",
        "mixed-fixposition/test_data_sbf.bin",
    ];
    let (mut blocks, mut framed, mut fields) = (0, 0, 0);
    for name in names {
        let (Some(bytes), Some(reference)) = (
            common::read(name),
            common::read_json_lines(&format!("{name}.pysbf2.jsonl")),
        ) else {
            return;
        };
        let (found, _) = decode(&bytes);
        for want in &reference {
            let offset = want["off"].as_u64().expect("offset");
            let Some((.., message, _)) = found.iter().find(|f| f.3.start == offset) else {
                panic!("{name}: no block at {offset}: {want}");
            };
            framed += 1;
            let Message::Sbf(block) = message else {
                assert!(
                    matches!(message, Message::Unknown(_)),
                    "{name}: {message:?}"
                );
                continue;
            };
            blocks += 1;
            assert_eq!(want["TOW"], block.time_of_week_ms.expect("time of week"));
            assert_eq!(want["WNc"], block.week.expect("week"));
            for (field, value) in sbf_fields(block) {
                let Some(theirs) = want[field].as_f64() else {
                    panic!("{field} is not in {want}");
                };
                let ours = value.unwrap_or(if field == "NrSV" { 255.0 } else { -2e10 });
                assert!(
                    (ours - theirs).abs() <= 1e-9 * theirs.abs().max(1e-6),
                    "{name} {field}: {ours}, expected {theirs}"
                );
                fields += 1;
            }
        }
    }
    eprintln!("SBF: {framed} blocks framed, {blocks} decoded, {fields} fields compared");
    assert!(blocks > 0 && fields > 0, "nothing was compared");
}

#[test]
fn nmea_reference_decodes() {
    let Some(bytes) = common::read("mixed-fixposition/test_data_nmea.bin") else {
        return;
    };
    let (found, statistics) = decode(&bytes);
    assert_eq!(statistics.skipped_bytes, 0);
    let names: Vec<_> = found.iter().map(|f| f.1).collect();
    assert_eq!(names, ["RMC", "GGA"]);
    let Message::Nmea(nmea::Sentence::Gga {
        utc_s,
        position_deg,
        satellites,
        ..
    }) = found[1].2
    else {
        panic!("{found:?}");
    };
    assert_eq!(satellites, Some(12));
    assert!((utc_s.expect("time") - 64_004.2).abs() < 1e-6);
    let [lat, lon] = position_deg.expect("position");
    assert!((lat - 47.400_303).abs() < 1e-6 && (lon - 8.450_374).abs() < 1e-6);
}

#[test]
fn a_mixture_of_protocols() {
    let Some(bytes) = common::read("mixed-fixposition/test_data_mixed.bin") else {
        return;
    };
    let (found, statistics) = decode(&bytes);
    let count = |p: Protocol| found.iter().filter(|f| f.0 == p).count();
    eprintln!(
        "mixture: {} NovAtel, {} NMEA; {statistics:?}",
        count(Protocol::NovatelBinary),
        count(Protocol::Nmea)
    );
    // Two long and one short NovAtel header are in the file, among UBX and RTCM frames; one UBX frame is
    // damaged.
    assert_eq!(
        (count(Protocol::NovatelBinary), count(Protocol::Nmea)),
        (3, 4)
    );
    assert_eq!((statistics.checksum_errors, statistics.malformed), (1, 0));
}

fn logs() -> impl Strategy<Value = Log> {
    let position = (
        -90.0f64..90.0,
        -180.0f64..180.0,
        -100.0f64..3000.0,
        any::<[u8; 4]>(),
    )
        .prop_map(|(latitude_deg, longitude_deg, height_msl_m, satellites)| {
            let mut body = novatel::Position {
                latitude_deg,
                longitude_deg,
                height_msl_m,
                datum: 61,
                ..Default::default()
            };
            body.solution.kind = 50;
            body.tail.satellites = satellites;
            (42, novatel::Body::Position(body))
        });
    let velocity = (0.0f64..60.0, 0.0f64..360.0, -5.0f64..5.0).prop_map(
        |(horizontal_m_s, track_deg, vertical_m_s)| {
            let body = novatel::Velocity {
                horizontal_m_s,
                track_deg,
                vertical_m_s,
                latency_s: 0.15,
                ..Default::default()
            };
            (99, novatel::Body::Velocity(body))
        },
    );
    let inertial = (-180.0f64..180.0).prop_map(|roll_deg| {
        let body = novatel::Inertial {
            roll_deg,
            status: 3,
            ..Default::default()
        };
        (508, novatel::Body::Inertial(body))
    });
    let heading = (0.0f32..360.0).prop_map(|heading_deg| {
        (
            971,
            novatel::Body::Heading(novatel::Heading {
                heading_deg,
                ..Default::default()
            }),
        )
    });
    let time = Just((
        101,
        novatel::Body::Time(novatel::Time {
            utc_offset_s: -18.0,
            year: 2026,
            utc_status: 1,
            ..Default::default()
        }),
    ));
    (
        prop_oneof![position, velocity, inertial, heading, time],
        1u16..4000,
        0u32..604_800_000,
    )
        .prop_map(|((id, body), week, ms)| Log::new(id, week, ms, body).expect("id fits body"))
}

fn blocks() -> impl Strategy<Value = Block> {
    let some = |v: [f64; 3]| v.map(Some);
    let v1 = prop::array::uniform3(-7e6f64..7e6).prop_map(move |p| {
        let b = sbf::PvtV1 {
            mode: 4,
            position: some(p),
            velocity_m_s: [Some(1.0), None, Some(-2.0)],
            ..Default::default()
        };
        (5903, 0, sbf::Body::PvtCartesianV1(b))
    });
    let geodetic = (prop::array::uniform3(-1.5f64..1.5), 0u8..3).prop_map(move |(p, revision)| {
        let b = sbf::Pvt {
            mode: 4,
            position: some(p),
            satellites: Some(9),
            ..Default::default()
        };
        (4007, revision, sbf::Body::PvtGeodetic(b))
    });
    let attitude = (0.0f32..360.0).prop_map(|heading| {
        let b = sbf::EulerAttitude {
            mode: 4,
            heading_deg: Some(heading),
            ..Default::default()
        };
        (5938, 0, sbf::Body::AttEuler(b))
    });
    let covariance = prop::array::uniform10(any::<f32>()).prop_map(|e| {
        let elements = e.map(|v| v.is_finite().then_some(v).filter(|v| *v != -2e10));
        (
            5907,
            0,
            sbf::Body::VelCovCartesian(sbf::Covariance {
                elements,
                ..Default::default()
            }),
        )
    });
    (
        prop_oneof![v1, geodetic, attitude, covariance],
        1u16..4000,
        0u32..604_800_000,
    )
        .prop_map(|((n, r, body), week, tow)| Block::new(n, r, week, tow, body))
}

/// An NMEA checksum has eight bits: some of these match by chance.
#[test]
fn a_stray_dollar_does_not_swallow_a_novatel_log() {
    for ms in 0..2000 {
        let body = novatel::Body::Velocity(novatel::Velocity::default());
        let mut bytes = b"$G".to_vec();
        let log = Log::new(99, 2000, ms, body).expect("99 is a velocity");
        log.encode_ascii(&mut bytes);
        let (found, _) = decode(&bytes);
        assert!(found.iter().any(|f| f.1 == "BESTVEL"), "lost at {ms} ms");
    }
}

/// Heading, velocity and position as sent come out in the project's axes.
#[test]
fn axes_and_signs() {
    use atvrec_wire::geodesy::Geodetic;
    use sample::Measurement;
    let place = Geodetic {
        latitude_rad: 0.57,
        longitude_rad: -1.49,
        height_m: 200.0,
    };
    let enu = [3.0, -4.0, 0.5];
    let mut bytes = Vec::new();
    let v1 = sbf::PvtV1 {
        mode: 4,
        position: place.to_ecef().map(Some),
        velocity_m_s: place.rotate_to_ecef(enu).map(|v| Some(v as f32)),
        ..Default::default()
    };
    Block::new(5903, 0, 1700, 1000, sbf::Body::PvtCartesianV1(v1)).encode(&mut bytes);
    let attitude = sbf::EulerAttitude {
        mode: 4,
        heading_deg: Some(90.0),
        pitch_deg: Some(5.0),
        roll_deg: Some(2.0),
        ..Default::default()
    };
    Block::new(5938, 0, 1700, 1000, sbf::Body::AttEuler(attitude)).encode(&mut bytes);
    let velocity = novatel::Velocity {
        horizontal_m_s: 2.0,
        track_deg: 90.0,
        latency_s: 0.15,
        ..Default::default()
    };
    Log::new(99, 1700, 1000, novatel::Body::Velocity(velocity))
        .expect("a velocity")
        .encode_binary(&mut bytes);
    nmea::encode_gga(12.5, place, -29.0, 9, &mut bytes);
    nmea::encode_rmc(12.5, "010614", place, enu, &mut bytes);
    nmea::encode_hrp(12.5, "010614", [0.1, -0.02, 0.03], [0.1; 3], &mut bytes);
    let mut all = Vec::new();
    Decoder::new().push(&bytes, |i| all.extend(i.measurements));
    let [
        Measurement::GnssPosition(p),
        Measurement::GnssVelocity(v),
        Measurement::GnssAttitude(a),
        Measurement::GnssVelocity(n),
        Measurement::GnssPosition(gga),
        Measurement::GnssPosition(place_of_rmc),
        Measurement::GnssVelocity(rmc),
        Measurement::GnssAttitude(hrp),
    ] = all.as_slice()
    else {
        panic!("{all:?}");
    };
    assert!((p.height_m - 200.0).abs() < 1e-6 && (p.latitude_rad - 0.57).abs() < 1e-12);
    assert!(
        v.velocity_enu_m_s
            .iter()
            .zip(enu)
            .all(|(a, b)| (a - b).abs() < 1e-5)
    );
    assert_eq!(a.yaw_rad, Some(0.0), "east is yaw zero");
    assert!(
        (a.pitch_rad.expect("pitch") + 5f64.to_radians()).abs() < 1e-9,
        "nose up is negative"
    );
    assert!((a.roll_rad.expect("roll") - 2f64.to_radians()).abs() < 1e-9);
    assert!((n.velocity_enu_m_s[0] - 2.0).abs() < 1e-9 && n.velocity_enu_m_s[1].abs() < 1e-9);
    assert!((n.latency_s.expect("latency") - 0.15).abs() < 1e-7);
    assert!((gga.height_m - 200.0).abs() < 1e-2 && (gga.longitude_rad + 1.49).abs() < 1e-9);
    assert!(
        (rmc.velocity_enu_m_s[0] - 3.0).abs() < 1e-3
            && (rmc.velocity_enu_m_s[1] + 4.0).abs() < 1e-3
    );
    assert!((place_of_rmc.latitude_rad - 0.57).abs() < 1e-9 && place_of_rmc.height_m.is_nan());
    assert!(
        rmc.velocity_enu_m_s[2].is_nan(),
        "RMC has no upward velocity"
    );
    assert!((hrp.yaw_rad.expect("yaw") - 0.1).abs() < 1e-4);
    assert!((hrp.pitch_rad.expect("pitch") + 0.02).abs() < 1e-4);
    assert!((hrp.roll_rad.expect("roll") - 0.03).abs() < 1e-4);
}

const HEADERS: &[u8] = b"\xAA\x44\x12\x1c*$@#BESTPOSA,<OK$R: $GP%";

proptest! {
    #[test]
    fn what_is_encoded_is_decoded(log in logs(), block in blocks()) {
        let mut bytes = Vec::new();
        log.encode_binary(&mut bytes);
        block.encode(&mut bytes);
        log.encode_ascii(&mut bytes);
        let (found, statistics) = decode(&bytes);
        prop_assert_eq!(found.len(), 3);
        prop_assert_eq!(statistics, Statistics { messages: 3, ..Statistics::default() });
        prop_assert_eq!(&found[0].2, &Message::Novatel(log.clone()));
        prop_assert_eq!(&found[1].2, &Message::Sbf(block));
        prop_assert_eq!(found[2].1, found[0].1);
        let Message::Novatel(text) = &found[2].2 else { panic!("{:?}", found[2]) };
        prop_assert_eq!(text.header, log.header);
        let mut again = Vec::new();
        text.encode_ascii(&mut again);
        prop_assert!(bytes.ends_with(&again), "ASCII is stable");
    }

    #[test]
    fn noise_never_costs_an_intact_message(
        parts in prop::collection::vec((common::noise(HEADERS), logs(), blocks(), any::<bool>()), 1..6),
        cuts in prop::collection::vec(1usize..60, 1..20),
    ) {
        let mut bytes = Vec::new();
        let mut places = Vec::new();
        for (noise, log, block, ascii) in &parts {
            bytes.extend(noise);
            places.push(bytes.len() as u64);
            if *ascii { log.encode_ascii(&mut bytes) } else { log.encode_binary(&mut bytes) }
            bytes.extend(noise);
            places.push(bytes.len() as u64);
            block.encode(&mut bytes);
        }
        let (found, statistics) = decode(&bytes);
        for place in &places {
            prop_assert!(found.iter().any(|f| f.3.start == *place), "lost the message at {}", place);
        }
        let mut decoder = Decoder::new();
        let mut again = Vec::new();
        let mut sink = |i: atvrec_wire::Item<'_>| again.push((i.protocol, i.name, i.message, i.range));
        for chunk in common::cut(&bytes, &cuts) {
            decoder.push(chunk, &mut sink);
        }
        decoder.finish(&mut sink);
        prop_assert_eq!(again, found);
        prop_assert_eq!(decoder.statistics(), statistics);
    }

    #[test]
    fn any_bytes_are_survived(bytes in prop::collection::vec(any::<u8>(), 0..3000)) {
        decode(&bytes);
        let mut decoder = Decoder::vectornav();
        let mut sink = |_: atvrec_wire::Item<'_>| {};
        decoder.push(&bytes, &mut sink);
        decoder.finish(&mut sink);
    }

    #[test]
    fn ubx_messages_are_encoded_as_they_were(
        kind in prop::sample::select(vec![[0x01, 0x07], [0x01, 0x3C], [0x01, 0x05], [0x01, 0x04], [0x0D, 0x03]]),
        payload in prop::collection::vec(any::<u8>(), 92),
    ) {
        let mut bytes = Vec::new();
        ubx::encode_frame(kind, &payload, &mut bytes);
        let (found, _) = decode(&bytes);
        for (_, name, message, _) in &found {
            let Message::Ubx(body) = message else { continue };
            let mut again = Vec::new();
            body.encode(&mut again);
            let (second, statistics) = decode(&again);
            prop_assert_eq!(statistics.messages, 1);
            prop_assert_eq!(second[0].1, *name);
            prop_assert_eq!(&second[0].2, message);
        }
    }
}
