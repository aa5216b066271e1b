//! The radial-interradial spring tyre of Badalamenti and Doyle.

/// A tyre of radial springs around the rim, neighbours joined by interradial springs (Badalamenti
/// and Doyle 1988; reference 4 of the thesis): it feels the shape of an obstacle, not only its
/// height.
///
/// F_i = k_r d_i + k_ir (2 d_i - d_(i-1) - d_(i+1)), zero where the spring is lifted (d_i = 0).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadialSpringTyre {
    /// Unloaded radius R, m.
    pub radius_m: f64,
    /// Angle between neighbouring springs, rad.
    pub spacing_rad: f64,
    /// Stiffness k_r of a radial spring, N/m.
    pub radial_n_m: f64,
    /// Stiffness k_ir of an interradial spring, N/m.
    pub interradial_n_m: f64,
}

/// What the ground does to a spring tyre.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpringForce {
    /// Backward or forward force on the wheel, N, forward positive.
    pub longitudinal_n: f64,
    /// Upward force on the wheel, N.
    pub vertical_n: f64,
}

impl RadialSpringTyre {
    /// A tyre whose deflection on flat ground by `deflection_m` gives `load_n`, with a part of the
    /// radial stiffness in the interradial springs.
    #[must_use]
    pub fn calibrated(
        radius_m: f64,
        spacing_rad: f64,
        interradial_part: f64,
        deflection_m: f64,
        load_n: f64,
    ) -> Self {
        let unit = Self {
            radius_m,
            spacing_rad,
            radial_n_m: 1.0,
            interradial_n_m: interradial_part,
        };
        let force = unit.force(radius_m - deflection_m, |_| 0.0).vertical_n;
        let scale = if force > 0.0 { load_n / force } else { 0.0 };
        Self {
            radial_n_m: scale,
            interradial_n_m: scale * interradial_part,
            ..unit
        }
    }

    /// Forces on a wheel whose centre is `axle_height_m` above the datum, over ground whose height
    /// at a distance ahead of the axle is `ground_m`.
    pub fn force(&self, axle_height_m: f64, ground_m: impl Fn(f64) -> f64) -> SpringForce {
        // Springs of the lower half; those beyond it never touch drivable ground.
        let side = (std::f64::consts::FRAC_PI_2 / self.spacing_rad) as i32;
        let deflection = |k: i32| -> f64 {
            let (sin, cos) = math::sin_cos(f64::from(k) * self.spacing_rad);
            self.reach(axle_height_m, sin, cos, &ground_m)
        };
        let mut total = SpringForce::default();
        let (mut before, mut here) = (0.0, deflection(-side));
        for k in -side..=side {
            let after = if k == side { 0.0 } else { deflection(k + 1) };
            if here > 0.0 {
                let pull =
                    self.radial_n_m * here + self.interradial_n_m * (2.0 * here - before - after);
                let (sin, cos) = math::sin_cos(f64::from(k) * self.spacing_rad);
                total.longitudinal_n -= pull * sin;
                total.vertical_n += pull * cos;
            }
            (before, here) = (here, after);
        }
        total
    }

    /// Deflection of the spring along (sin, -cos): how much of its length lies below ground.
    fn reach(&self, height: f64, sin: f64, cos: f64, ground: &impl Fn(f64) -> f64) -> f64 {
        let clearance = |length: f64| height - length * cos - ground(length * sin);
        if clearance(self.radius_m) >= 0.0 {
            return 0.0;
        }
        let (mut free, mut inside) = (0.0, self.radius_m);
        for _ in 0..40 {
            let middle = 0.5 * (free + inside);
            if clearance(middle) >= 0.0 {
                free = middle;
            } else {
                inside = middle;
            }
        }
        self.radius_m - free
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tyre() -> RadialSpringTyre {
        RadialSpringTyre::calibrated(0.3175, 1.0_f64.to_radians(), 0.3, 0.02, 1500.0)
    }

    #[test]
    fn flat_ground_pushes_straight_up_and_is_calibrated() {
        let force = tyre().force(0.2975, |_| 0.0);
        assert!((force.vertical_n - 1500.0).abs() < 1e-6, "{force:?}");
        assert!(force.longitudinal_n.abs() < 1e-9);
        assert_eq!(tyre().force(0.32, |_| 0.0), SpringForce::default());
    }

    #[test]
    fn force_on_a_flat_matches_its_closed_form_without_interradial_springs() {
        // d_i = R - h/cos(theta): sum of k (R - h/cos) cos = k sum (R cos - h).
        let tyre = RadialSpringTyre {
            interradial_n_m: 0.0,
            radial_n_m: 1000.0,
            ..tyre()
        };
        let height: f64 = 0.30;
        let expected: f64 = (-89..=89)
            .map(|k| math::cos(f64::from(k).to_radians()))
            .filter(|cos| 0.3175 * cos > height)
            .map(|cos| 1000.0 * (0.3175 * cos - height))
            .sum();
        let force = tyre.force(height, |_| 0.0).vertical_n;
        assert!((force / expected - 1.0).abs() < 1e-9, "{force} {expected}");
    }

    #[test]
    fn a_step_ahead_pushes_back_and_more_stiffness_between_springs_resists_a_cleat_more() {
        let step = |x: f64| if x > 0.1 { 0.05 } else { 0.0 };
        assert!(tyre().force(0.30, step).longitudinal_n < 0.0);
        let cleat = |x: f64| if x.abs() < 0.01 { 0.02 } else { -1.0 };
        let soft = RadialSpringTyre {
            interradial_n_m: 0.0,
            ..tyre()
        };
        let same = tyre().radial_n_m / soft.radial_n_m;
        assert!((same - 1.0).abs() < 1e-12);
        assert!(tyre().force(0.31, cleat).vertical_n > soft.force(0.31, cleat).vertical_n);
    }
}
