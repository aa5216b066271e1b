//! Response to steps of the steer angle.

use super::super::Drive;
use super::super::drive::{series, span_of};
use super::super::signals::{mean, smooth};
use crate::finding::{Excitation, Figure, Finding, Findings, Refusal};

const STEP: &str = "step response";
/// Time for which a step is held, s; and that of a step which is named if no step is held so long.
const HELD_S: f64 = 2.0;
const SHORTLY_HELD_S: f64 = 0.5;
/// Least speed of a step, m/s, and greatest change of the speed, part of it.
const SPEED_MIN_M_S: f64 = 3.0;
const SPEED_CHANGE_MAX: f64 = 0.25;

/// One step of the steer angle.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Step {
    /// Row at which the steer angle passes half of its way.
    at: usize,
    /// Mean of the second before, rad.
    from_rad: f64,
    /// Mean of the last second of the plateau, rad.
    to_rad: f64,
    /// Last row of the plateau.
    end: usize,
}

/// Finds response time and overshoot of yaw rate and lateral acceleration to steps of the steer
/// angle of at least `step_min_rad`, held for 2 s or more; several steps give means and their
/// deviations.
///
/// Findings, for `yaw_rate` and `lateral_acceleration`: `..._response_time` (s), `..._overshoot`
/// (-), `..._gain` (per rad of the road wheels).
///
/// # Errors
/// Missing signals, or no step.
pub fn step(drive: &Drive, step_min_rad: f64) -> Result<Findings, Refusal> {
    drive.require(STEP, &["yaw rate", "lateral acceleration", "steer angle"])?;
    let dt_s = drive.dt_s;
    let steer = smooth(&drive.steer_rad, dt_s, 10.0);
    let turned = find_steps(&steer, dt_s, step_min_rad, HELD_S);
    let count = turned.len();
    let driven = |step: &Step| is_driven(&drive.speed_m_s, step, dt_s);
    let steps: Vec<Step> = turned.into_iter().filter(driven).collect();
    if steps.is_empty() {
        return Err(no_steps(&steer, dt_s, step_min_rad, count));
    }
    let rows: Vec<usize> = steps.iter().flat_map(|step| [step.at, step.end]).collect();
    let mut found = Findings {
        what: STEP.to_owned(),
        ..Findings::default()
    };
    let responses = [
        ("yaw_rate", &drive.yaw_rate_rad_s, "rad/s/rad"),
        ("lateral_acceleration", &drive.lateral_m_s2, "m/s^2/rad"),
    ];
    for (name, signal, unit) in responses {
        let signal = smooth(signal, dt_s, 5.0);
        let each: Vec<[f64; 3]> = steps
            .iter()
            .filter_map(|step| one_step(&signal, step, dt_s))
            .collect();
        if each.is_empty() {
            return Err(unsettled(name, steps.len()));
        }
        let parts = [("response_time", "s"), ("overshoot", "-"), ("gain", unit)];
        for (j, (part, unit)) in parts.into_iter().enumerate() {
            let values: Vec<f64> = each.iter().map(|values| values[j]).collect();
            let mut span = span_of(&rows, dt_s, 1);
            span.used_s = steps.iter().map(|s| (s.end - s.at) as f64 * dt_s).sum();
            span.rows = values.len();
            found.findings.push(Finding {
                name: format!("{name}_{part}"),
                value: mean(values.iter().copied()),
                unit: unit.to_owned(),
                sigma: deviation_of_mean(&values),
                interval: None,
                condition: 1.0,
                excitation: Some(Excitation {
                    rms: mean(steps.iter().map(|s| (s.to_rad - s.from_rad).abs())),
                    unit: "rad".to_owned(),
                }),
                whiteness: None,
                span,
            });
        }
        found.figures.push(step_figure(name, &signal, &steps, dt_s));
    }
    found
        .beside
        .push(("steps".to_owned(), steps.len() as f64, "-".to_owned()));
    if steps.len() < 3 {
        let count = steps.len();
        found.notes.push(format!(
            "{count} steps: ISO 7401 asks for three at least; deviations are those between steps"
        ));
    }
    Ok(found)
}

/// Refusal of steps after which a signal does not settle.
fn unsettled(name: &str, steps: usize) -> Refusal {
    Refusal::NotExcited {
        what: STEP.to_owned(),
        quantity: format!(
            "the number of steps (of {steps}) after which the {} settles",
            name.replace('_', " ")
        ),
        found: 0.0,
        needed: 1.0,
        unit: "-".to_owned(),
        help: "hold steering wheel and speed until the vehicle turns evenly".to_owned(),
    }
}

/// Whether the vehicle drives at an even speed from half a second before a step until it is held, if the
/// speed was recorded.
fn is_driven(speed_m_s: &[f64], step: &Step, dt_s: f64) -> bool {
    if speed_m_s.is_empty() {
        return true;
    }
    let before = (0.5 / dt_s).round() as usize;
    let held = ((HELD_S + 0.5) / dt_s).round() as usize;
    let end = (step.at + held).min(step.end);
    let speeds = speed_m_s.get(step.at.saturating_sub(before)..end);
    speeds.is_some_and(|speeds| {
        let first = speeds.first().copied().unwrap_or(f64::NAN);
        let is_even = |speed: &f64| (speed - first).abs() <= SPEED_CHANGE_MAX * first;
        first >= SPEED_MIN_M_S && speeds.iter().all(is_even)
    })
}

