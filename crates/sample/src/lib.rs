#![doc = include_str!("../README.md")]
//!
//! # Axes and signs
//!
//! These definitions hold in all crates.
//!
//! - Vehicle axes (ISO 8855): x forward, y left, z up. Earth axes: x east, y north, z up.
//! - By the right-hand rule, roll is positive with the right side down, pitch with the nose down,
//!   and yaw to the left.
//! - Tyre forces are the forces of the ground on the tyre, in the axes that [`ForceFrame`] names
//!   ([`WheelAxes`] converts): the wheel-carrier frame, in which they are reported, and the contact
//!   frame, for friction and loads. A positive slip angle gives a negative lateral force.
//! - Specific force is the quantity that an accelerometer measures: +g along z at rest.
//! - Values are in SI units and radians. Degrees, bytes and counts occur only in `wire` and on
//!   screens.
//! - The order of the wheels is front left, front right, rear left, rear right ([`Wheel::ALL`]).

mod arrival;
mod axes;
pub mod boundary;
mod estimate;
mod innovation;
mod limits;
mod measurement;
mod road;
mod stamp;
mod terrain;
pub mod text;
mod wheel;

pub use arrival::{Arrival, CanFlags, CanFrame, FrameData, LossPlace, Notice, Payload, SourceId};
pub use axes::WheelAxes;
pub use estimate::{
    AxleGrip, Estimate, Event, EventKind, ForceFrame, ForceSource, Health, MessageCount, Motion,
    NextLift, Parameters, Rollover, Severity, SourceHealth, TyreForce,
};
pub use innovation::{InnovationKind, Innovations};
pub use limits::{Limit, LimitedBy, Limits, LimitsUnknown};
pub use measurement::{
    Attitude, ControlSample, CornerSample, Counts, DeviceTime, FixQuality, GnssAttitude,
    GnssPosition, GnssVelocity, GroundSpeedSample, HubAccelerationSample, ImuSample, Measurement,
    Mounting, Sample, Signal, SignalFrame, SteerSample, StrainChannel, WheelSpeedSample,
};
pub use road::{Road, RoadPlane, RoadRoughness, RoadUnknown, road_class};
pub use stamp::{LogTime, NANOS_PER_SECOND};
pub use terrain::{Terrain, TerrainClass};
pub use wheel::{Axle, PerWheel, Side, Wheel};

/// Standard gravity in m/s^2 (3rd CGPM, 1901).
pub const STANDARD_GRAVITY_M_S2: f64 = 9.806_65;
