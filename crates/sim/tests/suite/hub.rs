//! Hub accelerometers, and the rate of every channel.

use std::collections::BTreeMap;

use atvrec_sim::{
    Emission, HubFault, Motion, Options, Output, Port, TruthState, VirtualVehicle, WheelGround,
    port_loads, read_columns,
};
use model::sensors::Sensors;
use nalgebra::Vector3;
use sample::{STANDARD_GRAVITY_M_S2, Wheel};

use crate::support::{circle, vehicle};

/// Identifier of the frame of a wheel's accelerometer.
fn frame_of(wheel: Wheel) -> u32 {
    0x300 + 16 * [1, 3, 4, 5][wheel.index()]
}

fn run(motion: Motion, sensors: &Sensors, options: &Options) -> (VirtualVehicle, Vec<Emission>) {
    let make = |motion| {
        VirtualVehicle::new(motion, &vehicle(), sensors, options, 11).expect("a virtual vehicle")
    };
    (make(motion.clone()), make(motion).collect())
}

/// Readings of a wheel's accelerometer, m/s^2.
fn readings(sensors: &Sensors, emissions: &[Emission], wheel: Wheel) -> Vec<Vector3<f64>> {
    let scale = sensors
        .hub_acceleration
        .as_ref()
        .expect("hub accelerometers");
    let frames = emissions.iter().filter_map(|e| match &e.output {
        Output::Can(frame) if frame.id == frame_of(wheel) => Some(frame),
        _ => None,
    });
    frames
        .map(|frame| {
            assert_eq!(frame.len, 6);
            Vector3::from_fn(|i, _| {
                let count = u16::from_le_bytes([frame.data[2 * i], frame.data[2 * i + 1]]);
                let force = scale.specific_force_m_s2(i32::from(count));
                force.expect("a count within the range")
            })
        })
        .collect()
}

fn hub_sensors() -> Sensors {
    Sensors::builtin("thesis-10bit-hub").expect("a built-in set")
}

/// The same without errors and with a filter that follows at once.
fn perfect() -> Sensors {
    let mut sensors = hub_sensors();
    let hub = sensors
        .hub_acceleration
        .as_mut()
        .expect("hub accelerometers");
    (hub.noise_m_s2, hub.bias_m_s2, hub.misalignment_rad) = (0.0, 0.0, 0.0);
    hub.lag_hz = 1e6;
    sensors
}

#[test]
fn noise_bias_and_turn_are_those_of_the_sensors_file() {
    let sensors = hub_sensors();
    let hub = sensors.hub_acceleration.clone().unwrap();
    let (vehicle_run, emissions) = run(circle(0.0, 15.0, 40.0), &sensors, &Options::default());
    let truth = vehicle_run.hub_accelerometers().unwrap();
    let (_, exact) = run(circle(0.0, 15.0, 1.0), &perfect(), &Options::default());
    for wheel in Wheel::ALL {
        let (turn, bias) = truth[wheel];
        assert!(turn.iter().all(|a| a.abs() <= hub.misalignment_rad));
        assert!(bias.iter().all(|b| b.abs() <= hub.bias_m_s2));
        assert_ne!(turn, [0.0; 3]);
        let read = readings(&sensors, &emissions, wheel);
        assert_eq!(read.len(), 4001);
        let mean = read.iter().sum::<Vector3<f64>>() / read.len() as f64;
        let at_sensor = readings(&perfect(), &exact, wheel)[0];
        let turned = nalgebra::Rotation3::from_euler_angles(turn[0], turn[1], turn[2]);
        let expected = turned * at_sensor + Vector3::from(bias);
        assert!(
            (mean - expected).norm() < 0.01,
            "{wheel}: {mean} {expected}"
        );
        let spread: f64 = read.iter().map(|r| (r.z - mean.z).powi(2)).sum();
        let sigma = (spread / read.len() as f64).sqrt();
        assert!((sigma / hub.noise_m_s2 - 1.0).abs() < 0.05, "{sigma}");
    }
}

