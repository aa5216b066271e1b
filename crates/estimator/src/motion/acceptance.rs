//! How the values of receivers fare.

use nalgebra::Vector3;
use sample::LogTime;

use crate::tuning::ReceiverTuning;

/// What a receiver told last.
#[derive(Clone, Copy, Debug, Default)]
pub struct ReceiverState {
    pub at: Option<LogTime>,
    pub velocity_m_s: Vector3<f64>,
    pub rejected: bool,
    pub acceptance: AcceptanceCounter,
}

impl ReceiverState {
    /// Whether it has told anything of late.
    pub fn is_active(&self, now: LogTime, active_s: f64) -> bool {
        self.at.is_some_and(|at| now.seconds_since(at) < active_s)
    }
}

/// How a receiver's values have fared since it was last adopted.
#[derive(Clone, Copy, Debug, Default)]
pub struct AcceptanceCounter {
    /// Values in a row that were used, and whether there ever were enough to confirm the state.
    pub uses: u32,
    pub confirmed: bool,
    /// Whether the state was taken from it after it had contradicted.
    pub adopted: bool,
    /// Values in a row that contradicted the state, and those of them while nothing vouched for it.
    pub rejections: u32,
    pub rejections_unconfirmed: u32,
}

impl AcceptanceCounter {
    /// Of a receiver whose values are adopted.
    pub fn adopted() -> Self {
        Self {
            adopted: true,
            ..Self::default()
        }
    }

    /// Takes note of a value that was used.
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

    /// Takes note of one that contradicted a state that something else vouches for or not.
    pub fn contradicted(&mut self, imu_consistent: bool) {
        self.uses = 0;
        self.rejections += 1;
        self.rejections_unconfirmed += u32::from(!imu_consistent);
    }

    /// Whether it is the state that is wrong.
    pub fn too_many(self, tuning: &ReceiverTuning) -> bool {
        self.rejections_unconfirmed > tuning.rejections_max
            || self.rejections > tuning.rejections_max_consistent
    }
}
