//! Kalman filter in square-root form: P = S S', and every change of S an orthogonal transformation
//! of arrays (P. Kaminski, A. Bryson, S. Schmidt, "Discrete square root filtering", IEEE Trans.
//! Automatic Control 16 (1971) 727-736). All measurements between two changes of the state are
//! taken at once.

use atvrec_estimator::trace::{Operation, Term, Update};
use nalgebra::{DMatrix, DVector};

pub struct SquareRoot {
    state: DVector<f64>,
    root: DMatrix<f64>,
    started: bool,
}

impl SquareRoot {
    pub fn new(size: usize) -> Self {
        Self {
            state: DVector::zeros(size),
            root: DMatrix::zeros(size, size),
            started: false,
        }
    }

    /// Whether it has been told where to start.
    pub fn started(&self) -> bool {
        self.started
    }

    pub fn state(&self) -> &DVector<f64> {
        &self.state
    }

    pub fn covariance(&self) -> DMatrix<f64> {
        &self.root * self.root.transpose()
    }

    /// Does what another filter did.
    pub fn follow<const N: usize>(&mut self, operations: &[Operation<N>]) {
        let mut measured: Vec<&Update<N>> = Vec::new();
        let mut noise: Vec<Term> = Vec::new();
        for operation in operations {
            if !matches!(operation, Operation::Update(_)) {
                self.measure(&std::mem::take(&mut measured));
            }
            if !matches!(operation, Operation::Noise(_)) {
                self.widen(&std::mem::take(&mut noise));
            }
            match operation {
                Operation::Update(update) => measured.push(update),
                Operation::Noise(term) => noise.push(*term),
                Operation::Mix(terms) => self.mix(terms),
                Operation::Shift { index, by } => self.state[*index] += by,
                Operation::Forget { index, variance } => {
                    self.root.fill_row(*index, 0.0);
                    self.widen(&[Term {
                        row: *index,
                        column: *index,
                        value: *variance,
                    }]);
                }
                Operation::Restart(restart) => {
                    self.state.copy_from_slice(restart.state.as_slice());
                    let sigma = restart.variance.iter().map(|variance| variance.sqrt());
                    self.root = DMatrix::from_diagonal(&DVector::from_iterator(N, sigma));
                    self.started = true;
                }
            }
        }
        self.measure(&measured);
        self.widen(&noise);
    }

    /// x ← F x, S ← F S.
    fn mix(&mut self, terms: &[Term]) {
        let size = self.state.len();
        let mut f = DMatrix::identity(size, size);
        for term in terms {
            f[(term.row, term.column)] += term.value;
        }
        self.state = &f * &self.state;
        self.root = f * &self.root;
    }

    /// S S' ← S S' + Q.
    fn widen(&mut self, noise: &[Term]) {
        if noise.is_empty() {
            return;
        }
        let size = self.state.len();
        let mut q = DMatrix::zeros(size, size);
        for term in noise {
            q[(term.row, term.column)] += term.value;
            if term.row != term.column {
                q[(term.column, term.row)] += term.value;
            }
        }
        let mut array = DMatrix::zeros(2 * size, size);
        array.rows_mut(0, size).copy_from(&self.root.transpose());
        array
            .rows_mut(size, size)
            .copy_from(&cholesky(q).transpose());
        self.root = array.qr().r().transpose();
    }

    /// All of these at once: with R^(1/2) the deviations of the noise,
    ///
    /// | R^(1/2)'  0  |         | A  B |
    /// | S' H'     S' |  = Q *  | 0  S_new' |,  K' = A^-1 B.
    fn measure<const N: usize>(&mut self, updates: &[&Update<N>]) {
        if updates.is_empty() {
            return;
        }
        let (count, size) = (updates.len(), self.state.len());
        let mut rows = DMatrix::zeros(count, size);
        let mut array = DMatrix::zeros(count + size, count + size);
        for (k, update) in updates.iter().enumerate() {
            for &(i, h) in &update.row {
                rows[(k, i)] += h;
            }
            array[(k, k)] = update.variance.sqrt();
        }
        let value = DVector::from_iterator(count, updates.iter().map(|update| update.value));
        let innovation = value - &rows * &self.state;
        let seen = self.root.transpose() * rows.transpose();
        array.view_mut((count, 0), (size, count)).copy_from(&seen);
        array
            .view_mut((count, count), (size, size))
            .copy_from(&self.root.transpose());
        let r = array.qr().r();
        let total = r.view((0, 0), (count, count));
        let across = r.view((0, count), (count, size));
        let gain = total.solve_upper_triangular(&across).expect("noise");
        self.state += gain.transpose() * innovation;
        self.root = r.view((count, count), (size, size)).transpose();
    }
}

/// Lower triangle L of Q = L L', of which rows and columns may be zero.
fn cholesky(q: DMatrix<f64>) -> DMatrix<f64> {
    let size = q.nrows();
    let mut l = DMatrix::<f64>::zeros(size, size);
    for j in 0..size {
        let pivot = q[(j, j)] - l.row(j).norm_squared();
        if pivot <= 0.0 {
            continue;
        }
        l[(j, j)] = pivot.sqrt();
        for i in j + 1..size {
            let sum = q[(i, j)] - l.row(i).dot(&l.row(j));
            l[(i, j)] = sum / l[(j, j)];
        }
    }
    l
}
