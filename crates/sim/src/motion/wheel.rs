//! How a wheel moves over the earth.

/// A wheel over the earth, of a motion that tells it. Vectors are in earth axes (east, north, up).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelMotion {
    /// Wheel centre, m.
    pub centre_m: [f64; 3],
    /// Its velocity, m/s.
    pub velocity_m_s: [f64; 3],
    /// Its acceleration without gravity, m/s^2.
    pub acceleration_m_s2: [f64; 3],
    /// Contact point; in the air the lowest point of the tyre, m.
    pub contact_m: [f64; 3],
    /// Rate of the strut's length, m/s.
    pub strut_rate_m_s: f64,
    /// Its second derivative, m/s^2.
    pub strut_acceleration_m_s2: f64,
    /// Force of spring, damper and stops, pushing the strut's ends apart, N.
    pub strut_force_n: f64,
}

impl WheelMotion {
    /// The state between `a` (weight 0) and `b` (weight 1).
    pub(super) fn between(a: &Self, b: &Self, weight: f64) -> Self {
        let l = |x: f64, y: f64| x + (y - x) * weight;
        let mix = |a: &[f64; 3], b: &[f64; 3]| super::mix(a, b, weight);
        Self {
            centre_m: mix(&a.centre_m, &b.centre_m),
            velocity_m_s: mix(&a.velocity_m_s, &b.velocity_m_s),
            acceleration_m_s2: mix(&a.acceleration_m_s2, &b.acceleration_m_s2),
            contact_m: mix(&a.contact_m, &b.contact_m),
            strut_rate_m_s: l(a.strut_rate_m_s, b.strut_rate_m_s),
            strut_acceleration_m_s2: l(a.strut_acceleration_m_s2, b.strut_acceleration_m_s2),
            strut_force_n: l(a.strut_force_n, b.strut_force_n),
        }
    }

    /// The same on a later lap: places moved by `place`, directions turned left by `turn_rad`.
    pub(super) fn on_lap(&mut self, place: impl Fn([f64; 2]) -> [f64; 2], turn_rad: f64) {
        for point in [&mut self.centre_m, &mut self.contact_m] {
            [point[0], point[1]] = place([point[0], point[1]]);
        }
        for vector in [&mut self.velocity_m_s, &mut self.acceleration_m_s2] {
            let turned = super::ahead([0.0; 2], turn_rad, [vector[0], vector[1]]);
            [vector[0], vector[1]] = turned;
        }
    }
}
