//! Motions for the tests, and the built-in vehicle and sensors.

use atvrec_sim::{Emission, Motion, Options, Output, Port, TruthState, VirtualVehicle, WheelTruth};
use model::sensors::Sensors;
use model::vehicle::Vehicle;
use sample::{ImuSample, Measurement, PerWheel, STANDARD_GRAVITY_M_S2};

pub fn vehicle() -> Vehicle {
    Vehicle::builtin("prowler").expect("a built-in vehicle")
}

pub fn sensors() -> Sensors {
    Sensors::builtin("thesis-10bit").expect("built-in sensors")
}

/// A level circle to the left at constant speed, all corners alike.
pub fn circle(speed_m_s: f64, radius_m: f64, duration_s: f64) -> Motion {
    let rate = speed_m_s / radius_m;
    let states = (0..=(duration_s * 200.0) as usize)
        .map(|k| {
            let time_s = k as f64 / 200.0;
            let yaw_rad = rate * time_s;
            TruthState {
                time_s,
                position_m: [
                    radius_m * math::sin(yaw_rad),
                    radius_m * (1.0 - math::cos(yaw_rad)),
                    0.579,
                ],
                yaw_rad,
                velocity_body_m_s: [speed_m_s, 0.0, 0.0],
                rate_rad_s: [0.0, 0.0, rate],
                acceleration_m_s2: [0.0, speed_m_s * rate, 0.0],
                specific_force_m_s2: [0.0, speed_m_s * rate, STANDARD_GRAVITY_M_S2],
                steering_wheel_rad: 0.4,
                roll_rad: 0.02,
                pitch_rad: -0.01,
                wheels: PerWheel::from_fn(|wheel| WheelTruth {
                    force_n: [10.0, 600.0, 1500.0],
                    angular_speed_rad_s: speed_m_s / 0.3,
                    strut_length_m: if wheel.is_front() { 0.350 } else { 0.360 },
                    link_force_n: [-300.0, 200.0, 700.0, -800.0, 400.0],
                    ..WheelTruth::default()
                }),
                ..TruthState::default()
            }
        })
        .collect();
    Motion::new("circle", states).expect("a motion")
}

pub fn emissions(motion: Motion, options: &Options, seed: u64) -> Vec<Emission> {
    VirtualVehicle::new(motion, &vehicle(), &sensors(), options, seed)
        .expect("a virtual vehicle")
        .collect()
}

pub fn bytes_of(emissions: &[Emission], port: Port) -> Vec<u8> {
    emissions
        .iter()
        .filter(|emission| emission.port == port)
        .flat_map(|emission| match &emission.output {
            Output::Bytes(bytes) => bytes.clone(),
            Output::Can(_) => panic!("a frame on {port:?}"),
        })
        .collect()
}

pub fn frames_of(emissions: &[Emission], id: u32) -> Vec<[u16; 4]> {
    emissions
        .iter()
        .filter_map(|emission| match &emission.output {
            Output::Can(frame) if frame.id == id => Some(&frame.data),
            _ => None,
        })
        .map(|bytes| std::array::from_fn(|i| u16::from_le_bytes([bytes[2 * i], bytes[2 * i + 1]])))
        .collect()
}

pub fn imu_samples(emissions: &[Emission]) -> Vec<ImuSample> {
    let mut samples = Vec::new();
    let mut decoder = wire::crossbow440::Decoder::default();
    decoder.push(&bytes_of(emissions, Port::Imu), |item| {
        for measurement in item.measurements.iter() {
            if let Measurement::Imu(sample) = measurement {
                samples.push(*sample);
            }
        }
    });
    let statistics = decoder.statistics();
    assert_eq!((statistics.checksum_errors, statistics.gaps), (0, 0));
    samples
}
