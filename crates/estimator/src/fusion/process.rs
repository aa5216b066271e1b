//! Initial covariance, transition and process noise of the force filter.

use nalgebra::Vector3;
use sample::{PerWheel, STANDARD_GRAVITY_M_S2};

use super::layout::{
    ACCEL_BIAS, BEFORE, BETWEEN, BODY_RATE, FORCE, HUB_BIAS, LENGTH, LENGTH_ERROR, MOMENT, OFFSET,
    RATE, ROAD, SIZE, SPEED, STRUT, State, TORQUE,
};
use super::propagation::{Moving, Noises, Propagation};
use super::transition::Transition;
use super::{CornerForms, Fusion, StepInput, StepModel, lengths, live_axle};
use crate::calibration::CornerChannels;
use crate::corners::CornerState;
use crate::feedback::BodyMotionEstimate;
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

/// Noise of each tyre's M_x: the ground under a wheel leans across the track.
pub(super) fn tipping_noise(
    tuning: &FusionTuning,
    process_noise: ProcessNoiseTuning,
) -> ProcessNoise<4> {
    let bounds = tuning.moments.tipping_bounds;
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
            // The load's rate holds only what the travel of the wheel does not explain.
            variance[RATE + 3 * wheel + 2] = t.load_rate_start_sigma_n_s.powi(2);
            variance[ROAD + wheel] = t.load_rate_start_sigma_n_s.powi(2);
            for i in 0..2 {
                variance[MOMENT + 2 * wheel + i] =
                    self.body.moment_sigma_n_m(wheel, &t.moments)[i].powi(2);
            }
            variance[SPEED + wheel] = t.strut_start_sigma[1].powi(2);
            variance[LENGTH + wheel] = t.strut_start_sigma[0].powi(2);
            variance[STRUT + wheel] = t.strut_sigma_n.powi(2);
            variance[LENGTH_ERROR + wheel] =
                lengths::start_variance(&c.deflection, &t.potentiometers);
            for (i, sigma) in self.offset_sigmas(channels, wheel).into_iter().enumerate() {
                variance[OFFSET + 5 * wheel + i] = sigma.powi(2);
            }
            for axis in 0..3 {
                variance[HUB_BIAS + 3 * wheel + axis] =
                    self.hubs[wheel].map_or(0.0, |hub| hub.bias_sigma_m_s2[axis].powi(2));
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
        self.state[OFFSET..BEFORE].fill(0.0);
        self.state[HUB_BIAS..].fill(0.0);
        self.covariance.reset(&variance, &self.state);
        self.latencies.forget_effects();
    }

    /// Propagates state and covariance by the step.
    pub(super) fn predict(&mut self, input: &StepInput<'_>, model: &StepModel) {
        let dt = input.dt;
        let mut transition = Transition::new();
        let mut added = [0.0; SIZE];
        for axis in 0..3 {
            let turn = &model.balance.turn[axis];
            let gains = turn.gains.iter().enumerate();
            let index = BODY_RATE + axis;
            transition.mix(
                index,
                gains.map(|(j, gain)| (j, dt * gain)).chain([(index, 1.0)]),
            );
            added[index] = dt * turn.constant;
        }
        let propagations = self.propagations(model, dt);
        for corner in propagations.corners.iter().flatten() {
            corner.mix_into(&mut transition, &mut added);
        }
        if let Some(axle) = &propagations.axle {
            axle.mix_into(&mut transition, &mut added);
        }
        for wheel in 0..4 {
            // The body's own acceleration presses the tyre, too.
            let stiffness = self.body.tyres[wheel].vertical_stiffness_n_m;
            added[RATE + 3 * wheel + 2] -= dt * stiffness * self.lifting_m_s2(input, wheel);
        }
        let gains = self.decay(dt, input.channels, &mut transition.keep);
        self.state = transition.apply(&self.state);
        self.covariance.propagate(&transition);
        self.latencies.propagate(&transition, dt);
        for (index, by) in added.into_iter().enumerate().filter(|(_, by)| *by != 0.0) {
            self.state[index] += by;
            self.covariance
                .trace
                .note(|| Operation::Shift { index, by });
        }
        self.add_process_noise(input, model, &propagations, &gains);
    }

    /// Standard deviations of the offset states of a wheel.
    fn offset_sigmas(&self, channels: &PerWheel<CornerChannels>, wheel: usize) -> [f64; 5] {
        if self.live[wheel] {
            live_axle::offset_sigmas(channels, wheel)
        } else {
            std::array::from_fn(|i| channels.0[wheel].strain[i].offset_sigma)
        }
    }

    /// Propagations of the corners: of a live axle both together.
    fn propagations(&self, model: &StepModel, dt: f64) -> Propagations {
        let times_s = [self.tuning.load_rate_time_s, self.force_noise.road_time_s()];
        let live = model.axle.as_ref().map(|axle| axle.wheels);
        Propagations {
            corners: std::array::from_fn(|wheel| {
                let forms = &model.forms[wheel];
                let pressing = [forms.touching, 1e-3 * forms.touching * forms.stiffness_n_m];
                let moving = [Moving::alone(&forms.acceleration, pressing)];
                let is_alone = live.is_none_or(|wheels| !wheels.contains(&wheel));
                is_alone.then(|| Propagation::new([wheel], &moving, times_s, dt))
            }),
            axle: (model.axle.as_ref()).map(|axle| {
                let moving = [0, 1].map(|side| axle.moving(side, &model.forms));
                Propagation::new(axle.wheels, &moving, times_s, dt)
            }),
        }
    }

    /// Acceleration of the body at a wheel, against the ground's normal, m/s^2.
    fn lifting_m_s2(&self, input: &StepInput<'_>, wheel: usize) -> f64 {
        let up = input.motion.earth_from_body.inverse() * Vector3::z();
        let arm = input.corners[wheel].pose.wheel_centre_m - Vector3::z() * self.body.cg_height_m;
        let rate = input.motion.rate_rad_s;
        // Stands can carry a vehicle whose inertial unit is silent.
        let of_centre = if input.motion.inertial {
            BodyMotionEstimate {
                specific_force_m_s2: input.motion.specific_force_m_s2,
                rate_dot_rad_s2: self.ahead.rate_dot_rad_s2,
            }
        } else if let Some(ahead) = self.body_motion {
            ahead
        } else {
            return 0.0;
        };
        let force = of_centre.specific_force_m_s2
            + of_centre.rate_dot_rad_s2.cross(&arm)
            + rate.cross(&rate.cross(&arm));
        force.dot(&up) - STANDARD_GRAVITY_M_S2
    }

    /// Decay of load rates, moments, strut errors, torques, biases, offsets and length errors over `dt`.
    fn decay(&self, dt: f64, channels: &PerWheel<CornerChannels>, keep: &mut State) -> DecayGains {
        let t = self.tuning;
        let mut fade = |first: usize, count: usize, time_s: f64| {
            let kept = math::exp(-dt / time_s);
            keep[first..first + count].fill(kept);
            1.0 - kept * kept
        };
        for wheel in 0..4 {
            fade(RATE + 3 * wheel + 2, 1, t.load_rate_time_s);
        }
        fade(ROAD, 4, self.force_noise.road_time_s());
        let moment = fade(MOMENT, SPEED - MOMENT, t.moment_time_s);
        let strut = fade(STRUT, 4, t.strut_time_s);
        fade(TORQUE, 2, t.torque_time_s[0]);
        fade(TORQUE + 2, 2, t.torque_time_s[1]);
        fade(ACCEL_BIAS, 3, t.accel_time_s);
        let offset = fade(OFFSET, 20, t.offset_time_s);
        let length_mm2: [f64; 4] = std::array::from_fn(|wheel| {
            let deflection = &channels.0[wheel].deflection;
            let start = lengths::start_variance(deflection, &t.potentiometers);
            let (kept, gained) = self.lengths[wheel].fading(start, dt, &t.potentiometers);
            keep[LENGTH_ERROR + wheel] = kept;
            gained
        });
        keep[BETWEEN..BETWEEN + 4].fill(0.0);
        DecayGains {
            moment,
            strut,
            offset,
            length_mm2,
        }
    }

    /// Density of the white noise of a load, N^2/s. A wheel in the air can land in any step; then its load
    /// grows by the speed with which the wheel falls.
    fn load_density(&self, forms: &CornerForms, wheel: usize, dt: f64) -> f64 {
        let n = self.tuning.force_noise;
        let mut pressed_n_s = self.state[RATE + 3 * wheel + 2]
            - 1e-3 * forms.stiffness_n_m * self.state[SPEED + wheel];
        if let Some(coupled) = &forms.coupled {
            pressed_n_s -= 1e-3 * coupled.stiffness_n_m * self.state[SPEED + coupled.wheel];
        }
        let landing_n_s = n.air_part * pressed_n_s;
        let road = self.force_noise.road(wheel);
        let air = n.air_density + landing_n_s * landing_n_s * dt;
        forms.touching * n.road_white * road + (1.0 - forms.touching) * air
    }

    /// Variance of the force of a strut by the parts of the tyre's force that it carries, N^2.
    pub(super) fn carried_variance(&self, corner: &CornerState, wheel: usize) -> f64 {
        let parts = corner.strut_part_sigma.into_iter().enumerate();
        parts
            .map(|(axis, sigma)| (sigma * self.state[FORCE + 3 * wheel + axis]).powi(2))
            .sum()
    }

    fn add_process_noise(
        &mut self,
        input: &StepInput<'_>,
        model: &StepModel,
        propagations: &Propagations,
        gains: &DecayGains,
    ) {
        let (t, dt, n) = (self.tuning, input.dt, self.tuning.force_noise);
        let loads: [f64; 4] = std::array::from_fn(|i| self.load_density(&model.forms[i], i, dt));
        let carried = [0, 1, 2, 3].map(|i| self.carried_variance(&input.corners[i], i));
        let c = &mut self.covariance;
        // Forces of the vehicle model do not adapt the density.
        let rate = if self.blind {
            [t.blind_density; 3]
        } else {
            self.force_noise.densities()
        };
        let along = n.road_along * n.road_along;
        let [x, y, z] = rate;
        let road_time_s = self.force_noise.road_time_s();
        let roads: [f64; 4] = std::array::from_fn(|wheel| self.force_noise.road(wheel));
        let noises = |wheel: usize| {
            let road = roads[wheel];
            Noises {
                force: [along * road, along * road, loads[wheel]],
                rate: [
                    x,
                    y,
                    z,
                    (1.0 - n.road_white) * road / (road_time_s * road_time_s),
                ],
                speed: 1e6
                    * (t.strut_rate_density * t.strut_rate_density
                        + n.road_strut_rate * n.road_strut_rate * road),
            }
        };
        if let Some(axle) = &propagations.axle {
            let of_axle = axle.wheels().map(noises);
            axle.noise(&of_axle, dt, &mut |i, j, value| {
                c.add_covariance(i, j, value)
            });
        }
        for wheel in 0..4 {
            let road = roads[wheel];
            if let Some(corner) = &propagations.corners[wheel] {
                corner.noise(&[noises(wheel)], dt, &mut |i, j, value| {
                    c.add_covariance(i, j, value)
                });
            }
            c.add_noise(BETWEEN + wheel, road * dt * n.road_between);
            let rough = n.road_moment_m * n.road_moment_m * road;
            for i in 0..2 {
                let sigma = model.known[wheel].sigma_n_m[i];
                let adapted = if i == 0 { self.tipping.density() } else { 0.0 };
                let variance = gains.moment * (sigma * sigma + rough);
                c.add_noise(MOMENT + 2 * wheel + i, variance + adapted * dt);
            }
            let line = &input.corners[wheel].travel.strut;
            let stop = if line.stopped {
                t.stop_sigma_n_s_m * line.rate_m_s
            } else {
                0.0
            };
            let rough = n.road_strut * n.road_strut * road;
            let strut = t.strut_sigma_n * t.strut_sigma_n + stop * stop + rough;
            c.add_noise(STRUT + wheel, gains.strut * (strut + carried[wheel]));
            c.add_noise(LENGTH_ERROR + wheel, gains.length_mm2[wheel]);
        }
        self.add_body_noise(input, gains);
    }

    /// Process noise of torques, of the body and of the strain offsets.
    fn add_body_noise(&mut self, input: &StepInput<'_>, gains: &DecayGains) {
        let (t, dt) = (self.tuning, input.dt);
        let n = t.force_noise;
        let offsets: [[f64; 5]; 4] =
            std::array::from_fn(|wheel| self.offset_sigmas(input.channels, wheel));
        let c = &mut self.covariance;
        for axle in 0..2 {
            for (part, noise) in self.torque.iter().enumerate() {
                c.add_noise(TORQUE + 2 * part + axle, noise.density() * dt);
            }
        }
        let rough = n.road_balance_m * n.road_balance_m * self.force_noise.mean_road();
        for (axis, noise) in t.moment_noise_n_m.into_iter().enumerate() {
            let turn = (noise * noise + rough).sqrt() * self.body.inverse[(axis, axis)];
            c.add_noise(BODY_RATE + axis, turn * turn * dt);
            c.add_noise(ACCEL_BIAS + axis, self.accel.density() * dt);
        }
        for (i, sigma) in offsets.into_iter().flatten().enumerate() {
            c.add_noise(
                OFFSET + i,
                gains.offset * sigma.powi(2) + t.offset_walk_n.powi(2) * dt,
            );
        }
    }
}

/// Propagations of all corners.
struct Propagations {
    /// Of the corners that move by themselves.
    corners: [Option<Propagation<1>>; 4],
    /// Of a live axle.
    axle: Option<Propagation<2>>,
}

/// Gains of the process noise that keeps decaying states at their variance.
struct DecayGains {
    /// Part of the variance of moments.
    moment: f64,
    /// Part of the variance of strut errors.
    strut: f64,
    /// Part of the variance of strain offsets.
    offset: f64,
    /// Variance of each length error, mm^2.
    length_mm2: [f64; 4],
}
