//! The estimator over a run's samples, and its errors against the truth.

use estimator::consistency::{Consistency, WINDOW_STEPS, consistency};
use estimator::{Calibration, Estimator, Output, Settings};
use model::sensors::Sensors;
use model::vehicle::Vehicle;
use sample::{Estimate, Event, Limits, Parameters, Road, Sample, Terrain, Wheel};

use crate::sensing;
use crate::truth::{RATE_HZ, Run};

/// Rows at the start of a run that are not judged: 3 s.
const SETTLING_ROWS: usize = 600;
/// Lowest speed at which sideslip and slip angles are judged, m/s.
const MOVING_M_S: f64 = 3.0;
/// Lowest load of a wheel whose slip angle is judged, N.
const LOADED_N: f64 = 100.0;
/// Columns of a tyre's force, without the wheel.
const FORCES: [&str; 3] = ["Fx", "Fy", "Fz"];

/// What the estimator makes of a run.
#[derive(Default)]
pub struct Estimated {
    /// One estimate each 10 ms.
    pub estimates: Vec<Estimate>,
    /// Estimates with a lag of 20 ms.
    pub lagged: Vec<Estimate>,
    /// The road each 10 ms.
    pub roads: Vec<Road>,
    /// The road with a lag of 20 ms.
    pub lagged_roads: Vec<Road>,
    /// What the vehicle can still do, each 100 ms.
    pub limits: Vec<Limits>,
    /// The kind of ground, each 100 ms.
    pub terrains: Vec<Terrain>,
    /// Grip of the axles, each second.
    pub parameters: Vec<Parameters>,
    /// Events in their order.
    pub events: Vec<Event>,
}

/// Runs the estimator over the samples.
///
/// # Panics
/// If the estimator refuses the vehicle, the sensors or the calibration.
#[must_use]
pub fn estimate(
    vehicle: &Vehicle,
    sensors: &Sensors,
    calibration: &Calibration,
    settings: Settings,
    samples: &[Sample],
) -> Estimated {
    let mut estimator = Estimator::new(vehicle, sensors, calibration, settings)
        .expect("the estimator takes this vehicle and these sensors");
    let mut result = Estimated::default();
    for sample in samples {
        estimator.advance(sample.log_time, &mut |output| match output {
            Output::Estimate(estimate) => result.estimates.push(estimate),
            Output::Event(event) => result.events.push(event),
            Output::Lagged(estimate) => result.lagged.push(estimate),
            Output::Road(road) => result.roads.push(road),
            Output::LaggedRoad(road) => result.lagged_roads.push(road),
            Output::Terrain(terrain) => result.terrains.push(terrain),
            Output::Limits(limits) => result.limits.push(limits),
            Output::Parameters(parameters) => result.parameters.push(parameters),
            Output::Step(_) => {}
        });
        estimator.push(sample);
    }
    result
}

/// The truth row of an estimate.
#[must_use]
pub fn row(estimate: &Estimate) -> usize {
    (estimate.time.seconds_since(sensing::START) * RATE_HZ).round() as usize
}

/// Root mean square; zero of nothing.
pub fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for value in values {
        sum += value * value;
        count += 1.0;
    }
    f64::sqrt(sum / f64::max(count, 1.0))
}

/// RMS of `error`, which is called with each judged estimate and its row of the run.
fn rms_of_judged(
    run: &Run,
    result: &Estimated,
    mut error: impl FnMut(&Estimate, usize) -> Option<f64>,
) -> f64 {
    rms(result.estimates.iter().filter_map(|estimate| {
        let row = row(estimate);
        (row > SETTLING_ROWS && row < run.rows)
            .then(|| error(estimate, row))
            .flatten()
    }))
}

/// RMSE of sideslip (above 3 m/s), roll and pitch in degrees, after the first 3 s.
#[must_use]
pub fn motion_errors(run: &Run, result: &Estimated) -> [f64; 3] {
    let speed = run.column("vx_body");
    std::array::from_fn(|i| {
        let truth = run.column(["beta", "roll", "pitch"][i]);
        rms_of_judged(run, result, |estimate, row| {
            let motion = &estimate.motion;
            let value = [motion.sideslip_rad, motion.roll_rad, motion.pitch_rad][i];
            (i > 0 || speed[row] > MOVING_M_S).then(|| (value - truth[row]).to_degrees())
        })
    })
}

/// RMSE of the roll, pitch and yaw rates, degrees a second, after the first 3 s.
#[must_use]
pub fn rate_errors(run: &Run, result: &Estimated) -> [f64; 3] {
    std::array::from_fn(|axis| {
        let truth = run.column(["p", "q", "r"][axis]);
        rms_of_judged(run, result, |estimate, row| {
            Some((estimate.motion.rate_rad_s[axis] - truth[row]).to_degrees())
        })
    })
}

