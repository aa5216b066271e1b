//! Regression of the counts of one channel on the loads of a bench.

use nalgebra::{DMatrix, DVector};

use super::{APART, BenchLoad, COUNTS_NEEDED, LOADS_NEEDED, MORE_LOADS};
use crate::calibration::temperature::CHANGE_NEEDED_K;
use crate::finding::{Refusal, Whiteness};
use crate::regression::{Fit, least_squares};
use crate::statistics::student_over_normal;

/// Least variance of a residual if all counts are whole numbers: that of their rounding, counts^2.
const ROUNDING_COUNTS2: f64 = 1.0 / 12.0;
/// Standard deviations of the slope by which it must differ from zero.
const SLOPE_SIGMAS: f64 = 5.0;
/// Fewest rows of each direction for the hysteresis.
const BRANCH_NEEDED: usize = 2;

/// What the columns of a regression are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    Zero,
    Load,
    Other,
    Direction,
    Temperature,
    LoadTemperature,
}

/// A channel's regression. Values are pairs of value and standard deviation.
pub(super) struct Line {
    pub(super) bends: bool,
    /// Load that the channel measures, of each row.
    pub(super) load: Vec<f64>,
    /// 1 while the load rises, -1 while it falls, 0 before the first change.
    pub(super) direction: Vec<f64>,
    /// Counts of each row without all but the load's part.
    pub(super) own_counts: Vec<f64>,
    /// Counts at no load.
    pub(super) zero: [f64; 2],
    /// Counts for a unit of the load.
    pub(super) slope: [f64; 2],
    /// Load that a unit of the other load seems to be.
    pub(super) cross: Option<[f64; 2]>,
    /// Counts while the load rises less those while it falls.
    pub(super) hysteresis: Option<[f64; 2]>,
    /// Drift of the zero, counts/K, and relative drift of the sensitivity, 1/K.
    pub(super) drift: Option<[[f64; 2]; 2]>,
    /// Mean temperature, degrees Celsius.
    pub(super) reference_c: Option<f64>,
    pub(super) temperature_range_k: Option<f64>,
    /// Width of an interval over that of a normal distribution.
    pub(super) widen: f64,
    pub(super) condition: f64,
    pub(super) excitation: f64,
    pub(super) whiteness: Whiteness,
    pub(super) largest_residual: f64,
    /// Change of the counts over the range of the loads.
    pub(super) range_counts: f64,
}

impl Line {
    /// Fits one channel.
    ///
    /// # Errors
    /// Too few rows or different loads, loads that cannot be told apart, counts that do not change.
    pub(super) fn fit(
        rows: &[BenchLoad],
        counts: &[f64],
        temperature_c: Option<&[f64]>,
        bends: bool,
    ) -> Result<Self, Refusal> {
        let (axial, moment): (Vec<f64>, Vec<f64>) =
            rows.iter().map(|row| (row.load_n, row.moment_n_m)).unzip();
        let (load, other, name) = match bends {
            true => (moment, axial, "moment_n_m"),
            false => (axial, moment, "load_n"),
        };
        different(&load, name)?;
        let direction = directions(&load);
        let mean_c = temperature_c.map(|all| all.iter().sum::<f64>() / all.len() as f64);
        let temperature_range_k = temperature_c.map(range);
        let parts = parts(&other, &direction, temperature_range_k);
        let change_k =
            |row: usize| temperature_c.map_or(0.0, |all| all[row] - mean_c.unwrap_or(0.0));
        let value = |row: usize, part: Part| match part {
            Part::Zero => 1.0,
            Part::Load => load[row],
            Part::Other => other[row],
            Part::Direction => 0.5 * direction[row],
            Part::Temperature => change_k(row),
            Part::LoadTemperature => load[row] * change_k(row),
        };
        let fit = solve(counts, &parts, &value)?;
        let covariance = covariance(&fit, counts);
        let at = |part: Part| parts.iter().position(|other| *other == part);
        let pair = |k: usize| [fit.coefficients[k], covariance[(k, k)].max(0.0).sqrt()];
        let zero = at(Part::Zero).map_or([0.0; 2], pair);
        let slope = at(Part::Load).map_or([0.0; 2], pair);
        let range_counts = changes(slope, range(&load), name)?;
        let of_slope = at(Part::Load).unwrap_or_default();
        let over_slope = |k: usize| ratio(&fit, &covariance, [k, of_slope]);
        let lag_counts = at(Part::Direction).map_or(0.0, |k| fit.coefficients[k]);
        let rows = load.iter().zip(&direction).zip(&fit.residuals);
        Ok(Self {
            bends,
            own_counts: rows
                .map(|((load, way), residual)| residual + slope[0] * load + 0.5 * lag_counts * way)
                .collect(),
            zero,
            slope,
            cross: at(Part::Other).map(over_slope),
            hysteresis: at(Part::Direction).map(pair),
            drift: at(Part::Temperature)
                .zip(at(Part::LoadTemperature))
                .map(|(zero, gain)| [pair(zero), over_slope(gain)]),
            reference_c: mean_c,
            temperature_range_k,
            widen: student_over_normal((load.len() - parts.len()) as f64),
            condition: fit.condition,
            excitation: at(Part::Load).map_or(0.0, |k| fit.excitation[k]),
            whiteness: fit.whiteness,
            largest_residual: fit.residuals.iter().fold(0.0, |most, r| r.abs().max(most)),
            range_counts,
            load,
            direction,
        })
    }
}

