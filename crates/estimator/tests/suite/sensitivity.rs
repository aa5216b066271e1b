//! How much each tuned number matters: the error of the estimate with the number 20 % lower and
//! 20 % higher, over excerpts of truth runs.
//!
//! `make campaigns` measures all numbers and writes `docs/filter-sensitivity.csv`; every test run
//! repeats the most sensitive ones. The seed of the sensors' noise is one that tuning may use (11
//! and above).

use std::fmt::Write;
use std::sync::atomic::{AtomicUsize, Ordering};

use atvrec_estimator::specification::Sensitivity;
use atvrec_estimator::tuning::NumberPath;
use atvrec_estimator::{Calibration, Estimator, Output, Settings, Tuning};
use model::sensors::Sensors;
use model::vehicle::Vehicle;
use sample::{Estimate, Measurement, Sample, Wheel};
use testkit::sensing;
use testkit::truth::{self, RATE_HZ, Run};

const SEED: u64 = 11;
/// Length of an excerpt, and the part at its start that is not judged, s.
const EXCERPT_S: f64 = 12.0;
const START_S: f64 = 3.0;
/// Runs with the start of the excerpt, s, and the time in it from which GNSS is silent, s.
const EXCERPTS: [(&str, f64, f64); 4] = [
    ("c_sine03", 2.0, f64::INFINITY),
    ("c_sine03", 8.0, 8.0),
    ("d_sine_mu", 4.0, f64::INFINITY),
    ("f_launch_brake", 0.0, f64::INFINITY),
];
/// Errors that count as one: of forces, N, and of sideslip, rad.
const FORCE_UNIT_N: f64 = 10.0;
const SIDESLIP_UNIT_RAD: f64 = 0.002;
/// Relative change of a number.
const CHANGE: f64 = 0.2;
/// Numbers that every test run repeats.
const REPEATED: usize = 20;
/// Tolerance of a repeated change, in percentage points, and as a part of it: elementary functions
/// of other C libraries differ in the last bit.
const TOLERANCE_PERCENT: f64 = 0.05;
const TOLERANCE_PART: f64 = 0.05;

struct Excerpt {
    run: &'static Run,
    samples: Vec<Sample>,
    judged_from_s: f64,
}

struct Cases {
    vehicle: &'static Vehicle,
    sensors: Sensors,
    excerpts: Vec<Excerpt>,
}

fn cases() -> Option<Cases> {
    let excerpts = EXCERPTS.map(|(name, start_s, silent_s)| {
        let run = truth::run(name)?;
        let time = |s: f64| sensing::START.offset_seconds(s);
        let (first, last) = (time(start_s), time(start_s + EXCERPT_S));
        let silent = silent_s.is_finite().then(|| time(start_s + silent_s));
        let samples = run.samples("thesis-10bit", SEED).iter().filter(|sample| {
            let gnss = matches!(
                sample.measurement,
                Measurement::GnssVelocity(_) | Measurement::GnssAttitude(_)
            );
            let arrives = !gnss || silent.is_none_or(|silent| sample.log_time < silent);
            (first..last).contains(&sample.log_time) && arrives
        });
        Some(Excerpt {
            samples: samples.cloned().collect(),
            judged_from_s: start_s + START_S,
            run,
        })
    });
    Some(Cases {
        vehicle: truth::vehicle(),
        sensors: Sensors::builtin("thesis-10bit").unwrap(),
        excerpts: excerpts.into_iter().collect::<Option<_>>()?,
    })
}

impl Cases {
    /// Mean error over the excerpts, in the units above; infinite where an estimate is not finite.
    fn error(&self, tuning: Tuning) -> f64 {
        let errors = self.excerpts.iter().map(|excerpt| {
            let settings = Settings {
                tuning,
                ..Settings::default()
            };
            let calibration = Calibration::nominal(&self.vehicle.name);
            let mut estimator =
                Estimator::new(self.vehicle, &self.sensors, &calibration, settings).unwrap();
            let mut sum = Sum::default();
            for sample in &excerpt.samples {
                estimator.advance(sample.log_time, &mut |output| {
                    if let Output::Estimate(estimate) = output {
                        sum.add(excerpt, &estimate);
                    }
                });
                estimator.push(sample);
            }
            sum.error()
        });
        errors.sum::<f64>() / self.excerpts.len() as f64
    }

    /// Changes of the error by each number, on as many threads as the machine has.
    fn sensitivities(&self, numbers: &[NumberPath]) -> Vec<Sensitivity> {
        let base = self.error(Tuning::default());
        let next = AtomicUsize::new(0);
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let work = || {
            let mut found = Vec::new();
            while let Some(number) = numbers.get(next.fetch_add(1, Ordering::Relaxed)) {
                let change_percent =
                    [-CHANGE, CHANGE].map(|change| self.change_percent(number, change, base));
                found.push(Sensitivity {
                    name: number.name.clone(),
                    index: number.index,
                    change_percent,
                });
            }
            found
        };
        std::thread::scope(|scope| {
            let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
            (workers.into_iter())
                .flat_map(|worker| worker.join().unwrap())
                .collect()
        })
    }

