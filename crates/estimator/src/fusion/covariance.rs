//! A symmetric covariance matrix with the few operations that the filter needs.

mod kernels;

use std::ops::{Deref, DerefMut};

use nalgebra::SVector;

use super::joint::{Joint, Rows, TOGETHER};
use super::layout::{FORCE, RATE, SIZE, State};
use super::transition::Transition;
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
    /// Number of states in use, from the first.
    active: usize,
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
            active: SIZE,
            projected: [Column::ZERO; TOGETHER],
            trace: Trace::default(),
        }
    }
}

impl Covariance {
    /// Leaves out the states from `count` on.
    pub fn leave_out_from(&mut self, count: usize) {
        self.active = count;
    }

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

    /// Adds to a covariance of the upper half.
    pub fn add_covariance(&mut self, row: usize, column: usize, value: f64) {
        if self.p[row][row] < VARIANCE_MAX && self.p[column][column] < VARIANCE_MAX {
            self.p[row][column] += value;
            if row != column {
                self.p[column][row] += value;
            }
            self.note_noise(row, column, value);
        }
    }

    fn note_noise(&mut self, row: usize, column: usize, value: f64) {
        self.trace
            .note(|| Operation::Noise(Term { row, column, value }));
    }

    /// P ← F P F'.
    pub fn propagate(&mut self, transition: &Transition) {
        self.trace.note(|| Operation::Mix(transition.change()));
        for row in transition.rows() {
            for (i, _) in row.terms() {
                self.complete(i);
            }
        }
        for i in FORCE..RATE {
            self.complete(i);
        }
        kernels::propagate(&mut self.p, transition, self.active);
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
        kernels::project(
            &mut self.projected,
            &mut between,
            &self.p,
            &view,
            self.active,
        );
        Joint::new(view.times(state), between)
    }

    /// P h' of a taken row after [`Covariance::apply`], without the rows taken before it.
    pub fn projected(&self, row: usize) -> &[f64] {
        &self.projected[row][..SIZE]
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
        kernels::reduce(&mut self.p, &self.projected, &weight, count, self.active);
        self.whole = 0;
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

    /// A force that takes half of its rate, and rates that decay.
    fn transition() -> Transition {
        let mut transition = Transition::new();
        transition.mix(FORCE, [(FORCE, 1.0), (RATE, 0.5)]);
        transition.mix(RATE + 1, [(FORCE, 0.3), (RATE + 1, 0.5), (RATE, -0.2)]);
        transition.keep[RATE + 5] = 0.9;
        transition.keep[60] = 0.5;
        transition.keep[SIZE - 2] = 0.8;
        transition
    }

    fn start() -> (Covariance, State) {
        let mut covariance = Covariance::default();
        let state = [1.0; SIZE];
        covariance.reset(&[4.0; SIZE], &state);
        covariance.propagate(&transition());
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

    /// The matrix of a transition, element by element.
    fn matrix(transition: &Transition) -> nalgebra::DMatrix<f64> {
        let mut f = nalgebra::DMatrix::identity(SIZE, SIZE);
        for term in transition.change() {
            f[(term.row, term.column)] += term.value;
        }
        f
    }

    #[test]
    fn a_transition_is_that_of_its_matrix() {
        let rows = rows(GAINS);
        let (mut covariance, mut state) = start();
        let mut joint = covariance.project(&rows, &state);
        for (m, measured) in MEASURED.into_iter().enumerate() {
            joint.take(m, measured, joint.variance(m) + NOISE);
        }
        covariance.apply(&rows, &joint, &mut state);
        for _ in 0..4 {
            let full = |covariance: &Covariance| {
                nalgebra::DMatrix::from_fn(SIZE, SIZE, |i, j| covariance.row(i)[j])
            };
            let f = matrix(&transition());
            let expected = &f * full(&covariance) * f.transpose();
            covariance.propagate(&transition());
            assert!((full(&covariance) - expected).amax() < 1e-12);
            let moved = transition().apply(&state);
            let of_matrix = &f * nalgebra::DVector::from_row_slice(&state);
            for i in 0..SIZE {
                assert!((moved[i] - of_matrix[i]).abs() < 1e-12);
            }
            state = moved;
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
