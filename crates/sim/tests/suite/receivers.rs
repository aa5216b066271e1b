//! Both receivers, read back by the project's decoder of a receiver port.

use atvrec_sim::{Emission, Faults, Interruption, Options, Port, SeptentrioBlocks, TruthState};
use nalgebra::Vector3;
use sample::{DeviceTime, FixQuality, GnssAttitude, GnssPosition, GnssVelocity, Measurement};
use wire::geodesy::Geodetic;

use crate::support::{bytes_of, circle, emissions, sensors};

/// What a receiver said, each with its time tag in seconds since the motion's start.
#[derive(Default)]
struct Said {
    positions: Vec<(f64, GnssPosition)>,
    velocities: Vec<(f64, GnssVelocity)>,
    attitudes: Vec<(f64, GnssAttitude)>,
}

fn listen(all: &[Emission], port: Port) -> Said {
    let start_s = f64::from(Options::default().gps_start.time_of_week_ms) / 1e3;
    let mut said = Said::default();
    let mut decoder = wire::gnss::Decoder::new();
    decoder.push(&bytes_of(all, port), |item| {
        let tag_s = match item.device_time {
            Some(DeviceTime::Gps { time_of_week_s, .. }) => time_of_week_s - start_s,
            other => panic!("{} tagged {other:?}", item.name),
        };
        for measurement in item.measurements.iter() {
            match measurement {
                Measurement::GnssPosition(p) => said.positions.push((tag_s, *p)),
                Measurement::GnssVelocity(v) => said.velocities.push((tag_s, *v)),
                Measurement::GnssAttitude(a) => said.attitudes.push((tag_s, *a)),
                _ => {}
            }
        }
    });
    let counts = decoder.statistics();
    assert_eq!(
        (
            counts.checksum_errors,
            counts.malformed,
            counts.skipped_bytes
        ),
        (0, 0, 0)
    );
    said
}

const SPEED_M_S: f64 = 6.0;
const RADIUS_M: f64 = 15.24;

/// Velocity of a point of the body in earth axes, by the rigid body's own formula.
fn velocity_at(truth: &TruthState, r: [f64; 3]) -> [f64; 3] {
    let [p, q, w] = truth.rate_rad_s;
    let v = truth.velocity_body_m_s;
    let body = [
        v[0] + q * r[2] - w * r[1],
        v[1] + w * r[0] - p * r[2],
        v[2] + p * r[1] - q * r[0],
    ];
    (truth.earth_from_body() * Vector3::from(body)).into()
}

