//! The Python package `atvrec`: thin wrappers of the model, the estimator and logs.
//!
//! This is its extension module `atvrec._atvrec`; what Python users see is in `python/atvrec`.

mod arrays;
mod batch;
mod bicycle;
mod calibrate;
mod calibration;
mod chassis;
mod errors;
mod estimates;
mod estimation;
mod files;
mod findings;
mod four_wheel;
mod fourteen_dof;
mod identify;
mod input;
mod interrupt;
mod log;
mod origin;
#[cfg(target_os = "linux")]
mod program;
mod replay;
mod samples;
mod sensors;
mod steering;
mod strain;
mod suspension;
mod tables;
mod tuning;
mod tyre;
mod vehicle;

use pyo3::prelude::*;

/// Extension module of the package atvrec.
#[pymodule(gil_used = false)]
fn _atvrec(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    errors::register(module)?;
    identify::register(module)?;
    calibrate::register(module)?;
    module.add_class::<log::LogReader>()?;
    module.add_class::<vehicle::Vehicle>()?;
    module.add_class::<sensors::Sensors>()?;
    module.add_class::<calibration::Calibration>()?;
    module.add_class::<tuning::Tuning>()?;
    module.add_class::<estimation::SampleEstimator>()?;
    module.add_class::<tyre::Tyre>()?;
    module.add_class::<tyre::SpringTyre>()?;
    module.add_class::<steering::Steering>()?;
    module.add_class::<bicycle::Bicycle>()?;
    module.add_class::<four_wheel::FourWheel>()?;
    module.add_class::<fourteen_dof::FourteenDof>()?;
    module.add_class::<suspension::Ride>()?;
    module.add_class::<suspension::Corner>()?;
    module.add_class::<strain::StrainChannel>()?;
    module.add_function(wrap_pyfunction!(log::rainflow, module)?)?;
    #[cfg(target_os = "linux")]
    module.add_function(wrap_pyfunction!(program::run_program, module)?)?;
    module.add_function(wrap_pyfunction!(replay::replay_log, module)?)?;
    module.add_function(wrap_pyfunction!(replay::simulate_log, module)?)?;
    module.add_function(wrap_pyfunction!(replay::manoeuvres, module)?)?;
    module.add_function(wrap_pyfunction!(origin::restore, module)?)?;
    module.add_function(wrap_pyfunction!(suspension::road_height_m, module)?)?;
    module.add_function(wrap_pyfunction!(steering::ackermann_rad, module)?)?;
    module.add_function(wrap_pyfunction!(strain::amplifier_gain, module)?)?;
    module.add_function(wrap_pyfunction!(strain::strain_circuits, module)?)
}
