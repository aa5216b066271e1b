//! Loops over the covariance, which take half of the filter's time.
//!
//! Wider registers do the same operations on the same numbers, each rounded as ever, so every
//! processor gives the same bits. Plain loops: a closure is compiled for the same registers as the
//! kernel, and stays a call where an adapter's function that is not stands between them.

use std::sync::atomic::{Ordering, compiler_fence};

use multiversion::multiversion;

use super::{BALANCED, Column, LANES, Matrix, WIDTH, first, position};
use crate::fusion::joint::{RowsView, TOGETHER};
use crate::fusion::layout::{BODY_RATE, FORCE, RATE, SIZE};

/// Number of the forces, and of their rates after them.
const FORCES: usize = RATE - FORCE;

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
        rows: &RowsView
    ) {
        match rows.count {
            0..=3 => project_counted::<3>(to, matrix, rows),
            4..=6 => project_counted::<6>(to, matrix, rows),
            _ => project_counted::<TOGETHER>(to, matrix, rows),
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
) {
    for chunk in 0..WIDTH / LANES {
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
        count: usize
    ) {
        // As many as the registers hold: each element is then loaded and stored once for all.
        match count {
            0..=2 => reduce_counted::<0, 2>(matrix, columns, weight),
            3..=4 => reduce_counted::<0, 4>(matrix, columns, weight),
            _ => {
                reduce_counted::<0, 6>(matrix, columns, weight);
                if count > 6 {
                    reduce_counted::<6, TOGETHER>(matrix, columns, weight);
                }
            }
        }
    }
}

#[inline(always)]
fn reduce_counted<const FROM: usize, const TO: usize>(
    matrix: &mut Matrix,
    columns: &[Column; TOGETHER],
    weight: &[f64; TOGETHER],
) {
    for i in 0..SIZE {
        let mut gains = [0.0; TOGETHER];
        for m in FROM..TO {
            gains[m] = columns[m][i] * weight[m];
        }
        for chunk in first(i) / LANES..WIDTH / LANES {
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
    /// F += dt F' of all forces, in the upper half. Rows of the rates must be whole among
    /// themselves.
    fn integrate(matrix: &mut Matrix, dt: f64) {
        // Covariances of the forces with one another: with the rates' before and after these move.
        let mut forces = [[0.0; FORCES]; FORCES];
        for i in 0..FORCES {
            for j in i..FORCES {
                let rate = matrix[RATE + i][RATE + j];
                let sum = matrix[FORCE + i][RATE + j] + matrix[FORCE + j][RATE + i];
                forces[i][j] = dt * (sum + dt * rate);
            }
        }
        for i in 0..FORCES {
            let (upper, lower) = matrix.split_at_mut(RATE);
            let (force, rate) = (&mut upper[FORCE + i], &lower[i]);
            for j in RATE..WIDTH {
                force[j] += dt * rate[j];
            }
            for j in i..FORCES {
                force[FORCE + j] += forces[i][j];
            }
        }
    }
}

kernel! {
    /// x_i *= keep_i, in the upper half.
    fn scale(matrix: &mut Matrix, keep: &Column) {
        for (i, row) in matrix.iter_mut().enumerate() {
            let begin = first(i);
            let row = &mut row[begin..];
            let keeps = &keep[begin..];
            for j in 0..row.len() {
                row[j] *= keep[i] * keeps[j];
            }
        }
    }
}

kernel! {
    /// Rates of the body += dt J (F, M), in the upper half. Rows of F and M must be whole.
    fn turn(matrix: &mut Matrix, jacobian: &[[f64; BALANCED]; 3], dt: f64) {
        let mut added = [Column::ZERO; 3];
        for chunk in 0..WIDTH / LANES {
            let mut sums = [[0.0; LANES]; 3];
            for j in 0..BALANCED {
                let row = lanes(&matrix[position(j)], chunk);
                for axis in 0..3 {
                    let gain = dt * jacobian[axis][j];
                    for k in 0..LANES {
                        sums[axis][k] += gain * row[k];
                    }
                }
            }
            for axis in 0..3 {
                *lanes_mut(&mut added[axis], chunk) = sums[axis];
            }
        }
        for a in 0..3 {
            for b in a..3 {
                let mut square = 0.0;
                for j in 0..BALANCED {
                    square += dt * jacobian[b][j] * added[a][position(j)];
                }
                matrix[BODY_RATE + a][BODY_RATE + b] += added[a][BODY_RATE + b] + added[b][BODY_RATE + a] + square;
            }
            for j in BODY_RATE + 3..WIDTH {
                matrix[BODY_RATE + a][j] += added[a][j];
            }
        }
        for (i, row) in matrix[..BODY_RATE].iter_mut().enumerate() {
            for axis in 0..3 {
                row[BODY_RATE + axis] += added[axis][i];
            }
            lanes_stay_together();
        }
    }
}
