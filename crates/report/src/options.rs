//! What a report shows, and in which units.

use std::path::PathBuf;

use crate::picture::Picture;
use crate::stretch::Stretch;
use crate::tiles::TileFile;

/// Settings of a report.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Begin, s from the first message of the log.
    pub from_s: Option<f64>,
    /// End, s from the first message of the log.
    pub to_s: Option<f64>,
    /// Only 5 s around an event (its number from 1, or the name of a kind) or a mark (its text).
    pub around: Option<String>,
    /// Logs of another run, which is drawn beside this one.
    pub against: Vec<PathBuf>,
    /// The runs are compared at the same distance instead of the same time.
    pub by_distance: bool,
    /// Units of the page and of the numbers.
    pub units: Units,
    /// The smoothed estimates of `replay --smooth` instead of the causal ones.
    pub smoothed: bool,
    /// Single samples of all curves, whatever the length of the drive.
    pub full: bool,
    /// Where laps begin and end.
    pub gates: Gates,
    /// The abscissa of the figures is the distance when the page opens.
    pub over_distance: bool,
    /// A picture below the track.
    pub picture: Option<Picture>,
    /// Tiles of a map below the track.
    pub tiles: Option<TileFile>,
    /// Lines with what was not estimated, and why.
    pub limits: Vec<String>,
}

impl Options {
    /// The part of the log that is shown.
    pub(crate) fn stretch(&self) -> Stretch<'_> {
        Stretch {
            from_s: self.from_s,
            to_s: self.to_s,
            around: self.around.as_deref(),
        }
    }
}

/// Where laps begin and end.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Gates {
    /// No laps.
    #[default]
    None,
    /// At the place where the drive began.
    Start,
    /// At these gates.
    At(Vec<Gate>),
}

/// A line across the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gate {
    /// Latitude of its middle, deg.
    pub latitude_deg: f64,
    /// Longitude of its middle, deg.
    pub longitude_deg: f64,
    /// Direction of travel from north over east, deg; `None`: that of the first pass.
    pub heading_deg: Option<f64>,
}

/// A system of units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Units {
    /// N, m/s, m, degrees.
    #[default]
    Si,
    /// kN, km/h, m, degrees.
    Metric,
    /// lbf, mph, ft, degrees.
    Us,
}

/// A physical quantity that has different units in the systems.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Stored in N.
    Force,
    /// Stored in m/s.
    Speed,
    /// Stored in m.
    Length,
    /// Stored in rad.
    Angle,
    /// Stored in rad/s.
    Rate,
    /// Stored in m/s².
    Acceleration,
    /// A number without unit.
    Number,
}

impl Units {
    /// Factor from the stored unit, and the name of the unit.
    #[must_use]
    pub const fn of(self, quantity: Quantity) -> (f64, &'static str) {
        /// Pounds-force in a newton.
        const LBF: f64 = 1.0 / 4.448_221_615_260_5;
        match (quantity, self) {
            (Quantity::Force, Self::Si) => (1.0, "N"),
            (Quantity::Force, Self::Metric) => (1e-3, "kN"),
            (Quantity::Force, Self::Us) => (LBF, "lbf"),
            (Quantity::Speed, Self::Si) => (1.0, "m/s"),
            (Quantity::Speed, Self::Metric) => (3.6, "km/h"),
            (Quantity::Speed, Self::Us) => (3600.0 / 1609.344, "mph"),
            (Quantity::Length, Self::Si | Self::Metric) => (1.0, "m"),
            (Quantity::Length, Self::Us) => (1.0 / 0.3048, "ft"),
            (Quantity::Angle, _) => (180.0 / std::f64::consts::PI, "deg"),
            (Quantity::Rate, _) => (180.0 / std::f64::consts::PI, "deg/s"),
            (Quantity::Acceleration, _) => (1.0, "m/s²"),
            (Quantity::Number, _) => (1.0, "–"),
        }
    }
}
