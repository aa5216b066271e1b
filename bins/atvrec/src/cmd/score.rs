//! `atvrec score`: estimates of a log against its truth.

use std::collections::BTreeMap;

use anyhow::Context;
use estimator::score;
use model::vehicle::Vehicle;
use sample::{Estimate, EventKind, LogTime, PerWheel, STANDARD_GRAVITY_M_S2, Wheel};
use serde_json::{Value, json};
use store::{Reader, Record, Selection};

use crate::cli::ScoreArgs;
use crate::config::Config;
use crate::exit::Outcome;

/// Sideslip means little below this speed, m/s.
const SIDESLIP_SPEED_MIN_M_S: f64 = 3.0;
/// Interval of the estimates, s.
const INTERVAL_S: f64 = 0.01;
/// Longest delay that is looked for, intervals.
const DELAY_MAX: usize = 50;
/// A wheel has left the ground when its load is below this part of its static load, and is back
/// above the second.
const LIFTED: [f64; 2] = [0.02, 0.1];
/// A declaration belongs to a lift if it is this near, s.
const LIFT_NEAR_S: f64 = 2.0;
/// A warning belongs to a lift that follows within this time, s.
const WARNING_LEAD_MAX_S: f64 = 10.0;

/// One line of the table.
struct Row {
    signal: &'static str,
    wheel: Option<Wheel>,
    unit: &'static str,
    errors: score::Errors,
    normalised_percent: Option<f64>,
    delay_s: Option<f64>,
    normalised_square: Option<f64>,
}

/// A lift of a wheel in the truth and what the estimator said of it.
struct Lift {
    wheel: Wheel,
    at_s: f64,
    declared_after_s: Option<f64>,
    warned_before_s: Option<f64>,
}

/// What is compared: for each instant the estimate and the truth.
type Pairs = Vec<(Estimate, Estimate)>;

/// A signal of an estimate with its standard deviation (`NaN` if there is none).
type Pick<'a> = &'a dyn Fn(&Estimate) -> (f64, f64);

/// Scores.
pub fn run(args: &ScoreArgs) -> anyhow::Result<Outcome> {
    let reader = Reader::open(&args.logs)?;
    let config = Config::from_attachments(&reader.attachments()?)?;
    let vehicle = config
        .estimator
        .context("the log's configuration names no vehicle, so nothing was estimated")?
        .vehicle;
    let loads = static_loads(&vehicle);
    let (start, pairs) = pairs(&reader, args.from_s)?;
    let rows = rows(&pairs, &loads);
    let (lifts, false_lifts) = lifts(&reader, start, &loads)?;
    if args.json {
        println!("{:#}", as_json(&rows, &lifts, false_lifts));
    } else {
        tell(&rows, &lifts, false_lifts);
    }
    Ok(Outcome::Good)
}

/// Load of each wheel at rest, N.
fn static_loads(vehicle: &Vehicle) -> PerWheel<f64> {
    let body = &vehicle.body;
    let (a, b) = (body.front_axle_to_cg_m, body.cg_to_rear_axle_m);
    PerWheel::from_fn(|wheel| {
        let arm = if wheel.is_front() { b } else { a };
        0.5 * body.mass_kg * STANDARD_GRAVITY_M_S2 * arm / (a + b)
    })
}

fn pairs(reader: &Reader, from_s: f64) -> anyhow::Result<(LogTime, Pairs)> {
    let mut truth = BTreeMap::new();
    for state in reader.truth() {
        let state = state?;
        truth.insert(state.time, state);
    }
    let start = *truth.keys().next().context(
        "the log has no truth to compare with; make one with `atvrec simulate`, or replay a \
         simulated log",
    )?;
    let mut pairs = Pairs::new();
    for estimate in reader.estimates() {
        let estimate = estimate?;
        if estimate.time.seconds_since(start) < from_s {
            continue;
        }
        if let Some(truth) = truth.get(&estimate.time) {
            pairs.push((estimate, truth.clone()));
        }
    }
    anyhow::ensure!(
        !pairs.is_empty(),
        "no estimate stands at the same instant as a truth; was the estimator switched off?"
    );
    Ok((start, pairs))
}

