//! Messages whose latencies are not known: the drive tells them, and the forces are as good as with known ones.

use atvrec_estimator::{Calibration, Estimator, LatencyEstimate, LatencyPrior, Output, Settings};
use model::sensors::Sensors;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sample::{Estimate, Measurement, Sample, StrainChannel, Wheel};
use testkit::truth::Run;
use testkit::{report, scoring, sensing, truth};

/// Messages: two of each corner as in `prowler.dbc`, steering wheel, wheel speeds.
const MESSAGES: usize = 10;
/// Axial channels of the first message of a corner.
const FIRST: usize = 4;
/// Largest latency, s.
const LATENCY_MAX_S: f64 = 0.005;
/// Mean and standard deviation of a latency that is anywhere between zero and the largest one, s.
const PRIOR_S: [f64; 2] = [0.0025, 0.001_443];

/// What is configured.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Configured {
    /// The true latencies.
    Known,
    /// The mean of all, as if that were the truth.
    Mean,
    /// The mean of all with its standard deviation.
    Prior,
}

/// What came out of a drive.
struct Outcome {
    estimates: Vec<Estimate>,
    lagged: Vec<Estimate>,
    latencies: Vec<LatencyEstimate>,
    true_s: [f64; MESSAGES],
    faults: Vec<String>,
}

fn message_of(measurement: &Measurement) -> Option<usize> {
    Some(match measurement {
        Measurement::Corner(corner) => {
            let second = usize::from(corner.strain_counts[0].is_none());
            2 * corner.wheel.index() + second
        }
        Measurement::Steer(_) => 8,
        Measurement::WheelSpeed(_) => 9,
        _ => return None,
    })
}

/// The messages of a sample: that of a corner are two.
fn split(sample: &Sample) -> Vec<Sample> {
    let Measurement::Corner(corner) = &sample.measurement else {
        return vec![sample.clone()];
    };
    let [mut first, mut second] = [*corner; 2];
    first.deflection_counts = None;
    for channel in StrainChannel::ALL {
        let i = channel.index();
        let other = if i < FIRST { &mut second } else { &mut first };
        other.strain_counts[i] = None;
    }
    [first, second]
        .map(|corner| Sample {
            measurement: Measurement::Corner(corner),
            ..sample.clone()
        })
        .into()
}

fn drive(run: &Run, sensors_name: &str, seed: u64, configured: Configured) -> Outcome {
    let vehicle = truth::vehicle();
    let sensors = Sensors::builtin(sensors_name).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(1_000 + seed);
    let true_s: [f64; MESSAGES] = std::array::from_fn(|_| random.random_range(0.0..LATENCY_MAX_S));
    let made = sensing::samples(run, vehicle, &sensors, seed);
    let mut samples: Vec<(Sample, Option<usize>)> = made
        .iter()
        .flat_map(split)
        .map(|mut sample| {
            let message = message_of(&sample.measurement);
            if let Some(at) = message {
                let sampled = sample.valid_time;
                sample.log_time = sampled.offset_seconds(true_s[at]);
                if configured != Configured::Known {
                    sample.valid_time = sample.log_time.offset_seconds(-PRIOR_S[0]);
                }
            }
            (sample, message)
        })
        .collect();
    samples.sort_by_key(|(sample, _)| sample.log_time);
    let calibration = Calibration::nominal(&vehicle.name);
    let priors = (0..MESSAGES).map(|at| LatencyPrior {
        name: format!("can0.{at}"),
        latency_s: PRIOR_S[0],
        sigma_s: PRIOR_S[1],
    });
    let mut estimator =
        Estimator::new(vehicle, &sensors, &calibration, Settings::default()).unwrap();
    if configured == Configured::Prior {
        estimator = estimator.with_latencies(priors.collect());
    }
    let mut outcome = Outcome {
        estimates: Vec::new(),
        lagged: Vec::new(),
        latencies: Vec::new(),
        true_s,
        faults: Vec::new(),
    };
    for (sample, message) in &samples {
        estimator.advance(sample.log_time, &mut |output| match output {
            Output::Estimate(estimate) => outcome.estimates.push(estimate),
            Output::Lagged(estimate) => outcome.lagged.push(estimate),
            Output::Event(event) => {
                if let sample::EventKind::SensorFault(name) = event.kind {
                    outcome.faults.push(name);
                }
            }
            _ => {}
        });
        estimator.push_of(sample, *message);
    }
    outcome.latencies = estimator.latencies();
    outcome
}

impl Outcome {
    /// Estimates from a time on, s.
    fn from_s(estimates: &[Estimate], from_s: f64) -> Vec<Estimate> {
        let late = |e: &&Estimate| e.time.seconds_since(sensing::START) > from_s;
        estimates.iter().filter(late).cloned().collect()
    }

    /// Error of each latency of the corners' messages, s, with its standard deviation.
    fn latency_errors(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        let known = self.latencies.iter().zip(self.true_s).take(8);
        known.map(|(found, true_s)| [found.latency_s - true_s, found.sigma_s])
    }
}

fn three(values: [f64; 3]) -> String {
    format!("{:.2} {:.2} {:.2}", values[0], values[1], values[2])
}

/// One line of the table: errors, causal and lagged, and mean squares of them over the standard deviations.
fn line(run: &Run, outcome: &Outcome, from_s: f64) -> ([[f64; 3]; 2], [[f64; 3]; 2]) {
    let vehicle = truth::vehicle();
    let both = [&outcome.estimates, &outcome.lagged].map(|all| Outcome::from_s(all, from_s));
    (
        both.each_ref()
            .map(|all| scoring::carrier_errors(run, vehicle, all)),
        both.each_ref()
            .map(|all| scoring::carrier_squares(run, all)),
    )
}

/// Prints what a tuning needs.
#[test]
#[ignore = "for tuning, with seeds from 11"]
fn explore_latencies() {
    let seeds = std::env::var("SEEDS").unwrap_or_else(|_| "11".to_owned());
    let sets = std::env::var("SENSORS").unwrap_or_else(|_| "full-bridge-16bit".to_owned());
    let runs = [truth::run("c_sine03"), truth::rough_run("r1_iso_c_a")];
    for run in runs.into_iter().flatten() {
        for sensors in sets.split(',') {
            for seed in seeds.split(',').map(|seed| seed.parse().unwrap()) {
                for configured in [Configured::Known, Configured::Mean, Configured::Prior] {
                    let outcome = drive(run, sensors, seed, configured);
                    for from_s in [3.0, 15.0] {
                        let (errors, squares) = line(run, &outcome, from_s);
                        report(&format!(
                            "{} {sensors} {seed} {configured:?} from {from_s}: causal {} | {}; lagged {} | {}; {:?}",
                            run.name,
                            three(errors[0]),
                            three(squares[0]),
                            three(errors[1]),
                            three(squares[1]),
                            outcome.faults,
                        ));
                    }
                    for [error_s, sigma_s] in outcome.latency_errors() {
                        report(&format!(
                            "    {:.3} ± {:.3} ms",
                            1e3 * error_s,
                            1e3 * sigma_s
                        ));
                    }
                }
            }
        }
    }
}
