//! Identification of vehicle parameters from arrays.

use estimator::identification::{
    self, cornering, friction, inertia, response, roll_centre, roll_pitch, tyre, understeer,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sample::PerWheel;

use crate::errors;
use crate::findings::{column, dict, refusal, vectors};
use crate::input::Doubles;
use crate::vehicle::Vehicle;

type Found<'py> = PyResult<Bound<'py, PyDict>>;

/// A drive on an even time grid, all columns (n,), NaN where unknown; what was not measured is left
/// out. Accelerations are horizontal, of the centre of gravity; the steer angle is the mean of the
/// front road wheels; wheel loads are (n, 4).
#[pyclass(frozen, module = "atvrec.identify")]
pub struct Drive {
    inner: identification::Drive,
}

#[pymethods]
impl Drive {
    #[new]
    #[pyo3(signature = (
        dt_s, *, speed_m_s=None, sideslip_rad=None, yaw_rate_rad_s=None, lateral_m_s2=None,
        longitudinal_m_s2=None, steer_rad=None, roll_rad=None, pitch_rad=None, load_n=None,
    ))]
    #[allow(clippy::too_many_arguments)]
    #[allow(clippy::needless_pass_by_value)]
    fn new(
        dt_s: f64,
        speed_m_s: Option<Doubles<'_>>,
        sideslip_rad: Option<Doubles<'_>>,
        yaw_rate_rad_s: Option<Doubles<'_>>,
        lateral_m_s2: Option<Doubles<'_>>,
        longitudinal_m_s2: Option<Doubles<'_>>,
        steer_rad: Option<Doubles<'_>>,
        roll_rad: Option<Doubles<'_>>,
        pitch_rad: Option<Doubles<'_>>,
        load_n: Option<Doubles<'_>>,
    ) -> PyResult<Self> {
        let loads_n = load_n.map_or_else(|| Ok(Vec::new()), |n| vectors::<4>("load_n", &n))?;
        let inner = identification::Drive {
            dt_s,
            speed_m_s: column("speed_m_s", speed_m_s.as_ref())?,
            sideslip_rad: column("sideslip_rad", sideslip_rad.as_ref())?,
            yaw_rate_rad_s: column("yaw_rate_rad_s", yaw_rate_rad_s.as_ref())?,
            lateral_m_s2: column("lateral_m_s2", lateral_m_s2.as_ref())?,
            longitudinal_m_s2: column("longitudinal_m_s2", longitudinal_m_s2.as_ref())?,
            steer_rad: column("steer_rad", steer_rad.as_ref())?,
            roll_rad: column("roll_rad", roll_rad.as_ref())?,
            pitch_rad: column("pitch_rad", pitch_rad.as_ref())?,
            loads_n: PerWheel(
                [0, 1, 2, 3].map(|wheel| loads_n.iter().map(|row| row[wheel]).collect()),
            ),
        };
        inner
            .require("drive", &[])
            .map_err(|e| errors::argument(e.to_string()))?;
        Ok(Self { inner })
    }

    /// Interval of the grid, s.
    #[getter]
    fn dt_s(&self) -> f64 {
        self.inner.dt_s
    }

    fn __len__(&self) -> usize {
        self.inner.rows()
    }
}

/// Cornering stiffness of both axles, offsets of steer and sideslip angle. With wheel loads the
/// tyres' trail and the wheels' spin count.
#[pyfunction]
#[pyo3(signature = (drive, vehicle, *, lateral_max_m_s2=2.5, seed=1))]
pub fn identify_cornering<'py>(
    py: Python<'py>,
    drive: &Drive,
    vehicle: &Vehicle,
    lateral_max_m_s2: f64,
    seed: u64,
) -> Found<'py> {
    let options = cornering::Options {
        lateral_max_m_s2,
        seed,
        ..cornering::Options::default()
    };
    let found = py.detach(|| cornering::of_vehicle(&drive.inner, &vehicle.inner, &options));
    dict(py, &found.map_err(|e| refusal(&e))?)
}

/// Understeer, sideslip and roll gradient of a circle of constant radius.
#[pyfunction]
#[pyo3(signature = (drive, vehicle, *, seed=1))]
pub fn identify_understeer<'py>(
    py: Python<'py>,
    drive: &Drive,
    vehicle: &Vehicle,
    seed: u64,
) -> Found<'py> {
    let body = understeer::Body::of(&vehicle.inner);
    let options = understeer::Options {
        seed,
        ..understeer::Options::default()
    };
    let found = py.detach(|| understeer::identify(&drive.inner, &body, &options));
    dict(py, &found.map_err(|e| refusal(&e))?)
}

