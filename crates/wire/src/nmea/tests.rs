use sample::{FixQuality, GnssPosition, GnssVelocity, Measurement};

use super::*;
use crate::gnss::Decoder;

/// Measurements of sentences without their checksums.
fn measured(sentences: &[&str]) -> Vec<Measurement> {
    let mut bytes = Vec::new();
    for sentence in sentences {
        encode_sentence(sentence, &mut bytes);
    }
    let mut decoder = Decoder::new();
    let mut all = Vec::new();
    decoder.push(&bytes, |item| all.extend(item.measurements));
    let statistics = decoder.statistics();
    assert_eq!(statistics.messages, sentences.len() as u64);
    assert_eq!(
        (statistics.malformed, statistics.unknown),
        (0, 0),
        "{sentences:?}"
    );
    all
}

fn velocity(sentences: &[&str]) -> GnssVelocity {
    let last = measured(sentences).pop();
    match last {
        Some(Measurement::GnssVelocity(velocity)) => velocity,
        other => panic!("{other:?}"),
    }
}

fn position(sentences: &[&str]) -> GnssPosition {
    let all = measured(sentences);
    let mut all = all.into_iter().filter_map(|one| match one {
        Measurement::GnssPosition(position) => Some(position),
        _ => None,
    });
    all.next_back().expect("a position")
}

const PLACE: &str = "3235.0,N,08529.0,W";

fn gga(quality: &str) -> String {
    format!("GPGGA,120000.00,{PLACE},{quality},08,0.9,200.0,M,-30.0,M,,")
}

fn rmc(status: &str, rest: &str) -> String {
    format!("GPRMC,120000.00,{status},{PLACE},10.0,90.0,{rest}")
}

#[test]
fn modes_and_qualities_are_honoured_in_every_sentence() {
    use FixQuality::{DeadReckoning, Differential, Fixed, Float, None, Single};
    let qualities = [
        None,
        Single,
        Differential,
        Single,
        Fixed,
        Float,
        DeadReckoning,
        None,
        None,
    ];
    for (indicator, quality) in qualities.into_iter().chain([Differential]).enumerate() {
        let found = position(&[&gga(&indicator.to_string())]);
        assert_eq!(found.quality, quality, "GGA {indicator}");
        assert_eq!(found.latitude_rad.is_nan(), quality == None);
    }
    for (mode, quality) in [
        ("A", Single),
        ("P", Single),
        ("D", Differential),
        ("F", Float),
        ("R", Fixed),
        ("E", DeadReckoning),
        ("N", None),
        ("M", None),
        ("S", None),
    ] {
        let sentences = [
            rmc("A", &format!("010124,,,{mode}")),
            rmc("A", &format!("010124,,,{mode},V")),
            format!("GPVTG,90.0,T,,M,10.0,N,18.5,K,{mode}"),
        ];
        for sentence in sentences {
            let found = velocity(&[&sentence]);
            assert_eq!(found.quality, quality, "{sentence}");
            assert_eq!(found.velocity_enu_m_s[0].is_nan(), quality == None);
        }
        let gns = format!("GNGNS,120000.00,{PLACE},{mode}N,08,0.9,200.0,-30.0,,");
        assert_eq!(position(&[&gns]).quality, quality, "{gns}");
    }
    assert_eq!(velocity(&[&rmc("V", "010124,,,A")]).quality, None);
    assert_eq!(measured(&["GPTHS,90.0,V"]), []);
    assert_eq!(measured(&["GPTHS,90.0,A"]).len(), 1);
    let [Measurement::GnssAttitude(estimated)] = measured(&["GPTHS,90.0,E"])[..] else {
        panic!("a heading");
    };
    assert_eq!(estimated.quality, DeadReckoning);
}

/// A VTG of before version 2.3 has no mode: the solution of the other sentences counts.
#[test]
fn a_course_without_a_mode_has_the_quality_of_the_position() {
    let vtg = "GPVTG,90.0,T,,M,10.0,N,18.5,K";
    assert_eq!(velocity(&[vtg]).quality, FixQuality::Single);
    assert_eq!(velocity(&[&gga("0"), vtg]).quality, FixQuality::None);
    assert_eq!(
        velocity(&[&rmc("V", "010124,,"), vtg]).quality,
        FixQuality::None
    );
    assert_eq!(
        velocity(&[&gga("2"), vtg]).quality,
        FixQuality::Differential
    );
    let old = velocity(&["GPVTG,90.0,92.0,10.0,18.5"]);
    assert!((old.velocity_enu_m_s[0] - 5.1444).abs() < 1e-4);
    let by_km_h = velocity(&["GPVTG,90.0,T,,M,,N,18.0,K,A"]);
    assert!((by_km_h.velocity_enu_m_s[0] - 5.0).abs() < 1e-9);
}

