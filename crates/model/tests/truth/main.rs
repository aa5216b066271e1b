//! The linkage against runs of an independent multi-body simulator.

mod hanging;
mod kinematics;
mod params;
mod run;
mod statics;
