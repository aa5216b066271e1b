//! Seeded drives with random faults of random channels: the estimator stays finite while they last
//! and finds back when they are over.
//!
//! `make campaigns` runs a thousand, [`BOUNDED`] of them are part of `make test-all`. The drives of
//! `campaign/rough.rs` are on rough ground.

mod rough;

use atvrec_estimator::{Calibration, Estimator, Output, Settings};
use model::sensors::Sensors;
use model::vehicle::Vehicle;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sample::{Estimate, EventKind, LogTime, Sample, Wheel};
use testkit::scoring::{rms, row};
use testkit::sensing;
use testkit::truth::{self, RATE_HZ, Run};

use crate::RUNS;
use crate::fault::{self, Fault};

/// Drives of the bounded campaign and of the whole one.
const BOUNDED: u64 = 20;
const WHOLE: u64 = 1000;
/// Seeds of the sensors' noise for each run.
const NOISES: [u64; 4] = [11, 12, 13, 14];
/// Drives with a heading that hangs, a gyro that is saturated, and roll rates that are late or another
/// channel's, for up to four seconds; with both receivers or gyro and steering wheel wrong at once (407,
/// 908), with accelerometers that are late, silent or swapped while strain or GNSS is wrong, too (447,
/// 653, 992), with a gyro that reads another axis for a moment (511), a start from standstill whose
/// heading is not known at once (163), a steering wheel that dies in a bend (297, 818), accelerometers that
/// are swapped on a sine and so agree now and then (312, 400), and a potentiometer that is frozen and
/// makes the loads seem to need a jack (828).
const HARD: [u64; 17] = [
    163, 297, 312, 400, 407, 447, 511, 631, 653, 677, 745, 818, 828, 843, 899, 908, 992,
];

/// Drives on one kind of ground.
struct Ground {
    runs: &'static [&'static str],
    run: fn(&str) -> Option<&'static Run>,
    /// Length of a drive, s.
    drive_s: f64,
    /// When faults may begin and must have ended, s.
    faults_s: [f64; 2],
    /// From when on the estimates must be good again, s.
    recovered_s: f64,
    /// RMS errors after the faults of an estimate that is not yet back: of forces, of max(peak of the run,
    /// static load), per cent, and of sideslip, degrees.
    late: [f64; 2],
    /// Whether forces are compared in the wheel-carrier frame: on rough ground, no sensor measures the
    /// contact frame.
    in_carrier: bool,
}

const LEVEL: Ground = Ground {
    runs: &RUNS,
    run: truth::run,
    drive_s: 12.0,
    faults_s: [2.5, 7.0],
    recovered_s: 10.0,
    // Drive 992 has 5.4 %: late strain and late accelerations at once make a potentiometer suspect.
    late: [6.0, 0.5],
    in_carrier: false,
};
/// Most faults of a drive.
const FAULTS_MAX: usize = 4;

/// What no vehicle of this size can have, N and rad/s: an estimate beyond it has diverged, even
/// while channels are spoilt.
const FORCE_MAX_N: f64 = 30e3;
/// RMS errors after the faults of an estimate that has diverged, as [`Ground::late`].
const DIVERGED: [f64; 2] = [50.0, 20.0];
/// Largest part of the drives that may be late.
const LATE_MAX: f64 = 0.002;
/// Speed above which sideslip counts, m/s.
const MOVING_M_S: f64 = 3.0;

/// A truth run and what its sensors read, once for each draw of noise.
struct Drive {
    run: &'static Run,
    samples: Vec<&'static [Sample]>,
}

/// What became of a drive.
#[derive(Debug, Default)]
struct Outcome {
    /// Largest RMS error of a force after recovery, per cent, and of sideslip, degrees.
    force_percent: f64,
    sideslip_deg: f64,
    finite: bool,
    largest_n: f64,
    resets: usize,
    late: bool,
    /// Names of the channels that were excluded, with the time from the start of the run, s.
    excluded: Vec<(f64, String)>,
    faults: Vec<Fault>,
    /// Seed of the drive.
    seed: u64,
}

impl Outcome {
    fn diverged(&self) -> bool {
        !self.finite || self.largest_n > FORCE_MAX_N || self.is_beyond(DIVERGED)
    }

    fn is_beyond(&self, [force_percent, sideslip_deg]: [f64; 2]) -> bool {
        self.force_percent > force_percent || self.sideslip_deg > sideslip_deg
    }
}

