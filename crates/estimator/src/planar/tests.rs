use model::vehicle::Vehicle;
use sample::{
    FixQuality, GnssVelocity, GroundSpeedSample, ImuSample, LogTime, Measurement, Sample, SourceId,
    SteerSample,
};

use super::*;
use crate::calibration::Resolved;

fn vehicle() -> Vehicle {
    Vehicle::builtin("prowler").expect("a vehicle")
}

fn model() -> PlanarModel {
    let vehicle = vehicle();
    PlanarModel::new(
        &vehicle,
        Handling::of_vehicle(&vehicle),
        0.3,
        &PlanarTuning::default(),
    )
}

fn input(time_s: f64, speed_m_s: f64, steer_rad: f64) -> PlanarInput {
    PlanarInput {
        time_s,
        speed_m_s,
        acceleration_m_s2: 0.0,
        steer_rad,
        yaw_rate_rad_s: None,
        lateral_m_s2: None,
        inertial: LastInertial::default(),
    }
}

const NOISE: PlanarNoise = PlanarNoise {
    yaw_rate_rad_s: 0.002,
    acceleration_m_s2: 0.1,
};

/// Yaw rate and lateral acceleration in the steady state of small angles: v d/(L + K v^2) with the
/// understeer gradient K = m/L (b/C_f - a/C_r) (Mitschke).
fn steady(model: &PlanarModel, v: f64, steer: f64) -> (f64, f64) {
    let h = &model.handling;
    let (a, b) = (model.front_m, model.rear_m);
    let length = a + b;
    let gradient =
        model.mass_kg / length * (b / h.front_stiffness_n_rad - a / h.rear_stiffness_n_rad);
    let rate = v * steer / (length + gradient * v * v);
    let load = model.mass_kg * a / length;
    (
        rate,
        b * rate - load * v * v * rate / h.rear_stiffness_n_rad,
    )
}

#[test]
fn without_measurements_it_settles_at_the_steady_state_of_the_single_track_model() {
    let model = model();
    let mut filter = PlanarFilter::new(
        model,
        NOISE,
        PlanarDoubt::identified(&PlanarTuning::default()),
        true,
    );
    let (v, steer) = (15.0, 0.002);
    let mut last = None;
    for step in 0..600 {
        last = Some(filter.step(0.01, &input(f64::from(step) * 0.01, v, steer)));
    }
    let last = last.expect("steps");
    let (rate, lateral) = steady(&model, v, steer);
    assert!(
        (last.yaw_rate_rad_s / rate - 1.0).abs() < 0.01,
        "{last:?} {rate}"
    );
    assert!((last.lateral_m_s - lateral).abs() < 0.01 * lateral.abs().max(0.01));
    assert!((last.acceleration_m_s2 - v * rate).abs() < 0.02 * v * rate);
}

#[test]
fn slopes_are_those_of_the_rates() {
    let model = model();
    let driven = Driven {
        speed_m_s: 12.0,
        steer_rad: 0.08,
        grip_n: model.grip_n(2.0),
    };
    let state = SVector::from([-0.6, 0.5, 0.004, 0.002, 0.1, 0.2, 0.03, 0.05]);
    let (_, slope) = model.rates(&state, &driven);
    for j in 0..STATES {
        let at = |side: f64| {
            let mut moved = state;
            moved[j] += side * 1e-6;
            model.rates(&moved, &driven).0
        };
        let difference = (at(1.0) - at(-1.0)) / 2e-6;
        for i in 0..STATES {
            // How the cosine of the steer angle changes with its offset is left out.
            let left_out = j == STEER && (i == LATERAL || i == YAW_RATE);
            let tolerance = 1e-4 * difference[i].abs().max(1.0);
            assert!(
                left_out || (slope[(i, j)] - difference[i]).abs() < tolerance,
                "{i} {j} {} {}",
                slope[(i, j)],
                difference[i]
            );
        }
    }
}

