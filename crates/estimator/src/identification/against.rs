//! Comparison of two sets of identified tyre parameters (section 2.4.5 of the thesis): two tyres, two pressures, or
//! the same tyre on two days.
//!
//! For each parameter that both sets have, the difference d = a - b has the variance of both, whose errors are
//! independent. The parameters together are compared by
//!
//! chi^2 = d^T (C_a + C_b)^-1 d
//!
//! with the covariances C_a and C_b. Tyres that are equal exceed it with the probability of the chi-squared
//! distribution with as many degrees of freedom as there are parameters.

use nalgebra::{DMatrix, DVector};
use serde::Deserialize;

use crate::EstimatorError;
use crate::finding::{Finding, Findings, Refusal, Span};
use crate::statistics::{chi_squared_above, interval_95};

const WHAT: &str = "comparison of tyres";
/// Parameters that belong to the drive and not to the tyre.
const OF_THE_DRIVE: [&str; 1] = ["slip_angle_offset"];
/// Probability below which equal tyres are not credible.
const EQUAL_MIN: f64 = 0.05;

/// A file of `identify tyre -o`, as far as it is compared.
#[derive(Deserialize)]
struct File {
    #[serde(default)]
    made_by: String,
    #[serde(default)]
    result: Vec<Set>,
}

#[derive(Deserialize)]
struct Set {
    what: String,
    #[serde(default)]
    findings: Vec<Value>,
    #[serde(default)]
    covariance: Vec<Vec<f64>>,
    #[serde(default)]
    beside: Vec<(String, f64, String)>,
}

#[derive(Deserialize)]
struct Value {
    name: String,
    value: f64,
    unit: String,
    sigma: f64,
}

/// Results in the text of a file of `identify tyre -o`.
///
/// # Errors
/// A text that is not TOML or was made by another command.
pub fn results(text: &str) -> Result<Vec<Findings>, EstimatorError> {
    let file: File = sample::boundary::guarded(|| toml::from_str(text))
        .map_err(EstimatorError::Parse)?
        .map_err(|error| EstimatorError::Parse(error.to_string()))?;
    if file.made_by != "identify tyre" || file.result.is_empty() {
        return Err(Refusal::Missing {
            what: WHAT.to_owned(),
            channel: "result of `identify tyre` in the file".to_owned(),
            help: "give a log, or a file that `atvrec identify tyre -o` wrote".to_owned(),
        }
        .into());
    }
    let finding = |value: Value| Finding {
        name: value.name,
        value: value.value,
        unit: value.unit,
        sigma: value.sigma,
        interval: None,
        condition: f64::NAN,
        excitation: None,
        whiteness: None,
        span: Span::default(),
    };
    let findings = |set: Set| Findings {
        what: set.what,
        findings: set.findings.into_iter().map(finding).collect(),
        covariance: set.covariance,
        beside: set.beside,
        ..Findings::default()
    };
    Ok(file.result.into_iter().map(findings).collect())
}

/// Differences between two sets, one result for each tyre and model that both have. Each finding is the own value
/// less the other one.
///
/// # Errors
/// If no tyre and model is in both sets.
pub fn differences(own: &[Findings], other: &[Findings]) -> Result<Vec<Findings>, Refusal> {
    let pairs = own.iter().filter_map(|a| {
        let b = other.iter().find(|b| b.what == a.what)?;
        difference(a, b)
    });
    let found: Vec<Findings> = pairs.collect();
    if !found.is_empty() {
        return Ok(found);
    }
    let names = |set: &[Findings]| {
        let all: Vec<&str> = set.iter().map(|findings| findings.what.as_str()).collect();
        all.join(", ")
    };
    Err(Refusal::Missing {
        what: WHAT.to_owned(),
        channel: "tyre and model that both sets have".to_owned(),
        help: format!(
            "the first set has {}, the other one {}; identify both with the same --model",
            names(own),
            names(other)
        ),
    })
}

