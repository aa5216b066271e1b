//! Chassis models: the linear bicycle, the four-wheel model and the 14-degree-of-freedom model.

pub mod bicycle;
mod form;
pub mod four_wheel;
pub mod fourteen_dof;
mod slopes;
