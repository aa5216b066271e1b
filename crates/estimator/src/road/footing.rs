//! The ground below one wheel, also while the wheel is in the air.

use crate::tuning::RoadTuning;

/// What is known of the ground below one wheel.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Footing {
    /// Height of the ground, m.
    height_m: Option<f64>,
    /// Its mean over the last metres, m.
    level_m: f64,
    lifted: bool,
}

impl Footing {
    /// Takes the lowest point of the tyre, m, its load over the static load, and the distance since the last call,
    /// m. Returns the height of the ground and its standard deviation by a wheel in the air.
    ///
    /// No sensor sees the ground below a wheel in the air. It is not above the tyre. A wheel leaves the ground
    /// where the ground falls away: the height goes back to its mean.
    pub(super) fn step(
        &mut self,
        lowest_m: f64,
        load_part: f64,
        moved_m: f64,
        tuning: &RoadTuning,
    ) -> [f64; 2] {
        let t = tuning;
        let [leaves, lands] = t.contact_part;
        self.lifted = load_part < if self.lifted { lands } else { leaves };
        let Some(before_m) = self.height_m.filter(|_| self.lifted) else {
            let part = (moved_m / t.level_memory_m).min(1.0);
            if self.height_m.is_none() {
                self.level_m = lowest_m;
            }
            self.level_m += part * (lowest_m - self.level_m);
            self.height_m = Some(lowest_m);
            return [lowest_m, 0.0];
        };
        let part = (moved_m / t.fall_m).min(1.0);
        let height_m = lowest_m.min(before_m + part * (self.level_m - before_m));
        self.height_m = Some(height_m);
        let unknown_m = (lowest_m - height_m).max((height_m - self.level_m).abs());
        [height_m, t.lifted_sigma_m + t.lifted_part * unknown_m]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wheel that jumps off the end of a ramp: the ground is below it, not with it.
    #[test]
    fn the_ground_stays_below_a_wheel_in_the_air() {
        let tuning = RoadTuning::default();
        let mut footing = Footing::default();
        for k in 0..400 {
            let ramp_m = 0.002 * f64::from((k - 300).max(0));
            let [height, sigma] = footing.step(ramp_m, 1.0, 0.08, &tuning);
            assert_eq!([height, sigma], [ramp_m, 0.0]);
        }
        let mut found = [0.0; 2];
        for k in 0..40 {
            let flight_m = 0.2 + 0.005 * f64::from(k);
            found = footing.step(flight_m, 0.02, 0.08, &tuning);
            assert!(found[0] <= flight_m && found[1] >= tuning.lifted_sigma_m);
        }
        // The ramp was high for 8 m, so that the mean is above the ground of 0 m; the error is stated.
        assert!(found[0] < 0.15 && found[0] < 3.0 * found[1], "{found:?}");
        // In the air, noise of the load is no touchdown.
        let noisy = footing.step(0.4, 0.15, 0.08, &tuning);
        assert!(noisy[0] < 0.15, "{noisy:?}");
        assert_eq!(footing.step(0.01, 0.9, 0.08, &tuning), [0.01, 0.0]);
    }
}
