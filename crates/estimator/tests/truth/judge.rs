//! The estimator over a run's samples, and its errors against the truth.

use atvrec_estimator::{Calibration, Estimator, Output, Settings};
use model::sensors::Sensors;
use model::vehicle::Vehicle;
use sample::{Estimate, Event, Sample, Wheel};

use super::run::{RATE_HZ, Run};
use super::sensing;

pub struct Result {
    pub estimates: Vec<Estimate>,
    pub events: Vec<Event>,
}

pub fn estimate(
    vehicle: &Vehicle,
    sensors: &Sensors,
    calibration: &Calibration,
    settings: Settings,
    samples: &[Sample],
) -> Result {
    let mut estimator = Estimator::new(vehicle, sensors, calibration, settings).unwrap();
    let mut result = Result {
        estimates: Vec::new(),
        events: Vec::new(),
    };
    for sample in samples {
        estimator.advance(sample.log_time, &mut |output| match output {
            Output::Estimate(estimate) => result.estimates.push(estimate),
            Output::Event(event) => result.events.push(event),
            Output::Parameters(_) | Output::Step(_) => {}
        });
        estimator.push(sample);
    }
    result
}

/// The truth row of an estimate.
pub fn row(estimate: &Estimate) -> usize {
    (estimate.time.seconds_since(sensing::START) * RATE_HZ).round() as usize
}

/// Root mean square.
pub fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for value in values {
        sum += value * value;
        count += 1.0;
    }
    f64::sqrt(sum / f64::max(count, 1.0))
}

/// RMSE of sideslip, roll and pitch in degrees, above 3 m/s and after the first 3 s.
pub fn motion_errors(run: &Run, result: &Result) -> [f64; 3] {
    let truth = ["beta", "roll", "pitch"];
    std::array::from_fn(|i| {
        let column = run.column(truth[i]);
        rms(result.estimates.iter().filter_map(|estimate| {
            let row = row(estimate);
            let moving = run.column("vx_body").get(row)? > &3.0 || i > 0;
            let value = [
                estimate.motion.sideslip_rad,
                estimate.motion.roll_rad,
                estimate.motion.pitch_rad,
            ][i];
            (moving && row > 600).then(|| (value - column[row]).to_degrees())
        }))
    })
}

/// 100 RMS / max(peak of the run, static load), worst tyre, after the first 3 s.
pub fn force_errors(run: &Run, vehicle: &Vehicle, result: &Result) -> [f64; 3] {
    let wheelbase = vehicle.body.front_axle_to_cg_m + vehicle.body.cg_to_rear_axle_m;
    let half_weight = 0.5 * vehicle.body.mass_kg * 9.81 / wheelbase;
    std::array::from_fn(|axis| {
        Wheel::ALL
            .into_iter()
            .map(|wheel| {
                let name = ["Fx", "Fy", "Fz"][axis];
                let truth = run.column(&format!("{}_{name}", wheel.abbreviation()));
                let arm = if wheel.is_front() {
                    vehicle.body.cg_to_rear_axle_m
                } else {
                    vehicle.body.front_axle_to_cg_m
                };
                let peak = truth.iter().fold(half_weight * arm, |m, v| m.max(v.abs()));
                100.0 / peak
                    * rms(result.estimates.iter().filter_map(|estimate| {
                        let row = row(estimate);
                        (row > 600 && row < truth.len())
                            .then(|| estimate.measured[wheel].force_n[axis] - truth[row])
                    }))
            })
            .fold(0.0, f64::max)
    })
}
