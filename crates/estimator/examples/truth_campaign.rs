//! The fusion filter over truth runs, sensors files and seeds: errors, consistency of the stated
//! deviations, events; and the same over the virtual vehicle's manoeuvres and MINUTES (ten) of its
//! mixed driving.
//!
//! `cargo run --example truth_campaign -- [SEEDS] [SENSORS...]`

#![allow(clippy::disallowed_methods, reason = "it takes arguments")]
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's helpers stand outside its functions"
)]

#[path = "../tests/truth/deviations.rs"]
mod deviations;
#[path = "../tests/truth/drive.rs"]
mod drive;
#[path = "../tests/truth/judge.rs"]
mod judge;
#[path = "../tests/truth/run.rs"]
mod run;
#[path = "../tests/truth/sensing.rs"]
mod sensing;

use atvrec_estimator::{Calibration, Settings};
use deviations::deviations;
use judge::{estimate, force_errors, motion_errors};
use model::sensors::Sensors;
use model::vehicle::Vehicle;
use run::Run;
use sim::Manoeuvre;

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
    if run::directory().is_none() {
        return Ok(());
    }
    let mut arguments = std::env::args().skip(1);
    let seeds: u64 = arguments.next().map_or(Ok(1), |text| text.parse())?;
    let mut files: Vec<String> = arguments.collect();
    if files.is_empty() {
        files = FILES.map(str::to_owned).into();
    }
    let minutes = std::env::var("MINUTES").map_or(Ok(10.0), |text| text.parse())?;
    let mut runs: Vec<(&str, Vehicle, Run)> = RUNS
        .map(|name| (name, run::vehicle(), Run::load(name)))
        .into();
    for manoeuvre in MANOEUVRES.into_iter().filter(|_| minutes > 0.0) {
        let prowler = Vehicle::builtin("prowler")?;
        let span_s = match manoeuvre {
            Manoeuvre::MixedDriving => 60.0 * minutes,
            _ => 0.0,
        };
        let drive = drive::virtual_drive(&prowler, manoeuvre, span_s);
        runs.push((manoeuvre.name(), prowler, drive));
    }
    let mut surprise = 0.0;
    for file in &files {
        let sensors = Sensors::builtin(file)?;
        for (name, vehicle, run) in &runs {
            let calibration = Calibration::nominal(&vehicle.name);
            for seed in 1..=seeds {
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