/// Roll and pitch stiffness and damping; wheel loads tell the axles' shares.
#[pyfunction]
#[pyo3(signature = (drive, vehicle, *, seed=1))]
pub fn identify_roll_pitch<'py>(
    py: Python<'py>,
    drive: &Drive,
    vehicle: &Vehicle,
    seed: u64,
) -> Found<'py> {
    let body = roll_pitch::Body::of(&roll_centre::of_linkage(&vehicle.inner));
    let options = roll_pitch::Options {
        seed,
        ..roll_pitch::Options::default()
    };
    let found = py.detach(|| roll_pitch::identify(&drive.inner, &body, &options));
    dict(py, &found.map_err(|e| refusal(&e))?)
}

/// Response to steps of the steer angle of at least `step_min_rad`.
#[pyfunction]
#[pyo3(signature = (drive, *, step_min_rad=0.02))]
pub fn identify_step_response<'py>(
    py: Python<'py>,
    drive: &Drive,
    step_min_rad: f64,
) -> Found<'py> {
    let found = py.detach(|| response::step(&drive.inner, step_min_rad));
    dict(py, &found.map_err(|e| refusal(&e))?)
}

/// Frequency response of the yaw rate to the steer angle, and a second-order system in it.
#[pyfunction]
#[pyo3(signature = (drive, *, window_s=10.0, seed=1))]
pub fn identify_frequency_response<'py>(
    py: Python<'py>,
    drive: &Drive,
    window_s: f64,
    seed: u64,
) -> Found<'py> {
    let found = py.detach(|| response::frequency(&drive.inner, window_s, seed));
    dict(py, &found.map_err(|e| refusal(&e))?)
}

/// A tyre model's parameters from load, slip angle and lateral force in the wheel's frame, (n,).
#[pyfunction]
#[pyo3(signature = (
    kind, load_n, slip_angle_rad, lateral_n, *, dt_s, reference_load_n, load_exponent=1.0,
    friction=0.9, seed=1,
))]
#[allow(clippy::too_many_arguments)]
#[allow(clippy::needless_pass_by_value)]
pub fn identify_tyre<'py>(
    py: Python<'py>,
    kind: &str,
    load_n: Doubles<'py>,
    slip_angle_rad: Doubles<'py>,
    lateral_n: Doubles<'py>,
    dt_s: f64,
    reference_load_n: f64,
    load_exponent: f64,
    friction: f64,
    seed: u64,
) -> Found<'py> {
    let known = tyre::Kind::ALL.map(tyre::Kind::name);
    let position = known.iter().position(|name| *name == kind);
    let Some(kind) = position.map(|index| tyre::Kind::ALL[index]) else {
        return Err(errors::argument(format!(
            "kind = {kind:?}: must be one of {}",
            known.join(", ")
        )));
    };
    let data = tyre_data(dt_s, &load_n, &slip_angle_rad, &lateral_n)?;
    let held = [load_exponent, friction];
    let found = py.detach(|| tyre::fit(&data, kind, reference_load_n, held, seed));
    dict(py, &found.map_err(|e| refusal(&e))?.0)
}

/// Coefficient of friction, by Fiala's tyre.
#[pyfunction]
#[pyo3(signature = (
    load_n, slip_angle_rad, lateral_n, *, dt_s, reference_load_n, load_exponent=1.0, seed=1,
))]
#[allow(clippy::too_many_arguments)]
#[allow(clippy::needless_pass_by_value)]
pub fn identify_friction<'py>(
    py: Python<'py>,
    load_n: Doubles<'py>,
    slip_angle_rad: Doubles<'py>,
    lateral_n: Doubles<'py>,
    dt_s: f64,
    reference_load_n: f64,
    load_exponent: f64,
    seed: u64,
) -> Found<'py> {
    let data = tyre_data(dt_s, &load_n, &slip_angle_rad, &lateral_n)?;
    let found = py.detach(|| friction::identify(&data, reference_load_n, load_exponent, seed));
    dict(py, &found.map_err(|e| refusal(&e))?)
}

fn tyre_data(
    dt_s: f64,
    load_n: &Doubles<'_>,
    slip_angle_rad: &Doubles<'_>,
    lateral_n: &Doubles<'_>,
) -> PyResult<tyre::Data> {
    Ok(tyre::Data {
        dt_s,
        load_n: column("load_n", Some(load_n))?,
        slip_angle_rad: column("slip_angle_rad", Some(slip_angle_rad))?,
        lateral_n: column("lateral_n", Some(lateral_n))?,
    })
}

