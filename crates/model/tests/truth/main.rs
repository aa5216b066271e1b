//! The linkage against runs of an independent multi-body simulator.

mod kinematics;
mod params;
mod run;
mod statics;
