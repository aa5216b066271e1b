//! Process noise of the force rates.
//!
//! One density for each axis, common to the four tyres, adapts to the filter's corrections of the
//! rates ([`ProcessNoise`]). So a steady circle is smoothed more than a launch, and the standard
//! deviations hold in both.
//!
//! A sudden change that the adaptation is too slow for appears in many channels at once; a faulty
//! channel is a single outlier. Then the rates are inflated for the next step, before any channel
//! is judged.

use crate::process_noise::ProcessNoise;
use crate::tuning::{ForceNoiseTuning, ProcessNoiseTuning};

/// Densities of F_x, F_y, F_z, and the innovations of this step.
#[derive(Clone, Debug)]
pub struct ForceNoise {
    tuning: ForceNoiseTuning,
    noise: [ProcessNoise<4>; 3],
    large: [u32; 4],
    channels: u32,
    sum: f64,
    open: bool,
}

impl ForceNoise {
    /// The noise at the start.
    pub fn new(tuning: ForceNoiseTuning, process_noise: ProcessNoiseTuning) -> Self {
        let noise = ProcessNoise::new(tuning.start_density, tuning.density_bounds, process_noise);
        Self {
            tuning,
            noise: [noise; 3],
            large: [0; 4],
            channels: 0,
            sum: 0.0,
            open: false,
        }
    }

    /// Densities of the noise of the rates along x, y, z, (N/s)^2/s.
    pub fn densities(&self) -> [f64; 3] {
        let own = self.noise.map(|noise| noise.density());
        let shared = self.tuning.shared * own.into_iter().fold(0.0, f64::max);
        own.map(|density| density.max(shared))
    }

    /// Adds the normalised innovation squared of a strain channel.
    pub fn add_innovation(&mut self, wheel: usize, square: f64) {
        self.large[wheel] += u32::from(square > self.tuning.large_square);
        self.channels += 1;
        self.sum += square.min(self.tuning.share_max);
    }

    /// Whether the covariance was inflated in this step.
    pub fn open(&self) -> bool {
        self.open
    }

    /// Whether the innovations of this step require inflation; clears them.
    pub fn exceeded(&mut self) -> bool {
        let channels = f64::from(self.channels);
        let together = self.sum > channels + self.tuning.sum_sigma * (2.0 * channels).sqrt();
        let found = together
            || self
                .large
                .iter()
                .any(|count| *count >= self.tuning.channels);
        self.large = [0; 4];
        (self.channels, self.sum) = (0, 0.0);
        self.open = found;
        if found {
            for noise in &mut self.noise {
                noise.raise(self.tuning.inflated_density);
            }
        }
        found
    }

    /// Takes the normalised corrections of the twelve rates of one step.
    pub fn learn(&mut self, corrections: [f64; 12]) {
        for (axis, noise) in self.noise.iter_mut().enumerate() {
            noise.learn(std::array::from_fn(|wheel| corrections[3 * wheel + axis]));
        }
    }
}
