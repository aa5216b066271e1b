//! Calibration of sensors from arrays.

mod corners;
mod motion;

use estimator::calibration::Calibration;
use estimator::calibration::rest::{Rest, Signal};
use estimator::calibration::steer::{PlateReading, steer};
use estimator::calibration::weight::{ScaleReading, weight};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sample::PerWheel;

use crate::errors;
use crate::findings::{column, dict, estimator, refusal, same_length, vectors};
use crate::input::Doubles;
use crate::tables::{to_python, to_toml};
use crate::vehicle::Vehicle;

type Found<'py> = PyResult<Bound<'py, PyDict>>;

/// What a channel says at rest, in its own unit: a dict of `mean`, `mean_sigma`, `noise`,
/// `slope_per_s`, `slope_sigma`, `unsteadiness`, `unmoved`, `saturated`.
#[pyfunction]
#[pyo3(signature = (time_s, value, *, low=f64::NEG_INFINITY, high=f64::INFINITY))]
#[allow(clippy::needless_pass_by_value)]
pub fn calibrate_rest<'py>(
    py: Python<'py>,
    time_s: Doubles<'py>,
    value: Doubles<'py>,
    low: f64,
    high: f64,
) -> Found<'py> {
    let time_s = column("time_s", Some(&time_s))?;
    let value = column("value", Some(&value))?;
    same_length(&[("time_s", time_s.len()), ("value", value.len())])?;
    let signal = Signal {
        time_s: &time_s,
        value: &value,
    };
    let rest = Rest::of(&signal, f64::NEG_INFINITY, f64::INFINITY, [low, high]);
    let rest = rest.ok_or_else(|| {
        errors::data(format!(
            "rest: {} readings; at least 20 known ones are needed",
            value.len()
        ))
    })?;
    let told = PyDict::new(py);
    told.set_item("mean", rest.mean)?;
    told.set_item("mean_sigma", rest.mean_sigma)?;
    told.set_item("noise", rest.noise)?;
    told.set_item("slope_per_s", rest.slope_per_s)?;
    told.set_item("slope_sigma", rest.slope_sigma)?;
    told.set_item("unsteadiness", rest.unsteadiness)?;
    told.set_item("unmoved", rest.unmoved)?;
    told.set_item("saturated", rest.saturated)?;
    Ok(told)
}

/// Steering from turning plates: steering wheel (n,) and left and right front wheel (n, 2), rad.
#[pyfunction]
#[pyo3(signature = (steering_wheel_rad, wheels_rad, *, plate_sigma_rad))]
#[allow(clippy::needless_pass_by_value)]
pub fn calibrate_steer<'py>(
    py: Python<'py>,
    steering_wheel_rad: Doubles<'py>,
    wheels_rad: Doubles<'py>,
    plate_sigma_rad: f64,
) -> Found<'py> {
    let hand = column("steering_wheel_rad", Some(&steering_wheel_rad))?;
    let wheels = vectors::<2>("wheels_rad", &wheels_rad)?;
    same_length(&[
        ("steering_wheel_rad", hand.len()),
        ("wheels_rad", wheels.len()),
    ])?;
    let readings: Vec<PlateReading> = hand
        .into_iter()
        .zip(wheels)
        .map(|(steering_wheel_rad, wheels_rad)| PlateReading {
            sensors_rad: [None; 2],
            steering_wheel_rad,
            wheels_rad,
        })
        .collect();
    let found = steer(&readings, plate_sigma_rad).map_err(|e| refusal(&e))?;
    with_table(py, dict(py, &found.findings)?, &found.calibration)
}

/// Springs from a vehicle on scales under several loads: wheel loads, N, and strut compressions, m,
/// each (n, 4).
#[pyfunction]
#[pyo3(signature = (vehicle, load_n, compression_m, *, known_calibration=None))]
#[allow(clippy::needless_pass_by_value)]
pub fn calibrate_weight<'py>(
    py: Python<'py>,
    vehicle: &Vehicle,
    load_n: Doubles<'py>,
    compression_m: Doubles<'py>,
    known_calibration: Option<&Bound<'py, PyDict>>,
) -> Found<'py> {
    let loads = vectors::<4>("load_n", &load_n)?;
    let compressions = vectors::<4>("compression_m", &compression_m)?;
    same_length(&[
        ("load_n", loads.len()),
        ("compression_m", compressions.len()),
    ])?;
    let readings: Vec<ScaleReading> = loads
        .into_iter()
        .zip(compressions)
        .map(|(load_n, compression_m)| ScaleReading {
            load_n: PerWheel(load_n),
            compression_m: PerWheel(compression_m),
        })
        .collect();
    let known = known(vehicle, known_calibration)?;
    let found = weight(&vehicle.inner, &known, &readings).map_err(|e| estimator(&e))?;
    with_table(py, dict(py, &found.findings)?, &found.calibration)
}

/// The findings with the calibration file's table beside them, as `calibration`.
fn with_table<'py>(
    py: Python<'py>,
    found: Bound<'py, PyDict>,
    table: &impl serde::Serialize,
) -> Found<'py> {
    found.set_item("calibration", self::table(py, table)?)?;
    Ok(found)
}

/// A table of a file as Python's own.
fn table<'py>(py: Python<'py>, table: &impl serde::Serialize) -> PyResult<Bound<'py, PyAny>> {
    let table = toml::Value::try_from(table).map_err(|e| errors::data(e.to_string()))?;
    to_python(py, table)
}

/// What earlier steps found, as their `calibration` says it; nominal where there is none.
fn known(vehicle: &Vehicle, calibration: Option<&Bound<'_, PyDict>>) -> PyResult<Calibration> {
    let Some(calibration) = calibration else {
        return Ok(Calibration::nominal(&vehicle.inner.name));
    };
    let table = to_toml("known_calibration", calibration)?;
    table
        .try_into()
        .map_err(|e: toml::de::Error| errors::argument(format!("known_calibration: {e}")))
}

/// Adds this file's part to the extension module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(calibrate_rest, module)?)?;
    module.add_function(wrap_pyfunction!(calibrate_steer, module)?)?;
    module.add_function(wrap_pyfunction!(calibrate_weight, module)?)?;
    module.add_function(wrap_pyfunction!(corners::calibrate_zero, module)?)?;
    module.add_function(wrap_pyfunction!(corners::calibrate_load_rig, module)?)?;
    module.add_function(wrap_pyfunction!(corners::calibrate_member, module)?)?;
    module.add_function(wrap_pyfunction!(motion::calibrate_imu, module)?)?;
    module.add_function(wrap_pyfunction!(motion::calibrate_gnss, module)?)?;
    module.add_function(wrap_pyfunction!(motion::calibrate_hub, module)?)?;
    module.add_function(wrap_pyfunction!(motion::calibrate_wheel_radius, module)?)
}
