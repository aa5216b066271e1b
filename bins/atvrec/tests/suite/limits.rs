//! `/estimate/limits` on runs of an independent simulator's second vehicle that reach its limit.

use std::path::Path;

use sample::{Limits, LogTime};
use store::{Reader, Record, Selection, Stage};

use crate::support::atvrec;

/// Runs on flat ground of one friction. The circle has the largest steady lateral acceleration.
const RUNS: [&str; 3] = ["f3_circle_a", "f1_slalom_a", "f2_step_a"];
/// Windows in which a bound is judged, s, and the first seconds, which are not.
const WINDOW_S: f64 = 1.0;
const FROM_S: f64 = 4.0;
/// Least part of the windows in which the bound must hold.
const HOLDS_MIN: f64 = 0.95;
/// Distance from the truth as a part of the largest acceleration, and the least part of the windows above 0.6 of the
/// grip in which the bound is nearer: the friction of this vehicle's tyres is learnt late.
const NEAR_MIN: f64 = 0.45;
const NEAR: f64 = 0.2;
const USED_MIN: f64 = 0.6;

/// Limits, and true lateral accelerations along flat ground with their times, m/s^2.
fn read(directory: &Path) -> (Vec<Limits>, Vec<(LogTime, f64)>) {
    let reader = Reader::open([directory.join("drive.mcap")]).expect("the log opens");
    let topics = Selection::topics(["/estimate/limits", "/truth/motion"]);
    let (mut limits, mut lateral) = (Vec::new(), Vec::new());
    for message in reader.messages(topics) {
        match message.expect("a message").record().expect("a record") {
            Some(Record::Limits(found)) => limits.push(*found),
            Some(Record::Motion {
                time,
                stage: Stage::Truth,
                motion,
            }) => {
                let [_, y, z] = motion.acceleration_m_s2;
                let (sine, cosine) = math::sin_cos(motion.roll_rad);
                lateral.push((time, y * cosine - z * sine));
            }
            _ => {}
        }
    }
    (limits, lateral)
}

/// Mean over a window; `NaN` without values.
fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / count
}

#[test]
fn the_bound_of_the_limits_holds_on_runs_to_the_limit() {
    score(&[1]);
}

#[test]
#[ignore = "the seeds that are scored: `make campaigns`"]
fn campaign_of_scored_seeds() {
    score(&[1, 2, 3, 4]);
}

fn score(seeds: &[u32]) {
    let (mut reachable, mut windows, mut holds, mut used, mut near) = (0.0, 0, 0, 0, 0);
    let drives = RUNS
        .iter()
        .flat_map(|run| seeds.iter().map(|seed| (*run, *seed)));
    for (number, (run, seed)) in drives.enumerate() {
        let Some(truth) = testkit::shared(&format!("data/truth-second/{run}.parquet")) else {
            return;
        };
        let directory = tempfile::tempdir().expect("a directory");
        atvrec(directory.path())
            .args(["simulate", "--output", "drive.mcap"])
            .arg("--truth")
            .arg(&truth)
            .args(["--vehicle", "second-vehicle"])
            .args(["--sensors", "second-vehicle-10bit"])
            .args(["--seed", &seed.to_string()])
            .assert()
            .success();
        let (limits, lateral) = read(directory.path());
        let start = lateral.first().expect("a truth").0;
        let seconds = |time: LogTime| time.seconds_since(start);
        let length_s = lateral.last().map_or(0.0, |(time, _)| seconds(*time));
        let all: Vec<f64> = (FROM_S as u32..length_s as u32).map(f64::from).collect();
        let within =
            |time: LogTime, from_s: f64| (from_s..from_s + WINDOW_S).contains(&seconds(time));
        let lateral_in = |from_s: f64| {
            let inside = lateral
                .iter()
                .filter(move |(time, _)| within(*time, from_s));
            inside.map(|(_, value)| *value)
        };
        if number == 0 {
            let means = all.iter().map(|from_s| mean(lateral_in(*from_s)).abs());
            reachable = means.fold(0.0, f64::max);
        }
        for from_s in all {
            let inside: Vec<&Limits> = limits
                .iter()
                .filter(|found| within(found.time, from_s))
                .collect();
            let left = mean(lateral_in(from_s).map(|a| (reachable - a.abs()).max(0.0)));
            let bound = mean(inside.iter().map(|found| found.lateral_m_s2.at_least));
            if !bound.is_finite() {
                continue;
            }
            windows += 1;
            holds += usize::from(bound <= left);
            if mean(inside.iter().map(|found| found.grip_used)) > USED_MIN {
                used += 1;
                near += usize::from((bound - left).abs() <= NEAR * reachable);
            }
            if bound > left || (bound - left).abs() > NEAR * reachable {
                println!(
                    "{run}, seed {seed}, at {from_s} s: at least {bound:.2} of {left:.2} m/s^2"
                );
            }
        }
        println!(
            "{run}, seed {seed}: {windows} windows so far, {holds} hold; {used} used, {near} near; {reachable:.2} m/s^2"
        );
    }
    assert!(windows > 50 && used > 5, "{windows} {used}");
    assert!(
        holds as f64 >= HOLDS_MIN * windows as f64,
        "{holds} of {windows}"
    );
    assert!(near as f64 >= NEAR_MIN * used as f64, "{near} of {used}");
}
