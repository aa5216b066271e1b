use math::Random;

use super::*;

const OPTIONS: Options = Options {
    dt_s: 0.01,
    reference_load_n: 1300.0,
    friction: 0.87,
    cornering_n_rad: 3000.0,
    file_trail_m: 0.03,
    seed: 1,
};

/// A sine of a wheel with the trail of a brush tyre (Fiala's moment), which is no straight line in the used part of the
/// grip.
fn drive(trail_m: f64, noise_n_m: f64, offset_n_m: f64, seed: u64) -> Data {
    let mut random = Random::new(seed);
    let mut data = Data::default();
    let mut wander = 0.0;
    for row in 0..3000 {
        let t = 0.01 * f64::from(row);
        let load_n = 1300.0 + 250.0 * math::sin(1.9 * t);
        let lateral_n = 480.0 * math::sin(1.9 * t) * (0.7 + 0.3 * math::sin(0.2 * t));
        let used = lateral_n.abs() / (0.87 * load_n);
        let sticking = math::powf(1.0 - used, 1.0 / 3.0);
        let part = 1.0 - sticking;
        let loss = 3.0 * sticking.powi(3) / (part * part - 3.0 * part + 3.0);
        let trail = trail_m * (load_n / 1300.0).sqrt() * loss;
        // Correlated over half a second, as the estimated moments.
        wander += -0.02 * wander + 0.2 * noise_n_m * random.normal();
        data.aligning_n_m
            .push(-trail * lateral_n + offset_n_m + wander);
        data.longitudinal_n.push(20.0 * random.normal());
        data.lateral_n.push(lateral_n + 5.0 * random.normal());
        data.load_n.push(load_n);
    }
    data
}

#[test]
fn a_sine_gives_the_trail_and_the_offsets() {
    let mut inside = 0;
    for seed in 1..=20 {
        let wheels = [
            drive(0.03, 1.0, 2.0, seed),
            drive(0.03, 1.0, -1.5, 100 + seed),
        ];
        let found = identify(&wheels, &OPTIONS).expect("a sine");
        let [trail_m, sigma_m] = found.value("pneumatic_trail");
        assert!((trail_m / 0.03 - 1.0).abs() < 0.1, "{trail_m} {sigma_m}");
        let [left, _] = found.value("aligning_offset_left");
        let [right, _] = found.value("aligning_offset_right");
        assert!(
            (left - 2.0).abs() < 0.8 && (right + 1.5).abs() < 0.8,
            "{left} {right}"
        );
        let interval = found.get("pneumatic_trail").and_then(|f| f.interval);
        inside += u32::from(interval.is_some_and(|[low, high]| low < 0.03 && 0.03 < high));
    }
    assert!(inside >= 17, "{inside} of 20 intervals contain the truth");
}

#[test]
fn a_drive_without_turns_or_without_moments_tells_nothing() {
    let said = |data: &Data| {
        identify(&[data.clone(), data.clone()], &OPTIONS)
            .expect_err("refused")
            .to_string()
    };
    let mut straight = drive(0.03, 1.0, 0.0, 1);
    straight
        .lateral_n
        .iter_mut()
        .for_each(|force| *force *= 0.05);
    assert!(
        said(&straight).contains("the standard deviation of the lateral force"),
        "{}",
        said(&straight)
    );
    let mut unknown = drive(0.03, 1.0, 0.0, 1);
    unknown.aligning_n_m.fill(f64::NAN);
    assert!(
        said(&unknown).contains("no moment of a tyre"),
        "{}",
        said(&unknown)
    );
    let mut short = drive(0.03, 1.0, 0.0, 1);
    short.load_n.pop();
    assert!(
        said(&short).contains("load has 2999 values"),
        "{}",
        said(&short)
    );
}
