//! Benches whose counts are computed here by themselves: gauges on a tube of 4130 steel of 25.4 mm by 1.65 mm
//! (E A = 23.4 MN, E W = 130 N m per 1000 um/m), an amplifier with a gain of 805, 10 or 16 bits.

use model::sensors::Sensors;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::*;

/// A bench with known errors.
#[derive(Clone, Copy)]
struct Truth {
    gain_n: f64,
    gain_n_m: f64,
    zero: [f64; 2],
    /// Tension that 1 N m seems to be, N; moment that 1 N seems to be, N m.
    cross: [f64; 2],
    hysteresis_counts: f64,
    zero_per_k: f64,
    gain_per_k: f64,
    noise_counts: f64,
    /// Relative error of all loads.
    load_error: f64,
}

const TRUTH: Truth = Truth {
    gain_n: 27.6,
    gain_n_m: 0.53,
    zero: [509.3, 514.8],
    cross: [4.0, 0.0005],
    hysteresis_counts: -1.2,
    zero_per_k: 0.8,
    gain_per_k: -3e-4,
    noise_counts: 0.15,
    load_error: 0.0,
};

const BENCH: Bench = Bench {
    wheel: Wheel::FrontLeft,
    member: StrainChannel::LowerFront,
    load_sigma: 0.002,
};

fn normal(random: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(random)
}

/// Tension and moment put on and taken off in steps, at two temperatures.
fn rows(truth: &Truth, seed: u64) -> Vec<BenchLoad> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let error = truth.load_error * normal(&mut random);
    let steps = [0.0, 1.0, 2.0, 3.0, 4.0, 3.0, 2.0, 1.0, 0.0];
    let mut rows = Vec::new();
    let (mut lag_n, mut lag_n_m) = (0.0, 0.0);
    let mut last = [0.0; 2];
    for temperature_c in [8.0, 31.0] {
        let tension = steps.map(|step| [1000.0 * step, 0.0]);
        let moment = steps.map(|step| [0.0, 12.0 * step]);
        for load in tension.into_iter().chain(moment) {
            let sign = |change: f64, lag: f64| if change == 0.0 { lag } else { change.signum() };
            lag_n = sign(load[0] - last[0], lag_n);
            lag_n_m = sign(load[1] - last[1], lag_n_m);
            last = load;
            let [axial, bending] = load.map(|load| load * (1.0 + error));
            let warm_k = temperature_c - 19.5;
            let mut counts = |own: f64, gain: f64, zero: f64, lag: f64| {
                let counts = zero
                    + own / gain * (1.0 + truth.gain_per_k * warm_k)
                    + 0.5 * lag * truth.hysteresis_counts
                    + truth.zero_per_k * warm_k;
                counts + truth.noise_counts * normal(&mut random)
            };
            // The cross part has the drift of the gain, too: 0.7 % of a small part.
            let axial_counts = counts(
                axial + truth.cross[0] * bending,
                truth.gain_n,
                truth.zero[0],
                lag_n,
            );
            let bending_counts = counts(
                bending + truth.cross[1] * axial,
                truth.gain_n_m,
                truth.zero[1],
                lag_n_m,
            );
            rows.push(BenchLoad {
                load_n: load[0],
                moment_n_m: load[1],
                axial_counts: Some(axial_counts),
                bending_counts: Some(bending_counts),
                temperature_c: Some(temperature_c),
            });
        }
    }
    rows
}

fn vehicle() -> Vehicle {
    Vehicle::builtin("prowler").expect("built in")
}

/// The chain of the thesis with a bending bridge, 0.54 N m/count.
fn sensors() -> Sensors {
    let mut sensors = Sensors::builtin("thesis-10bit").expect("built in");
    let text =
        "bridge = \"full_bending\"\ngain_resistor_ohm = 680.0\ndistance_from_ball_joint_m = 0.1";
    sensors.strain.bending = Some(toml::from_str(text).expect("a bridge"));
    sensors
}

fn run(rows: &[BenchLoad], bench: &Bench) -> Result<MemberBench, EstimatorError> {
    let vehicle = vehicle();
    let known = Calibration::nominal(&vehicle.name);
    member(&vehicle, &sensors(), &known, rows, bench)
}