    /// Counts change by at least one. A number that cannot change counts as without effect.
    fn change_percent(&self, number: &NumberPath, change: f64, base: f64) -> f64 {
        let moved = number.value * (1.0 + change);
        let whole =
            (number.value + (number.value * change).abs().max(1.0).copysign(change)).round();
        let with = |value| Tuning::default().with(&number.name, number.index, value);
        match with(moved).or_else(|_| with(whole)) {
            Ok(tuning) => 100.0 * (self.error(tuning) / base - 1.0),
            Err(_) => 0.0,
        }
    }
}

/// Squares of errors of one excerpt.
#[derive(Default)]
struct Sum {
    force: f64,
    sideslip: f64,
    count: f64,
}

impl Sum {
    fn add(&mut self, excerpt: &Excerpt, estimate: &Estimate) {
        let time_s = estimate.time.seconds_since(sensing::START);
        let row = (time_s * RATE_HZ).round() as usize;
        let truth = |name: &str| excerpt.run.column(name).get(row).copied();
        let (Some(sideslip), true) = (truth("beta"), time_s >= excerpt.judged_from_s) else {
            return;
        };
        for wheel in Wheel::ALL {
            for (axis, name) in ["Fx", "Fy", "Fz"].into_iter().enumerate() {
                let truth = truth(&format!("{}_{name}", wheel.abbreviation())).unwrap();
                let error = estimate.measured[wheel].force_n[axis] - truth;
                self.force += (error / FORCE_UNIT_N).powi(2) / 12.0;
            }
        }
        if truth("vx_body").unwrap() > 3.0 {
            let error = estimate.motion.sideslip_rad - sideslip;
            self.sideslip += (error / SIDESLIP_UNIT_RAD).powi(2);
        }
        self.count += 1.0;
    }

    fn error(&self) -> f64 {
        let error = 0.5 * ((self.force / self.count).sqrt() + (self.sideslip / self.count).sqrt());
        if error.is_finite() {
            error
        } else {
            f64::INFINITY
        }
    }
}

fn table() -> Vec<Sensitivity> {
    let text = include_str!("../../../../docs/filter-sensitivity.csv");
    Sensitivity::from_csv(text).unwrap()
}

#[test]
fn the_most_sensitive_numbers_have_the_effect_that_the_specification_states() {
    let Some(cases) = cases() else { return };
    let all = Tuning::default().numbers();
    let stated: Vec<Sensitivity> = table().into_iter().take(REPEATED).collect();
    assert_eq!(stated.len(), REPEATED, "run `make campaigns` first");
    let number = |row: &Sensitivity| {
        let found = all
            .iter()
            .find(|n| n.name == row.name && n.index == row.index);
        found
            .cloned()
            .unwrap_or_else(|| panic!("{} is not in Tuning", row.name))
    };
    let numbers: Vec<NumberPath> = stated.iter().map(number).collect();
    let mut wrong = Vec::new();
    for found in cases.sensitivities(&numbers) {
        let row = (stated.iter()).find(|row| row.name == found.name && row.index == found.index);
        let row = row.expect("only stated numbers were asked for");
        let pairs = || found.change_percent.into_iter().zip(row.change_percent);
        let is_near = |(found_percent, stated_percent): (f64, f64)| {
            let most = TOLERANCE_PERCENT + TOLERANCE_PART * stated_percent.abs();
            (found_percent - stated_percent).abs() <= most || found_percent == stated_percent
        };
        if !pairs().all(is_near) {
            wrong.push(format!(
                "{}[{}]: the error changes by {:.3?} %, the table states {:.3?} %",
                found.name, found.index, found.change_percent, row.change_percent
            ));
        }
    }
    assert!(
        wrong.is_empty(),
        "{}; run `make campaigns` and `make bless`",
        wrong.join("; ")
    );
}

#[test]
#[ignore = "minutes; `make campaigns` runs it and writes docs/filter-sensitivity.csv"]
fn campaign() {
    let Some(cases) = cases() else { return };
    let mut rows = cases.sensitivities(&Tuning::default().numbers());
    rows.sort_by(|a, b| {
        let order = b.largest_percent().total_cmp(&a.largest_percent());
        order.then_with(|| (&a.name, a.index).cmp(&(&b.name, b.index)))
    });
    let mut text = "name,index,less_percent,more_percent\n".to_owned();
    for Sensitivity {
        name,
        index,
        change_percent: [less, more],
    } in &rows
    {
        writeln!(text, "{name},{index},{less:.3},{more:.3}").unwrap();
    }
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../docs/filter-sensitivity.csv"
    );
    std::fs::write(path, text).unwrap();
}
