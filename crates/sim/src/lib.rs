//! The virtual vehicle: a motion as each sensor's own bytes.
//!
//! ```text
//! Motion::open(truth file) ───────┐
//!                                 ├─► VirtualVehicle ─► Emission, Emission, …  (bytes, CAN frames)
//! Manoeuvre::drive(vehicle file) ─┘                 └─► truth_at(time)
//! ```
//!
//! Nothing here opens a port or reads a clock: time is seconds since the motion's start. The same
//! motion, vehicle, sensors, options and seed give the same bytes. Each sensor draws from its own
//! random stream, so that a change of one sensor leaves the others' bytes as they were.

mod can_bus;
mod controllers;
mod corner;
mod driver;
mod emission;
mod encode;
mod error;
mod faults;
mod gnss;
mod hidden;
mod imu;
mod jackstand;
mod linkage;
mod manoeuvre;
mod motion;
mod options;
mod random;
mod serial_line;
mod slope;
mod truth;
mod truth_params;
mod virtual_vehicle;
mod workshop;

pub use emission::{Emission, Output, Port};
pub use error::SimError;
pub use faults::{
    Chance, ChannelFault, ChannelFaultKind, Faults, ImuFault, ImuFaultKind, Interruption,
};
pub use hidden::{Hidden, HiddenErrors};
pub use manoeuvre::Manoeuvre;
pub use motion::{Motion, TruthState, WheelTruth};
pub use options::{GpsStart, Options, Origin, SeptentrioBlocks};
pub use truth::{Columns, optional_columns, read_columns, required_columns};
pub use truth_params::{TruthParamsError, vehicle_from_truth_params};
pub use virtual_vehicle::VirtualVehicle;
pub use workshop::RIG_N;