#[test]
fn a_few_drives_with_random_faults_do_not_diverge() {
    let Some(outcomes) = campaign(&LEVEL, &Vec::from_iter(0..BOUNDED)) else {
        return;
    };
    judge_all(&outcomes);
}

#[test]
#[ignore = "a campaign of minutes: `make campaigns`"]
fn a_thousand_drives_with_random_faults_do_not_diverge() {
    let Some(outcomes) = campaign(&LEVEL, &Vec::from_iter(0..WHOLE)) else {
        return;
    };
    judge_all(&outcomes);
}

/// A heading that is adopted although it hangs, a balance of moments that runs away without struts or
/// the gyro to hold it, one that counts for too short a time, a state that counts as consistent before
/// GNSS has confirmed it, a steering wheel that is followed although it jumps, an accelerometer that is
/// good again after a moment's agreement, or a jack under a vehicle that moves, is late in one of
/// these.
#[test]
fn hard_drives_are_survived() {
    let Some(outcomes) = campaign(&LEVEL, &HARD) else {
        return;
    };
    assert_eq!(outcomes.len(), HARD.len());
    assert!(outcomes.iter().all(|outcome| !outcome.late));
}

/// What became of the drives with these seeds; `None` without the truth runs.
fn campaign(ground: &Ground, seeds: &[u64]) -> Option<Vec<Outcome>> {
    let vehicle = truth::vehicle();
    let sensors = Sensors::builtin("thesis-10bit").unwrap();
    let drives = ground.runs.iter().map(|name| {
        let run = (ground.run)(name)?;
        let samples = NOISES.map(|seed| run.samples("thesis-10bit", seed)).into();
        Some(Drive { run, samples })
    });
    let drives: Vec<Drive> = drives.collect::<Option<_>>()?;
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get());
    let outcomes = std::thread::scope(|scope| {
        let (drives, sensors) = (&drives, &sensors);
        let workers = (0..threads).map(|worker| {
            scope.spawn(move || {
                let seeds = seeds.iter().skip(worker).step_by(threads);
                seeds
                    .map(|seed| drive(ground, *seed, drives, vehicle, sensors))
                    .collect::<Vec<_>>()
            })
        });
        let workers: Vec<_> = workers.collect();
        workers
            .into_iter()
            .flat_map(|worker| worker.join().unwrap())
            .collect()
    });
    Some(outcomes)
}

fn judge_all(outcomes: &[Outcome]) {
    assert!(!outcomes.is_empty());
    tell(outcomes);
    let diverged = outcomes.iter().filter(|outcome| outcome.diverged()).count();
    let late = outcomes.iter().filter(|outcome| outcome.late).count();
    let count = outcomes.len();
    assert_eq!(diverged, 0, "of {count} drives");
    assert!(
        late as f64 <= LATE_MAX * count as f64,
        "{late} of {count} drives are late"
    );
}

fn tell(outcomes: &[Outcome]) {
    let percentiles = |value: fn(&Outcome) -> f64| {
        let mut all: Vec<f64> = outcomes.iter().map(value).collect();
        all.sort_by(f64::total_cmp);
        [0.5, 0.99, 1.0].map(|part| all[((all.len() - 1) as f64 * part) as usize])
    };
    eprintln!(
        "{} drives; after recovery median, 99th percentile and worst of forces {:.2?} %, sideslip \
         {:.3?} deg; largest force {:.0?} N; {} resets",
        outcomes.len(),
        percentiles(|outcome| outcome.force_percent),
        percentiles(|outcome| outcome.sideslip_deg),
        percentiles(|outcome| outcome.largest_n),
        outcomes.iter().map(|outcome| outcome.resets).sum::<usize>(),
    );
}

fn drive(
    ground: &Ground,
    seed: u64,
    drives: &[Drive],
    vehicle: &Vehicle,
    sensors: &Sensors,
) -> Outcome {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let drive = &drives[rng.random_range(0..drives.len())];
    let noise = rng.random_range(0..drive.samples.len());
    let length_s = (drive.run.rows - 1) as f64 / RATE_HZ;
    let start_s = rng.random_range(0.0..length_s - ground.drive_s);
    let faults: Vec<Fault> = (0..rng.random_range(1..=FAULTS_MAX))
        .map(|_| Fault::draw(&mut rng, ground.faults_s.map(|s| start_s + s)))
        .collect();
    let time = |s: f64| sensing::START.offset_seconds(s);
    let [first, last] = [start_s, start_s + ground.drive_s].map(time);
    let samples = drive.samples[noise].iter();
    let samples = samples.filter(|sample| (first..last).contains(&sample.log_time));
    let samples = fault::spoil(samples.cloned().collect(), &faults, &mut rng);
    let recovered = time(start_s + ground.recovered_s);
    let (mut outcome, good) = estimate(vehicle, sensors, &samples, recovered);
    compare(ground, drive.run, vehicle, &good, &mut outcome);
    outcome.late = outcome.is_beyond(ground.late);
    if outcome.diverged() || outcome.late {
        eprintln!(
            "seed {seed}, {} from {start_s:.2} s: {outcome:.2?}",
            drive.run.name
        );
        for fault in &faults {
            eprintln!("    {fault:.2?}");
        }
    }
    (outcome.faults, outcome.seed) = (faults, seed);
    outcome
}

