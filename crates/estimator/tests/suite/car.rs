//! Sideslip of cars of which mass and axle distances are known: handling is identified from the
//! first half of a drive without a reference, then the estimator and its smoother run over the whole
//! drive, and its second half is judged.

mod cars;
mod halves;
mod receiver;
mod road;
mod spin;
mod surrogate;

use atvrec_estimator::finding::Refusal;
use atvrec_estimator::identification::handling::{Identified, identify};
use atvrec_estimator::planar::{LastInertial, PlanarInput};
use atvrec_estimator::score::{self, Errors};
use atvrec_estimator::smoother::{LAG_STEPS, Smoother};
use atvrec_estimator::{Calibration, Estimator, Output, Settings};
use cars::Case;
use model::sensors::Sensors;
use model::vehicle::Vehicle;
use sample::{
    Estimate, Event, EventKind, GroundSpeedSample, ImuSample, LogTime, Measurement, Sample,
    SourceId, SteerSample,
};
use surrogate::{Row, drive};

/// Time constant of the difference quotient of the speed, s.
const ACCELERATION_TIME_S: f64 = 0.15;
const ROW_S: f64 = 0.01;

/// What is known of the car.
fn vehicle(case: &Case) -> Vehicle {
    let car = &case.car;
    let text = format!(
        "name = \"{}\"\n[body]\nmass_kg = {:?}\nfront_axle_to_cg_m = {:?}\n\
         cg_to_rear_axle_m = {:?}\n",
        case.name, car.mass_kg, car.front_m, car.rear_m
    );
    Vehicle::from_toml(&text, "car.toml").expect("a vehicle file")
}

fn inputs(rows: &[Row]) -> Vec<PlanarInput> {
    let mut smooth = rows[0].speed_m_s;
    let input = |row: &Row| {
        let acceleration_m_s2 = (row.speed_m_s - smooth) / ACCELERATION_TIME_S;
        smooth += ROW_S * acceleration_m_s2;
        PlanarInput {
            time_s: row.time_s,
            speed_m_s: row.speed_m_s,
            acceleration_m_s2,
            steer_rad: row.steer_rad,
            yaw_rate_rad_s: Some(row.yaw_rate_rad_s),
            lateral_m_s2: Some(row.lateral_m_s2),
            inertial: LastInertial::default(),
        }
    };
    rows.iter().map(input).collect()
}

/// What the car's sensors say at each row, in the order of arrival.
fn samples(rows: &[Row], steering_ratio: f64) -> Vec<Vec<Sample>> {
    let open = f64::NAN;
    let of_row = |row: &Row| {
        let time = LogTime(1_000_000_000).offset_seconds(row.time_s);
        [
            Measurement::GroundSpeed(GroundSpeedSample {
                forward_m_s: row.speed_m_s,
                leftward_m_s: None,
            }),
            Measurement::Steer(SteerSample {
                steering_wheel_rad: steering_ratio * row.steer_rad,
            }),
            Measurement::Imu(ImuSample {
                specific_force_m_s2: [open, row.lateral_m_s2, open],
                angular_rate_rad_s: [open, open, row.yaw_rate_rad_s],
                valid: true,
                ..ImuSample::default()
            }),
        ]
        .map(|measurement| Sample {
            source: SourceId(0),
            log_time: time,
            valid_time: time,
            device_time: None,
            measurement,
        })
        .to_vec()
    };
    rows.iter().map(of_row).collect()
}

/// What the estimator and the smoother make of a drive's rows after `from`, once the offsets that
/// were found are taken off; and what happened.
fn judged(
    vehicle: &Vehicle,
    found: &Identified,
    rows: &[Row],
    from: usize,
) -> ([Errors; 2], Vec<Event>) {
    let samples = samples(rows, vehicle.steering.ratio);
    let (estimates, events) = estimated(vehicle, found, samples.iter().flatten());
    let truth_deg: Vec<f64> = rows.iter().map(|r| r.sideslip_rad.to_degrees()).collect();
    let errors = estimates.map(|estimates| {
        let sideslip = |estimate: &Estimate| estimate.motion.sideslip_rad.to_degrees();
        let found_deg: Vec<f64> = estimates.iter().map(sideslip).collect();
        let last = found_deg.len();
        assert!(last + 2 >= rows.len(), "{last} of {}", rows.len());
        score::errors(&found_deg[from..], &truth_deg[from..last]).expect("pairs")
    });
    (errors, events)
}

