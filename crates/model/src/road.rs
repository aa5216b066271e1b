//! The ground that tyres stand on.

mod contact;

pub use contact::{Ground, GroundContact, Plane};