/// RMSE of each wheel's slip angle, degrees, above 3 m/s and after the first 3 s, while the wheel
/// carries load.
#[must_use]
pub fn slip_errors(run: &Run, result: &Estimated) -> [f64; 4] {
    let speed = run.column("vx_body");
    Wheel::ALL.map(|wheel| {
        let name = wheel.abbreviation();
        let truth = run.column(&format!("{name}_alpha"));
        let load = run.column(&format!("{name}_Fz"));
        rms_of_judged(run, result, |estimate, row| {
            (speed[row] > MOVING_M_S && load[row] > LOADED_N)
                .then(|| (estimate.motion.slip_angle_rad[wheel] - truth[row]).to_degrees())
        })
    })
}

/// 100 RMS / max(peak of the run, static load) of F_x, F_y and F_z, worst tyre, after the first 3 s.
#[must_use]
pub fn force_errors(run: &Run, vehicle: &Vehicle, result: &Estimated) -> [f64; 3] {
    std::array::from_fn(|axis| {
        let of_wheel = |wheel: Wheel| {
            let truth = run.column(&format!("{}_{}", wheel.abbreviation(), FORCES[axis]));
            let peak = (truth.iter()).fold(vehicle.static_load_n(wheel), |m, v| m.max(v.abs()));
            100.0 / peak
                * rms_of_judged(run, result, |estimate, row| {
                    Some(estimate.measured[wheel].force_n[axis] - truth[row])
                })
        };
        Wheel::ALL.into_iter().map(of_wheel).fold(0.0, f64::max)
    })
}

/// The same in the wheel-carrier frame, of causal or of lagged estimates.
#[must_use]
pub fn carrier_errors(run: &Run, vehicle: &Vehicle, estimates: &[Estimate]) -> [f64; 3] {
    let truth: Vec<[[f64; 3]; 4]> = (0..run.rows).map(|row| run.carrier_forces(row)).collect();
    std::array::from_fn(|axis| {
        let of_wheel = |wheel: Wheel| {
            let at = |row: usize| truth[row][wheel.index()][axis];
            let loads = (0..run.rows).map(|row| at(row).abs());
            let peak = loads.fold(vehicle.static_load_n(wheel), f64::max);
            let judged = estimates.iter().map(|estimate| (estimate, row(estimate)));
            let errors = judged
                .filter(|(_, row)| (SETTLING_ROWS..run.rows).contains(row))
                .map(|(estimate, row)| estimate.carrier[wheel].force_n[axis] - at(row));
            100.0 / peak * rms(errors)
        };
        Wheel::ALL.into_iter().map(of_wheel).fold(0.0, f64::max)
    })
}

/// Mean squares of the errors of F_x, F_y, F_z over their standard deviations, in the wheel-carrier frame.
#[must_use]
pub fn carrier_squares(run: &Run, estimates: &[Estimate]) -> [f64; 3] {
    let mut sums = [0.0; 3];
    let mut count = 0;
    let judged = estimates.iter().map(|estimate| (estimate, row(estimate)));
    for (estimate, row) in judged.filter(|(_, row)| (SETTLING_ROWS..run.rows).contains(row)) {
        for (force, truth) in estimate.carrier.0.iter().zip(run.carrier_forces(row)) {
            count += 1;
            for axis in 0..3 {
                let z = (force.force_n[axis] - truth[axis]) / force.sigma_n[axis];
                sums[axis] += z * z;
            }
        }
    }
    sums.map(|sum| sum / f64::from(count))
}

/// Whether the standard deviations of all forces hold, after the first 3 s.
pub struct Squares {
    /// Mean squares of the normalised errors of F_x, F_y, F_z.
    pub axes: [f64; 3],
    /// All twelve forces, window by window.
    pub all: Consistency,
    /// Mean of z^2/2 + ln sigma of F_x, F_y, F_z: the less, the better.
    pub surprise: [f64; 3],
}

/// Compares the errors of the forces with their standard deviations.
///
/// # Panics
/// If the run is shorter than one window.
#[must_use]
pub fn deviations(run: &Run, result: &Estimated) -> Squares {
    let mut signals = Vec::new();
    let mut axes = [0.0; 3];
    let mut surprise = [0.0; 3];
    for axis in 0..3 {
        for wheel in Wheel::ALL {
            let truth = run.column(&format!("{}_{}", wheel.abbreviation(), FORCES[axis]));
            let mut series = Vec::new();
            let mut logs = 0.0;
            for estimate in &result.estimates {
                let row = row(estimate);
                if row > SETTLING_ROWS && row < run.rows {
                    let force = &estimate.measured[wheel];
                    let sigma = force.sigma_n[axis];
                    series.push((force.force_n[axis] - truth[row]) / sigma);
                    logs += math::ln(sigma);
                }
            }
            let count = series.len() as f64;
            let square = series.iter().map(|z| z * z).sum::<f64>() / count;
            axes[axis] += square / 4.0;
            surprise[axis] += (0.5 * square + logs / count) / 4.0;
            signals.push(series);
        }
    }
    Squares {
        axes,
        all: consistency(&signals, WINDOW_STEPS).expect("a run of one window at least"),
        surprise,
    }
}
