#![doc = include_str!("../README.md")]
//!
//! # Data flow
//!
//! The [`Estimator`] reads no clock. [`Estimator::advance`] sets the log time, and
//! [`Estimator::push`] takes a sample. Each instant of a 100 Hz grid gives an
//! [`Estimate`](sample::Estimate) and events. [`Tuning`] contains all tuned numbers.
//!
//! ```text
//! samples ─► calibration ─► motion (attitude, velocity, sideslip) ─┬─► statics or fusion ─► measured forces
//!                                                                   └─► expected (vehicle model) ─► expected forces
//! ```

pub mod calibration;
pub mod consistency;
mod corners;
mod error;
mod estimator;
mod expected;
mod feedback;
pub mod finding;
pub mod fusion;
mod gaussian;
mod grid;
mod grip;
mod handling;
pub mod identification;
mod inertial_forces;
mod innovation;
mod inputs;
mod kinematics;
mod lift;
mod limits;
pub mod mistakes;
pub mod motion;
pub mod planar;
mod process_noise;
pub mod regression;
pub mod road;
pub mod score;
mod settings;
pub mod simple;
pub mod smoother;
pub mod specification;
mod statics;
mod statistics;
mod steering_column;
mod terrain;
pub mod trace;
pub mod triads;
pub mod tuning;
mod units;
mod waiting;
mod watch;
mod wheel_frame;

pub use {model, sample};

pub use calibration::Calibration;
pub use error::EstimatorError;
pub use estimator::{
    CalibrationChanges, Estimator, FoundMistake, LATENCIES_MAX, LatencyEstimate, LatencyPrior,
    MistakeReport, Output, ParameterErrors, WheelPlacement,
};
pub use grid::GRID_NANOS;
pub use settings::{Input, Method, ModelFriction, Settings};
pub use tuning::Tuning;
pub use units::{Quantity, WrongUnit};
