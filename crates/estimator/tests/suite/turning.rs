//! Angular acceleration of the body: that of the balance of moments against the truth. The unsprung parts and the
//! specific force at the centre of gravity use it.

use atvrec_estimator::{Calibration, Estimator, Output, Settings};
use model::sensors::Sensors;
use nalgebra::Vector3;
use testkit::scoring::{rms, row};
use testkit::truth;

/// Excerpts on rough ground: class E, and jumps.
const EXCERPTS: [&str; 2] = ["r2_iso_e_a", "r6_jump"];
/// Time from the first estimate in which the filters settle, steps.
const SETTLING: usize = 200;
/// Sensors whose forces are exact enough for all three axes.
const SENSORS: &str = "full-bridge-16bit-bending";
/// Largest root mean square error, as a part of that of the gyros' derivative, which is late and noisy: measured
/// are 0.69 to 0.81.
const PART_OF_GYROS_MAX: f64 = 0.87;

#[test]
fn the_balance_of_moments_tells_the_angular_acceleration_better_than_the_gyros() {
    let vehicle = truth::vehicle();
    let sensors = Sensors::builtin(SENSORS).unwrap();
    let calibration = Calibration::nominal(&vehicle.name);
    for name in EXCERPTS {
        let run = truth::excerpt(name);
        let mut estimator = Estimator::new(vehicle, &sensors, &calibration, Settings::default())
            .unwrap()
            .traced();
        let mut steps = Vec::new();
        for sample in run.samples(SENSORS, 11) {
            estimator.advance(sample.log_time, &mut |output| {
                if let Output::Step(step) = output {
                    steps.push(step);
                }
            });
            estimator.push(sample);
        }
        let steps = &steps[SETTLING..];
        for (axis, column) in ["pdot", "qdot", "rdot"].into_iter().enumerate() {
            let truth = run.column(column);
            let error = |of: fn(&atvrec_estimator::smoother::Step) -> Vector3<f64>| {
                rms(steps
                    .iter()
                    .map(|step| of(step)[axis] - truth[row(&step.estimate)]))
            };
            let [own, gyros] = [
                error(|step| step.rate_dot_rad_s2),
                error(|step| step.solution.rate_dot),
            ];
            let size = rms(steps.iter().map(|step| truth[row(&step.estimate)]));
            testkit::report(&format!(
                "{name}, {column}: rms {size:.2} rad/s2, error {own:.2}, of the gyros' derivative {gyros:.2}"
            ));
            assert!(
                own < PART_OF_GYROS_MAX * gyros,
                "{name}, {column}: {own} {gyros}"
            );
        }
    }
}
