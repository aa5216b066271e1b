//! The Crossbow decoder against reference vectors and against noise.

use atvrec_wire::crossbow440::{BitStatus, Decoder, Increments, Packet, PacketRate, Scaled};
use atvrec_wire::{Message, Statistics};
use proptest::prelude::*;
use sample::{DeviceTime, Measurement};

use crate::common;

fn decode(bytes: &[u8]) -> (Vec<Packet>, Statistics) {
    let mut decoder = Decoder::default();
    let mut packets = Vec::new();
    let mut sink = |item: atvrec_wire::Item<'_>| {
        if let Message::Crossbow440(packet) = item.message {
            packets.push(packet);
        }
    };
    decoder.push(bytes, &mut sink);
    decoder.finish(&mut sink);
    (packets, decoder.statistics())
}

fn close(ours: f64, theirs: f64) -> bool {
    (ours - theirs).abs() <= 1e-12 * theirs.abs().max(1.0)
}

#[test]
fn s1_reference_vectors() {
    let (Some(bytes), Some(text)) = (
        common::read("crossbow-440/s1_vectors.bin"),
        common::read_text("crossbow-440/s1_vectors.json"),
    ) else {
        return;
    };
    let expected: Vec<serde_json::Value> = serde_json::from_str(&text).expect("valid JSON");
    let (packets, statistics) = decode(&bytes);
    assert_eq!(packets.len(), expected.len());
    assert_eq!(statistics.messages, expected.len() as u64);
    assert_eq!(
        (statistics.checksum_errors, statistics.skipped_bytes),
        (0, 0)
    );
    let mut compared = 0;
    let mut again = Vec::new();
    for (packet, want) in packets.iter().zip(&expected) {
        let Packet::S1(s) = packet else {
            panic!("{packet:?} is not S1");
        };
        s.encode_s1(&mut again);
        let accel = s
            .specific_force_m_s2
            .map(|a| a / sample::STANDARD_GRAVITY_M_S2);
        let ours = [
            ("ax_g", accel[0]),
            ("ay_g", accel[1]),
            ("az_g", accel[2]),
            ("p_rps", s.angular_rate_rad_s[0]),
            ("q_rps", s.angular_rate_rad_s[1]),
            ("r_rps", s.angular_rate_rad_s[2]),
            ("tx", s.gyro_temperature_c[0]),
            ("ty", s.gyro_temperature_c[1]),
            ("tz", s.gyro_temperature_c[2]),
            ("tboard", s.board_temperature_c),
            ("counter", f64::from(s.counter)),
            ("bit", f64::from(s.bit.0)),
        ];
        for (name, value) in ours {
            let theirs = want[name].as_f64().expect(name);
            assert!(close(value, theirs), "{name}: {value}, expected {theirs}");
            compared += 1;
        }
    }
    assert_eq!(again, bytes, "encoding gives the same bytes");
    eprintln!("S1: {} packets, {compared} fields compared", packets.len());
}

#[test]
fn s2_reference_vectors() {
    let (Some(bytes), Some(text)) = (
        common::read("crossbow-440/s2_vectors.bin"),
        common::read_text("crossbow-440/s2_vectors.json"),
    ) else {
        return;
    };
    let expected: Vec<serde_json::Value> = serde_json::from_str(&text).expect("valid JSON");
    let (packets, _) = decode(&bytes);
    assert_eq!(packets.len(), expected.len());
    let mut compared = 0;
    let mut again = Vec::new();
    for (packet, want) in packets.iter().zip(&expected) {
        let Packet::S2(s) = packet else {
            panic!("{packet:?} is not S2");
        };
        s.encode_s2(&mut again);
        for axis in 0..3 {
            let dv = want["dv"][axis].as_f64().expect("dv");
            let dth = want["dth"][axis].as_f64().expect("dth");
            assert!(close(s.delta_v_m_s[axis], dv), "{s:?}");
            assert!(close(s.delta_angle_rad[axis], dth), "{s:?}");
            compared += 2;
        }
        assert_eq!(
            u64::from(s.counter),
            want["counter"].as_u64().expect("counter")
        );
        assert_eq!(u64::from(s.bit.0), want["bit"].as_u64().expect("bit"));
        compared += 2;
    }
    assert_eq!(again, bytes, "encoding gives the same bytes");
    eprintln!("S2: {} packets, {compared} fields compared", packets.len());
}

