//! Calibration of sensors from arrays.

use estimator::calibration::Calibration;
use estimator::calibration::gnss::Vectors;
use estimator::calibration::imu::ImuSignal;
use estimator::calibration::rest::{Rest, Signal};
use estimator::calibration::steer::{PlateReading, steer};
use estimator::calibration::weight::{ScaleReading, weight};
use estimator::calibration::wheel_radius::{RadiusInput, wheel_radius};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sample::PerWheel;

use crate::errors;
use crate::findings::{column, dict, estimator, refusal, same_length, vectors};
use crate::input::Doubles;
use crate::vehicle::{Vehicle, to_python};

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

/// Steering from turning plates: hand wheel (n,) and left and right front wheel (n, 2), rad.
#[pyfunction]
#[pyo3(signature = (hand_wheel_rad, wheels_rad, *, plate_sigma_rad))]
#[allow(clippy::needless_pass_by_value)]
pub fn calibrate_steer<'py>(
    py: Python<'py>,
    hand_wheel_rad: Doubles<'py>,
    wheels_rad: Doubles<'py>,
    plate_sigma_rad: f64,
) -> Found<'py> {
    let hand = column("hand_wheel_rad", Some(&hand_wheel_rad))?;
    let wheels = vectors::<2>("wheels_rad", &wheels_rad)?;
    same_length(&[("hand_wheel_rad", hand.len()), ("wheels_rad", wheels.len())])?;
    let readings: Vec<PlateReading> = hand
        .into_iter()
        .zip(wheels)
        .map(|(hand_wheel_rad, wheels_rad)| PlateReading {
            hand_wheel_rad,
            wheels_rad,
        })
        .collect();
    let found = steer(&readings, plate_sigma_rad).map_err(|e| refusal(&e))?;
    with_table(py, dict(py, &found.findings)?, &found.calibration)
}

/// Springs from a vehicle on scales under several loads: wheel loads, N, and strut compressions, m,
/// each (n, 4).
#[pyfunction]
#[allow(clippy::needless_pass_by_value)]
pub fn calibrate_weight<'py>(
    py: Python<'py>,
    vehicle: &Vehicle,
    load_n: Doubles<'py>,
    compression_m: Doubles<'py>,
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
    let known = Calibration {
        vehicle: vehicle.inner.name.clone(),
        ..Calibration::default()
    };
    let found = weight(&vehicle.inner, &known, &readings).map_err(|e| estimator(&e))?;
    with_table(py, dict(py, &found.findings)?, &found.calibration)
}

/// Rolling radii from straight, even driving: an antenna's velocity east, north, up, m/s, (n, 3),
/// the inertial unit's specific force and rate, (m, 3), wheel speeds, rad/s, (k, 4).
#[pyfunction]
#[pyo3(signature = (
    velocity_time_s, velocity_m_s, imu_time_s, force_m_s2, rate_rad_s, wheel_time_s, wheel_rad_s,
    *, latency_s=0.0,
))]
#[allow(clippy::too_many_arguments)]
#[allow(clippy::needless_pass_by_value)]
pub fn calibrate_wheel_radius<'py>(
    py: Python<'py>,
    velocity_time_s: Doubles<'py>,
    velocity_m_s: Doubles<'py>,
    imu_time_s: Doubles<'py>,
    force_m_s2: Doubles<'py>,
    rate_rad_s: Doubles<'py>,
    wheel_time_s: Doubles<'py>,
    wheel_rad_s: Doubles<'py>,
    latency_s: f64,
) -> Found<'py> {
    let velocity_s = column("velocity_time_s", Some(&velocity_time_s))?;
    let velocity = vectors::<3>("velocity_m_s", &velocity_m_s)?;
    let imu_s = column("imu_time_s", Some(&imu_time_s))?;
    let force = vectors::<3>("force_m_s2", &force_m_s2)?;
    let rate = vectors::<3>("rate_rad_s", &rate_rad_s)?;
    let wheel_s = column("wheel_time_s", Some(&wheel_time_s))?;
    let wheels = vectors::<4>("wheel_rad_s", &wheel_rad_s)?;
    same_length(&[
        ("velocity_time_s", velocity_s.len()),
        ("velocity_m_s", velocity.len()),
    ])?;
    same_length(&[
        ("imu_time_s", imu_s.len()),
        ("force_m_s2", force.len()),
        ("rate_rad_s", rate.len()),
    ])?;
    same_length(&[
        ("wheel_time_s", wheel_s.len()),
        ("wheel_rad_s", wheels.len()),
    ])?;
    let turning =
        [0, 1, 2, 3].map(|wheel| -> Vec<f64> { wheels.iter().map(|row| row[wheel]).collect() });
    let found = wheel_radius(&RadiusInput {
        velocity: Vectors {
            time_s: &velocity_s,
            value: &velocity,
        },
        latency_s,
        imu: ImuSignal {
            time_s: &imu_s,
            force_m_s2: &force,
            rate_rad_s: &rate,
        },
        wheels_rad_s: turning.each_ref().map(|value| Signal {
            time_s: &wheel_s,
            value,
        }),
    });
    dict(py, &found.map_err(|e| refusal(&e))?.findings)
}

/// The findings with the calibration file's table beside them, as `calibration`.
fn with_table<'py>(
    py: Python<'py>,
    found: Bound<'py, PyDict>,
    table: &impl serde::Serialize,
) -> Found<'py> {
    let table = toml::Value::try_from(table).map_err(|e| errors::data(e.to_string()))?;
    found.set_item("calibration", to_python(py, table)?)?;
    Ok(found)
}

/// Adds this file's part to the extension module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(calibrate_rest, module)?)?;
    module.add_function(wrap_pyfunction!(calibrate_steer, module)?)?;
    module.add_function(wrap_pyfunction!(calibrate_weight, module)?)?;
    module.add_function(wrap_pyfunction!(calibrate_wheel_radius, module)?)
}
