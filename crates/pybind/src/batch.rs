//! Many runs of a model at once, on all cores.

use std::borrow::Cow;
use std::ops::Range;

use model::integrate::{LANES, Tolerance};
use model::simulation::{Grid, Model, side_by_side};
use numpy::ndarray::{ArrayD, IxDyn};
use numpy::{IntoPyArray, PyArrayDyn, PyUntypedArrayMethods};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PySlice};
use rayon::prelude::*;

use crate::errors;
use crate::input::{self, Doubles};

/// Below this number of steps a batch is not worth a second thread.
const STEPS_FOR_THREADS: usize = 2_000;

/// A chassis model as rows of numbers.
pub trait Dynamics: Model {
    /// Names of the states' numbers, with units.
    fn state_names() -> &'static [String];
    /// Names of the inputs' numbers, with units.
    fn input_names() -> &'static [String];
    /// The state from numbers in the order of [`Dynamics::state_names`].
    fn state(values: &[f64]) -> Self::State;
    /// The numbers of a state.
    fn write(state: &Self::State, values: &mut [f64]);
    /// Inputs from numbers in the order of [`Dynamics::input_names`].
    fn inputs(values: &[f64]) -> Self::Inputs;
}

/// States and inputs of a batch, brought to one number of rows.
struct Rows<'a> {
    states: Cow<'a, [f64]>,
    inputs: Cow<'a, [f64]>,
    /// Number of runs.
    count: usize,
    /// Whether states, or inputs, are the same for all runs.
    shared: [bool; 2],
    /// Inputs of each run: one row for each of its steps, or a single one.
    input_rows: usize,
    /// Whether there is an axis of runs at all.
    batched: bool,
}

impl<'a> Rows<'a> {
    fn new<D: Dynamics>(
        states: &'a Doubles<'_>,
        inputs: &'a Doubles<'_>,
        models: Option<usize>,
        in_time: bool,
    ) -> PyResult<Self> {
        let numbers = input::rows("state", states, D::state_names())?;
        let input_numbers = input::rows("inputs", inputs, D::input_names())?;
        for row in input_numbers.chunks_exact(D::input_names().len()) {
            D::check_inputs(&D::inputs(row)).map_err(|e| errors::model(&e))?;
        }
        let own_axes = if in_time { 2 } else { 1 };
        let (of_state, of_inputs) = (states.shape(), inputs.shape());
        if of_state.len() > 2 || of_inputs.len() > own_axes + 1 {
            return Err(errors::argument(format!(
                "state has the shape {of_state:?} and inputs {of_inputs:?}: at most one axis of \
                 runs may stand before their own"
            )));
        }
        let runs = [
            (of_state.len() == 2).then(|| of_state[0]),
            (of_inputs.len() == own_axes + 1).then(|| of_inputs[0]),
            models,
        ];
        let count = runs.iter().flatten().copied().next().unwrap_or(1);
        if runs.iter().flatten().any(|n| *n != count) {
            let [a, b, c] = runs.map(|n| n.map_or("one for all".to_owned(), |n| n.to_string()));
            return Err(errors::argument(format!(
                "the numbers of runs differ: state {a}, inputs {b}, models {c}"
            )));
        }
        let input_rows = match of_inputs.len() {
            2 | 3 if in_time => of_inputs[of_inputs.len() - 2],
            _ => 1,
        };
        Ok(Self {
            states: numbers,
            inputs: input_numbers,
            count,
            shared: [runs[0].is_none(), runs[1].is_none()],
            input_rows,
            batched: runs.iter().any(Option::is_some),
        })
    }

    fn state(&self, run: usize, width: usize) -> &[f64] {
        let run = if self.shared[0] { 0 } else { run };
        &self.states[run * width..(run + 1) * width]
    }

    /// Inputs of the run's step.
    fn input(&self, run: usize, step: usize, width: usize) -> &[f64] {
        let run = if self.shared[1] { 0 } else { run };
        let step = if self.input_rows == 1 { 0 } else { step };
        let row = run * self.input_rows + step;
        &self.inputs[row * width..(row + 1) * width]
    }

