//! Roll or pitch of the body on its springs.

/// Steps of the integration in one step of the estimator.
const SUBSTEPS: usize = 4;

/// Rotation about one axis: I x'' = M - K x - B x'.
#[derive(Clone, Copy, Debug)]
pub struct Tilt {
    inertia_kg_m2: f64,
    stiffness_n_m_rad: f64,
    damping_n_m_s_rad: f64,
    /// Angle against the design position, rad.
    pub angle_rad: f64,
    /// Its rate, rad/s.
    pub rate_rad_s: f64,
    /// Its second derivative, rad/s^2.
    pub acceleration_rad_s2: f64,
}

impl Tilt {
    /// A body at rest in the design position.
    pub fn new(inertia_kg_m2: f64, stiffness_n_m_rad: f64, damping_n_m_s_rad: f64) -> Self {
        Self {
            inertia_kg_m2: inertia_kg_m2.max(1.0),
            stiffness_n_m_rad: stiffness_n_m_rad.max(1.0),
            damping_n_m_s_rad,
            angle_rad: 0.0,
            rate_rad_s: 0.0,
            acceleration_rad_s2: 0.0,
        }
    }

    /// The same body on other springs.
    pub fn stiffen(&mut self, stiffness_n_m_rad: f64) {
        self.stiffness_n_m_rad = stiffness_n_m_rad.max(1.0);
    }

    /// Starts in the equilibrium with a moment.
    pub fn settle(&mut self, moment_n_m: f64) {
        self.angle_rad = moment_n_m / self.stiffness_n_m_rad;
        self.rate_rad_s = 0.0;
        self.acceleration_rad_s2 = 0.0;
    }

    /// Propagates by `dt_s` with a constant moment. The damping is implicit, so that an overdamped body is stable.
    pub fn step(&mut self, moment_n_m: f64, dt_s: f64) {
        let part_s = dt_s / SUBSTEPS as f64;
        let before = self.rate_rad_s;
        for _ in 0..SUBSTEPS {
            let drive = moment_n_m - self.stiffness_n_m_rad * self.angle_rad;
            self.rate_rad_s = (self.rate_rad_s + drive / self.inertia_kg_m2 * part_s)
                / (1.0
                    + (self.damping_n_m_s_rad + self.stiffness_n_m_rad * part_s)
                        / self.inertia_kg_m2
                        * part_s);
            self.angle_rad += self.rate_rad_s * part_s;
        }
        self.acceleration_rad_s2 = (self.rate_rad_s - before) / dt_s;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_moment_ends_in_the_static_angle_and_an_oscillation_has_its_frequency() {
        let mut tilt = Tilt::new(200.0, 20_000.0, 800.0);
        for _ in 0..500 {
            tilt.step(1000.0, 0.01);
        }
        assert!((tilt.angle_rad - 0.05).abs() < 1e-6);
        assert!(tilt.acceleration_rad_s2.abs() < 1e-4);

        let mut free = Tilt::new(200.0, 20_000.0, 0.0);
        free.settle(1000.0);
        let mut crossed = None;
        for step in 0..300 {
            free.step(0.0, 0.001);
            if free.angle_rad <= 0.0 {
                crossed = Some(f64::from(step) * 0.001);
                break;
            }
        }
        // A quarter of the period 2 pi sqrt(I/K) = 0.628 s, less the start of the last step.
        assert!((crossed.unwrap() - 0.157).abs() < 0.005, "{crossed:?}");
    }
}
