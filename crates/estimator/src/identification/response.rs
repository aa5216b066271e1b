//! Transient response (ISO 7401): to a step of the steering wheel, and over frequency.
//!
//! The step's response times count from the instant at which the steer angle reaches half of its
//! final value to the instant at which the response reaches 90 % of its own (ISO 7401 section 8).
//! The frequency response is H = S_xy/S_xx by Welch's averages over half-overlapping Hann windows,
//! with the coherence |S_xy|^2/(S_xx S_yy); the random error of |H| is
//! |H| sqrt((1 - coherence)/(2 coherence n)) with n independent windows (Bendat and Piersol, Random
//! Data, section 9.2). A second-order system is fitted to what is coherent:
//! H(s) = G (1 + T_z s)/(1 + 2 zeta s/omega + s^2/omega^2), the yaw rate's of the two-wheel model.

mod step;

use std::f64::consts::TAU;

use nalgebra::Complex;

use super::Drive;
use super::drive::{series, span_of};
use super::signals::mean;
use crate::finding::{Excitation, Figure, Finding, Findings, Refusal};
use crate::regression::{Fit, Nonlinear, nonlinear};

pub use step::step;

const FREQUENCY: &str = "frequency response";
/// Coherence below which a frequency says nothing.
const COHERENCE_MIN: f64 = 0.9;
/// Least number of coherent frequencies.
const LINES_MIN: usize = 6;
/// Longest part of a window's length that is looked at, Hz.
const FREQUENCY_MAX_HZ: f64 = 4.0;

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
