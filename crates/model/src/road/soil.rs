//! Soft ground: pressure and sinkage by Bekker, shear by Janosi and Hanamoto, and the stresses below
//! a rigid wheel by Wong and Reece.
//!
//! | quantity | equation |
//! |---|---|
//! | pressure at the sinkage z | p = (k_c/b + k_phi) z^n |
//! | radial stress ahead of its peak | sigma(t) = (k_c/b + k_phi) R^n (cos t - cos t_1)^n |
//! | behind it | the same at the angle t_1 - (t/t_m) (t_1 - t_m) |
//! | angle of the peak | t_m = (c_1 + c_2 s) t_1 |
//! | shear stress | tau = (c + sigma tan phi) (1 - e^(-j/K)) |
//! | shear displacement | j = R [t_1 - t - (1 - s) (sin t_1 - sin t)] |
//!
//! with the angle t from the lowest point of the wheel to the front, the entry angle t_1 of
//! cos t_1 = 1 - z/R, the slip s = 1 - v/(omega R) and the wheel's width b (Wong, Theory of Ground
//! Vehicles, 4th edition, 2008, chapters 2.4 and 2.5; Wong and Reece, Prediction of rigid wheel
//! performance based on the analysis of soil-wheel stresses, J. Terramechanics 4, 1967).
//!
//! The wheel leaves the soil at its lowest point: the soil does not spring back. Slip does not dig
//! the wheel in further than the loss of shear support, lugs and bulldozing are left out.

use std::f64::consts::FRAC_PI_2;

/// A soil.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Soil {
    /// Name in road files.
    pub name: &'static str,
    /// Exponent n of the sinkage.
    pub exponent: f64,
    /// Cohesive modulus of sinkage k_c, N/m^(n+1).
    pub cohesive_modulus: f64,
    /// Frictional modulus of sinkage k_phi, N/m^(n+2).
    pub frictional_modulus: f64,
    /// Cohesion c, Pa.
    pub cohesion_pa: f64,
    /// Angle of internal friction phi, rad.
    pub friction_rad: f64,
    /// Shear deformation modulus K, m.
    pub shear_modulus_m: f64,
}

/// Coefficients c_1 and c_2 of the angle of the greatest radial stress: loose sand (Wong and Reece
/// 1967). Other soils use the same, for want of measurements.
const PEAK: [f64; 2] = [0.18, 0.32];

impl Soil {
    /// The soils of road files: dry sand, sandy loam of 15 % moisture, clayey soil of 38 % moisture
    /// and snow (Wong 2008, table 2.3, the first four as measured by the Land Locomotion Laboratory,
    /// in Thailand and by Harrison; the shear moduli within the ranges of section 2.4: loose sand
    /// 25 mm, firm sandy soil 10 mm, clay 6 mm, fresh snow 25 to 50 mm).
    pub const ALL: [Self; 4] = [
        Self {
            name: "sand",
            exponent: 1.1,
            cohesive_modulus: 0.99e3,
            frictional_modulus: 1528.43e3,
            cohesion_pa: 1.04e3,
            friction_rad: 28.0 * DEGREE,
            shear_modulus_m: 0.025,
        },
        Self {
            name: "loam",
            exponent: 0.7,
            cohesive_modulus: 5.27e3,
            frictional_modulus: 1515.04e3,
            cohesion_pa: 1.72e3,
            friction_rad: 29.0 * DEGREE,
            shear_modulus_m: 0.010,
        },
        Self {
            name: "clay",
            exponent: 0.5,
            cohesive_modulus: 13.19e3,
            frictional_modulus: 692.15e3,
            cohesion_pa: 4.14e3,
            friction_rad: 13.0 * DEGREE,
            shear_modulus_m: 0.006,
        },
        Self {
            name: "snow",
            exponent: 1.6,
            cohesive_modulus: 4.37e3,
            frictional_modulus: 196.72e3,
            cohesion_pa: 1.03e3,
            friction_rad: 19.7 * DEGREE,
            shear_modulus_m: 0.040,
        },
    ];

