//! The estimator, fed with samples.

use std::sync::{Mutex, PoisonError};

use estimator::{Estimator, Settings};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use sample::{LogTime, Sample};

use crate::calibration::Calibration;
use crate::estimates::Collected;
use crate::sensors::Sensors;
use crate::tuning::Tuning;
use crate::vehicle::Vehicle;
use crate::{errors, interrupt, samples};

/// The estimator. What Python users see is `atvrec.Estimator`, which wraps this.
#[pyclass(frozen, module = "atvrec._atvrec")]
pub struct SampleEstimator {
    state: Mutex<State>,
}

/// The estimator, and what it gave since it was asked last.
struct State {
    estimator: Estimator,
    /// Log time of the last call.
    now: LogTime,
    collected: Collected,
}

#[pymethods]
impl SampleEstimator {
    #[new]
    fn new(
        vehicle: &Vehicle,
        sensors: &Sensors,
        calibration: &Calibration,
        tuning: &Tuning,
        method: &str,
        ignore: Vec<String>,
        payload: Vec<String>,
    ) -> PyResult<Self> {
        let settings = Settings {
            method: engine::config::method(method).map_err(errors::argument)?,
            ignore: ignore
                .iter()
                .map(|name| engine::config::input(name).map_err(errors::argument))
                .collect::<PyResult<_>>()?,
            payload,
            tuning: tuning.inner,
            ..Settings::default()
        };
        let (sensors, calibration) = (&sensors.inner, &calibration.inner);
        let estimator = Estimator::new(&vehicle.inner, sensors, calibration, settings);
        let estimator = estimator.map_err(|error| errors::argument(error.to_string()))?;
        Ok(Self {
            state: Mutex::new(State {
                estimator,
                now: LogTime(0),
                collected: Collected::default(),
            }),
        })
    }

    /// Moves time to `log_time_ns`.
    fn advance(&self, py: Python<'_>, log_time_ns: u64) -> PyResult<()> {
        self.locked(py, |state| state.advance(LogTime(log_time_ns)))
    }

    /// Takes samples, in the order of their log time.
    fn push(&self, py: Python<'_>, samples: &Bound<'_, PyDict>) -> PyResult<()> {
        let samples = samples::read(samples)?;
        let mut interrupt = interrupt::Watch::default();
        self.locked(py, |state| {
            samples.iter().try_for_each(|sample| {
                interrupt.check()?;
                state.push(sample)
            })
        })
    }

    /// Hands out what was estimated since the last call.
    fn take<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyDict>, Bound<'py, PyDict>, Bound<'py, PyList>)> {
        let collected = self.locked(py, |state| Ok(std::mem::take(&mut state.collected)))?;
        collected.into_python(py)
    }
}

impl SampleEstimator {
    /// Works on the state; other Python threads run meanwhile.
    fn locked<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut State) -> PyResult<T> + Send,
    ) -> PyResult<T> {
        py.detach(|| work(&mut self.state.lock().unwrap_or_else(PoisonError::into_inner)))
    }
}

impl State {
    fn advance(&mut self, now: LogTime) -> PyResult<()> {
        if now < self.now {
            return Err(errors::argument(format!(
                "log_time_ns = {} is earlier than {}, which was given before; give samples in the \
                 order of their log time",
                now.0, self.now.0
            )));
        }
        self.now = now;
        let collected = &mut self.collected;
        self.estimator
            .advance(now, &mut |output| collected.push(output));
        Ok(())
    }

    fn push(&mut self, sample: &Sample) -> PyResult<()> {
        self.advance(sample.log_time)?;
        self.estimator.push(sample);
        Ok(())
    }
}
