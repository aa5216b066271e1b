//! How an object was made: pickling makes it again in the same way.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString, PyTuple};

/// Calls `method` of the class `cls`, or the class itself where the name is empty. Pickles of this
/// package's objects refer to it.
#[pyfunction]
#[pyo3(name = "_restore")]
pub fn restore<'py>(
    cls: &Bound<'py, PyAny>,
    method: &str,
    arguments: &Bound<'py, PyTuple>,
    named: &Bound<'py, PyDict>,
) -> PyResult<Bound<'py, PyAny>> {
    let maker = match method {
        "" => cls.clone(),
        method => cls.getattr(method)?,
    };
    maker.call(arguments, Some(named))
}

/// What `__reduce__` returns: [`restore`] and its arguments.
pub type Reduced<'py> = (Bound<'py, PyAny>, Bound<'py, PyTuple>);

/// The call that made an object.
pub struct Origin {
    method: &'static str,
    arguments: Py<PyTuple>,
    named: Py<PyDict>,
}

impl Origin {
    /// A call of the class itself, or of one of its static methods.
    pub fn new<'py, A>(py: Python<'py>, method: &'static str, arguments: A) -> PyResult<Self>
    where
        A: IntoPyObject<'py, Target = PyTuple, Output = Bound<'py, PyTuple>>,
        A::Error: Into<PyErr>,
    {
        let arguments = arguments.into_pyobject(py).map_err(Into::into)?;
        Ok(Self {
            method,
            arguments: arguments.unbind(),
            named: PyDict::new(py).unbind(),
        })
    }

    /// The same with an argument by its name.
    pub fn with<'py, V: IntoPyObject<'py>>(
        self,
        py: Python<'py>,
        name: &str,
        value: V,
    ) -> PyResult<Self> {
        self.named.bind(py).set_item(name, value)?;
        Ok(self)
    }

    /// The arguments of `__reduce__` for an object of class `T`.
    pub fn reduce<'py, T: pyo3::PyTypeInfo>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let cls = py.get_type::<T>();
        let method = PyString::new(py, self.method);
        let call = (cls, method, self.arguments.bind(py), self.named.bind(py));
        let restore = py.import("atvrec._atvrec")?.getattr("_restore")?;
        Ok((restore, call.into_pyobject(py)?))
    }
}
