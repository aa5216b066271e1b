use serde::{Deserialize, Serialize};

use crate::LogTime;

/// How much further the vehicle can go on the ground of the last seconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limits {
    /// Log clock of the instant that the values are for.
    pub time: LogTime,
    /// Why the limits themselves are not known; `None` where they are. Their lower bounds may be known
    /// nevertheless.
    pub unknown: Option<LimitsUnknown>,
    /// Largest part of the grip that was used in the last 10 s, of the axle that used more: utilisation of the
    /// estimated friction, or of that of the vehicle file.
    pub grip_used: f64,
    /// What ends a turn first.
    pub limited_by: LimitedBy,
    /// Lateral acceleration still available to the side to which the tyres push, m/s^2.
    pub lateral_m_s2: Limit,
    /// Largest steady speed in the present curvature, m/s; unknown on a straight way.
    pub speed_m_s: Limit,
    /// Radius of the curve that [`Self::curve_speed_m_s`] is for, m; `NaN` where none is set.
    pub curve_radius_m: f64,
    /// Largest steady speed in this curve to either side on the present bank, m/s.
    pub curve_speed_m_s: Limit,
    /// Steepest side slope along which the vehicle can drive straight on, rad.
    pub side_slope_rad: Limit,
    /// Steepest grade that the driven wheels can climb, rad.
    pub grade_rad: Limit,
}

impl Limits {
    /// Limits of which nothing is known.
    #[must_use]
    pub const fn unknown(time: LogTime, why: LimitsUnknown) -> Self {
        Self {
            time,
            unknown: Some(why),
            grip_used: f64::NAN,
            limited_by: LimitedBy::Unknown,
            lateral_m_s2: Limit::UNKNOWN,
            speed_m_s: Limit::UNKNOWN,
            curve_radius_m: f64::NAN,
            curve_speed_m_s: Limit::UNKNOWN,
            side_slope_rad: Limit::UNKNOWN,
            grade_rad: Limit::UNKNOWN,
        }
    }

    /// Why the limits are not known, for people; `None` where they are.
    #[must_use]
    pub fn reason(&self) -> Option<String> {
        Some(match self.unknown? {
            LimitsUnknown::Settling => "the estimator has not settled since its start".to_owned(),
            LimitsUnknown::NoForces => "no sensors measure the forces of the tyres".to_owned(),
            LimitsUnknown::Grip => format!(
                "no more than {:.1} of the grip has been used",
                // Rounded up: the statement must hold.
                (10.0 * self.grip_used).ceil() / 10.0
            ),
        })
    }
}

/// A limit and its lower bound.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limit {
    /// The estimate; `NaN` where unknown.
    pub value: f64,
    /// The limit is at least this with a probability of 0.95; `NaN` where unknown.
    pub at_least: f64,
}

impl Limit {
    /// A limit of which nothing is known.
    pub const UNKNOWN: Self = Self {
        value: f64::NAN,
        at_least: f64::NAN,
    };

    /// A function of this limit that rises with it.
    #[must_use]
    pub fn map(self, rising: impl Fn(f64) -> f64) -> Self {
        Self {
            value: rising(self.value),
            at_least: rising(self.at_least),
        }
    }
}

/// What ends a turn first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LimitedBy {
    /// Not known.
    #[default]
    Unknown,
    /// Grip of the front axle: the vehicle runs wide.
    FrontGrip,
    /// Grip of the rear axle: the vehicle spins.
    RearGrip,
    /// Both wheels of the inner side lift.
    Rollover,
}

impl LimitedBy {
    /// Its name: `unknown`, `front_grip`, `rear_grip` or `rollover`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Unknown => "unknown",
            Self::FrontGrip => "front_grip",
            Self::RearGrip => "rear_grip",
            Self::Rollover => "rollover",
        }
    }
}

/// Why limits are not known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LimitsUnknown {
    /// The estimator has not settled since its start.
    Settling,
    /// No sensors measure the forces of the tyres.
    NoForces,
    /// Too little of the grip has been used in the last seconds to see where it ends.
    Grip,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reason_tells_how_much_of_the_grip_was_used() {
        let mut limits = Limits::unknown(LogTime(1), LimitsUnknown::Grip);
        limits.grip_used = 0.24;
        let reason = limits.reason();
        assert_eq!(
            reason.as_deref(),
            Some("no more than 0.3 of the grip has been used")
        );
        limits.unknown = None;
        assert_eq!(limits.reason(), None);
    }
}
