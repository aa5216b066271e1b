//! Process noise of the tyre forces.
//!
//! The rates of F_x and F_y and the rate of the load that the wheel's travel does not explain have one
//! density for each axis, common to the four tyres, which adapts to the filter's corrections of the rates
//! ([`ProcessNoise`]). So a steady circle is smoothed more than a launch, and the standard deviations hold
//! in both.
//!
//! The road presses each tyre by itself: noise on the load, which is white but for the time in which the tyre
//! passes a part of its contact. Its density follows the innovations of
//! the wheel's potentiometer and hub accelerometer slowly. It stands for the roughness of the road, which does
//! not change from one step to the next; a rock is an innovation of its own.

use crate::process_noise::ProcessNoise;
use crate::tuning::{ForceNoiseTuning, ProcessNoiseTuning};

/// Densities of the process noise.
#[derive(Clone, Debug)]
pub struct ForceNoise {
    tuning: ForceNoiseTuning,
    noise: [ProcessNoise<4>; 3],
    /// Density of the load's white noise of each wheel at [`ForceNoiseTuning::road_speed_m_s`], N^2/s.
    road: [f64; 4],
    /// Speed by that speed: the road passes in proportion.
    pace: f64,
    /// Mean square of the potentiometer's normalised innovation.
    square: [f64; 4],
    /// The same of the vertical axis of the hub accelerometer; zero without one.
    hub_square: [f64; 4],
    /// Mean square of the normalised correction of each wheel's load.
    load_square: [f64; 4],
}

impl ForceNoise {
    /// The noise at the start.
    pub fn new(tuning: ForceNoiseTuning, process_noise: ProcessNoiseTuning) -> Self {
        let noise = |bounds| ProcessNoise::new(tuning.start_density, bounds, process_noise);
        let lateral = noise(tuning.density_bounds);
        Self {
            tuning,
            noise: [lateral, lateral, noise(tuning.load_density_bounds)],
            road: [tuning.road_start; 4],
            pace: 1.0,
            square: [1.0; 4],
            hub_square: [0.0; 4],
            load_square: [1.0; 4],
        }
    }

    /// Densities of the noise of the rates along x, y, z, (N/s)^2/s.
    pub fn densities(&self) -> [f64; 3] {
        let [x, y, z] = self.noise.map(|noise| noise.density());
        let shared = self.tuning.shared * x.max(y);
        [x.max(shared), y.max(shared), z]
    }

    /// Density of the load's white noise of a wheel, N^2/s.
    pub fn road(&self, wheel: usize) -> f64 {
        self.road[wheel] * self.pace
    }

    /// Sets the vehicle's speed.
    pub fn drive(&mut self, speed_m_s: f64) {
        let t = &self.tuning;
        self.pace = speed_m_s.abs().max(t.road_speed_min_m_s) / t.road_speed_m_s;
    }

    /// Time constant of the rate at which the road presses a tyre, s.
    pub fn road_time_s(&self) -> f64 {
        let t = &self.tuning;
        let [least, most] = t.road_time_s;
        (t.road_length_m / (self.pace * t.road_speed_m_s)).clamp(least, most)
    }

    /// Its mean over the wheels.
    pub fn mean_road(&self) -> f64 {
        self.pace * self.roughness()
    }

    /// Its mean at the speed of reference.
    pub fn roughness(&self) -> f64 {
        self.road.iter().sum::<f64>() / 4.0
    }

    /// Raises the density of a wheel after an event on the road.
    pub fn surprise(&mut self, wheel: usize) {
        let t = &self.tuning;
        let raised = self.road[wheel] * t.surprise;
        self.road[wheel] = raised.min(t.surprise_max.max(self.road[wheel]));
    }

    /// Takes the normalised innovation of a wheel's potentiometer.
    pub fn take_length(&mut self, wheel: usize, innovation: f64) {
        let t = &self.tuning;
        let z = innovation.clamp(-t.innovation_max, t.innovation_max);
        self.square[wheel] += t.road_memory * (z * z - self.square[wheel]);
    }

    /// Takes the normalised innovation of the vertical axis of a wheel's hub accelerometer.
    pub fn take_hub(&mut self, wheel: usize, innovation: f64) {
        let t = &self.tuning;
        let z = innovation.clamp(-t.innovation_max, t.innovation_max);
        self.hub_square[wheel] += t.road_memory * (z * z - self.hub_square[wheel]);
    }

    /// Adapts the densities at the end of a step to the normalised corrections of the twelve rates; the road's
    /// to those of the loads and, for wheels with a potentiometer, to its innovations.
    pub fn learn(&mut self, corrections: [f64; 12], measured: [bool; 4], loads: [f64; 4]) {
        for (axis, noise) in self.noise.iter_mut().enumerate() {
            noise.learn(std::array::from_fn(|wheel| corrections[3 * wheel + axis]));
        }
        let t = &self.tuning;
        let surplus: [f64; 4] = std::array::from_fn(|wheel| {
            let z = loads[wheel].clamp(-t.innovation_max, t.innovation_max);
            self.load_square[wheel] += t.load_memory * (z * z - self.load_square[wheel]);
            let load = self.load_square[wheel];
            let (length, [low, high], [down, up]) = if measured[wheel] {
                (self.square[wheel], t.load_square, t.load_gain)
            } else {
                (t.road_square, t.unposed_square, [1.0, 1.0])
            };
            length.max(self.hub_square[wheel]) - t.road_square
                + down * (load - low).min(0.0)
                + up * (load - high).max(0.0)
        });
        let mean = surplus.iter().sum::<f64>() / 4.0;
        // The slower the vehicle, the more of the innovations is of its own manoeuvres and not of the road.
        let gain = t.road_gain * self.pace.min(1.0).sqrt();
        let [down, up] = t.road_step;
        let [least, most] = t.road_bounds;
        for wheel in 0..4 {
            let step = gain * (0.5 * (surplus[wheel] + mean)).clamp(-down, up);
            self.road[wheel] = (self.road[wheel] * (1.0 + step)).clamp(least, most);
        }
    }
}