/// Causal and smoothed estimates from samples in their order of arrival, and what happened.
fn estimated<'a>(
    vehicle: &Vehicle,
    found: &Identified,
    samples: impl Iterator<Item = &'a Sample>,
) -> ([Vec<Estimate>; 2], Vec<Event>) {
    let mut calibration = Calibration::nominal(&vehicle.name);
    found.put(vehicle.steering.ratio, &mut calibration);
    let sensors = Sensors::builtin("thesis-10bit").expect("a sensors file");
    let mut estimator = Estimator::new(vehicle, &sensors, &calibration, Settings::default())
        .expect("an estimator")
        .traced();
    let mut smoother = Smoother::new(vehicle, LAG_STEPS);
    let (mut causal, mut smoothed, mut events) = (Vec::new(), Vec::new(), Vec::new());
    let mut take = |output| match output {
        Output::Step(step) => {
            causal.push(step.estimate.clone());
            smoother.push(*step, &mut |estimate| smoothed.push(estimate));
        }
        Output::Event(event) => events.push(event),
        _ => {}
    };
    for sample in samples {
        estimator.advance(sample.log_time, &mut take);
        estimator.push(sample);
    }
    smoother.finish(&mut |estimate| smoothed.push(estimate));
    ([causal, smoothed], events)
}

/// Handling from the first half of a drive, in which the car spins so often, and errors in the second.
fn tried(case: &Case, seconds: f64, spins: usize) -> (Identified, [Errors; 2]) {
    let rows = drive(&case.car, &case.lap, &case.errors, seconds);
    let greatest = |pick: fn(&Row) -> f64| rows.iter().map(pick).fold(0.0, f64::max);
    let vehicle = vehicle(case);
    let mut first = rows[..rows.len() / 2].to_vec();
    for k in 1..=spins {
        first = spin::inserted(&first, first.len() * k / (spins + 1), &case.errors);
    }
    let found = identify(&inputs(&first), &vehicle, 0.0).expect("parameters of a car");
    let ([causal, smoothed], events) = judged(&vehicle, &found, &rows, rows.len() / 2);
    assert_eq!(events, []);
    println!(
        "{:<8} {:.1} m/s, {:.1} m/s^2, sideslip up to {:.1} deg: rmse {:.3}, 95 % {:.3}, mean \
         {:+.3} deg; smoothed {:.3}, {:.3}, {:+.3}",
        case.name,
        greatest(|r| r.speed_m_s),
        found.peak_m_s2,
        greatest(|r| r.sideslip_rad.abs()).to_degrees(),
        causal.rmse,
        causal.percentile_95,
        causal.mean,
        smoothed.rmse,
        smoothed.percentile_95,
        smoothed.mean,
    );
    (found, [causal, smoothed])
}

#[test]
fn mass_and_axle_distances_and_a_drive_give_sideslip() {
    let case = cars::SPORT;
    let (found, [errors, smoothed]) = tried(&case, 140.0, 0);
    assert!(errors.rmse < 0.2, "{errors:?} {found:#?}");
    assert!(errors.percentile_95 < 0.4, "{errors:?}");
    assert!(smoothed.rmse < errors.rmse, "{errors:?} {smoothed:?}");
    let steer = found.steer_offset_rad - case.errors.steer_rad;
    assert!(steer.to_degrees().abs() < 0.1, "{found:#?}");
    let rate = found.yaw_rate_offset_rad_s - case.errors.gyro_rad_s;
    assert!(rate.to_degrees().abs() < 0.2, "{found:#?}");
}

#[test]
fn spins_are_left_out_of_what_handling_is_identified_from() {
    let (found, [errors, _]) = tried(&cars::SPORT, 140.0, 2);
    assert!(errors.rmse < 0.1, "{errors:?} {found:#?}");
    assert!((4.0..15.0).contains(&found.spun_s), "{found:#?}");
}

