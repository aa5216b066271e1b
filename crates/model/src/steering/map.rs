use crate::error::require;
use crate::{Error, Scalar};

/// A monotone cubic through calibrated points (Fritsch and Carlson, 1980): it follows them without
/// overshoot, its slope is continuous, and it goes on straight beyond its ends.
#[derive(Clone, Debug, PartialEq)]
pub struct MonotoneMap {
    points: Vec<[f64; 2]>,
    slopes: Vec<f64>,
}

impl MonotoneMap {
    /// The map through points (x, y), x ascending and y never falling.
    ///
    /// # Errors
    /// Where there are fewer than two points, or they are not finite, ascending and monotone.
    pub fn new(points: &[[f64; 2]]) -> Result<Self, Error> {
        require(
            points.len() >= 2,
            "number of map points",
            points.len() as f64,
            "",
            "two or more",
        )?;
        for point in points {
            require(point[0].is_finite(), "map x", point[0], "rad", "finite")?;
            require(point[1].is_finite(), "map y", point[1], "rad", "finite")?;
        }
        for pair in points.windows(2) {
            require(
                pair[1][0] > pair[0][0],
                "map x",
                pair[1][0],
                "rad",
                "above the one before",
            )?;
            require(
                pair[1][1] >= pair[0][1],
                "map y",
                pair[1][1],
                "rad",
                "not below the one before",
            )?;
        }
        let secants: Vec<f64> = points
            .windows(2)
            .map(|pair| (pair[1][1] - pair[0][1]) / (pair[1][0] - pair[0][0]))
            .collect();
        let last = secants.len() - 1;
        let mut slopes: Vec<f64> = (0..points.len())
            .map(|k| match k {
                0 => secants[0],
                k if k > last => secants[last],
                k if secants[k - 1] * secants[k] <= 0.0 => 0.0,
                k => 0.5 * (secants[k - 1] + secants[k]),
            })
            .collect();
        for (k, secant) in secants.iter().enumerate() {
            if *secant == 0.0 {
                slopes[k] = 0.0;
                slopes[k + 1] = 0.0;
                continue;
            }
            let (left, right) = (slopes[k] / secant, slopes[k + 1] / secant);
            let size = math::hypot(left, right);
            if size > 3.0 {
                slopes[k] = 3.0 / size * left * secant;
                slopes[k + 1] = 3.0 / size * right * secant;
            }
        }
        Ok(Self {
            points: points.to_vec(),
            slopes,
        })
    }

    /// The map's value at x.
    pub fn at<T: Scalar>(&self, x: T) -> T {
        let last = self.points.len() - 1;
        let k = self.points.partition_point(|point| x > point[0]);
        if k == 0 || k > last {
            let end = if k == 0 { 0 } else { last };
            let [from, value] = self.points[end];
            return (x - from) * self.slopes[end] + value;
        }
        let ([x0, y0], [x1, y1]) = (self.points[k - 1], self.points[k]);
        let width = x1 - x0;
        let t = (x - x0) / width;
        let (start, end) = (self.slopes[k - 1] * width, self.slopes[k] * width);
        // Horner form of the cubic Hermite polynomial.
        let rise = y1 - y0;
        ((t * (start + end - 2.0 * rise) + (3.0 * rise - 2.0 * start - end)) * t + start) * t + y0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: RngSeed::Fixed(14), ..ProptestConfig::default() })]

        #[test]
        fn it_passes_through_its_points_and_never_falls(
            steps in prop::collection::vec((0.05..1.0_f64, 0.0..1.0_f64), 2..12),
            probe in 0.0..1.0_f64,
        ) {
            let mut at = [-2.0, -1.0];
            let points: Vec<[f64; 2]> = steps.iter().map(|(dx, dy)| {
                at = [at[0] + dx, at[1] + dy];
                at
            }).collect();
            let map = MonotoneMap::new(&points).unwrap();
            for point in &points {
                prop_assert!((map.at(point[0]) - point[1]).abs() < 1e-12);
            }
            let span = points[points.len() - 1][0] - points[0][0] + 1.0;
            let x = points[0][0] - 0.5 + probe * span;
            prop_assert!(map.at(x + 1e-3) >= map.at(x) - 1e-12);
        }
    }

    #[test]
    fn falling_or_non_finite_points_are_named() {
        let message = MonotoneMap::new(&[[0.0, 0.0], [1.0, -1.0]])
            .unwrap_err()
            .to_string();
        assert!(message.contains("map y = -1 rad"), "{message}");
        assert!(MonotoneMap::new(&[[0.0, 0.0], [f64::NAN, 1.0]]).is_err());
        assert!(MonotoneMap::new(&[[0.0, 0.0]]).is_err());
    }
}