/// Ratio of two coefficients and its standard deviation, with their covariance.
fn ratio(fit: &Fit, covariance: &DMatrix<f64>, [k, over]: [usize; 2]) -> [f64; 2] {
    let below = fit.coefficients[over];
    let ratio = fit.coefficients[k] / below;
    let variance = covariance[(k, k)] + ratio * ratio * covariance[(over, over)]
        - 2.0 * ratio * covariance[(k, over)];
    [ratio, variance.max(0.0).sqrt() / below.abs()]
}

/// Change of the counts over the range of the load, if it is large enough.
fn changes(slope: [f64; 2], range: f64, name: &str) -> Result<f64, Refusal> {
    let (found, unsure) = ((slope[0] * range).abs(), SLOPE_SIGMAS * slope[1] * range);
    if found >= COUNTS_NEEDED && found >= unsure {
        return Ok(found);
    }
    Err(Refusal::NotExcited {
        what: String::new(),
        quantity: format!("change of the counts over the range of {name}"),
        found,
        needed: COUNTS_NEEDED.max(unsure.ceil()),
        unit: "counts".to_owned(),
        help: "use larger loads, and look at gauge, bridge and cable of the channel".to_owned(),
    })
}

fn solve(
    counts: &[f64],
    parts: &[Part],
    value: &impl Fn(usize, Part) -> f64,
) -> Result<Fit, Refusal> {
    let rows = counts.len();
    if rows <= parts.len() {
        return Err(Refusal::NotExcited {
            what: String::new(),
            quantity: "number of rows".to_owned(),
            found: rows as f64,
            needed: (parts.len() + 1) as f64,
            unit: "-".to_owned(),
            help: format!("{} values are unknown; {MORE_LOADS}", parts.len()),
        });
    }
    let design = DMatrix::from_fn(rows, parts.len(), |row, k| value(row, parts[k]));
    least_squares(&design, &DVector::from_column_slice(counts)).map_err(|refusal| {
        refusal.advise(
            "load_n, moment_n_m and temperature_c change together; add rows in which only one of them changes",
        )
    })
}

/// Covariance with white residuals, whose variance is at least that of the rounding.
fn covariance(fit: &Fit, counts: &[f64]) -> DMatrix<f64> {
    let free = (counts.len() - fit.coefficients.len()) as f64;
    let square = fit.residuals.iter().map(|r| r * r).sum::<f64>() / free;
    let is_whole = counts.iter().all(|count| count.fract() == 0.0);
    if is_whole && square < ROUNDING_COUNTS2 {
        // The leverage is that of residuals of variance one.
        return fit.leverage.transpose() * &fit.leverage * ROUNDING_COUNTS2;
    }
    fit.covariance_white.clone()
}

fn parts(other: &[f64], direction: &[f64], temperature_range_k: Option<f64>) -> Vec<Part> {
    let mut parts = vec![Part::Zero, Part::Load];
    if range(other) > 0.0 {
        parts.push(Part::Other);
    }
    let count = |sign: f64| direction.iter().filter(|d| **d == sign).count();
    if count(1.0) >= BRANCH_NEEDED && count(-1.0) >= BRANCH_NEEDED {
        parts.push(Part::Direction);
    }
    if temperature_range_k.is_some_and(|range_k| range_k >= CHANGE_NEEDED_K) {
        parts.extend([Part::Temperature, Part::LoadTemperature]);
    }
    parts
}

fn range(values: &[f64]) -> f64 {
    let [low, high] = values
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
            [low.min(*value), high.max(*value)]
        });
    (high - low).max(0.0)
}

fn different(load: &[f64], name: &str) -> Result<(), Refusal> {
    let mut sorted = load.to_vec();
    sorted.sort_by(f64::total_cmp);
    let apart = APART * range(load);
    sorted.dedup_by(|a, b| (*a - *b).abs() <= apart);
    if sorted.len() >= LOADS_NEEDED {
        return Ok(());
    }
    Err(Refusal::NotExcited {
        what: String::new(),
        quantity: format!("number of different loads ({name})"),
        found: sorted.len() as f64,
        needed: LOADS_NEEDED as f64,
        unit: "-".to_owned(),
        help: MORE_LOADS.to_owned(),
    })
}

/// Direction of the last change of the load before each row. The first row has the direction from no load.
fn directions(load: &[f64]) -> Vec<f64> {
    let apart = APART * range(load);
    let (mut last, mut direction) = (0.0, 0.0);
    load.iter()
        .map(|load| {
            if (load - last).abs() > apart {
                direction = (load - last).signum();
                last = *load;
            }
            direction
        })
        .collect()
}
