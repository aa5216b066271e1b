//! One channel's counts against the known forces.

use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};
use sample::StrainChannel;

use super::faults::WiringKind;

/// What the sensors file leaves open of a gain, as a part of it.
const GAIN_PRIOR: f64 = 0.2;
/// What the geometry leaves open of a sensitivity, as a part of its size.
const GEOMETRY_PRIOR: f64 = 0.1;
/// Deviation of the geometry's prediction, as a part of the greatest change that it predicts.
const GEOMETRY_SIGMA: f64 = 0.002;
/// Least part of a channel's changes that its member must explain.
const EXPLAINED: f64 = 0.9;
/// Least greatest change of a channel, counts, that tells anything.
const CHANGE_NEEDED: f64 = 4.0;
/// A gain this many times the nominal one, or its reciprocal, is not the nominal wiring.
const GAIN_WITHIN: f64 = 2.0;

/// One channel's counts, the known forces, and what they make of each member.
pub(super) struct Table {
    pub(super) counts: Vec<f64>,
    pub(super) sigma: Vec<f64>,
    pub(super) force: Vec<[f64; 3]>,
    pub(super) member: Vec<[f64; StrainChannel::COUNT]>,
}

/// counts = offset + slope member.
pub(super) struct Line {
    pub(super) offset: [f64; 2],
    pub(super) slope: [f64; 2],
    pub(super) condition: f64,
    pub(super) residuals: Vec<f64>,
}

impl Table {
    /// What is wrong, if anything.
    pub(super) fn wiring(&self, channel: StrainChannel, nominal: f64) -> Option<WiringKind> {
        let own = self.explained(channel.index());
        let change = spread(&self.counts);
        let expected = spread(&self.column(channel.index())) / nominal;
        if change < 0.15 * expected.max(CHANGE_NEEDED) {
            return (expected > CHANGE_NEEDED).then_some(WiringKind::NoReaction);
        }
        let sound = own.0 > EXPLAINED
            && (1.0 / GAIN_WITHIN..GAIN_WITHIN).contains(&(own.1.abs() * nominal));
        let best = StrainChannel::ALL
            .into_iter()
            .take(6)
            .map(|other| (other, self.explained(other.index())))
            .max_by(|a, b| a.1.0.total_cmp(&b.1.0));
        let better = best
            .filter(|(other, (part, _))| *other != channel && 1.0 - part < 0.25 * (1.0 - own.0));
        match better {
            Some((other, (part, _))) if part > EXPLAINED && !sound => {
                if other == StrainChannel::LowerFrontBending {
                    Some(WiringKind::Bending)
                } else {
                    Some(WiringKind::Swapped(other))
                }
            }
            _ if sound && own.1 < 0.0 => Some(WiringKind::Inverted),
            _ if sound => None,
            _ if own.0 > EXPLAINED && own.1.abs() * nominal > GAIN_WITHIN => {
                Some(WiringKind::Bending)
            }
            _ => Some(WiringKind::Unexplained),
        }
    }

    fn column(&self, member: usize) -> Vec<f64> {
        self.member.iter().map(|row| row[member]).collect()
    }

    /// The part of the counts' changes that a member explains, and counts for one unit of it.
    fn explained(&self, member: usize) -> (f64, f64) {
        let x = self.column(member);
        let n = x.len() as f64;
        let (mx, my) = (
            x.iter().sum::<f64>() / n,
            self.counts.iter().sum::<f64>() / n,
        );
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for (x, y) in x.iter().zip(&self.counts) {
            xx += (x - mx).powi(2);
            xy += (x - mx) * (y - my);
            yy += (y - my).powi(2);
        }
        if xx > 0.0 && yy > 0.0 {
            (xy * xy / (xx * yy), xy / xx)
        } else {
            (0.0, 0.0)
        }
    }

    /// The channel's line, with the sensors file's slope as its prior.
    pub(super) fn line(&self, member: usize, slope: f64) -> Line {
        let x = self.column(member);
        let most = x.iter().fold(0.0_f64, |most, x| most.max(x.abs())) * slope.abs();
        let mut normal = Matrix2::new(0.0, 0.0, 0.0, 1.0 / (GAIN_PRIOR * slope).powi(2));
        let mut right = Vector2::new(0.0, slope * normal[(1, 1)]);
        for (k, x) in x.iter().enumerate() {
            let weight = 1.0 / (self.sigma[k].powi(2) + (GEOMETRY_SIGMA * most).powi(2)).max(1e-6);
            let row = Vector2::new(1.0, *x);
            normal += row * row.transpose() * weight;
            right += row * self.counts[k] * weight;
        }
        let covariance = normal.try_inverse().unwrap_or_default();
        let solution = covariance * right;
        let residuals = x.iter().zip(&self.counts);
        let residuals: Vec<f64> = residuals
            .map(|(x, y)| y - solution[0] - solution[1] * x)
            .collect();
        let correlation =
            covariance[(0, 1)].abs() / (covariance[(0, 0)] * covariance[(1, 1)]).sqrt();
        Line {
            offset: [solution[0], covariance[(0, 0)].sqrt()],
            slope: [solution[1], covariance[(1, 1)].sqrt()],
            condition: ((1.0 + correlation) / (1.0 - correlation).max(1e-9)).sqrt(),
            residuals,
        }
    }

    /// Counts for a newton of F_x, F_y, F_z, the geometry's with the nominal slope as the prior.
    pub(super) fn sensitivity(&self, member: usize, slope: f64) -> [f64; 3] {
        let x = self.column(member);
        let none = Vector4::zeros();
        let geometry = self.solve(&x, &vec![1.0; x.len()], none, 1e-9);
        let mut prior = geometry * slope;
        prior[3] = 512.0;
        let size = prior.fixed_rows::<3>(0).norm();
        let strength = 1.0 / (GEOMETRY_PRIOR * size).powi(2).max(1e-12);
        let weights: Vec<f64> = self
            .sigma
            .iter()
            .map(|s| 1.0 / s.powi(2).max(1e-4))
            .collect();
        let found = self.solve(&self.counts, &weights, prior, strength);
        [found[0], found[1], found[2]]
    }

    /// Weighted least squares of `y` on the forces and a constant, drawn to a prior.
    fn solve(
        &self,
        y: &[f64],
        weights: &[f64],
        prior: Vector4<f64>,
        strength: f64,
    ) -> Vector4<f64> {
        let mut normal = Matrix4::from_diagonal(&Vector4::new(strength, strength, strength, 1e-9));
        let mut right = normal * prior;
        for ((force, y), weight) in self.force.iter().zip(y).zip(weights) {
            let row = Vector4::new(force[0], force[1], force[2], 1.0);
            normal += row * row.transpose() * *weight;
            right += row * *y * *weight;
        }
        normal
            .try_inverse()
            .map_or(prior, |inverse| inverse * right)
    }
}

/// Root mean square from the mean.
pub(super) fn spread(values: &[f64]) -> f64 {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt()
}