/// What became of a drive, and its estimates after the faults.
fn estimate(
    vehicle: &Vehicle,
    sensors: &Sensors,
    samples: &[Sample],
    recovered: LogTime,
) -> (Outcome, Vec<Estimate>) {
    let calibration = Calibration::nominal(&vehicle.name);
    let mut estimator =
        Estimator::new(vehicle, sensors, &calibration, Settings::default()).unwrap();
    let mut outcome = Outcome {
        finite: true,
        ..Outcome::default()
    };
    let mut good = Vec::new();
    for sample in samples {
        estimator.advance(sample.log_time, &mut |output| match output {
            Output::Estimate(estimate) => {
                watch(&estimate, &mut outcome);
                if estimate.time >= recovered {
                    good.push(estimate);
                }
            }
            Output::Event(event) => {
                outcome.resets += usize::from(event.kind == EventKind::FilterReset);
                if let EventKind::SensorFault(name) = event.kind {
                    let at_s = event.time.seconds_since(sensing::START);
                    outcome.excluded.push((at_s, name));
                }
            }
            Output::Lagged(_)
            | Output::LaggedRoad(_)
            | Output::Limits(_)
            | Output::Road(_)
            | Output::Parameters(_)
            | Output::Step(_)
            | Output::Terrain(_) => {}
        });
        estimator.push(sample);
    }
    assert!(good.len() > 100, "{} estimates after recovery", good.len());
    (outcome, good)
}

/// Takes note of what no estimate may be.
fn watch(estimate: &Estimate, outcome: &mut Outcome) {
    let motion = &estimate.motion;
    let velocity = [
        motion.velocity_x_m_s,
        motion.velocity_y_m_s,
        motion.sideslip_rad,
    ];
    let attitude = [motion.roll_rad, motion.pitch_rad];
    let mut numbers = velocity
        .into_iter()
        .chain(attitude)
        .chain(motion.rate_rad_s);
    outcome.finite &= numbers.all(f64::is_finite);
    for force in &estimate.measured.0 {
        for (value, sigma) in force.force_n.iter().zip(force.sigma_n) {
            outcome.finite &= value.is_finite() && sigma.is_finite() && sigma > 0.0;
            outcome.largest_n = outcome.largest_n.max(value.abs());
        }
    }
}

/// Errors of the estimates against the truth.
fn compare(
    ground: &Ground,
    run: &Run,
    vehicle: &Vehicle,
    estimates: &[Estimate],
    outcome: &mut Outcome,
) {
    let quarter_n = 0.25 * vehicle.body.mass_kg * sample::STANDARD_GRAVITY_M_S2;
    for wheel in Wheel::ALL {
        for (axis, name) in ["Fx", "Fy", "Fz"].into_iter().enumerate() {
            let truth = run.column(&format!("{}_{name}", wheel.abbreviation()));
            let peak = truth
                .iter()
                .fold(quarter_n, |peak, force| peak.max(force.abs()));
            let error = |e: &Estimate| {
                if ground.in_carrier {
                    let true_n = run.carrier_forces(row(e))[wheel.index()][axis];
                    e.carrier[wheel].force_n[axis] - true_n
                } else {
                    e.measured[wheel].force_n[axis] - truth[row(e)]
                }
            };
            let percent = 100.0 / peak * rms(estimates.iter().map(error));
            outcome.force_percent = outcome.force_percent.max(percent);
        }
    }
    let [beta, speed] = ["beta", "vx_body"].map(|name| run.column(name));
    let moving = estimates.iter().filter(|e| speed[row(e)] > MOVING_M_S);
    let error = |e: &Estimate| (e.motion.sideslip_rad - beta[row(e)]).to_degrees();
    outcome.sideslip_deg = rms(moving.map(error));
}
