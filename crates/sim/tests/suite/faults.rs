//! Faults do what they say, where and when they say it, and nothing else.

use atvrec_sim::{
    Chance, ChannelFault, ChannelFaultKind, Faults, ImuFault, ImuFaultKind, Interruption, Options,
    Output, Port,
};
use sample::{StrainChannel, Wheel};

use crate::support::{self, bytes_of, circle, emissions, frames_of, imu_samples};

fn with(faults: Faults) -> Options {
    Options {
        faults,
        ..Options::default()
    }
}

fn channel(kind: ChannelFaultKind) -> Options {
    with(Faults {
        channel: vec![ChannelFault {
            wheel: Wheel::FrontRight,
            channel: Some(StrainChannel::LowerFront),
            kind,
            from_s: 1.0,
            to_s: 3.0,
        }],
        ..Faults::default()
    })
}

/// Counts of the faulty channel: sound, faulty.
fn lower_front(options: &Options) -> (Vec<u16>, Vec<u16>) {
    let run = |options: &Options| {
        frames_of(&emissions(circle(5.0, 15.24, 4.0), options, 9), 0x130)
            .into_iter()
            .map(|frame| frame[2])
            .collect()
    };
    (run(&Options::default()), run(options))
}

#[test]
fn channel_faults() {
    let check = |kind, expected: &dyn Fn(usize, &[u16]) -> i32| {
        let (sound, faulty) = lower_front(&channel(kind));
        for (k, &count) in faulty.iter().enumerate() {
            let wanted = if (100..300).contains(&k) {
                expected(k, &sound)
            } else {
                i32::from(sound[k])
            };
            // Rounding falls on either side once the level is mirrored or shifted.
            assert!(
                (i32::from(count) - wanted).abs() <= 1,
                "{kind:?} at {k}: {count} {wanted}"
            );
        }
    };
    check(ChannelFaultKind::Dead, &|_, _| 0);
    check(ChannelFaultKind::Frozen, &|_, sound| i32::from(sound[99]));
    check(ChannelFaultKind::Inverted, &|k, sound| {
        1024 - i32::from(sound[k])
    });
    check(ChannelFaultKind::Step { counts: 40.0 }, &|k, sound| {
        i32::from(sound[k]) + 40
    });
    let drift = ChannelFaultKind::Drifting { counts_per_s: 50.0 };
    check(drift, &|k, sound| {
        i32::from(sound[k]) + (k as i32 - 100) / 2
    });
}

#[test]
fn a_bending_wired_channel_reads_bending_instead_of_axial_force() {
    let counts = |channel, slot: usize| {
        let options = with(Faults {
            channel: vec![ChannelFault {
                wheel: Wheel::FrontRight,
                channel: Some(channel),
                kind: ChannelFaultKind::BendingWired,
                from_s: 0.0,
                to_s: f64::INFINITY,
            }],
            ..Faults::default()
        });
        let frames = frames_of(&emissions(circle(5.0, 15.24, 4.0), &options, 9), 0x130);
        frames
            .iter()
            .skip(30)
            .map(|f| f64::from(f[slot]))
            .sum::<f64>()
            / (frames.len() - 30) as f64
    };
    // The upper arm is a two-force member: it hardly bends, whatever its tubes carry.
    assert!((counts(StrainChannel::UpperFront, 0) - 512.0).abs() < 1.0);
    // The lower arm holds the strut: its outboard part bends strongly, upwards at the ball joint.
    assert!(counts(StrainChannel::LowerFront, 2) > 600.0);
}

#[test]
fn other_sensors_do_not_notice() {
    let run = |options: &Options| emissions(circle(5.0, 15.24, 4.0), options, 9);
    let (sound, faulty) = (
        run(&Options::default()),
        run(&channel(ChannelFaultKind::Frozen)),
    );
    for id in [0x110, 0x111, 0x131, 0x140, 0x200, 0x210] {
        assert_eq!(frames_of(&sound, id), frames_of(&faulty, id), "{id:#x}");
    }
    assert_eq!(bytes_of(&sound, Port::Imu), bytes_of(&faulty, Port::Imu));
}

