//! Transient response (ISO 7401): to a step of the steering wheel, and over frequency.
//!
//! The step's response times count from the instant at which the steer angle reaches half of its
//! final value to the instant at which the response reaches 90 % of its own (ISO 7401 section 8).
//! The frequency response is H = S_xy/S_xx by Welch's averages over half-overlapping Hann windows,
//! with the coherence |S_xy|^2/(S_xx S_yy); the random error of |H| is
//! |H| sqrt((1 - coherence)/(2 coherence n)) with n independent windows (Bendat and Piersol, Random
//! Data, section 9.2). A second-order system is fitted to what is coherent:
//! H(s) = G (1 + T_z s)/(1 + 2 zeta s/omega + s^2/omega^2), the yaw rate's of the two-wheel model.

use std::f64::consts::TAU;

use nalgebra::Complex;

use super::Drive;
use super::drive::{series, span_of};
use super::signals::{mean, smooth};
use crate::finding::{Excitation, Figure, Finding, Findings, Refusal};
use crate::regression::{Fit, Nonlinear, nonlinear};

const STEP: &str = "step response";
const FREQUENCY: &str = "frequency response";
/// Coherence below which a frequency says nothing.
const COHERENCE_MIN: f64 = 0.9;
/// Least number of coherent frequencies.
const LINES_MIN: usize = 6;
/// Longest part of a window's length that is looked at, Hz.
const FREQUENCY_MAX_HZ: f64 = 4.0;

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

/// A transfer function at frequencies.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Transfer {
    /// Frequencies, Hz.
    pub frequency_hz: Vec<f64>,
    /// H = S_xy/S_xx.
    pub response: Vec<Complex<f64>>,
    /// Coherence, 0 to 1.
    pub coherence: Vec<f64>,
    /// Independent windows that were averaged.
    pub windows: f64,
}

/// Welch's transfer function from `input` to `output`, both on a grid of `dt_s`, with windows of
/// `window_s` that overlap by half; windows with an unknown value are left out.
///
/// # Errors
/// Fewer than four windows.
pub fn transfer(
    input: &[f64],
    output: &[f64],
    dt_s: f64,
    window_s: f64,
) -> Result<Transfer, Refusal> {
    let length = (window_s / dt_s).round() as usize;
    let lines = (FREQUENCY_MAX_HZ * window_s).floor() as usize;
    let mut sums = vec![(0.0, 0.0, Complex::new(0.0, 0.0)); lines];
    let mut windows = 0_usize;
    let mut start = 0;
    while length > 1 && start + length <= input.len().min(output.len()) {
        let (x, y) = (
            &input[start..start + length],
            &output[start..start + length],
        );
        if x.iter().chain(y).all(|value| value.is_finite()) {
            for (line, sum) in sums.iter_mut().enumerate() {
                let (x, y) = (spectrum(x, line + 1), spectrum(y, line + 1));
                sum.0 += x.norm_sqr();
                sum.1 += y.norm_sqr();
                sum.2 += x.conj() * y;
            }
            windows += 1;
        }
        start += length / 2;
    }
    if windows < 4 {
        return Err(Refusal::TooShort {
            what: FREQUENCY.to_owned(),
            found_s: windows as f64 * 0.5 * window_s,
            needed_s: 2.5 * window_s,
            help: "steer a sweep or at random from 0.2 to 3 Hz for a minute".to_owned(),
        });
    }
    Ok(Transfer {
        frequency_hz: (1..=lines).map(|line| line as f64 / window_s).collect(),
        response: sums.iter().map(|(xx, _, xy)| xy / *xx).collect(),
        coherence: sums
            .iter()
            .map(|(xx, yy, xy)| xy.norm_sqr() / (xx * yy))
            .collect(),
        // Hann windows that overlap by half share some of their data (Welch 1967).
        windows: windows as f64 / 1.06,
    })
}

