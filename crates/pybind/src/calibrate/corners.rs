//! Strain bridges and potentiometers of all corners.

use estimator::calibration::load_rig::{RigLoad, load_rig};
use estimator::calibration::member::{Bench, BenchLoad, member};
use estimator::calibration::rest::{Rest, Signal};
use estimator::calibration::zero::{CornerRest, ZeroInput, zero};
use numpy::PyUntypedArrayMethods;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use sample::{PerWheel, STANDARD_GRAVITY_M_S2, StrainChannel};

use super::{Found, known, with_table};
use crate::errors;
use crate::findings::{column, dict, estimator, same_length, vectors};
use crate::input::{self, Doubles};
use crate::sensors::Sensors;
use crate::vehicle::Vehicle;

const CHANNELS: usize = StrainChannel::COUNT;

/// All converters of a vehicle at rest, as a dict.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Counts<'py> {
    time_s: Doubles<'py>,
    strain: Doubles<'py>,
    deflection: Doubles<'py>,
}

impl Counts<'_> {
    /// What each channel says, its first and last count taken for the ends of its range.
    fn rest(
        &self,
        argument: &str,
        sensors: &model::sensors::Sensors,
    ) -> PyResult<PerWheel<CornerRest>> {
        let time_s = column(&format!("{argument}.time_s"), Some(&self.time_s))?;
        let strain = self.columns(&format!("{argument}.strain"), &time_s)?;
        let pots = vectors::<4>(&format!("{argument}.deflection"), &self.deflection)?;
        same_length(&[("time_s", time_s.len()), ("deflection", pots.len())])?;
        let of = |value: &[f64], bits: u8| {
            let signal = Signal {
                time_s: &time_s,
                value,
            };
            let range = [0.0, math::exp2(f64::from(bits)) - 1.0];
            Rest::of(&signal, f64::NEG_INFINITY, f64::INFINITY, range)
        };
        Ok(PerWheel::from_fn(|wheel| {
            let pot: Vec<f64> = pots.iter().map(|row| row[wheel.index()]).collect();
            CornerRest {
                strain: std::array::from_fn(|i| {
                    let values = &strain[wheel.index() * CHANNELS + i];
                    of(values, sensors.strain.adc_bits)
                }),
                deflection: of(&pot, sensors.deflection.adc_bits),
            }
        }))
    }

    /// The strain channels one after the other, wheel by wheel.
    fn columns(&self, argument: &str, time_s: &[f64]) -> PyResult<Vec<Vec<f64>>> {
        let expected = [time_s.len(), 4, CHANNELS];
        if self.strain.shape() != expected {
            return Err(errors::argument(format!(
                "{argument} has the shape {:?}: must be {expected:?}",
                self.strain.shape()
            )));
        }
        let numbers = input::row_major(&self.strain);
        let (rows, _) = numbers.as_chunks::<{ 4 * CHANNELS }>();
        Ok((0..4 * CHANNELS)
            .map(|i| rows.iter().map(|row| row[i]).collect())
            .collect())
    }
}

/// Zeros and faults of all strain bridges and potentiometers, from a vehicle on stands and, for
/// signs and wiring, on the ground.
#[pyfunction]
#[pyo3(signature = (
    vehicle, sensors, hanging, standing=None, *,
    specific_force_m_s2=[0.0, 0.0, STANDARD_GRAVITY_M_S2], steering_wheel_rad=[0.0, 0.0],
    weight_sigma=0.0, known_calibration=None,
))]
#[allow(clippy::too_many_arguments)]
#[allow(clippy::needless_pass_by_value)]
pub fn calibrate_zero<'py>(
    py: Python<'py>,
    vehicle: &Vehicle,
    sensors: &Sensors,
    hanging: Counts<'py>,
    standing: Option<Counts<'py>>,
    specific_force_m_s2: [f64; 3],
    steering_wheel_rad: [f64; 2],
    weight_sigma: f64,
    known_calibration: Option<&Bound<'py, PyDict>>,
) -> Found<'py> {
    let known = known(vehicle, known_calibration)?;
    let hanging = hanging.rest("hanging", &sensors.inner)?;
    let standing = standing
        .map(|counts| counts.rest("standing", &sensors.inner))
        .transpose()?;
    let found = zero(&ZeroInput {
        vehicle: &vehicle.inner,
        sensors: &sensors.inner,
        known: &known,
        hanging: &hanging,
        standing: standing.as_ref(),
        specific_force_m_s2,
        steering_wheel_rad,
        weight_sigma,
    })
    .map_err(|e| estimator(&e))?;
    let told = with_table(py, dict(py, &found.findings)?, &found.calibration)?;
    told.set_item("faults", texts(py, &found.faults)?)?;
    Ok(told)
}

