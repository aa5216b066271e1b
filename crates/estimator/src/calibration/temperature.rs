//! Zero and gain of strain channels over the temperature of the bridge.
//!
//! counts = zero + a (T - T_0) + b (T - T_0)^2 + (1 + c (T - T_0)) F / gain
//!
//! with the temperature T of the bridge, the reference T_0 at which zero and gain are those of the file, and the
//! force F of the member. b is found only if it is significant, c only if known loads differ.

use nalgebra::{DMatrix, DVector};
use sample::{StrainChannel, Wheel};
use serde::{Deserialize, Serialize};

use super::Channel;
use crate::finding::{Excitation, Figure, Finding, Findings, Refusal, Series, Span};
use crate::regression::{Fit, least_squares};

const WHAT: &str = "temperature";
/// Least change of the temperature, K.
pub const CHANGE_NEEDED_K: f64 = 8.0;
/// Fewest windows of a channel.
const WINDOWS_NEEDED: usize = 20;
/// Standard deviations from which the quadratic part is significant.
const SIGNIFICANT: f64 = 3.0;
/// Least effect of the quadratic part at the ends of the range, counts.
const CURVED_COUNTS: f64 = 0.5;
/// Least spread (rms) of the known force of a member, counts, from which the gain's drift is found.
const LOADS_NEEDED_COUNTS: f64 = 5.0;
/// Age from which a temperature counts as old, s.
pub const OLD_S: f64 = 30.0;
/// Standard deviation of the bridge's temperature with a reading, K.
const READ_SIGMA_K: f64 = 0.5;
/// Growth of this standard deviation with an old reading, K/s, and its limit, K.
const OLD_SIGMA_K_S: f64 = 0.02;
const UNKNOWN_SIGMA_K: f64 = 15.0;

/// Drift of a strain channel with the temperature of its bridge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TemperatureCalibration {
    /// Temperature at which offset and gain are those of the channel, degrees Celsius.
    pub reference_c: f64,
    /// Change of the offset, counts/K.
    #[serde(default)]
    pub offset_counts_per_k: f64,
    /// Standard deviation of this change, counts/K.
    #[serde(default)]
    pub offset_sigma_counts_per_k: f64,
    /// Quadratic part of the change of the offset, counts/K^2.
    #[serde(default)]
    pub offset_counts_per_k2: f64,
    /// Relative change of the counts per newton, 1/K.
    #[serde(default)]
    pub gain_per_k: f64,
    /// Standard deviation of this change, 1/K.
    #[serde(default)]
    pub gain_sigma_per_k: f64,
}

impl TemperatureCalibration {
    /// Whether the channel does not depend on the temperature.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.offset_counts_per_k == 0.0
            && self.offset_counts_per_k2 == 0.0
            && self.gain_per_k == 0.0
    }

    /// The channel at the last temperature of its bridge, degrees Celsius, and the age of this reading, s.
    /// Without a reading, it is the channel at the reference with a larger standard deviation.
    #[must_use]
    pub fn applied(&self, channel: &Channel, reading: Option<(f64, f64)>) -> Channel {
        let (change_k, sigma_k) = match reading {
            Some((temperature_c, age_s)) => {
                let old_k = OLD_SIGMA_K_S * (age_s - OLD_S).max(0.0);
                (
                    temperature_c - self.reference_c,
                    (READ_SIGMA_K + old_k).min(UNKNOWN_SIGMA_K),
                )
            }
            None => (0.0, UNKNOWN_SIGMA_K),
        };
        let slope = self.offset_counts_per_k + 2.0 * self.offset_counts_per_k2 * change_k;
        let moved = change_k * (self.offset_counts_per_k + self.offset_counts_per_k2 * change_k);
        let gain = channel.gain / (1.0 + self.gain_per_k * change_k);
        let sigma_counts = math::hypot(self.offset_sigma_counts_per_k * change_k, slope * sigma_k);
        Channel {
            offset_counts: channel.offset_counts + moved,
            offset_sigma: math::hypot(channel.offset_sigma, gain * sigma_counts),
            gain,
            ..*channel
        }
    }
}

/// A window of a channel at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// Its middle, s.
    pub time_s: f64,
    /// Temperature of the bridge, degrees Celsius.
    pub temperature_c: f64,
    /// Mean of the counts.
    pub counts: f64,
    /// Known force of the member by nominal gain, counts; 0 without a known load.
    pub force_counts: f64,
}

