//! A symmetric covariance matrix with the few operations that the filter needs.

use std::ops::{Deref, DerefMut};

use multiversion::multiversion;

use nalgebra::SVector;

use super::layout::{MOMENT, OFFSET, SIZE};
use crate::trace::{Operation, Restart, Term, Trace, Update};

/// Largest variance of any state: keeps a blind filter's numbers tame.
const VARIANCE_MAX: f64 = 1e10;
/// Columns that are updated together; a power of two.
const LANES: usize = 8;
/// Numbers of a row in memory: whole vectors. Those past the states stay zero.
const WIDTH: usize = SIZE.next_multiple_of(LANES);
/// Measurements that are taken off together: each element is then loaded and stored once for all.
const BATCH: usize = 6;

/// States that move themselves or one another; those from here on only fade.
const MOVED: usize = OFFSET;

/// One number for each state.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct Column([f64; WIDTH]);

impl Column {
    const ZERO: Self = Self([0.0; WIDTH]);
}

impl Deref for Column {
    type Target = [f64; WIDTH];

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl DerefMut for Column {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.0
    }
}

/// Terms of a row that are summed together.
const FOUR: usize = 4;

/// A sparse row of a measurement equation: positions and values, `N` of them at most, a multiple of
/// four; those past the last are zero.
#[derive(Clone, Copy, Debug)]
pub struct Row<const N: usize> {
    index: [u8; N],
    value: [f64; N],
    length: usize,
}

impl<const N: usize> Row<N> {
    /// A row of zeros.
    pub fn new() -> Self {
        const { assert!(N.is_multiple_of(FOUR)) };
        Self {
            index: [0; N],
            value: [0.0; N],
            length: 0,
        }
    }

    /// Adds a term; there must be room for it.
    pub fn add(&mut self, index: usize, value: f64) {
        debug_assert!(self.length < N, "a row of more than {N} terms");
        if self.length < N && value != 0.0 {
            self.index[self.length] = index as u8;
            self.value[self.length] = value;
            self.length += 1;
        }
    }

    /// The row times a factor.
    pub fn scaled(mut self, factor: f64) -> Self {
        for value in &mut self.value {
            *value *= factor;
        }
        self
    }

    /// Positions and values.
    pub fn terms(&self) -> impl Iterator<Item = (usize, f64)> {
        let index = self.index[..self.length].iter().map(|i| usize::from(*i));
        index.zip(self.value[..self.length].iter().copied())
    }

    /// The same, four at a time.
    fn fours(&self) -> (&[[u8; FOUR]], &[[f64; FOUR]]) {
        let fours = self.length.div_ceil(FOUR);
        let (index, value) = (self.index.as_chunks().0, self.value.as_chunks().0);
        (&index[..fours], &value[..fours])
    }

    /// The row times a state or a column: four sums, so that no addition waits for all before it.
    pub fn times(&self, state: &[f64]) -> f64 {
        let mut sums = [0.0; FOUR];
        let (index, value) = self.fours();
        for (index, value) in index.iter().zip(value) {
            for k in 0..FOUR {
                sums[k] += value[k] * state[usize::from(index[k])];
            }
        }
        (sums[0] + sums[1]) + (sums[2] + sums[3])
    }
}

/// The matrix. Of a row i the columns from `first(i)` on always hold; those before it hold while
/// bit i of `whole` is set, and are copied from the upper half where an operation asks for them.
/// Measurements wait until [`BATCH`] of them can be taken off together; [`Covariance::settle`] takes
/// the rest off.
#[derive(Clone, Debug)]
pub struct Covariance {
    p: Matrix,
    whole: u128,
    /// What waits: P h' of measurements and 1/S, the first `waiting` of them.
    taken: [Column; BATCH],
    weight: [f64; BATCH],
    waiting: usize,
    /// Every change of the matrix.
    pub trace: Trace<SIZE>,
}

type Matrix = [Column; SIZE];

/// First column of a row that always holds: whole vectors of the upper half.
const fn first(row: usize) -> usize {
    row & !(LANES - 1)
}

