//! Suspension: double-wishbone kinematics and statics from hard-points, strut, and the quarter,
//! half and full car.
//!
//! Everything geometric stands in *vehicle axes*: x forward, y left, z up, origin on the design
//! ground plane below the whole vehicle's centre of gravity, fixed to the sprung body.

mod beams;
pub mod curves;
pub mod full;
mod gauges;
pub mod ground;
pub mod half;
pub mod hanging;
pub mod linkage;
pub mod live_axle;
pub mod motion;
pub mod parity;
pub mod quarter;
pub mod ride;
pub mod statics;
pub mod straight;
pub mod strut;
pub mod wishbone;

pub use beams::{MemberBeam, beams};
pub use curves::JouncePoint;
pub use full::FullCar;
pub use gauges::{Gauge, GaugeError, GaugeLoad, GaugeTable, gauges};
pub use ground::{GroundPlane, TyreFrame, ground_plane};
pub use half::HalfCar;
pub use hanging::Hanging;
pub use linkage::{Coordinates, Linkage, PointPath};
pub use live_axle::{
    AxleLine, LinkedAxle, LiveAxleAtRest, LiveAxleMembers, LiveAxleMotion, LiveAxlePose,
    LiveAxleStatics,
};
pub use motion::{BodyMotion, CornerMotion};
pub use parity::{Parity, WrenchEstimate};
pub use quarter::{QuarterCar, lever_motion_ratio, motion_ratio, vertical_force_n, wheel_rate_n_m};
pub use ride::{Ride, RideCorner, frequency_and_damping};
pub use statics::{ChannelKind, CornerStatics, MemberForces, Wrench, inboard_excess_n};
pub use straight::StraightPath;
pub use strut::StrutForce;
pub use wishbone::{Corner, CornerPath, CornerPose, CornerRates, HardPoints, Twist, WheelPath};

/// Why a suspension could not be built or posed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SuspensionError {
    /// The vehicle file lacks a table that the operation needs.
    #[error("{axle}.{table} is missing from the vehicle file; add it to use the linkage")]
    Missing {
        /// `front` or `rear`.
        axle: &'static str,
        /// The absent table.
        table: &'static str,
    },
    /// Two hard-points coincide, or three that must span a plane stand on one line.
    #[error("hard-points are degenerate: {what}; correct their coordinates")]
    Degenerate {
        /// Which points, and how.
        what: &'static str,
    },
    /// No position of the linkage has this value.
    #[error("{what} = {value} {unit} is out of the linkage's reach")]
    OutOfReach {
        /// The argument.
        what: &'static str,
        /// Its value.
        value: f64,
        /// Its unit.
        unit: &'static str,
    },
    /// An argument is not a finite number, or outside its range.
    #[error("{what} = {value} {unit} is not valid; expected {expected}")]
    Invalid {
        /// The argument.
        what: &'static str,
        /// Its value.
        value: f64,
        /// Its unit.
        unit: &'static str,
        /// What would be valid.
        expected: &'static str,
    },
}

/// Fails with the argument's name unless `value` is finite.
pub(crate) fn finite(
    what: &'static str,
    value: f64,
    unit: &'static str,
) -> Result<f64, SuspensionError> {
    if value.is_finite() {
        Ok(value)
    } else {
        Err(SuspensionError::Invalid {
            what,
            value,
            unit,
            expected: "a finite number",
        })
    }
}
