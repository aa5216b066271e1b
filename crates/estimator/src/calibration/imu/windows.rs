//! Windows of a drive that a row of a regression comes from.

use std::ops::Range;

use super::{ImuLog, ImuSignal};
use crate::finding::Span;

/// Readings at each end of a window that its change is taken from.
pub(in crate::calibration) const END_READINGS: usize = 10;

impl ImuSignal<'_> {
    pub(super) fn rows(&self, from_s: f64, to_s: f64) -> Range<usize> {
        let first = self.time_s.partition_point(|&time_s| time_s < from_s);
        let last = self.time_s.partition_point(|&time_s| time_s <= to_s);
        first..last.max(first)
    }
}

/// Windows of a log between its rests, gapless and of full length.
pub(in crate::calibration) fn windows(log: &ImuLog<'_>, length_s: f64) -> Vec<Range<usize>> {
    let imu = &log.imu;
    let count = imu
        .time_s
        .len()
        .min(imu.force_m_s2.len())
        .min(imu.rate_rad_s.len());
    let resting = |time_s: f64| {
        log.rest
            .iter()
            .any(|rest| (rest.from_s..=rest.to_s).contains(&time_s))
    };
    let mut windows = Vec::new();
    let mut start = 0;
    for k in 1..count {
        let gap = imu.time_s[k] - imu.time_s[k - 1] > 0.05 || resting(imu.time_s[k]);
        if gap || resting(imu.time_s[start]) {
            start = k;
        } else if imu.time_s[k] - imu.time_s[start] >= length_s {
            if k - start >= 2 * END_READINGS {
                windows.push(start..k);
            }
            start = k;
        }
    }
    windows
}

pub(in crate::calibration) fn extend(span: &mut Span, from_s: f64, to_s: f64, rows: usize) {
    if span.rows == 0 {
        span.from_s = from_s;
    }
    span.to_s = to_s;
    span.used_s += to_s - from_s;
    span.rows += rows;
}
