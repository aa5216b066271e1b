//! How the state begins and goes on by itself: what is known of it beforehand, transition and
//! process noise.

use sample::PerWheel;

use super::inertial::Balance;
use super::layout::{ACCEL, FORCE, LENGTH, MOMENT, OFFSET, RATE, SIZE, TORQUE, TURN};
use super::{Fusion, TURN_VARIANCE, lengths};
use crate::calibration::CornerChannels;
use crate::process_noise::ProcessNoise;
use crate::trace::Operation;

/// How fast moments that the tyres' model does not know of fade, s.
const MOMENT_TIME_S: f64 = 1.0;
/// Half-shafts' torques: standard deviation of the mean and of half the difference of left and right
/// at the start, N m, and how fast they fade, s. Both axles have them, whatever the vehicle file's
/// split: where four-wheel drive can be switched on, taking the front wheels for undriven would cost
/// 12 % of F_x.
const TORQUE_SIGMA: [f64; 2] = [50.0, 1.0];
const TORQUE_TIME_S: [f64; 2] = [50.0, 1.0];
/// Densities of the noises of mean and difference at the start, and their bounds, (N m)^2/s. Torques
/// that always may differ would cost each axle a channel; 16-bit bridges, taken for alike where they
/// differ by a newton metre, are off by half a per cent of F_y.
const TORQUE_DENSITY: [f64; 2] = [1.0e4, 2.0];
const TORQUE_BOUNDS: [[f64; 2]; 2] = [[10.0, 1.0e6], [2.0, 1.0e4]];
/// Moment that the rigid-body balance does not know of, N m/sqrt(Hz).
pub(super) const TURN_NOISE_N_M: [f64; 3] = [10.0, 10.0, 15.0];
/// Time constant of what is left of the accelerometers' bias, s, and its least and most standard
/// deviation, m/s^2. Where mass and centre of gravity are known but to a workshop's per cent, it
/// grows with the acceleration to several times what exact ones leave: how much there is, is learnt.
const ACCEL_TIME_S: f64 = 30.0;
const ACCEL_SIGMA: [f64; 2] = [0.004, 0.03];
/// How fast what was learnt of a strain channel's offset fades to the calibrated zero, s, and its
/// walk, N/sqrt(s). Moments, torques and geometry are wrong by little, but for long: an offset that
/// only walked would within minutes take their errors for its own, and be sure of them.
const OFFSET_TIME_S: f64 = 100.0;
const OFFSET_WALK: f64 = 0.05;

/// Density of the noise of the forces' rates while a corner's strain is missing, (N/s)^2/s.
const BLIND_DENSITY: f64 = 6.0e3 * 6.0e3;

pub(super) fn torque_noise() -> [ProcessNoise<2>; 2] {
    [0, 1].map(|part| ProcessNoise::new(TORQUE_DENSITY[part], TORQUE_BOUNDS[part]))
}

/// Density with which the residue, which fades, keeps its deviation.
pub(super) fn accel_noise() -> ProcessNoise<3> {
    let bounds = ACCEL_SIGMA.map(|sigma| 2.0 * sigma * sigma / ACCEL_TIME_S);
    ProcessNoise::new(bounds[0], bounds)
}

impl Fusion {
    /// Doubts all that the state says, and takes the channels' zeros for right.
    pub(super) fn forget(&mut self, channels: &PerWheel<CornerChannels>) {
        let mut variance = [0.0; SIZE];
        for wheel in 0..4 {
            let c = &channels.0[wheel];
            for axis in 0..3 {
                variance[FORCE + 3 * wheel + axis] = 2000.0_f64.powi(2);
                variance[RATE + 3 * wheel + axis] = 1e4_f64.powi(2);
            }
            for i in 0..2 {
                variance[MOMENT + 2 * wheel + i] = self.body.moment_sigma_n_m(wheel)[i].powi(2);
            }
            variance[LENGTH + wheel] = lengths::start_variance(&c.deflection);
            for i in 0..5 {
                variance[OFFSET + 5 * wheel + i] = (c.strain[i].offset_sigma).powi(2);
            }
        }
        for axle in 0..2 {
            variance[TORQUE + axle] = TORQUE_SIGMA[0].powi(2);
            variance[TORQUE + 2 + axle] = TORQUE_SIGMA[1].powi(2);
        }
        for axis in 0..3 {
            variance[TURN + axis] = TURN_VARIANCE;
            variance[ACCEL + axis] = ACCEL_SIGMA[0].powi(2);
        }
        self.state[OFFSET..].fill(0.0);
        self.covariance.reset(&variance, &self.state);
    }