#[test]
fn braking_and_driving_leave_less_for_the_side_and_braking_loads_the_front() {
    let model = model();
    let [front, rear] = model.grip_n(0.0);
    let [braked_front, braked_rear] = model.grip_n(-6.0);
    let [driven_front, driven_rear] = model.grip_n(4.0);
    let h = model.handling;
    assert_eq!(h.drive_split_front, 0.0, "driven at the rear");
    assert!(braked_rear < 0.8 * rear && driven_front < front);
    let load = |still: f64, split: f64| {
        let moved = model.mass_kg * 6.0 * h.load_transfer_height_m / (model.front_m + model.rear_m);
        let whole = still + h.front_friction * moved;
        (whole * whole - (split * model.mass_kg * 6.0).powi(2)).sqrt()
    };
    assert!((braked_front / load(front, h.brake_split_front) - 1.0).abs() < 1e-9);
    let without_force = rear
        + h.rear_friction * model.mass_kg * 4.0 * h.load_transfer_height_m
            / (model.front_m + model.rear_m);
    assert!(driven_rear < without_force);
}

#[test]
fn offsets_and_sideslip_are_found_from_yaw_rate_and_acceleration() {
    let model = model();
    let mut truth = PlanarFilter::new(
        model,
        NOISE,
        PlanarDoubt::identified(&PlanarTuning::default()),
        true,
    );
    let mut filter = PlanarFilter::new(
        model,
        NOISE,
        PlanarDoubt::identified(&PlanarTuning::default()),
        false,
    );
    let (steer_error, rate_error, accel_error) = (0.004, 0.006, 0.15);
    let mut worst: f64 = 0.0;
    for step in 0..6000 {
        let time_s = f64::from(step) * 0.01;
        let speed = 14.0 + 4.0 * math::sin(0.21 * time_s);
        let steer = 0.05 * math::sin(1.7 * time_s) * math::cos(0.13 * time_s);
        let real = truth.step(0.01, &input(time_s, speed, steer));
        let driven = truth.model.driven(&input(time_s, speed, steer));
        let turn = model.pushed(&model.forces(&truth.state, &driven))[1].0;
        let seen = PlanarInput {
            yaw_rate_rad_s: Some(real.yaw_rate_rad_s + rate_error),
            lateral_m_s2: Some(
                model.handling.roll_gain * real.acceleration_m_s2 + 0.3 * turn + accel_error,
            ),
            ..input(time_s, speed, steer - steer_error)
        };
        let found = filter.step(0.01, &seen);
        if step > 3000 {
            worst = worst.max((found.lateral_m_s - real.lateral_m_s).abs() / speed);
        }
    }
    let [steer, rate, accel] = filter.offsets();
    // A gyro's offset shows while the vehicle stands; in a minute's drive it goes with the bank.
    assert!((steer - steer_error).abs() < 0.0025, "{steer}");
    assert!((rate - rate_error).abs() < 0.005, "{rate}");
    assert!((accel - accel_error).abs() < 0.1, "{accel}");
    assert!(worst.to_degrees() < 0.5, "{}", worst.to_degrees());
    assert_eq!(filter.resets(), 0);
}

