//! Spring, damper and stops along one strut.

use crate::vehicle::Strut;

/// The parts of a strut's force, N. Positive pushes the strut's ends apart.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StrutForce {
    /// Coil: k (l_0 - l).
    pub spring_n: f64,
    /// Damper: -c l'.
    pub damper_n: f64,
    /// Whichever stop touches: negative in droop, positive in bump.
    pub stop_n: f64,
}

impl StrutForce {
    /// The whole force, N.
    #[must_use]
    pub fn total_n(&self) -> f64 {
        self.spring_n + self.damper_n + self.stop_n
    }
}

impl Strut {
    /// Force at length l and rate of length l' (positive lengthens):
    ///
    /// F = k (l_0 - l) - c l' + F_stop
    ///
    /// | symbol | name | unit |
    /// |---|---|---|
    /// | k, l_0 | coil stiffness, free length | N/m, m |
    /// | c | damping in the direction of l' | N s/m |
    /// | F_stop | `-(k_stop x + k_2 x^2 + c_stop x')` past the droop or bump length by x; k_2 of the bump stop only | N |
    ///
    /// A stop pushes only: it does not hold the strut back as it leaves. The thesis's chapter
    /// 2.2.4 takes F = k_s dl without the preload, and "verifies" 2.44 for the lever with it: a
    /// secant through one load that also holds about 2.5 kN of preload.
    #[must_use]
    pub fn force(&self, length_m: f64, rate_m_s: f64) -> StrutForce {
        let droop = length_m - self.droop_stop_length_m;
        let bump = self.bump_stop_length_m - length_m;
        let stop_n = if droop > 0.0 {
            -(self.stop_stiffness_n_m * droop + self.stop_damping_n_s_m * rate_m_s).max(0.0)
        } else if bump > 0.0 {
            (self.bump_stop_n(bump) - self.stop_damping_n_s_m * rate_m_s).max(0.0)
        } else {
            0.0
        };
        StrutForce {
            spring_n: self.stiffness_n_m * (self.free_length_m - length_m),
            damper_n: -self.damping_at(rate_m_s) * rate_m_s,
            stop_n,
        }
    }

    /// Damping at a rate, N s/m: of compression 2 c - c_r, and of extension c_r, if the file has the latter.
    #[must_use]
    pub fn damping_at(&self, rate_m_s: f64) -> f64 {
        match self.rebound_damping_n_s_m {
            None => self.damping_n_s_m,
            Some(rebound) if rate_m_s > 0.0 => rebound,
            Some(rebound) => 2.0 * self.damping_n_s_m - rebound,
        }
    }

    /// Slope -dF/dl of coil and touching stop at a length, N/m.
    #[must_use]
    pub fn stiffness_at(&self, length_m: f64) -> f64 {
        let bump = self.bump_stop_length_m - length_m;
        self.stiffness_n_m
            + if length_m > self.droop_stop_length_m {
                self.stop_stiffness_n_m
            } else if bump > 0.0 {
                self.bump_stop_stiffness(bump)
            } else {
                0.0
            }
    }

    /// Force of the bump stop by the travel into it, N.
    fn bump_stop_n(&self, into_m: f64) -> f64 {
        let linear = (self.bump_stop_stiffness_n_m).unwrap_or(self.stop_stiffness_n_m);
        if self.bump_stop_progression_n_m2 == 0.0 {
            return linear * into_m;
        }
        (linear + self.bump_stop_progression_n_m2 * into_m) * into_m
    }

    /// Slope of the bump stop's force, N/m.
    #[must_use]
    pub fn bump_stop_stiffness(&self, into_m: f64) -> f64 {
        let linear = (self.bump_stop_stiffness_n_m).unwrap_or(self.stop_stiffness_n_m);
        linear + 2.0 * self.bump_stop_progression_n_m2 * into_m
    }

    /// Preload F_0 of the coil in the design position, N.
    #[must_use]
    pub fn design_preload_n(&self) -> f64 {
        self.stiffness_n_m * (self.free_length_m - self.design_length_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STRUT: Strut = Strut {
        stiffness_n_m: 65_000.0,
        free_length_m: 0.394_975,
        design_length_m: 0.353_792,
        damping_n_s_m: 3_500.0,
        rebound_damping_n_s_m: None,
        droop_stop_length_m: 0.388_792,
        bump_stop_length_m: 0.308_792,
        stop_stiffness_n_m: 300_000.0,
        bump_stop_stiffness_n_m: None,
        bump_stop_progression_n_m2: 0.0,
        stop_damping_n_s_m: 2_000.0,
        motion_ratio: None,
    };

    #[test]
    fn parts_add_up_and_stops_only_push() {
        let design = STRUT.force(STRUT.design_length_m, 0.1);
        assert!((design.spring_n - 2_676.895).abs() < 1e-6);
        assert!((design.damper_n + 350.0).abs() < 1e-9);
        assert_eq!(design.stop_n, 0.0);
        assert!((STRUT.design_preload_n() - design.spring_n).abs() < 1e-9);

        let droop = STRUT.force(STRUT.droop_stop_length_m + 0.001, 0.05);
        assert!((droop.stop_n + 400.0).abs() < 1e-6);
        assert_eq!(
            STRUT.force(STRUT.droop_stop_length_m + 0.001, -1.0).stop_n,
            0.0
        );
        let bump = STRUT.force(STRUT.bump_stop_length_m - 0.001, -0.05);
        assert!((bump.stop_n - 400.0).abs() < 1e-6);
    }

    #[test]
    fn a_damper_can_be_stiffer_in_rebound() {
        let strut = Strut {
            damping_n_s_m: 2_400.0,
            rebound_damping_n_s_m: Some(2_900.0),
            ..STRUT
        };
        let damper_n = |rate_m_s| strut.force(strut.design_length_m, rate_m_s).damper_n;
        assert!((damper_n(0.1) + 290.0).abs() < 1e-9);
        assert!((damper_n(-0.1) - 190.0).abs() < 1e-9);
    }

    #[test]
    fn slope_matches_differences() {
        let progressive = Strut {
            bump_stop_stiffness_n_m: Some(70_000.0),
            bump_stop_progression_n_m2: 4e6,
            ..STRUT
        };
        for strut in [&STRUT, &progressive] {
            for length in [0.30, 0.35, 0.3895] {
                let step = 1e-7;
                let slope = (strut.force(length - step, 0.0).total_n()
                    - strut.force(length + step, 0.0).total_n())
                    / (2.0 * step);
                assert!((slope / strut.stiffness_at(length) - 1.0).abs() < 1e-6);
            }
        }
        // 5 mm into the stop: 70 N/mm and 4 N/mm^2.
        let into = progressive.force(progressive.bump_stop_length_m - 0.005, 0.0);
        assert!((into.stop_n - 450.0).abs() < 1e-6, "{into:?}");
    }
}
