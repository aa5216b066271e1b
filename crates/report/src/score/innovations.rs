//! Whether innovations are as large as the filters expect, second by second. No truth is needed.

use std::collections::BTreeMap;

use estimator::consistency::chi_squared_bounds;
use estimator::score::Distribution;
use sample::{InnovationKind, Innovations, LogTime, Parameters};
use serde_json::{Value, json};
use store::{Reader, Record, Selection};

use super::ScoreError;

/// Innovations of one kind of measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct InnovationScore {
    /// What was measured.
    pub kind: InnovationKind,
    /// Scalar measurements that were taken in.
    pub count: u64,
    /// Measurements that were left out because they contradicted the state.
    pub rejected: u64,
    /// Mean of y^2/S over those taken in.
    pub mean: f64,
    /// Windows: the seconds in which any was taken in.
    pub windows: usize,
    /// Median of the windows' means.
    pub median: f64,
    /// Part of them whose mean lies within the 95 % bounds of chi-square.
    pub inside: f64,
    /// Part of them above the upper bound: the filter is too sure of itself.
    pub above: f64,
    /// 95 % bounds of a window with as many measurements as the windows have on the average.
    pub bounds: [f64; 2],
}

/// Judges a log's innovations by its reports of each second, leaving out those that begin within
/// `from_s` of the first report; kinds of which nothing was measured are left out.
///
/// # Errors
/// If the log cannot be read.
pub fn innovations(reader: &Reader, from_s: f64) -> Result<Vec<InnovationScore>, ScoreError> {
    let mut reports = Vec::new();
    for message in reader.messages(Selection::topics(["/estimate/parameters"])) {
        if let Some(Record::Parameters(parameters)) = message?.record()? {
            reports.push(Judged::new(&parameters));
        }
    }
    Ok(judged(&reports, from_s))
}

/// What is judged of a report.
pub(super) struct Judged {
    time: LogTime,
    innovations: [Innovations; InnovationKind::ALL.len()],
}

impl Judged {
    pub fn new(report: &Parameters) -> Self {
        Self {
            time: report.time,
            innovations: report.innovations,
        }
    }
}

/// Judges reports of each second.
pub(super) fn judged(reports: &[Judged], from_s: f64) -> Vec<InnovationScore> {
    let first = reports
        .first()
        .map(|report| report.time)
        .unwrap_or_default();
    let late = reports
        .iter()
        .filter(|report| report.time.seconds_since(first) >= from_s + 1.0);
    let of_kind =
        |kind: InnovationKind| judge(kind, late.clone().map(|all| all.innovations[kind.index()]));
    InnovationKind::ALL
        .into_iter()
        .filter_map(of_kind)
        .collect()
}

fn judge(
    kind: InnovationKind,
    reports: impl Iterator<Item = Innovations>,
) -> Option<InnovationScore> {
    let (mut count, mut rejected, mut sum) = (0, 0, 0.0);
    let (mut inside, mut above) = (0_usize, 0_usize);
    let mut means = Distribution::default();
    // Few numbers of measurements in a second occur, and the bounds take long.
    let mut bounds = BTreeMap::new();
    for found in reports {
        rejected += u64::from(found.rejected);
        if found.count == 0 {
            continue;
        }
        let [low, high] = *bounds
            .entry(found.count)
            .or_insert_with(|| chi_squared_bounds(f64::from(found.count)));
        means.push(found.mean_square);
        inside += usize::from((low..=high).contains(&found.mean_square));
        above += usize::from(found.mean_square > high);
        count += u64::from(found.count);
        sum += f64::from(found.count) * found.mean_square;
    }
    let windows = means.count();
    let part = |some: usize| some as f64 / windows as f64;
    let median = means.median()?;
    Some(InnovationScore {
        kind,
        count,
        rejected,
        mean: sum / count as f64,
        median,
        windows,
        inside: part(inside),
        above: part(above),
        bounds: chi_squared_bounds(count as f64 / windows as f64),
    })
}

/// As JSON: a list, one entry for each kind.
#[must_use]
pub fn innovations_json(found: &[InnovationScore]) -> Value {
    let of_kind = |found: &InnovationScore| {
        json!({
            "kind": found.kind.name(),
            "count": found.count,
            "rejected": found.rejected,
            "mean": found.mean,
            "median": found.median,
            "windows": found.windows,
            "inside": found.inside,
            "above": found.above,
            "bounds": found.bounds,
        })
    };
    found.iter().map(of_kind).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_are_judged_by_their_own_count() {
        let window = |count, mean_square| Innovations {
            count,
            mean_square,
            rejected: 1,
        };
        // 1.2 is within the bounds of 100 squares (0.74 to 1.30), not of 1000 (0.91 to 1.09).
        let reports = [
            window(100, 1.2),
            window(1000, 1.2),
            window(1000, 0.8),
            window(0, 0.0),
        ];
        let found = judge(InnovationKind::Gyro, reports.into_iter()).unwrap();
        assert_eq!((found.count, found.rejected, found.windows), (2100, 4, 3));
        assert!((found.mean - 2120.0 / 2100.0).abs() < 1e-12, "{found:?}");
        let third = 1.0 / 3.0;
        assert!((found.inside - third).abs() < 1e-12 && (found.above - third).abs() < 1e-12);
        assert!((found.bounds[0] - 0.898).abs() < 2e-3, "{found:?}");
        assert!(judge(InnovationKind::Gyro, [window(0, 0.0)].into_iter()).is_none());
    }
}
