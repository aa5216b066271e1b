//! Propagation of one corner, or of both corners of a live axle, over a step: forces, struts and tyres as one linear
//! system.
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
use super::layout::{FORCE, RATE, ROAD, State};
use super::transition::Transition;

/// States of a corner, its force rates, and the rate of the road.
const BLOCK: usize = CORNER + 4;
const AT_RATE: usize = CORNER;
const AT_ROAD: usize = CORNER + 3;
const LOAD: usize = 2;
/// States whose equation has more than a rate: load, strut rate, strut length.
const COUPLED: [usize; 3] = [LOAD, AT_SPEED, AT_LENGTH];
/// Terms of the exponential's series: the stiffest corner (on a stop) has a norm of 3 over a step.
const TERMS: u32 = 18;
/// Rows of two corners and one source of noise.
const MOVED: usize = 11;

/// Gains of the states of `W` corners, and a constant.
#[derive(Clone, Copy)]
struct Row<const W: usize> {
    of: [[f64; BLOCK]; W],
    one: f64,
}

impl<const W: usize> Row<W> {
    const ZERO: Self = Self {
        of: [[0.0; BLOCK]; W],
        one: 0.0,
    };

    fn unit(corner: usize, local: usize) -> Self {
        let mut row = Self::ZERO;
        row.of[corner][local] = 1.0;
        row
    }

    fn add(&mut self, factor: f64, other: &Self) {
        for (to, from) in self.of.iter_mut().zip(&other.of) {
            for (gain, of_other) in to.iter_mut().zip(from) {
                *gain += factor * of_other;
            }
        }
        self.one += factor * other.one;
    }
}

/// Transition of the states of `W` corners that move each other over a step, and half a step: one corner by itself,
/// or both of a live axle.
pub(super) struct Propagation<const W: usize> {
    /// Rows of F_x, F_y, F_z, strut rate and length of each corner over the local states.
    full: [[Row<W>; 5]; W],
    half: [[Row<W>; 5]; W],
    /// Part of the road's rate that remains after half a step.
    road_kept: f64,
    wheels: [usize; W],
}

/// Local positions of the rows of a [`Propagation`].
const ROWS: [usize; 5] = [0, 1, LOAD, AT_SPEED, AT_LENGTH];

/// What moves a corner's strut and presses its tyre.
pub(super) struct Moving<const W: usize> {
    /// Acceleration of the strut, m/s^2: gains of the states of each corner.
    pub(super) acceleration: [[f64; CORNER]; W],
    /// Its constant, m/s^2.
    pub(super) constant: f64,
    /// Part of the tyre that touches the ground.
    pub(super) touching: f64,
    /// The tyre's stiffness along each strut, N/mm of its length.
    pub(super) pressing_n_mm: [f64; W],
}

impl Moving<1> {
    /// A corner by itself.
    pub(super) fn alone(acceleration: &Form, [touching, pressing_n_mm]: [f64; 2]) -> Self {
        Self {
            acceleration: [acceleration.gains],
            constant: acceleration.constant,
            touching,
            pressing_n_mm: [pressing_n_mm],
        }
    }
}

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

impl<const W: usize> Propagation<W> {
    /// With what moves each corner, and the time constants of the load's rate and of the road's, s.
    pub(super) fn new(
        wheels: [usize; W],
        moving: &[Moving<W>; W],
        times_s: [f64; 2],
        dt: f64,
    ) -> Self {
        let mut equations = [[Row::ZERO; 3]; W];
        for (corner, (equations, moving)) in equations.iter_mut().zip(moving).enumerate() {
            equations[0].of[corner][AT_RATE + 2] = moving.touching;
            equations[0].of[corner][AT_ROAD] = moving.touching;
            for (other, pressing) in moving.pressing_n_mm.iter().enumerate() {
                equations[0].of[other][AT_SPEED] = -pressing;
            }
            for (other, gains) in moving.acceleration.iter().enumerate() {
                for (k, gain) in gains.iter().enumerate() {
                    equations[1].of[other][k] = 1e3 * gain;
                }
            }
            equations[1].one = 1e3 * moving.constant;
            equations[2].of[corner][AT_SPEED] = 1.0;
        }
        let mut power: [[Row<W>; 3]; W] =
            std::array::from_fn(|corner| COUPLED.map(|local| Row::unit(corner, local)));
        let [mut full, mut half] = [power; 2];
        let (mut of_full, mut of_half) = (1.0, 1.0);
        for n in 1..=TERMS {
            of_full *= dt / f64::from(n);
            of_half *= 0.5 * dt / f64::from(n);
            for corner in 0..W {
                for row in 0..3 {
                    let next = times_equations(&power[corner][row], &equations, times_s);
                    power[corner][row] = next;
                    full[corner][row].add(of_full, &next);
                    half[corner][row].add(of_half, &next);
                }
            }
        }
        let with_plain = |coupled: &[[Row<W>; 3]; W], time_s: f64| {
            std::array::from_fn(|corner| {
                let plain = |axis: usize| {
                    let mut row = Row::unit(corner, axis);
                    row.of[corner][AT_RATE + axis] = time_s;
                    row
                };
                let [load, speed, length] = coupled[corner];
                [plain(0), plain(1), load, speed, length]
            })
        };
        Self {
            full: with_plain(&full, dt),
            half: with_plain(&half, 0.5 * dt),
            road_kept: math::exp(-0.5 * dt / times_s[1]),
            wheels,
        }
    }

