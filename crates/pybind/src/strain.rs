//! The strain chain.

use std::path::PathBuf;

use model::sensors::{Amplifier, Sensors};
use model::strain::{self, ChannelScale};
use numpy::{PyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::batch;
use crate::errors;
use crate::input::{self, Doubles};
use crate::sensors;

/// One channel of the strain chain: counts = zero + gain * load.
#[pyclass(frozen, module = "atvrec")]
pub struct StrainChannel {
    scale: ChannelScale,
}

#[pymethods]
impl StrainChannel {
    /// The axial channels of a sensors file that ships with the package; the load is tension, N.
    #[staticmethod]
    #[pyo3(signature = (sensors="thesis-10bit"))]
    fn axial(sensors: &str) -> PyResult<Self> {
        let chain = Sensors::builtin(sensors)
            .map_err(|e| errors::model(&e))?
            .strain;
        let scale = chain.axial_scale();
        scale
            .map(|scale| Self { scale })
            .map_err(|e| errors::model(&e))
    }

    /// The bending channels; the load is a moment, N m.
    #[staticmethod]
    #[pyo3(signature = (sensors="full-bridge-16bit-bending"))]
    fn bending(sensors: &str) -> PyResult<Self> {
        let chain = Sensors::builtin(sensors)
            .map_err(|e| errors::model(&e))?
            .strain;
        let scale = chain.bending_scale().map_err(|e| errors::model(&e))?;
        scale.map(|scale| Self { scale }).ok_or_else(|| {
            errors::argument(format!("sensors = {sensors:?}: has no bending bridges"))
        })
    }

    /// The axial channels of a sensors file of your own; all errors of the file are reported at once.
    #[staticmethod]
    fn load_axial(path: PathBuf) -> PyResult<Self> {
        let scale = sensors::read(&path)?.strain.axial_scale();
        scale
            .map(|scale| Self { scale })
            .map_err(|e| errors::model(&e))
    }

    /// The bending channels of a sensors file of your own.
    #[staticmethod]
    fn load_bending(path: PathBuf) -> PyResult<Self> {
        let scale = sensors::read(&path)?.strain.bending_scale();
        scale
            .map_err(|e| errors::model(&e))?
            .map(|scale| Self { scale })
            .ok_or_else(|| errors::argument(format!("{}: has no bending bridges", path.display())))
    }

    /// Names of the sensors files that ship with the package.
    #[staticmethod]
    fn builtin_names() -> Vec<&'static str> {
        Sensors::builtin_names().collect()
    }

    /// Load of one count, N or N m.
    #[getter]
    fn load_per_count(&self) -> f64 {
        self.scale.load_per_count()
    }

    /// Smallest and largest load within the converter's range, N or N m.
    #[getter]
    fn range(&self) -> (f64, f64) {
        self.scale.range().into()
    }

    /// Counts that the converter gives for loads, without noise: array like `load`.
    fn counts<'py>(
        &self,
        py: Python<'py>,
        load: Doubles<'py>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let loads = input::row_major(&load);
        let convert = |load: &f64| f64::from(self.scale.convert(self.scale.level(*load)));
        batch::shaped(py, load.shape(), loads.iter().map(convert).collect())
    }

    /// Loads that counts stand for, N or N m: array like `counts`.
    fn load<'py>(
        &self,
        py: Python<'py>,
        counts: Doubles<'py>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let values = input::row_major(&counts);
        let loads = values.iter().map(|counts| self.scale.load(*counts));
        batch::shaped(py, counts.shape(), loads.collect())
    }
}

/// Gain of an instrumentation amplifier with a gain resistor R_G, ohm: `base_gain` + `gain_ohm`/R_G.
/// The defaults are those of the thesis, equation 3.5.
#[pyfunction]
#[pyo3(signature = (gain_resistor_ohm, *, base_gain = 5.0, gain_ohm = 80_000.0))]
pub fn amplifier_gain(gain_resistor_ohm: f64, base_gain: f64, gain_ohm: f64) -> PyResult<f64> {
    input::positive("gain_resistor_ohm", gain_resistor_ohm, "ohm")?;
    let amplifier = Amplifier {
        base_gain,
        gain_ohm,
    };
    Ok(amplifier.gain(gain_resistor_ohm))
}

/// Table 3.2 of the thesis: all strain circuits as a list of dicts.
#[pyfunction]
pub fn strain_circuits(py: Python<'_>) -> PyResult<Bound<'_, PyList>> {
    let list = PyList::empty(py);
    for circuit in strain::TABLE_3_2 {
        let row = PyDict::new(py);
        row.set_item("can_box", circuit.can_box)?;
        row.set_item("box_channel", circuit.box_channel)?;
        row.set_item("wheel", format!("{:?}", circuit.wheel))?;
        row.set_item("member", format!("{:?}", circuit.member))?;
        row.set_item("bridge", format!("{:?}", circuit.bridge))?;
        row.set_item("gain_resistor_ohm", circuit.gain_resistor_ohm)?;
        row.set_item("gain", circuit.gain())?;
        list.append(row)?;
    }
    Ok(list)
}
