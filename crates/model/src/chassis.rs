//! Chassis models: the linear bicycle and the four-wheel model.

pub mod bicycle;
pub mod four_wheel;
