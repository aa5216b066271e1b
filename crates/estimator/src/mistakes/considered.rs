//! What the errors of the parameters within their tolerances do to the forces: consider parameters (Jazwinski,
//! Stochastic Processes and Filtering Theory, section 8.4).
//!
//! The force filter takes the parameters for exact. Rows z = G u + H p that are solved for the forces by gains K have
//! the error K H p. The tolerances of all parameters have one factor, the one for which the drive is likeliest
//! (empirical Bayes). It is zero for a vehicle whose readings agree as if all parameters were exact.

use super::evidence::{Setup, tolerated_gains};
use super::layout::TOLERATED;
use super::linear;
use super::tolerances::Shape;
use crate::fusion::relations::{Loads, ROWS, STRUT_ROW};
use crate::statics::AXIAL;

/// Forces of the tyres.
pub(super) const FORCES: usize = 12;

/// Effect of the parameters' errors on the forces.
#[derive(Clone, Debug)]
pub(super) struct Considered {
    /// Factor on the tolerances.
    pub(super) care: f64,
    /// Gains of the forces on the rows of the last window.
    pub(super) response: Box<[[f64; ROWS]; FORCES]>,
}

impl Default for Considered {
    fn default() -> Self {
        Self {
            care: 0.0,
            response: Box::new([[0.0; ROWS]; FORCES]),
        }
    }
}

impl Considered {
    /// Variances of the forces by parameters with these tolerances, wheel-carrier frame, N^2.
    pub(super) fn variances(
        &self,
        loads: &Loads,
        setup: &Setup,
        tolerance: &[f64; TOLERATED],
    ) -> [f64; FORCES] {
        let mut effects = [[0.0; TOLERATED]; FORCES];
        tolerated_gains(loads, setup, &mut |row, column, gain| {
            for (effects, response) in effects.iter_mut().zip(self.response.iter()) {
                effects[column] += response[row] * gain;
            }
        });
        let mut variances = effects.map(|effects| {
            let parts = effects
                .iter()
                .zip(tolerance)
                .map(|(a, b)| self.care * a * b);
            parts.map(|part| part * part).sum()
        });
        if let Some(shape) = &setup.stated.shape {
            self.add_hard_points(loads, shape, &mut variances);
        }
        variances
    }

    /// Adds the variances by the hard-points: an error of a coordinate acts on all members of its corner.
    fn add_hard_points(&self, loads: &Loads, shape: &Shape, variances: &mut [f64; FORCES]) {
        for (wheel, coordinates) in shape.coordinates.iter().enumerate() {
            let force_n = &loads.force_n[3 * wheel..3 * wheel + 3];
            let strut = STRUT_ROW + wheel;
            for carried in coordinates {
                let [axial @ .., by_strut] =
                    carried.map(|parts| self.care * linear::dot(&parts, force_n));
                let by_strut = by_strut / loads.strut_mass_kg[wheel];
                for (variance, response) in variances.iter_mut().zip(self.response.iter()) {
                    let rows = &response[AXIAL.len() * wheel..];
                    let effect = linear::dot(&axial, rows) + by_strut * response[strut];
                    *variance += effect * effect;
                }
            }
        }
    }
}
