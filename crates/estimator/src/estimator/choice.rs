//! Choice between the inertial navigation and the single-track filter of a vehicle without linkages.

use sample::LogTime;

use crate::motion::MotionState;
use crate::planar::PlanarMotion;

/// Which motion is reported.
///
/// The inertial navigation needs an inertial unit with all axes, and receivers of velocity and attitude. A receiver
/// that is slower than the navigation's limit of silence would make the estimate change between both filters with
/// each of its values. After a silence, the navigation is therefore used again only when its receivers have been heard
/// without a gap for some time.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct MotionChoice {
    /// The last instant at which the receivers were silent after they had been heard.
    silent_at: Option<LogTime>,
    heard: bool,
    /// Whether the motion of the inertial navigation is reported.
    pub(super) navigates: bool,
}

impl MotionChoice {
    /// Takes one instant; `hears` tells whether both receivers are recent, `motion` is that of the single-track filter.
    /// Returns whether the motion of the inertial navigation is reported.
    pub(super) fn step(
        &mut self,
        time: LogTime,
        hears: bool,
        hold_s: f64,
        state: &MotionState,
        motion: Option<&PlanarMotion>,
    ) -> bool {
        self.heard |= hears;
        if self.heard && !hears {
            self.silent_at = Some(time);
        }
        let holds = self
            .silent_at
            .is_none_or(|silent| time.seconds_since(silent) >= hold_s);
        // Without all axes of the unit, nothing carries the navigation from one value of a receiver to the next.
        let is_carried = state.inertial || !motion.is_some_and(PlanarMotion::has_yaw_rate);
        self.navigates = hears && (motion.is_none() || holds && is_carried);
        self.navigates
    }
}