/// At rest with z down: a_z of -1 g is -3277 counts.
#[test]
fn a_packet_by_hand() {
    let bytes = [
        0x55, 0x55, 0x53, 0x31, 0x18, 0, 0, 0, 0, 0xF3, 0x33, 0, 0, 0, 0, 0, 0, 0x13, 0x33, 0x13,
        0x33, 0x13, 0x33, 0x14, 0x7B, 0, 0, 0, 0, 0x4E, 0xAF,
    ];
    let mut decoder = Decoder::default();
    let mut seen = 0;
    decoder.push(&bytes, |item| {
        seen += 1;
        assert_eq!(item.name, "S1");
        assert_eq!(item.raw, bytes);
        assert_eq!(item.range, 0..31);
        let counter = DeviceTime::Counter {
            value: 0,
            modulus: 65_536,
        };
        assert_eq!(item.device_time, Some(counter));
        let Some(Measurement::Imu(imu)) = item.measurements.iter().next() else {
            panic!("no inertial sample");
        };
        assert!((imu.specific_force_m_s2[2] + 9.807_248).abs() < 1e-5);
        assert!(imu.valid);
    });
    assert_eq!(seen, 1);
}

#[test]
fn status_bits() {
    assert!(BitStatus(0x0300).is_good(), "a missing 1PPS is no failure");
    assert!(!BitStatus(0x0002).is_good());
    assert!(!BitStatus(0x1000).is_good());
}

#[test]
fn missing_packets_are_counted() {
    let mut bytes = Vec::new();
    for counter in [65_533u16, 65_534, 1, 2, 2, 40_000] {
        Scaled {
            counter,
            ..Scaled::default()
        }
        .encode_s1(&mut bytes);
    }
    // 65535 and 0 are missing; the repeated 2 is a restart; 3 to 39999 is a jump of more than half.
    assert_eq!(decode(&bytes).1.gaps, 2 + 1 + 1);
}

#[test]
fn increments_become_rates() {
    let mut bytes = Vec::new();
    let increments = Increments {
        delta_v_m_s: [0.1, 0.0, -0.196_133],
        ..Increments::default()
    };
    increments.encode_s2(&mut bytes);
    let mut decoder = Decoder::new(PacketRate::Hz50);
    decoder.push(&bytes, |item| {
        let Some(Measurement::Imu(imu)) = item.measurements.into_iter().next() else {
            panic!("no inertial sample");
        };
        assert_eq!(imu.interval_s, 0.02);
        assert!((imu.specific_force_m_s2[0] - 5.0).abs() < 1e-5);
    });
}

prop_compose! {
    fn any_scaled()(words in prop::array::uniform10(any::<i16>()), counter: u16, bit: u16) -> Scaled {
        let w = |i: usize, scale: f64| f64::from(words[i]) * scale;
        let g = 20.0 * sample::STANDARD_GRAVITY_M_S2 / 65_536.0;
        let r = 7.0 * std::f64::consts::PI / 65_536.0;
        let t = 200.0 / 65_536.0;
        Scaled {
            specific_force_m_s2: [w(0, g), w(1, g), w(2, g)],
            angular_rate_rad_s: [w(3, r), w(4, r), w(5, r)],
            gyro_temperature_c: [w(6, t), w(7, t), w(8, t)],
            board_temperature_c: w(9, t),
            counter,
            bit: BitStatus(bit),
        }
    }
}

proptest! {
    #[test]
    fn what_is_encoded_is_decoded(scaled in any_scaled()) {
        let mut bytes = Vec::new();
        scaled.encode_s1(&mut bytes);
        prop_assert_eq!(decode(&bytes).0, vec![Packet::S1(scaled)]);
    }

    #[test]
    fn noise_never_costs_an_intact_packet(
        parts in prop::collection::vec((any_scaled(), common::noise(b"\x55\x55S1\x18")), 1..8),
        cuts in prop::collection::vec(1usize..40, 1..20),
    ) {
        let mut bytes = Vec::new();
        for (scaled, noise) in &parts {
            bytes.extend(noise);
            scaled.encode_s1(&mut bytes);
        }
        let (packets, statistics) = decode(&bytes);
        for (scaled, _) in &parts {
            prop_assert!(packets.contains(&Packet::S1(*scaled)));
        }
        // Any cut of the stream gives the same.
        let mut decoder = Decoder::default();
        let mut again = Vec::new();
        let mut sink = |item: atvrec_wire::Item<'_>| if let Message::Crossbow440(p) = item.message { again.push(p) };
        for chunk in common::cut(&bytes, &cuts) {
            decoder.push(chunk, &mut sink);
        }
        decoder.finish(&mut sink);
        prop_assert_eq!(again, packets);
        prop_assert_eq!(decoder.statistics(), statistics);
    }

    #[test]
    fn a_damaged_packet_is_never_believed(scaled in any_scaled(), at in 2usize..31, flip in 1u8..) {
        let mut bytes = Vec::new();
        scaled.encode_s1(&mut bytes);
        bytes[at] ^= flip;
        prop_assert!(decode(&bytes).0.is_empty());
    }
}
