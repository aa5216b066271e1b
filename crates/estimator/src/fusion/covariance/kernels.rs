//! Loops over the covariance, which take half of the filter's time.
//!
//! Wider registers do the same operations on the same numbers, each rounded as ever, so every
//! processor gives the same bits. Plain loops: a closure is compiled for the same registers as the
//! kernel, and stays a call where an adapter's function that is not stands between them.

use std::sync::atomic::{Ordering, compiler_fence};

use multiversion::multiversion;

use super::{Column, LANES, Matrix, WIDTH, first};
use crate::fusion::joint::{RowsView, TOGETHER};
use crate::fusion::layout::{BEFORE, FORCE, HUB_BIAS, LAGGED, SIZE, State};
use crate::fusion::transition::{FORCES, MIXED, Mixed, Transition};

macro_rules! kernel {
    ($(#[$attribute:meta])* fn $name:ident($($argument:ident: $type:ty),*) $body:block) => {
        $(#[$attribute])*
        #[multiversion(targets("x86_64+avx+avx2+avx512f", "x86_64+avx+avx2"))]
        pub fn $name($($argument: $type),*) $body
    };
}

/// The same lanes of a column.
#[inline(always)]
fn lanes(column: &Column, chunk: usize) -> &[f64; LANES] {
    &column.as_chunks().0[chunk]
}

#[inline(always)]
fn lanes_mut(column: &mut Column, chunk: usize) -> &mut [f64; LANES] {
    &mut column.as_chunks_mut().0[chunk]
}

/// At the end of a loop's body over lanes: keeps the compiler from taking the same lane of eight
/// turns for one vector, which it then gathers and scatters in ten times the time. No instruction.
#[inline(always)]
fn lanes_stay_together() {
    compiler_fence(Ordering::SeqCst);
}

kernel! {
    /// P h' of rows, and the covariances of their values, H P H'.
    fn project(
        to: &mut [Column; TOGETHER],
        between: &mut [[f64; TOGETHER]; TOGETHER],
        matrix: &Matrix,
        rows: &RowsView,
        active: usize
    ) {
        match rows.count {
            0..=3 => project_counted::<3>(to, matrix, rows, active),
            4..=6 => project_counted::<6>(to, matrix, rows, active),
            7..=8 => project_counted::<8>(to, matrix, rows, active),
            _ => project_counted::<TOGETHER>(to, matrix, rows, active),
        }
        for m in 0..rows.count {
            between[m] = rows.times(&to[m][..]);
        }
    }
}

#[inline(always)]
fn project_counted<const M: usize>(
    to: &mut [Column; TOGETHER],
    matrix: &Matrix,
    rows: &RowsView<'_>,
    active: usize,
) {
    for chunk in 0..active.div_ceil(LANES) {
        let mut sums = [[0.0; LANES]; M];
        for (index, gains) in rows.shared.iter().zip(rows.gains) {
            let row = lanes(&matrix[usize::from(*index)], chunk);
            for m in 0..M {
                for k in 0..LANES {
                    sums[m][k] += gains[m] * row[k];
                }
            }
        }
        for m in 0..M {
            let row = lanes(&matrix[usize::from(rows.own[m])], chunk);
            for k in 0..LANES {
                sums[m][k] += rows.own_gain[m] * row[k];
            }
            *lanes_mut(&mut to[m], chunk) = sums[m];
        }
    }
}

kernel! {
    /// Gram-Schmidt: subtracts from each column its projections on the earlier columns,
    /// `projection[m][k]` of column m in column k.
    fn clear_of_earlier(
        columns: &mut [Column; TOGETHER],
        projection: &[[f64; TOGETHER]; TOGETHER],
        count: usize
    ) {
        for m in 1..count {
            let (earlier, rest) = columns.split_at_mut(m);
            for e in 0..m {
                let part = projection[e][m];
                for j in 0..WIDTH {
                    rest[0][j] -= part * earlier[e][j];
                }
            }
        }
    }
}

kernel! {
    /// Takes weighted squares of columns off the upper half.
    fn reduce(
        matrix: &mut Matrix,
        columns: &[Column; TOGETHER],
        weight: &[f64; TOGETHER],
        count: usize,
        active: usize
    ) {
        // As many as the registers hold: each element is then loaded and stored once for all.
        match count {
            0..=2 => reduce_counted::<0, 2>(matrix, columns, weight, active),
            3..=4 => reduce_counted::<0, 4>(matrix, columns, weight, active),
            5..=6 => reduce_counted::<0, 6>(matrix, columns, weight, active),
            7..=8 => reduce_counted::<0, 8>(matrix, columns, weight, active),
            _ => {
                reduce_counted::<0, 6>(matrix, columns, weight, active);
                reduce_counted::<6, TOGETHER>(matrix, columns, weight, active);
            }
        }
    }
}

#[inline(always)]
fn reduce_counted<const FROM: usize, const TO: usize>(
    matrix: &mut Matrix,
    columns: &[Column; TOGETHER],
    weight: &[f64; TOGETHER],
    active: usize,
) {
    for i in 0..active {
        let mut gains = [0.0; TOGETHER];
        for m in FROM..TO {
            gains[m] = columns[m][i] * weight[m];
        }
        for chunk in first(i) / LANES..active.div_ceil(LANES) {
            let row = lanes_mut(&mut matrix[i], chunk);
            for m in FROM..TO {
                let column = lanes(&columns[m], chunk);
                for k in 0..LANES {
                    row[k] -= gains[m] * column[k];
                }
            }
            lanes_stay_together();
        }
    }
}

kernel! {
    /// P ← F P F' in the upper half. Rows of the states that are mixed or handed on must be whole.
    ///
    /// With the mixed rows A of F P, the covariance of a mixed state with one that is only kept is A
    /// times that state's factor; that of two mixed states is a sum over A once more.
    fn propagate(matrix: &mut Matrix, transition: &Transition, active: usize) {
        let rows = transition.rows();
        let mixed = mixed_rows(matrix, rows, active.div_ceil(LANES));
        let both = of_both(&mixed, rows);
        let mut forces = [Column::ZERO; FORCES];
        forces.copy_from_slice(&matrix[FORCE..FORCE + FORCES]);
        hand_rows_on(matrix, &forces, &transition.keep);
        for (i, row) in matrix.iter_mut().enumerate().take(BEFORE) {
            let keep = transition.keep[i];
            hand_on(row, keep);
            for (k, force) in forces.iter().enumerate() {
                row[BEFORE + k] = keep * force[i];
            }
            for j in first(i)..BEFORE {
                row[j] *= keep * transition.keep[j];
            }
            for j in HUB_BIAS..SIZE {
                row[j] *= keep * transition.keep[j];
            }
            for (of_mixed, of) in mixed.iter().zip(rows) {
                row[of.index] = keep * of_mixed[i];
            }
        }
        for (i, of) in rows.iter().enumerate() {
            let row = &mut matrix[of.index];
            *row = mixed[i];
            hand_on(row, 1.0);
            for k in 0..FORCES {
                row[BEFORE + k] = mixed[i][FORCE + k];
            }
            for j in first(of.index)..BEFORE {
                row[j] *= transition.keep[j];
            }
            for j in HUB_BIAS..SIZE {
                row[j] *= transition.keep[j];
            }
            for (j, other) in rows.iter().enumerate() {
                if other.index >= of.index {
                    row[other.index] = both[i][j];
                }
            }
        }
    }
}

/// Mixed rows of F P.
#[inline(always)]
fn mixed_rows(matrix: &Matrix, rows: &[Mixed], chunks: usize) -> [Column; MIXED] {
    let mut mixed = [Column::ZERO; MIXED];
    for (to, row) in mixed.iter_mut().zip(rows) {
        for chunk in 0..chunks {
            let mut sum = [0.0; LANES];
            for (state, gain) in row.terms() {
                let of_state = lanes(&matrix[state], chunk);
                for k in 0..LANES {
                    sum[k] += gain * of_state[k];
                }
            }
            *lanes_mut(to, chunk) = sum;
        }
    }
    mixed
}

/// Covariances of two mixed states, the second with the higher index.
#[inline(always)]
fn of_both(mixed: &[Column; MIXED], rows: &[Mixed]) -> [[f64; MIXED]; MIXED] {
    let mut both = [[0.0; MIXED]; MIXED];
    for (i, of_row) in mixed.iter().enumerate().take(rows.len()) {
        for (j, row) in rows.iter().enumerate() {
            if row.index >= rows[i].index {
                both[i][j] = row.terms().map(|(state, gain)| gain * of_row[state]).sum();
            }
        }
    }
    both
}

/// Rows of the forces of earlier steps and of the last states.
#[inline(always)]
fn hand_rows_on(matrix: &mut Matrix, forces: &[Column; FORCES], keep: &State) {
    // From the last to the first: a row's source is before it.
    for k in 0..FORCES {
        let (upper, lower) = matrix.split_at_mut(LAGGED);
        let source = &upper[BEFORE + k];
        lower[k][LAGGED..HUB_BIAS].copy_from_slice(&source[BEFORE..LAGGED]);
        for j in HUB_BIAS..SIZE {
            lower[k][j] = source[j] * keep[j];
        }
    }
    for (k, force) in forces.iter().enumerate() {
        let row = &mut matrix[BEFORE + k];
        row[BEFORE..LAGGED].copy_from_slice(&force[FORCE..FORCE + FORCES]);
        row[LAGGED..HUB_BIAS].copy_from_slice(&force[BEFORE..LAGGED]);
        for j in HUB_BIAS..SIZE {
            row[j] = force[j] * keep[j];
        }
    }
    for i in HUB_BIAS..SIZE {
        for j in HUB_BIAS..SIZE {
            matrix[i][j] *= keep[i] * keep[j];
        }
    }
}

/// Covariances with the forces of one step before become those with the forces of two steps before.
#[inline(always)]
fn hand_on(row: &mut Column, keep: f64) {
    let (before, lagged) = row.split_at_mut(LAGGED);
    for k in 0..FORCES {
        lagged[k] = keep * before[BEFORE + k];
    }
}
