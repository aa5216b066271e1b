#![doc = include_str!("../README.md")]
//!
//! # Data flow
//!
//! ```text
//! Motion::open(truth file) ───────┐
//!                                 ├─► VirtualVehicle ─► Emission, Emission, …  (bytes, CAN frames)
//! Manoeuvre::drive(vehicle file) ─┘                 └─► truth_at(time)
//! ```
//!
//! The crate opens no port and reads no clock. Time is in seconds since the start of the motion. Each
//! sensor has its own random stream, so that a change of one sensor does not change the bytes of the
//! other sensors.

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
mod hub;
mod imu;
mod jackstand;
mod linkage;
mod load;
mod manoeuvre;
mod motion;
mod options;
mod random;
mod serial_line;
mod slope;
mod steering;
mod truth;
mod truth_params;
mod tyre_pressure;
mod virtual_vehicle;
mod wheel_angles;
mod workshop;

pub use {model, sample};

pub use can_bus::frame_latencies_s;
pub use driver::rough::{Course, Hitch, Profile, RoughPlan, drive_rough};
pub use emission::{Emission, Output, Port};
pub use error::SimError;
pub use faults::{
    Chance, ChannelFault, ChannelFaultKind, Faults, HubAxisFault, HubAxisFaultKind, HubFault,
    ImuFault, ImuFaultKind, Interruption,
};
pub use hidden::{Hidden, HiddenErrors};
pub use load::{PortLoad, port_loads};
pub use manoeuvre::Manoeuvre;
pub use motion::{Motion, TruthState, WheelGround, WheelMotion, WheelTruth};
pub use options::{GpsStart, InertialUnit, Options, Origin, SeptentrioBlocks, VelocityReceiver};
pub use truth::{Columns, optional_columns, read_columns, required_columns};
pub use truth_params::{TruthParamsError, vehicle_from_truth_params};
pub use virtual_vehicle::VirtualVehicle;
pub use workshop::RIG_N;
