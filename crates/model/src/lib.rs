#![doc = include_str!("../README.md")]

pub mod chassis;
mod checks;
mod error;
pub mod file;
pub mod integrate;
pub mod road;
mod scalar;
pub mod sensors;
pub mod simulation;
pub mod steering;
pub mod strain;
pub mod suspension;
mod tolerances;
pub mod tyre;
mod values;
pub mod vehicle;

pub use {nalgebra, sample};

pub use error::Error;
pub use file::FileErrors;
pub use scalar::Scalar;
pub use tolerances::{SensorsTolerances, VehicleTolerances};
pub use values::Values;