#[test]
fn a_field_that_is_not_used_never_costs_the_sentence() {
    let east = 10.0 * M_S_PER_KNOT;
    for sentence in [
        rmc("A", "010124,0,A"),
        rmc("A", "010124,4.2,X,A"),
        rmc("A", "311304,,,A"),
        rmc("A", "000000,,,A"),
        rmc("A", ",,,A"),
        rmc("A", "010124"),
        rmc("A", "010124,,,A").replace("120000.00", "235960.00"),
        rmc("A", "010124,,,A").replace("120000.00", "996199"),
    ] {
        let found = velocity(&[&sentence]);
        assert!(
            (found.velocity_enu_m_s[0] - east).abs() < 1e-9,
            "{sentence}"
        );
        assert!(position(&[&sentence]).quality.is_solved(), "{sentence}");
    }
    let mut times = Vec::new();
    let leap = gga("1").replace("120000.00", "235960.00");
    let mut bytes = Vec::new();
    encode_sentence(&leap, &mut bytes);
    Decoder::new().push(&bytes, |item| times.extend(item.device_time));
    assert_eq!(times, [DeviceTime::UtcTimeOfDay(86_400.0)]);
}

#[test]
fn what_was_not_sent_is_not_made_up() {
    let without = gga("1").replace("-30.0", "");
    assert!(
        position(&[&without]).height_m.is_nan(),
        "no height of the geoid"
    );
    assert!((position(&[&gga("1")]).height_m - 170.0).abs() < 1e-9);
    let found = velocity(&[&rmc("A", "010124,,,A")]);
    assert!(found.velocity_enu_m_s[2].is_nan(), "no upward velocity");
    assert_eq!(found.on_the_level_m_s()[2], 0.0);
    let none = position(&["GPGGA,120000.00,,,,,0,00,99.99,,,,,,"]);
    assert_eq!(none.quality, FixQuality::None);
    assert!(none.latitude_rad.is_nan() && none.longitude_rad.is_nan());
    assert_eq!(measured(&["GPHDT,,T"]), []);
}

#[test]
fn a_standing_receiver_sends_a_speed_without_a_course() {
    for sentence in [
        "GNRMC,120000.00,A,3235.0,N,08529.0,W,0.004,,010124,,,A",
        "GNVTG,,T,,M,0.004,N,0.007,K,A",
    ] {
        let found = velocity(&[sentence]);
        let [east, north, _] = found.velocity_enu_m_s;
        assert!((math::hypot(east, north) - 0.002_058).abs() < 1e-6);
        assert_eq!(found.quality, FixQuality::Single);
        let sigma = found.sigma_enu_m_s.expect("a standard deviation");
        assert!(sigma.iter().all(|s| *s >= math::hypot(east, north)));
    }
}

#[test]
fn a_deviation_goes_with_the_next_positions() {
    let gst = "GPGST,120000.00,0.5,0.8,0.6,174.6,0.7,0.5,1.3";
    assert_eq!(
        position(&[gst, &gga("1")]).sigma_enu_m,
        Some([0.5, 0.7, 1.3])
    );
    assert_eq!(position(&[&gga("1")]).sigma_enu_m, None);
    let later = gga("1").replace("120000.00", "120003.00");
    assert_eq!(position(&[gst, &later]).sigma_enu_m, None);
}

#[test]
fn names_are_exact() {
    let kind = |text: &str| {
        let mut bytes = Vec::new();
        encode_sentence(text, &mut bytes);
        match decode(&bytes[..bytes.len() - 2]) {
            Decoded::Sentence(name, _) => name.to_owned(),
            Decoded::Unknown(name) => format!("unknown {}", name.unwrap_or("-")),
            Decoded::Malformed => "malformed".to_owned(),
        }
    };
    // Unicore's second antenna, a maker's own sentence, a known one that is not decoded.
    assert_eq!(kind(&gga("1").replace("GPGGA", "GNGGAH")), "unknown -");
    assert_eq!(kind("PGRME,1,M"), "unknown -");
    assert_eq!(kind("GPGSV,1,1,0"), "unknown GSV");
    assert_eq!(kind("INGGA,,,,,,0,,,,,,,,"), "GGA");
    assert_eq!(kind("GPGGA,120000.00"), "malformed");
    assert_eq!(kind("GPZDA,120000.00,01,01,2024,00,00"), "ZDA");
}
