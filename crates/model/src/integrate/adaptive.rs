use crate::Error;
use crate::error::require;

/// How exact an adaptive integration is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Error of one step, part of each number's size.
    pub relative: f64,
    /// Error of one step added to that, in each number's own unit.
    pub absolute: f64,
    /// Longest step, s.
    pub step_most_s: f64,
    /// Shortest step, s; needing a shorter one is an error.
    pub step_least_s: f64,
}

impl Default for Tolerance {
    fn default() -> Self {
        Self {
            relative: 1e-8,
            absolute: 1e-9,
            step_most_s: 0.05,
            step_least_s: 1e-12,
        }
    }
}

/// Nodes of Dormand and Prince's pair of fifth and fourth order.
const NODE: [f64; 7] = [0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0];

/// Its stages (Dormand and Prince 1980, table 2); the last row is the fifth-order rule.
const STAGE: [[f64; 6]; 7] = [
    [0.0; 6],
    [0.2, 0.0, 0.0, 0.0, 0.0, 0.0],
    [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0],
    [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0],
    [
        19372.0 / 6561.0,
        -25360.0 / 2187.0,
        64448.0 / 6561.0,
        -212.0 / 729.0,
        0.0,
        0.0,
    ],
    [
        9017.0 / 3168.0,
        -355.0 / 33.0,
        46732.0 / 5247.0,
        49.0 / 176.0,
        -5103.0 / 18656.0,
        0.0,
    ],
    [
        35.0 / 384.0,
        0.0,
        500.0 / 1113.0,
        125.0 / 192.0,
        -2187.0 / 6784.0,
        11.0 / 84.0,
    ],
];

/// Fifth-order weights less fourth-order weights.
const DIFFERENCE: [f64; 7] = [
    71.0 / 57600.0,
    0.0,
    -71.0 / 16695.0,
    71.0 / 1920.0,
    -17253.0 / 339200.0,
    22.0 / 525.0,
    -1.0 / 40.0,
];

/// Integrates a rate from one time to another with Dormand and Prince's pair and a
/// proportional-integral step control. `observe` sees every accepted step.
///
/// # Errors
/// Where the step would have to be shorter than allowed, as with a rate that is not finite, and
/// where an argument is out of range.
pub fn adaptive<const N: usize>(
    start: &[f64; N],
    from_s: f64,
    to_s: f64,
    tolerance: &Tolerance,
    mut rate: impl FnMut(f64, &[f64; N]) -> [f64; N],
    mut observe: impl FnMut(f64, &[f64; N]),
) -> Result<[f64; N], Error> {
    require(from_s.is_finite(), "from_s", from_s, "s", "finite")?;
    require(to_s >= from_s, "to_s", to_s, "s", "not before from_s")?;
    require(
        tolerance.relative > 0.0,
        "tolerance.relative",
        tolerance.relative,
        "",
        "greater than 0",
    )?;
    let (mut time, mut x) = (from_s, *start);
    let mut k = [[0.0; N]; 7];
    k[0] = rate(time, &x);
    let mut step = first_step(&x, &k[0], tolerance).min(to_s - from_s);
    let mut last_error: f64 = 1e-4;
    while time < to_s {
        let step_now = step.min(to_s - time);
        if step_now < tolerance.step_least_s && to_s - time > tolerance.step_least_s {
            return Err(Error::StepTooSmall {
                time_s: time,
                step_s: step_now,
            });
        }
        let mut ahead = x;
        for s in 1..7 {
            for (i, value) in ahead.iter_mut().enumerate() {
                let sum: f64 = (0..s).map(|j| STAGE[s][j] * k[j][i]).sum();
                *value = x[i] + step_now * sum;
            }
            k[s] = rate(time + NODE[s] * step_now, &ahead);
        }
        let error = error_norm(&x, &ahead, &k, step_now, tolerance);
        if error <= 1.0 {
            time = if step_now < step || to_s - time <= step_now {
                to_s
            } else {
                time + step_now
            };
            x = ahead;
            k[0] = k[6];
            observe(time, &x);
            let growth = 0.9 * math::powf(error.max(1e-10), -0.17) * math::powf(last_error, 0.04);
            step = (step_now * growth.clamp(0.2, 5.0)).min(tolerance.step_most_s);
            last_error = error.max(1e-4);
        } else {
            let shrink = if error.is_finite() {
                (0.9 * math::powf(error, -0.2)).clamp(0.1, 0.9)
            } else {
                0.1
            };
            step = step_now * shrink;
            if step < tolerance.step_least_s {
                return Err(Error::StepTooSmall {
                    time_s: time,
                    step_s: step,
                });
            }
        }
    }
    Ok(x)
}

