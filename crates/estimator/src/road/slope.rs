//! Slope of the ground without its roughness.
//!
//! The plane through the four contacts has the slope of the ground and that of its roughness. The slope of
//! the ground lasts longer: a mean of the plane's slopes in earth axes, so that a turn of the vehicle does not
//! change it, with a fading memory over the distance. Where the ground itself changes, the plane differs from
//! this mean in one direction for longer than roughness does. If the mean of the last few metres differs by
//! more than the usual spread, this mean is the slope. While the plane is unknown, the slope goes back to the
//! long mean: a ramp ends where the wheels leave the ground.

use crate::tuning::RoadTuning;

/// The filter.
#[derive(Clone, Copy, Debug, Default)]
pub struct SlopeFilter {
    /// Long mean of the slopes along east and north.
    slope: Option<[f64; 2]>,
    /// Mean of the last few metres of the plane's slope less the long mean.
    apart: [f64; 2],
    /// Usual mean square of the plane's slope less the long mean.
    spread: f64,
}

impl SlopeFilter {
    /// Takes bank and grade of the plane through the contacts, rad, and returns those of the ground.
    /// `None`: the contacts are unknown. `distance_m`: driven since the last call.
    pub fn step(
        &mut self,
        plane: Option<[f64; 2]>,
        yaw_rad: f64,
        distance_m: f64,
        dt: f64,
        tuning: &RoadTuning,
    ) -> Option<[f64; 2]> {
        let t = tuning;
        let (sine, cosine) = math::sin_cos(yaw_rad);
        let seen = plane
            .filter(|angles| angles.iter().all(|angle| angle.is_finite()))
            .map(|[bank, grade]| {
                let (left, ahead) = (math::tan(bank), -math::tan(grade));
                [cosine * ahead - sine * left, sine * ahead + cosine * left]
            });
        if self.slope.is_none() {
            self.slope = seen;
        }
        let slope = self.slope.as_mut()?;
        // At rest the noise of the sensors is averaged over time.
        let moved_m = distance_m.max(t.slope_rest_m_s * dt);
        let part = |memory_m: f64| (moved_m / memory_m).min(1.0);
        let beyond: [f64; 2] = std::array::from_fn(|i| seen.map_or(0.0, |seen| seen[i] - slope[i]));
        for (apart, beyond) in self.apart.iter_mut().zip(beyond) {
            *apart += part(t.slope_change_m) * (beyond - *apart);
        }
        let floor = t.slope_spread_min * t.slope_spread_min;
        let mean = mean_square(&self.apart);
        let changed = mean > t.slope_change_sigma.powi(2) * self.spread.max(floor);
        if seen.is_some() {
            if !changed {
                self.spread += part(t.slope_spread_m) * (mean_square(&beyond) - self.spread);
            }
            for (slope, beyond) in slope.iter_mut().zip(beyond) {
                *slope += part(t.slope_memory_m) * beyond;
            }
        }
        let [east, north] =
            std::array::from_fn(|i| slope[i] + if changed { self.apart[i] } else { 0.0 });
        let (ahead, left) = (cosine * east + sine * north, cosine * north - sine * east);
        Some([math::atan(left), -math::atan(ahead)])
    }
}

fn mean_square(values: &[f64; 2]) -> f64 {
    0.5 * values.iter().map(|value| value * value).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use math::Random;

    use super::*;

    const TILT: f64 = 0.12;

    /// Rough ground that becomes a side slope, in a vehicle that turns: roughness is averaged, and the slope
    /// is found within metres.
    #[test]
    fn roughness_is_averaged_and_a_side_slope_is_found() {
        let tuning = RoadTuning::default();
        let mut random = Random::new(11);
        let mut filter = SlopeFilter::default();
        let (dt, speed) = (0.01, 5.0);
        let mut rough = [0.0; 2];
        let (mut squares, mut late) = (0.0, 0.0_f64);
        for k in 0..6000 {
            let yaw = 0.002 * f64::from(k);
            let (sine, cosine) = math::sin_cos(yaw);
            // The ground rises to the north after 30 s.
            let north = if k < 3000 { 0.0 } else { TILT };
            let truth = [math::atan(cosine * north), -math::atan(sine * north)];
            for value in &mut rough {
                *value += dt * speed / 0.8 * -*value
                    + 0.02 * f64::sqrt(2.0 * dt * speed / 0.8) * random.normal();
            }
            let plane = [truth[0] + rough[0], truth[1] + rough[1]];
            let found = filter.step(Some(plane), yaw, speed * dt, dt, &tuning);
            let found = found.expect("a slope");
            let square: f64 = found
                .iter()
                .zip(truth)
                .map(|(f, t)| (f - t) * (f - t))
                .sum();
            if (1000..3000).contains(&k) {
                squares += square / 2000.0;
            }
            if k == 3000 + 150 {
                late = square.sqrt();
            }
        }
        assert!(squares.sqrt() < 0.01, "{}", squares.sqrt());
        assert!(late < 0.02, "{late}");
        let unknown = filter
            .step(None, 0.0, 0.05, dt, &tuning)
            .expect("the last slope");
        assert!((unknown[0] - math::atan(TILT)).abs() < 0.02, "{unknown:?}");
    }
}