/// On a turntable the sensor 30 mm inboard of the wheel centre feels less centripetal acceleration
/// than the wheel centre, by the square of the rate times the lever arm.
#[test]
fn lever_arm_of_a_steady_turn() {
    let motion = circle(8.0, 10.0, 1.0);
    let rate = motion.states()[0].rate_rad_s[2];
    let mut moved = perfect();
    moved.hub_acceleration.as_mut().unwrap().position_m = [0.0; 3];
    let [with, without] = [perfect(), moved].map(|sensors| {
        let (_, emissions) = run(motion.clone(), &sensors, &Options::default());
        Wheel::ALL.map(|wheel| readings(&sensors, &emissions, wheel)[50])
    });
    for wheel in Wheel::ALL {
        // Towards the middle plane on both sides.
        let arm_m = -0.03 * wheel.side();
        let felt = with[wheel.index()] - without[wheel.index()];
        let expected = -rate * rate * arm_m;
        assert!(
            (felt.y - expected).abs() < 0.012,
            "{wheel}: {felt} {expected}"
        );
        assert!(felt.x.abs() < 0.012 && felt.z.abs() < 0.012, "{felt}");
    }
}

/// A wheel that is steered to and fro turns its upright: the sensor inboard of the wheel centre feels
/// the angular acceleration times the lever arm.
#[test]
fn lever_arm_of_a_steered_upright() {
    let frequency = 4.0 * std::f64::consts::TAU;
    let states = (0..=400)
        .map(|k| {
            let mut state = circle(0.0, 15.0, 0.01).states()[0];
            state.time_s = f64::from(k) / 200.0;
            state.steering_wheel_rad = 2.0 * math::sin(frequency * state.time_s);
            state.roll_rad = 0.0;
            state.pitch_rad = 0.0;
            state.specific_force_m_s2 = [0.0, 0.0, STANDARD_GRAVITY_M_S2];
            state
        })
        .collect();
    let motion = Motion::new("steered", states).unwrap();
    let sensors = perfect();
    let (vehicle_run, emissions) = run(motion, &sensors, &Options::default());
    let read = readings(&sensors, &emissions, Wheel::FrontLeft);
    let steer = |k: usize| vehicle_run.motion().states()[k].wheels[Wheel::FrontLeft].steer_rad;
    let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
    for (k, felt) in read.iter().enumerate().take(190).skip(10) {
        let row = 2 * k;
        let bend = (steer(row + 1) - 2.0 * steer(row) + steer(row - 1)) * 200.0_f64.powi(2);
        // At (0, -0.03): x' = 0.03 times the yaw acceleration.
        worst = worst.max((felt.x - 0.03 * bend).abs());
        largest = largest.max(bend.abs() * 0.03);
    }
    assert!(largest > 3.0, "{largest}");
    assert!(worst < 0.1 * largest, "{worst} of {largest}");
}

#[test]
fn a_sensor_mounted_on_its_side_reads_gravity_on_another_axis() {
    let mut options = Options::default();
    options.faults.hub = vec![HubFault {
        wheel: Wheel::RearLeft,
        turned_rad: [std::f64::consts::FRAC_PI_2, 0.0, 0.0],
    }];
    let sensors = perfect();
    let (_, emissions) = run(circle(0.0, 15.0, 0.1), &sensors, &options);
    let along = |wheel| readings(&sensors, &emissions, wheel)[0];
    assert!(along(Wheel::RearRight).z > 9.5);
    let turned = along(Wheel::RearLeft);
    assert!(turned.y.abs() > 9.5 && turned.z.abs() < 1.0, "{turned}");
}

