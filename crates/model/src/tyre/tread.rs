//! The overturning moment of a tread that stands on the ground at a camber angle.

use crate::Scalar;
use crate::vehicle;

impl vehicle::Tyre {
    /// How hard a tread of width b rights itself on flat ground, N m, at a load F_z, N, and the
    /// inclination gamma, rad, of the wheel plane from upright: M_x about the contact point is
    /// minus this for a wheel whose top leans right. Zero where the file tells no width.
    ///
    /// The tread is a row of springs, c_z/b each metre of width, pressed by F_z/c_z in its middle
    /// and tilted by gamma. While all of it touches, M = c_z b^2/12 tan gamma. Past
    /// tan gamma b/2 = F_z/c_z a part hangs free, the part w = sqrt(2 F_z b/(c_z tan gamma))
    /// carries, and M = F_z (b/2 - w/3). Odd in gamma.
    #[must_use]
    pub fn tread_moment_n_m(&self, load_n: f64, inclination_rad: f64) -> f64 {
        let stiffness = self.vertical_stiffness_n_m;
        let tilt = math::tan(inclination_rad);
        tread_moment(self.width_m, stiffness, load_n.max(0.0), tilt)
    }

    /// Part w/b of the tread's width that carries load, as above; one where the file tells no width.
    #[must_use]
    pub fn tread_carrying(&self, load_n: f64, inclination_rad: f64) -> f64 {
        let stiffness = self.vertical_stiffness_n_m;
        let tilt = math::tan(inclination_rad).abs();
        tread_carrying(self.width_m, stiffness, load_n.max(0.0), tilt)
    }
}

/// [`vehicle::Tyre::tread_moment_n_m`] of a width, m, and a vertical stiffness, N/m, at a load of
/// zero or more, N, and tan gamma. Both cases are worked out, so that loops over runs become vector
/// code.
#[inline(always)]
pub(crate) fn tread_moment<T: Scalar>(width_m: f64, stiffness_n_m: f64, load_n: T, tilt: T) -> T {
    let size = tilt.magnitude();
    let carrying = tread_carrying(width_m, stiffness_n_m, load_n, size);
    let touching = size * (stiffness_n_m * width_m * width_m / 12.0);
    let partly = load_n * (carrying * (-width_m / 3.0) + 0.5 * width_m);
    let pressed = if carrying < 1.0 { partly } else { touching };
    let moment = if load_n > 0.0 { pressed } else { T::from(0.0) };
    moment * tilt.sign()
}

#[inline(always)]
fn tread_carrying<T: Scalar>(width_m: f64, stiffness_n_m: f64, load_n: T, tilt: T) -> T {
    let pressed_m = load_n * (2.0 / stiffness_n_m);
    let tilted_m = tilt * width_m;
    let part = (pressed_m / tilted_m).sqrt();
    if tilted_m - pressed_m > 0.0 {
        part
    } else {
        T::from(1.0)
    }
}

#[cfg(test)]
mod tests {
    use crate::vehicle::Vehicle;

    #[test]
    fn the_moment_is_the_sum_over_the_springs_that_touch() {
        let mut tyre = Vehicle::builtin("prowler").unwrap().rear.tyre;
        tyre.width_m = 0.25;
        let strips = 20_000;
        for inclination in [0.01_f64, -0.05, 0.12] {
            for press in [0.002, 0.006, 0.02] {
                let (mut load, mut moment) = (0.0, 0.0);
                for i in 0..strips {
                    let y = tyre.width_m * ((f64::from(i) + 0.5) / f64::from(strips) - 0.5);
                    let depth = (press + y * math::tan(inclination)).max(0.0);
                    let force = tyre.vertical_stiffness_n_m * depth / f64::from(strips);
                    load += force;
                    moment += y * force;
                }
                let found = tyre.tread_moment_n_m(load, inclination);
                assert!(
                    (found - moment).abs() < 1e-3 * moment.abs(),
                    "{found} {moment}"
                );
            }
        }
        assert_eq!(tyre.tread_moment_n_m(0.0, 0.1), 0.0);
        tyre.width_m = 0.0;
        assert_eq!(tyre.tread_moment_n_m(1000.0, 0.1), 0.0);
    }
}
