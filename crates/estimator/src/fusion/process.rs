//! Initial covariance, transition and process noise of the force filter.

use sample::PerWheel;

use super::inertial::Balance;
use super::layout::{
    ACCEL_BIAS, BODY_RATE, FORCE, MOMENT, OFFSET, RATE, SIZE, STRUT_LENGTH, TORQUE,
};
use super::{Fusion, lengths};
use crate::calibration::CornerChannels;
use crate::process_noise::ProcessNoise;
use crate::trace::Operation;
use crate::tuning::{FusionTuning, ProcessNoiseTuning};

pub(super) fn torque_noise(
    tuning: &FusionTuning,
    process_noise: ProcessNoiseTuning,
) -> [ProcessNoise<2>; 2] {
    let bounds = [tuning.torque_mean_bounds, tuning.torque_difference_bounds];
    let density = tuning.torque_density;
    [0, 1].map(|part| ProcessNoise::new(density[part], bounds[part], process_noise))
}

/// Noise that keeps the remaining accelerometer bias at its standard deviation while it decays.
pub(super) fn accel_noise(
    tuning: &FusionTuning,
    process_noise: ProcessNoiseTuning,
) -> ProcessNoise<3> {
    let time_s = tuning.accel_time_s;
    let bounds = (tuning.accel_sigma_m_s2).map(|sigma| 2.0 * sigma * sigma / time_s);
    ProcessNoise::new(bounds[0], bounds, process_noise)
}

impl Fusion {
    /// Sets the initial covariance, and the strain offsets and length errors to zero.
    pub(super) fn forget(&mut self, channels: &PerWheel<CornerChannels>) {
        let t = self.tuning;
        let mut variance = [0.0; SIZE];
        for wheel in 0..4 {
            let c = &channels.0[wheel];
            for axis in 0..3 {
                variance[FORCE + 3 * wheel + axis] = t.force_start_sigma_n.powi(2);
                variance[RATE + 3 * wheel + axis] = t.rate_start_sigma_n_s.powi(2);
            }
            for i in 0..2 {
                variance[MOMENT + 2 * wheel + i] =
                    self.body.moment_sigma_n_m(wheel, &t.moments)[i].powi(2);
            }
            variance[STRUT_LENGTH + wheel] =
                lengths::start_variance(&c.deflection, &t.potentiometers);
            for i in 0..5 {
                variance[OFFSET + 5 * wheel + i] = (c.strain[i].offset_sigma).powi(2);
            }
        }
        for axle in 0..2 {
            variance[TORQUE + axle] = t.torque_start_sigma_n_m[0].powi(2);
            variance[TORQUE + 2 + axle] = t.torque_start_sigma_n_m[1].powi(2);
        }
        for axis in 0..3 {
            variance[BODY_RATE + axis] = t.body_rate_variance;
            variance[ACCEL_BIAS + axis] = t.accel_sigma_m_s2[0].powi(2);
        }
        self.state[OFFSET..].fill(0.0);
        self.covariance.reset(&variance, &self.state);
    }

    /// Propagates state and covariance by `dt`.
    pub(super) fn predict(
        &mut self,
        dt: f64,
        balance: &Balance,
        channels: &PerWheel<CornerChannels>,
    ) {
        for i in 0..3 {
            self.state[BODY_RATE + i] += dt * balance.turn_rate(i, &self.state);
        }
        for i in 0..12 {
            self.state[FORCE + i] += dt * self.state[RATE + i];
        }
        let c = &mut self.covariance;
        // First order in dt: the rows of the body's rates use the covariance before the forces move.
        c.turn(&balance.jacobian, dt);
        for i in 0..3 {
            c.trace.note(|| Operation::Shift {
                index: BODY_RATE + i,
                by: dt * balance.constant[i],
            });
        }
        c.integrate(dt);
        let gains = self.decay(dt, channels);
        self.add_process_noise(dt, balance, channels, &gains);
    }

    /// Decay of moments, torques, biases, offsets and length errors over `dt`.
    fn decay(&mut self, dt: f64, channels: &PerWheel<CornerChannels>) -> DecayGains {
        let t = self.tuning;
        let mut keep = [1.0; SIZE];
        let mut fade = |first: usize, count: usize, time_s: f64| {
            let kept = math::exp(-dt / time_s);
            keep[first..first + count].fill(kept);
            1.0 - kept * kept
        };
        let moment = fade(MOMENT, TORQUE - MOMENT, t.moment_time_s);
        fade(TORQUE, 2, t.torque_time_s[0]);
        fade(TORQUE + 2, 2, t.torque_time_s[1]);
        fade(ACCEL_BIAS, 3, t.accel_time_s);
        let offset = fade(OFFSET, 20, t.offset_time_s);
        let length_mm2: [f64; 4] = std::array::from_fn(|wheel| {
            let deflection = &channels.0[wheel].deflection;
            let start = lengths::start_variance(deflection, &t.potentiometers);
            let (kept, gained) = self.lengths[wheel].fading(start, dt, &t.potentiometers);
            keep[STRUT_LENGTH + wheel] = kept;
            gained
        });
        for (x, kept) in self.state.iter_mut().zip(&keep) {
            *x *= kept;
        }
        self.covariance.scale(&keep);
        DecayGains {
            moment,
            offset,
            length_mm2,
        }
    }

    fn add_process_noise(
        &mut self,
        dt: f64,
        balance: &Balance,
        channels: &PerWheel<CornerChannels>,
        gains: &DecayGains,
    ) {
        let t = self.tuning;
        let c = &mut self.covariance;
        // Forces of the vehicle model do not adapt the density.
        let density = if self.blind {
            [t.blind_density; 3]
        } else {
            self.force_noise.densities()
        };
        for i in 0..12 {
            c.add_noise_pair(FORCE + i, RATE + i, density[i % 3], dt);
        }
        for i in 0..TORQUE - MOMENT {
            let sigma = balance.known[i / 2].sigma_n_m[i % 2];
            c.add_noise(MOMENT + i, gains.moment * sigma * sigma);
        }
        for axle in 0..2 {
            for (part, noise) in self.torque.iter().enumerate() {
                c.add_noise(TORQUE + 2 * part + axle, noise.density() * dt);
            }
        }
        for (axis, noise) in t.moment_noise_n_m.into_iter().enumerate() {
            let turn = noise * self.body.inverse[(axis, axis)];
            c.add_noise(BODY_RATE + axis, turn * turn * dt);
            c.add_noise(ACCEL_BIAS + axis, self.accel.density() * dt);
        }
        for (wheel, gained) in gains.length_mm2.into_iter().enumerate() {
            c.add_noise(STRUT_LENGTH + wheel, gained);
        }
        for i in 0..20 {
            let start = channels.0[i / 5].strain[i % 5].offset_sigma.powi(2);
            c.add_noise(
                OFFSET + i,
                gains.offset * start + t.offset_walk_n.powi(2) * dt,
            );
        }
    }
}

/// Gains of the process noise that keeps decaying states at their variance.
struct DecayGains {
    /// Part of the variance of moments.
    moment: f64,
    /// Part of the variance of strain offsets.
    offset: f64,
    /// Variance of each length error, mm^2.
    length_mm2: [f64; 4],
}
