//! The linkage against runs of an independent multi-body simulator.

mod hanging;
mod instant;
mod kinematics;
mod live_axle;
mod rough;
mod run;
mod statics;
mod strut;
