//! A symmetric covariance matrix with the few operations that the filter needs.

use multiversion::multiversion;

use super::layout::{MOMENT, SIZE};

/// Largest variance of any state: keeps a blind filter's numbers tame.
const VARIANCE_MAX: f64 = 1e10;
/// Columns that are updated together; a power of two.
const LANES: usize = 8;

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

/// The matrix. Measurements change its upper half only (whole blocks of [`LANES`] columns);
/// [`Covariance::mirror`] completes the lower one before the prediction, which needs both.
#[derive(Clone, Debug)]
pub struct Covariance([[f64; SIZE]; SIZE]);

impl Default for Covariance {
    fn default() -> Self {
        Self([[0.0; SIZE]; SIZE])
    }
}

impl Covariance {
    /// A diagonal matrix.
    pub fn reset(&mut self, variance: &[f64; SIZE]) {
        self.0 = [[0.0; SIZE]; SIZE];
        for (i, v) in variance.iter().enumerate() {
            self.0[i][i] = *v;
        }
    }

    /// Copies the upper half to the lower one.
    pub fn mirror(&mut self) {
        for i in 1..SIZE {
            for j in 0..i {
                self.0[i][j] = self.0[j][i];
            }
        }
    }

    /// Variance of a state.
    pub fn variance(&self, i: usize) -> f64 {
        self.0[i][i]
    }

    /// Whether every variance is a number that a variance can be.
    pub fn sound(&self) -> bool {
        (0..SIZE).all(|i| self.0[i][i] >= -1e-6 && self.0[i][i] <= 1e3 * VARIANCE_MAX)
    }

    /// Makes a state independent of all others, with this variance.
    pub fn forget(&mut self, i: usize, variance: f64) {
        self.0[i] = [0.0; SIZE];
        for row in &mut self.0 {
            row[i] = 0.0;
        }
        self.0[i][i] = variance;
    }

    /// Adds variance to a state, up to a bound.
    pub fn add_noise(&mut self, i: usize, variance: f64) {
        if self.0[i][i] < VARIANCE_MAX {
            self.0[i][i] += variance;
        }
    }

    /// Integrated white noise of density `q` over `dt`.
    pub fn add_noise_pair(&mut self, value: usize, rate: usize, q: f64, dt: f64) {
        if self.0[value][value] < VARIANCE_MAX {
            self.0[value][value] += q * dt * dt * dt / 3.0;
            self.0[value][rate] += q * dt * dt / 2.0;
            self.0[rate][value] += q * dt * dt / 2.0;
            self.0[rate][rate] += q * dt;
        }
    }

    /// x[value..] += dt x[rate..], `count` of them.
    pub fn integrate(&mut self, value: usize, rate: usize, count: usize, dt: f64) {
        for k in 0..count {
            let source = self.0[rate + k];
            for (p, s) in self.0[value + k].iter_mut().zip(&source) {
                *p += dt * s;
            }
        }
        for row in &mut self.0 {
            for k in 0..count {
                row[value + k] += dt * row[rate + k];
            }
        }
    }

    /// x[i] *= keep.
    pub fn scale(&mut self, i: usize, keep: f64) {
        for p in &mut self.0[i] {
            *p *= keep;
        }
        for row in &mut self.0 {
            row[i] *= keep;
        }
    }

    /// x[first + k] += dt sum_j jacobian[k][j] x[j] over forces and moments, k = 0..3. Both halves
    /// must be there; the columns of the states that stay follow from the rows by symmetry.
    pub fn add_rows(&mut self, first: usize, jacobian: &[[f64; 24]; 3], dt: f64) {
        let mut added = [[0.0; SIZE]; 3];
        for (sum, gains) in added.iter_mut().zip(jacobian) {
            for (j, gain) in gains.iter().enumerate() {
                for (s, p) in sum.iter_mut().zip(&self.0[position(j)]) {
                    *s += dt * gain * p;
                }
            }
        }
        for (k, sum) in added.iter().enumerate() {
            for (p, s) in self.0[first + k].iter_mut().zip(sum) {
                *p += s;
            }
        }
        for (i, row) in self.0.iter_mut().enumerate() {
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
        times(&self.0, row)
    }

    /// P -= ph ph' / total.
    pub fn reduce(&mut self, ph: &[f64; SIZE], total: f64) {
        reduce(&mut self.0, ph, total);
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

#[multiversion(targets("x86_64+avx+avx2"))]
fn reduce(matrix: &mut [[f64; SIZE]; SIZE], ph: &[f64; SIZE], total: f64) {
    let inverse = 1.0 / total;
    for (i, row) in matrix.iter_mut().enumerate() {
        let gain = ph[i] * inverse;
        if gain == 0.0 {
            continue;
        }
        let begin = i & !(LANES - 1);
        for (p, other) in row[begin..].iter_mut().zip(&ph[begin..]) {
            *p -= gain * other;
        }
    }
}

/// Position of the j-th of twelve forces and twelve moments.
pub fn position(j: usize) -> usize {
    if j < 12 { j } else { MOMENT + j - 12 }
}
