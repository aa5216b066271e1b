//! The bytes, read back by the project's own decoders, say what was true within the sensors'
//! noise.

use crate::support::{bytes_of, circle, emissions, frames_of, imu_samples, sensors, vehicle};
use atvrec_sim::{Options, Output, Port, VirtualVehicle};

/// Mean and standard deviation.
fn moments(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let count = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / count;
    let variance = values.map(|v| (v - mean).powi(2)).sum::<f64>() / count;
    (mean, variance.sqrt())
}

/// The published bounds of a sample's standard deviation at this many values: +-4 sigma of
/// sigma/sqrt(2 n).
fn assert_sigma(what: &str, found: f64, expected: f64, count: usize) {
    let tolerance = 4.0 / (2.0 * count as f64).sqrt();
    assert!(
        (found / expected - 1.0).abs() < tolerance,
        "{what}: standard deviation {found}, expected {expected} within {tolerance}"
    );
}

#[test]
fn time_never_falls_and_ports_keep_their_rates() {
    let all = emissions(circle(5.0, 15.24, 10.0), &Options::default(), 1);
    assert!(all.windows(2).all(|pair| pair[0].time_s <= pair[1].time_s));
    let count = |port| all.iter().filter(|e| e.port == port).count();
    assert_eq!(count(Port::Imu), 1001);
    assert_eq!(count(Port::Novatel), 200 * 2 + 10);
    assert_eq!(count(Port::Septentrio), 100 * 4);
    assert_eq!(count(Port::Can0), 1001 * 10);
}

#[test]
fn the_same_seed_gives_the_same_bytes() {
    let run = |seed| emissions(circle(5.0, 15.24, 3.0), &Options::default(), seed);
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
}

#[test]
fn a_sensor_changed_leaves_the_others_bytes() {
    let run = |sensors| {
        let motion = circle(5.0, 15.24, 3.0);
        VirtualVehicle::new(motion, &vehicle(), &sensors, &Options::default(), 1)
            .expect("a virtual vehicle")
            .collect::<Vec<_>>()
    };
    let mut changed = sensors();
    changed.imu.accel_noise_m_s2 *= 2.0;
    changed.strain.noise_counts *= 3.0;
    changed.gnss_velocity.velocity_noise_m_s *= 2.0;
    let (a, b) = (run(sensors()), run(changed));
    assert_ne!(bytes_of(&a, Port::Imu), bytes_of(&b, Port::Imu));
    assert_ne!(frames_of(&a, 0x110), frames_of(&b, 0x110));
    assert_eq!(frames_of(&a, 0x200), frames_of(&b, 0x200));
    assert_eq!(frames_of(&a, 0x210), frames_of(&b, 0x210));
}

#[test]
fn inertial_unit_reads_truth_with_bias_and_noise() {
    let seconds = 40.0;
    let motion = circle(6.0, 15.24, seconds);
    let truth = motion.at(1.0);
    let vehicle_run = VirtualVehicle::new(motion, &vehicle(), &sensors(), &Options::default(), 3)
        .expect("a virtual vehicle");
    let (accel_bias, gyro_bias) = vehicle_run.imu_biases();
    let samples = imu_samples(&vehicle_run.collect::<Vec<_>>());
    let imu = sensors().imu;
    // On a steady circle the mount feels w x (w x r) besides: r is behind, so it pulls forward.
    let spin = truth.rate_rad_s[2].powi(2);
    let lever = [-spin * imu.position_m[0], -spin * imu.position_m[1], 0.0];
    for axis in 0..3 {
        let expected = truth.specific_force_m_s2[axis] + lever[axis] + accel_bias[axis];
        let (mean, sigma) = moments(samples.iter().map(|s| s.specific_force_m_s2[axis]));
        assert!(
            (mean - expected).abs() < 0.003,
            "force {axis}: {mean} {expected}"
        );
        assert_sigma("force", sigma, imu.accel_noise_m_s2, samples.len());
        assert!((accel_bias[axis].abs() - imu.accel_bias_m_s2).abs() < 1e-12);
        let (mean, sigma) = moments(samples.iter().map(|s| s.angular_rate_rad_s[axis]));
        let expected = truth.rate_rad_s[axis] + gyro_bias[axis];
        assert!(
            (mean - expected).abs() < 5e-4,
            "rate {axis}: {mean} {expected}"
        );
        assert_sigma("rate", sigma, imu.gyro_noise_rad_s, samples.len());
    }
}

