//! What is known of a tyre's moments beforehand, and the wrench that six noisy channels and this
//! knowledge give together.

use nalgebra::{Matrix6, Vector6};

use super::{CornerStatics, Wrench};

/// Parity constraints on a tyre's moments about its contact point, as standard deviations.
///
/// M_x = 0 +- sigma_x, M_y + c_rr R F_z = 0 +- sigma_y, M_z = 0 +- sigma_z. Overturning moments
/// of 55 N m rms have been seen: sigma_x must not be small. A driven wheel's M_y holds an unknown
/// half-shaft torque: widen sigma_y there unless the torque is given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parity {
    /// Standard deviations of M_x, M_y, M_z, N m; infinite where nothing is known.
    pub sigma_n_m: [f64; 3],
    /// c_rr R: rolling-resistance coefficient times radius, m.
    pub rolling_radius_m: f64,
}

impl Parity {
    /// Deviations found on truth runs of a free-rolling wheel: 40, 6 and 15 N m.
    #[must_use]
    pub fn free_rolling(rolling_resistance: f64, radius_m: f64) -> Self {
        Self {
            sigma_n_m: [40.0, 6.0, 15.0],
            rolling_radius_m: rolling_resistance * radius_m,
        }
    }

    /// The same for a driven wheel whose half-shaft torque is not measured.
    #[must_use]
    pub fn driven(rolling_resistance: f64, radius_m: f64) -> Self {
        Self {
            sigma_n_m: [40.0, f64::INFINITY, 15.0],
            rolling_radius_m: rolling_resistance * radius_m,
        }
    }
}

/// A wrench with its covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrenchEstimate {
    /// Force and moment.
    pub wrench: Wrench,
    /// Covariance in the order of [`Wrench::to_vector`]; N^2, N^2 m, N^2 m^2.
    pub covariance: Matrix6<f64>,
}

impl CornerStatics {
    /// Weighted least squares over the channels and the parity constraints:
    ///
    /// min |c - G^-1 w - c_0|^2_R + |parity(w)|^2
    ///
    /// A dead channel has an infinite deviation. `None` when what is left does not determine the
    /// wrench.
    #[must_use]
    pub fn wrench_with_parity(
        &self,
        members_n: &Vector6<f64>,
        sigma_n: &Vector6<f64>,
        parity: &Parity,
    ) -> Option<WrenchEstimate> {
        let mut information = Matrix6::zeros();
        let mut right = Vector6::zeros();
        for channel in 0..6 {
            if !sigma_n[channel].is_finite() || !members_n[channel].is_finite() {
                continue;
            }
            let row = self.members_from_wrench.row(channel).transpose() / sigma_n[channel];
            let value = (members_n[channel] - self.members_offset[channel]) / sigma_n[channel];
            information += row * row.transpose();
            right += row * value;
        }
        for (axis, sigma) in parity.sigma_n_m.into_iter().enumerate() {
            if !sigma.is_finite() {
                continue;
            }
            let mut row = Vector6::zeros();
            row[3 + axis] = 1.0 / sigma;
            if axis == 1 {
                row[2] = parity.rolling_radius_m / sigma;
            }
            information += row * row.transpose();
        }
        let factor = information.cholesky()?;
        let wrench = factor.solve(&right);
        wrench
            .iter()
            .all(|v| v.is_finite())
            .then(|| WrenchEstimate {
                wrench: Wrench::from_vector(&wrench),
                covariance: factor.inverse(),
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suspension::ChannelKind;

    /// A map with a gain of its own for each pair, well conditioned.
    fn statics() -> CornerStatics {
        let wrench_from_members = Matrix6::from_fn(|i, j| {
            if i == j {
                1.0
            } else {
                0.1 * ((3 * i + 5 * j) % 7) as f64
            }
        });
        let wrench_offset = Vector6::new(3.0, -2.0, 200.0, 1.0, 0.5, -0.2);
        let members_from_wrench = wrench_from_members.try_inverse().expect("regular");
        CornerStatics {
            wrench_from_members,
            wrench_offset,
            members_from_wrench,
            members_offset: -(members_from_wrench * wrench_offset),
            ball_normal_per_strut: 0.4,
            ball_normal_offset_n: 10.0,
            lower_normal: nalgebra::Vector3::z(),
            sixth: ChannelKind::Strut,
        }
    }

    const KNOW_NOTHING: Parity = Parity {
        sigma_n_m: [f64::INFINITY; 3],
        rolling_radius_m: 0.0,
    };

    #[test]
    fn without_parity_it_is_the_plain_sum() {
        let statics = statics();
        let members = Vector6::new(300.0, -200.0, 150.0, 80.0, -40.0, 900.0);
        let sigma = Vector6::new(20.0, 30.0, 20.0, 25.0, 20.0, 15.0);
        let found = statics
            .wrench_with_parity(&members, &sigma, &KNOW_NOTHING)
            .expect("six channels determine six values");
        let plain = statics.wrench_from_members * members + statics.wrench_offset;
        assert!((found.wrench.to_vector() - plain).amax() < 1e-6);
        let spread = statics.wrench_from_members
            * Matrix6::from_diagonal(&sigma.component_mul(&sigma))
            * statics.wrench_from_members.transpose();
        assert!((found.covariance - spread).amax() < 1e-6 * spread.amax());
    }

    #[test]
    fn parity_sharpens_and_stands_in_for_a_dead_channel() {
        let statics = statics();
        let truth = Vector6::new(400.0, -700.0, 1500.0, 0.0, -9.0, 0.0);
        let members = statics.members_from_wrench * truth + statics.members_offset;
        let parity = Parity {
            sigma_n_m: [40.0, 6.0, 15.0],
            rolling_radius_m: 0.006,
        };
        let mut sigma = Vector6::repeat(20.0);
        let plain = statics
            .wrench_with_parity(&members, &sigma, &KNOW_NOTHING)
            .expect("determined");
        let sharp = statics
            .wrench_with_parity(&members, &sigma, &parity)
            .expect("determined");
        for axis in 0..6 {
            assert!(sharp.covariance[(axis, axis)] < plain.covariance[(axis, axis)]);
        }
        // The truth obeys the parity constraints, so that nothing pulls the estimate off it.
        assert!((sharp.wrench.to_vector() - truth).amax() < 1e-6);

        sigma[4] = f64::INFINITY;
        assert!(
            statics
                .wrench_with_parity(&members, &sigma, &KNOW_NOTHING)
                .is_none()
        );
        let dead = statics
            .wrench_with_parity(&members, &sigma, &parity)
            .expect("parity stands in");
        assert!((dead.wrench.to_vector() - truth).amax() < 1e-6);
        sigma[4] = 20.0;
        let mut lost = members;
        lost[2] = f64::NAN;
        assert!(statics.wrench_with_parity(&lost, &sigma, &parity).is_some());
    }
}
