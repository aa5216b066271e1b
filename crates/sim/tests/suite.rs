//! The virtual vehicle from outside.

#[path = "suite/controllers.rs"]
mod controllers;
#[path = "suite/faults.rs"]
mod faults;
#[path = "suite/manoeuvres.rs"]
mod manoeuvres;
#[path = "suite/receivers.rs"]
mod receivers;
#[path = "suite/sensors.rs"]
mod sensors;
#[path = "suite/support.rs"]
mod support;
#[path = "suite/truth_files.rs"]
mod truth_files;
#[path = "suite/truth_params.rs"]
mod truth_params;