fn rows(pairs: &Pairs, loads: &PerWheel<f64>) -> Vec<Row> {
    let mut rows = Vec::new();
    let none = f64::NAN;
    let mut add = |signal, wheel, unit, floor, estimate: Pick<'_>, truth: Pick<'_>| {
        rows.extend(row(pairs, signal, wheel, unit, floor, estimate, truth));
    };
    let sideslip = |e: &Estimate| {
        let fast = e.motion.velocity_x_m_s > SIDESLIP_SPEED_MIN_M_S;
        let angle = if fast {
            e.motion.sideslip_rad
        } else {
            f64::NAN
        };
        (angle, e.motion.sideslip_sigma_rad)
    };
    add("sideslip", None, "rad", None, &sideslip, &sideslip);
    let plain: [(&'static str, &'static str, Pick<'_>); 5] = [
        ("velocity_x", "m/s", &|e| (e.motion.velocity_x_m_s, none)),
        ("velocity_y", "m/s", &|e| (e.motion.velocity_y_m_s, none)),
        ("roll", "rad", &|e| (e.motion.roll_rad, none)),
        ("pitch", "rad", &|e| (e.motion.pitch_rad, none)),
        ("yaw_rate", "rad/s", &|e| (e.motion.rate_rad_s[2], none)),
    ];
    for (signal, unit, pick) in plain {
        add(signal, None, unit, None, pick, pick);
    }
    let measured = ["measured_force_x", "measured_force_y", "measured_force_z"];
    let expected = ["expected_force_x", "expected_force_y", "expected_force_z"];
    for axis in 0..3 {
        for wheel in Wheel::ALL {
            let floor = Some(loads[wheel]);
            let own = |e: &Estimate| {
                let force = &e.measured[wheel];
                (force.force_n[axis], force.sigma_n[axis])
            };
            let model = |e: &Estimate| (e.expected[wheel].force_n[axis], none);
            add(measured[axis], Some(wheel), "N", floor, &own, &own);
            add(expected[axis], Some(wheel), "N", floor, &model, &own);
        }
    }
    rows
}

fn row(
    pairs: &Pairs,
    signal: &'static str,
    wheel: Option<Wheel>,
    unit: &'static str,
    floor: Option<f64>,
    estimate: Pick<'_>,
    truth: Pick<'_>,
) -> Option<Row> {
    let (values, sigmas): (Vec<f64>, Vec<f64>) = pairs.iter().map(|(e, _)| estimate(e)).unzip();
    let truths: Vec<f64> = pairs.iter().map(|(_, t)| truth(t).0).collect();
    Some(Row {
        signal,
        wheel,
        unit,
        errors: score::errors(&values, &truths)?,
        normalised_percent: floor
            .and_then(|floor| score::normalised_error_percent(&values, &truths, floor)),
        delay_s: score::delay(&values, &truths, DELAY_MAX).map(|delay| delay * INTERVAL_S),
        normalised_square: score::normalised_square(&values, &truths, &sigmas),
    })
}

/// Lifts of the truth with what was declared of them, and how many declarations had no lift.
fn lifts(
    reader: &Reader,
    start: LogTime,
    loads: &PerWheel<f64>,
) -> anyhow::Result<(Vec<Lift>, usize)> {
    let mut declared = Vec::new();
    let mut warned = Vec::new();
    for message in reader.messages(Selection::topics(["/estimate/events"])) {
        if let Some(Record::Event(event)) = message?.record()? {
            let at_s = event.time.seconds_since(start);
            match event.kind {
                EventKind::Lift(wheel) => declared.push((wheel, at_s)),
                EventKind::LiftWarning(wheel, _) => warned.push((wheel, at_s)),
                _ => {}
            }
        }
    }
    let mut lifts: Vec<Lift> = Vec::new();
    let mut up = PerWheel([true; 4]);
    for truth in reader.truth() {
        let truth = truth?;
        let at_s = truth.time.seconds_since(start);
        for wheel in Wheel::ALL {
            let part = truth.measured[wheel].force_n[2] / loads[wheel];
            if up[wheel] {
                up[wheel] = part < LIFTED[1];
            } else if part < LIFTED[0] {
                up[wheel] = true;
                lifts.push(lift(wheel, at_s, &declared, &warned));
            }
        }
    }
    let is_false = |(wheel, at_s): &&(Wheel, f64)| {
        !lifts
            .iter()
            .any(|lift| lift.wheel == *wheel && (lift.at_s - at_s).abs() < LIFT_NEAR_S)
    };
    let false_lifts = declared.iter().filter(is_false).count();
    Ok((lifts, false_lifts))
}

fn lift(wheel: Wheel, at_s: f64, declared: &[(Wheel, f64)], warned: &[(Wheel, f64)]) -> Lift {
    let of_wheel = |list: &[(Wheel, f64)]| -> Vec<f64> {
        let mine = list.iter().filter(|(other, _)| *other == wheel);
        mine.map(|(_, time_s)| time_s - at_s).collect()
    };
    Lift {
        wheel,
        at_s,
        declared_after_s: of_wheel(declared)
            .into_iter()
            .find(|after_s| after_s.abs() < LIFT_NEAR_S),
        warned_before_s: of_wheel(warned)
            .into_iter()
            .map(|after_s| -after_s)
            .find(|before_s| (0.0..WARNING_LEAD_MAX_S).contains(before_s)),
    }
}

fn tell(rows: &[Row], lifts: &[Lift], false_lifts: usize) {
    println!(
        "{:<20}{:<6}{:<7}{:>10}{:>10}{:>10}{:>10}{:>8}{:>9}{:>8}",
        "signal", "wheel", "unit", "mean", "rmse", "95 %", "peak", "%", "late ms", "nees"
    );
    let optional = |value: Option<f64>, digits: usize| {
        value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
    };
    for row in rows {
        // Angles are read in degrees.
        let (scale, unit) = match row.unit {
            "rad" => (1.0_f64.to_degrees(), "deg"),
            "rad/s" => (1.0_f64.to_degrees(), "deg/s"),
            unit => (1.0, unit),
        };
        let [mean, rmse, most, peak] = [
            row.errors.mean,
            row.errors.rmse,
            row.errors.percentile_95,
            row.errors.peak,
        ]
        .map(|value| value * scale);
        println!(
            "{:<20}{:<6}{unit:<7}{mean:>10.3}{rmse:>10.3}{most:>10.3}{peak:>10.3}{:>8}{:>9}{:>8}",
            row.signal,
            row.wheel.map_or("", Wheel::abbreviation),
            optional(row.normalised_percent, 2),
            optional(row.delay_s.map(|delay_s| delay_s * 1e3), 1),
            optional(row.normalised_square, 2),
        );
    }
    for lift in lifts {
        println!(
            "{} lifts at {:.2} s: declared {} s after, warned {} s before",
            lift.wheel,
            lift.at_s,
            optional(lift.declared_after_s, 2),
            optional(lift.warned_before_s, 2),
        );
    }
    println!("{} lifts, {false_lifts} declared without one", lifts.len());
}

fn as_json(rows: &[Row], lifts: &[Lift], false_lifts: usize) -> Value {
    let rows: Vec<Value> = rows
        .iter()
        .map(|row| {
            json!({
                "signal": row.signal,
                "wheel": row.wheel.map(Wheel::abbreviation),
                "unit": row.unit,
                "count": row.errors.count,
                "mean": row.errors.mean,
                "rmse": row.errors.rmse,
                "percentile_95": row.errors.percentile_95,
                "peak": row.errors.peak,
                "normalised_percent": row.normalised_percent,
                "delay_s": row.delay_s,
                "nees": row.normalised_square,
            })
        })
        .collect();
    let lifts: Vec<Value> = lifts
        .iter()
        .map(|lift| {
            json!({
                "wheel": lift.wheel.abbreviation(),
                "at_s": lift.at_s,
                "declared_after_s": lift.declared_after_s,
                "warned_before_s": lift.warned_before_s,
            })
        })
        .collect();
    json!({ "signals": rows, "lifts": lifts, "false_lifts": false_lifts })
}
