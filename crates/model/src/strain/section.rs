use std::f64::consts::PI;

/// Elastic properties of a material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Name as in Table 3.1.
    pub name: &'static str,
    /// Poisson's ratio nu (equation 3.1).
    pub poisson_ratio: f64,
    /// Young's modulus E (equation 3.2), Pa.
    pub youngs_modulus_pa: f64,
}

/// Table 3.1 of the thesis. The Prowler's frame and arms are of 4130 (Chromoly).
pub const MATERIALS: [Material; 5] = [
    material("Aluminum (2024-T4)", 0.32, 73.0e9),
    material("Aluminum (6061)", 0.32, 71.7e9),
    material("Steel - 1018", 0.285, 206.8e9),
    material("Steel - 4130", 0.28, 190.0e9),
    material("Steel - 304 SS", 0.25, 193.0e9),
];

const fn material(name: &'static str, poisson_ratio: f64, youngs_modulus_pa: f64) -> Material {
    Material {
        name,
        poisson_ratio,
        youngs_modulus_pa,
    }
}

impl Material {
    /// The material of Table 3.1 whose name holds `text`, such as `4130`.
    #[must_use]
    pub fn find(text: &str) -> Option<Self> {
        MATERIALS.into_iter().find(|m| m.name.contains(text))
    }

    /// Strain under a stress, equation 3.2.
    #[must_use]
    pub fn strain(&self, stress_pa: f64) -> f64 {
        stress_pa / self.youngs_modulus_pa
    }
}

/// Cross-section of a member.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Section {
    /// Round tube.
    Tube {
        /// Outer diameter, m.
        outer_diameter_m: f64,
        /// Wall, m.
        wall_m: f64,
    },
    /// Round bar.
    Bar {
        /// Diameter, m.
        diameter_m: f64,
    },
    /// Flat bar, bent about its wide side.
    Flat {
        /// Width, m.
        width_m: f64,
        /// Height in the bending direction, m.
        height_m: f64,
    },
}

impl Section {
    /// Area A, m^2.
    #[must_use]
    pub fn area_m2(&self) -> f64 {
        match *self {
            Self::Tube {
                outer_diameter_m,
                wall_m,
            } => PI * wall_m * (outer_diameter_m - wall_m),
            Self::Bar { diameter_m } => PI / 4.0 * diameter_m.powi(2),
            Self::Flat { width_m, height_m } => width_m * height_m,
        }
    }

    /// Second moment of area I about the bending axis, m^4.
    #[must_use]
    pub fn second_moment_m4(&self) -> f64 {
        match *self {
            Self::Tube {
                outer_diameter_m,
                wall_m,
            } => {
                let inner = outer_diameter_m - 2.0 * wall_m;
                PI / 64.0 * (outer_diameter_m.powi(4) - inner.powi(4))
            }
            Self::Bar { diameter_m } => PI / 64.0 * diameter_m.powi(4),
            Self::Flat { width_m, height_m } => width_m * height_m.powi(3) / 12.0,
        }
    }

    /// Section modulus Z = I over the distance of the outer fibre, m^3.
    #[must_use]
    pub fn section_modulus_m3(&self) -> f64 {
        let half = 0.5
            * match *self {
                Self::Tube {
                    outer_diameter_m, ..
                } => outer_diameter_m,
                Self::Bar { diameter_m } => diameter_m,
                Self::Flat { height_m, .. } => height_m,
            };
        self.second_moment_m4() / half
    }

    /// Axial strain under a tension, equation 3.4: F/(E A).
    #[must_use]
    pub fn axial_strain(&self, material: &Material, tension_n: f64) -> f64 {
        tension_n / (material.youngs_modulus_pa * self.area_m2())
    }

    /// Strain of the outer fibre under a bending moment: M/(E Z).
    #[must_use]
    pub fn bending_strain(&self, material: &Material, moment_n_m: f64) -> f64 {
        moment_n_m / (material.youngs_modulus_pa * self.section_modulus_m3())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strain_at_the_thesis_stress() {
        // Section 3.3 prints 10 microstrain for 180 to 200 MPa.
        let steel = Material::find("4130").expect("in Table 3.1");
        assert!((steel.strain(180e6) * 1e6 - 947.4).abs() < 0.1);
        assert!((steel.strain(200e6) * 1e6 - 1052.6).abs() < 0.1);
    }

    #[test]
    fn a_tube_is_a_bar_less_a_bar() {
        let (outer_diameter_m, wall_m) = (0.0254, 0.00165);
        let tube = Section::Tube {
            outer_diameter_m,
            wall_m,
        };
        let bar = |diameter_m| Section::Bar { diameter_m };
        let inner = outer_diameter_m - 2.0 * wall_m;
        let area = bar(outer_diameter_m).area_m2() - bar(inner).area_m2();
        assert!((tube.area_m2() / area - 1.0).abs() < 1e-12);
        let second = bar(outer_diameter_m).second_moment_m4() - bar(inner).second_moment_m4();
        assert!((tube.second_moment_m4() / second - 1.0).abs() < 1e-12);
        let steel = Material::find("4130").expect("in Table 3.1");
        // 0.35 to 2 kN in a leg are 15 to 86 microstrain.
        assert!((tube.axial_strain(&steel, 350.0) * 1e6 - 15.0).abs() < 0.1);
        assert!((tube.axial_strain(&steel, 2000.0) * 1e6 - 85.5).abs() < 0.5);
        let flat = Section::Flat {
            width_m: 0.03,
            height_m: 0.01,
        };
        assert!((flat.bending_strain(&steel, 10.0) - 10.0 * 6.0 / (190e9 * 3e-6)).abs() < 1e-12);
    }
}