/// Component of `line` periods within the values, mean taken out, under a Hann window.
fn spectrum(values: &[f64], line: usize) -> Complex<f64> {
    let n = values.len() as f64;
    let middle = values.iter().sum::<f64>() / n;
    let (sine, cosine) = math::sin_cos(-TAU * line as f64 / n);
    let turn = Complex::new(cosine, sine);
    let mut phase = Complex::new(1.0, 0.0);
    let mut sum = Complex::new(0.0, 0.0);
    for (i, value) in values.iter().enumerate() {
        let window = 0.5 - 0.5 * math::cos(TAU * i as f64 / n);
        sum += phase * ((value - middle) * window);
        phase *= turn;
    }
    sum
}

/// Finds the frequency response of yaw rate to steer angle, and the second-order system in it.
///
/// Findings: `yaw_rate_gain` (1/s), `natural_frequency` (Hz), `damping_ratio` (-), `lead_time`
/// (T_z, s). Beside: bandwidth, where the gain has fallen to 1/sqrt(2) of the first line's, and the
/// equivalent time of ISO 7401, the phase at the lowest line over its frequency.
///
/// # Errors
/// Missing signals, too little data, too few coherent frequencies.
pub fn frequency(drive: &Drive, window_s: f64, seed: u64) -> Result<Findings, Refusal> {
    drive.require(FREQUENCY, &["yaw rate", "steer angle"])?;
    let (transfer, lines, fit) = fitted(drive, window_s)?;
    // The bias of windows of a finite length is inverse to the square of the length (the curvature of the
    // response within the width of a line): half the length has four times the bias.
    let halved = fitted(drive, 0.5 * window_s).map(|(_, _, halved)| halved.coefficients);
    let bias = |j: usize| {
        let halved = halved
            .as_ref()
            .map_or(fit.coefficients[j], |halved| halved[j]);
        (halved - fit.coefficients[j]) / 3.0
    };
    let sigma = |j: usize| math::hypot(fit.sigma(j), bias(j));
    let widened = |j: usize, ends: [f64; 2]| {
        let (value, factor) = (fit.coefficients[j], sigma(j) / fit.sigma(j));
        ends.map(|end| value + factor * (end - value))
    };
    let rows: Vec<usize> = (0..drive.rows()).collect();
    let span = span_of(&rows, drive.dt_s, 1);
    let names = [
        ("yaw_rate_gain", "1/s"),
        ("natural_frequency", "Hz"),
        ("damping_ratio", "-"),
        ("lead_time", "s"),
    ];
    let intervals = fit.intervals(seed, <[f64]>::to_vec);
    let findings = names.iter().enumerate().map(|(j, (name, unit))| Finding {
        name: (*name).to_owned(),
        value: fit.coefficients[j],
        unit: (*unit).to_owned(),
        sigma: sigma(j),
        interval: intervals.as_ref().map(|intervals| widened(j, intervals[j])),
        condition: fit.condition,
        excitation: Some(Excitation {
            rms: mean(transfer.coherence.iter().copied()),
            unit: "mean coherence".to_owned(),
        }),
        whiteness: Some(fit.whiteness),
        span,
    });
    let first = lines[0];
    let low = transfer.response[first];
    let equivalent_s = -phase(low) / (TAU * transfer.frequency_hz[first]);
    let bandwidth = lines
        .iter()
        .find(|line| size(transfer.response[**line]) < size(low) * 0.5_f64.sqrt())
        .map_or(f64::NAN, |line| transfer.frequency_hz[*line]);
    Ok(Findings {
        what: FREQUENCY.to_owned(),
        findings: findings.collect(),
        covariance: (0..4)
            .map(|i| (0..4).map(|j| fit.covariance[(i, j)]).collect())
            .collect(),
        beside: vec![
            ("bandwidth".to_owned(), bandwidth, "Hz".to_owned()),
            ("equivalent_time".to_owned(), equivalent_s, "s".to_owned()),
            (
                "coherent_frequencies".to_owned(),
                lines.len() as f64,
                "-".to_owned(),
            ),
        ],
        notes: Vec::new(),
        figures: bode(&transfer, &fit.coefficients),
    })
}

