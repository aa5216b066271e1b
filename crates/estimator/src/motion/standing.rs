//! How the values of receivers fare.

use nalgebra::Vector3;
use sample::LogTime;

use crate::tuning::ReceiverTuning;

/// What a receiver told last.
#[derive(Clone, Copy, Debug, Default)]
pub struct ToldVelocity {
    pub at: Option<LogTime>,
    pub velocity_m_s: Vector3<f64>,
    pub left_out: bool,
    pub standing: Standing,
}

impl ToldVelocity {
    /// Whether it has told anything of late.
    pub fn is_heard(&self, now: LogTime, active_s: f64) -> bool {
        self.at.is_some_and(|at| now.seconds_since(at) < active_s)
    }
}

/// How a receiver's values have fared since it was last adopted.
#[derive(Clone, Copy, Debug, Default)]
pub struct Standing {
    /// Values in a row that were used, and whether there ever were enough to confirm the state.
    pub uses: u32,
    pub confirmed: bool,
    /// Whether the state was taken from it after it had contradicted.
    pub anew: bool,
    /// Values in a row that contradicted the state, and those of them while nothing vouched for it.
    pub misses: u32,
    pub unvouched: u32,
}

impl Standing {
    /// Of a receiver whose values are adopted.
    pub fn adopted() -> Self {
        Self {
            anew: true,
            ..Self::default()
        }
    }

    /// Takes note of a value that was used.
    pub fn used(&mut self, tuning: &ReceiverTuning) {
        let least = if self.anew {
            tuning.confirmed_again
        } else {
            tuning.confirmed
        };
        self.uses += 1;
        self.confirmed |= self.uses >= least;
        (self.misses, self.unvouched) = (0, 0);
    }

    /// Takes note of one that contradicted a state that something else vouches for or not.
    pub fn contradicted(&mut self, vouched: bool) {
        self.uses = 0;
        self.misses += 1;
        self.unvouched += u32::from(!vouched);
    }

    /// Whether it is the state that is wrong.
    pub fn too_many(self, tuning: &ReceiverTuning) -> bool {
        self.unvouched > tuning.rejections_max || self.misses > tuning.rejections_max_consistent
    }
}
