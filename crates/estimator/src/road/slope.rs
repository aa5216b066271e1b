//! Slope of the ground without its roughness.
//!
//! The plane through the four contacts has the slope of the ground and that of its roughness. The slope of
//! the ground lasts longer: a mean of the plane's slopes in earth axes, so that a turn of the vehicle does not
//! change it, with a fading memory over the distance. Where the ground itself changes, the plane differs from
//! this mean in one direction for longer than roughness does. If the mean of the last few metres differs by
//! more than the usual spread, the memory is as short as these metres.

use crate::tuning::RoadTuning;

/// The filter.
#[derive(Clone, Copy, Debug, Default)]
pub struct SlopeFilter {
    /// Slopes along east and north.
    slope: Option<[f64; 2]>,
    /// Mean of the last few metres of the plane's slope less the slope.
    apart: [f64; 2],
    /// Usual mean square of the plane's slope less the slope.
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
        if let Some([bank, grade]) = plane.filter(|angles| angles.iter().all(|a| a.is_finite())) {
            let (left, ahead) = (math::tan(bank), -math::tan(grade));
            let seen = [cosine * ahead - sine * left, sine * ahead + cosine * left];
            let floor = t.slope_spread_min * t.slope_spread_min;
            let slope = self.slope.get_or_insert(seen);
            // At rest the noise of the sensors is averaged over time.
            let moved_m = distance_m.max(t.slope_rest_m_s * dt);
            let part = |memory_m: f64| (moved_m / memory_m).min(1.0);
            let mut square = 0.0;
            for ((apart, seen), slope) in self.apart.iter_mut().zip(seen).zip(&*slope) {
                *apart += part(t.slope_change_m) * (seen - slope - *apart);
                square += 0.5 * (seen - slope) * (seen - slope);
            }
            let usual = self.spread.max(floor);
            let mean = 0.5 * self.apart.iter().map(|apart| apart * apart).sum::<f64>();
            let changed = mean > t.slope_change_sigma * t.slope_change_sigma * usual;
            if !changed {
                self.spread += part(t.slope_spread_m) * (square - self.spread);
            }
            let memory_m = if changed { t.slope_change_m } else { t.slope_memory_m };
            for (slope, seen) in slope.iter_mut().zip(seen) {
                *slope += part(memory_m) * (seen - *slope);
            }
        }
        self.slope.map(|[east, north]| {
            let (ahead, left) = (cosine * east + sine * north, cosine * north - sine * east);
            [math::atan(left), -math::atan(ahead)]
        })
    }
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
                *value += dt * speed / 0.8 * -*value + 0.02 * (2.0 * dt * speed / 0.8).sqrt() * random.normal();
            }
            let plane = [truth[0] + rough[0], truth[1] + rough[1]];
            let found = filter.step(Some(plane), yaw, speed * dt, dt, &tuning);
            let found = found.expect("a slope");
            let square: f64 = found.iter().zip(truth).map(|(f, t)| (f - t) * (f - t)).sum();
            if (1000..3000).contains(&k) {
                squares += square / 2000.0;
            }
            if k == 3000 + 300 {
                late = square.sqrt();
            }
        }
        assert!(squares.sqrt() < 0.01, "{}", squares.sqrt());
        assert!(late < 0.02, "{late}");
        let unknown = filter.step(None, 0.0, 0.05, dt, &tuning).expect("the last slope");
        assert!((unknown[0] - math::atan(TILT)).abs() < 0.02, "{unknown:?}");
    }
}