/// Name, truth, and the largest error that is allowed.
fn values(truth: &Truth) -> [(&'static str, f64, f64); 12] {
    [
        ("lower_front_gain", truth.gain_n, 0.1),
        ("lower_front_zero", truth.zero[0], 0.2),
        ("lower_front_cross_sensitivity", truth.cross[0], 0.3),
        ("lower_front_hysteresis", truth.hysteresis_counts, 0.2),
        ("lower_front_zero_drift", truth.zero_per_k, 0.01),
        ("lower_front_gain_drift", truth.gain_per_k, 2e-4),
        ("lower_front_bending_gain", truth.gain_n_m, 2e-3),
        ("lower_front_bending_zero", truth.zero[1], 0.2),
        (
            "lower_front_bending_cross_sensitivity",
            truth.cross[1],
            5e-5,
        ),
        (
            "lower_front_bending_hysteresis",
            truth.hysteresis_counts,
            0.2,
        ),
        ("lower_front_bending_zero_drift", truth.zero_per_k, 0.01),
        ("lower_front_bending_gain_drift", truth.gain_per_k, 3e-4),
    ]
}

#[test]
fn a_bench_gives_gain_cross_sensitivity_hysteresis_and_drift() {
    let found = run(&rows(&TRUTH, 11), &BENCH).expect("a bench");
    for (name, truth, within) in values(&TRUTH) {
        let [value, sigma] = found.findings.value(name);
        assert!(
            (value - truth).abs() < within,
            "{name}: {value} for {truth}"
        );
        assert!(sigma > 0.0 && sigma < within, "{name}: {sigma}");
    }
    let corner = &found.calibration.corner[&Wheel::FrontLeft];
    let axial = corner.strain[&StrainChannel::LowerFront];
    assert!((axial.gain_per_count.expect("a gain") - TRUTH.gain_n).abs() < 0.1);
    assert!((axial.offset_counts.expect("a zero") - TRUTH.zero[0]).abs() < 0.2);
    let drift = axial.temperature.expect("a drift");
    assert!(
        (drift.reference_c - 19.5).abs() < 1e-9 && !drift.is_none(),
        "{drift:?}"
    );
    assert!(
        corner
            .strain
            .contains_key(&StrainChannel::LowerFrontBending)
    );
    let again = Calibration::from_toml(&found.calibration.to_toml().expect("text"));
    assert_eq!(again.expect("a file"), found.calibration);
}

#[test]
fn a_note_names_a_bridge_that_is_wired_wrongly() {
    let notes = |truth: Truth| {
        let found = run(&rows(&truth, 11), &BENCH).expect("a bench");
        found.findings.notes.join("\n")
    };
    assert!(
        !notes(TRUTH).contains("wiring") && !notes(TRUTH).contains("inverted"),
        "{}",
        notes(TRUTH)
    );
    // A quarter bridge: half the sensitivity, and the whole strain of the outer fibre, A/W = 179.2 1/m.
    let quarter = notes(Truth {
        gain_n: 54.6,
        cross: [179.2, 0.0],
        ..TRUTH
    });
    assert!(
        quarter.contains("the gain is 2.0") && quarter.contains("100 % of the bending strain"),
        "{quarter}"
    );
    let inverted = notes(Truth {
        gain_n: -27.0,
        ..TRUTH
    });
    assert!(
        inverted.contains("lower_front: the counts fall as the load rises"),
        "{inverted}"
    );
}

#[test]
fn rounded_counts_have_the_deviation_of_rounding() {
    let mut rows = rows(
        &Truth {
            noise_counts: 0.0,
            hysteresis_counts: 0.0,
            ..TRUTH
        },
        11,
    );
    for row in &mut rows {
        row.axial_counts = Some((row.load_n / 27.0 + 500.0).round());
        row.load_n = (row.axial_counts.expect("set") - 500.0) * 27.0;
    }
    let found = run(&rows, &BENCH).expect("a bench");
    let [_, sigma] = found.findings.value("lower_front_zero");
    assert!((0.05..0.3).contains(&sigma), "{sigma}");
}

#[test]
fn a_bench_that_tells_nothing_is_refused_with_what_to_do() {
    let said = |rows: &[BenchLoad]| run(rows, &BENCH).expect_err("refused").to_string();
    let all = rows(&TRUTH, 11);
    let one: Vec<BenchLoad> = all
        .iter()
        .filter(|row| row.load_n == 2000.0)
        .copied()
        .collect();
    let text = said(&one);
    assert!(
        text.contains("lower_front: number of different loads (load_n) is 1.0")
            && text.contains("put on at least three different loads"),
        "{text}"
    );
    assert!(said(&[]).contains("no column of counts"));
    let still: Vec<BenchLoad> = all
        .iter()
        .map(|row| BenchLoad {
            axial_counts: Some(512.0 + 1e-3 * row.load_n),
            bending_counts: None,
            ..*row
        })
        .collect();
    assert!(
        said(&still).contains("change of the counts over the range of load_n is 4.0"),
        "{}",
        said(&still)
    );
    let together: Vec<BenchLoad> = all
        .iter()
        .map(|row| BenchLoad {
            moment_n_m: 0.01 * row.load_n,
            ..*row
        })
        .collect();
    assert!(
        said(&together).contains("change together"),
        "{}",
        said(&together)
    );
    let mut ended = all.clone();
    ended[4].axial_counts = Some(1023.0);
    assert!(
        said(&ended).contains("axial_counts in row 5 = 1023"),
        "{}",
        said(&ended)
    );
    let mut hole = all.clone();
    hole[2].temperature_c = None;
    assert!(
        said(&hole).contains("no temperature_c in row 3"),
        "{}",
        said(&hole)
    );
    for (member, wanted) in [
        (StrainChannel::TieRod, "no bending bridge on tie_rod"),
        (
            StrainChannel::LowerRearBending,
            "name the member by its axial channel",
        ),
    ] {
        let text = run(&all, &Bench { member, ..BENCH })
            .expect_err("refused")
            .to_string();
        assert!(text.contains(wanted), "{text}");
    }
}

/// 95 % of 200: at least 182 with a probability of 0.995, by the binomial distribution.
#[test]
fn intervals_hold_the_truth() {
    let mut inside = [0; 12];
    let truth = Truth {
        load_error: 0.002,
        ..TRUTH
    };
    for seed in 0..200 {
        let found = run(&rows(&truth, 1000 + seed), &BENCH).expect("a bench");
        for (count, (name, value, _)) in inside.iter_mut().zip(values(&truth)) {
            let interval = found
                .findings
                .get(name)
                .and_then(|finding| finding.interval);
            let [low, high] = interval.expect("an interval");
            *count += u32::from(low <= value && value <= high);
        }
    }
    println!("{inside:?} of 200");
    assert!(
        inside.iter().all(|count| *count >= 182),
        "{inside:?} of 200"
    );
}
