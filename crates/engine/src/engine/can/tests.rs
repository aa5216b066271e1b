use model::strain::ABSENT_COUNT;
use sample::{CanFlags, FrameData, Side};

use super::*;
use crate::config::{RoleOf, SyncFrame};

const DBC: &[u8] = b"VERSION \"\"\n\nBU_: Box\n\nBO_ 1 Rods: 8 Box\n \
    SG_ left : 0|16@1- (0.1,0) [0|0] \"mm\" Box\n SG_ right : 16|16@1+ (1,0) [0|0] \"count\" Box\n \
    SG_ angle : 32|16@1- (0.001,0) [0|0] \"rad\" Box\n";

/// Steering-wheel angle of a frame with these roles of the signals.
fn angle_rad(roles: &[(usize, Role)], fields: [u16; 3], rods: bool) -> Option<f64> {
    let roles = roles.iter().map(|&(signal, role)| RoleOf {
        database: 0,
        message: 0,
        signal,
        role,
        at: None,
    });
    let databases = vec![Database::parse(DBC).expect("a DBC file")];
    let meaning = CanMeaning::new(databases, roles.collect());
    let pots = Potentiometers {
        rate_hz: 100.0,
        span_m: 0.1,
        adc_bits: 10,
        noise_counts: 1.0,
        zero_error_counts: 0.0,
        excitation_v: None,
    };
    let scales = Scales {
        rack_m_rad: Some(0.01),
        rods: rods.then_some(pots),
        ..Scales::default()
    };
    let mut data = FrameData::zeros(8);
    for (bytes, field) in data.chunks_exact_mut(2).zip(fields) {
        bytes.copy_from_slice(&field.to_le_bytes());
    }
    let frame = CanFrame {
        id: 1,
        flags: CanFlags::default(),
        len: 8,
        data,
        len8_dlc: 0,
        kernel_ns: None,
        hardware_ns: None,
    };
    let arrived = Arrived {
        late_ns: 0,
        source: SourceId(0),
        log_time: LogTime(1_000_000_000),
        latency_s: 0.0,
        sampled: None,
    };
    let mut samples = Vec::new();
    CanDecoder::new(&meaning, scales).push(&arrived, &frame, &mut samples);
    samples.iter().find_map(|sample| match &sample.measurement {
        Measurement::Steer(steer) => Some(steer.steering_wheel_rad),
        _ => None,
    })
}

#[test]
fn tie_rods_in_metres_and_in_counts_give_the_steering_wheel() {
    let millimetres = (0, Role::SteerRod(Side::Left, Travel::Length(1e-3)));
    let counts = (1, Role::SteerRod(Side::Right, Travel::Counts));
    let encoder = (2, Role::Steer(1.0));
    // 5 mm to the left; a quarter of the span, 25 mm; 0.3 rad.
    let fields = [50, 768, 300];
    let close = |found: Option<f64>, expected: f64| {
        assert!(
            (found.expect("an angle") - expected).abs() < 1e-12,
            "{found:?}"
        );
    };
    close(angle_rad(&[millimetres], fields, false), 0.5);
    close(angle_rad(&[counts], fields, true), 2.5);
    close(angle_rad(&[millimetres, counts], fields, true), 1.5);
    // At an end of its range, or absent, the other one counts alone.
    close(
        angle_rad(&[millimetres, counts], [50, 1023, 300], true),
        0.5,
    );
    close(
        angle_rad(&[millimetres, counts], [50, ABSENT_COUNT, 300], true),
        0.5,
    );
    // Counts without a scale measure nothing.
    assert_eq!(angle_rad(&[counts], fields, false), None);
    // The sensors file tells which device measures the steering wheel.
    close(angle_rad(&[counts, encoder], fields, true), 2.5);
    close(angle_rad(&[counts, encoder], fields, false), 0.3);
    close(angle_rad(&[millimetres, encoder], fields, false), 0.3);
    assert_eq!(angle_rad(&[encoder], fields, true), None);
}

