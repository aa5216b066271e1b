//! Errors of the crates as exceptions of Python.

use engine::output::TargetError;
use pyo3::exceptions::{PyException, PyFileExistsError, PyOSError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyTuple, PyType};
use report::score::ScoreError;

/// The package's exceptions.
struct Exceptions {
    base: Py<PyType>,
    log: Py<PyType>,
    vehicle: Py<PyType>,
    argument: Py<PyType>,
    simulation: Py<PyType>,
    data: Py<PyType>,
}

static EXCEPTIONS: PyOnceLock<Exceptions> = PyOnceLock::new();

fn exceptions(py: Python<'_>) -> PyResult<&Exceptions> {
    EXCEPTIONS.get_or_try_init(py, || {
        let make = |name: &str, doc: &str, bases: &[Bound<'_, PyType>]| {
            let members = PyDict::new(py);
            members.set_item("__module__", "atvrec")?;
            members.set_item("__doc__", doc)?;
            let made = py
                .get_type::<PyType>()
                .call1((name, PyTuple::new(py, bases)?, members))?;
            PyResult::Ok(made.cast_into::<PyType>()?.unbind())
        };
        let base = make(
            "AtvrecError",
            "Base of all errors of this package.",
            &[py.get_type::<PyException>()],
        )?;
        let own = base.bind(py).clone();
        let of_value = [own.clone(), py.get_type::<PyValueError>()];
        Ok(Exceptions {
            log: make(
                "LogError",
                "A log cannot be read, or does not hold what is asked for.",
                std::slice::from_ref(&own),
            )?,
            vehicle: make(
                "VehicleError",
                "A vehicle file has mistakes, or lacks a part that a model needs.",
                &of_value,
            )?,
            argument: make(
                "ArgumentError",
                "An argument is not finite or out of its range.",
                &of_value,
            )?,
            simulation: make(
                "SimulationError",
                "No equilibrium exists, or an integrator cannot meet its tolerance.",
                std::slice::from_ref(&own),
            )?,
            data: make(
                "DataError",
                "Data do not tell what is looked for; the message says what is lacking.",
                &of_value,
            )?,
            base,
        })
    })
}

/// Adds the exceptions to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    let all = exceptions(py)?;
    module.add("AtvrecError", all.base.bind(py))?;
    module.add("LogError", all.log.bind(py))?;
    module.add("VehicleError", all.vehicle.bind(py))?;
    module.add("ArgumentError", all.argument.bind(py))?;
    module.add("DataError", all.data.bind(py))?;
    module.add("SimulationError", all.simulation.bind(py))
}

fn raise(pick: impl Fn(&Exceptions) -> &Py<PyType>, message: String) -> PyErr {
    Python::attach(|py| match exceptions(py) {
        Ok(all) => PyErr::from_type(pick(all).bind(py).clone(), message),
        Err(error) => error,
    })
}

/// An argument that Python gave and that cannot be used.
pub fn argument(message: impl Into<String>) -> PyErr {
    raise(|all| &all.argument, message.into())
}

/// Data that do not tell what is looked for.
pub fn data(message: String) -> PyErr {
    raise(|all| &all.data, message)
}

/// What the log reader says. A refusal of the operating system keeps its number, so that a missing
/// file is a `FileNotFoundError`.
pub fn log(error: &store::Error) -> PyErr {
    if let store::Error::File { path, cause, .. } = error
        && let Some(number) = cause.raw_os_error()
    {
        let what = error.to_string();
        return PyOSError::new_err((number, what, path.display().to_string()));
    }
    raise(|all| &all.log, error.to_string())
}

/// Why a log cannot be scored.
pub fn score(error: &ScoreError) -> PyErr {
    match error {
        ScoreError::Log(error) => log(error),
        other => raise(|all| &all.log, other.to_string()),
    }
}

/// Why a log has no report.
pub fn report(error: &report::Error) -> PyErr {
    match error {
        report::Error::Log(error) => log(error),
        other => raise(|all| &all.log, other.to_string()),
    }
}

/// A vehicle file that cannot be used.
pub fn vehicle(message: String) -> PyErr {
    raise(|all| &all.vehicle, message)
}

/// What the model says.
pub fn model(error: &model::Error) -> PyErr {
    use model::Error;
    let message = error.to_string();
    match error {
        Error::File(_) | Error::UnknownName { .. } | Error::MissingPart { .. } => vehicle(message),
        Error::Argument { .. } => argument(message),
        _ => raise(|all| &all.simulation, message),
    }
}

/// What the engine says. A file that exists is a `FileExistsError`.
pub fn engine(error: &engine::Error) -> PyErr {
    use engine::Error;
    let message = with_causes(error);
    match error {
        Error::Target(error) => target(error),
        Error::Log(error) => log(error),
        Error::Simulation(sim::SimError::UnknownManoeuvre { .. }) => argument(message),
        Error::Simulation(_) | Error::Manoeuvre { .. } => raise(|all| &all.simulation, message),
        Error::VehicleFile(_) => vehicle(message),
        Error::ConfigurationUnreadable { cause: source, .. }
        | Error::OptionsUnreadable { source, .. }
        | Error::Unreadable { source, .. } => match source.raw_os_error() {
            Some(number) => PyOSError::new_err((number, message)),
            None => PyOSError::new_err(message),
        },
        Error::Write { .. } => PyOSError::new_err(message),
        Error::NoConfiguration
        | Error::ConfigurationNotText(_)
        | Error::AttachedConfiguration(_)
        | Error::PartsMissing(_) => raise(|all| &all.log, message),
        _ => argument(message),
    }
}

/// Why a file cannot be an output, with the next step in Python's terms.
fn target(error: &TargetError) -> PyErr {
    match error {
        TargetError::Exists { path } => PyFileExistsError::new_err(format!(
            "{} exists already; use another name, or replace the file with force=True",
            path.display()
        )),
        TargetError::Unfinished { path } => PyFileExistsError::new_err(format!(
            "{0} exists: it is the unfinished log of a call that was killed or is still running; \
             recover it with `atvrec recover {0}`, replace it with force=True, or use another name \
             for the output",
            path.display()
        )),
        other => argument(other.to_string()),
    }
}

/// The message of an error and of all its causes.
fn with_causes(error: &dyn std::error::Error) -> String {
    let mut message = error.to_string();
    let mut cause = error.source();
    while let Some(found) = cause {
        message = format!("{message}: {found}");
        cause = found.source();
    }
    message
}
