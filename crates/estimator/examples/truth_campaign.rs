//! The fusion filter over truth runs, sensors files and seeds: errors, consistency, events.
//!
//! `cargo run --example truth_campaign -- [SEEDS] [SENSORS...]`

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's helpers stand outside its functions"
)]

#[path = "../tests/truth/judge.rs"]
mod judge;
#[path = "../tests/truth/run.rs"]
mod run;
#[path = "../tests/truth/sensing.rs"]
mod sensing;

use estimator::{Calibration, Settings};
use judge::{estimate, force_errors, motion_errors};
use model::sensors::Sensors;
use run::Run;
use sample::{EventKind, Wheel};

const RUNS: [&str; 5] = [
    "b_circle",
    "c_sine03",
    "d_sine_mu",
    "f_launch_brake",
    "h_jack",
];

fn main() {
    if run::directory().is_none() {
        return;
    }
    let mut arguments = std::env::args().skip(1);
    let seeds: u64 = arguments.next().map_or(1, |text| text.parse().unwrap());
    let mut files: Vec<String> = arguments.collect();
    if files.is_empty() {
        files = vec!["thesis-10bit".to_owned()];
    }
    let vehicle = run::vehicle();
    let calibration = Calibration::nominal(&vehicle.name);
    let only = std::env::var("RUNS").unwrap_or_default();
    let runs: Vec<(&str, Run)> = RUNS
        .into_iter()
        .filter(|name| only.is_empty() || only.contains(&name[..1]))
        .map(|name| (name, Run::load(name)))
        .collect();
    let mut total = [0.0; 4];
    for file in &files {
        let mut sensors = Sensors::builtin(file).unwrap();
        if std::env::var("PERFECT").is_ok() {
            sensors.deflection.adc_bits = 16;
        }
        for (name, run) in &runs {
            for seed in 1..=seeds {
                let samples = sensing::samples(run, &vehicle, &sensors, seed);
                let result = estimate(
                    &vehicle,
                    &sensors,
                    &calibration,
                    Settings::default(),
                    &samples,
                );
                let force = force_errors(run, &vehicle, &result);
                let motion = motion_errors(run, &result);
                let consistency = judge::consistency_of(run, &result);
                let all = &consistency.all;
                println!(
                    "{file:26} {name:15} {seed:2} {force:5.2?} % motion {motion:.3?} NEES {:.2?} \
                     inside {:3.0} % above {:3.0} % of {} (dof {:.1} {:.2?}) surprise {:.3?}",
                    consistency.axes,
                    100.0 * all.inside,
                    100.0 * all.above,
                    all.windows,
                    all.freedom,
                    all.bounds,
                    consistency.surprise,
                );
                for (sum, part) in total.iter_mut().zip(consistency.surprise) {
                    *sum += part;
                }
                total[3] += force.iter().sum::<f64>();
                for event in &result.events {
                    println!(
                        "    {:.2} s {}",
                        event.time.seconds_since(sensing::START),
                        event.text
                    );
                }
                if let Ok(what) = std::env::var("DUMP") {
                    let axis = usize::from(what.as_bytes()[3] - b'x');
                    let wheel = Wheel::ALL
                        .into_iter()
                        .find(|w| w.abbreviation() == &what[..2])
                        .unwrap();
                    let truth = run.column(&format!("{}_F{}", &what[..2], &what[3..]));
                    for e in &result.estimates {
                        let row = judge::row(e);
                        if row < truth.len() {
                            let f = &e.measured[wheel];
                            println!(
                                "DUMP {:.3} {:.1} {:.1} {:.1}",
                                row as f64 / 200.0,
                                truth[row],
                                f.force_n[axis],
                                f.sigma_n[axis]
                            );
                        }
                    }
                }
                let _ = &EventKind::FilterReset;
            }
        }
    }
    println!(
        "TOTAL surprise {:.3} ({total:.3?})",
        total[..3].iter().sum::<f64>()
    );
}
