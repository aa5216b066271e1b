//! Linear operations of a Kalman filter on its state, in order. The smoother runs through them
//! backward; a second filter uses them to check the first.
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
//! In an error-state filter x is the error, which is added to the nominal state at once.

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
    /// Nonzero elements of F - I; each element occurs once.
    Mix(Vec<Term>),
    /// Addition of a known value.
    Shift {
        /// Which state.
        index: usize,
        /// By how much.
        by: f64,
    },
    /// Process noise: an element of the upper half of its covariance.
    Noise(Term),
    /// A state becomes independent of all others.
    Forget {
        /// Which state.
        index: usize,
        /// Its variance from now on.
        variance: f64,
    },
    /// A scalar measurement.
    Update(Box<Update<N>>),
    /// A restart.
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
    /// Nonzero elements of h; an index may occur twice.
    pub row: Vec<(usize, f64)>,
    /// z; in an error-state filter, the difference from the nominal state.
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

/// Initial state of a filter after a restart.
#[derive(Clone, Debug, PartialEq)]
pub struct Restart<const N: usize> {
    /// The state.
    pub state: SVector<f64, N>,
    /// Its variances; nothing is correlated.
    pub variance: SVector<f64, N>,
}

/// Records operations while it is switched on.
#[derive(Clone, Debug)]
pub struct Trace<const N: usize>(Option<Vec<Operation<N>>>);

impl<const N: usize> Default for Trace<N> {
    fn default() -> Self {
        Self(None)
    }
}

impl<const N: usize> Trace<N> {
    /// Starts recording.
    pub fn switch_on(&mut self) {
        self.0.get_or_insert_default();
    }

    /// Records an operation; `make` is not called while recording is off.
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
