//! Whether the potentiometers' levels hold.
//!
//! Each strut's length has an error state of its own. While nothing speaks against the potentiometer
//! it fades within half a second: a stop is five times as stiff as the spring, so that what a length
//! had learnt from other errors on the spring would be a gross error on the stop. It is set free by
//! a jump that no strut makes, and by innovations of the strut's force that keep to one side; strain
//! and the balances of the whole vehicle then tell where the level stands. A level that is off by
//! more than a spring's tolerances is a fault: it is named, and the linkage's pose follows the
//! corrected length. When the error has been small for a second it fades again.

use super::layout::LENGTH;
use super::{ChannelChange, Fusion};
use crate::calibration::{Channel, CornerChannels};
use sample::PerWheel;

/// Error of a strut's length beside the potentiometer's zero, mm.
const SIGMA_MM: f64 = 0.02;
/// How fast it fades, s.
const FADE_S: f64 = 0.5;
/// Its walk while it is doubted, mm/sqrt(s).
const DOUBTED_WALK_MM: f64 = 1.0;
/// Doubt of a length whose potentiometer has jumped, mm.
const JUMP_SIGMA_MM: f64 = 15.0;
/// Error from which a potentiometer is faulty, and below which it is good, mm.
const FAULTY_MM: f64 = 3.0;
const GOOD_MM: f64 = 1.5;
/// How many deviations it must stand above the former.
const FAULTY_SIGMAS: f64 = 3.0;
/// Steps that it must be good.
const GOOD_STEPS: u32 = 100;
/// Weight of one innovation in their mean, and the means that together make doubt: in deviations,
/// of which white innovations have 0.07, and as a length, mm.
const LEARN: f64 = 0.01;
const DOUBT: f64 = 0.5;
const DOUBT_MM: f64 = 0.7;

/// Memory of one potentiometer.
#[derive(Clone, Copy, Debug, Default)]
pub struct LengthWatch {
    mean: f64,
    mean_mm: f64,
    doubted: bool,
    faulty: bool,
    calm: u32,
}

impl LengthWatch {
    /// Whether its level is wrong.
    pub fn faulty(&self) -> bool {
        self.faulty
    }

    /// What the error keeps over `dt`, and the variance that it gains, mm^2; `start` is that of a
    /// potentiometer that is believed.
    pub fn fading(&self, start: f64, dt: f64) -> (f64, f64) {
        if self.doubted {
            (1.0, DOUBTED_WALK_MM.powi(2) * dt)
        } else {
            let keep = math::exp(-dt / FADE_S);
            (keep, (1.0 - keep * keep) * start)
        }
    }

    /// Takes an innovation in: by its deviation, and as a length.
    pub fn learn(&mut self, innovation: f64, length_mm: f64) {
        self.mean += LEARN * (innovation.clamp(-5.0, 5.0) - self.mean);
        self.mean_mm += LEARN * (length_mm.clamp(-20.0, 20.0) - self.mean_mm);
        self.doubted |= self.mean.abs() > DOUBT && self.mean_mm.abs() > DOUBT_MM;
    }
}

/// Variance of a length's error at the start, mm^2.
pub fn start_variance(channel: &Channel) -> f64 {
    (1e3 * channel.offset_sigma).powi(2) + SIGMA_MM.powi(2)
}

impl Fusion {
    /// The potentiometer of a wheel has jumped: nothing is known of its level.
    pub(super) fn doubt_length(&mut self, wheel: usize) {
        self.lengths[wheel].doubted = true;
        let variance = JUMP_SIGMA_MM * JUMP_SIGMA_MM;
        self.covariance.add_noise(LENGTH + wheel, variance);
    }

    /// Tells potentiometers that are found faulty or good again.
    pub(super) fn watch_lengths(
        &mut self,
        channels: &PerWheel<CornerChannels>,
        changes: &mut impl FnMut(ChannelChange),
    ) {
        for wheel in 0..4 {
            let watch = &mut self.lengths[wheel];
            if !watch.doubted {
                continue;
            }
            let error = self.state[LENGTH + wheel].abs();
            let variance = self.covariance.variance(LENGTH + wheel);
            watch.calm = if error < GOOD_MM { watch.calm + 1 } else { 0 };
            if !watch.faulty && error - FAULTY_SIGMAS * variance.max(0.0).sqrt() > FAULTY_MM {
                watch.faulty = true;
                changes(ChannelChange {
                    wheel,
                    channel: None,
                    faulty: true,
                });
            }
            if watch.calm > GOOD_STEPS {
                if watch.faulty {
                    changes(ChannelChange {
                        wheel,
                        channel: None,
                        faulty: false,
                    });
                }
                *watch = LengthWatch::default();
                let start = start_variance(&channels.0[wheel].deflection);
                self.covariance.forget(LENGTH + wheel, start);
            }
        }
    }
}
