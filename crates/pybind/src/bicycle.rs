//! The linear bicycle.

use model::chassis::bicycle::Bicycle as Model;
use nalgebra::Complex;
use numpy::ndarray::{Array1, Array2};
use numpy::{Complex64, IntoPyArray, PyArray1, PyArray2, PyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::input::{self, Doubles};
use crate::origin::{Origin, Reduced};
use crate::vehicle::Vehicle;
use crate::{batch, errors};

const GAINS: [(&str, usize); 4] = [
    ("yaw_rate_1_s", 1),
    ("sideslip", 1),
    ("lateral_m_s2", 1),
    ("curvature_1_m", 1),
];

/// The linear bicycle of a vehicle (equation 2.5 of the thesis): state (beta, r), input the front
/// steer angle.
#[pyclass(frozen, module = "atvrec")]
pub struct Bicycle {
    inner: Model,
    origin: Origin,
}

type Array<'py> = Bound<'py, PyArrayDyn<f64>>;
type Matrix<'py> = Bound<'py, PyArray2<f64>>;
type Vector<'py> = Bound<'py, PyArray1<f64>>;

#[pymethods]
impl Bicycle {
    /// The bicycle of a vehicle: two tyres to an axle, at their reference loads.
    #[new]
    fn new(vehicle: &Bound<'_, Vehicle>) -> PyResult<Self> {
        Ok(Self {
            inner: Model::from_vehicle(&vehicle.get().inner),
            origin: Origin::new(vehicle.py(), "", (vehicle,))?,
        })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        self.origin.reduce::<Self>(py)
    }

    /// A and B at a speed: arrays (2, 2) and (2,). Raises ArgumentError at rest, where sideslip is
    /// not defined: see `relaxed_system`.
    fn system<'py>(&self, py: Python<'py>, speed_m_s: f64) -> PyResult<(Matrix<'py>, Vector<'py>)> {
        let system = self
            .inner
            .system(speed_m_s)
            .map_err(|e| errors::model(&e))?;
        let a = Array2::from_shape_fn((2, 2), |(r, c)| system.a[(r, c)]);
        let b = Array1::from_shape_fn(2, |r| system.b[r]);
        Ok((a.into_pyarray(py), b.into_pyarray(py)))
    }

    /// A and B with relaxing tyres, x = (v, r, alpha_f, alpha_r): arrays (4, 4) and (4,). Holds at
    /// any speed from zero on.
    fn relaxed_system<'py>(
        &self,
        py: Python<'py>,
        speed_m_s: f64,
        relaxation_m: f64,
    ) -> PyResult<(Matrix<'py>, Vector<'py>)> {
        let system = self.inner.relaxed_system(speed_m_s, relaxation_m);
        let (a, b) = system.map_err(|e| errors::model(&e))?;
        let a = Array2::from_shape_fn((4, 4), |(r, c)| a[(r, c)]);
        let b = Array1::from_shape_fn(4, |r| b[r]);
        Ok((a.into_pyarray(py), b.into_pyarray(py)))
    }

    /// Eigenvalues at speeds, 1/s: complex array (..., 2).
    fn eigenvalues<'py>(
        &self,
        py: Python<'py>,
        speed_m_s: Doubles<'py>,
    ) -> PyResult<Bound<'py, PyArray2<Complex64>>> {
        let speeds = input::row_major(&speed_m_s);
        let mut all = Array2::zeros((speeds.len(), 2));
        for (row, speed) in speeds.iter().enumerate() {
            let pair = self.inner.eigenvalues(*speed);
            for (column, value) in pair.map_err(|e| errors::model(&e))?.iter().enumerate() {
                all[(row, column)] = Complex::new(value.re, value.im);
            }
        }
        Ok(all.into_pyarray(py))
    }

    /// Undamped natural frequency, rad/s, and damping ratio of the yaw mode; None where unstable.
    fn yaw_mode(&self, speed_m_s: f64) -> PyResult<Option<(f64, f64)>> {
        let mode = self.inner.yaw_mode(speed_m_s);
        Ok(mode.map_err(|e| errors::model(&e))?.map(Into::into))
    }

    /// Understeer gradient K_us, rad/(m/s^2).
    #[getter]
    fn understeer_gradient_rad_m_s2(&self) -> f64 {
        self.inner.understeer_gradient_rad_m_s2()
    }

    /// Speed of the greatest yaw gain, m/s; None where the vehicle oversteers.
    #[getter]
    fn characteristic_speed_m_s(&self) -> Option<f64> {
        self.inner.characteristic_speed_m_s()
    }

    /// Speed at which the vehicle becomes unstable, m/s; None where it understeers.
    #[getter]
    fn critical_speed_m_s(&self) -> Option<f64> {
        self.inner.critical_speed_m_s()
    }

    /// Static margin, part of the wheelbase; positive where stable at all speeds.
    #[getter]
    fn static_margin(&self) -> f64 {
        self.inner.static_margin()
    }

    /// Steady gains on the steer angle at speeds as a dict of arrays like `speed_m_s`:
    /// `yaw_rate_1_s`, `sideslip`, `lateral_m_s2` (per rad), `curvature_1_m`.
    fn steady_gains<'py>(
        &self,
        py: Python<'py>,
        speed_m_s: Doubles<'py>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let speeds = input::row_major(&speed_m_s);
        let mut rows = Vec::with_capacity(4 * speeds.len());
        for speed in speeds.iter() {
            let gains = self.inner.steady_gains(*speed);
            let gains = gains.map_err(|e| errors::model(&e))?;
            rows.extend([
                gains.yaw_rate_1_s,
                gains.sideslip,
                gains.lateral_m_s2,
                gains.curvature_1_m,
            ]);
        }
        let shape: Vec<usize> = speed_m_s.shape().iter().copied().chain([4]).collect();
        let all: Array<'py> = batch::shaped(py, &shape, rows)?;
        batch::split(py, &all, &GAINS)
    }

    /// Frequency response to the steer angle at angular frequencies: complex array (frequencies, 3)
    /// of beta/delta, r/delta (1/s) and a_y/delta (m/s^2 per rad).
    fn frequency_response<'py>(
        &self,
        py: Python<'py>,
        speed_m_s: f64,
        frequency_rad_s: Doubles<'py>,
    ) -> PyResult<Bound<'py, PyArray2<Complex64>>> {
        let frequencies = input::row_major(&frequency_rad_s);
        let mut all = Array2::zeros((frequencies.len(), 3));
        for (row, frequency) in frequencies.iter().enumerate() {
            let response = self.inner.frequency_response(speed_m_s, *frequency);
            let response = response.map_err(|e| errors::model(&e))?;
            let values = [
                response.sideslip,
                response.yaw_rate_1_s,
                response.lateral_m_s2,
            ];
            for (column, value) in values.into_iter().enumerate() {
                all[(row, column)] = Complex::new(value.re, value.im);
            }
        }
        Ok(all.into_pyarray(py))
    }
}
