//! Values on a regular lattice, interpolated by cubic convolution.

/// Values on a square lattice, row by row: value (i, j) belongs to x = i, y = j in lattice steps.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Lattice {
    columns: usize,
    rows: usize,
    values: Vec<f64>,
    /// Whether the lattice repeats in both directions; else the values of its edges go on outside.
    repeats: bool,
}

impl Lattice {
    /// A lattice that ends; `values` has `columns` values for each row.
    pub(super) fn bounded(columns: usize, values: Vec<f64>) -> Self {
        Self {
            columns,
            rows: values.len() / columns.max(1),
            values,
            repeats: false,
        }
    }

    /// A square lattice that repeats; its side is a power of two.
    pub(super) fn periodic(side: usize, values: Vec<f64>) -> Self {
        Self {
            columns: side,
            rows: side,
            values,
            repeats: true,
        }
    }

    /// Number of columns and rows.
    pub(super) const fn size(&self) -> [usize; 2] {
        [self.columns, self.rows]
    }

    /// The value at lattice coordinates by cubic convolution with a = -1/2: it passes through the
    /// values, its slope is continuous (Keys, Cubic convolution interpolation for digital image
    /// processing, IEEE Trans. ASSP 29, 1981, equation 15).
    pub(super) fn at(&self, x: f64, y: f64) -> f64 {
        let ((column, x), (row, y)) = (split(x), split(y));
        let columns = self.indices(column, self.columns);
        let rows = self.indices(row, self.rows);
        let (along, across) = (weights(x), weights(y));
        let mut sum = 0.0;
        for k in 0..4 {
            let line = &self.values[rows[k] * self.columns..][..self.columns];
            let value = along[0] * line[columns[0]]
                + along[1] * line[columns[1]]
                + along[2] * line[columns[2]]
                + along[3] * line[columns[3]];
            sum += across[k] * value;
        }
        sum
    }

    /// The four lattice indices around a cell.
    #[inline]
    fn indices(&self, cell: i64, count: usize) -> [usize; 4] {
        let first = cell - 1;
        let all = [first, first + 1, first + 2, first + 3];
        if self.repeats {
            let mask = count as i64 - 1;
            all.map(|index| (index & mask) as usize)
        } else {
            let last = count as i64 - 1;
            all.map(|index| index.clamp(0, last) as usize)
        }
    }
}

/// The whole number below, and the rest.
#[inline]
fn split(x: f64) -> (i64, f64) {
    let toward_zero = x as i64;
    let whole = toward_zero - i64::from(toward_zero as f64 > x);
    (whole, x - whole as f64)
}

/// Weights of the four neighbours at the part `t` of the way from the second to the third.
#[inline]
fn weights(t: f64) -> [f64; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [
        0.5 * (-t3 + 2.0 * t2 - t),
        0.5 * (3.0 * t3 - 5.0 * t2 + 2.0),
        0.5 * (-3.0 * t3 + 4.0 * t2 + t),
        0.5 * (t3 - t2),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_is_exact_inside_and_level_beyond_the_edges() {
        let values = (0..30).map(|k| f64::from(k % 6) + 2.0 * f64::from(k / 6));
        let lattice = Lattice::bounded(6, values.collect());
        assert_eq!(lattice.size(), [6, 5]);
        assert!((lattice.at(2.3, 1.7) - (2.3 + 3.4)).abs() < 1e-12);
        assert_eq!(lattice.at(-7.0, 2.0), 4.0);
        assert_eq!(lattice.at(90.0, 90.0), 13.0);
    }

    #[test]
    fn a_wave_of_eight_points_keeps_its_height_within_one_percent() {
        let side = 16;
        let wave = |x: f64| math::cos(std::f64::consts::TAU * x / 8.0);
        let values = (0..side * side).map(|k| wave((k % side) as f64)).collect();
        let lattice = Lattice::periodic(side, values);
        for step in 0..400 {
            let x = f64::from(step) * 0.173 - 30.0;
            assert!((lattice.at(x, 0.37 * x) - wave(x)).abs() < 0.01);
        }
    }
}