    /// Carries state and covariance on by `dt`.
    pub(super) fn predict(
        &mut self,
        dt: f64,
        balance: &Balance,
        channels: &PerWheel<CornerChannels>,
    ) {
        let c = &mut self.covariance;
        for i in 0..3 {
            self.state[TURN + i] += dt * balance.turn_rate(i, &self.state);
        }
        for i in 0..12 {
            self.state[FORCE + i] += dt * self.state[RATE + i];
        }
        // The turn rows need the covariance of the forces before these move: first order in dt.
        c.turn(&balance.jacobian, dt);
        for i in 0..3 {
            c.trace.note(|| Operation::Shift {
                index: TURN + i,
                by: dt * balance.constant[i],
            });
        }
        c.integrate(dt);
        let mut keep = [1.0; SIZE];
        let mut fade = |first: usize, count: usize, time_s: f64| {
            let kept = math::exp(-dt / time_s);
            keep[first..first + count].fill(kept);
            1.0 - kept * kept
        };
        let moment_gain = fade(MOMENT, TORQUE - MOMENT, MOMENT_TIME_S);
        fade(TORQUE, 2, TORQUE_TIME_S[0]);
        fade(TORQUE + 2, 2, TORQUE_TIME_S[1]);
        fade(ACCEL, 3, ACCEL_TIME_S);
        let offset_gain = fade(OFFSET, 20, OFFSET_TIME_S);
        let length_gain: [f64; 4] = std::array::from_fn(|wheel| {
            let start = lengths::start_variance(&channels.0[wheel].deflection);
            let (kept, gained) = self.lengths[wheel].fading(start, dt);
            keep[LENGTH + wheel] = kept;
            gained
        });
        for (x, kept) in self.state.iter_mut().zip(&keep) {
            *x *= kept;
        }
        c.scale(&keep);
        // What the vehicle model guesses teaches nothing of how fast the forces change.
        let density = if self.blind {
            [BLIND_DENSITY; 3]
        } else {
            self.agility.densities()
        };
        for i in 0..12 {
            c.add_noise_pair(FORCE + i, RATE + i, density[i % 3], dt);
        }
        for i in 0..TORQUE - MOMENT {
            let sigma = balance.known[i / 2].sigma_n_m[i % 2];
            c.add_noise(MOMENT + i, moment_gain * sigma * sigma);
        }
        for axle in 0..2 {
            for (part, noise) in self.torque.iter().enumerate() {
                c.add_noise(TORQUE + 2 * part + axle, noise.density() * dt);
            }
        }
        for (axis, noise) in TURN_NOISE_N_M.into_iter().enumerate() {
            let turn = noise * self.body.inverse[(axis, axis)];
            c.add_noise(TURN + axis, turn * turn * dt);
            c.add_noise(ACCEL + axis, self.accel.density() * dt);
        }
        for (wheel, gained) in length_gain.into_iter().enumerate() {
            c.add_noise(LENGTH + wheel, gained);
        }
        for i in 0..20 {
            let start = channels.0[i / 5].strain[i % 5].offset_sigma.powi(2);
            c.add_noise(OFFSET + i, offset_gain * start + OFFSET_WALK.powi(2) * dt);
        }
    }
}