    /// The soil of this name.
    #[must_use]
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|soil| soil.name == name)
    }

    /// The soil with factors on its moduli of sinkage and its cohesion, and an angle that adds to that of the internal
    /// friction, rad.
    pub(super) fn changed(self, stiffness: f64, cohesion: f64, steeper_rad: f64) -> Self {
        Self {
            cohesive_modulus: stiffness * self.cohesive_modulus,
            frictional_modulus: stiffness * self.frictional_modulus,
            cohesion_pa: cohesion * self.cohesion_pa,
            friction_rad: self.friction_rad + steeper_rad,
            ..self
        }
    }

    /// Stiffness k_c/b + k_phi below a wheel of this width, N/m^(n+2).
    fn stiffness(&self, width_m: f64) -> f64 {
        self.cohesive_modulus / width_m + self.frictional_modulus
    }

    /// What the soil does to a rigid wheel at a sinkage (less than the radius) and a slip from
    /// -1 to 1, driving positive.
    #[must_use]
    pub fn forces(&self, wheel: RigidWheel, sinkage_m: f64, slip: f64) -> SoilForces {
        let entry_rad = math::acos((1.0 - sinkage_m / wheel.radius_m).clamp(0.0, 1.0));
        let peak_rad = (PEAK[0] + PEAK[1] * slip).clamp(0.01, 0.99) * entry_rad;
        let stress = Stress {
            soil: self,
            wheel,
            slip,
            entry_rad,
            peak_rad,
        };
        // Nodes close up at both ends, where the stress begins with a power of n.
        let front = stress.integral(|u| entry_rad - (entry_rad - peak_rad) * u * u);
        let rear = stress.integral(|u| peak_rad * u * u);
        let [along_sigma, down_sigma, along_tau, down_tau, turning] =
            std::array::from_fn(|k| front[k] + rear[k]);
        let area_m2 = wheel.radius_m * wheel.width_m;
        SoilForces {
            load_n: area_m2 * (down_sigma + down_tau),
            thrust_n: area_m2 * along_tau,
            resistance_n: area_m2 * along_sigma,
            torque_n_m: area_m2 * wheel.radius_m * turning,
        }
    }

    /// Load that Bekker's closed form gives for a sinkage z, W = b k (3 - n)/3 sqrt(2 R) z^(n + 1/2)
    /// with k = k_c/b + k_phi, and its derivative, N and N/m.
    pub(super) fn bekker_load(&self, wheel: RigidWheel, sinkage_m: f64) -> [f64; 2] {
        let power = self.exponent + 0.5;
        let factor = wheel.width_m * self.stiffness(wheel.width_m) * (3.0 - self.exponent) / 3.0
            * (2.0 * wheel.radius_m).sqrt();
        let steep = factor * math::powf(sinkage_m, power - 1.0);
        [steep * sinkage_m, power * steep]
    }

    /// Bekker's resistance by compaction, b (k_c/b + k_phi) z^(n + 1)/(n + 1), N.
    pub(super) fn compaction_n(&self, wheel: RigidWheel, sinkage_m: f64) -> f64 {
        let power = self.exponent + 1.0;
        wheel.width_m * self.stiffness(wheel.width_m) * math::powf(sinkage_m, power) / power
    }

    /// Sinkage at which the soil carries a load at a slip, m; none where a wheel that has sunk in by
    /// its radius is not carried yet.
    #[must_use]
    pub fn sinkage_m(&self, wheel: RigidWheel, load_n: f64, slip: f64) -> Option<f64> {
        let carried = |sinkage_m: f64| self.forces(wheel, sinkage_m, slip).load_n >= load_n;
        let (mut low, mut high) = (0.0, wheel.radius_m);
        if !carried(high) {
            return None;
        }
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            if carried(middle) {
                high = middle;
            } else {
                low = middle;
            }
        }
        Some(high)
    }
}

/// Soil on firm ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoftLayer {
    /// The soil.
    pub soil: Soil,
    /// Its thickness, m: a wheel sinks in no deeper.
    pub depth_m: f64,
}

const DEGREE: f64 = FRAC_PI_2 / 90.0;

/// A wheel that does not deform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidWheel {
    /// Radius R, m.
    pub radius_m: f64,
    /// Width b, m.
    pub width_m: f64,
}

/// What soil does to a wheel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoilForces {
    /// Load that is carried, N.
    pub load_n: f64,
    /// Forward part of the shear stresses, N.
    pub thrust_n: f64,
    /// Backward part of the radial stresses, N.
    pub resistance_n: f64,
    /// Torque that the shear stresses need at the wheel, N m.
    pub torque_n_m: f64,
}

impl SoilForces {
    /// What is left to pull, N: thrust less resistance.
    #[must_use]
    pub fn drawbar_pull_n(&self) -> f64 {
        self.thrust_n - self.resistance_n
    }
}

/// Stresses below a wheel.
struct Stress<'a> {
    soil: &'a Soil,
    wheel: RigidWheel,
    slip: f64,
    entry_rad: f64,
    peak_rad: f64,
}

impl Stress<'_> {
    /// Radial and shear stress at an angle, Pa.
    fn at(&self, angle_rad: f64) -> [f64; 2] {
        let Self {
            soil,
            entry_rad,
            peak_rad,
            ..
        } = self;
        let mirrored_rad = if angle_rad >= *peak_rad {
            angle_rad
        } else {
            entry_rad - angle_rad / peak_rad * (entry_rad - peak_rad)
        };
        let sunk = (math::cos(mirrored_rad) - math::cos(*entry_rad)).max(0.0);
        let stiffness = soil.stiffness(self.wheel.width_m);
        let radial = stiffness * math::powf(self.wheel.radius_m * sunk, soil.exponent);
        let sines = math::sin(*entry_rad) - math::sin(angle_rad);
        let displacement_m =
            self.wheel.radius_m * (entry_rad - angle_rad - (1.0 - self.slip) * sines);
        let mobilised = -math::exp_m1(-displacement_m.abs() / soil.shear_modulus_m);
        let strength = soil.cohesion_pa + radial * math::tan(soil.friction_rad);
        [radial, strength * mobilised.copysign(displacement_m)]
    }

    /// Integrals over the angle, whose path is a function of a part from 0 to 1: radial stress along
    /// and down, shear stress along and down, shear stress. Simpson's rule.
    fn integral(&self, angle_rad: impl Fn(f64) -> f64) -> [f64; 5] {
        const PARTS: u32 = 48;
        let step = 1.0 / f64::from(PARTS);
        let mut sums = [0.0; 5];
        for k in 0..=PARTS {
            let u = f64::from(k) * step;
            let angle = angle_rad(u);
            // d(angle)/du of a path a + b u^2.
            let rate = if k == 0 {
                0.0
            } else {
                2.0 * (angle - angle_rad(0.0)) / u
            };
            let simpson = match k {
                0 | PARTS => 1.0,
                k if k % 2 == 1 => 4.0,
                _ => 2.0,
            };
            let [radial, shear] = self.at(angle);
            let (sin, cos) = math::sin_cos(angle);
            let terms = [radial * sin, radial * cos, shear * cos, shear * sin, shear];
            for (sum, term) in sums.iter_mut().zip(terms) {
                *sum += simpson * step / 3.0 * rate.abs() * term;
            }
        }
        sums
    }
}
