//! Normalised innovations squared (NIS) by kind of measurement.
//!
//! With the innovation y and its variance S, y²/S is chi-square with one degree of freedom in a
//! consistent filter, and the sum of n independent ones with n (Bar-Shalom, Li and Kirubarajan,
//! Estimation with Applications to Tracking and Navigation (2001), section 5.4.2).

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
    /// Counts a measurement that was used, by y²/S.
    pub fn used(&mut self, kind: InnovationKind, square: f64) {
        let sum = &mut self.sums[kind.index()];
        sum.square += square;
        sum.count += 1;
    }

    /// Counts a measurement that was rejected.
    pub fn rejected(&mut self, kind: InnovationKind) {
        self.sums[kind.index()].rejected += 1;
    }

    /// Sums of this tally and of `other` since the last report.
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