/// Decoded messages of frames, as `message: signals`.
fn decoded(databases: &[&str], frames: &[(u32, bool)]) -> Vec<String> {
    let parse = |text: &&str| Database::parse(text.as_bytes()).expect("a DBC file");
    let databases = databases.iter().map(parse).collect();
    let mut decoder = CanDecoder::new(&CanMeaning::new(databases, Vec::new()), Scales::default());
    let mut samples = Vec::new();
    let arrived = Arrived {
        late_ns: 0,
        source: SourceId(0),
        log_time: LogTime(1_000_000_000),
        latency_s: 0.0,
        sampled: None,
    };
    for (number, (id, extended)) in frames.iter().enumerate() {
        let flags = CanFlags {
            extended: *extended,
            ..CanFlags::default()
        };
        let frame = CanFrame::new(*id, flags, &[number as u8; 8]).expect("eight bytes");
        decoder.push(&arrived, &frame, &mut samples);
    }
    let signals = samples.iter().map(|sample| match &sample.measurement {
        Measurement::Signals(frame) => {
            let each = frame.signals.iter();
            let each = each.map(|s| format!("{}={}", s.name, s.value));
            format!("{}: {}", frame.message, each.collect::<Vec<_>>().join(" "))
        }
        other => panic!("{other:?}"),
    });
    signals.collect()
}

#[test]
fn messages_of_one_name_have_names_of_their_own() {
    let file = |id: u32, signal: &str| {
        format!(
            "VERSION \"\"\nBU_: A\nBO_ {id} M: 8 A\n SG_ {signal} : 0|8@1+ (1,0) [0|0] \"\" A\n"
        )
    };
    let files = [file(256, "s"), file(257, "t")];
    let found = decoded(&[&files[0], &files[1]], &[(256, false), (257, false)]);
    assert_eq!(found, ["M: s=0", "M_101: t=1"]);
}

#[test]
fn senders_of_a_parameter_group_are_told_apart() {
    let file = "VERSION \"\"\nBU_: A\nBO_ 2566845440 TIRE: 8 A\n \
        SG_ s : 0|8@1+ (1,0) [0|0] \"\" A\n\
        BA_DEF_ BO_ \"VFrameFormat\" ENUM \"StandardCAN\",\"ExtendedCAN\",\"reserved\",\"J1939PG\";\n\
        BA_DEF_DEF_ \"VFrameFormat\" \"J1939PG\";\n\
        BA_ \"VFrameFormat\" BO_ 2566845440 3;\n";
    let found = decoded(&[file], &[(0x18FE_F433, true), (0x18FE_F434, true)]);
    let expected = [
        "TIRE: s=0 j1939_can_id=419361843 j1939_source_address=51",
        "TIRE: s=1 j1939_can_id=419361844 j1939_source_address=52",
    ];
    assert_eq!(found, expected);
}

