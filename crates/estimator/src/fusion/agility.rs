//! How fast the forces change: the process noise of their rates, learnt from the filter's own
//! corrections.
//!
//! In a filter whose noise is right the corrections d of a state have the variance that the
//! measurements take away, E d^2 = P- - P+. Rates that are corrected by more have been told to
//! change too little, and the density of their noise grows; by less, and it shrinks. So a steady
//! circle is smoothed more than a launch, and the deviations stay true in both. One density for
//! each axis, shared by the four tyres (which may turn rough together).
//!
//! A blow that learning is too slow for shows in many channels at once, where a faulty channel
//! stands alone: then the rates are set free for the next step, before any channel is blamed.

/// Density at the start, and its bounds, (N/s)^2/s.
const START: f64 = 3.0e3 * 3.0e3;
const BOUNDS: [f64; 2] = [400.0 * 400.0, 2.0e4 * 2.0e4];
/// Weight of one step in the mean of corrections: about half a second.
const LEARN: f64 = 0.02;
/// Corrections beyond the variance taken away that are the measurements' own colour.
const CORRECTED: f64 = 1.2;
/// How much of the surplus a density follows in one step, and the most, downward and upward.
const FOLLOW: f64 = 0.05;
const STEP: [f64; 2] = [0.01, 0.1];

/// Square of a normalised innovation that surprises, and how many of one corner's channels it takes;
/// in three corners at once one each will do.
const SURPRISE: f64 = 20.0;
const CHANNELS: u32 = 3;
/// Least density after a surprise, (N/s)^2/s.
const AFTER_SURPRISE: f64 = 6.0e3 * 6.0e3;

/// Densities of F_x, F_y, F_z and what they are learnt from.
#[derive(Clone, Debug)]
pub struct Agility {
    density: [f64; 3],
    corrected: [f64; 3],
    told: [f64; 3],
    surprises: [u32; 4],
    open: bool,
}

impl Default for Agility {
    fn default() -> Self {
        Self {
            density: [START; 3],
            corrected: [0.0; 3],
            told: [0.0; 3],
            surprises: [0; 4],
            open: false,
        }
    }
}

impl Agility {
    /// Density of the noise of the rate along an axis, (N/s)^2/s.
    pub fn density(&self, axis: usize) -> f64 {
        self.density[axis]
    }

    /// Takes the normalised square of a strain channel's innovation in.
    pub fn surprise(&mut self, wheel: usize, square: f64) {
        self.surprises[wheel] += u32::from(square > SURPRISE);
    }

    /// Whether the last step surprised: what contradicts the state now may be right.
    pub fn open(&self) -> bool {
        self.open
    }

    /// Whether this step's innovations call for faster forces; forgets them.
    pub fn surprised(&mut self) -> bool {
        let corners = self.surprises.iter().filter(|count| **count > 0).count();
        let found = corners >= 3 || self.surprises.iter().any(|count| *count >= CHANNELS);
        self.surprises = [0; 4];
        self.open = found;
        if found {
            for density in &mut self.density {
                *density = density.max(AFTER_SURPRISE);
            }
        }
        found
    }

    /// Takes in values and variances of the twelve rates before and after the measurements of one
    /// step.
    pub fn learn(&mut self, before: &[[f64; 2]; 12], after: &[[f64; 2]; 12]) {
        for axis in 0..3 {
            let (mut corrected, mut told) = (0.0, 0.0);
            for i in (axis..12).step_by(3) {
                corrected += (after[i][0] - before[i][0]).powi(2);
                told += (before[i][1] - after[i][1]).max(0.0);
            }
            self.corrected[axis] += LEARN * (corrected - self.corrected[axis]);
            self.told[axis] += LEARN * (told - self.told[axis]);
            let ratio = self.corrected[axis] / self.told[axis].max(f64::MIN_POSITIVE);
            let [down, up] = STEP;
            let step = (FOLLOW * (ratio - CORRECTED)).clamp(-down, up);
            let [least, most] = BOUNDS;
            if step.is_finite() {
                self.density[axis] = (self.density[axis] * (1.0 + step)).clamp(least, most);
            }
        }
    }
}
