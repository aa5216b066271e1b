//! Tyre forces by the method of the thesis: statics of each corner by itself at each instant, from
//! its strain channels and its strut (chapters 2.2 and 4).
//!
//! Weighted least squares over the channels that are read and the prior knowledge of the tyre's
//! moments. Where strain is missing, the vertical force comes from the deflection, with the lateral
//! force that the vehicle model expects.

use model::suspension::Parity;
use nalgebra::Vector6;
use sample::{ForceSource, LogTime, StrainChannel, TyreForce};

use crate::calibration::CornerChannels;
use crate::corners::{CornerState, KnownLinkage};
use crate::inputs::CornerReadings;
use crate::tuning::StaticsTuning;

/// Axial channels, in the order of the member forces.
pub const AXIAL: [StrainChannel; 5] = [
    StrainChannel::UpperFront,
    StrainChannel::UpperRear,
    StrainChannel::LowerFront,
    StrainChannel::LowerRear,
    StrainChannel::TieRod,
];

/// Assumptions for the statics of a corner.
#[derive(Clone, Copy, Debug)]
pub struct CornerAssumptions {
    /// Rolling-resistance coefficient times radius, with the sign of the speed, m.
    pub rolling_radius_m: f64,
    /// Force that the vehicle model expects, N.
    pub expected_n: [f64; 3],
    /// A reading that is older is not used, s.
    pub fresh_s: f64,
}

/// The force on one tyre.
#[must_use]
pub fn tyre_force(
    now: LogTime,
    state: &CornerState,
    readings: &CornerReadings,
    channels: &CornerChannels,
    assumed: &CornerAssumptions,
    tuning: &StaticsTuning,
) -> TyreForce {
    let mut members = Vector6::zeros();
    let mut sigma = Vector6::repeat(f64::INFINITY);
    let mut alive = 0;
    for (i, channel) in AXIAL.into_iter().enumerate() {
        let reading = readings.strain[channel.index()]
            .and_then(|reading| reading.fresh(now, assumed.fresh_s));
        if let Some(value) = reading {
            members[i] = value;
            let c = &channels.strain[channel.index()];
            sigma[i] = math::hypot(c.noise_sigma, c.offset_sigma).max(tuning.member_sigma_min_n);
            alive += 1;
        }
    }
    members[5] = state.strut_n;
    sigma[5] = state.strut_sigma_n;
    let [roll_n_m, yaw_n_m] = tuning.moment_sigma_n_m;
    let parity = Parity {
        sigma_n_m: [roll_n_m, f64::INFINITY, yaw_n_m],
        rolling_radius_m: assumed.rolling_radius_m,
    };
    if alive >= 3
        && state.linkage == KnownLinkage::Corner
        && channels.matrix.is_none()
        && let Some(found) = state.statics.wrench_with_parity(&members, &sigma, &parity)
    {
        let variance = found.covariance.diagonal();
        return TyreForce {
            force_n: found.wrench.force_n.into(),
            sigma_n: [variance[0].sqrt(), variance[1].sqrt(), variance[2].sqrt()],
            source: ForceSource::Statics,
            ..TyreForce::default()
        };
    }
    from_deflection(state, assumed, tuning)
}

/// F_z out of the strut's row of c = A F + B M + c_0 with F_x, F_y given and no moment.
fn from_deflection(
    state: &CornerState,
    assumed: &CornerAssumptions,
    tuning: &StaticsTuning,
) -> TyreForce {
    if !state.strut_sigma_n.is_finite() {
        return TyreForce::default();
    }
    let row = state.statics.members_from_wrench.row(5);
    let [x, y, _] = assumed
        .expected_n
        .map(|f| if f.is_finite() { f } else { 0.0 });
    let rest = state.strut_n - state.statics.members_offset[5] - row[0] * x - row[1] * y;
    let z = rest / row[2];
    if !z.is_finite() {
        return TyreForce::default();
    }
    let blind = tuning.blind_part * z.abs() + tuning.blind_n;
    let sigma = (state.strut_sigma_n.powi(2) + (row[1] * blind).powi(2)).sqrt() / row[2].abs();
    TyreForce {
        force_n: [f64::NAN, f64::NAN, z],
        sigma_n: [f64::NAN, f64::NAN, sigma],
        source: ForceSource::Deflection,
        ..TyreForce::default()
    }
}
