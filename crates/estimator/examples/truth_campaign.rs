//! The fusion filter over truth runs, sensors files and seeds: errors, consistency of the stated
//! deviations, events; and the same over the virtual vehicle's manoeuvres and MINUTES (ten) of its
//! mixed driving.
//!
//! `cargo run --example truth_campaign -- [SEEDS] [SENSORS...]`
//!
//! SEEDS is a range: `1-4` for scoring, `11-14` for tuning.

#![allow(clippy::disallowed_methods, reason = "it takes arguments")]

use atvrec_estimator::{Calibration, Settings};
use model::sensors::Sensors;
use model::vehicle::Vehicle;
use sim::Manoeuvre;
use testkit::drive::virtual_drive;
use testkit::scoring::{deviations, estimate, force_errors, motion_errors};
use testkit::sensing;
use testkit::truth::{self, Run};

const RUNS: [&str; 5] = [
    "b_circle",
    "c_sine03",
    "d_sine_mu",
    "f_launch_brake",
    "h_jack",
];

const MANOEUVRES: [Manoeuvre; 8] = [
    Manoeuvre::Circle,
    Manoeuvre::SlowSine,
    Manoeuvre::FastSine,
    Manoeuvre::StepSteer,
    Manoeuvre::AsphaltToGravel,
    Manoeuvre::LaunchBrake,
    Manoeuvre::Hillside,
    Manoeuvre::MixedDriving,
];

const FILES: [&str; 3] = [
    "thesis-10bit",
    "full-bridge-16bit",
    "full-bridge-16bit-bending",
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let seeds = seeds(&arguments.next().unwrap_or_else(|| "1-1".to_owned()))
        .ok_or("the first argument is a range of seeds, such as 11-14")?;
    let mut files: Vec<String> = arguments.collect();
    if files.is_empty() {
        files = FILES.map(str::to_owned).into();
    }
    let minutes = std::env::var("MINUTES").map_or(Ok(10.0), |text| text.parse())?;
    let mut runs: Vec<(&str, Vehicle, Run)> = Vec::new();
    for name in RUNS {
        let run = truth::run(name).ok_or("the truth runs are needed")?;
        runs.push((name, truth::vehicle().clone(), run.clone()));
    }
    for manoeuvre in MANOEUVRES.into_iter().filter(|_| minutes > 0.0) {
        let prowler = Vehicle::builtin("prowler")?;
        let span_s = match manoeuvre {
            Manoeuvre::MixedDriving => 60.0 * minutes,
            _ => 0.0,
        };
        let drive = virtual_drive(&prowler, manoeuvre, span_s);
        runs.push((manoeuvre.name(), prowler, drive));
    }
    let mut surprise = 0.0;
    for file in &files {
        let sensors = Sensors::builtin(file)?;
        for (name, vehicle, run) in &runs {
            let calibration = Calibration::nominal(&vehicle.name);
            for seed in seeds.clone() {
                let samples = sensing::samples(run, vehicle, &sensors, seed);
                let settings = Settings::default();
                let result = estimate(vehicle, &sensors, &calibration, settings, &samples);
                let force = force_errors(run, vehicle, &result);
                let motion = motion_errors(run, &result);
                let found = deviations(run, &result);
                let all = &found.all;
                println!(
                    "{file:25} {name:17} {seed:2}: {force:4.2?} %, motion {motion:.3?} deg, NEES \
                     {:.2?}, {:3.0} % of {} windows inside, {:.0} % above ({:.0} dof, {:.2?}), \
                     surprise {:.3?}",
                    found.axes,
                    100.0 * all.inside,
                    all.windows,
                    100.0 * all.above,
                    all.freedom,
                    all.bounds,
                    found.surprise,
                );
                surprise += found.surprise.iter().sum::<f64>();
                for event in &result.events {
                    let time_s = event.time.seconds_since(sensing::START);
                    let chance = event.probability.unwrap_or(f64::NAN);
                    println!(
                        "    {time_s:.2} s: {} (probability {chance:.3})",
                        event.text
                    );
                }
            }
        }
    }
    println!("surprise in all {surprise:.3}");
    Ok(())
}

/// First and last seed.
fn seeds(text: &str) -> Option<std::ops::RangeInclusive<u64>> {
    let (first, last) = text.split_once('-')?;
    Some(first.parse().ok()?..=last.parse().ok()?)
}
