//! What a vehicle does: chassis, suspension, tyres, strain chain, steering and vehicle files.

pub mod sensors;
pub mod vehicle;
