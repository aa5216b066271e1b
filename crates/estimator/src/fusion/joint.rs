//! Joint update by several rows.
//!
//! Rows with common states share the passes over the covariance that compute P h' and subtract it.
//! Each row is still judged by itself, after the rows before it: taking row m with the innovation y
//! of variance S changes each later row k to
//!
//! h_k x ← h_k x + B_km y/S, B_kj ← B_kj - B_km B_mj/S, P h_k' ← P h_k' - P h_m' B_mk/S
//!
//! with B = H P H'. The first two are small and done at once; the columns follow when all rows are
//! judged. In exact arithmetic the result is that of scalar updates one after another (Bierman,
//! Factorization Methods for Discrete Sequential Estimation, 1977).

/// Largest number of rows: a corner's potentiometer, its seven strain channels and the three axes of its
/// hub accelerometer, rounded up.
pub const TOGETHER: usize = 12;

/// Own state of a row without one.
pub const NO_OWN: (usize, f64) = (0, 0.0);

/// Rows of measurement equations with `K` common states and one own state each.
#[derive(Clone, Debug)]
pub struct Rows<const K: usize> {
    shared: [u8; K],
    /// Gains of each common state in all rows.
    gains: [[f64; TOGETHER]; K],
    own: [u8; TOGETHER],
    own_gain: [f64; TOGETHER],
    count: usize,
}

impl<const K: usize> Rows<K> {
    /// No rows yet.
    pub fn new(shared: [usize; K]) -> Self {
        Self {
            shared: shared.map(|i| i as u8),
            gains: [[0.0; TOGETHER]; K],
            own: [0; TOGETHER],
            own_gain: [0.0; TOGETHER],
            count: 0,
        }
    }

    /// Sets row `m` to the gains of the shared states and of one more.
    pub fn set(&mut self, m: usize, gains: [f64; K], (own, own_gain): (usize, f64)) {
        for (to, gain) in self.gains.iter_mut().zip(gains) {
            to[m] = gain;
        }
        self.own[m] = own as u8;
        self.own_gain[m] = own_gain;
        self.count = self.count.max(m + 1);
    }

    /// The same, of any number of shared states.
    pub fn view(&self) -> RowsView<'_> {
        RowsView {
            shared: &self.shared,
            gains: &self.gains,
            own: &self.own,
            own_gain: &self.own_gain,
            count: self.count,
        }
    }

    /// Positions and values of row `m`.
    pub fn terms(&self, m: usize) -> Vec<(usize, f64)> {
        let shared = self.shared.iter().zip(&self.gains);
        shared
            .map(|(index, gains)| (usize::from(*index), gains[m]))
            .chain([(usize::from(self.own[m]), self.own_gain[m])])
            .filter(|(_, gain)| *gain != 0.0)
            .collect()
    }
}

/// Rows of any number of shared states.
#[derive(Clone, Copy, Debug)]
pub struct RowsView<'a> {
    pub(super) shared: &'a [u8],
    pub(super) gains: &'a [[f64; TOGETHER]],
    pub(super) own: &'a [u8; TOGETHER],
    pub(super) own_gain: &'a [f64; TOGETHER],
    pub(super) count: usize,
}

impl RowsView<'_> {
    /// Predicted values from the common states alone.
    #[inline(always)]
    pub fn of_shared(&self, state: &[f64]) -> [f64; TOGETHER] {
        let mut sums = [0.0; TOGETHER];
        for (index, gains) in self.shared.iter().zip(self.gains) {
            let x = state[usize::from(*index)];
            for m in 0..TOGETHER {
                sums[m] += gains[m] * x;
            }
        }
        sums
    }

    /// All rows times a state or a column.
    #[inline(always)]
    pub fn times(&self, state: &[f64]) -> [f64; TOGETHER] {
        let mut sums = self.of_shared(state);
        for m in 0..TOGETHER {
            sums[m] += self.own_gain[m] * state[usize::from(self.own[m])];
        }
        sums
    }
}

/// Predicted values and covariances of rows while they are judged.
#[derive(Clone, Debug)]
pub struct Joint {
    pub(super) value: [f64; TOGETHER],
    /// H P H'; for a taken row at the time when it was taken.
    pub(super) between: [[f64; TOGETHER]; TOGETHER],
    pub(super) taken: [Option<Taken>; TOGETHER],
}

/// Values of a taken row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Taken {
    pub(super) measured: f64,
    pub(super) innovation: f64,
    pub(super) total: f64,
}

impl Joint {
    pub(super) fn new(value: [f64; TOGETHER], between: [[f64; TOGETHER]; TOGETHER]) -> Self {
        Self {
            value,
            between,
            taken: [None; TOGETHER],
        }
    }

    /// h x of row `m`.
    pub fn value(&self, m: usize) -> f64 {
        self.value[m]
    }

    /// h P h' of row `m`.
    pub fn variance(&self, m: usize) -> f64 {
        self.between[m][m]
    }

    /// Takes row `m` with the value `measured` and the innovation variance `total`. Rows must be
    /// taken in increasing order. A value that is not a number changes nothing.
    pub fn take(&mut self, m: usize, measured: f64, total: f64) {
        let innovation = measured - self.value[m];
        if total.is_nan() || total <= 0.0 || !innovation.is_finite() {
            return;
        }
        let of_taken = self.between[m];
        for k in m + 1..TOGETHER {
            let gain = of_taken[k] / total;
            self.value[k] += gain * innovation;
            for (b, of_taken) in self.between[k].iter_mut().zip(of_taken) {
                *b -= gain * of_taken;
            }
        }
        self.taken[m] = Some(Taken {
            measured,
            innovation,
            total,
        });
    }
}
