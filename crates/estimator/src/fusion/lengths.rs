//! Monitor of the potentiometers' levels.
//!
//! Each strut has an error state of its length. While the potentiometer is good the error returns
//! to zero within half a second: a stop is five times as stiff as the spring, so a length that was
//! learnt on the spring would be a large error on the stop. A jump that no strut makes, or
//! innovations of the strut force with one sign, make the potentiometer suspect. Then strain and
//! the balances of the whole vehicle determine the error. An error beyond a spring's tolerance is
//! reported as a fault, and the linkage's pose uses the corrected length. After a second with a
//! small error the potentiometer is good again.

use super::layout::LENGTH_ERROR;
use super::{ChannelChange, Fusion};
use crate::calibration::{Channel, CornerChannels};
use crate::tuning::PotentiometerTuning;
use sample::PerWheel;

/// Monitor of one potentiometer.
#[derive(Clone, Copy, Debug, Default)]
pub struct LengthWatch {
    mean: f64,
    mean_mm: f64,
    suspect: bool,
    faulty: bool,
    /// Steps with an error beyond the limit of a fault.
    beyond: u32,
    calm: u32,
}

impl LengthWatch {
    /// Whether it was found faulty.
    pub const fn is_faulty(&self) -> bool {
        self.faulty
    }

    /// Decay factor of the error over `dt` and the variance that is added, mm^2. `start` is the
    /// variance for a good potentiometer.
    pub fn fading(&self, start: f64, dt: f64, tuning: &PotentiometerTuning) -> (f64, f64) {
        if self.suspect {
            (1.0, tuning.suspect_walk_mm.powi(2) * dt)
        } else {
            let keep = math::exp(-dt / tuning.time_s);
            (keep, (1.0 - keep * keep) * start)
        }
    }

    /// Updates the means by a normalised innovation and the same innovation as a length.
    pub fn learn(&mut self, innovation: f64, length_mm: f64, tuning: &PotentiometerTuning) {
        let t = tuning;
        let [most, most_mm] = [t.innovation_max_sigma, t.innovation_max_mm];
        self.mean += t.learning * (innovation.clamp(-most, most) - self.mean);
        self.mean_mm += t.learning * (length_mm.clamp(-most_mm, most_mm) - self.mean_mm);
        self.suspect |=
            self.mean.abs() > t.suspect_mean_sigma && self.mean_mm.abs() > t.suspect_mean_mm;
    }
}

/// Initial variance of a length error, mm^2.
pub fn start_variance(channel: &Channel, tuning: &PotentiometerTuning) -> f64 {
    (1e3 * channel.offset_sigma).powi(2) + tuning.sigma_mm.powi(2)
}

impl Fusion {
    /// The potentiometer of a wheel has jumped: its level is unknown.
    pub(super) fn suspect_length(&mut self, wheel: usize) {
        self.lengths[wheel].suspect = true;
        let sigma_mm = self.tuning.potentiometers.jump_sigma_mm;
        let variance = sigma_mm * sigma_mm;
        self.covariance.add_noise(LENGTH_ERROR + wheel, variance);
    }

    /// Reports potentiometers that are found faulty or good again.
    pub(super) fn watch_lengths(
        &mut self,
        channels: &PerWheel<CornerChannels>,
        changes: &mut impl FnMut(ChannelChange),
    ) {
        let t = self.tuning.potentiometers;
        for wheel in 0..4 {
            let watch = &mut self.lengths[wheel];
            if !watch.suspect {
                continue;
            }
            let error = self.state[LENGTH_ERROR + wheel].abs();
            let variance = self.covariance.variance(LENGTH_ERROR + wheel);
            watch.calm = if error < t.good_mm { watch.calm + 1 } else { 0 };
            let beyond = error - t.faulty_sigma * variance.max(0.0).sqrt() > t.faulty_mm;
            watch.beyond = if beyond { watch.beyond + 1 } else { 0 };
            if !watch.faulty && watch.beyond > t.faulty_steps && !self.undecided {
                watch.faulty = true;
                changes(ChannelChange {
                    wheel,
                    channel: None,
                    faulty: true,
                });
            }
            if watch.calm > t.good_steps {
                if watch.faulty {
                    changes(ChannelChange {
                        wheel,
                        channel: None,
                        faulty: false,
                    });
                }
                *watch = LengthWatch::default();
                let start = start_variance(&channels.0[wheel].deflection, &t);
                self.covariance.forget(LENGTH_ERROR + wheel, start);
            }
        }
    }
}
