//! Steering-wheel angle, rate and acceleration from encoder readings.

use crate::tuning::SteeringWheelTuning;

/// Fits a parabola by least squares with a fading memory: it has no lag for a constant rate or a
/// constant acceleration. A differentiated encoder would give the front wheels' gyroscopic moment
/// noise of 0.1 rad/s, 30 N of F_y at 15 m/s; the rate of a straight line would lag by 0.12 s.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SteeringWheel {
    pub(super) angle_rad: f64,
    rate_rad_s: f64,
    rate_dot_rad_s2: f64,
    known: bool,
}

impl SteeringWheel {
    pub(super) fn follow(&mut self, reading_rad: f64, keep: f64, dt: f64) {
        if !self.known {
            (self.angle_rad, self.known) = (reading_rad, true);
        }
        let lost = 1.0 - keep;
        self.angle_rad += (self.rate_rad_s + 0.5 * self.rate_dot_rad_s2 * dt) * dt;
        self.rate_rad_s += self.rate_dot_rad_s2 * dt;
        let error = reading_rad - self.angle_rad;
        self.angle_rad += (1.0 - keep.powi(3)) * error;
        self.rate_rad_s += 1.5 * lost * lost * (1.0 + keep) * error / dt;
        self.rate_dot_rad_s2 += cube(lost) * error / (dt * dt);
    }

    /// Rate and acceleration of a rack with this travel for a radian, m/s and m/s^2.
    pub(super) fn motion(&self, rack_m_rad: f64, tuning: &SteeringWheelTuning) -> [f64; 2] {
        let [speed, acceleration] = [tuning.rack_max_m_s, tuning.rack_max_m_s2];
        [
            (self.rate_rad_s * rack_m_rad).clamp(-speed, speed),
            (self.rate_dot_rad_s2 * rack_m_rad).clamp(-acceleration, acceleration),
        ]
    }
}

/// x^3, rounded once: three factors multiplied one after another are rounded twice, which changes
/// the last bit.
fn cube(x: f64) -> f64 {
    let square = x * x;
    let rounding = x.mul_add(x, -square);
    square.mul_add(x, rounding * x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_steering_wheel_that_turns_ever_faster_is_not_left_behind() {
        let tuning = SteeringWheelTuning::default();
        let mut wheel = SteeringWheel::default();
        let (dt, rate_dot) = (0.01, 3.0);
        for k in 0..=100 {
            let time_s = dt * f64::from(k);
            wheel.follow(0.5 * rate_dot * time_s * time_s, tuning.rate_keep, dt);
        }
        let [rate, acceleration] = wheel.motion(0.01, &tuning);
        assert!((rate - 0.01 * rate_dot).abs() < 1e-6, "{rate}");
        assert!(
            (acceleration - 0.01 * rate_dot).abs() < 1e-4,
            "{acceleration}"
        );
    }
}
