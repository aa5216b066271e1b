use atvrec_estimator::calibration::steer::{PlateReading, steer};
use atvrec_estimator::calibration::weight::{ScaleReading, weight};
use atvrec_estimator::{Calibration, Estimator, Settings};
use model::sensors::Sensors;
use model::suspension::{Corner, LinkedAxle};
use model::vehicle::Vehicle;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use sample::{PerWheel, Wheel};

const OFFSET_RAD: f64 = 0.12;
const LASH_RAD: f64 = 0.10;

/// Plates read to a tenth of a degree, on the way left and right, with play.
fn plates(seed: u64) -> Vec<PlateReading> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let steps = [
        0.0, 1.0, 2.0, 3.0, 2.0, 1.0, 0.0, -1.0, -2.0, -3.0, -2.0, -1.0, 0.0, 1.0,
    ];
    let mut held = 0.0_f64;
    steps
        .into_iter()
        .map(|hand: f64| {
            held = held.clamp(hand - 0.5 * LASH_RAD, hand + 0.5 * LASH_RAD);
            let mut read = |ratio: f64| {
                let noise: f64 = StandardNormal.sample(&mut random);
                held * ratio + (0.1 * noise).to_radians()
            };
            PlateReading {
                sensors_rad: [None; 2],
                steering_wheel_rad: hand + OFFSET_RAD,
                wheels_rad: [read(0.112), read(0.106)],
            }
        })
        .collect()
}

#[test]
fn centre_play_and_monotone_maps_come_out_of_turn_plates() {
    for seed in 0..20 {
        let found = steer(&plates(seed), 0.1_f64.to_radians()).expect("sound");
        let [centre, _] = found.findings.value("steering wheel straight ahead");
        let [lash, _] = found.findings.value("play at the steering wheel");
        assert!((centre - OFFSET_RAD).abs() < 0.02, "{seed}: {centre}");
        assert!((lash - LASH_RAD).abs() < 0.03, "{seed}: {lash}");
        for map in [
            &found.calibration.left_map_rad,
            &found.calibration.right_map_rad,
        ] {
            assert!(
                map.windows(2)
                    .all(|p| p[1][0] > p[0][0] && p[1][1] >= p[0][1])
            );
        }
    }
}

#[test]
fn the_middles_and_the_plays_intervals_hold() {
    let mut inside = [0; 2];
    for seed in 0..200 {
        let found = steer(&plates(seed), 0.1_f64.to_radians()).expect("sound");
        let truth = [
            ("steering wheel straight ahead", OFFSET_RAD),
            ("play at the steering wheel", LASH_RAD),
        ];
        for (count, (name, truth)) in inside.iter_mut().zip(truth) {
            let [value, sigma] = found.findings.value(name);
            *count += i32::from((value - truth).abs() < 1.96 * sigma);
        }
    }
    println!("of 200: middle {}, play {}", inside[0], inside[1]);
    assert!(
        inside.iter().all(|count| (180..=196).contains(count)),
        "{inside:?}"
    );
}

#[test]
fn plates_of_one_side_or_with_the_wrong_sign_are_refused() {
    let mut readings = plates(1);
    for reading in &mut readings {
        reading.wheels_rad = reading.wheels_rad.map(|angle| -angle);
    }
    let refusal = steer(&readings, 0.002).unwrap_err().to_string();
    assert!(refusal.contains("sign"), "{refusal}");
    let left: Vec<_> = plates(1)
        .into_iter()
        .filter(|reading| reading.wheels_rad[0] > -0.02)
        .collect();
    let refusal = steer(&left, 0.002).unwrap_err().to_string();
    assert!(refusal.contains("right"), "{refusal}");
}

fn scales(loads_kg: &[f64]) -> Vec<ScaleReading> {
    loads_kg
        .iter()
        .map(|load| ScaleReading {
            load_n: PerWheel([1327.0, 1327.0, 1831.0, 1831.0].map(|n| n + 9.81 * load / 4.0)),
            compression_m: PerWheel([0.0002 + 9.81 * load / 4.0 / 0.41 / 65_000.0; 4]),
        })
        .collect()
}

#[test]
fn fewer_than_three_loads_are_refused_and_springs_reach_the_estimator() {
    let vehicle = Vehicle::builtin("prowler").expect("sound");
    let known = Calibration::nominal(&vehicle.name);
    let refusal = weight(&vehicle, &known, &scales(&[0.0, 60.0]))
        .unwrap_err()
        .to_string();
    assert!(refusal.contains("three loads"), "{refusal}");
    let found = weight(
        &vehicle,
        &known,
        &scales(&[0.0, 60.0, 120.0, 180.0, 120.0, 60.0]),
    )
    .expect("sound");
    let spring = found.calibration.corner[&Wheel::FrontLeft]
        .spring
        .expect("sound");
    assert!((spring.rate_n_m / 65_000.0 - 1.0).abs() < 0.1, "{spring:?}");
    let applied = found.calibration.applied(&vehicle);
    let strut = applied.front.strut.as_ref().expect("sound");
    assert!((strut.stiffness_n_m - spring.rate_n_m).abs() < 1.0);
    assert!((strut.design_preload_n() - spring.preload_n).abs() < 1.0);
    let sensors = Sensors::builtin("thesis-10bit").expect("sound");
    assert!(Estimator::new(&vehicle, &sensors, &found.calibration, Settings::default()).is_ok());
}

/// Loads, lengths and forces of the springs of the standing vehicle in the simulator that made its truth runs
/// (`vehicle.json`, `static`): MacPherson struts in front, a live axle at the rear.
#[test]
fn scales_give_the_spring_forces_of_struts_and_of_a_live_axle() {
    const LENGTH_M: [f64; 4] = [0.48529, 0.50892, 0.26764, 0.28381];
    const LOAD_N: [f64; 4] = [4112.3, 3389.2, 4061.9, 3740.2];
    const SPRING_N: [f64; 4] = [3741.5, 3067.9, 3472.8, 2971.5];
    let vehicle = Vehicle::builtin("second-vehicle").expect("sound");
    let corner = Corner::of(&vehicle, Wheel::FrontLeft).expect("sound");
    let front_m = corner.design_strut_length_m();
    let [left_m, right_m] = (LinkedAxle::of(&vehicle).expect("sound")).design_lengths_m();
    let design_m = [front_m, front_m, left_m, right_m];
    let readings = [0.0, 1.0, 2.0, 3.0].map(|more| ScaleReading {
        load_n: PerWheel(LOAD_N.map(|load_n| load_n + 300.0 * more)),
        compression_m: PerWheel(std::array::from_fn(|i| {
            design_m[i] - LENGTH_M[i] + 0.01 * more
        })),
    });
    let known = Calibration::nominal(&vehicle.name);
    let found = weight(&vehicle, &known, &readings).expect("sound");
    let figure = &found.findings.figures[0];
    for (series, expected_n) in figure.series.iter().zip(SPRING_N) {
        let found_n = series.y[0];
        println!("{}: {found_n:.1} of {expected_n} N", series.name);
        // The file has no motion ratio of the struts, so that the lean of the body is not known: 1.8 % of a spring
        // of the live axle.
        assert!((found_n / expected_n - 1.0).abs() < 0.03, "{}", series.name);
    }
}
