//! Linear ride models: what quarter, half and full car have in common.
//!
//! All are M q'' + C q' + K q = C_t u' + K_t u with heights measured from static equilibrium and
//! road heights u under the wheels. Written in first order with the state [q', q], rates first as
//! in equation 2.20 of the thesis. The thesis's 2.21 has one mass m for both and no tyre damping,
//! and 2.17/2.19 name the one road height u twice; here m_s and m_u differ, the tyre damps, and
//! u' enters beside u.

use nalgebra::{Complex, DMatrix, SMatrix, SVector};

use super::{SuspensionError, finite};

/// A linear ride model with D degrees of freedom, N = 2 D states and W wheels.
#[derive(Clone, Debug, PartialEq)]
pub struct Ride<const D: usize, const N: usize, const W: usize> {
    /// State matrix A of x' = A x + B_0 u + B_1 u'.
    pub state: SMatrix<f64, N, N>,
    /// Input matrix B_0 on the road heights u, m.
    pub road: SMatrix<f64, N, W>,
    /// Input matrix B_1 on the road heights' rates u', m/s.
    pub road_rate: SMatrix<f64, N, W>,
    /// For each wheel, how each degree of freedom opens its suspension (body less wheel), m/m.
    pub travel: SMatrix<f64, W, D>,
    /// For each wheel, its own degree of freedom.
    pub wheel: SMatrix<f64, W, D>,
}

/// One corner of a ride model, at the wheel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RideCorner {
    /// Unsprung mass m_u, kg.
    pub unsprung_mass_kg: f64,
    /// Wheel rate: spring stiffness times the motion ratio squared, N/m.
    pub stiffness_n_m: f64,
    /// Damping at the wheel: times the motion ratio squared likewise, N s/m.
    pub damping_n_s_m: f64,
    /// Vertical stiffness k_t of the tyre, N/m.
    pub tyre_stiffness_n_m: f64,
    /// Vertical damping b_t of the tyre, N s/m.
    pub tyre_damping_n_s_m: f64,
}

impl RideCorner {
    fn check(&self) -> Result<(), SuspensionError> {
        positive("unsprung mass", self.unsprung_mass_kg, "kg")?;
        for (what, value, unit) in [
            ("wheel rate", self.stiffness_n_m, "N/m"),
            ("damping at the wheel", self.damping_n_s_m, "N s/m"),
            ("tyre stiffness", self.tyre_stiffness_n_m, "N/m"),
            ("tyre damping", self.tyre_damping_n_s_m, "N s/m"),
        ] {
            if finite(what, value, unit)? < 0.0 {
                return Err(SuspensionError::Invalid {
                    what,
                    value,
                    unit,
                    expected: "0 or more",
                });
            }
        }
        Ok(())
    }
}

fn positive(what: &'static str, value: f64, unit: &'static str) -> Result<(), SuspensionError> {
    if finite(what, value, unit)? > 0.0 {
        Ok(())
    } else {
        Err(SuspensionError::Invalid {
            what,
            value,
            unit,
            expected: "above 0",
        })
    }
}

/// What a model is assembled from.
pub(super) struct Assembly<const D: usize, const W: usize> {
    /// Masses and inertias on the diagonal; the wheels' own are added.
    pub(super) body_mass: SVector<f64, D>,
    /// How each degree of freedom lifts the body over each wheel.
    pub(super) lift: SMatrix<f64, W, D>,
    pub(super) corners: [RideCorner; W],
    /// Anti-roll bars: left wheel, right wheel, stiffness per metre of difference in travel, N/m.
    pub(super) bars: [Option<(usize, usize, f64)>; 2],
}

