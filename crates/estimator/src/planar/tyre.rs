//! The tyre curve of an axle.

/// Force over the greatest force, and its slope: x/(1 + |x|^n)^(1/n) with the normalised slip
/// x = C a/(mu F_z). It has the slope 1 at the origin and rises to 1; a higher n keeps to the straight
/// line for longer. (The normalisation is that of Pacejka's similarity method, Tyre and Vehicle
/// Dynamics, 3rd edition, section 4.2.)
#[must_use]
pub fn normalised_force(x: f64, shape: f64) -> (f64, f64) {
    let size = x.abs();
    if size > 1e3 {
        return (x.signum(), 0.0);
    }
    let root = math::powf(1.0 + math::powf(size, shape), -1.0 / shape);
    // d/dx x (1 + x^n)^(-1/n) = (1 + x^n)^(-1/n - 1)
    (x * root, math::powf(root, shape + 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_is_that_of_the_force() {
        for shape in [1.2, 2.0, 2.5, 4.0] {
            for x in [-5.0, -1.0, -0.2, 0.0, 0.3, 1.1, 4.0] {
                let step = 1e-6;
                let (high, _) = normalised_force(x + step, shape);
                let (low, _) = normalised_force(x - step, shape);
                let (value, slope) = normalised_force(x, shape);
                assert!((slope - (high - low) / (2.0 * step)).abs() < 1e-6);
                assert!(value.abs() <= 1.0);
            }
        }
    }
}
