//! What the chassis models have in common in Python.

/// Names of numbers: for a quantity with its unit one name, or one for each wheel, as in
/// `wheel_speed_fl_rad_s`.
pub struct Quantity {
    /// Name without the unit.
    pub stem: &'static str,
    /// Unit, or nothing.
    pub unit: &'static str,
    /// Whether each wheel has one.
    pub per_wheel: bool,
}

/// One quantity.
pub const fn one(stem: &'static str, unit: &'static str) -> Quantity {
    Quantity {
        stem,
        unit,
        per_wheel: false,
    }
}

/// One quantity for each wheel.
pub const fn each(stem: &'static str, unit: &'static str) -> Quantity {
    Quantity {
        stem,
        unit,
        per_wheel: true,
    }
}

/// All names of some quantities.
pub fn names(quantities: &[Quantity]) -> Vec<String> {
    let wheels = |quantity: &Quantity| -> &'static [&'static str] {
        if quantity.per_wheel {
            &["fl", "fr", "rl", "rr"]
        } else {
            &[""]
        }
    };
    quantities
        .iter()
        .flat_map(|quantity| {
            wheels(quantity).iter().map(move |wheel| {
                let parts = [quantity.stem, wheel, quantity.unit];
                let parts: Vec<_> = parts.into_iter().filter(|part| !part.is_empty()).collect();
                parts.join("_")
            })
        })
        .collect()
}