/// Gains, zeros and wiring of the strain bridges from known forces on wheels: wheel names (k,),
/// forces, N, (k, 3), strut compressions, m, (k,), mean counts and their deviations, (k, 7), NaN
/// where a channel has no reading within its range, steering wheel, rad, (k,), points of application from the
/// wheel centre, m, (k, 3), at the hub if they are not given. A wheel of an axle without hard-points gets a
/// sensitivity matrix in the calibration.
#[pyfunction]
#[pyo3(signature = (
    vehicle, sensors, wheel, force_n, compression_m, counts, counts_sigma, *,
    steering_wheel_rad=None, at_m=None, known_calibration=None,
))]
#[allow(clippy::too_many_arguments)]
#[allow(clippy::needless_pass_by_value)]
pub fn calibrate_load_rig<'py>(
    py: Python<'py>,
    vehicle: &Vehicle,
    sensors: &Sensors,
    wheel: Vec<String>,
    force_n: Doubles<'py>,
    compression_m: Doubles<'py>,
    counts: Doubles<'py>,
    counts_sigma: Doubles<'py>,
    steering_wheel_rad: Option<Doubles<'py>>,
    at_m: Option<Doubles<'py>>,
    known_calibration: Option<&Bound<'py, PyDict>>,
) -> Found<'py> {
    let known = known(vehicle, known_calibration)?;
    let at_m = match &at_m {
        Some(at_m) => vectors::<3>("at_m", at_m)?,
        None => vec![[0.0; 3]; wheel.len()],
    };
    let force_n = vectors::<3>("force_n", &force_n)?;
    let compression_m = column("compression_m", Some(&compression_m))?;
    let counts = vectors::<CHANNELS>("counts", &counts)?;
    let sigma = vectors::<CHANNELS>("counts_sigma", &counts_sigma)?;
    let steering_wheel = match &steering_wheel_rad {
        Some(_) => column("steering_wheel_rad", steering_wheel_rad.as_ref())?,
        None => vec![0.0; wheel.len()],
    };
    same_length(&[
        ("wheel", wheel.len()),
        ("force_n", force_n.len()),
        ("at_m", at_m.len()),
        ("compression_m", compression_m.len()),
        ("counts", counts.len()),
        ("counts_sigma", sigma.len()),
        ("steering_wheel_rad", steering_wheel.len()),
    ])?;
    let loads = (0..wheel.len()).map(|k| {
        Ok(RigLoad {
            wheel: input::wheel(&wheel[k])?,
            force_n: force_n[k],
            at_m: at_m[k],
            compression_m: compression_m[k],
            steering_wheel_rad: steering_wheel[k],
            counts: std::array::from_fn(|i| {
                let reading = [counts[k][i], sigma[k][i]];
                reading[0].is_finite().then_some(reading)
            }),
        })
    });
    let loads = loads.collect::<PyResult<Vec<_>>>()?;
    let found =
        load_rig(&vehicle.inner, &sensors.inner, &known, &loads).map_err(|e| estimator(&e))?;
    let told = with_table(py, dict(py, &found.findings)?, &found.calibration)?;
    told.set_item("faults", texts(py, &found.faults)?)?;
    let sensitivity = PyDict::new(py);
    for (wheel, channel, counts_per_n) in found.sensitivity {
        sensitivity.set_item(format!("{wheel} {}", channel.name()), counts_per_n)?;
    }
    told.set_item("counts_per_n", sensitivity)?;
    Ok(told)
}

/// Gains, zeros, hysteresis and drift of the bridges of one member from known loads on a bench: loads, N, and
/// moments, N m, in the order in which they were applied, mean counts and temperatures, degrees Celsius, all (k,).
#[pyfunction]
#[pyo3(signature = (
    vehicle, sensors, wheel, channel, load_n, *, axial_counts=None, moment_n_m=None, bending_counts=None,
    temperature_c=None, load_sigma=0.002, known_calibration=None,
))]
#[allow(clippy::too_many_arguments)]
#[allow(clippy::needless_pass_by_value)]
pub fn calibrate_member<'py>(
    py: Python<'py>,
    vehicle: &Vehicle,
    sensors: &Sensors,
    wheel: &str,
    channel: &str,
    load_n: Doubles<'py>,
    axial_counts: Option<Doubles<'py>>,
    moment_n_m: Option<Doubles<'py>>,
    bending_counts: Option<Doubles<'py>>,
    temperature_c: Option<Doubles<'py>>,
    load_sigma: f64,
    known_calibration: Option<&Bound<'py, PyDict>>,
) -> Found<'py> {
    let known = known(vehicle, known_calibration)?;
    let load_n = column("load_n", Some(&load_n))?;
    let optional = |name: &'static str, values: Option<&Doubles<'py>>| {
        let values = values
            .map(|values| column(name, Some(values)))
            .transpose()?;
        if let Some(values) = &values {
            same_length(&[("load_n", load_n.len()), (name, values.len())])?;
        }
        PyResult::Ok(values)
    };
    let axial = optional("axial_counts", axial_counts.as_ref())?;
    let moment = optional("moment_n_m", moment_n_m.as_ref())?;
    let bending = optional("bending_counts", bending_counts.as_ref())?;
    let temperature = optional("temperature_c", temperature_c.as_ref())?;
    let at = |values: &Option<Vec<f64>>, row: usize| values.as_ref().map(|values| values[row]);
    let rows: Vec<BenchLoad> = (0..load_n.len())
        .map(|row| BenchLoad {
            load_n: load_n[row],
            moment_n_m: at(&moment, row).unwrap_or_default(),
            axial_counts: at(&axial, row),
            bending_counts: at(&bending, row),
            temperature_c: at(&temperature, row),
        })
        .collect();
    let bench = Bench {
        wheel: input::wheel(wheel)?,
        member: StrainChannel::from_name(channel).ok_or_else(|| {
            errors::argument(format!(
                "channel = {channel:?}: must be upper_front, upper_rear, lower_front, lower_rear or tie_rod"
            ))
        })?,
        load_sigma,
    };
    let found =
        member(&vehicle.inner, &sensors.inner, &known, &rows, &bench).map_err(|e| estimator(&e))?;
    with_table(py, dict(py, &found.findings)?, &found.calibration)
}

fn texts<'py>(py: Python<'py>, faults: &[impl ToString]) -> PyResult<Bound<'py, PyList>> {
    PyList::new(py, faults.iter().map(ToString::to_string))
}
