//! The virtual vehicle from outside.

mod controllers;
mod excerpts;
mod faults;
mod ground;
mod hub;
mod manoeuvres;
mod receivers;
mod roads;
mod rough;
mod sensors;
mod support;
mod truth_files;
mod truth_params;