/// Hub accelerometers draw from generators of their own, and their frames come last.
/// A dead axis sits at zero, a frozen one keeps its count; the other axes and wheels are as without the
/// faults, which have the names of the estimator's events.
#[test]
fn axes_die_and_freeze() {
    let text = "[[hub_axis]]\nwheel = \"front_left\"\naxis = \"x\"\nkind = \"dead\"\nfrom_s = 2.0\n\
                to_s = 4.0\n[[hub_axis]]\nwheel = \"rear_right\"\naxis = \"z\"\nkind = \"frozen\"\n\
                from_s = 3.0\n[[hub]]\nwheel = \"rear_left\"\nturned_rad = [0.0, 0.0, 0.0]\n";
    let options = Options {
        faults: toml::from_str(text).expect("faults"),
        ..Options::default()
    };
    let names: Vec<_> = options.faults.sensors().into_iter().collect();
    assert_eq!(
        names,
        [
            ("RL hub acceleration".to_owned(), 0.0..f64::INFINITY),
            ("FL hub acceleration x".to_owned(), 2.0..4.0),
            ("RR hub acceleration z".to_owned(), 3.0..f64::INFINITY),
        ]
    );
    let sensors = hub_sensors();
    let frames = |options: &Options| {
        let (_, emissions) = run(circle(0.0, 15.0, 6.0), &sensors, options);
        Wheel::ALL.map(|wheel| crate::support::frames_of(&emissions, frame_of(wheel)))
    };
    let (good, bad) = (frames(&Options::default()), frames(&options));
    for wheel in Wheel::ALL {
        let i = wheel.index();
        assert_eq!(good[i].len(), 601);
        for (k, (good_now, now)) in good[i].iter().zip(&bad[i]).enumerate() {
            let mut expected = *good_now;
            if wheel == Wheel::FrontLeft && (200..400).contains(&k) {
                expected[0] = 0;
            }
            if wheel == Wheel::RearRight && k >= 300 {
                expected[2] = good[i][299][2];
            }
            assert_eq!(now[..3], expected[..3], "{wheel} {k}");
        }
    }
}

#[test]
fn frames_of_a_set_are_the_same_with_hub_accelerometers() {
    for name in ["thesis-10bit", "full-bridge-16bit-bending"] {
        let of = |name: &str| {
            let sensors = Sensors::builtin(name).unwrap();
            run(circle(6.0, 15.0, 3.0), &sensors, &Options::default()).1
        };
        let is_hub = |e: &Emission| matches!(&e.output, Output::Can(f) if f.id >= 0x300);
        let mut with = of(&format!("{name}-hub"));
        assert_eq!(with.iter().filter(|e| is_hub(e)).count(), 4 * 301);
        with.retain(|e| !is_hub(e));
        assert_eq!(with, of(name));
    }
}

#[test]
fn every_channel_has_its_own_rate() {
    let mut sensors = Sensors::builtin("full-bridge-16bit-bending-hub").unwrap();
    let options = Options {
        can_bit_rate: Some(5_000_000),
        imu_baud: 921_600,
        novatel_baud: 4_000_000,
        septentrio_baud: 4_000_000,
        ..Options::default()
    };
    let rates = [[500.0, 1000.0], [1000.0, 50.0], [10.0, 25.0]];
    for [strain_hz, deflection_hz] in rates {
        sensors.strain.rate_hz = strain_hz;
        sensors.deflection.rate_hz = deflection_hz;
        sensors.steer.as_mut().unwrap().rate_hz = 40.0;
        sensors.wheel_speed.rate_hz = 1000.0;
        sensors.imu.rate_hz = 1000.0;
        sensors.gnss_velocity.rate_hz = 1000.0;
        sensors.gnss_attitude.rate_hz = 500.0;
        sensors.hub_acceleration.as_mut().unwrap().rate_hz = 800.0;
        let (_, emissions) = run(circle(6.0, 15.0, 2.0), &sensors, &options);
        let fields = |id: u32, field: usize| {
            let frames = emissions.iter().filter_map(|e| match &e.output {
                Output::Can(frame) if frame.id == id => Some(&frame.data),
                _ => None,
            });
            let present =
                |data: &&sample::FrameData| data[2 * field..2 * field + 2] != [0xff, 0xff];
            frames.filter(present).count() as f64
        };
        for (id, field, rate_hz) in [
            (0x110, 0, strain_hz),
            (0x111, 0, strain_hz),
            (0x111, 1, deflection_hz),
            (0x111, 2, strain_hz),
            (0x200, 0, 40.0),
            (0x210, 0, 1000.0),
            (0x310, 2, 800.0),
        ] {
            let found = fields(id, field);
            assert_eq!(
                found,
                2.0 * rate_hz + 1.0,
                "{id:#x}.{field} at {rate_hz} Hz"
            );
        }
        let count = |port| emissions.iter().filter(|e| e.port == port).count();
        assert!(count(Port::Imu).abs_diff(2000) <= 1, "{}", count(Port::Imu));
        // Position and velocity, and the time on whole seconds.
        assert_eq!(count(Port::Novatel), 2 * 2000 + 2);
        assert_eq!(count(Port::Septentrio), 4 * 1000);
    }
}

