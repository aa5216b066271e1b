//! Propagation of one corner over a step: forces, strut and tyre as one linear system.
//!
//! | equation | what |
//! |---|---|
//! | F_x' = R_x + w, F_y' = R_y + w | force rates, with white noise on rates and forces |
//! | F_z' = R_z + P - k e_z l' + w | the wheel's travel presses the tyre: k tyre stiffness, e_z vertical movement of the wheel centre for the strut's length |
//! | P' = -P/T + w | the road presses the tyre: T is the time in which the tyre passes its contact |
//! | l'' = a F + b M + ... + c | the strut's row of the statics |
//!
//! The noise of P and the white noise on F_z are a road whose height is a random walk (ISO 8608, waviness 2) that
//! the contact smooths.

use super::forms::{AT_LENGTH, AT_SPEED, CORNER, Form, corner_states};
use super::layout::{FORCE, RATE, ROAD};

/// States of a corner, its force rates, the rate of the road, and one.
const LOCAL: usize = CORNER + 5;
const AT_RATE: usize = CORNER;
const AT_ROAD: usize = CORNER + 3;
const ONE: usize = CORNER + 4;
const LOAD: usize = 2;
/// States whose equation has more than a rate: load, strut rate, strut length.
const COUPLED: [usize; 3] = [LOAD, AT_SPEED, AT_LENGTH];
/// Terms of the exponential's series: the stiffest corner (on a stop) has a norm of 3 over a step.
const TERMS: u32 = 18;

/// Transition of one corner's states over a step, and half a step.
pub(super) struct Propagation {
    /// Rows of F_x, F_y, F_z, strut rate and length over the local states.
    full: [[f64; LOCAL]; 5],
    half: [[f64; LOCAL]; 5],
    /// Part of the road's rate that remains after half a step.
    road_kept: f64,
    wheel: usize,
}

/// Local positions of the rows of a [`Propagation`].
const ROWS: [usize; 5] = [0, 1, LOAD, AT_SPEED, AT_LENGTH];

/// Densities of a corner's white noises.
pub(super) struct Noises {
    /// On F_x, F_y, F_z, N^2/s.
    pub(super) force: [f64; 3],
    /// On their rates and on that of the road, (N/s)^2/s.
    pub(super) rate: [f64; 4],
    /// On the strut's rate, (mm/s)^2/s.
    pub(super) speed: f64,
}

/// Index of a local state among all.
pub(super) fn global(wheel: usize, local: usize) -> usize {
    match local.checked_sub(AT_RATE) {
        None => corner_states(wheel)[local],
        Some(axis @ 0..3) => RATE + 3 * wheel + axis,
        Some(_) => ROAD + wheel,
    }
}

impl Propagation {
    /// With the acceleration of the strut, m/s^2, the part of the tyre that touches the ground, the tyre's
    /// stiffness along the strut, N/mm of its length, and the time constants of the load's rate and of the
    /// road's, s.
    pub(super) fn new(
        wheel: usize,
        acceleration: &Form,
        [touching, pressing_n_mm]: [f64; 2],
        times_s: [f64; 2],
        dt: f64,
    ) -> Self {
        let mut equations = [[0.0; LOCAL]; 3];
        equations[0][AT_RATE + 2] = touching;
        equations[0][AT_ROAD] = touching;
        equations[0][AT_SPEED] = -pressing_n_mm;
        for (k, gain) in acceleration.gains.iter().enumerate() {
            equations[1][k] = 1e3 * gain;
        }
        equations[1][ONE] = 1e3 * acceleration.constant;
        equations[2][AT_SPEED] = 1.0;
        let [mut full, mut half] = [[[0.0; LOCAL]; 3]; 2];
        let mut power = [[0.0; LOCAL]; 3];
        for (row, local) in COUPLED.into_iter().enumerate() {
            power[row][local] = 1.0;
            full[row][local] = 1.0;
            half[row][local] = 1.0;
        }
        let (mut of_full, mut of_half) = (1.0, 1.0);
        for n in 1..=TERMS {
            of_full *= dt / f64::from(n);
            of_half *= 0.5 * dt / f64::from(n);
            for row in 0..3 {
                power[row] = times_equations(&power[row], &equations, times_s);
                for k in 0..LOCAL {
                    full[row][k] += of_full * power[row][k];
                    half[row][k] += of_half * power[row][k];
                }
            }
        }
        let with_plain = |coupled: [[f64; LOCAL]; 3], time_s: f64| {
            let plain = |axis: usize| {
                let mut row = [0.0; LOCAL];
                row[axis] = 1.0;
                row[AT_RATE + axis] = time_s;
                row
            };
            [plain(0), plain(1), coupled[0], coupled[1], coupled[2]]
        };
        Self {
            full: with_plain(full, dt),
            half: with_plain(half, 0.5 * dt),
            road_kept: math::exp(-0.5 * dt / times_s[1]),
            wheel,
        }
    }

