//! The linkage against runs of an independent multi-body simulator.

mod hanging;
mod instant;
mod kinematics;
mod run;
mod statics;