/// The arithmetic that refuses an overloaded port counts what the port sends.
#[test]
fn loads_are_those_of_the_bytes_that_are_sent() {
    let seconds = 20.0;
    for name in ["thesis-10bit", "full-bridge-16bit-bending-500hz-hub"] {
        let sensors = Sensors::builtin(name).unwrap();
        let options = Options::default();
        let (_, emissions) = run(circle(6.0, 15.0, seconds), &sensors, &options);
        let mut bits = BTreeMap::<Port, f64>::new();
        for emission in &emissions {
            *bits.entry(emission.port).or_default() += match &emission.output {
                Output::Bytes(bytes) => 10.0 * bytes.len() as f64,
                Output::Can(frame) => (47.0 + 8.0 * f64::from(frame.len)) * 1.1,
            };
        }
        for load in port_loads(&sensors, &options) {
            let found = bits[&load.port] / seconds;
            // The velocity receiver's time, once a second, and shorter lines of the controllers.
            let told = load.bits_per_s();
            assert!((0.4..1.03).contains(&(found / told)), "{load}: {found}");
            if !matches!(load.port, Port::Steering | Port::Throttle | Port::Brake) {
                assert!((found / told - 1.0).abs() < 0.03, "{load}: {found}");
            }
        }
    }
}

/// The columns of a truth run with the wheel centres' accelerations.
fn rough_motion() -> Option<Motion> {
    let path = testkit::shared("data/truth-rough/r1_iso_c_a.parquet")?;
    let motion = Motion::open(&path).expect("a truth file");
    let columns = read_columns(&path, |name| {
        Ok((name.contains("wcw_a_")).then(|| name.to_owned()))
    })
    .expect("columns");
    let mut states = motion.states().to_vec();
    for (row, state) in states.iter_mut().enumerate() {
        let body_from_earth = state.earth_from_body().inverse();
        for wheel in Wheel::ALL {
            let of =
                |axis: &str| columns[&format!("{}_wcw_a_{axis}[m/s2]", wheel.abbreviation())][row];
            let earth = Vector3::new(of("x"), of("y"), of("z"));
            let (sine, cosine) = math::sin_cos(state.wheels[wheel].steer_rad);
            state.wheels[wheel].ground = Some(WheelGround {
                normal_body: [0.0, 0.0, 1.0],
                force_body_n: [0.0; 3],
                moment_body_n_m: None,
                spindle_body: [-sine, cosine, 0.0],
                centre_acceleration_m_s2: Some((body_from_earth * earth).into()),
                unsprung_inertia_n: None,
                ground_height_m: None,
            });
        }
    }
    Some(Motion::new("r1", states).expect("a motion"))
}

/// On a rough road the sensor reads what the independent simulator's wheel centre does.
#[test]
fn readings_follow_the_wheel_centre_of_a_truth_run() {
    let Some(motion) = rough_motion() else {
        return;
    };
    let states: Vec<TruthState> = motion.states().to_vec();
    let sensors = perfect();
    let (_, emissions) = run(motion, &sensors, &Options::default());
    for wheel in Wheel::ALL {
        let read = readings(&sensors, &emissions, wheel);
        let (mut error, mut size) = (0.0, 0.0);
        for (k, felt) in read.iter().enumerate().skip(100) {
            let Some(state) = states.get(2 * k) else {
                break;
            };
            let told = state.wheels[wheel].ground.unwrap().centre_acceleration_m_s2;
            let up = state.up_body() * STANDARD_GRAVITY_M_S2;
            let body = Vector3::from(told.unwrap()) + up;
            error += (felt.norm() - body.norm()).powi(2);
            size += Vector3::from(told.unwrap()).norm_squared();
        }
        let part = (error / size).sqrt();
        // What is left is the lever arm of 30 mm and the converter.
        assert!(size > 0.0 && part < 0.1, "{wheel}: {part}");
    }
}
