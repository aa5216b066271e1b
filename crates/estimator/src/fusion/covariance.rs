//! A symmetric covariance matrix with the few operations that the filter needs.

use multiversion::multiversion;

use nalgebra::SVector;

use super::layout::{MOMENT, SIZE};
use crate::trace::{Operation, Restart, Term, Trace};

/// Largest variance of any state: keeps a blind filter's numbers tame.
const VARIANCE_MAX: f64 = 1e10;
/// Columns that are updated together; a power of two.
const LANES: usize = 8;
/// Measurements that are taken off together: each element is then loaded and stored once for all.
const BATCH: usize = 6;

/// A sparse row of a measurement equation: positions and values.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    index: [u8; Self::CAPACITY],
    value: [f64; Self::CAPACITY],
    length: usize,
}

impl Row {
    const CAPACITY: usize = 48;

    /// A row of zeros.
    pub fn new() -> Self {
        Self {
            index: [0; Self::CAPACITY],
            value: [0.0; Self::CAPACITY],
            length: 0,
        }
    }

    /// Adds a term. A row never has more than its capacity: 36 of the balances and a few more.
    pub fn add(&mut self, index: usize, value: f64) {
        if self.length < Self::CAPACITY && value != 0.0 {
            self.index[self.length] = index as u8;
            self.value[self.length] = value;
            self.length += 1;
        }
    }

    /// The row times a factor.
    pub fn scaled(mut self, factor: f64) -> Self {
        for value in &mut self.value[..self.length] {
            *value *= factor;
        }
        self
    }

    /// Positions and values.
    pub fn terms(&self) -> impl Iterator<Item = (usize, f64)> {
        let index = self.index[..self.length].iter().map(|i| usize::from(*i));
        index.zip(self.value[..self.length].iter().copied())
    }

    /// The row times a state.
    pub fn times(&self, state: &[f64; SIZE]) -> f64 {
        self.terms().map(|(i, value)| value * state[i]).sum()
    }
}

/// The matrix. Measurements change its upper half only (whole blocks of [`LANES`] columns), and wait
/// until [`BATCH`] of them can be taken off together; [`Covariance::settle`] takes the rest off and
/// [`Covariance::mirror`] completes the lower half before the prediction, which needs both.
#[derive(Clone, Debug)]
pub struct Covariance {
    p: [[f64; SIZE]; SIZE],
    /// What waits: P h' of measurements and 1/S, the first `waiting` of them.
    taken: [[f64; SIZE]; BATCH],
    weight: [f64; BATCH],
    waiting: usize,
    /// Every change of the matrix.
    pub trace: Trace<SIZE>,
}

impl Default for Covariance {
    fn default() -> Self {
        Self {
            p: [[0.0; SIZE]; SIZE],
            taken: [[0.0; SIZE]; BATCH],
            weight: [0.0; BATCH],
            waiting: 0,
            trace: Trace::default(),
        }
    }
}

impl Covariance {
    /// A diagonal matrix, around the state.
    pub fn reset(&mut self, variance: &[f64; SIZE], state: &[f64; SIZE]) {
        self.trace.note(|| {
            Operation::Restart(Box::new(Restart {
                state: SVector::from(*state),
                variance: SVector::from(*variance),
            }))
        });
        self.waiting = 0;
        self.p = [[0.0; SIZE]; SIZE];
        for (i, v) in variance.iter().enumerate() {
            self.p[i][i] = *v;
        }
    }

    /// Takes off what waits.
    pub fn settle(&mut self) {
        if self.waiting > 0 {
            self.taken[self.waiting..].fill([0.0; SIZE]);
            reduce(&mut self.p, &self.taken, &self.weight);
            self.waiting = 0;
        }
    }

    /// Copies the upper half to the lower one; nothing must wait.
    pub fn mirror(&mut self) {
        for i in 1..SIZE {
            for j in 0..i {
                self.p[i][j] = self.p[j][i];
            }
        }
    }

    /// Covariances of a state with all states; nothing must wait.
    pub fn row(&self, i: usize) -> SVector<f64, SIZE> {
        SVector::from_fn(|j, _| self.p[i.min(j)][i.max(j)])
    }

    /// Variance of a state.
    pub fn variance(&self, i: usize) -> f64 {
        let taken = self.waiting().map(|(ph, weight)| weight * ph[i] * ph[i]);
        self.p[i][i] - taken.sum::<f64>()
    }

    fn waiting(&self) -> impl Iterator<Item = (&[f64; SIZE], f64)> {
        let all = self.taken.iter().zip(self.weight.iter().copied());
        all.take(self.waiting)
    }

    /// Whether every variance is a number that a variance can be; nothing must wait.
    pub fn sound(&self) -> bool {
        (0..SIZE).all(|i| self.p[i][i] >= -1e-6 && self.p[i][i] <= 1e3 * VARIANCE_MAX)
    }

    /// Makes a state independent of all others, with this variance; nothing must wait.
    pub fn forget(&mut self, i: usize, variance: f64) {
        self.trace.note(|| Operation::Forget { index: i, variance });
        self.p[i] = [0.0; SIZE];
        for row in &mut self.p {
            row[i] = 0.0;
        }
        self.p[i][i] = variance;
    }

    /// Adds variance to a state, up to a bound.
    pub fn add_noise(&mut self, i: usize, variance: f64) {
        if self.p[i][i] < VARIANCE_MAX {
            self.p[i][i] += variance;
            self.note_noise(i, i, variance);
        }
    }

