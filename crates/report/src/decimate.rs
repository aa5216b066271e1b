//! Fewer points with the same look: the extremes of equal stretches.

/// A curve ready to be drawn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curve {
    /// Abscissa.
    pub x: Vec<f64>,
    /// Ordinate; `NaN` breaks the line.
    pub y: Vec<f64>,
}

/// At most about `limit` points of a curve: all of them if they are few enough, else the least and
/// the greatest value of each of `limit / 2` equal runs of samples, in their order. A run without a
/// finite value becomes one `NaN`, so that gaps stay gaps.
#[must_use]
pub fn extremes(x: &[f64], y: &[f64], limit: usize) -> Curve {
    if x.len() <= limit {
        return Curve {
            x: x.to_vec(),
            y: y.to_vec(),
        };
    }
    let run = x.len().div_ceil((limit / 2).max(1));
    let mut curve = Curve::default();
    for start in (0..x.len()).step_by(run) {
        let end = (start + run).min(x.len());
        let finite = || (start..end).filter(|&index| y[index].is_finite());
        let least = finite().min_by(|&a, &b| y[a].total_cmp(&y[b]));
        let greatest = finite().max_by(|&a, &b| y[a].total_cmp(&y[b]));
        match (least, greatest) {
            (Some(least), Some(greatest)) => {
                for index in [least.min(greatest), least.max(greatest)] {
                    curve.x.push(x[index]);
                    curve.y.push(y[index]);
                }
            }
            _ => {
                curve.x.push(x[start]);
                curve.y.push(f64::NAN);
            }
        }
    }
    curve
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spike_survives_and_a_gap_stays() {
        let x: Vec<f64> = (0..10_000).map(f64::from).collect();
        let mut y = vec![0.0; 10_000];
        y[5_432] = 7.0;
        y[2_000..4_000].fill(f64::NAN);
        let curve = extremes(&x, &y, 100);
        assert!(curve.x.len() <= 102);
        let peak = curve
            .y
            .iter()
            .position(|&value| value == 7.0)
            .expect("the spike is kept");
        assert_eq!(curve.x[peak], 5_432.0);
        assert!(curve.y.iter().any(|value| value.is_nan()));
        assert!(curve.x.is_sorted());
    }

    #[test]
    fn short_curves_are_whole() {
        let curve = extremes(&[0.0, 1.0], &[3.0, 4.0], 2);
        assert_eq!(curve.y, [3.0, 4.0]);
    }
}