fn difference(a: &Findings, b: &Findings) -> Option<Findings> {
    // Places of the parameters that both have.
    let shared: Vec<[usize; 2]> = (a.findings.iter().enumerate())
        .filter(|(_, of)| of.sigma.is_finite() && !OF_THE_DRIVE.contains(&of.name.as_str()))
        .filter_map(|(i, of)| {
            let is_same = |other: &&Finding| other.name == of.name && other.unit == of.unit;
            let j = b.findings.iter().position(|other| is_same(&other))?;
            b.findings[j].sigma.is_finite().then_some([i, j])
        })
        .collect();
    if shared.is_empty() {
        return None;
    }
    let mut found = Findings {
        what: format!("{}: first less other", a.what),
        ..Findings::default()
    };
    for [i, j] in &shared {
        let (of, other) = (&a.findings[*i], &b.findings[*j]);
        let (value, sigma) = (of.value - other.value, math::hypot(of.sigma, other.sigma));
        let interval = interval_95(value, sigma);
        found.findings.push(Finding {
            name: format!("{}_difference", of.name),
            value,
            sigma,
            interval: Some(interval),
            condition: f64::NAN,
            excitation: None,
            whiteness: None,
            ..of.clone()
        });
        for (name, one) in [("first", of), ("other", other)] {
            found.beside.push((
                format!("{} of the {name} set", of.name),
                one.value,
                one.unit.clone(),
            ));
        }
        let differs = interval[0] > 0.0 || interval[1] < 0.0;
        found.notes.push(format!(
            "{}: {}",
            of.name,
            if differs {
                "the sets differ (the 95 % interval of the difference does not contain zero)"
            } else {
                "no difference is found (the 95 % interval of the difference contains zero)"
            }
        ));
    }
    let covariance = block(a, &shared, 0)? + block(b, &shared, 1)?;
    found.covariance = (0..shared.len())
        .map(|i| (0..shared.len()).map(|j| covariance[(i, j)]).collect())
        .collect();
    found.notes.push(together(&found, &covariance));
    Some(found)
}

/// Covariance of the shared parameters of a set; without correlations where the set has none.
fn block(set: &Findings, shared: &[[usize; 2]], side: usize) -> Option<DMatrix<f64>> {
    let size = set.findings.len();
    let has_all =
        set.covariance.len() == size && set.covariance.iter().all(|row| row.len() == size);
    let at = |i: usize, j: usize| {
        if has_all {
            set.covariance[i][j]
        } else if i == j {
            set.findings[i].sigma.powi(2)
        } else {
            0.0
        }
    };
    let matrix = DMatrix::from_fn(shared.len(), shared.len(), |i, j| {
        at(shared[i][side], shared[j][side])
    });
    matrix
        .iter()
        .all(|value| value.is_finite())
        .then_some(matrix)
}

/// What all parameters together say.
fn together(found: &Findings, covariance: &DMatrix<f64>) -> String {
    let size = found.findings.len();
    // Scaled by the standard deviations: the units of the parameters differ by many powers of ten.
    let scale = DVector::from_fn(size, |i, _| {
        covariance[(i, i)].sqrt().max(f64::MIN_POSITIVE)
    });
    let scaled = DMatrix::from_fn(size, size, |i, j| {
        covariance[(i, j)] / (scale[i] * scale[j])
    });
    let d = DVector::from_fn(size, |i, _| found.findings[i].value / scale[i]);
    let Some(inverse) = scaled.cholesky() else {
        return "all parameters together: not compared, because their covariance is singular"
            .to_owned();
    };
    let chi_squared = d.dot(&inverse.solve(&d));
    let probability = chi_squared_above(chi_squared, size as f64);
    let statement = if probability < EQUAL_MIN {
        "the tyres differ"
    } else {
        "the tyres can be equal"
    };
    format!(
        "all parameters together: {statement}; equal tyres have a larger difference in {:.1} % of all cases",
        100.0 * probability
    )
}

#[cfg(test)]
mod tests;
