//! What a Kalman filter did to its state, one linear operation after another: what a smoother runs
//! through backward, and what a second filter is fed with to check the first.
//!
//! With state x and covariance P an operation is one of
//!
//! | operation | state | covariance |
//! |---|---|---|
//! | [`Operation::Mix`] | x ← F x | P ← F P F' |
//! | [`Operation::Shift`] | x_i ← x_i + b | |
//! | [`Operation::Noise`] | | P_ij ← P_ij + q, P_ji alike |
//! | [`Operation::Forget`] | | row and column i ← 0, then P_ii ← q |
//! | [`Operation::Update`] | x ← x + K y | P ← P - K S K' |
//! | [`Operation::Restart`] | x ← x_0 | P ← diag(q) |
//!
//! In a filter of errors x is the error beside the nominal state, to which it is added at once.

use nalgebra::{SMatrix, SVector};

/// One element of a matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Term {
    /// Row.
    pub row: usize,
    /// Column.
    pub column: usize,
    /// Value.
    pub value: f64,
}

/// One operation on a state of `N` numbers.
#[derive(Clone, Debug, PartialEq)]
pub enum Operation<const N: usize> {
    /// F - I, by its elements that are not zero; each stands once.
    Mix(Vec<Term>),
    /// An addition of something known.
    Shift {
        /// Which state.
        index: usize,
        /// By how much.
        by: f64,
    },
    /// Process noise: an element of the upper half of its covariance.
    Noise(Term),
    /// What was known of a state is no longer believed.
    Forget {
        /// Which state.
        index: usize,
        /// Its variance from now on.
        variance: f64,
    },
    /// A scalar measurement.
    Update(Box<Update<N>>),
    /// A new start.
    Restart(Box<Restart<N>>),
}

impl<const N: usize> Operation<N> {
    /// [`Operation::Mix`] by F.
    #[must_use]
    pub fn mixed(f: &SMatrix<f64, N, N>) -> Self {
        let change = f - SMatrix::identity();
        let at = |k: usize| Term {
            row: k % N,
            column: k / N,
            value: change[k],
        };
        let terms = (0..N * N).map(at);
        Self::Mix(terms.filter(|term| term.value != 0.0).collect())
    }
}

/// A scalar measurement z = h x + v.
#[derive(Clone, Debug, PartialEq)]
pub struct Update<const N: usize> {
    /// h, by its elements that are not zero; an index may stand twice.
    pub row: Vec<(usize, f64)>,
    /// z; in a filter of errors, beside what the nominal state tells.
    pub value: f64,
    /// y = z - h x.
    pub innovation: f64,
    /// Variance of v.
    pub variance: f64,
    /// S = h P h' + variance.
    pub total: f64,
    /// K = P h' / S.
    pub gain: SVector<f64, N>,
}

/// Where a filter starts anew.
#[derive(Clone, Debug, PartialEq)]
pub struct Restart<const N: usize> {
    /// The state.
    pub state: SVector<f64, N>,
    /// Its variances; nothing is correlated.
    pub variance: SVector<f64, N>,
}

/// Takes operations down while it is switched on.
#[derive(Clone, Debug)]
pub struct Trace<const N: usize>(Option<Vec<Operation<N>>>);

impl<const N: usize> Default for Trace<N> {
    fn default() -> Self {
        Self(None)
    }
}

impl<const N: usize> Trace<N> {
    /// From now on operations are taken down.
    pub fn switch_on(&mut self) {
        self.0.get_or_insert_default();
    }

    /// Takes an operation down; `make` is not called while the trace is off.
    pub fn note(&mut self, make: impl FnOnce() -> Operation<N>) {
        if let Some(operations) = &mut self.0 {
            operations.push(make());
        }
    }

    /// The operations since the last call.
    pub fn take(&mut self) -> Vec<Operation<N>> {
        self.0.as_mut().map(std::mem::take).unwrap_or_default()
    }
}