    /// Rows of the transition: state, gains of states, and what is added.
    pub(super) fn rows(&self) -> impl Iterator<Item = (usize, [(usize, f64); ONE], f64)> + '_ {
        ROWS.into_iter().zip(&self.full).map(|(local, row)| {
            let terms = std::array::from_fn(|k| (global(self.wheel, k), row[k]));
            (global(self.wheel, local), terms, row[ONE])
        })
    }

    /// Covariances of the process noise over the step, by Simpson's rule, element by element of the upper
    /// half.
    pub(super) fn noise(&self, noises: &Noises, dt: f64, add: &mut impl FnMut(usize, usize, f64)) {
        let sources = (0..3)
            .map(|axis| (axis, noises.force[axis]))
            .chain((0..4).map(|axis| (AT_RATE + axis, noises.rate[axis])))
            .chain([(AT_SPEED, noises.speed)]);
        for (source, density) in sources {
            // The source itself keeps its place; what it moves are the rows.
            let own = source >= AT_RATE;
            let kept = if source == AT_ROAD {
                self.road_kept
            } else {
                1.0
            };
            let effect = |rows: &[[f64; LOCAL]; 5], kept: f64| -> [f64; 6] {
                std::array::from_fn(|k| match rows.get(k) {
                    Some(row) => row[source],
                    None => f64::from(own) * kept,
                })
            };
            let (full, half) = (effect(&self.full, kept * kept), effect(&self.half, kept));
            let begin: [f64; 6] = std::array::from_fn(|k| match ROWS.get(k) {
                Some(local) => f64::from(*local == source),
                None => f64::from(own),
            });
            let place = |k: usize| global(self.wheel, ROWS.get(k).copied().unwrap_or(source));
            let weight = density * dt / 6.0;
            for i in 0..6 {
                for j in i..6 {
                    let product = begin[i] * begin[j] + 4.0 * half[i] * half[j] + full[i] * full[j];
                    if product != 0.0 && (own || j < 5) {
                        let (a, b) = (place(i), place(j));
                        add(a.min(b), a.max(b), weight * product);
                    }
                }
            }
        }
    }
}

/// A row of a power of the system's matrix, times the matrix.
fn times_equations(
    row: &[f64; LOCAL],
    equations: &[[f64; LOCAL]; 3],
    [load_rate_s, road_s]: [f64; 2],
) -> [f64; LOCAL] {
    let mut product = [0.0; LOCAL];
    for (equation, local) in equations.iter().zip(COUPLED) {
        for k in 0..LOCAL {
            product[k] += row[local] * equation[k];
        }
    }
    product[AT_RATE] += row[0];
    product[AT_RATE + 1] += row[1];
    product[AT_RATE + 2] -= row[AT_RATE + 2] / load_rate_s;
    product[AT_ROAD] -= row[AT_ROAD] / road_s;
    product
}

/// Forces are the first states of a corner.
const _: () = assert!(FORCE == 0);

#[cfg(test)]
mod tests {
    use super::*;

    /// A load that only the road changes is the integral of a Gauss-Markov process: its variance over a
    /// step from known values in closed form (Gelb, Applied Optimal Estimation, 1974, section 3.8).
    #[test]
    fn the_road_presses_as_the_integral_of_a_gauss_markov_process() {
        let (dt, time_s, density) = (0.01, 0.008, 4.0e6);
        let corner = Propagation::new(0, &Form::default(), [1.0, 0.0], [1.0, time_s], dt);
        let kept = math::exp(-dt / time_s);
        let of_rate = corner.full[2][AT_ROAD];
        assert!((of_rate - time_s * (1.0 - kept)).abs() < 1e-9, "{of_rate}");
        let noises = Noises {
            force: [0.0; 3],
            rate: [0.0, 0.0, 0.0, density],
            speed: 0.0,
        };
        let mut variance = [0.0; 2];
        corner.noise(&noises, dt, &mut |i, j, value| {
            for (sum, at) in variance.iter_mut().zip([FORCE + LOAD, ROAD]) {
                if i == at && j == at {
                    *sum += value;
                }
            }
        });
        let load = density
            * time_s
            * time_s
            * (dt - 2.0 * time_s * (1.0 - kept) + 0.5 * time_s * (1.0 - kept * kept));
        let rate = density * 0.5 * time_s * (1.0 - kept * kept);
        for (is, wanted) in variance.into_iter().zip([load, rate]) {
            assert!((is / wanted - 1.0).abs() < 0.03, "{is} {wanted}");
        }
    }
}