    /// Its wheels.
    pub(super) fn wheels(&self) -> [usize; W] {
        self.wheels
    }

    /// Adds the rows to the transition, and what is added to their states.
    pub(super) fn mix_into(&self, transition: &mut Transition, added: &mut State) {
        for (corner, rows) in self.full.iter().enumerate() {
            for (local, row) in ROWS.into_iter().zip(rows) {
                let index = global(self.wheels[corner], local);
                let terms = row.of.iter().enumerate().flat_map(|(other, gains)| {
                    let wheel = self.wheels[other];
                    (0..BLOCK).map(move |k| (global(wheel, k), gains[k]))
                });
                transition.mix(index, terms);
                added[index] = row.one;
            }
        }
    }

    /// Covariances of the process noise over the step, by Simpson's rule, element by element of the upper
    /// half.
    pub(super) fn noise(
        &self,
        noises: &[Noises; W],
        dt: f64,
        add: &mut impl FnMut(usize, usize, f64),
    ) {
        for (corner, noises) in noises.iter().enumerate() {
            let sources = (0..3)
                .map(|axis| (axis, noises.force[axis]))
                .chain((0..4).map(|axis| (AT_RATE + axis, noises.rate[axis])))
                .chain([(AT_SPEED, noises.speed)]);
            for (source, density) in sources {
                self.noise_of([corner, source], density * dt / 6.0, add);
            }
        }
    }

    fn noise_of(
        &self,
        [corner, source]: [usize; 2],
        weight: f64,
        add: &mut impl FnMut(usize, usize, f64),
    ) {
        let moved = 5 * W;
        // The source itself keeps its place; what it moves are the rows.
        let own = source >= AT_RATE;
        let kept = if source == AT_ROAD {
            self.road_kept
        } else {
            1.0
        };
        let effect = |rows: &[[Row<W>; 5]; W], kept: f64| -> [f64; MOVED] {
            std::array::from_fn(|k| match rows.get(k / 5) {
                Some(rows) => rows[k % 5].of[corner][source],
                None => f64::from(own) * kept,
            })
        };
        let (full, half) = (effect(&self.full, kept * kept), effect(&self.half, kept));
        let begin: [f64; MOVED] = std::array::from_fn(|k| {
            if k < moved {
                f64::from(k / 5 == corner && ROWS[k % 5] == source)
            } else {
                f64::from(own)
            }
        });
        let place = |k: usize| match self.wheels.get(k / 5) {
            Some(wheel) => global(*wheel, ROWS[k % 5]),
            None => global(self.wheels[corner], source),
        };
        for i in 0..=moved {
            for j in i..=moved {
                let product = begin[i] * begin[j] + 4.0 * half[i] * half[j] + full[i] * full[j];
                if product != 0.0 && (own || j < moved) {
                    let (a, b) = (place(i), place(j));
                    add(a.min(b), a.max(b), weight * product);
                }
            }
        }
    }
}

/// A row of a power of the system's matrix, times the matrix.
fn times_equations<const W: usize>(
    row: &Row<W>,
    equations: &[[Row<W>; 3]; W],
    [load_rate_s, road_s]: [f64; 2],
) -> Row<W> {
    let mut product = Row::ZERO;
    for (of_corner, equations) in row.of.iter().zip(equations) {
        for (equation, local) in equations.iter().zip(COUPLED) {
            product.add(of_corner[local], equation);
        }
    }
    for (product, row) in product.of.iter_mut().zip(&row.of) {
        product[AT_RATE] += row[0];
        product[AT_RATE + 1] += row[1];
        product[AT_RATE + 2] -= row[AT_RATE + 2] / load_rate_s;
        product[AT_ROAD] -= row[AT_ROAD] / road_s;
    }
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
        let moving = [Moving::alone(&Form::default(), [1.0, 0.0])];
        let corner = Propagation::new([0], &moving, [1.0, time_s], dt);
        let kept = math::exp(-dt / time_s);
        let of_rate = corner.full[0][2].of[0][AT_ROAD];
        assert!((of_rate - time_s * (1.0 - kept)).abs() < 1e-9, "{of_rate}");
        let noises = Noises {
            force: [0.0; 3],
            rate: [0.0, 0.0, 0.0, density],
            speed: 0.0,
        };
        let mut variance = [0.0; 2];
        corner.noise(&[noises], dt, &mut |i, j, value| {
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
