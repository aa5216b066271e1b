//! Tyres.

use std::collections::HashMap;

use model::tyre::{
    Contact, Curve, Law, MagicFormula52, Offset, Physical, RadialSpringTyre, Rational, Stiffness,
    Tyre as Model,
};
use numpy::{PyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyFloat, PyTuple};

use crate::batch;
use crate::errors;
use crate::input::{self, Doubles};
use crate::origin::{Origin, Reduced};
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
    origin: Origin,
}

#[pymethods]
impl Tyre {
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        self.origin.reduce::<Self>(py)
    }

    /// The tyre of a vehicle's `front` or `rear` axle: a brush tyre with the file's stiffnesses,
    /// load exponent and friction.
    #[staticmethod]
    fn of(vehicle: &Bound<'_, Vehicle>, axle: &str) -> PyResult<Self> {
        let origin = Origin::new(vehicle.py(), "of", (vehicle, axle))?;
        let vehicle = &vehicle.get().inner;
        let axle = match axle {
            "front" => &vehicle.front,
            "rear" => &vehicle.rear,
            other => {
                return Err(errors::argument(format!(
                    "axle = {other:?}: must be \"front\" or \"rear\""
                )));
            }
        };
        Ok(Self {
            inner: Model::from_vehicle(&axle.tyre),
            origin,
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
        py: Python<'_>,
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
        let origin = Origin::new(py, "physical", (law,))?
            .with(py, "cornering_stiffness_n_rad", cornering_stiffness_n_rad)?
            .with(py, "slip_stiffness_n", slip_stiffness_n)?
            .with(py, "friction", friction)?
            .with(py, "sliding_friction", sliding_friction)?
            .with(py, "camber_stiffness_n_rad", camber_stiffness_n_rad)?
            .with(py, "contact_length_m", contact_length_m)?
            .with(py, "reference_load_n", reference_load_n)?
            .with(py, "load_exponent", load_exponent)?;
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
            origin,
        })
    }

    /// The Magic Formula of 1987/89 with the published tyre of SAE 870421, table 2 (a car's).
    #[staticmethod]
    fn magic_formula_89(py: Python<'_>) -> PyResult<Self> {
        Ok(Self {
            inner: Model::MagicFormula89(Box::default()),
            origin: Origin::new(py, "magic_formula_89", ())?,
        })
    }

    /// The Magic Formula 5.2 with combined slip (Pacejka, Tyre and Vehicle Dynamics, 2nd edition,
    /// section 4.3.2). `coefficients` takes those of a property file by name, in any case (`PCX1`,
    /// `FNOMIN` in N, `UNLOADED_RADIUS` in m); what is not given is a passenger car's 205/60 R15.
    #[staticmethod]
    #[pyo3(signature = (coefficients=None))]
    fn magic_formula_52(
        py: Python<'_>,
        coefficients: Option<HashMap<String, f64>>,
    ) -> PyResult<Self> {
        let origin = Origin::new(py, "magic_formula_52", (coefficients.clone(),))?;
        let mut formula = Box::<MagicFormula52>::default();
        for (name, value) in coefficients.into_iter().flatten() {
            let Some(place) = formula.coefficient_mut(&name.to_lowercase()) else {
                return Err(errors::argument(format!(
                    "coefficients: {name:?} is none of the Magic Formula 5.2; its names are those \
                     of tyre property files, as PCX1 or QHZ4"
                )));
            };
            *place = input::finite(&name, value, "")?;
        }
        input::positive("FNOMIN", formula.nominal_load_n, "N")?;
        input::positive("UNLOADED_RADIUS", formula.radius_m, "m")?;
        Ok(Self {
            inner: Model::MagicFormula52(formula),
            origin,
        })
    }

    /// A tyre of rational curves (after Rill's TMeasy), each direction given at the nominal load
    /// and at twice that load: rows of (initial slope in N per unit slip, peak force in N, slip of
    /// the peak, sliding force in N, slip from which it slides). `offset` is (pneumatic trail over
    /// contact length at zero slip, slip where it vanishes, slip from which it stays zero), at both
    /// loads.
    #[staticmethod]
    #[pyo3(signature = (
        *, nominal_load_n, greatest_load_n, longitudinal, lateral, offset, radius_m,
        vertical_stiffness_n_m
    ))]
    #[allow(clippy::too_many_arguments)]
    fn rational(
        py: Python<'_>,
        nominal_load_n: f64,
        greatest_load_n: f64,
        longitudinal: [[f64; 5]; 2],
        lateral: [[f64; 5]; 2],
        offset: [[f64; 3]; 2],
        radius_m: f64,
        vertical_stiffness_n_m: f64,
    ) -> PyResult<Self> {
        let origin = Origin::new(py, "rational", ())?
            .with(py, "nominal_load_n", nominal_load_n)?
            .with(py, "greatest_load_n", greatest_load_n)?
            .with(py, "longitudinal", longitudinal)?
            .with(py, "lateral", lateral)?
            .with(py, "offset", offset)?
            .with(py, "radius_m", radius_m)?
            .with(py, "vertical_stiffness_n_m", vertical_stiffness_n_m)?;
        let curves = |name: &str, rows: [[f64; 5]; 2]| {
            for value in rows.as_flattened() {
                input::positive(name, *value, "")?;
            }
            PyResult::Ok(rows.map(
                |[slope_n, peak_n, peak_slip, sliding_n, sliding_slip]| Curve {
                    slope_n,
                    peak_n,
                    peak_slip,
                    sliding_n,
                    sliding_slip,
                },
            ))
        };
        for value in offset.as_flattened() {
            input::positive("offset", *value, "")?;
        }
        Ok(Self {
            inner: Model::Rational(Box::new(Rational {
                nominal_load_n: input::positive("nominal_load_n", nominal_load_n, "N")?,
                greatest_load_n: input::positive("greatest_load_n", greatest_load_n, "N")?,
                longitudinal: curves("longitudinal", longitudinal)?,
                lateral: curves("lateral", lateral)?,
                offset: offset.map(|[at_rest, first_zero, last_zero]| Offset {
                    at_rest,
                    first_zero,
                    last_zero,
                }),
                radius_m: input::positive("radius_m", radius_m, "m")?,
                vertical_stiffness_n_m: input::positive(
                    "vertical_stiffness_n_m",
                    vertical_stiffness_n_m,
                    "N/m",
                )?,
            })),
            origin,
        })
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
                    slip_tangent: math::tan(angle),
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

/// A tyre of radial springs joined by interradial springs (Badalamenti and Doyle): it feels the
/// shape of an obstacle, not only its height.
#[pyclass(frozen, module = "atvrec")]
pub struct SpringTyre {
    inner: RadialSpringTyre,
    origin: Origin,
}

#[pymethods]
impl SpringTyre {
    /// A tyre that carries `load_n` on flat ground pressed in by `deflection_m`, with
    /// `interradial_part` of the radial stiffness in the springs between neighbours, `spacing_rad`
    /// apart.
    #[new]
    #[pyo3(signature = (
        *, radius_m, deflection_m, load_n, spacing_rad=0.017_453_292_519_943_295,
        interradial_part=0.3
    ))]
    fn new(
        py: Python<'_>,
        radius_m: f64,
        deflection_m: f64,
        load_n: f64,
        spacing_rad: f64,
        interradial_part: f64,
    ) -> PyResult<Self> {
        input::positive("radius_m", radius_m, "m")?;
        input::positive("deflection_m", deflection_m, "m")?;
        input::positive("load_n", load_n, "N")?;
        input::positive("spacing_rad", spacing_rad, "rad")?;
        input::finite("interradial_part", interradial_part, "")?;
        let part = interradial_part;
        Ok(Self {
            inner: RadialSpringTyre::calibrated(radius_m, spacing_rad, part, deflection_m, load_n),
            origin: Origin::new(py, "", ())?
                .with(py, "radius_m", radius_m)?
                .with(py, "deflection_m", deflection_m)?
                .with(py, "load_n", load_n)?
                .with(py, "spacing_rad", spacing_rad)?
                .with(py, "interradial_part", interradial_part)?,
        })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        self.origin.reduce::<Self>(py)
    }

    /// Forces (longitudinal, forward positive, and vertical, upward positive; N) on a wheel whose
    /// centre is at these positions along a road and heights above its datum: array (..., 2).
    ///
    /// The road is a line through points `road_m`, array (M, 2) of position and height, positions
    /// ascending; it goes on level beyond its ends.
    fn forces<'py>(
        &self,
        py: Python<'py>,
        position_m: Doubles<'py>,
        height_m: Doubles<'py>,
        road_m: Doubles<'py>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let road = input::rows("road_m", &road_m, &["position_m", "height_m"])?;
        let (positions, heights) = (input::row_major(&position_m), input::row_major(&height_m));
        if position_m.shape() != height_m.shape() {
            return Err(errors::argument(format!(
                "position_m has the shape {:?} and height_m {:?}: they must be the same",
                position_m.shape(),
                height_m.shape()
            )));
        }
        if road
            .chunks_exact(2)
            .zip(road.chunks_exact(2).skip(1))
            .any(|(a, b)| b[0] <= a[0])
        {
            return Err(errors::argument("road_m: positions must ascend"));
        }
        for (name, values) in [("position_m", &positions), ("height_m", &heights)] {
            for value in values.iter() {
                input::finite(name, *value, "m")?;
            }
        }
        let forces = py.detach(|| {
            let at = |position: &f64, height: &f64| {
                let force = self
                    .inner
                    .force(*height, |ahead| ground(&road, position + ahead));
                [force.longitudinal_n, force.vertical_n]
            };
            positions
                .iter()
                .zip(heights.iter())
                .flat_map(|(x, z)| at(x, z))
                .collect()
        });
        let shape: Vec<usize> = position_m.shape().iter().copied().chain([2]).collect();
        batch::shaped(py, &shape, forces)
    }
}

/// Height of a line through points at a position.
fn ground(road: &[f64], position: f64) -> f64 {
    let (points, _) = road.as_chunks::<2>();
    let count = points.len();
    let after = points.partition_point(|point| point[0] <= position);
    if count == 0 {
        return 0.0;
    }
    if after == 0 {
        return points[0][1];
    }
    if after == count {
        return points[count - 1][1];
    }
    let ([x0, z0], [x1, z1]) = (points[after - 1], points[after]);
    z0 + (z1 - z0) * (position - x0) / (x1 - x0)
}
