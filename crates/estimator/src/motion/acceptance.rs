//! Acceptance of the values of GNSS receivers.

use nalgebra::Vector3;
use sample::LogTime;

use crate::tuning::ReceiverTuning;
use crate::watch::Stuck;

/// Last velocity of a receiver.
#[derive(Clone, Copy, Debug, Default)]
pub struct ReceiverState {
    pub at: Option<LogTime>,
    pub velocity_m_s: Vector3<f64>,
    pub rejected: bool,
    /// Of each component of its velocity.
    pub stuck: [Stuck; 3],
    pub acceptance: AcceptanceCounter,
}

impl ReceiverState {
    /// Whether its last velocity is recent.
    pub fn is_active(&self, now: LogTime, active_s: f64) -> bool {
        self.at.is_some_and(|at| now.seconds_since(at) < active_s)
    }
}

/// Counts of a receiver's accepted and rejected values since it was last adopted.
#[derive(Clone, Copy, Debug, Default)]
pub struct AcceptanceCounter {
    /// Consecutive accepted values, and whether there were enough of them to confirm the state.
    pub uses: u32,
    pub confirmed: bool,
    /// Whether the state was adopted from the receiver after a contradiction.
    pub adopted: bool,
    /// Consecutive rejected values, and those of them while the balances did not confirm the
    /// inertial unit.
    pub rejections: u32,
    pub rejections_unconfirmed: u32,
}

impl AcceptanceCounter {
    /// For a receiver whose values are adopted.
    pub fn adopted() -> Self {
        Self {
            adopted: true,
            ..Self::default()
        }
    }

    /// Counts an accepted value.
    pub fn used(&mut self, tuning: &ReceiverTuning) {
        let least = if self.adopted {
            tuning.confirmed_again
        } else {
            tuning.confirmed
        };
        self.uses += 1;
        self.confirmed |= self.uses >= least;
        (self.rejections, self.rejections_unconfirmed) = (0, 0);
    }

    /// Counts a rejected value; `imu_consistent`: the balances confirm the inertial unit.
    pub fn contradicted(&mut self, imu_consistent: bool) {
        self.uses = 0;
        self.rejections += 1;
        self.rejections_unconfirmed += u32::from(!imu_consistent);
    }

    /// Whether the state is considered wrong.
    pub fn too_many(self, tuning: &ReceiverTuning) -> bool {
        self.rejections_unconfirmed > tuning.rejections_max
            || self.rejections > tuning.rejections_max_consistent
    }
}