#[test]
fn an_axis_of_the_inertial_unit_freezes() {
    let options = with(Faults {
        imu: vec![ImuFault {
            axis: 5,
            kind: ImuFaultKind::Frozen,
            from_s: 1.0,
            to_s: f64::INFINITY,
        }],
        ..Faults::default()
    });
    let samples = imu_samples(&emissions(circle(5.0, 15.24, 3.0), &options, 9));
    let late = &samples[110..];
    assert!(
        late.iter()
            .all(|s| s.angular_rate_rad_s[2] == late[0].angular_rate_rad_s[2])
    );
    assert!(
        late.iter()
            .any(|s| s.angular_rate_rad_s[1] != late[0].angular_rate_rad_s[1])
    );
}

#[test]
fn lines_lose_and_change_bytes() {
    let interruption = |port| Interruption {
        port,
        from_s: 1.002,
        to_s: 2.002,
    };
    let chance = |port, probability| Chance {
        port,
        probability,
        from_s: 0.0,
        to_s: f64::INFINITY,
    };
    let options = with(Faults {
        unplugged: vec![interruption(Port::Imu)],
        dropped: vec![chance(Port::Can0, 0.25)],
        byte_noise: vec![chance(Port::Novatel, 0.01)],
        ..Faults::default()
    });
    let run = |options: &Options| emissions(circle(5.0, 15.24, 4.0), options, 9);
    let (sound, faulty) = (run(&Options::default()), run(&options));

    let inside =
        |e: &&atvrec_sim::Emission| e.port == Port::Imu && (1.002..2.002).contains(&e.time_s);
    assert_eq!(faulty.iter().filter(inside).count(), 0);
    let torn = faulty.iter().any(|e| match &e.output {
        Output::Bytes(bytes) => e.port == Port::Imu && bytes.len() < 31,
        Output::Can(_) => false,
    });
    assert!(torn, "the plug is pulled in the middle of a packet");

    let frames =
        |all: &[atvrec_sim::Emission]| all.iter().filter(|e| e.port.is_can()).count() as f64;
    let kept = frames(&faulty) / frames(&sound);
    assert!((kept - 0.75).abs() < 0.03, "{kept}");

    let [a, b] = [&sound, &faulty].map(|all| bytes_of(all, Port::Novatel));
    let changed = a.iter().zip(&b).filter(|(x, y)| x != y).count() as f64;
    assert_eq!(a.len(), b.len());
    assert!((changed / a.len() as f64 - 0.01).abs() < 0.004);
}

#[test]
fn a_fault_file_reads_and_refuses_what_it_does_not_know() {
    let text = r#"
        [[channel]]
        wheel = "front_right"
        channel = "lower_front"
        kind = { drifting = { counts_per_s = 2.0 } }
        from_s = 5.0

        [[outage]]
        port = "novatel"
        from_s = 8.0
        to_s = 11.0
    "#;
    let faults: Faults = toml::from_str(text).expect("a fault file");
    assert_eq!(faults.channel[0].to_s, f64::INFINITY);
    assert_eq!(faults.outage[0].port, Port::Novatel);
    let back: Faults = toml::from_str(&toml::to_string(&faults).expect("TOML")).expect("TOML");
    assert_eq!(back, faults);
    assert!(toml::from_str::<Faults>("[[outtage]]\nport = \"novatel\"").is_err());
}

#[test]
fn faults_that_make_no_sense_are_refused() {
    let options = with(Faults {
        imu: vec![ImuFault {
            axis: 6,
            kind: ImuFaultKind::Inverted,
            from_s: 0.0,
            to_s: 1.0,
        }],
        ..Faults::default()
    });
    let (vehicle, sensors) = (support::vehicle(), support::sensors());
    let made =
        atvrec_sim::VirtualVehicle::new(circle(5.0, 15.24, 1.0), &vehicle, &sensors, &options, 1);
    let error = made.err().expect("there is no seventh axis");
    assert_eq!(error.to_string(), "imu.axis is 6; it must be 0 to 5");
}
