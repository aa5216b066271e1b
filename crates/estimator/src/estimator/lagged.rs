//! The estimate with a fixed lag: of two steps before, by what was measured since.

use sample::{Estimate, PerWheel, TyreForce};

use crate::wheel_frame::WheelFrame;

/// Steps of the lag: 20 ms at 100 Hz.
pub(crate) const LAG_STEPS: usize = 2;

/// The estimates of the last steps with the wheels' axes.
#[derive(Clone, Debug, Default)]
pub(super) struct Past([Option<(Estimate, PerWheel<WheelFrame>)>; LAG_STEPS]);

impl Past {
    /// The estimate of two steps before with the forces that are known of it now; stores the present one.
    pub(super) fn pass(
        &mut self,
        estimate: &Estimate,
        frames: Option<&PerWheel<WheelFrame>>,
        lagged: Option<&PerWheel<TyreForce>>,
    ) -> Option<Estimate> {
        let now = frames.map(|frames| (estimate.clone(), frames.clone()));
        self.0.rotate_right(1);
        let (mut estimate, frames) = std::mem::replace(&mut self.0[0], now)?;
        let lagged = lagged?;
        let all = PerWheel::from_fn(|wheel| frames[wheel].of_carrier(&lagged[wheel]));
        estimate.carrier = PerWheel::from_fn(|wheel| all[wheel].carrier);
        estimate.measured = PerWheel::from_fn(|wheel| all[wheel].reported);
        Some(estimate)
    }
}