    /// Steps some runs of one model side by side; `keep` counts them from zero.
    fn run<D: Dynamics>(
        &self,
        model: &D,
        runs: Range<usize>,
        grid: &Grid,
        keep: impl FnMut(usize, usize, &D::State),
    ) {
        let (width, inputs) = (D::state_names().len(), D::input_names().len());
        let starts: Vec<D::State> = runs
            .clone()
            .map(|run| D::state(self.state(run, width)))
            .collect();
        side_by_side(
            model,
            &starts,
            grid,
            self.input_rows.saturating_sub(1),
            |run, step| D::inputs(self.input(runs.start + run, step, inputs)),
            keep,
        );
    }

    fn shape(&self, own: &[usize]) -> IxDyn {
        let runs = self.batched.then_some(self.count);
        IxDyn(
            &runs
                .into_iter()
                .chain(own.iter().copied())
                .collect::<Vec<_>>(),
        )
    }
}

type Array<'py> = Bound<'py, PyArrayDyn<f64>>;

/// One row of results for each run, `width` numbers wide.
pub fn map<'py, D: Dynamics>(
    py: Python<'py>,
    model: &D,
    states: &Doubles<'py>,
    inputs: &Doubles<'py>,
    own_shape: &[usize],
    work: impl Fn(&D, &D::State, &D::Inputs, &mut [f64]) + Sync,
) -> PyResult<Array<'py>> {
    let rows = Rows::new::<D>(states, inputs, None, false)?;
    let width: usize = own_shape.iter().product();
    let values = py.detach(|| {
        fill(rows.count, width, |run, out| {
            let state = D::state(rows.state(run, D::state_names().len()));
            let input = D::inputs(rows.input(run, 0, D::input_names().len()));
            work(model, &state, &input, out);
        })
    });
    array(py, rows.shape(own_shape), values)
}

/// The states `steps` steps later, inputs held.
pub fn step<'py, D: Dynamics>(
    py: Python<'py>,
    model: &D,
    states: &Doubles<'py>,
    inputs: &Doubles<'py>,
    step_s: f64,
    steps: usize,
) -> PyResult<Array<'py>> {
    input::positive("step_s", step_s, "s")?;
    let rows = Rows::new::<D>(states, inputs, None, false)?;
    let width = D::state_names().len();
    let grid = Grid {
        step_s,
        steps,
        every: steps.max(1),
    };
    let values = py.detach(|| {
        grouped(rows.count, width, steps, LANES, |runs, out| {
            rows.run(model, runs, &grid, |run, _, state| {
                D::write(state, &mut out[run * width..(run + 1) * width]);
            });
        })
    });
    array(py, rows.shape(&[width]), values)
}

/// How a simulation runs.
#[derive(Clone, Copy)]
pub struct Schedule {
    /// Length of a step, s.
    pub step_s: f64,
    /// Number of steps; without it, as many as there are inputs.
    pub steps: Option<usize>,
    /// Every how many steps the state is kept.
    pub every: usize,
}

/// States over time, the first included: all of one model, or of one model for each run.
pub fn simulate<'py, D: Dynamics>(
    py: Python<'py>,
    models: &[&D],
    states: &Doubles<'py>,
    inputs: &Doubles<'py>,
    schedule: Schedule,
) -> PyResult<Array<'py>> {
    input::positive("step_s", schedule.step_s, "s")?;
    let count = (models.len() != 1).then_some(models.len());
    let rows = Rows::new::<D>(states, inputs, count, true)?;
    let steps = schedule.steps.unwrap_or(rows.input_rows);
    if rows.input_rows != 1 && rows.input_rows != steps {
        return Err(errors::argument(format!(
            "inputs has {} rows for steps = {steps}: give one for all steps, or one for each",
            rows.input_rows
        )));
    }
    let grid = Grid {
        step_s: schedule.step_s,
        steps,
        every: schedule.every.max(1),
    };
    let (width, kept) = (D::state_names().len(), grid.kept());
    let size = if models.len() == 1 { LANES } else { 1 };
    let values = py.detach(|| {
        grouped(rows.count, width * kept, steps, size, |runs, out| {
            let model = models[if models.len() == 1 { 0 } else { runs.start }];
            rows.run(model, runs, &grid, |run, number, state| {
                let place = (run * kept + number) * width;
                D::write(state, &mut out[place..place + width]);
            });
        })
    });
    array(py, rows.shape(&[kept, width]), values)
}

