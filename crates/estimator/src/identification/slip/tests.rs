use math::Random;

use super::{Data, Findings, Options, Refusal};

const OPTIONS: Options = Options {
    dt_s: 0.01,
    reference_load_n: 1300.0,
    load_exponent: 0.75,
    friction: 0.87,
    radius_m: 0.3175,
    vertical_stiffness_n_m: 120_000.0,
    seed: 1,
};

/// Both axles with the same data.
fn identify(wheels: &[Data; 2], options: &Options) -> Result<Findings, Refusal> {
    let [found, _] = super::identify([wheels; 2], [options; 2]);
    found
}

/// A start and braking of a Fiala tyre, whose parabola is computed here by itself.
fn drive(stiffness_n: f64, noise: f64, offset: f64, seed: u64) -> Data {
    let mut random = Random::new(seed);
    let mut data = Data::default();
    for row in 0..1400 {
        let t = 0.01 * f64::from(row);
        let slip =
            if t < 7.0 { 0.06 } else { -0.09 } * math::sin(std::f64::consts::PI * t / 7.0).powi(2);
        let load_n = if t < 7.0 { 1200.0 } else { 1450.0 } + 100.0 * math::sin(3.0 * t);
        let grip_n = OPTIONS.friction * load_n;
        let at_load = stiffness_n * math::powf(load_n / 1300.0, 0.75);
        let z = (at_load * slip / (3.0 * grip_n)).clamp(-1.0, 1.0);
        let force_n = grip_n * (3.0 * z - 3.0 * z * z.abs() + z.powi(3));
        let by_load = 0.01 * (load_n / 1325.0 - 1.0);
        data.slip
            .push(slip + by_load + offset + noise * random.normal());
        data.longitudinal_n.push(force_n + 10.0 * random.normal());
        data.lateral_n.push(5.0 * random.normal());
        data.load_n.push(load_n);
    }
    data
}

#[test]
fn stiffness_and_radius_errors_of_a_start_and_braking() {
    let mut inside = 0;
    for seed in 1..=20 {
        let wheels = [
            drive(12_000.0, 0.006, 0.004, seed),
            drive(12_000.0, 0.006, -0.003, 100 + seed),
        ];
        let found = identify(&wheels, &OPTIONS).expect("a start and braking");
        let [stiffness, sigma] = found.value("slip_stiffness");
        assert!(
            (stiffness / 12_000.0 - 1.0).abs() < 0.03,
            "{stiffness} {sigma}"
        );
        let [left, _] = found.value("slip_offset_left");
        let [right, _] = found.value("slip_offset_right");
        assert!(
            (left - 0.004).abs() < 0.002 && (right + 0.003).abs() < 0.002,
            "{left} {right}"
        );
        let interval = found.get("slip_stiffness").and_then(|f| f.interval);
        inside += u32::from(interval.is_some_and(|[low, high]| low < 12_000.0 && 12_000.0 < high));
    }
    assert!(inside >= 18, "{inside} of 20 intervals contain the truth");
}

#[test]
fn a_drive_without_throttle_tells_nothing() {
    let mut still = drive(12_000.0, 0.006, 0.0, 1);
    still
        .longitudinal_n
        .iter_mut()
        .for_each(|force| *force *= 0.01);
    let error = identify(&[still.clone(), still], &OPTIONS).expect_err("no force");
    let text = error.to_string();
    assert!(
        text.contains("the standard deviation of the longitudinal force over the load is 0.0")
            && text.contains("then brake hard"),
        "{text}"
    );
    let short = Data {
        slip: vec![0.0; 9],
        ..Data::default()
    };
    assert!(matches!(
        identify(&[short.clone(), short], &OPTIONS),
        Err(Refusal::Length { .. })
    ));
}