/// Finds the drift of one channel; `None` with too few windows. `reference_c` is the temperature of zero and gain
/// in the file.
///
/// # Errors
/// If the temperature changes too little.
pub fn drift(
    wheel: Wheel,
    channel: StrainChannel,
    windows: &[Window],
    reference_c: f64,
    findings: &mut Findings,
) -> Result<Option<TemperatureCalibration>, Refusal> {
    if windows.len() < WINDOWS_NEEDED {
        return Ok(None);
    }
    let [low_c, high_c] = range_c(windows);
    if high_c - low_c < CHANGE_NEEDED_K {
        return Err(too_small(wheel, high_c - low_c));
    }
    let reach_k = (high_c - reference_c)
        .abs()
        .max((low_c - reference_c).abs());
    let loaded = force_spread(windows) > LOADS_NEEDED_COUNTS;
    let straight = fit(windows, reference_c, false, loaded)?;
    let curved = fit(windows, reference_c, true, loaded)?;
    let bend = [curved.coefficients[2], curved.sigma(2)];
    let is_curved =
        bend[0].abs() > SIGNIFICANT * bend[1] && bend[0].abs() * reach_k * reach_k > CURVED_COUNTS;
    let best = if is_curved { curved } else { straight };
    let gain = loaded.then(|| {
        let k = best.coefficients.len() - 2;
        let force = best.coefficients[k];
        [
            best.coefficients[k + 1] / force,
            best.sigma(k + 1) / force.abs(),
        ]
    });
    let [gain_per_k, gain_sigma_per_k] = gain.unwrap_or_default();
    let zero = [best.coefficients[1], best.sigma(1)];
    let parts = [
        ("zero drift", Some(zero), "counts/K"),
        (
            "zero drift, quadratic",
            is_curved.then_some(bend),
            "counts/K^2",
        ),
        ("gain drift", gain, "1/K"),
    ];
    for (name, value, unit) in parts {
        if let Some(value) = value {
            let name = format!("{wheel} {} {name}", channel.name());
            findings
                .findings
                .push(finding(name, value, unit, &best, windows));
        }
    }
    Ok(Some(TemperatureCalibration {
        reference_c,
        offset_counts_per_k: zero[0],
        offset_sigma_counts_per_k: zero[1],
        offset_counts_per_k2: if is_curved { bend[0] } else { 0.0 },
        gain_per_k,
        gain_sigma_per_k,
    }))
}

fn range_c(windows: &[Window]) -> [f64; 2] {
    let temperatures = windows.iter().map(|window| window.temperature_c);
    temperatures.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], t| {
        [low.min(t), high.max(t)]
    })
}

/// Root mean square of the known forces about their mean, counts.
fn force_spread(windows: &[Window]) -> f64 {
    let n = windows.len() as f64;
    let mean = windows
        .iter()
        .map(|window| window.force_counts)
        .sum::<f64>()
        / n;
    let squares = windows
        .iter()
        .map(|window| (window.force_counts - mean).powi(2));
    (squares.sum::<f64>() / n).sqrt()
}

fn too_small(wheel: Wheel, change_k: f64) -> Refusal {
    Refusal::NotExcited {
        what: WHAT.to_owned(),
        quantity: format!("change of the bridge temperature of {wheel}"),
        found: change_k,
        needed: CHANGE_NEEDED_K,
        unit: "K".to_owned(),
        help: "record from a cold morning to a warm noon, or warm the bridges with the vehicle at rest; 20 K or \
               more are better"
            .to_owned(),
    }
}

fn finding(
    name: String,
    [value, sigma]: [f64; 2],
    unit: &str,
    fit: &Fit,
    windows: &[Window],
) -> Finding {
    let (from_s, to_s) = (windows[0].time_s, windows[windows.len() - 1].time_s);
    Finding {
        name,
        value,
        unit: unit.to_owned(),
        sigma,
        interval: None,
        condition: fit.condition,
        excitation: Some(Excitation {
            rms: fit.excitation[1],
            unit: "K".to_owned(),
        }),
        whiteness: Some(fit.whiteness),
        span: Span {
            from_s,
            to_s,
            used_s: to_s - from_s,
            rows: windows.len(),
        },
    }
}

fn fit(windows: &[Window], reference_c: f64, curved: bool, loaded: bool) -> Result<Fit, Refusal> {
    let row = |window: &Window| {
        let change_k = window.temperature_c - reference_c;
        let mut row = vec![1.0, change_k];
        row.extend(curved.then_some(change_k * change_k));
        if loaded {
            row.extend([window.force_counts, window.force_counts * change_k]);
        }
        row
    };
    let rows: Vec<Vec<f64>> = windows.iter().map(row).collect();
    let columns = rows.first().map_or(0, Vec::len);
    let design = DMatrix::from_fn(rows.len(), columns, |i, j| rows[i][j]);
    let response = DVector::from_fn(rows.len(), |i, _| windows[i].counts);
    least_squares(&design, &response).map_err(|refusal| refusal.of(WHAT))
}

/// Figure of the counts of a wheel's channels over the temperature.
#[must_use]
pub fn figure(wheel: Wheel, channels: &[(StrainChannel, Vec<Window>)]) -> Figure {
    Figure {
        title: format!("{wheel}: counts over the temperature of the bridges"),
        x_label: "temperature (degrees Celsius)".to_owned(),
        y_label: "counts from the first ones".to_owned(),
        series: channels
            .iter()
            .map(|(channel, windows)| Series {
                name: channel.name().to_owned(),
                line: false,
                x: windows.iter().map(|window| window.temperature_c).collect(),
                y: windows
                    .iter()
                    .map(|window| window.counts - windows[0].counts)
                    .collect(),
            })
            .collect(),
    }
}
