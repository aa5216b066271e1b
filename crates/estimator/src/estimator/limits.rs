//! What the vehicle can still do.

use sample::{ForceSource, Limits, LimitsUnknown, LogTime, Motion, PerWheel, Rollover, TyreForce};

use super::{Estimator, Output};
use crate::grid::GRID_S;
use crate::limits::LimitsInput;

/// Spacing of the instants that have limits, ns.
const LIMITS_NANOS: u64 = 100_000_000;

impl Estimator {
    /// Stage 11b: the limits, for vehicles with the force filter.
    pub(super) fn find_limits(
        &mut self,
        now: LogTime,
        motion: &Motion,
        forces: &PerWheel<TyreForce>,
        rollover: &Rollover,
        settled: bool,
        out: &mut impl FnMut(Output),
    ) {
        let Some(limits) = &mut self.limits else {
            return;
        };
        let measured = forces.0[0].source == ForceSource::Fusion;
        limits.step(&LimitsInput {
            dt: GRID_S,
            motion,
            load_transfer_ratio: if measured && settled {
                rollover.load_transfer_ratio
            } else {
                f64::NAN
            },
            forces,
        });
        if now.0.is_multiple_of(LIMITS_NANOS) {
            let grip = [0, 1].map(|axle| self.grip.axle(axle, now));
            out(Output::Limits(if settled {
                limits.limits(now, [&grip[0], &grip[1]])
            } else {
                Limits::unknown(now, LimitsUnknown::Settling)
            }));
        }
    }
}
