//! What the vehicle did: forces, motion, events, calibration and identification from samples.
//!
//! The [`Estimator`] is a deterministic machine without a clock: [`Estimator::advance`] tells it
//! how far the log clock has come, [`Estimator::push`] gives it a sample, and at each instant of a
//! 100 Hz grid it hands out an [`Estimate`](sample::Estimate) and the events that it declares.
//! The same calls in the same order give the same bits.
//!
//! ```text
//! samples ─► calibration ─► motion (attitude, velocity, sideslip) ─┬─► statics or fusion ─► measured forces
//!                                                                   └─► expected (vehicle model) ─► expected forces
//! ```

pub mod calibration;
pub mod consistency;
pub mod corners;
mod error;
mod estimator;
pub mod expected;
pub mod feedback;
pub mod finding;
pub mod fusion;
pub mod gaussian;
mod grid;
pub mod grip;
mod handling;
pub mod identification;
mod innovation;
pub mod inputs;
mod kinematics;
pub mod lift;
pub mod motion;
pub mod planar;
mod process_noise;
pub mod regression;
pub mod score;
mod settings;
pub mod smoother;
pub mod statics;
mod steering_column;
pub mod trace;
pub mod triads;
pub mod tuning;
mod waiting;
pub mod watch;

pub use calibration::Calibration;
pub use error::EstimatorError;
pub use estimator::{Estimator, Output};
pub use grid::GRID_NANOS;
pub use settings::{Input, Method, Settings};
pub use tuning::Tuning;