/// Yaw inertia from the tyre forces' yaw moment, N m, and the yaw rate, (n,).
#[pyfunction]
#[pyo3(signature = (moment_n_m, yaw_rate_rad_s, *, dt_s, seed=1))]
#[allow(clippy::needless_pass_by_value)]
pub fn identify_yaw_inertia<'py>(
    py: Python<'py>,
    moment_n_m: Doubles<'py>,
    yaw_rate_rad_s: Doubles<'py>,
    dt_s: f64,
    seed: u64,
) -> Found<'py> {
    let moment = column("moment_n_m", Some(&moment_n_m))?;
    let rate = column("yaw_rate_rad_s", Some(&yaw_rate_rad_s))?;
    let found = py.detach(|| inertia::yaw(&moment, &rate, dt_s, seed));
    dict(py, &found.map_err(|e| refusal(&e))?)
}

/// Height of both roll centres, from a vehicle's hard-points.
#[pyfunction]
pub fn identify_roll_centre<'py>(py: Python<'py>, vehicle: &Vehicle) -> Found<'py> {
    let found = roll_centre::identify(&vehicle.inner);
    dict(py, &found.map_err(|e| refusal(&e))?)
}

/// Inertia from the swing of a pendulum: the rate about its axis, rad/s, (n,), on a grid of `dt_s`.
/// The suspended body is given by `mass_kg` with `distance_m` (compound), with `radius_m` and `length_m`
/// (wires), or by `stiffness_n_m_rad` (springs).
#[pyfunction]
#[pyo3(signature = (
    rate_rad_s, *, dt_s, mass_kg=None, distance_m=None, radius_m=None, length_m=None,
    stiffness_n_m_rad=None, fixture_kg_m2=0.0, seed=1,
))]
#[allow(clippy::too_many_arguments)]
#[allow(clippy::needless_pass_by_value)]
pub fn identify_pendulum<'py>(
    py: Python<'py>,
    rate_rad_s: Doubles<'py>,
    dt_s: f64,
    mass_kg: Option<f64>,
    distance_m: Option<f64>,
    radius_m: Option<f64>,
    length_m: Option<f64>,
    stiffness_n_m_rad: Option<f64>,
    fixture_kg_m2: f64,
    seed: u64,
) -> Found<'py> {
    let rate = column("rate_rad_s", Some(&rate_rad_s))?;
    let hung = match (mass_kg, distance_m, radius_m, length_m, stiffness_n_m_rad) {
        (Some(mass_kg), Some(distance_m), None, None, None) => inertia::Pendulum::Compound {
            mass_kg,
            distance_m,
        },
        (Some(mass_kg), None, Some(radius_m), Some(length_m), None) => inertia::Pendulum::Wires {
            mass_kg,
            radius_m,
            length_m,
        },
        (None, None, None, None, Some(stiffness_n_m_rad)) => {
            inertia::Pendulum::Springs { stiffness_n_m_rad }
        }
        _ => {
            return Err(errors::argument(
                "give mass_kg and distance_m, or mass_kg, radius_m and length_m, or \
                 stiffness_n_m_rad alone"
                    .to_owned(),
            ));
        }
    };
    let found = py.detach(|| inertia::pendulum(&rate, dt_s, hung, fixture_kg_m2, seed));
    dict(py, &found.map_err(|e| refusal(&e))?)
}

/// Adds this file's part to the extension module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Drive>()?;
    module.add_function(wrap_pyfunction!(identify_cornering, module)?)?;
    module.add_function(wrap_pyfunction!(identify_understeer, module)?)?;
    module.add_function(wrap_pyfunction!(identify_roll_pitch, module)?)?;
    module.add_function(wrap_pyfunction!(identify_step_response, module)?)?;
    module.add_function(wrap_pyfunction!(identify_frequency_response, module)?)?;
    module.add_function(wrap_pyfunction!(identify_tyre, module)?)?;
    module.add_function(wrap_pyfunction!(identify_friction, module)?)?;
    module.add_function(wrap_pyfunction!(identify_yaw_inertia, module)?)?;
    module.add_function(wrap_pyfunction!(identify_pendulum, module)?)?;
    module.add_function(wrap_pyfunction!(identify_roll_centre, module)?)
}