/// Implements [`Dynamics`](crate::batch::Dynamics) for a model's parameters, and makes the Python
/// class around them with the methods that all chassis models share.
///
/// `model` is the model's module; `states` and `inputs` list the names of rows; `outputs` names the
/// entries of the dict with their columns, and writes them; `own` holds the class's own methods.
macro_rules! chassis_class {
    (
        $(#[$doc:meta])*
        $class:ident, $model:ident,
        states: $states:expr,
        inputs: $inputs:expr,
        outputs: $outputs:expr, $output_row:expr,
        own: { $($own:tt)* }
    ) => {
        static STATES: LazyLock<Vec<String>> = LazyLock::new(|| chassis::names(&$states));
        static INPUTS: LazyLock<Vec<String>> = LazyLock::new(|| chassis::names(&$inputs));

        impl Dynamics for Parameters {
            fn state_names() -> &'static [String] {
                &STATES
            }

            fn input_names() -> &'static [String] {
                &INPUTS
            }

            fn state(values: &[f64]) -> State<f64> {
                State::from_array(std::array::from_fn(|i| values[i]))
            }

            fn write(state: &State<f64>, values: &mut [f64]) {
                values.copy_from_slice(&state.to_array());
            }

            fn inputs(values: &[f64]) -> Inputs<f64> {
                Inputs::from_array(&std::array::from_fn(|i| values[i]))
            }
        }

        $(#[$doc])*
        #[pyclass(frozen, module = "atvrec")]
        pub struct $class {
            parameters: Parameters,
            origin: Origin,
        }

        type Array<'py> = Bound<'py, PyArrayDyn<f64>>;

        #[pymethods]
        impl $class {
            /// Names of the states, with units.
            #[classattr]
            #[pyo3(name = "STATES")]
            fn states() -> Vec<String> {
                STATES.clone()
            }

            /// Names of the inputs, with units.
            #[classattr]
            #[pyo3(name = "INPUTS")]
            fn input_names() -> Vec<String> {
                INPUTS.clone()
            }

            $($own)*

            fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
                self.origin.reduce::<Self>(py)
            }

            /// Rate of the state: array (S,) or (N, S), with S = len(STATES).
            fn derivative<'py>(
                &self,
                py: Python<'py>,
                state: Doubles<'py>,
                inputs: Doubles<'py>,
            ) -> PyResult<Array<'py>> {
                let width = [$model::STATES];
                batch::map(py, &self.parameters, &state, &inputs, &width, |p, x, u, out| {
                    out.copy_from_slice(&$model::derivative(p, x, u).to_array());
                })
            }

            /// The state `steps` Runge-Kutta steps (fourth order) of `step_s` later, inputs held:
            /// array (S,) or (N, S).
            #[pyo3(signature = (state, inputs, step_s, steps=1))]
            fn step<'py>(
                &self,
                py: Python<'py>,
                state: Doubles<'py>,
                inputs: Doubles<'py>,
                step_s: f64,
                steps: usize,
            ) -> PyResult<Array<'py>> {
                batch::step(py, &self.parameters, &state, &inputs, step_s, steps)
            }

            /// States over time, the first included: array (K+1, S) or (N, K+1, S).
            ///
            /// `inputs` is (I,) for all steps, (T, I) with one row a step, or (N, T, I), with
            /// I = len(INPUTS); `state` (S,) or (N, S). Every `every`-th state is kept:
            /// K = steps // every.
            #[pyo3(signature = (state, inputs, step_s, steps=None, every=1))]
            fn simulate<'py>(
                &self,
                py: Python<'py>,
                state: Doubles<'py>,
                inputs: Doubles<'py>,
                step_s: f64,
                steps: Option<usize>,
                every: usize,
            ) -> PyResult<Array<'py>> {
                let schedule = Schedule {
                    step_s,
                    steps,
                    every,
                };
                batch::simulate(py, &[&self.parameters], &state, &inputs, schedule)
            }

            /// The same with a model of its own for each of the N runs: rollouts over parameters.
            #[staticmethod]
            #[pyo3(signature = (models, state, inputs, step_s, steps=None, every=1))]
            fn simulate_each<'py>(
                py: Python<'py>,
                models: Vec<Py<$class>>,
                state: Doubles<'py>,
                inputs: Doubles<'py>,
                step_s: f64,
                steps: Option<usize>,
                every: usize,
            ) -> PyResult<Array<'py>> {
                let schedule = Schedule {
                    step_s,
                    steps,
                    every,
                };
                let parameters: Vec<&Parameters> =
                    models.iter().map(|model| &model.get().parameters).collect();
                batch::simulate(py, &parameters, &state, &inputs, schedule)
            }

            /// States over time with steps as long as the tolerance allows (Dormand and Prince's
            /// pair), inputs held, as (times (K,) in s, states (K, S)); the first is the start.
            /// `relative` and `absolute` bound the error of a step for each number, in its unit.
            #[pyo3(signature = (state, inputs, duration_s, *, relative=1e-8, absolute=1e-9))]
            fn simulate_adaptive<'py>(
                &self,
                py: Python<'py>,
                state: Doubles<'py>,
                inputs: Doubles<'py>,
                duration_s: f64,
                relative: f64,
                absolute: f64,
            ) -> PyResult<(Array<'py>, Array<'py>)> {
                let tolerance = batch::tolerance(relative, absolute, duration_s)?;
                let [start, held] =
                    batch::single::<Parameters>(&state, &inputs)?;
                let inputs = <Parameters as Dynamics>::inputs(&held);
                let start = <Parameters as Dynamics>::state(&start).to_array();
                let (mut times, mut rows) = (vec![0.0], start.to_vec());
                py.detach(|| {
                    adaptive(
                        &start,
                        0.0,
                        duration_s,
                        &tolerance,
                        |_, x| {
                            let state = State::from_array(*x);
                            $model::derivative(&self.parameters, &state, &inputs).to_array()
                        },
                        |time_s, x| {
                            times.push(time_s);
                            rows.extend_from_slice(x);
                        },
                    )
                })
                .map_err(|e| errors::model(&e))?;
                let shape = [times.len(), $model::STATES];
                Ok((batch::vector(py, times)?, batch::shaped(py, &shape, rows)?))
            }

            /// What the model tells besides the rate, as a dict of arrays (..., columns), or (...)
            /// where there is one column; see the class for the names.
            fn outputs<'py>(
                &self,
                py: Python<'py>,
                state: Doubles<'py>,
                inputs: Doubles<'py>,
            ) -> PyResult<Bound<'py, PyDict>> {
                let width = [$outputs.iter().map(|(_, columns)| columns).sum()];
                let write = $output_row;
                let all = batch::map(py, &self.parameters, &state, &inputs, &width, |p, x, u, out| {
                    write(&$model::outputs(p, x, u), out);
                })?;
                batch::split(py, &all, &$outputs)
            }

            /// Exact Jacobian of the rate by the state: array (S, S) or (N, S, S), row i and column
            /// j d(rate_i)/d(state_j).
            fn jacobian<'py>(
                &self,
                py: Python<'py>,
                state: Doubles<'py>,
                inputs: Doubles<'py>,
            ) -> PyResult<Array<'py>> {
                let shape = [$model::STATES, $model::STATES];
                batch::map(py, &self.parameters, &state, &inputs, &shape, |p, x, u, out| {
                    let jacobian = $model::jacobian(p, x, u);
                    out.copy_from_slice(jacobian.transpose().as_slice());
                })
            }
        }
    };
}

pub(crate) use chassis_class;
