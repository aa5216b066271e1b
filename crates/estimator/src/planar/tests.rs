use super::*;

fn vehicle() -> Vehicle {
    Vehicle::builtin("prowler").expect("a vehicle")
}

fn model() -> PlanarModel {
    let vehicle = vehicle();
    PlanarModel::new(&vehicle, Handling::of_vehicle(&vehicle), 0.3)
}

fn input(time_s: f64, speed_m_s: f64, steer_rad: f64) -> PlanarInput {
    PlanarInput {
        time_s,
        speed_m_s,
        acceleration_m_s2: 0.0,
        steer_rad,
        yaw_rate_rad_s: None,
        lateral_m_s2: None,
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
    let mut filter = PlanarFilter::new(model, NOISE, true);
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
fn jacobians_are_those_of_the_model() {
    let model = model();
    let driven = Driven {
        speed_m_s: 12.0,
        steer_rad: 0.08,
        loads_n: model.loads_n(2.0),
    };
    let mut state = SVector::<f64, STATES>::zeros();
    (state[LATERAL], state[YAW_RATE], state[STEER]) = (-0.6, 0.5, 0.004);
    let found = model.motion(&model.forces(&state, &driven), driven.speed_m_s);
    for j in [LATERAL, YAW_RATE, STEER] {
        let at = |side: f64| {
            let mut moved = state;
            moved[j] += side * 1e-6;
            model.motion(&model.forces(&moved, &driven), driven.speed_m_s)
        };
        let (low, high) = (at(-1.0), at(1.0));
        for row in 0..2 {
            let slope = (high[row].0 - low[row].0) / 2e-6;
            let scale = slope.abs().max(1.0);
            assert!(
                (found[row].1[j] - slope).abs() < 0.02 * scale,
                "{row} {j} {} {slope}",
                found[row].1[j]
            );
        }
    }
}

#[test]
fn offsets_and_sideslip_are_found_from_yaw_rate_and_acceleration() {
    let model = model();
    let mut truth = PlanarFilter::new(model, NOISE, true);
    let mut filter = PlanarFilter::new(model, NOISE, false);
    let (steer_error, rate_error, accel_error) = (0.004, 0.006, 0.15);
    let mut worst: f64 = 0.0;
    for step in 0..6000 {
        let time_s = f64::from(step) * 0.01;
        let speed = 14.0 + 4.0 * (0.21 * time_s).sin();
        let steer = 0.05 * (1.7 * time_s).sin() * (0.13 * time_s).cos();
        let real = truth.step(0.01, &input(time_s, speed, steer));
        let turn = model.motion(
            &model.forces(&truth.state, &truth.driven(&input(time_s, speed, steer))),
            speed,
        )[1]
        .0;
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
    let mut filter = PlanarFilter::new(model(), NOISE, false);
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
