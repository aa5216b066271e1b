//! What one datum is: stamps, SI payloads, frames and signs.
//!
//! Axes and signs are stated here, once, for the whole project.
//!
//! - Vehicle axes (ISO 8855): x forward, y left, z up. Earth axes: east, north, up.
//! - Roll right side down, pitch nose down and yaw left are positive, as the right-hand rule gives.
//! - Tyre forces are those of the ground on the tyre, in the axes that [`ForceFrame`] names. The
//!   estimator uses the contact frame. A positive slip angle gives a negative lateral force.
//! - Specific force is what an accelerometer reads: +g along z at rest.
//! - SI units and radians. Degrees, bytes and counts live in `wire` and on screens only.
//! - Wheels are ordered front left, front right, rear left, rear right everywhere ([`Wheel::ALL`]).

mod arrival;
pub mod boundary;
mod estimate;
mod innovation;
mod measurement;
mod stamp;
pub mod text;
mod wheel;

pub use arrival::{Arrival, CanFlags, CanFrame, LossPlace, Notice, Payload, SourceId};
pub use estimate::{
    AxleGrip, Estimate, Event, EventKind, ForceFrame, ForceSource, Health, Motion, Parameters,
    Rollover, Severity, SourceHealth, TyreForce,
};
pub use innovation::{InnovationKind, Innovations};
pub use measurement::{
    Attitude, ControlSample, CornerSample, DeviceTime, FixQuality, GnssAttitude, GnssPosition,
    GnssVelocity, GroundSpeedSample, ImuSample, Measurement, Sample, Signal, SignalFrame,
    SteerSample, StrainChannel, WheelSpeedSample,
};
pub use stamp::{LogTime, NANOS_PER_SECOND};
pub use wheel::{Axle, PerWheel, Side, Wheel};

/// Standard gravity in m/s^2 (3rd CGPM, 1901).
pub const STANDARD_GRAVITY_M_S2: f64 = 9.806_65;
