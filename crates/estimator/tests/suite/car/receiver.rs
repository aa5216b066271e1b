//! A receiver with several antennas beside the signals of a car must not make the sideslip worse.

use atvrec_estimator::identification::handling::identify;
use math::Random;
use sample::{
    Estimate, FixQuality, GnssAttitude, GnssVelocity, LogTime, Measurement, Sample, SourceId,
};

use super::cars::{self, Case};
use super::surrogate::{Row, drive};
use super::{estimated, inputs, samples, vehicle};

/// Noise of the receiver: velocity, m/s, and heading, rad.
const NOISE: [f64; 2] = [0.03, 0.003];
/// Rows from the measurement to its arrival.
const LATE_ROWS: usize = 10;

/// The samples with those of a receiver that sends every `period` rows.
fn with_receiver(case: &Case, rows: &[Row], period: usize) -> Vec<Sample> {
    let ratio = vehicle(case).steering.ratio;
    let mut random = Random::new(11);
    let mut heading_rad = 0.0;
    let mut all = Vec::new();
    for (row, own) in rows.iter().zip(samples(rows, ratio)) {
        let time = own[0].log_time;
        let index = (row.time_s * 100.0).round() as usize;
        all.extend(own);
        if index.is_multiple_of(period) {
            let arrived = time.offset_seconds(0.01 * LATE_ROWS as f64);
            all.extend(receiver(row, heading_rad, [time, arrived], &mut random));
        }
        heading_rad += super::ROW_S * (row.yaw_rate_rad_s - case.errors.gyro_rad_s);
    }
    all.sort_by_key(|sample| sample.log_time);
    all
}

fn receiver(
    row: &Row,
    heading_rad: f64,
    [time, arrived]: [LogTime; 2],
    random: &mut Random,
) -> [Sample; 2] {
    let (sine, cosine) = math::sin_cos(heading_rad + row.sideslip_rad);
    let speed = row.speed_m_s / math::cos(row.sideslip_rad);
    let mut noisy = |value: f64, sigma: f64| value + sigma * random.normal();
    [
        Measurement::GnssVelocity(GnssVelocity {
            quality: FixQuality::Fixed,
            velocity_enu_m_s: [speed * cosine, speed * sine, 0.0].map(|v| noisy(v, NOISE[0])),
            sigma_enu_m_s: None,
            latency_s: None,
        }),
        Measurement::GnssAttitude(GnssAttitude {
            quality: FixQuality::Fixed,
            yaw_rad: Some(noisy(heading_rad, NOISE[1])),
            pitch_rad: Some(0.0),
            roll_rad: None,
            sigma_rad: None,
        }),
    ]
    .map(|measurement| Sample {
        source: SourceId(2),
        log_time: arrived,
        valid_time: time,
        device_time: None,
        measurement,
    })
}

/// RMSE of sideslip from a row on, degrees, and the largest change from one estimate to the next.
fn judged(estimates: &[Estimate], rows: &[Row], from: usize) -> [f64; 2] {
    let pairs = estimates.iter().zip(rows).skip(from);
    let errors: Vec<f64> = pairs
        .map(|(estimate, row)| (estimate.motion.sideslip_rad - row.sideslip_rad).to_degrees())
        .collect();
    let square: f64 = errors.iter().map(|error| error * error).sum();
    let jumps = errors.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    [
        (square / errors.len() as f64).sqrt(),
        jumps.fold(0.0, f64::max),
    ]
}

/// The unit of a car measures yaw rate and lateral acceleration alone: nothing carries the navigation from one value
/// of the receiver to the next, and the estimate changed between the navigation and the single-track filter.
#[test]
fn a_slow_receiver_of_a_car_makes_nothing_worse() {
    let case = &cars::SPORT;
    let rows = drive(&case.car, &case.lap, &case.errors, 140.0);
    let vehicle = vehicle(case);
    let half = rows.len() / 2;
    let found = identify(&inputs(&rows[..half]), &vehicle, 0.0).expect("parameters of a car");
    let plain = samples(&rows, vehicle.steering.ratio);
    let ([alone, _], _) = estimated(&vehicle, &found, plain.iter().flatten());
    let [alone_deg, alone_jump_deg] = judged(&alone, &rows, half);
    for period in [10, 20, 50, 100] {
        let all = with_receiver(case, &rows, period);
        let ([with, _], _) = estimated(&vehicle, &found, all.iter());
        let [with_deg, jump_deg] = judged(&with, &rows, half);
        println!("{period} rows: {with_deg:.3} and {alone_deg:.3} deg, jump {jump_deg:.2} deg");
        assert!(with_deg <= alone_deg + 0.01, "{with_deg} {alone_deg}");
        assert!(
            jump_deg <= alone_jump_deg + 0.05,
            "{jump_deg} {alone_jump_deg}"
        );
    }
}
