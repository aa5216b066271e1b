//! A symmetric covariance matrix with the few operations that the filter needs.

mod kernels;

use std::ops::{Deref, DerefMut};

use nalgebra::SVector;

use super::joint::{Joint, Rows, TOGETHER};
use super::layout::{BODY_RATE, FORCE, MOMENT, RATE, SIZE, State, TORQUE};
use crate::trace::{Operation, Restart, Term, Trace, Update};

/// Largest variance of any state; keeps numbers finite while nothing is measured.
const VARIANCE_MAX: f64 = 1e10;
/// Columns that are updated together; a power of two.
const LANES: usize = 8;
/// Numbers of a row in memory: whole vectors. Those past the states stay zero.
const WIDTH: usize = SIZE.next_multiple_of(LANES);

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

/// The matrix. Of a row i the columns from `first(i)` on always hold; those before it hold while
/// bit i of `whole` is set, and are copied from the upper half where an operation asks for them.
#[derive(Clone, Debug)]
pub struct Covariance {
    p: Matrix,
    whole: u128,
    /// P h' of the rows that were projected last.
    projected: [Column; TOGETHER],
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
            projected: [Column::ZERO; TOGETHER],
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
        self.whole = u128::MAX;
        self.p = [Column::ZERO; SIZE];
        for (i, v) in variance.iter().enumerate() {
            self.p[i][i] = *v;
        }
    }

    /// Completes a row from the upper half.
    fn complete(&mut self, row: usize) {
        if self.whole & (1 << row) == 0 {
            let (above, below) = self.p.split_at_mut(row);
            for (to, from) in below[0].iter_mut().zip(above) {
                *to = from[row];
            }
            self.whole |= 1 << row;
        }
    }

    /// Covariances of a state with all states.
    pub fn row(&self, i: usize) -> SVector<f64, SIZE> {
        SVector::from_fn(|j, _| self.p[i.min(j)][i.max(j)])
    }

    /// Variance of a state.
    pub fn variance(&self, i: usize) -> f64 {
        self.p[i][i]
    }

    /// Whether every variance is finite and not negative.
    pub fn sound(&self) -> bool {
        (0..SIZE).all(|i| self.p[i][i] >= -1e-6 && self.p[i][i] <= 1e3 * VARIANCE_MAX)
    }

    /// Makes a state independent of all others, with this variance.
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

    /// F += dt F' of all forces.
    pub fn integrate(&mut self, dt: f64) {
        self.trace.note(|| {
            let terms = (0..RATE - FORCE).map(|k| Term {
                row: FORCE + k,
                column: RATE + k,
                value: dt,
            });
            Operation::Mix(terms.collect())
        });
        // Of the rates' rows what the forces take from them.
        for i in RATE..2 * RATE {
            for j in RATE..i {
                self.p[i][j] = self.p[j][i];
            }
        }
        kernels::integrate(&mut self.p, dt);
        self.whole = 0;
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
        let mut of_column = Column::ZERO;
        of_column[..SIZE].copy_from_slice(keep);
        kernels::scale(&mut self.p, &of_column);
        self.whole = 0;
    }

    /// Rates of the body += dt J (F, M).
    pub fn turn(&mut self, jacobian: &[[f64; BALANCED]; 3], dt: f64) {
        self.trace.note(|| {
            let terms = jacobian.iter().enumerate().flat_map(|(axis, gains)| {
                gains.iter().enumerate().map(move |(j, gain)| Term {
                    row: BODY_RATE + axis,
                    column: position(j),
                    value: dt * gain,
                })
            });
            Operation::Mix(terms.collect())
        });
        for j in 0..BALANCED {
            self.complete(position(j));
        }
        kernels::turn(&mut self.p, jacobian, dt);
        self.whole = 0;
    }

    /// Predicted values of rows and their covariances. No state may change until
    /// [`Covariance::apply`].
    pub fn project<const K: usize>(&mut self, rows: &Rows<K>, state: &State) -> Joint {
        let view = rows.view();
        for i in view.shared.iter().chain(&view.own[..view.count]) {
            self.complete(usize::from(*i));
        }
        let mut between = [[0.0; TOGETHER]; TOGETHER];
        kernels::project(&mut self.projected, &mut between, &self.p, &view);
        Joint::new(view.times(state), between)
    }

    /// Corrects state and covariance by the taken rows of the last projection.
    pub fn apply<const K: usize>(&mut self, rows: &Rows<K>, joint: &Joint, state: &mut State) {
        if joint.taken.iter().all(Option::is_none) {
            return;
        }
        // A row that was not taken can contain NaN: it is left out, not weighted with zero.
        let count = rows.view().count;
        let mut weight = [0.0; TOGETHER];
        let mut projection = [[0.0; TOGETHER]; TOGETHER];
        for (m, taken) in joint.taken[..count].iter().enumerate() {
            if let Some(taken) = taken {
                weight[m] = 1.0 / taken.total;
                for later in m + 1..count {
                    if joint.taken[later].is_some() {
                        projection[m][later] = joint.between[m][later] * weight[m];
                    }
                }
            } else {
                self.projected[m] = Column::ZERO;
            }
        }
        kernels::clear_of_earlier(&mut self.projected, &projection, count);
        let columns = self.projected.iter().zip(&joint.taken).enumerate();
        for (m, (column, taken)) in columns {
            let Some(taken) = taken else { continue };
            self.trace.note(|| {
                Operation::Update(Box::new(Update {
                    row: rows.terms(m),
                    value: taken.measured,
                    innovation: taken.innovation,
                    variance: taken.total - joint.variance(m),
                    total: taken.total,
                    gain: SVector::from_column_slice(&column[..SIZE]) / taken.total,
                }))
            });
            let gain = taken.innovation / taken.total;
            for (x, p) in state.iter_mut().zip(column.iter()) {
                *x += gain * p;
            }
        }
        kernels::reduce(&mut self.p, &self.projected, &weight, count);
        self.whole = 0;
    }
}

