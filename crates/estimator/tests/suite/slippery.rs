//! Slippery ground: the sideslip without a receiver, and the forces of the vehicle model with the friction that the
//! drive has shown.

use atvrec_estimator::{Calibration, Input, ModelFriction, Settings};
use model::road::{Road, SoftGround};
use model::sensors::Sensors;
use model::vehicle::Vehicle;
use sample::{ForceSource, Wheel};
use sim::{Course, RoughPlan, drive_rough};
use testkit::drive::of_motion;
use testkit::scoring::{Estimated, estimate, row};
use testkit::sensing;
use testkit::truth::{self, RATE_HZ, Run};

const SEEDS: [u64; 2] = [1, 2];
/// Ground of a third of the friction of the tyres' file.
const SLIPPERY: &str = "[part.ground]\nkind = \"friction\"\nfactor = 0.35\n";
/// From when a drive is judged, s: the circle is steady then.
const FROM_S: f64 = 6.0;
/// Part of the estimates within two standard deviations, at least.
const WITHIN_MIN: f64 = 0.95;
/// Error of the model with the friction found, as a part of that with the friction of the file.
const FOUND_PART_MAX: f64 = 0.6;
/// Largest mean standard deviation of the sideslip on dry ground without a receiver, degrees.
const DRY_SIGMA_MAX_DEG: f64 = 3.0;

fn vehicle() -> Vehicle {
    Vehicle::builtin("prowler").unwrap()
}

/// A circle on slippery ground: speed, m/s, and angle of the steering wheel, rad.
fn circle(vehicle: &Vehicle, speed_m_s: f64, steering_wheel_rad: f64) -> Run {
    let road = Road::from_toml(SLIPPERY, "ground.toml", &|_| Err(String::new())).unwrap();
    let plan = RoughPlan {
        duration_s: 20.0,
        rows_per_s: 200,
        start_m: [0.0; 2],
        start_yaw_rad: 0.0,
        start_speed_m_s: speed_m_s,
        speed_m_s: Box::new(move |_| speed_m_s),
        course: Course::SteeringWheel(Box::new(move |t| {
            steering_wheel_rad * ((t - 1.0) / 4.0).clamp(0.0, 1.0)
        })),
        hitch: None,
    };
    let ground = SoftGround::new(&road, vehicle);
    of_motion(
        &drive_rough("circle", vehicle, &ground, &plan).unwrap(),
        "slippery circle",
    )
}

fn without_gnss() -> Settings {
    Settings {
        ignore: vec![Input::GnssVelocity, Input::GnssAttitude],
        ..Settings::default()
    }
}

fn estimated(vehicle: &Vehicle, run: &Run, seed: u64, settings: Settings) -> Estimated {
    let sensors = Sensors::builtin("thesis-10bit").unwrap();
    let samples = sensing::samples(run, vehicle, &sensors, seed);
    let calibration = Calibration::nominal(&vehicle.name);
    estimate(vehicle, &sensors, &calibration, settings, &samples)
}

/// RMSE of the sideslip and its mean standard deviation, degrees, and the part within two of them.
fn sideslip(run: &Run, result: &Estimated, from_s: f64) -> [f64; 3] {
    let truth = run.column("beta");
    let speed = run.column("vx_body");
    let rows = (from_s * RATE_HZ) as usize..run.rows;
    let (mut count, mut square, mut sum, mut within) = (0.0, 0.0, 0.0, 0.0);
    for estimate in &result.estimates {
        let row = row(estimate);
        if !rows.contains(&row) || speed[row] < 3.0 {
            continue;
        }
        let error = estimate.motion.sideslip_rad - truth[row];
        let sigma = estimate.motion.sideslip_sigma_rad;
        count += 1.0;
        square += error * error;
        sum += sigma;
        within += f64::from(error.abs() < 2.0 * sigma);
    }
    let rmse: f64 = f64::sqrt(square / count);
    [
        rmse.to_degrees(),
        f64::to_degrees(sum / count),
        within / count,
    ]
}