#[test]
fn a_spin_is_one_event_and_the_filter_finds_back() {
    let case = &cars::SPORT;
    let rows = drive(&case.car, &case.lap, &case.errors, 140.0);
    let vehicle = vehicle(case);
    let half = rows.len() / 2;
    let found = identify(&inputs(&rows[..half]), &vehicle, 0.0).expect("parameters of a car");
    let spun = spin::inserted(&rows, half, &case.errors);
    let last_half_minute = spun.len() - 3000;
    let ([causal, smoothed], events) = judged(&vehicle, &found, &spun, last_half_minute);
    let kinds: Vec<_> = events.iter().map(|event| &event.kind).collect();
    assert_eq!(
        kinds,
        [&EventKind::FilterReset, &EventKind::FilterRecovered]
    );
    assert!(causal.rmse < 0.3, "{causal:?}");
    assert!(smoothed.rmse < 0.3, "{smoothed:?}");
}

/// Spikes and what is not a number cost little, the order of arrival nothing; an unknown value is
/// reported as unknown and is estimated again later.
#[test]
fn bad_samples_upset_nothing() {
    let case = &cars::SPORT;
    let rows = drive(&case.car, &case.lap, &case.errors, 100.0);
    let vehicle = vehicle(case);
    let found = identify(&inputs(&rows[..7000]), &vehicle, 0.0).expect("parameters of a car");
    let clean = samples(&rows, vehicle.steering.ratio);
    let through = |samples: &[Vec<Sample>]| {
        let ([causal, _], events) = estimated(&vehicle, &found, samples.iter().flatten());
        assert_eq!(events, []);
        causal
    };
    let plain = through(&clean);

    let mut disordered = clean.clone();
    disordered.iter_mut().for_each(|row| row.reverse());
    let told = |estimates: &[Estimate]| -> Vec<u64> {
        let sideslip = estimates.iter().map(|e| e.motion.sideslip_rad.to_bits());
        sideslip.collect()
    };
    assert!(told(&through(&disordered)) == told(&plain));

    let mut spoilt = clean.clone();
    for (count, row) in spoilt.iter_mut().enumerate().skip(3000) {
        for sample in row {
            match &mut sample.measurement {
                Measurement::GroundSpeed(speed) if count % 37 < 3 => speed.forward_m_s = 110.0,
                Measurement::Steer(steer) if count % 41 < 3 => steer.steering_wheel_rad += 9.0,
                Measurement::Imu(imu) if count % 43 < 3 => imu.angular_rate_rad_s[2] = f64::NAN,
                Measurement::Imu(imu) if count % 47 < 3 => imu.specific_force_m_s2[1] = 90.0,
                _ => {}
            }
        }
    }
    let sideslip_deg = |estimate: &Estimate| estimate.motion.sideslip_rad.to_degrees();
    let apart_deg = |estimates: &[Estimate], from: usize| {
        let pairs = estimates.iter().zip(&plain).skip(from);
        let apart = pairs.map(|(a, b)| (sideslip_deg(a) - sideslip_deg(b)).abs());
        apart.fold(0.0, f64::max)
    };
    let upset_deg = apart_deg(&through(&spoilt), 0);
    assert!(upset_deg < 0.5, "{upset_deg}");

    let mut silent = clean;
    for row in &mut silent[5000..5300] {
        row.retain(|sample| !matches!(sample.measurement, Measurement::Steer(_)));
    }
    let estimates = through(&silent);
    let known = |row: usize| estimates[row].motion.sideslip_rad.is_finite();
    assert!(known(4990) && !known(5100) && known(5310));
    assert!(estimates[5100].motion.velocity_x_m_s.is_nan());
    let late_deg = apart_deg(&estimates, 6000);
    assert!(late_deg < 0.1, "{late_deg}");
}