/// A message of 20 bytes to all, and trouble codes in one frame.
#[test]
fn messages_of_several_frames_and_trouble_codes_are_decoded() {
    let file = "VERSION \"\"\nBU_: A\nBO_ 2566841342 LONG: 20 A\n \
        SG_ late : 128|16@1+ (1,0) [0|0] \"\" A\n\
        BA_DEF_ BO_ \"VFrameFormat\" ENUM \"StandardCAN\",\"ExtendedCAN\",\"reserved\",\"J1939PG\";\n\
        BA_DEF_DEF_ \"VFrameFormat\" \"J1939PG\";\n\
        BA_ \"VFrameFormat\" BO_ 2566841342 3;\n";
    let group = parameter_group(2_566_841_342);
    let database = Database::parse(file.as_bytes()).expect("a DBC file");
    let meaning = CanMeaning::new(vec![database], Vec::new());
    let mut decoder = CanDecoder::new(&meaning, Scales::default());
    let [g0, g1, g2, _] = group.to_le_bytes();
    let frames: [(u32, [u8; 8]); 5] = [
        (0x1CEC_FF33, [32, 20, 0, 3, 0xFF, g0, g1, g2]),
        (0x1CEB_FF33, [1, 0, 1, 2, 3, 4, 5, 6]),
        (0x1CEB_FF33, [2, 7, 8, 9, 10, 11, 12, 13]),
        (0x1CEB_FF33, [3, 14, 15, 16, 1, 18, 19, 0xFF]),
        (
            0x18FE_CA00,
            [0x04, 0xFF, 0xB8, 0x04, 0x03, 0x0A, 0xFF, 0xFF],
        ),
    ];
    let mut samples = Vec::new();
    for (number, (id, data)) in frames.into_iter().enumerate() {
        let flags = CanFlags {
            extended: true,
            ..CanFlags::default()
        };
        let frame = CanFrame::new(id, flags, &data).expect("eight bytes");
        let arrived = Arrived {
            late_ns: 0,
            source: SourceId(0),
            log_time: LogTime(1_000_000_000 + 50_000_000 * number as u64),
            latency_s: 0.0,
            sampled: None,
        };
        decoder.push(&arrived, &frame, &mut samples);
    }
    let signals: Vec<_> = samples
        .iter()
        .filter_map(|sample| match &sample.measurement {
            Measurement::Signals(frame) => Some(frame),
            _ => None,
        })
        .collect();
    let value = |frame: &SignalFrame, name: &str| {
        let mut all = frame.signals.iter();
        all.find(|signal| *signal.name == *name).map(|s| s.value)
    };
    assert_eq!(signals.len(), 2, "{signals:?}");
    assert_eq!(&*signals[0].message, "LONG");
    assert_eq!(value(signals[0], "late"), Some(f64::from(1 << 8 | 16)));
    assert_eq!(value(signals[0], "j1939_source_address"), Some(51.0));
    assert_eq!(&*signals[1].message, DM1);
    let expected = [
        ("lamp_amber_warning", 1.0),
        ("codes", 1.0),
        ("spn_1", 1208.0),
        ("fmi_1", 3.0),
    ];
    for (name, expected) in expected {
        assert_eq!(value(signals[1], name), Some(expected), "{name}");
    }
}

/// A message is as old as the sync frame before it, whatever its own arrival; without a sync frame of the last time it
/// has its latency.
#[test]
fn a_sync_frame_gives_the_time_of_the_messages_that_it_marks() {
    let databases = vec![Database::parse(DBC).expect("a DBC file")];
    let role = RoleOf {
        database: 0,
        message: 0,
        signal: 2,
        role: Role::Steer(1.0),
        at: None,
    };
    let mut meaning = CanMeaning::new(databases, vec![role]);
    meaning.sync = Some(SyncFrame {
        id: (0x80, false),
        offset_s: 0.0005,
        within: std::time::Duration::from_millis(50),
        marks: vec![vec![true]],
    });
    let mut decoder = CanDecoder::new(&meaning, Scales::default());
    decoder.set_uncertain([0, 0], 3);
    let mut push = |id: u32, at_ms: u64, late_ns: i64| {
        let arrived = Arrived {
            source: SourceId(0),
            log_time: LogTime(at_ms * 1_000_000),
            latency_s: 0.002,
            late_ns,
            sampled: None,
        };
        let frame = CanFrame::new(id, CanFlags::default(), &[0; 8]).expect("eight bytes");
        let mut samples = Vec::new();
        let place = decoder.push(&arrived, &frame, &mut samples);
        let steer = samples.into_iter().find_map(|sample| {
            let is_steer = matches!(sample.measurement, Measurement::Steer(_));
            is_steer.then_some(sample.valid_time.0 / 1_000)
        });
        (steer, place)
    };
    // Microseconds: its own latency before the first sync frame.
    assert_eq!(push(1, 1_000, 0), (Some(998_000), Some(3)));
    assert_eq!(push(0x80, 1_010, 1_000_000), (None, None));
    assert_eq!(push(1, 1_013, 0), (Some(1_009_500), Some(3)));
    assert_eq!(push(1, 1_020, 0), (Some(1_009_500), Some(3)));
    assert_eq!(push(1, 1_100, 0), (Some(1_098_000), Some(3)));
}
