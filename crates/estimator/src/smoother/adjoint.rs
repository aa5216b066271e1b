//! The adjoint of the filter's operations: information of later measurements about a state.

use nalgebra::{SMatrix, SVector};

use crate::trace::{Operation, Term, Update};

/// The adjoint vector l and its matrix L: zero at the end of the data.
#[derive(Clone, Debug)]
pub struct Adjoint<const N: usize> {
    vector: SVector<f64, N>,
    matrix: Box<SMatrix<f64, N, N>>,
}

impl<const N: usize> Default for Adjoint<N> {
    fn default() -> Self {
        Self {
            vector: SVector::zeros(),
            matrix: Box::new(SMatrix::zeros()),
        }
    }
}

impl<const N: usize> Adjoint<N> {
    /// Passes the adjoint from after the operations to before them.
    pub fn pass(&mut self, operations: &[Operation<N>]) {
        for operation in operations.iter().rev() {
            match operation {
                Operation::Mix(terms) => self.mix(terms),
                Operation::Update(update) => self.update(update),
                Operation::Forget { index, .. } => self.forget(*index),
                Operation::Restart(_) => *self = Self::default(),
                Operation::Shift { .. } | Operation::Noise(_) => {}
            }
        }
    }

    /// l ← F' l, L ← F' L F.
    fn mix(&mut self, terms: &[Term]) {
        let before = self.vector;
        let matrix = &mut self.matrix;
        let columns: Vec<_> = terms
            .iter()
            .map(|t| matrix.column(t.row) * t.value)
            .collect();
        for (term, column) in terms.iter().zip(&columns) {
            self.vector[term.column] += term.value * before[term.row];
            let mut sum = matrix.column_mut(term.column);
            sum += column;
        }
        let rows: Vec<_> = terms.iter().map(|t| matrix.row(t.row) * t.value).collect();
        for (term, row) in terms.iter().zip(&rows) {
            let mut sum = matrix.row_mut(term.column);
            sum += row;
        }
    }

    fn forget(&mut self, index: usize) {
        self.vector[index] = 0.0;
        self.matrix.fill_row(index, 0.0);
        self.matrix.fill_column(index, 0.0);
    }

    /// l ← l - h' (y/S + K' l), L ← (I - K h)' L (I - K h) + h' h/S.
    fn update(&mut self, update: &Update<N>) {
        let share = update.innovation / update.total + update.gain.dot(&self.vector);
        let gained = *self.matrix * update.gain;
        let square = update.gain.dot(&gained) + 1.0 / update.total;
        for &(i, h) in &update.row {
            self.vector[i] -= h * share;
            let mut column = self.matrix.column_mut(i);
            column.axpy(-h, &gained, 1.0);
            let mut row = self.matrix.row_mut(i);
            row -= gained.transpose() * h;
        }
        for &(i, of_row) in &update.row {
            for &(j, of_column) in &update.row {
                self.matrix[(i, j)] += of_row * of_column * square;
            }
        }
    }

    /// -P l: what to add to states whose covariances with all states are the rows of `covariance`.
    pub fn correction<const M: usize>(&self, covariance: &SMatrix<f64, M, N>) -> SVector<f64, M> {
        -(covariance * self.vector)
    }

    /// P L P' of the same states: by how much their covariance shrinks.
    pub fn shrinkage<const M: usize>(&self, covariance: &SMatrix<f64, M, N>) -> SMatrix<f64, M, M> {
        covariance * *self.matrix * covariance.transpose()
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    type Matrix = SMatrix<f64, 3, 3>;
    type Vector = SVector<f64, 3>;

    /// A Kalman filter's state and covariance behind each step, and what led there.
    struct Run {
        behind: Vec<(Vector, Matrix)>,
        before: Vec<(Vector, Matrix)>,
        operations: Vec<Vec<Operation<3>>>,
        turn: Matrix,
    }

    fn filtered(steps: usize) -> Run {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let turn = Matrix::new(0.9, 0.2, 0.0, -0.1, 0.95, 0.3, 0.05, 0.0, 0.8);
        let (mut x, mut p) = (Vector::zeros(), Matrix::identity() * 4.0);
        let mut run = Run {
            behind: Vec::new(),
            before: Vec::new(),
            operations: Vec::new(),
            turn,
        };
        for _ in 0..steps {
            x = turn * x;
            p = turn * p * turn.transpose() + Matrix::identity() * 0.1;
            run.before.push((x, p));
            let mut operations = vec![Operation::mixed(&turn)];
            for row in [Vector::new(1.0, 0.0, 0.5), Vector::new(0.0, -1.0, 0.2)] {
                let (total, innovation) = (row.dot(&(p * row)) + 0.3, normal());
                let gain = p * row / total;
                x += gain * innovation;
                p -= gain * gain.transpose() * total;
                operations.push(Operation::Update(Box::new(Update {
                    row: row.iter().copied().enumerate().collect(),
                    value: f64::NAN,
                    innovation,
                    variance: 0.3,
                    total,
                    gain,
                })));
            }
            run.behind.push((x, p));
            run.operations.push(operations);
        }
        run
    }

    /// x_s = x + C (x_s+ - x-), P_s = P + C (P_s+ - P-) C' with C = P F' (P-)^-1 (H. E. Rauch,
    /// F. Tung, C. T. Striebel, AIAA Journal 3 (1965) 1445-1450).
    #[test]
    fn the_adjoint_smooths_as_rauch_tung_and_striebel_do() {
        let run = filtered(30);
        let mut adjoint = Adjoint::default();
        let (mut x_later, mut p_later) = run.behind[29];
        for k in (0..30).rev() {
            let (x, p) = run.behind[k];
            if k < 29 {
                let (x_before, p_before) = run.before[k + 1];
                let gain = p * run.turn.transpose() * p_before.try_inverse().unwrap();
                x_later = x + gain * (x_later - x_before);
                p_later = p + gain * (p_later - p_before) * gain.transpose();
            }
            let found = x + adjoint.correction(&p);
            assert!((found - x_later).amax() < 1e-12, "{k}: {found} {x_later}");
            let found = p - adjoint.shrinkage(&p);
            assert!((found - p_later).amax() < 1e-12, "{k}: {found} {p_later}");
            adjoint.pass(&run.operations[k]);
        }
    }

    #[test]
    fn what_was_forgotten_is_not_corrected_from_later() {
        let run = filtered(5);
        let mut adjoint = Adjoint::default();
        adjoint.pass(&run.operations[4]);
        adjoint.pass(&[Operation::Forget {
            index: 1,
            variance: 2.0,
        }]);
        let only_second = Matrix::from_diagonal(&Vector::new(0.0, 1.0, 0.0));
        assert_eq!(adjoint.correction(&only_second), Vector::zeros());
        assert_ne!(adjoint.correction(&Matrix::identity()), Vector::zeros());
        adjoint.pass(&[Operation::Restart(Box::new(crate::trace::Restart {
            state: Vector::zeros(),
            variance: Vector::zeros(),
        }))]);
        assert_eq!(adjoint.shrinkage(&Matrix::identity()), Matrix::zeros());
    }
}
