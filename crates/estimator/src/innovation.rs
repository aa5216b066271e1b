//! Normalised innovations by what was measured.
//!
//! With y what a sensor says beyond what the filter foretold and S the variance that the filter
//! expects of it, y^2/S is chi-square with one degree of freedom where the filter is right, and the
//! sum of n of them, which are independent then, with n (Bar-Shalom, Li and Kirubarajan, Estimation
//! with Applications to Tracking and Navigation (2001), section 5.4.2).

use sample::{InnovationKind, Innovations};

/// Sums since the last report.
#[derive(Clone, Copy, Debug, Default)]
pub struct InnovationTally {
    sums: [Sum; InnovationKind::COUNT],
}

#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    square: f64,
    count: u32,
    rejected: u32,
}

impl InnovationTally {
    /// Counts a measurement that was taken in, by y^2/S.
    pub fn used(&mut self, kind: InnovationKind, square: f64) {
        let sum = &mut self.sums[kind.index()];
        sum.square += square;
        sum.count += 1;
    }

    /// Counts one that was left out.
    pub fn rejected(&mut self, kind: InnovationKind) {
        self.sums[kind.index()].rejected += 1;
    }

    /// What was counted here and in `other` since the last report.
    pub fn report(&mut self, other: &mut Self) -> [Innovations; InnovationKind::COUNT] {
        let [own, other] = [self, other].map(std::mem::take);
        std::array::from_fn(|kind| {
            let [a, b] = [own.sums[kind], other.sums[kind]];
            let count = a.count + b.count;
            Innovations {
                count,
                mean_square: (a.square + b.square) / f64::from(count.max(1)),
                rejected: a.rejected + b.rejected,
            }
        })
    }
}