/// Number of forces and moments, which the balance of moments sums.
pub const BALANCED: usize = RATE - FORCE + TORQUE - MOMENT;

/// Position of the j-th of forces and moments.
pub fn position(j: usize) -> usize {
    let force = j < RATE - FORCE;
    if force {
        FORCE + j
    } else {
        MOMENT + j - (RATE - FORCE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three rows that share a force and its rate, each with an offset of its own.
    fn rows(gains: [[f64; 2]; 3]) -> Rows<2> {
        let mut rows = Rows::new([FORCE, RATE]);
        for (m, gains) in gains.into_iter().enumerate() {
            rows.set(m, gains, (SIZE - 3 + m, 1.0));
        }
        rows
    }

    fn start() -> (Covariance, State) {
        let mut covariance = Covariance::default();
        let state = [1.0; SIZE];
        covariance.reset(&[4.0; SIZE], &state);
        covariance.integrate(0.5);
        (covariance, state)
    }

    const GAINS: [[f64; 2]; 3] = [[1.0, -0.1], [0.5, 0.2], [-2.0, 0.3]];
    const MEASURED: [f64; 3] = [3.0, -1.0, 2.0];
    const NOISE: f64 = 0.5;

    #[test]
    fn rows_together_are_rows_one_after_another() {
        let rows = rows(GAINS);
        let (mut covariance, mut state) = start();
        let mut joint = covariance.project(&rows, &state);
        for (m, measured) in MEASURED.into_iter().enumerate() {
            joint.take(m, measured, joint.variance(m) + NOISE);
        }
        covariance.apply(&rows, &joint, &mut state);
        let (mut alone, mut state_alone) = start();
        for (m, measured) in MEASURED.into_iter().enumerate() {
            let mut joint = alone.project(&rows, &state_alone);
            joint.take(m, measured, joint.variance(m) + NOISE);
            alone.apply(&rows, &joint, &mut state_alone);
        }
        for i in 0..SIZE {
            assert!((state[i] - state_alone[i]).abs() < 1e-12);
            assert!((covariance.row(i) - alone.row(i)).amax() < 1e-12);
        }
    }

    #[test]
    fn a_row_that_is_no_number_spoils_no_other() {
        let mut broken = GAINS;
        broken[1][0] = f64::NAN;
        let [without, with] = [rows(GAINS), rows(broken)].map(|rows| {
            let (mut covariance, mut state) = start();
            let mut joint = covariance.project(&rows, &state);
            for (m, measured) in MEASURED.into_iter().enumerate() {
                let total = joint.variance(m) + NOISE;
                if m != 1 || total.is_nan() {
                    joint.take(m, measured, total);
                }
            }
            covariance.apply(&rows, &joint, &mut state);
            (state, covariance)
        });
        assert_eq!(with.0, without.0);
        for i in 0..SIZE {
            assert_eq!(with.1.row(i), without.1.row(i));
        }
    }
}
