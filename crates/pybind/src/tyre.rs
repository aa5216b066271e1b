//! Tyres.

use model::tyre::{Contact, Law, Physical, Stiffness, Tyre as Model};
use numpy::{PyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyFloat, PyTuple};

use crate::batch;
use crate::errors;
use crate::input::{self, Doubles};
use crate::vehicle::Vehicle;

const ARGUMENTS: [(&str, &str); 6] = [
    ("load_n", "N"),
    ("slip_angle_rad", "rad"),
    ("slip_ratio", ""),
    ("camber_rad", "rad"),
    ("friction_scale", ""),
    ("stiffness_scale", ""),
];

const OUTPUTS: [(&str, usize); 3] = [("longitudinal_n", 1), ("lateral_n", 1), ("aligning_n_m", 1)];

/// A tyre: from load and slip to force. In the wheel's contact frame; a positive slip angle gives
/// a negative lateral force.
#[pyclass(frozen, module = "atvrec")]
pub struct Tyre {
    inner: Model,
}

#[pymethods]
impl Tyre {
    /// The tyre of a vehicle's `front` or `rear` axle: a brush tyre with the file's stiffnesses,
    /// load exponent and friction.
    #[staticmethod]
    fn of(vehicle: &Vehicle, axle: &str) -> PyResult<Self> {
        let axle = match axle {
            "front" => &vehicle.inner.front,
            "rear" => &vehicle.inner.rear,
            other => {
                return Err(errors::argument(format!(
                    "axle = {other:?}: must be \"front\" or \"rear\""
                )));
            }
        };
        Ok(Self {
            inner: Model::from_vehicle(&axle.tyre),
        })
    }

    /// A tyre of stiffnesses and friction, by its force law: `linear`, `fiala`, `brush` (Fiala's
    /// parabola along the resulting slip), `exponential` or `dugoff`. Stiffnesses are of one tyre,
    /// the same at every load, or growing as (load/reference)^exponent.
    #[staticmethod]
    #[pyo3(signature = (
        law, *, cornering_stiffness_n_rad, slip_stiffness_n, friction, sliding_friction=None,
        camber_stiffness_n_rad=0.0, contact_length_m=0.0, reference_load_n=None, load_exponent=0.0
    ))]
    #[allow(clippy::too_many_arguments)]
    fn physical(
        law: &str,
        cornering_stiffness_n_rad: f64,
        slip_stiffness_n: f64,
        friction: f64,
        sliding_friction: Option<f64>,
        camber_stiffness_n_rad: f64,
        contact_length_m: f64,
        reference_load_n: Option<f64>,
        load_exponent: f64,
    ) -> PyResult<Self> {
        let law = match law {
            "linear" => Law::Linear,
            "fiala" => Law::Fiala,
            "brush" => Law::Brush,
            "exponential" => Law::Exponential,
            "dugoff" => Law::Dugoff,
            other => {
                return Err(errors::argument(format!(
                    "law = {other:?}: must be linear, fiala, brush, exponential or dugoff"
                )));
            }
        };
        input::positive(
            "cornering_stiffness_n_rad",
            cornering_stiffness_n_rad,
            "N/rad",
        )?;
        input::positive("slip_stiffness_n", slip_stiffness_n, "N")?;
        input::positive("friction", friction, "")?;
        input::finite("camber_stiffness_n_rad", camber_stiffness_n_rad, "N/rad")?;
        input::finite("contact_length_m", contact_length_m, "m")?;
        input::finite("load_exponent", load_exponent, "")?;
        let reference_load_n = reference_load_n
            .map(|load| input::positive("reference_load_n", load, "N"))
            .transpose()?;
        let stiffness = |at_reference| match reference_load_n {
            Some(reference_load_n) => Stiffness::Power {
                at_reference,
                reference_load_n,
                exponent: load_exponent,
            },
            None => Stiffness::Constant(at_reference),
        };
        let sliding_friction = sliding_friction.unwrap_or(friction);
        input::positive("sliding_friction", sliding_friction, "")?;
        Ok(Self {
            inner: Model::Physical(Physical {
                law,
                cornering: stiffness(cornering_stiffness_n_rad),
                slip: stiffness(slip_stiffness_n),
                friction,
                sliding_friction,
                camber_stiffness_n_rad,
                contact_length_m,
            }),
        })
    }

    /// The Magic Formula of 1987/89 with the published tyre of SAE 870421, table 2 (a car's).
    #[staticmethod]
    fn magic_formula_89() -> Self {
        Self {
            inner: Model::MagicFormula89(Box::default()),
        }
    }

    /// Forces and aligning moment as a dict: `longitudinal_n`, `lateral_n`, `aligning_n_m`.
    ///
    /// Arguments are numbers or arrays, broadcast against each other as NumPy does; the results
    /// have their common shape. At loads of zero and below the tyre is airborne: no force.
    #[pyo3(signature = (
        load_n, slip_angle_rad=None, slip_ratio=None, camber_rad=None, friction_scale=None,
        stiffness_scale=None
    ))]
    #[allow(clippy::too_many_arguments)]
    fn forces<'py>(
        &self,
        py: Python<'py>,
        load_n: Bound<'py, PyAny>,
        slip_angle_rad: Option<Bound<'py, PyAny>>,
        slip_ratio: Option<Bound<'py, PyAny>>,
        camber_rad: Option<Bound<'py, PyAny>>,
        friction_scale: Option<Bound<'py, PyAny>>,
        stiffness_scale: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let given = [
            Some(load_n),
            slip_angle_rad,
            slip_ratio,
            camber_rad,
            friction_scale,
            stiffness_scale,
        ];
        let mut arguments = Vec::with_capacity(given.len());
        for (index, argument) in given.into_iter().enumerate() {
            let default = if index < 4 { 0.0 } else { 1.0 };
            arguments.push(match argument {
                Some(argument) => argument,
                None => PyFloat::new(py, default).into_any(),
            });
        }
        let arrays = py
            .import("numpy")?
            .call_method1("broadcast_arrays", PyTuple::new(py, arguments)?)?;
        let mut columns: Vec<Doubles<'py>> = Vec::with_capacity(ARGUMENTS.len());
        for array in arrays.try_iter()? {
            columns.push(array?.extract()?);
        }
        let values: Vec<_> = columns.iter().map(input::row_major).collect();
        for ((name, unit), values) in ARGUMENTS.iter().zip(&values) {
            if let Some(bad) = values.iter().find(|value| !value.is_finite()) {
                input::finite(name, *bad, unit)?;
            }
        }
        let shape: Vec<usize> = columns[0].shape().to_vec();
        let count = values[0].len();
        let results = py.detach(|| {
            let row = |row: usize| {
                let [
                    load_n,
                    angle,
                    slip_ratio,
                    camber_rad,
                    friction_scale,
                    stiffness_scale,
                ] = std::array::from_fn(|column| values[column][row]);
                let forces = self.inner.forces(&Contact {
                    load_n,
                    slip_tangent: angle.tan(),
                    slip_ratio,
                    camber_rad,
                    friction_scale,
                    stiffness_scale,
                });
                [forces.longitudinal_n, forces.lateral_n, forces.aligning_n_m]
            };
            (0..count).flat_map(row).collect()
        });
        let shape: Vec<usize> = shape.into_iter().chain([3]).collect();
        let all: Bound<'py, PyArrayDyn<f64>> = batch::shaped(py, &shape, results)?;
        batch::split(py, &all, &OUTPUTS)
    }

    fn __repr__(&self) -> String {
        format!("<atvrec.Tyre {:?}>", self.inner)
    }
}
