//! A second filter, of other algebra, beside each of the estimator's: a square root of the
//! covariance by orthogonal transformations beside the forces', and points of a cubature on the
//! equations of motion themselves beside the motion's.

mod cubature;
mod square_root;

use atvrec_estimator::fusion::OUTPUTS;
use atvrec_estimator::fusion::layout::SIZE;
use atvrec_estimator::smoother::Step;
use atvrec_estimator::trace::{Operation, Term};
use atvrec_estimator::{Calibration, Estimator, Output, Settings};
use model::sensors::Sensors;
use square_root::SquareRoot;
use testkit::sensing;
use testkit::truth;

/// Largest difference of a state, of its deviation's size, and of a covariance, of the product of
/// both deviations' size: the square root of rounding in all states over hundreds of steps.
const SAME: f64 = 1e-9;
/// Excerpts on level and on rough ground, with the time from which they are compared, s.
const DRIVES: [(&str, f64); 4] = [
    ("c_sine03", 0.0),
    ("f_launch_brake", 4.0),
    ("r2_iso_e_a", 0.0),
    ("r6_jump", 0.0),
];
/// Steps that are compared: the start, settling and driving.
const STEPS: usize = 600;

/// Steps from the start that innovations are not judged in.
const SETTLED: usize = 200;

/// Steps of the estimator on an excerpt, from a time of it.
fn steps(name: &str, first_s: f64) -> Vec<Step> {
    let vehicle = truth::vehicle();
    let sensors = Sensors::builtin("thesis-10bit").unwrap();
    let calibration = Calibration::nominal(&vehicle.name);
    let samples = truth::excerpt(name).samples("thesis-10bit", 1);
    let mut estimator = Estimator::new(vehicle, &sensors, &calibration, Settings::default())
        .unwrap()
        .traced();
    let mut steps = Vec::new();
    let first = sensing::START.offset_seconds(first_s);
    for sample in samples.iter().skip_while(|sample| sample.log_time < first) {
        estimator.advance(sample.log_time, &mut |output| {
            if let Output::Step(step) = output {
                steps.push(*step);
            }
        });
        if steps.len() >= STEPS {
            break;
        }
        estimator.push(sample);
    }
    steps
}

/// Largest differences of states and of covariances between the filter and its second, which is
/// fed with `change` of the filter's operations.
fn differences(steps: &[Step], change: impl Fn(usize, &mut Vec<Operation<SIZE>>)) -> [f64; 2] {
    let mut second = SquareRoot::new(SIZE);
    let mut worst = [0.0_f64; 2];
    for (k, step) in steps.iter().enumerate() {
        let belief = step.forces.as_ref().expect("a force filter");
        let mut operations = belief.operations.clone();
        change(k, &mut operations);
        second.follow(&operations);
        if !second.started() {
            continue;
        }
        let covariance = second.covariance();
        let sigma: Vec<f64> = (0..SIZE).map(|i| covariance[(i, i)].sqrt()).collect();
        for i in 0..SIZE {
            let apart = (belief.state[i] - second.state()[i]).abs() / sigma[i];
            worst[0] = worst[0].max(apart);
            for (row, &j) in OUTPUTS.iter().enumerate() {
                let apart = belief.covariance[(row, i)] - covariance[(j, i)];
                worst[1] = worst[1].max(apart.abs() / (sigma[i] * sigma[j]));
            }
        }
    }
    worst
}

#[test]
fn the_square_root_of_the_force_filter_agrees() {
    for (name, first_s) in DRIVES {
        let steps = steps(name, first_s);
        let count = |wanted: fn(&Operation<SIZE>) -> bool| {
            let beliefs = steps.iter().filter_map(|step| step.forces.as_ref());
            let all = beliefs.flat_map(|belief| &belief.operations);
            all.filter(|operation| wanted(operation)).count()
        };
        let updates = count(|operation| matches!(operation, Operation::Update(_)));
        assert!(updates > 20 * STEPS, "{updates} measurements");
        let found = differences(&steps, |_, _| {});
        eprintln!("{name}: {updates} measurements, states and covariances differ by {found:?}");
        assert!(found.iter().all(|apart| *apart < SAME), "{name}: {found:?}");
    }
}

/// Mean of y^2/S over measurements, one where the filter's noise is the sensors'.
fn normalised_innovation<'a, const N: usize>(
    operations: impl Iterator<Item = &'a Operation<N>>,
) -> f64 {
    let squares = operations.filter_map(|operation| match operation {
        Operation::Update(update) => Some(update.innovation.powi(2) / update.total),
        _ => None,
    });
    let (sum, count) = squares.fold((0.0, 0.0), |(sum, n), square| (sum + square, n + 1.0));
    sum / f64::max(count, 1.0)
}

#[test]
fn innovations_are_no_larger_than_the_filters_say() {
    for (name, first_s) in DRIVES {
        let steps = &steps(name, first_s)[SETTLED..];
        let motion = normalised_innovation(steps.iter().flat_map(|step| &step.operations));
        let beliefs = steps.iter().filter_map(|step| step.forces.as_ref());
        let forces = normalised_innovation(beliefs.flat_map(|belief| &belief.operations));
        eprintln!(
            "{name}: mean square of normalised innovations: motion {motion:.2}, forces {forces:.2}"
        );
        for square in [motion, forces] {
            assert!((0.2..1.3).contains(&square), "{name}: {motion} {forces}");
        }
    }
}

#[test]
fn the_square_root_notices_what_is_wrong_by_a_thousandth() {
    let steps = &steps("c_sine03", 0.0)[..200];
    let noise = differences(steps, |_, operations| {
        for operation in operations {
            if let Operation::Noise(Term { value, .. }) = operation {
                *value *= 1.001;
            }
        }
    });
    let once = differences(steps, |k, operations| {
        if k == 150 {
            operations.retain(|operation| !matches!(operation, Operation::Shift { .. }));
        }
    });
    let row = differences(steps, |_, operations| {
        let updates = operations
            .iter_mut()
            .filter_map(|operation| match operation {
                Operation::Update(update) => Some(update),
                _ => None,
            });
        if let Some(last) = updates.last() {
            last.row[0].1 *= 1.001;
        }
    });
    for found in [noise[0], noise[1], once[0], row[0], row[1]] {
        assert!(found > 10.0 * SAME, "{noise:?} {once:?} {row:?}");
    }
}

#[test]
fn points_on_the_equations_of_motion_agree() {
    // The excerpts on rough ground are too short to forget the start.
    for (name, _) in &DRIVES[..2] {
        let found = cubature::compare(name, 1.0);
        eprintln!(
            "{name}: attitude, velocity and biases differ by {:.3?} deviations at most, deviations \
             by {:.3?}",
            found.apart, found.ratio
        );
        assert!(found.instants > 12, "{} instants", found.instants);
        found.assert_same(name);
        let wrong = cubature::compare(name, 0.99);
        assert!(!wrong.same(), "{name}: gravity off by 1 % was not noticed");
    }
}