impl<const D: usize, const N: usize, const W: usize> Ride<D, N, W> {
    /// The wheels' degrees of freedom are the last W.
    pub(super) fn assemble(parts: &Assembly<D, W>) -> Result<Self, SuspensionError> {
        debug_assert_eq!(N, 2 * D, "rates and positions");
        for inertia in parts.body_mass.iter().take(D - W) {
            positive("sprung mass or inertia", *inertia, "kg or kg m^2")?;
        }
        for lever in parts.lift.iter() {
            finite("wheel position", *lever, "m")?;
        }
        for corner in &parts.corners {
            corner.check()?;
        }
        let mut mass = parts.body_mass;
        let mut stiffness = SMatrix::<f64, D, D>::zeros();
        let mut damping = SMatrix::<f64, D, D>::zeros();
        let mut wheel = SMatrix::<f64, W, D>::zeros();
        let mut travel = parts.lift;
        for (i, corner) in parts.corners.iter().enumerate() {
            let own = D - W + i;
            mass[own] += corner.unsprung_mass_kg;
            wheel[(i, own)] = 1.0;
            travel[(i, own)] -= 1.0;
            let open = travel.row(i).transpose();
            stiffness += open * open.transpose() * corner.stiffness_n_m;
            damping += open * open.transpose() * corner.damping_n_s_m;
            stiffness[(own, own)] += corner.tyre_stiffness_n_m;
            damping[(own, own)] += corner.tyre_damping_n_s_m;
        }
        for &(left, right, rate) in parts.bars.iter().flatten() {
            let twist = (travel.row(left) - travel.row(right)).transpose();
            stiffness += twist * twist.transpose() * rate;
        }
        let mut model = Self {
            state: SMatrix::zeros(),
            road: SMatrix::zeros(),
            road_rate: SMatrix::zeros(),
            travel,
            wheel,
        };
        for row in 0..D {
            for column in 0..D {
                model.state[(row, column)] = -damping[(row, column)] / mass[row];
                model.state[(row, D + column)] = -stiffness[(row, column)] / mass[row];
            }
            model.state[(D + row, row)] = 1.0;
        }
        for (i, corner) in parts.corners.iter().enumerate() {
            let own = D - W + i;
            model.road[(own, i)] = corner.tyre_stiffness_n_m / mass[own];
            model.road_rate[(own, i)] = corner.tyre_damping_n_s_m / mass[own];
        }
        Ok(model)
    }

    /// Rate of change of the state under road heights (m) and their rates (m/s).
    #[must_use]
    pub fn derivative(
        &self,
        state: &SVector<f64, N>,
        road_m: &SVector<f64, W>,
        road_rate_m_s: &SVector<f64, W>,
    ) -> SVector<f64, N> {
        self.state * state + self.road * road_m + self.road_rate * road_rate_m_s
    }

    /// Opening of each suspension (body less wheel), m.
    #[must_use]
    pub fn travel_m(&self, state: &SVector<f64, N>) -> SVector<f64, W> {
        self.travel * state.fixed_rows::<D>(D)
    }

    /// Compression of each tyre beyond its static one (road less wheel), m.
    #[must_use]
    pub fn tyre_compression_m(
        &self,
        state: &SVector<f64, N>,
        road_m: &SVector<f64, W>,
    ) -> SVector<f64, W> {
        road_m - self.wheel * state.fixed_rows::<D>(D)
    }

    /// Poles, 1/s: eigenvalues of the state matrix, by rising magnitude.
    #[must_use]
    pub fn poles(&self) -> Vec<Complex<f64>> {
        let matrix = DMatrix::from_fn(N, N, |row, column| self.state[(row, column)]);
        let mut poles: Vec<_> = matrix.complex_eigenvalues().iter().copied().collect();
        poles.sort_by(|a, b| a.norm().total_cmp(&b.norm()).then(a.im.total_cmp(&b.im)));
        poles
    }

    /// Response of the state to a unit sine of road height under one wheel, as complex amplitudes:
    /// (j w I - A)^-1 (B_0 + j w B_1). `None` where an undamped pole lies on this frequency.
    #[must_use]
    pub fn response(&self, wheel: usize, frequency_hz: f64) -> Option<SVector<Complex<f64>, N>> {
        let w = std::f64::consts::TAU * frequency_hz;
        let matrix = DMatrix::from_fn(N, N, |row, column| {
            let diagonal = if row == column { w } else { 0.0 };
            Complex::new(-self.state[(row, column)], diagonal)
        });
        let input = DMatrix::from_fn(N, 1, |row, _| {
            Complex::new(self.road[(row, wheel)], w * self.road_rate[(row, wheel)])
        });
        let solution = matrix.lu().solve(&input)?;
        Some(SVector::from_fn(|row, _| solution[(row, 0)]))
    }
}

/// Undamped natural frequency of a pole, Hz, and its damping ratio.
#[must_use]
pub fn frequency_and_damping(pole: Complex<f64>) -> [f64; 2] {
    let magnitude = pole.norm();
    [magnitude / std::f64::consts::TAU, -pole.re / magnitude]
}
