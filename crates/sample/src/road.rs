use serde::{Deserialize, Serialize};

use crate::{LogTime, PerWheel};

/// The road under the wheels at one instant.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Road {
    /// Log clock of the instant that the values are for.
    pub time: LogTime,
    /// Why nothing of the road is known; `None` where heights and plane are known.
    pub unknown: Option<RoadUnknown>,
    /// Height of the ground below each wheel centre, m, against a reference that follows the ground slowly;
    /// `NaN` where unknown.
    pub height_m: PerWheel<f64>,
    /// Standard deviation of the part of the height above 0.5 Hz, m.
    pub height_sigma_m: PerWheel<f64>,
    /// The plane through the four ground points.
    pub plane: RoadPlane,
    /// Roughness of the road of late; `None` before enough of it has passed.
    pub roughness: Option<RoadRoughness>,
    /// International Roughness Index of the left and of the right track of late, m/km; `NaN` where unknown.
    pub iri_m_km: [f64; 2],
}

impl Road {
    /// A road of which nothing is known.
    #[must_use]
    pub const fn unknown(time: LogTime, why: RoadUnknown) -> Self {
        Self {
            time,
            unknown: Some(why),
            height_m: PerWheel([f64::NAN; 4]),
            height_sigma_m: PerWheel([f64::NAN; 4]),
            plane: RoadPlane::UNKNOWN,
            roughness: None,
            iri_m_km: [f64::NAN; 2],
        }
    }
}

/// The plane through the four ground points (least squares), and how far they are from a plane.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoadPlane {
    /// Right side down positive, rad.
    pub bank_rad: f64,
    /// Its standard deviation, rad.
    pub bank_sigma_rad: f64,
    /// Nose down positive, rad.
    pub grade_rad: f64,
    /// Its standard deviation, rad.
    pub grade_sigma_rad: f64,
    /// Heights front left - front right - rear left + rear right, m.
    pub warp_m: f64,
    /// Its standard deviation, m.
    pub warp_sigma_m: f64,
}

impl RoadPlane {
    /// A plane of which nothing is known.
    pub const UNKNOWN: Self = Self {
        bank_rad: f64::NAN,
        bank_sigma_rad: f64::NAN,
        grade_rad: f64::NAN,
        grade_sigma_rad: f64::NAN,
        warp_m: f64::NAN,
        warp_sigma_m: f64::NAN,
    };
}

/// Roughness of a road by ISO 8608: Gd(n) = Gd(n0) (n/n0)^-2 with n0 = 0.1 cycles/m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoadRoughness {
    /// Gd(n0) from waves of 0.6 to 10 m, m^3.
    pub gd_n0_m3: f64,
    /// Bounds of Gd(n0) that contain the road's with a probability of 0.95, m^3.
    pub bounds_m3: [f64; 2],
    /// Fitted waviness: the negative exponent of Gd(n), 2 for the classes of the standard; `NaN` where only
    /// one band of waves is known.
    pub waviness: f64,
    /// Distance that the value rests on, m: the equivalent of the fading memory.
    pub distance_m: f64,
}

impl RoadRoughness {
    /// Class of the road, `A` to `H`.
    #[must_use]
    pub fn class(&self) -> char {
        road_class(self.gd_n0_m3)
    }

    /// Best and worst class within the bounds.
    #[must_use]
    pub fn class_bounds(&self) -> [char; 2] {
        self.bounds_m3.map(road_class)
    }
}

/// Class of a road with Gd(n0), m^3, by ISO 8608: the upper limit of A is 32e-6 m^3, and each further class
/// is four times as rough.
#[must_use]
pub fn road_class(gd_n0_m3: f64) -> char {
    const CLASSES: [char; 8] = ['A', 'B', 'C', 'D', 'E', 'F', 'G', 'H'];
    let mut limit_m3 = 32e-6;
    for class in CLASSES {
        if gd_n0_m3 <= limit_m3 {
            return class;
        }
        limit_m3 *= 4.0;
    }
    'H'
}

/// Why nothing of the road is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RoadUnknown {
    /// The estimator has not settled since its start.
    Settling,
    /// The vehicle is slower than 2 m/s.
    Slow,
    /// No potentiometer measures the travel of a wheel.
    NoDeflection,
}

impl RoadUnknown {
    /// Its name: `settling`, `slow` or `no_deflection`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Settling => "settling",
            Self::Slow => "slow",
            Self::NoDeflection => "no_deflection",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_geometric_means_of_the_standard_are_in_their_classes() {
        for (k, class) in "ABCDEFGH".chars().enumerate() {
            assert_eq!(road_class(16e-6 * f64::powi(4.0, k as i32)), class);
        }
        assert_eq!(road_class(1.0), 'H');
    }
}
