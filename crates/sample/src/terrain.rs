use serde::{Deserialize, Serialize};

use crate::LogTime;

/// The kind of ground below the tyres, by forces alone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Terrain {
    /// Log clock of the instant that the values are for.
    pub time: LogTime,
    /// The class that is named: [`TerrainClass::Unknown`] unless one class is probable enough.
    pub class: TerrainClass,
    /// Probability of each class, by [`TerrainClass::index`].
    pub probability: [f64; TerrainClass::COUNT],
    /// Rolling resistance over load; `NaN` where unknown.
    pub rolling_resistance: f64,
    /// Its standard deviation.
    pub rolling_resistance_sigma: f64,
}

/// A class of ground.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TerrainClass {
    /// Firm and even, much grip.
    Asphalt,
    /// Firm and loose.
    Gravel,
    /// Soft soil that binds.
    Loam,
    /// Soft and loose.
    Sand,
    /// None of these, or too little is known.
    Unknown,
}

impl TerrainClass {
    /// Number of classes.
    pub const COUNT: usize = 5;
    /// All classes.
    pub const ALL: [Self; Self::COUNT] = [
        Self::Asphalt,
        Self::Gravel,
        Self::Loam,
        Self::Sand,
        Self::Unknown,
    ];

    /// Its position in [`Self::ALL`].
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// Its name: `asphalt`, `gravel`, `loam`, `sand` or `unknown`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        ["asphalt", "gravel", "loam", "sand", "unknown"][self.index()]
    }
}