#[test]
fn standing_still_shows_the_gyros_offset_and_rubbish_never_poisons_the_state() {
    let mut filter = PlanarFilter::new(
        model(),
        NOISE,
        PlanarDoubt::identified(&PlanarTuning::default()),
        false,
    );
    for step in 0..500 {
        let still = PlanarInput {
            yaw_rate_rad_s: Some(0.007),
            lateral_m_s2: Some(0.0),
            ..input(f64::from(step) * 0.01, 0.0, 0.1)
        };
        let found = filter.step(0.01, &still);
        assert!(found.lateral_m_s.abs() < 0.02);
    }
    assert!((filter.offsets()[1] - 0.007).abs() < 5e-4);
    for (step, wild) in [1e3_f64, -1e3, 50.0, -90.0, 0.0, 19.0]
        .into_iter()
        .cycle()
        .take(3000)
        .enumerate()
    {
        let bad = PlanarInput {
            acceleration_m_s2: wild.clamp(-15.0, 15.0),
            yaw_rate_rad_s: Some(wild / 60.0),
            lateral_m_s2: Some(wild),
            ..input(
                5.0 + step as f64 * 0.01,
                3.0 + wild.abs() % 40.0,
                wild / 1000.0,
            )
        };
        let found = filter.step(0.01, &bad);
        assert!(found.lateral_m_s.is_finite() && found.lateral_sigma_m_s > 0.0);
    }
}

#[test]
fn a_lost_motion_does_not_cost_the_offsets_unless_no_sensor_has_such() {
    for (gyro, kept) in [(0.007, 0.007), (0.3, 0.0)] {
        let mut filter = PlanarFilter::new(
            model(),
            NOISE,
            PlanarDoubt::identified(&PlanarTuning::default()),
            false,
        );
        filter.state[GYRO] = gyro;
        filter.state[LATERAL] = 100.0;
        let _ = filter.step(0.01, &input(0.0, 15.0, 0.0));
        assert_eq!(filter.resets(), 1);
        assert!((filter.offsets()[1] - kept).abs() < 1e-9);
        let sigma = filter.covariance[(GYRO, GYRO)].sqrt();
        assert!((sigma - PlanarTuning::default().offset_sigma[1]).abs() < 1e-9);
    }
}

/// What is known of these measurements of one instant.
fn taken<const N: usize>(measurements: [Measurement; N]) -> Option<PlanarInput> {
    let sensors = model::sensors::Sensors::builtin("thesis-10bit").expect("a sensors file");
    let calibration = crate::Calibration::nominal("car");
    let resolved = Resolved::new(&sensors, &calibration).expect("a calibration");
    // The sensors file's place of the inertial unit is another vehicle's.
    assert_eq!(resolved.plain_imu_ahead_m, 0.0);
    let now = LogTime(1_000_000_000);
    let mut readings =
        PlanarReadings::new(&vehicle(), PlanarTuning::default().input).expect("readings");
    for measurement in measurements {
        let sample = Sample {
            source: SourceId(0),
            log_time: now,
            valid_time: now,
            device_time: None,
            measurement,
        };
        readings.push(&sample, &resolved, &crate::Settings::default());
    }
    readings.sort();
    readings.take(now, now)
}

const STEERING_WHEEL: Measurement = Measurement::Steer(SteerSample {
    steering_wheel_rad: 0.1,
});

/// A receiver without a fix tells no speed, whatever it fills its fields with.
#[test]
fn a_receiver_without_a_fix_tells_no_speed() {
    for (quality, speed) in [
        (FixQuality::None, None),
        (FixQuality::DeadReckoning, None),
        (FixQuality::Single, Some(5.0)),
    ] {
        let velocity = GnssVelocity {
            quality,
            velocity_enu_m_s: [3.0, 4.0, 0.0],
            ..GnssVelocity::default()
        };
        let input = taken([Measurement::GnssVelocity(velocity), STEERING_WHEEL]);
        assert_eq!(input.map(|input| input.speed_m_s), speed, "{quality:?}");
    }
}

#[test]
fn a_reading_that_the_unit_calls_bad_tells_nothing() {
    for valid in [false, true] {
        let speed = GroundSpeedSample {
            forward_m_s: 5.0,
            leftward_m_s: None,
        };
        let imu = ImuSample {
            angular_rate_rad_s: [0.0, 0.0, 0.3],
            valid,
            ..ImuSample::default()
        };
        let input = taken([
            Measurement::GroundSpeed(speed),
            STEERING_WHEEL,
            Measurement::Imu(imu),
        ]);
        let input = input.expect("speed and steer");
        assert_eq!(input.yaw_rate_rad_s.is_some(), valid);
        assert_eq!(input.lateral_m_s2.is_some(), valid);
    }
}

