//! Chassis models: the linear bicycle and the four-wheel model.

pub mod four_wheel;
