//! What a vehicle does: chassis, suspension, tyres, strain chain, steering and vehicle files.

mod error;
mod file;
pub mod sensors;
pub mod suspension;
pub mod truth_params;
pub mod vehicle;

pub use error::Error;
pub use file::{FileErrors, Problem};
