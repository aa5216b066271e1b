use super::*;

const DT_S: f64 = 0.01;

/// A minute of sines of the lateral force with rising amplitude, and what a wheel with compliance and play does.
fn wheel(compliance_rad_n: f64, play_rad: f64, seed: u64) -> Data {
    let mut noise = math::Random::new(seed);
    let mut data = Data::default();
    for row in 0..6_000 {
        let time_s = DT_S * f64::from(row);
        let force_n = (300.0 + 8.0 * time_s) * math::sin(1.5 * time_s);
        let in_play = (force_n / TOE_PLAY_FORCE_N).clamp(-1.0, 1.0);
        let difference = 0.004 - compliance_rad_n * force_n - 0.5 * play_rad * in_play;
        data.difference_rad.push(difference + 5e-4 * noise.normal());
        data.lateral_n.push(force_n + 20.0 * noise.normal());
        data.load_n.push(1500.0);
    }
    data
}

#[test]
fn compliance_and_play_are_found_within_their_intervals() {
    let mut inside = 0;
    for seed in 1..=4 {
        for (side, [c, p]) in [[1.5e-5, 0.01], [2.5e-5, 0.0]].into_iter().enumerate() {
            let found = identify(&wheel(c, p, seed), side, DT_S, seed).unwrap();
            let side = SIDES[side];
            let [value, sigma] = found.value(&format!("toe_compliance_{side}"));
            assert!((value / c - 1.0).abs() < 0.05, "{value} for {c}");
            inside += usize::from((value - c).abs() < 2.0 * sigma);
            let [value, sigma] = found.value(&format!("toe_play_{side}"));
            assert!((value - p).abs() < 5e-4, "{value} for {p}");
            inside += usize::from((value - p).abs() < 2.0 * sigma);
            let [value, _] = found.value(&format!("toe_offset_{side}"));
            assert!((value - 0.004).abs() < 1e-4, "{value}");
        }
    }
    assert!(
        inside >= 13,
        "{inside} of 16 within two standard deviations"
    );
}

#[test]
fn a_drive_without_lateral_force_or_to_one_side_is_refused() {
    let mut straight = wheel(1e-5, 0.0, 1);
    straight.lateral_n.fill(200.0);
    let error = identify(&straight, 0, DT_S, 1).unwrap_err().to_string();
    assert!(error.contains("lateral force"), "{error}");
    let mut one_sided = wheel(1e-5, 0.0, 1);
    for force in &mut one_sided.lateral_n {
        *force = force.abs();
    }
    let error = identify(&one_sided, 0, DT_S, 1).unwrap_err().to_string();
    assert!(error.contains("less used side"), "{error}");
}
