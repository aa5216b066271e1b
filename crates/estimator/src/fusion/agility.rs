//! How fast the forces change: the process noise of their rates.
//!
//! One density for each axis, shared by the four tyres (which may turn rough together), follows the
//! filter's corrections of the rates ([`ProcessNoise`]), so that a steady circle is smoothed more
//! than a launch and the deviations stay true in both.
//!
//! A blow that learning is too slow for shows in many channels at once, where a faulty channel
//! stands alone: then the rates are set free for the next step, before any channel is blamed.

use crate::process_noise::ProcessNoise;

/// Density at the start, and its bounds, (N/s)^2/s.
const START: f64 = 3.0e3 * 3.0e3;
const BOUNDS: [f64; 2] = [15.0 * 15.0, 2.0e4 * 2.0e4];
/// Part of the largest density that every axis has at least: a tyre that is steered or braked
/// pushes along all of them.
const SHARED: f64 = 0.02;

/// Square of a normalised innovation that surprises, and how many of one corner's channels it takes.
const SURPRISE: f64 = 20.0;
const CHANNELS: u32 = 3;
/// Deviations of chi-square that the sum of all squares must stand above its mean, and the most that
/// one channel gives to it: of twenty good channels once a minute.
const TOGETHER: f64 = 4.5;
const SHARE_MAX: f64 = 9.0;
/// Least density after a surprise, (N/s)^2/s.
const AFTER_SURPRISE: f64 = 6.0e3 * 6.0e3;

/// Densities of F_x, F_y, F_z and what has just surprised.
#[derive(Clone, Debug)]
pub struct Agility {
    noise: [ProcessNoise<4>; 3],
    surprises: [u32; 4],
    channels: u32,
    sum: f64,
    open: bool,
}

impl Default for Agility {
    fn default() -> Self {
        Self {
            noise: [ProcessNoise::new(START, BOUNDS); 3],
            surprises: [0; 4],
            channels: 0,
            sum: 0.0,
            open: false,
        }
    }
}

impl Agility {
    /// Densities of the noise of the rates along x, y, z, (N/s)^2/s.
    pub fn densities(&self) -> [f64; 3] {
        let own = self.noise.map(|noise| noise.density());
        let shared = SHARED * own.into_iter().fold(0.0, f64::max);
        own.map(|density| density.max(shared))
    }

    /// Takes the normalised square of a strain channel's innovation in.
    pub fn surprise(&mut self, wheel: usize, square: f64) {
        self.surprises[wheel] += u32::from(square > SURPRISE);
        self.channels += 1;
        self.sum += square.min(SHARE_MAX);
    }

    /// Whether this step surprised: what contradicts the state now may be right.
    pub fn open(&self) -> bool {
        self.open
    }

    /// Whether this step's innovations call for faster forces; forgets them.
    pub fn surprised(&mut self) -> bool {
        let channels = f64::from(self.channels);
        let together = self.sum > channels + TOGETHER * (2.0 * channels).sqrt();
        let found = together || self.surprises.iter().any(|count| *count >= CHANNELS);
        self.surprises = [0; 4];
        (self.channels, self.sum) = (0, 0.0);
        self.open = found;
        if found {
            for noise in &mut self.noise {
                noise.raise(AFTER_SURPRISE);
            }
        }
        found
    }

    /// Takes in one step's corrections of the twelve rates, in deviations.
    pub fn learn(&mut self, corrections: [f64; 12]) {
        for (axis, noise) in self.noise.iter_mut().enumerate() {
            noise.learn(std::array::from_fn(|wheel| corrections[3 * wheel + axis]));
        }
    }
}