impl Default for Covariance {
    fn default() -> Self {
        Self {
            p: [Column::ZERO; SIZE],
            whole: 0,
            taken: [Column::ZERO; BATCH],
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
        self.whole = u128::MAX;
        self.p = [Column::ZERO; SIZE];
        for (i, v) in variance.iter().enumerate() {
            self.p[i][i] = *v;
        }
    }

    /// Takes off what waits.
    pub fn settle(&mut self) {
        if self.waiting > 0 {
            self.taken[self.waiting..].fill(Column::ZERO);
            reduce(&mut self.p, &self.taken, &self.weight);
            self.waiting = 0;
            self.whole = 0;
        }
    }

    fn is_whole(&self, row: usize) -> bool {
        self.whole & (1 << row) != 0
    }

    /// Completes the rows of the states that move one another, which the prediction keeps whole; of
    /// the others it keeps the upper half only. Nothing must wait.
    pub fn complete_moved(&mut self) {
        for row in 0..MOVED {
            self.complete(row);
        }
        self.whole = (1 << MOVED) - 1;
    }

    /// Completes a row from the upper half.
    fn complete(&mut self, row: usize) {
        if !self.is_whole(row) {
            for j in 0..row {
                self.p[row][j] = self.p[j][row];
            }
            self.whole |= 1 << row;
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

    fn waiting(&self) -> impl Iterator<Item = (&Column, f64)> {
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
        self.p[i] = Column::ZERO;
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
        integrate(&mut self.p, value, rate, count, dt);
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
        scale(&mut self.p, keep);
    }

    /// x[first + k] += dt sum_j jacobian[k][j] x[j] over forces and moments, k = 0..3.
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
        add_rows(&mut self.p, first, jacobian, dt);
    }

    /// Finds the covariance P h' of the state with a row's value, for [`Covariance::reduce`], and
    /// returns the variance h P h' of that value.
    pub fn project<const N: usize>(&mut self, row: &Row<N>) -> f64 {
        for (i, _) in row.terms() {
            self.complete(i);
        }
        let mut weight = [0.0; BATCH];
        for (weight, (taken, of_taken)) in weight.iter_mut().zip(self.waiting()) {
            *weight = -of_taken * row.times(&taken[..]);
        }
        let (taken, next) = self.taken.split_at_mut(self.waiting);
        let to = &mut next[0];
        *to = Column::ZERO;
        let (index, value) = row.fours();
        project(to, &self.p, index, value);
        shift(to, taken, &weight);
        row.times(&to[..])
    }

    /// Takes the value of the row that was projected last in: x += (P h') innovation/total at once,
    /// P -= (P h')(P h')'/total soon.
    pub fn reduce<const N: usize>(
        &mut self,
        row: &Row<N>,
        state: &mut [f64; SIZE],
        innovation: f64,
        total: f64,
    ) {
        let ph = &self.taken[self.waiting];
        self.trace.note(|| {
            Operation::Update(Box::new(Update {
                row: row.terms().collect(),
                value: innovation + row.times(state),
                innovation,
                variance: total - row.times(&ph[..]),
                total,
                gain: SVector::from_column_slice(&ph[..SIZE]) / total,
            }))
        });
        let gain = innovation / total;
        for (x, p) in state.iter_mut().zip(ph.iter()) {
            *x += gain * p;
        }
        self.weight[self.waiting] = 1.0 / total;
        self.waiting += 1;
        if self.waiting == BATCH {
            self.settle();
        }
    }
}

// The kernels take half of the filter's time. Wider registers do the same operations on the same
// numbers, each rounded as ever, so every processor gives the same bits. Plain loops: a closure is
// compiled for the same registers as the kernel, and stays a call where an adapter's function that is
// not stands between them.

macro_rules! kernel {
    (fn $name:ident($($argument:ident: $type:ty),*) $(-> $result:ty)? $body:block) => {
        #[multiversion(targets("x86_64+avx+avx2+avx512f", "x86_64+avx+avx2"))]
        fn $name($($argument: $type),*) $(-> $result)? $body
    };
}

kernel! {
    fn project(to: &mut Column, matrix: &Matrix, index: &[[u8; FOUR]], value: &[[f64; FOUR]]) {
        // Four at a time: what is summed is loaded and stored once for all.
        for (index, [p, q, r, s]) in index.iter().zip(value) {
            let [a, b, c, d] = index.map(|i| &matrix[usize::from(i)]);
            for k in 0..WIDTH {
                to[k] = to[k] + p * a[k] + q * b[k] + r * c[k] + s * d[k];
            }
        }
    }
}

kernel! {
    fn shift(to: &mut Column, columns: &[Column], factors: &[f64; BATCH]) {
        for (a, p) in columns.iter().zip(factors) {
            for k in 0..WIDTH {
                to[k] += p * a[k];
            }
        }
    }
}

kernel! {
    fn reduce(matrix: &mut Matrix, taken: &[Column; BATCH], weight: &[f64; BATCH]) {
        for i in 0..SIZE {
            let row = &mut matrix[i];
            let mut gains = [0.0; BATCH];
            for m in 0..BATCH {
                gains[m] = taken[m][i] * weight[m];
            }
            for j in first(i)..WIDTH {
                let mut left = row[j];
                for m in 0..BATCH {
                    left -= gains[m] * taken[m][j];
                }
                row[j] = left;
            }
        }
    }
}

kernel! {
    fn integrate(matrix: &mut Matrix, value: usize, rate: usize, count: usize, dt: f64) {
        for k in 0..count {
            let source = matrix[rate + k];
            for j in 0..WIDTH {
                matrix[value + k][j] += dt * source[j];
            }
        }
        for row in &mut matrix[..MOVED] {
            for k in 0..count {
                row[value + k] += dt * row[rate + k];
            }
        }
    }
}

kernel! {
    fn scale(matrix: &mut Matrix, keep: &[f64; SIZE]) {
        let mut of_column = Column::ZERO;
        of_column[..SIZE].copy_from_slice(keep);
        for (i, row) in matrix.iter_mut().enumerate() {
            let begin = if i < MOVED { 0 } else { first(i) };
            for j in begin..WIDTH {
                row[j] *= keep[i] * of_column[j];
            }
        }
    }
}

kernel! {
    fn add_rows(matrix: &mut Matrix, to: usize, jacobian: &[[f64; 24]; 3], dt: f64) {
        let mut added = [Column::ZERO; 3];
        for j in 0..24 {
            let row = &matrix[position(j)];
            for k in 0..3 {
                let gain = dt * jacobian[k][j];
                for column in 0..WIDTH {
                    added[k][column] += gain * row[column];
                }
            }
        }
        for k in 0..3 {
            for j in 0..WIDTH {
                matrix[to + k][j] += added[k][j];
            }
        }
        // The columns of the states that stay follow from the rows by symmetry.
        for i in 0..SIZE {
            let row = &mut matrix[i];
            for k in 0..3 {
                let mut column = added[k][i];
                if (to..to + 3).contains(&i) {
                    column = 0.0;
                    for j in 0..24 {
                        column += dt * jacobian[k][j] * row[position(j)];
                    }
                }
                row[to + k] += column;
            }
        }
    }
}

/// Position of the j-th of twelve forces and twelve moments.
pub fn position(j: usize) -> usize {
    if j < 12 { j } else { MOMENT + j - 12 }
}