fn rms(errors: &[f64]) -> f64 {
    (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
}

/// Root mean square of the velocity's errors against truth `late_s` before the tag.
fn velocity_rms(said: &Said, antenna_m: [f64; 3], late_s: f64) -> f64 {
    let motion = circle(SPEED_M_S, RADIUS_M, 60.0);
    let errors: Vec<f64> = said
        .velocities
        .iter()
        .skip(5)
        .flat_map(|(tag_s, found)| {
            let expected = velocity_at(&motion.at(tag_s - late_s), antenna_m);
            (0..3).map(move |i| found.velocity_enu_m_s[i] - expected[i])
        })
        .collect();
    rms(&errors)
}

#[test]
fn velocity_is_the_antenna_s_late_and_noisy_as_the_file_says() {
    let all = emissions(circle(SPEED_M_S, RADIUS_M, 60.0), &Options::default(), 4);
    let gnss = sensors().gnss_velocity;
    let said = listen(&all, Port::Novatel);
    assert_eq!(said.velocities.len(), 60 * 20);
    let right = velocity_rms(&said, gnss.antenna_m, gnss.latency_s);
    assert!(
        (right / gnss.velocity_noise_m_s - 1.0).abs() < 0.05,
        "{right} m/s"
    );
    // Neither the latency nor the lever arm may be forgotten.
    assert!(velocity_rms(&said, gnss.antenna_m, 0.0) > 1.2 * right);
    assert!(velocity_rms(&said, [0.0; 3], gnss.latency_s) > 2.0 * right);
    for (_, velocity) in &said.velocities {
        assert_eq!(velocity.quality, FixQuality::Single);
        assert!((velocity.latency_s.expect("BESTVEL has one") - 0.025).abs() < 1e-6);
    }
}

#[test]
fn position_wanders_about_the_antenna() {
    let motion = circle(SPEED_M_S, RADIUS_M, 60.0);
    let all = emissions(motion.clone(), &Options::default(), 4);
    let said = listen(&all, Port::Novatel);
    let gnss = sensors().gnss_velocity;
    let origin = Options::default().origin;
    let place = Geodetic {
        latitude_rad: origin.latitude_deg.to_radians(),
        longitude_rad: origin.longitude_deg.to_radians(),
        height_m: origin.height_m,
    };
    let start = place.to_ecef();
    let mut previous: Option<[f64; 3]> = None;
    for (tag_s, position) in &said.positions {
        let ecef = Geodetic {
            latitude_rad: position.latitude_rad,
            longitude_rad: position.longitude_rad,
            height_m: position.height_m,
        }
        .to_ecef();
        let enu = place.rotate_to_enu(std::array::from_fn(|i| ecef[i] - start[i]));
        let truth = motion.at(*tag_s);
        let error: [f64; 3] = std::array::from_fn(|i| enu[i] - truth.position_m[i]);
        // Five sigma and the lever arm.
        assert!(
            error
                .iter()
                .all(|e| e.abs() < 5.0 * gnss.position_noise_m + 1.3),
            "{error:?}"
        );
        if let Some(last) = previous {
            let step = (0..3)
                .map(|i| (error[i] - last[i]).abs())
                .fold(0.0, f64::max);
            assert!(step < 0.5, "it wanders, it does not jump: {step} m");
        }
        previous = Some(error);
    }
    assert_eq!(said.positions.len(), 60 * 20);
}

#[test]
fn attitude_is_late_and_noisy_as_the_file_says() {
    let motion = circle(SPEED_M_S, RADIUS_M, 60.0);
    for blocks in [SeptentrioBlocks::PolaRx2e, SeptentrioBlocks::Current] {
        let options = Options {
            septentrio_blocks: blocks,
            ..Options::default()
        };
        let all = emissions(motion.clone(), &options, 4);
        let said = listen(&all, Port::Septentrio);
        let gnss = sensors().gnss_attitude;
        let [mut yaw, mut pitch, mut roll] = [const { Vec::new() }; 3];
        for (tag_s, attitude) in said.attitudes.iter().filter(|(_, a)| a.yaw_rad.is_some()) {
            let truth = motion.at(tag_s - gnss.latency_s);
            let turn = std::f64::consts::TAU;
            let error = attitude.yaw_rad.expect("filtered") - truth.yaw_rad;
            yaw.push(error - turn * (error / turn).round());
            pitch.push(attitude.pitch_rad.expect("a pitch") - truth.pitch_rad);
            roll.push(attitude.roll_rad.expect("a roll") - truth.roll_rad);
        }
        assert_eq!(yaw.len(), 600, "{blocks:?}");
        for (errors, sigma) in [
            (yaw, gnss.heading_noise_rad),
            (pitch, gnss.roll_pitch_noise_rad),
            (roll, gnss.roll_pitch_noise_rad),
        ] {
            assert!(
                (rms(&errors) / sigma - 1.0).abs() < 0.12,
                "{} {sigma}",
                rms(&errors)
            );
        }
        // Its velocity is averaged over its own interval of 0.1 s.
        let velocity = velocity_rms(&said, gnss.antenna_m, 0.05);
        assert!(
            (velocity / 0.03 - 1.0).abs() < 0.07,
            "{blocks:?}: {velocity}"
        );
    }
}

#[test]
fn an_outage_is_told_by_the_receiver() {
    let outage = |port| Interruption {
        port,
        from_s: 2.0,
        to_s: 4.0,
    };
    let options = Options {
        faults: Faults {
            outage: vec![outage(Port::Novatel), outage(Port::Septentrio)],
            ..Faults::default()
        },
        ..Options::default()
    };
    let all = emissions(circle(SPEED_M_S, RADIUS_M, 6.0), &options, 4);
    for port in [Port::Novatel, Port::Septentrio] {
        let said = listen(&all, port);
        for (tag_s, velocity) in &said.velocities {
            let out = (2.0..4.0).contains(tag_s);
            assert_eq!(
                velocity.quality == FixQuality::None,
                out,
                "{port:?} at {tag_s} s"
            );
        }
        for (tag_s, attitude) in &said.attitudes {
            let out = (2.0..4.0).contains(tag_s);
            assert!(!out || attitude.yaw_rad.is_none(), "{port:?} at {tag_s} s");
        }
        assert!(said.velocities.iter().any(|(tag_s, _)| *tag_s > 4.0));
    }
}
