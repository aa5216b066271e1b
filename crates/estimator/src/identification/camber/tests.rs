use math::Random;

use super::*;

const OPTIONS: Options = Options {
    dt_s: 0.01,
    reference_load_n: 1300.0,
    load_exponent: 0.75,
    friction: 0.87,
    file_stiffness_n_rad: 0.0,
    vertical_m_s2: 0.1,
    seed: 1,
};
const CAMBER_N_RAD: f64 = 1200.0;
const CORNERING_N_RAD: f64 = 3000.0;

/// Turns whose inclination is that of roll, of steering with caster, and of bumps. The force is that of a Fiala tyre,
/// whose curve is computed here by itself, with the camber thrust.
fn drive(offset_rad: f64, bumps_rad: f64, seed: u64) -> Data {
    let mut random = Random::new(seed);
    let mut data = Data::default();
    let mut wander = 0.0;
    for row in 0..6000 {
        let t = 0.01 * f64::from(row);
        let load_n = 1300.0 + 200.0 * math::sin(0.9 * t);
        let slip = 0.07 * math::sin(0.9 * t) * math::sin(0.13 * t);
        let bump = bumps_rad * math::sin(1.7 * t);
        let grip_n = OPTIONS.friction * load_n;
        let at_load = CORNERING_N_RAD * math::powf(load_n / 1300.0, 0.75);
        let z = (at_load * slip / (3.0 * grip_n)).clamp(-1.0, 1.0);
        let of_slip_n = -grip_n * (3.0 * z - 3.0 * z * z.abs() + z.powi(3));
        let inclination_rad = 4e-5 * of_slip_n + bump;
        wander += -0.02 * wander + 0.2 * 0.0015 * random.normal();
        let measured = slip + offset_rad + wander;
        data.slip_tangent.push(measured);
        // 30 ms later, and as the wheel centre moves.
        let slower = 0.07 * math::sin(0.9 * (t - 0.03)) * math::sin(0.13 * (t - 0.03));
        let [longer, centre] = &mut data.moved_slip_tangent;
        longer.push(measured + slower - slip);
        centre.push(measured - 0.04 * 1.7 * bumps_rad * math::cos(1.7 * t));
        data.inclination_rad
            .push(inclination_rad + 3e-4 * random.normal());
        data.lateral_n
            .push(of_slip_n - CAMBER_N_RAD * inclination_rad + 5.0 * random.normal());
        data.longitudinal_n.push(10.0 * random.normal());
        data.load_n.push(load_n);
    }
    data
}

#[test]
fn drives_give_the_camber_stiffness_and_its_interval() {
    let (mut inside, mut sum) = (0, 0.0);
    for seed in 1..=20 {
        let wheels = [drive(0.003, 0.03, seed), drive(-0.002, 0.03, 100 + seed)];
        let found = identify(&wheels, &OPTIONS).expect("turns and bumps");
        let [camber, sigma] = found.value("camber_stiffness");
        sum += camber;
        assert!(
            (camber / CAMBER_N_RAD - 1.0).abs() < 0.1,
            "{camber} {sigma}"
        );
        let [cornering, _] = found.value("cornering_stiffness");
        assert!(
            (cornering / CORNERING_N_RAD - 1.0).abs() < 0.05,
            "{cornering}"
        );
        let [left, _] = found.value("slip_angle_offset_left");
        assert!((left - 0.003).abs() < 0.002, "{left}");
        let interval = found.get("camber_stiffness").and_then(|f| f.interval);
        inside += u32::from(
            interval.is_some_and(|[low, high]| low < CAMBER_N_RAD && CAMBER_N_RAD < high),
        );
    }
    assert!(
        (sum / 20.0 / CAMBER_N_RAD - 1.0).abs() < 0.03,
        "{}",
        sum / 20.0
    );
    assert!(inside >= 17, "{inside} of 20 intervals contain the truth");
}

#[test]
fn turns_alone_do_not_separate_camber_from_slip() {
    let wheels = [drive(0.0, 0.0, 1), drive(0.0, 0.0, 2)];
    let text = identify(&wheels, &OPTIONS)
        .expect_err("refused")
        .to_string();
    assert!(
        text.contains("the inclination that does not follow the lateral force")
            && text.contains("side slope"),
        "{text}"
    );
    let rough = Options {
        vertical_m_s2: 0.9,
        ..OPTIONS
    };
    let text = identify(&wheels, &rough).expect_err("refused").to_string();
    assert!(
        text.contains("vertical acceleration = 0.9") && text.contains("even ground"),
        "{text}"
    );
    let mut short = drive(0.0, 0.03, 1);
    short.inclination_rad.pop();
    let text = identify(&[short.clone(), short], &OPTIONS)
        .expect_err("refused")
        .to_string();
    assert!(text.contains("inclination has 5999 values"), "{text}");
}