#[test]
fn strain_counts_are_force_through_bridge_and_converter() {
    let all = emissions(circle(6.0, 15.24, 30.0), &Options::default(), 5);
    let frames = frames_of(&all, 0x110);
    // EA of the tube over half-axial bridge, gain 805 and 10 bit: 27 N a count.
    let chain = sensors().strain;
    let (wall_m, diameter_m) = (
        chain.tube_wall_m.unwrap(),
        chain.tube_outer_diameter_m.unwrap(),
    );
    let area = std::f64::consts::PI * wall_m * (diameter_m - wall_m);
    let modulus_pa = chain.youngs_modulus_pa.unwrap();
    let newtons_a_count = modulus_pa * area / (2.1 / 2.0 * 805.0 * 1024.0);
    for (channel, force_n) in [-300.0, 200.0, 700.0, -800.0].into_iter().enumerate() {
        let (mean, sigma) = moments(frames.iter().map(|frame| f64::from(frame[channel])));
        let error = mean - (512.0 + force_n / newtons_a_count);
        assert!(
            error.abs() < chain.zero_error_counts + 0.1,
            "{channel}: {error}"
        );
        assert_sigma("strain", sigma, (1.0_f64 + 1.0 / 12.0).sqrt(), frames.len());
    }
    let second = frames_of(&all, 0x111);
    let (tie, _) = moments(second.iter().map(|frame| f64::from(frame[0])));
    assert!((tie - (512.0 + 400.0 / newtons_a_count)).abs() < 0.6);
    let compression_m = vehicle().front.strut.expect("a strut").design_length_m - 0.350;
    let (deflection, _) = moments(second.iter().map(|frame| f64::from(frame[1])));
    assert!((deflection - (512.0 + compression_m / 0.15 * 1024.0)).abs() < 0.6);
    // No bending bridges here.
    assert!(second.iter().all(|f| f[2] == 0xFFFF && f[3] == 0xFFFF));
}

#[test]
fn steering_wheel_and_wheel_speeds() {
    let all = emissions(circle(6.0, 15.24, 30.0), &Options::default(), 5);
    let steer: Vec<f64> = all
        .iter()
        .filter_map(|e| match &e.output {
            Output::Can(f) if f.id == 0x200 => Some(i32::from_le_bytes([
                f.data[0], f.data[1], f.data[2], f.data[3],
            ])),
            _ => None,
        })
        .map(|hundredths| f64::from(hundredths) / 100.0)
        .collect();
    let (mean, sigma) = moments(steer.iter().copied());
    assert!((mean - 0.4_f64.to_degrees()).abs() < 0.04);
    assert_sigma(
        "steer",
        sigma,
        sensors().steer.expect("an encoder").noise_rad.to_degrees(),
        steer.len(),
    );
    let speeds = frames_of(&all, 0x210);
    let (mean, sigma) = moments(speeds.iter().map(|f| f64::from(f[2].cast_signed()) / 100.0));
    assert!((mean - 20.0).abs() < 0.01);
    assert_sigma("wheel speed", sigma, 0.005 * 20.0, speeds.len());
}

#[test]
fn frames_are_those_of_the_project_s_dbc() {
    let dbc = include_bytes!("../../../../crates/engine/assets/prowler.dbc");
    let database = wire::dbc::Database::parse(dbc).expect("the project's DBC");
    let all = emissions(circle(6.0, 15.24, 0.5), &Options::default(), 5);
    let mut seen = std::collections::BTreeSet::new();
    for emission in &all {
        let Output::Can(frame) = &emission.output else {
            continue;
        };
        let decoded = database.decode(frame).expect("a frame of the DBC");
        let value = |name: &str| {
            let signal = decoded.signals.iter().find(|s| *s.name == *name);
            signal.map(|s| s.value).expect("a signal of the DBC")
        };
        match &*decoded.message {
            "Steering" => assert!((value("hand_wheel_angle") - 22.9).abs() < 3.0),
            "WheelSpeed" => assert!((value("RR") - 20.0).abs() < 1.0),
            "Corner_RL" => assert!((value("deflection") - 559.0).abs() < 6.0),
            "Strain_RL" => assert!((value("lower_front") - 538.0).abs() < 6.0),
            _ => {}
        }
        seen.insert(decoded.message);
    }
    assert_eq!(seen.len(), 10, "{seen:?}");
}

#[test]
fn messages_leave_when_the_line_has_carried_them() {
    let all = emissions(circle(5.0, 15.24, 2.0), &Options::default(), 1);
    let first = |port| {
        all.iter()
            .find(|e| e.port == port)
            .expect("a message")
            .time_s
    };
    // 31 bytes of 10 bits at 57600 bit/s.
    let imu_s = first(Port::Imu);
    assert!((31.0 * 10.0 / 57_600.0..0.0056).contains(&imu_s), "{imu_s}");
    // Tag at 50 ms, 25 ms of processing, 104 bytes at 115200 bit/s, some jitter.
    let novatel_s = first(Port::Novatel);
    assert!((0.084..0.095).contains(&novatel_s), "{novatel_s}");
    let septentrio_s = first(Port::Septentrio);
    assert!((0.141..0.153).contains(&septentrio_s), "{septentrio_s}");
    let can_s = first(Port::Can0);
    assert!((0.0004..0.0006).contains(&can_s), "{can_s}");
}