fn scale_of(tolerance: &Tolerance, a: f64, b: f64) -> f64 {
    tolerance.absolute + tolerance.relative * a.abs().max(b.abs())
}

fn first_step<const N: usize>(x: &[f64; N], rate: &[f64; N], tolerance: &Tolerance) -> f64 {
    let fastest = x
        .iter()
        .zip(rate)
        .map(|(x, rate)| rate.abs() / (1e-3 + x.abs()))
        .fold(1e-6, f64::max);
    (1e-3 / fastest).clamp(10.0 * tolerance.step_least_s, tolerance.step_most_s)
}

fn error_norm<const N: usize>(
    x: &[f64; N],
    ahead: &[f64; N],
    k: &[[f64; N]; 7],
    step: f64,
    tolerance: &Tolerance,
) -> f64 {
    let sum: f64 = (0..N)
        .map(|i| {
            let error: f64 = (0..7).map(|s| DIFFERENCE[s] * k[s][i]).sum();
            (step * error / scale_of(tolerance, x[i], ahead[i])).powi(2)
        })
        .sum();
    (sum / N as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn circle(tolerance: f64) -> (f64, usize) {
        let limits = Tolerance {
            relative: tolerance,
            absolute: tolerance,
            step_most_s: 10.0,
            ..Tolerance::default()
        };
        let mut steps = 0;
        let end = adaptive(
            &[1.0, 0.0],
            0.0,
            20.0,
            &limits,
            |_, x| [x[1], -x[0]],
            |_, _| steps += 1,
        )
        .unwrap();
        let error = math::hypot(end[0] - math::cos(20.0_f64), end[1] + math::sin(20.0_f64));
        (error, steps)
    }

    #[test]
    fn it_is_as_exact_as_asked_and_of_fifth_order() {
        let (coarse, few) = circle(1e-5);
        let (fine, many) = circle(1e-10);
        assert!(coarse < 1e-3 && fine < 2e-8, "{coarse} {fine}");
        // Fifth order: 1e5 times less error for ten times the steps.
        let order = math::ln(coarse / fine) / math::ln(many as f64 / few as f64);
        assert!((4.5..5.8).contains(&order), "{order}");
    }

    #[test]
    fn it_ends_at_the_time_asked_for_and_a_rate_of_time_is_followed() {
        let mut last = 0.0;
        let end = adaptive(
            &[0.0],
            0.0,
            1.5,
            &Tolerance::default(),
            |t, _| [3.0 * t * t],
            |t, _| last = t,
        )
        .unwrap();
        assert_eq!(last, 1.5);
        assert!((end[0] - 3.375).abs() < 1e-9);
    }

    #[test]
    fn a_rate_that_blows_up_is_an_error_that_names_the_time() {
        let error = adaptive(
            &[1.0],
            0.0,
            2.0,
            &Tolerance::default(),
            |_, x| [x[0] * x[0]],
            |_, _| {},
        );
        assert!(
            matches!(error, Err(Error::StepTooSmall { time_s, .. }) if (time_s - 1.0).abs() < 1e-3),
            "{error:?}"
        );
    }
}
