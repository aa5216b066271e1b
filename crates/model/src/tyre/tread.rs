//! The overturning moment of a tread that stands on the ground at a camber angle.

use crate::vehicle;

impl vehicle::Tyre {
    /// How hard a tread of width b rights itself on flat ground, N m, at a load F_z, N, and the
    /// inclination gamma, rad, of the wheel plane from upright: M_x about the contact point is
    /// minus this for a wheel whose top leans right. Zero where the file tells no width.
    ///
    /// The tread is a row of springs, c_z/b each metre of width, pressed by F_z/c_z in its middle
    /// and tilted by gamma. While all of it touches, M = c_z b^2/12 gamma. Past
    /// gamma b/2 = F_z/c_z a part hangs free, the part w = sqrt(2 F_z b/(c_z gamma)) carries, and
    /// M = F_z (b/2 - w/3). Odd in gamma.
    #[must_use]
    pub fn tread_moment_n_m(&self, load_n: f64, inclination_rad: f64) -> f64 {
        let (width, stiffness) = (self.width_m, self.vertical_stiffness_n_m);
        let tilt = inclination_rad.tan().abs();
        if width <= 0.0 || load_n <= 0.0 || tilt == 0.0 {
            return 0.0;
        }
        let size = if 0.5 * tilt * width <= load_n / stiffness {
            stiffness * width * width / 12.0 * tilt
        } else {
            let carrying = (2.0 * load_n * width / (stiffness * tilt)).sqrt();
            load_n * (0.5 * width - carrying / 3.0)
        };
        size * inclination_rad.signum()
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
                    let depth = (press + y * inclination.tan()).max(0.0);
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
