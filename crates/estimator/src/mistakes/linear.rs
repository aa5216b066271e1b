//! Symmetric positive definite systems in buffers that exist already: a step must not allocate. Wider registers do
//! the same operations in the same order, so that every processor gives the same bits.

use multiversion::multiversion;

/// Sums that a scalar product adds up side by side.
const LANES: usize = 8;

/// Replaces a symmetric matrix of `n` rows by its Cholesky factor, the lower triangle; `None` if it is not positive
/// definite.
#[multiversion(targets("x86_64+avx+avx2+avx512f", "x86_64+avx+avx2"))]
pub(super) fn factor(matrix: &mut [f64], n: usize) -> Option<()> {
    for i in 0..n {
        for j in 0..=i {
            let (rows, row) = matrix.split_at(i * n);
            let other = if j == i { row } else { &rows[j * n..] };
            let known: f64 = dot(&row[..j], &other[..j]);
            let rest = row[j] - known;
            if j < i {
                matrix[i * n + j] = rest / matrix[j * n + j];
            } else if rest > 0.0 {
                matrix[i * n + i] = rest.sqrt();
            } else {
                return None;
            }
        }
    }
    Some(())
}

/// Solves L y = b in place; b is the vector of `of`.
#[multiversion(targets("x86_64+avx+avx2+avx512f", "x86_64+avx+avx2"))]
pub(super) fn forward(factor: &[f64], n: usize, b: &mut [f64]) {
    for i in 0..n {
        let row = &factor[i * n..i * n + i];
        b[i] = (b[i] - dot(row, &b[..i])) / factor[i * n + i];
    }
}

/// Solves L' x = y in place.
#[multiversion(targets("x86_64+avx+avx2+avx512f", "x86_64+avx+avx2"))]
fn backward(factor: &[f64], n: usize, y: &mut [f64]) {
    for i in (0..n).rev() {
        y[i] /= factor[i * n + i];
        let (before, at) = y.split_at_mut(i);
        add(before, -at[0], &factor[i * n..i * n + i]);
    }
}

/// Solves A x = b in place by the factor of A.
pub(super) fn solve(factor: &[f64], n: usize, b: &mut [f64]) {
    forward(factor, n, b);
    backward(factor, n, b);
}

/// Writes the inverse of A by its factor.
pub(super) fn invert(factor: &[f64], n: usize, inverse: &mut [f64]) {
    inverse[..n * n].fill(0.0);
    for (i, row) in inverse.chunks_exact_mut(n).take(n).enumerate() {
        row[i] = 1.0;
        solve(factor, n, row);
    }
}

#[inline(always)]
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let count = a.len().min(b.len());
    let ((a, last_a), (b, last_b)) = (
        a[..count].as_chunks::<LANES>(),
        b[..count].as_chunks::<LANES>(),
    );
    let mut sums = [0.0; LANES];
    for (a, b) in a.iter().zip(b) {
        for k in 0..LANES {
            sums[k] += a[k] * b[k];
        }
    }
    let last = last_a.iter().zip(last_b);
    sums.iter().sum::<f64>() + last.map(|(a, b)| a * b).sum::<f64>()
}

/// sum += factor part.
#[inline(always)]
pub(super) fn add(sum: &mut [f64], factor: f64, part: &[f64]) {
    for (sum, part) in sum.iter_mut().zip(part) {
        *sum += factor * part;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_of_a_matrix_times_the_matrix_is_one() {
        let n = 7;
        let entry = |i: usize, j: usize| {
            let apart = i.abs_diff(j) as f64;
            1.0 / (1.0 + apart * apart) + if i == j { 0.3 * i as f64 } else { 0.0 }
        };
        let mut matrix: Vec<f64> = (0..n * n).map(|k| entry(k / n, k % n)).collect();
        factor(&mut matrix, n).unwrap();
        let mut inverse = vec![0.0; n * n];
        invert(&matrix, n, &mut inverse);
        for i in 0..n {
            for j in 0..n {
                let product: f64 = (0..n).map(|k| entry(i, k) * inverse[k * n + j]).sum();
                let one = f64::from(u8::from(i == j));
                assert!((product - one).abs() < 1e-12, "{i} {j} {product}");
            }
        }
    }

    #[test]
    fn an_indefinite_matrix_has_no_factor() {
        assert_eq!(factor(&mut [1.0, 2.0, 2.0, 1.0], 2), None);
    }
}