/// Why a drive has no step; `count` steps were turned at a low or changing speed.
fn no_steps(steer: &[f64], dt_s: f64, least: f64, count: usize) -> Refusal {
    let degrees = least.to_degrees();
    let short = find_steps(steer, dt_s, least, SHORTLY_HELD_S).len();
    let (quantity, found, help) = if count > 0 {
        (
            format!(
                "the number of steps of the steer angle at an even speed of {SPEED_MIN_M_S} m/s or more \
                 (of {count} steps)"
            ),
            0.0,
            "the wheels were turned while the vehicle stood, or while its speed changed; drive at \
             constant speed"
                .to_owned(),
        )
    } else if short > 0 {
        (
            format!("the time for which the longest of {short} steps of the steer angle is held"),
            SHORTLY_HELD_S,
            format!("hold the steering wheel for {HELD_S} s after a step (ISO 7401)"),
        )
    } else {
        (
            format!("the number of steps of the steer angle by {degrees:.1} degrees or more"),
            0.0,
            format!(
                "turn the steering wheel within half a second by {degrees:.1} degrees at the road wheels \
                 or more at constant speed and hold it (ISO 7401), such as the manoeuvre step-steer; a \
                 smaller step needs a smaller --step-min-deg"
            ),
        )
    };
    let held = found > 0.0;
    Refusal::NotExcited {
        what: STEP.to_owned(),
        quantity,
        found,
        needed: if held { HELD_S } else { 1.0 },
        unit: if held { "s" } else { "-" }.to_owned(),
        help,
    }
}

/// Steps: a change of at least `least` within 0.6 s, quiet before and for `hold_s` after.
fn find_steps(steer: &[f64], dt_s: f64, least: f64, hold_s: f64) -> Vec<Step> {
    let rows = |seconds: f64| (seconds / dt_s).round() as usize;
    let (before, rise, hold) = (rows(0.5), rows(0.6), rows(hold_s));
    let quiet = |range: &[f64], size: f64| {
        let middle = mean(range.iter().copied());
        range
            .iter()
            .all(|value| (value - middle).abs() < 0.1 * size)
    };
    let mut steps: Vec<Step> = Vec::new();
    let mut row = before;
    while row + rise + hold < steer.len() {
        let from = &steer[row - before..row];
        let to = &steer[row + rise..row + rise + hold];
        let (from_rad, to_rad) = (mean(from.iter().copied()), mean(to.iter().copied()));
        let size = (to_rad - from_rad).abs();
        if size < least || !quiet(from, size) || !quiet(to, size) {
            row += 1;
            continue;
        }
        let half = 0.5 * (from_rad + to_rad);
        let crosses = |i: &usize| (steer[*i] - half) * (steer[*i + 1] - half) <= 0.0;
        let at = (row..row + rise).find(crosses).unwrap_or(row);
        let mut end = row + rise + hold;
        while end + 1 < steer.len() && (steer[end + 1] - to_rad).abs() < 0.1 * size {
            end += 1;
        }
        steps.push(Step {
            at,
            from_rad,
            to_rad,
            end,
        });
        row = end;
    }
    steps
}

/// Response time s, overshoot, gain.
fn one_step(signal: &[f64], step: &Step, dt_s: f64) -> Option<[f64; 3]> {
    let second = (1.0 / dt_s).round() as usize;
    let half = second / 2;
    let start = mean(
        signal
            .get(step.at.checked_sub(second)?..step.at.checked_sub(half)?)?
            .to_vec(),
    );
    let settled = mean(
        signal
            .get(step.end.checked_sub(second)?..step.end)?
            .to_vec(),
    );
    let way = settled - start;
    let part = |row: usize| (signal[row] - start) / way;
    let reached = (step.at..step.end).find(|row| part(*row) >= 0.9)?;
    // Between the rows, by a line.
    let (low, high) = (part(reached - 1), part(reached));
    let between = if high > low {
        (0.9 - low) / (high - low)
    } else {
        1.0
    };
    let time_s = ((reached - step.at) as f64 - 1.0 + between) * dt_s;
    let most = (step.at..step.end).map(part).fold(f64::MIN, f64::max);
    let values = [
        time_s,
        (most - 1.0).max(0.0),
        way / (step.to_rad - step.from_rad),
    ];
    values.iter().all(|v| v.is_finite()).then_some(values)
}

fn deviation_of_mean(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    if n < 2.0 {
        return f64::NAN;
    }
    let middle = mean(values.iter().copied());
    let square: f64 = values.iter().map(|v| (v - middle).powi(2)).sum();
    (square / (n - 1.0) / n).sqrt()
}

fn step_figure(name: &str, signal: &[f64], steps: &[Step], dt_s: f64) -> Figure {
    let second = (1.0 / dt_s).round() as usize;
    let traces = steps.iter().enumerate().filter_map(|(k, step)| {
        let rows = step.at.checked_sub(second)?..step.end;
        let before = mean(signal.get(rows.start..rows.start + second / 2)?.to_vec());
        let size = step.to_rad - step.from_rad;
        Some(series(
            &format!("step {}", k + 1),
            true,
            rows.clone()
                .map(|row| (row as f64 - step.at as f64) * dt_s)
                .collect(),
            rows.map(|row| (signal[row] - before) / size).collect(),
        ))
    });
    Figure {
        title: format!("Response of {} to the steer angle", name.replace('_', " ")),
        x_label: "time from half of the step (s)".to_owned(),
        y_label: "response per radian at the road wheels".to_owned(),
        series: traces.collect(),
    }
}