/// Tyres that slide without a receiver: the sideslip was 2.7 degrees off at a stated 0.46.
#[test]
fn sideslip_without_a_receiver_is_within_two_deviations_on_slippery_ground() {
    let vehicle = vehicle();
    for (speed_m_s, steering_wheel_rad) in [(6.0, 1.6), (8.0, 3.0)] {
        let run = circle(&vehicle, speed_m_s, steering_wheel_rad);
        for seed in SEEDS {
            let result = estimated(&vehicle, &run, seed, without_gnss());
            let [rmse, sigma, within] = sideslip(&run, &result, FROM_S);
            println!(
                "{speed_m_s} m/s, seed {seed}: {rmse:.2} deg at {sigma:.2}, {within:.2} within"
            );
            assert!(within >= WITHIN_MIN, "{rmse} {sigma} {within}");
            // The standard deviation of the filter alone does not contain the error.
            let mut settings = without_gnss();
            settings.tuning.motion.aiding.blind_slip_part = 0.0;
            let result = estimated(&vehicle, &run, seed, settings);
            let [rmse, sigma, within] = sideslip(&run, &result, FROM_S);
            println!("    filter alone: {rmse:.2} deg at {sigma:.2}, {within:.2} within");
            assert!(within < 0.5, "{rmse} {sigma} {within}");
        }
    }
    let Some(run) = truth::run("c_sine03") else {
        return;
    };
    let result = estimated(truth::vehicle(), run, 1, without_gnss());
    let [rmse, sigma, within] = sideslip(run, &result, FROM_S);
    println!("dry: {rmse:.2} deg at {sigma:.2}, {within:.2} within");
    assert!(
        sigma < DRY_SIGMA_MAX_DEG && within >= WITHIN_MIN,
        "{sigma} {within}"
    );
}

/// 100 RMS / max(peak of the run, static load) of the model's lateral forces, worst wheel, from a time on.
fn model_error(run: &Run, vehicle: &Vehicle, result: &Estimated, from_s: f64) -> f64 {
    let of_wheel = |wheel: Wheel| {
        let truth = run.column(&format!("{}_Fy", wheel.abbreviation()));
        let load_n = vehicle.static_load_n(wheel);
        let peak = truth
            .iter()
            .fold(load_n, |most, force| most.max(force.abs()));
        let late = result.estimates.iter().filter_map(|estimate| {
            let row = row(estimate);
            (row as f64 > from_s * RATE_HZ && row < run.rows)
                .then(|| estimate.expected[wheel].force_n[1] - truth[row])
        });
        100.0 * testkit::scoring::rms(late) / peak
    };
    Wheel::ALL.into_iter().map(of_wheel).fold(0.0, f64::max)
}

/// On slippery ground, the model with the friction of the file expects forces that the ground does not give.
#[test]
fn the_vehicle_model_uses_the_friction_that_the_drive_has_shown() {
    let vehicle = &vehicle();
    let run = &circle(vehicle, 8.0, 2.0);
    let with = |model_friction| {
        let settings = Settings {
            model_friction,
            ..Settings::default()
        };
        estimated(vehicle, run, 1, settings)
    };
    let [file, found] = [ModelFriction::Vehicle, ModelFriction::Found].map(with);
    let errors = [&file, &found].map(|result| model_error(run, vehicle, result, 12.0));
    println!("F_y of the model: {errors:.1?} %");
    assert!(errors[1] < FOUND_PART_MAX * errors[0], "{errors:?}");
    let sources = |result: &Estimated, source| {
        let all = result.estimates.iter();
        all.filter(|estimate| estimate.expected.0[0].source == source)
            .count()
    };
    assert_eq!(sources(&file, ForceSource::ModelFound), 0);
    let last = found.estimates.last().unwrap();
    assert_eq!(last.expected.0[0].source, ForceSource::ModelFound);
    assert!(sources(&found, ForceSource::Model) > 100);
    let carrier = |result: &Estimated| {
        result
            .estimates
            .iter()
            .map(|e| e.carrier)
            .collect::<Vec<_>>()
    };
    assert!(
        carrier(&file) == carrier(&found),
        "the measured forces are those of the sensors"
    );
}