    /// Integrated white noise of density `q` over `dt`.
    pub fn add_noise_pair(&mut self, value: usize, rate: usize, q: f64, dt: f64) {
        if self.p[value][value] < VARIANCE_MAX {
            let [of_value, between, of_rate] = [q * dt * dt * dt / 3.0, q * dt * dt / 2.0, q * dt];
            self.p[value][value] += of_value;
            self.p[value][rate] += between;
            self.p[rate][value] += between;
            self.p[rate][rate] += of_rate;
            self.note_noise(value, value, of_value);
            self.note_noise(value, rate, between);
            self.note_noise(rate, rate, of_rate);
        }
    }

    fn note_noise(&mut self, row: usize, column: usize, value: f64) {
        self.trace
            .note(|| Operation::Noise(Term { row, column, value }));
    }

    /// x[value..] += dt x[rate..], `count` of them.
    pub fn integrate(&mut self, value: usize, rate: usize, count: usize, dt: f64) {
        self.trace.note(|| {
            let terms = (0..count).map(|k| Term {
                row: value + k,
                column: rate + k,
                value: dt,
            });
            Operation::Mix(terms.collect())
        });
        for k in 0..count {
            let source = self.p[rate + k];
            for (p, s) in self.p[value + k].iter_mut().zip(&source) {
                *p += dt * s;
            }
        }
        for row in &mut self.p {
            for k in 0..count {
                row[value + k] += dt * row[rate + k];
            }
        }
    }

    /// x[i] *= keep[i].
    pub fn scale(&mut self, keep: &[f64; SIZE]) {
        self.trace.note(|| {
            let fading = keep.iter().enumerate().filter(|(_, keep)| **keep != 1.0);
            let terms = fading.map(|(i, keep)| Term {
                row: i,
                column: i,
                value: keep - 1.0,
            });
            Operation::Mix(terms.collect())
        });
        for (row, of_row) in self.p.iter_mut().zip(keep) {
            for (p, of_column) in row.iter_mut().zip(keep) {
                *p *= of_row * of_column;
            }
        }
    }

    /// x[first + k] += dt sum_j jacobian[k][j] x[j] over forces and moments, k = 0..3. Both halves
    /// must be there; the columns of the states that stay follow from the rows by symmetry.
    pub fn add_rows(&mut self, first: usize, jacobian: &[[f64; 24]; 3], dt: f64) {
        self.trace.note(|| {
            let terms = jacobian.iter().enumerate().flat_map(|(k, gains)| {
                gains.iter().enumerate().map(move |(j, gain)| Term {
                    row: first + k,
                    column: position(j),
                    value: dt * gain,
                })
            });
            Operation::Mix(terms.collect())
        });
        let mut added = [[0.0; SIZE]; 3];
        for (sum, gains) in added.iter_mut().zip(jacobian) {
            for (j, gain) in gains.iter().enumerate() {
                for (s, p) in sum.iter_mut().zip(&self.p[position(j)]) {
                    *s += dt * gain * p;
                }
            }
        }
        for (k, sum) in added.iter().enumerate() {
            for (p, s) in self.p[first + k].iter_mut().zip(sum) {
                *p += s;
            }
        }
        for (i, row) in self.p.iter_mut().enumerate() {
            for (k, gains) in jacobian.iter().enumerate() {
                row[first + k] += if (first..first + 3).contains(&i) {
                    let gains = gains.iter().enumerate();
                    dt * gains.map(|(j, gain)| gain * row[position(j)]).sum::<f64>()
                } else {
                    added[k][i]
                };
            }
        }
    }

    /// Covariance of the state with a row's value.
    pub fn times(&self, row: &Row) -> [f64; SIZE] {
        let mut sum = times(&self.p, row);
        for (ph, weight) in self.waiting() {
            let part = weight * row.times(ph);
            for (s, p) in sum.iter_mut().zip(ph) {
                *s -= part * p;
            }
        }
        sum
    }

    /// P -= ph ph' / total, soon.
    pub fn reduce(&mut self, ph: &[f64; SIZE], total: f64) {
        self.taken[self.waiting] = *ph;
        self.weight[self.waiting] = 1.0 / total;
        self.waiting += 1;
        if self.waiting == BATCH {
            self.settle();
        }
    }
}

// The two kernels take half of the filter's time. Wider registers do the same operations on the same
// numbers, each rounded as ever, so every processor gives the same bits.

#[multiversion(targets("x86_64+avx+avx2"))]
fn times(matrix: &[[f64; SIZE]; SIZE], row: &Row) -> [f64; SIZE] {
    let mut sum = [0.0; SIZE];
    for (i, value) in row.terms() {
        let begin = i & !(LANES - 1);
        for (s, p) in sum.iter_mut().zip(matrix).take(begin) {
            *s += value * p[i];
        }
        for (s, p) in sum[begin..].iter_mut().zip(&matrix[i][begin..]) {
            *s += value * p;
        }
    }
    sum
}

#[allow(
    clippy::needless_range_loop,
    reason = "with iterators the compiler makes slower code of it"
)]
#[multiversion(targets("x86_64+avx+avx2"))]
fn reduce(matrix: &mut [[f64; SIZE]; SIZE], taken: &[[f64; SIZE]; BATCH], weight: &[f64; BATCH]) {
    for (i, row) in matrix.iter_mut().enumerate() {
        let gains: [f64; BATCH] = std::array::from_fn(|m| taken[m][i] * weight[m]);
        let begin = i & !(LANES - 1);
        for j in begin..SIZE {
            let mut left = row[j];
            for m in 0..BATCH {
                left -= gains[m] * taken[m][j];
            }
            row[j] = left;
        }
    }
}

/// Position of the j-th of twelve forces and twelve moments.
pub fn position(j: usize) -> usize {
    if j < 12 { j } else { MOMENT + j - 12 }
}