/// `count` rows of `width` numbers, each made by `work`, on all cores if that pays.
fn fill(count: usize, width: usize, work: impl Fn(usize, &mut [f64]) + Sync) -> Vec<f64> {
    grouped(count, width, 1, 1, |runs, out| work(runs.start, out))
}

/// `count` rows of `width` numbers, made by `work` for some `size` rows at once, on all cores if
/// that pays.
fn grouped(
    count: usize,
    width: usize,
    steps: usize,
    size: usize,
    work: impl Fn(Range<usize>, &mut [f64]) + Sync,
) -> Vec<f64> {
    let mut values = vec![0.0; count * width];
    if width == 0 {
        return values;
    }
    let range = |group: usize| group * size..((group + 1) * size).min(count);
    if count > size && count.saturating_mul(steps) >= STEPS_FOR_THREADS {
        let groups = values.par_chunks_mut(width * size).enumerate();
        groups.for_each(|(group, out)| work(range(group), out));
    } else {
        let groups = values.chunks_mut(width * size).enumerate();
        groups.for_each(|(group, out)| work(range(group), out));
    }
    values
}

fn array(py: Python<'_>, shape: IxDyn, values: Vec<f64>) -> PyResult<Array<'_>> {
    ArrayD::from_shape_vec(shape, values)
        .map(|array| array.into_pyarray(py))
        .map_err(|error| errors::argument(error.to_string()))
}

/// One row of numbers.
pub fn vector(py: Python<'_>, values: Vec<f64>) -> PyResult<Array<'_>> {
    array(py, IxDyn(&[values.len()]), values)
}

/// Parts of the last axis by name, as views; parts of one column lose the axis.
pub fn split<'py>(
    py: Python<'py>,
    all: &Array<'py>,
    parts: &[(&str, usize)],
) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    let mut first = 0;
    for (name, columns) in parts {
        let end = first + columns;
        let index = if *columns == 1 {
            first.into_bound_py_any(py)?
        } else {
            PySlice::new(py, first.cast_signed(), end.cast_signed(), 1).into_any()
        };
        dict.set_item(name, all.get_item((py.Ellipsis(), index))?)?;
        first = end;
    }
    Ok(dict)
}

/// Numbers in row order as an array of this shape.
pub fn shaped<'py>(py: Python<'py>, shape: &[usize], values: Vec<f64>) -> PyResult<Array<'py>> {
    array(py, IxDyn(shape), values)
}

/// A row of inputs, all finite.
pub fn input_row<'py>(py: Python<'py>, names: &[String], row: Vec<f64>) -> PyResult<Array<'py>> {
    if let Some(bad) = row.iter().position(|value| !value.is_finite()) {
        return Err(errors::argument(format!(
            "{} = {}: must be a finite number",
            names[bad], row[bad]
        )));
    }
    vector(py, row)
}

/// One state and one row of inputs, checked.
pub fn single<D: Dynamics>(state: &Doubles<'_>, inputs: &Doubles<'_>) -> PyResult<[Vec<f64>; 2]> {
    let start = input::rows("state", state, D::state_names())?;
    let held = input::rows("inputs", inputs, D::input_names())?;
    for (name, shape) in [("state", state.shape()), ("inputs", inputs.shape())] {
        if shape.len() != 1 {
            return Err(errors::argument(format!(
                "{name} has the shape {shape:?}: give one row"
            )));
        }
    }
    Ok([start.into_owned(), held.into_owned()])
}

/// Bounds of an adaptive integration over a duration.
pub fn tolerance(relative: f64, absolute: f64, duration_s: f64) -> PyResult<Tolerance> {
    input::positive("duration_s", duration_s, "s")?;
    Ok(Tolerance {
        relative: input::positive("relative", relative, "")?,
        absolute: input::positive("absolute", absolute, "")?,
        ..Tolerance::default()
    })
}