/// Lateral velocities of a drive with turns at 15 m/s, m/s. The steering wheel arrives `late_s` after
/// its time, and its samples state `latency_s`.
fn lateral_velocities(late_s: f64, latency_s: f64) -> (Vec<f64>, Vec<(LogTime, PlanarTrace)>) {
    let sensors = model::sensors::Sensors::builtin("thesis-10bit").expect("a sensors file");
    let calibration = crate::Calibration::nominal("car");
    let resolved = Resolved::new(&sensors, &calibration).expect("a calibration");
    let tuning = crate::tuning::Tuning::default();
    let settings = crate::Settings::default();
    let mut planar = Planar::new(&vehicle(), &sensors, &resolved, &tuning).expect("a filter");
    planar.switch_trace_on();
    let begin = LogTime(1_000_000_000);
    let steer = |t: f64| 0.3 * math::sin(2.0 * t);
    let mut velocities = Vec::new();
    for step in 0..1000_u32 {
        let t = f64::from(step) * 0.01;
        let now = begin.offset_seconds(t);
        let rate = 0.02 * math::sin(2.0 * t - 0.1);
        let mut push = |measurement, latency_s: f64| {
            let sample = Sample {
                source: SourceId(0),
                log_time: now,
                valid_time: now.offset_seconds(-latency_s),
                device_time: None,
                measurement,
            };
            planar.push(&sample, &resolved, &settings);
        };
        push(
            Measurement::GroundSpeed(GroundSpeedSample {
                forward_m_s: 15.0,
                leftward_m_s: None,
            }),
            0.0,
        );
        push(
            Measurement::Imu(ImuSample {
                angular_rate_rad_s: [0.0, 0.0, rate],
                specific_force_m_s2: [0.0, 15.0 * rate, sample::STANDARD_GRAVITY_M_S2],
                valid: true,
                ..ImuSample::default()
            }),
            0.0,
        );
        let steering_wheel_rad = steer(t - late_s);
        push(
            Measurement::Steer(SteerSample { steering_wheel_rad }),
            latency_s,
        );
        let motion = planar.step(now, 0.01).expect("a motion");
        velocities.push(motion.state.lateral_m_s);
    }
    (velocities, planar.take_traces())
}

#[test]
fn a_latency_shifts_a_signal_back() {
    let (right, traces) = lateral_velocities(0.0, 0.0);
    let (shifted, _) = lateral_velocities(0.15, 0.0);
    let (corrected, completed) = lateral_velocities(0.15, 0.15);
    let error = |found: &[f64]| {
        let errors = right.iter().zip(found).skip(200);
        errors.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    let (wrong, left) = (error(&shifted), error(&corrected));
    assert!(wrong > 0.02, "{wrong}");
    assert!(left < 0.5 * wrong, "{left} of {wrong}");
    // The instants whose values have all arrived are those of a drive without latencies.
    assert!(completed.len() > 980, "{}", completed.len());
    for ((time, found), (other, expected)) in completed.iter().zip(&traces).skip(200) {
        assert_eq!(time, other);
        let apart = (found.state - expected.state).amax();
        assert!(apart < 1e-6, "{apart} at {time}");
    }
}

#[test]
fn a_vehicle_file_that_contradicts_the_drive_is_reported_once() {
    let tuning = PlanarTuning::default();
    let mut state = live::Contradiction::default();
    let mut changes = Vec::new();
    for (square, seconds) in [(1.0, 20), (38.0, 30), (1.0, 60)] {
        for _ in 0..seconds * 100 {
            state.push(square, 0.01, &tuning);
            changes.extend(state.take_change().map(|(found, _)| found));
        }
    }
    assert_eq!(changes, [true, false]);
}