#[test]
fn a_wrong_sign_is_named() {
    type Turn = fn(&mut Row);
    let case = &cars::SPORT;
    let rows = drive(&case.car, &case.lap, &case.errors, 30.0);
    let turned: [(&str, Turn); 3] = [
        ("sign of the steer angle", |row| row.steer_rad *= -1.0),
        ("sign of the yaw rate", |row| row.yaw_rate_rad_s *= -1.0),
        ("sign of the lateral acceleration", |row| {
            row.lateral_m_s2 *= -1.0
        }),
    ];
    for (expected, turn) in turned {
        let mut rows = rows.clone();
        rows.iter_mut().for_each(turn);
        match identify(&inputs(&rows), &vehicle(case), 0.0) {
            Err(Refusal::Value { name, .. }) => assert_eq!(name, expected),
            other => panic!("{other:?}"),
        }
    }
}

/// Longest time for which the lateral force of the vehicle model may be off by more than `LATCHED_M_S2`, s.
const LATCHED_MAX_S: f64 = 2.0;
const LATCHED_M_S2: f64 = 4.0;

/// Longest time for which the lateral force of the vehicle model is off, s. The model begins again at a difference of
/// `spun_rad` in sideslip.
fn latched_s(case: &Case, rows: &[Row], spun_rad: f64) -> f64 {
    let vehicle = vehicle(case);
    let mut calibration = Calibration::nominal(&vehicle.name);
    calibration.steer.offset_rad = vehicle.steering.ratio * case.errors.steer_rad;
    let mut settings = Settings::default();
    settings.tuning.expected.spun_rad = spun_rad;
    let sensors = Sensors::builtin("thesis-10bit").expect("a sensors file");
    let mut estimator =
        Estimator::new(&vehicle, &sensors, &calibration, settings).expect("an estimator");
    let mut model_m_s2 = Vec::new();
    let all = samples(rows, vehicle.steering.ratio);
    for sample in all.iter().flatten() {
        estimator.advance(sample.log_time, &mut |output| {
            if let Output::Estimate(estimate) = output {
                let forces = estimate.expected.0.iter().map(|force| force.force_n[1]);
                model_m_s2.push(forces.sum::<f64>() / case.car.mass_kg);
            }
        });
        estimator.push(sample);
    }
    let (mut steps, mut most) = (0, 0);
    for (model, row) in model_m_s2.iter().zip(rows) {
        let error = model - (row.lateral_m_s2 - case.errors.accel_m_s2);
        steps = if error.abs() > LATCHED_M_S2 {
            steps + 1
        } else {
            0
        };
        most = most.max(steps);
    }
    f64::from(most) * ROW_S
}

/// With the speed given, a model that spins would never stop: the forces stayed at the friction.
#[test]
fn the_vehicle_model_does_not_stay_at_the_limit_of_grip() {
    let spun_rad = Settings::default().tuning.expected.spun_rad;
    let mut without_s = 0.0_f64;
    for case in &cars::ALL {
        let rows = drive(&case.car, &case.lap, &case.errors, 140.0);
        let [with_s, free_s] = [spun_rad, 10.0].map(|limit| latched_s(case, &rows, limit));
        println!(
            "{}: {with_s:.2} s, without a limit {free_s:.2} s",
            case.name
        );
        assert!(with_s < LATCHED_MAX_S, "{}: {with_s} s", case.name);
        without_s = without_s.max(free_s);
    }
    assert!(without_s > 2.0 * LATCHED_MAX_S, "{without_s} s");
}

#[test]
#[ignore = "a campaign of minutes: `make campaigns`"]
fn five_cars_over_half_a_drive_of_550_s() {
    let mut worst = [0.0_f64; 2];
    for case in &cars::ALL {
        let (found, [errors, smoothed]) = tried(case, 550.0, 0);
        assert_eq!(found.spun_s, 0.0, "{found:#?}");
        assert!(smoothed.rmse < errors.rmse, "{errors:?} {smoothed:?}");
        worst = [
            worst[0].max(errors.rmse),
            worst[1].max(errors.percentile_95),
        ];
    }
    assert!(worst[0] < 0.3, "{worst:?}");
    assert!(worst[1] < 0.6, "{worst:?}");
}