/// Frequency response over windows of a length, the lines of it that are coherent, and the fit of a
/// second-order system to them.
fn fitted(drive: &Drive, window_s: f64) -> Result<(Transfer, Vec<usize>, Fit), Refusal> {
    let transfer = transfer(
        &drive.steer_rad,
        &drive.yaw_rate_rad_s,
        drive.dt_s,
        window_s,
    )?;
    let lines: Vec<usize> = (0..transfer.coherence.len())
        .filter(|line| transfer.coherence[*line] >= COHERENCE_MIN)
        .collect();
    if lines.len() < LINES_MIN {
        return Err(Refusal::NotExcited {
            what: FREQUENCY.to_owned(),
            quantity: format!("the number of frequencies with a coherence above {COHERENCE_MIN}"),
            found: lines.len() as f64,
            needed: LINES_MIN as f64,
            unit: "-".to_owned(),
            help: "steer a sweep or at random from 0.2 to 3 Hz for a minute".to_owned(),
        });
    }
    let weight = |line: usize| {
        let coherence = transfer.coherence[line].min(1.0 - 1e-9);
        let error = ((1.0 - coherence) / (2.0 * coherence * transfer.windows)).sqrt();
        (error * size(transfer.response[line])).recip()
    };
    let start_gain = size(transfer.response[lines[0]]);
    let problem = Nonlinear {
        start: vec![start_gain, 1.5, 0.8, 0.1],
        scale: vec![start_gain, 1.5, 0.5, 0.1],
        iterations: 200,
    };
    let fit = nonlinear(&problem, |c| {
        lines
            .iter()
            .flat_map(|&line| {
                let model = second_order(c, transfer.frequency_hz[line]);
                let miss = (transfer.response[line] - model) * weight(line);
                [miss.re, miss.im]
            })
            .collect()
    })
    .map_err(|refusal| refusal.of(FREQUENCY))?;
    Ok((transfer, lines, fit))
}

fn size(of: Complex<f64>) -> f64 {
    math::hypot(of.re, of.im)
}

fn phase(of: Complex<f64>) -> f64 {
    math::atan2(of.im, of.re)
}

/// G (1 + T_z s)/(1 + 2 zeta s/omega + s^2/omega^2) at a frequency; omega is given in Hz.
fn second_order(c: &[f64], frequency_hz: f64) -> Complex<f64> {
    let s = Complex::new(0.0, TAU * frequency_hz);
    let part = s / (TAU * c[1]);
    (s * c[3] + 1.0) * c[0] / (part * part + part * (2.0 * c[2]) + 1.0)
}

fn bode(transfer: &Transfer, c: &[f64]) -> Vec<Figure> {
    let hz = &transfer.frequency_hz;
    let model: Vec<Complex<f64>> = hz.iter().map(|f| second_order(c, *f)).collect();
    let degrees = |values: &[Complex<f64>]| values.iter().map(|v| phase(*v).to_degrees()).collect();
    let sizes = |values: &[Complex<f64>]| values.iter().map(|v| size(*v)).collect();
    let figure = |title: &str, y_label: &str, series: Vec<_>| Figure {
        title: title.to_owned(),
        x_label: "frequency (Hz)".to_owned(),
        y_label: y_label.to_owned(),
        series,
    };
    vec![
        figure(
            "Gain from steer angle to yaw rate",
            "gain (1/s)",
            vec![
                series("measured", false, hz.clone(), sizes(&transfer.response)),
                series("second order", true, hz.clone(), sizes(&model)),
            ],
        ),
        figure(
            "Phase from steer angle to yaw rate",
            "phase (°)",
            vec![
                series("measured", false, hz.clone(), degrees(&transfer.response)),
                series("second order", true, hz.clone(), degrees(&model)),
            ],
        ),
        figure(
            "Coherence",
            "coherence",
            vec![series(
                "coherence",
                true,
                hz.clone(),
                transfer.coherence.clone(),
            )],
        ),
    ]
}
