//! Chassis models: the linear bicycle, the four-wheel model, the 14-degree-of-freedom model, and
//! the 14-degree-of-freedom model on its linkages for rough ground.

pub mod bicycle;
mod form;
pub mod four_wheel;
pub mod fourteen_dof;
pub mod linked;
mod slopes;
