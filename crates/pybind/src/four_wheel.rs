//! The non-linear four-wheel model.

use model::chassis::four_wheel::{self, Drive, Inputs, Outputs, Parameters, State};
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::batch::{self, Dynamics, Schedule};
use crate::errors;
use crate::input::{self, Doubles, PerWheel};
use crate::vehicle::Vehicle;

const STATES: [&str; four_wheel::STATES] = [
    "longitudinal_m_s",
    "lateral_m_s",
    "yaw_rate_rad_s",
    "roll_rad",
    "roll_rate_rad_s",
    "pitch_rad",
    "pitch_rate_rad_s",
    "slip_tangent_fl",
    "slip_tangent_fr",
    "slip_tangent_rl",
    "slip_tangent_rr",
    "slip_ratio_fl",
    "slip_ratio_fr",
    "slip_ratio_rl",
    "slip_ratio_rr",
    "wheel_speed_fl_rad_s",
    "wheel_speed_fr_rad_s",
    "wheel_speed_rl_rad_s",
    "wheel_speed_rr_rad_s",
];

const INPUTS: [&str; 22] = [
    "steer_fl_rad",
    "steer_fr_rad",
    "steer_rl_rad",
    "steer_rr_rad",
    "drive_fl_n_m",
    "drive_fr_n_m",
    "drive_rl_n_m",
    "drive_rr_n_m",
    "brake_fl_n_m",
    "brake_fr_n_m",
    "brake_rl_n_m",
    "brake_rr_n_m",
    "bank_rad",
    "grade_rad",
    "friction_scale_fl",
    "friction_scale_fr",
    "friction_scale_rl",
    "friction_scale_rr",
    "stiffness_scale_fl",
    "stiffness_scale_fr",
    "stiffness_scale_rl",
    "stiffness_scale_rr",
];

/// Names of what `outputs` gives, with the number of columns of each.
const OUTPUTS: [(&str, usize); 8] = [
    ("load_n", 4),
    ("longitudinal_n", 4),
    ("lateral_n", 4),
    ("aligning_n_m", 4),
    ("slip_angle_rad", 4),
    ("slip_ratio", 4),
    ("longitudinal_m_s2", 1),
    ("lateral_m_s2", 1),
];

impl Dynamics for Parameters {
    type State = State<f64>;
    type Inputs = Inputs<f64>;
    const STATES: &'static [&'static str] = &STATES;
    const INPUTS: &'static [&'static str] = &INPUTS;

    fn state(values: &[f64]) -> State<f64> {
        State::from_array(std::array::from_fn(|i| values[i]))
    }

    fn write(state: &State<f64>, values: &mut [f64]) {
        values.copy_from_slice(&state.to_array());
    }

    fn inputs(values: &[f64]) -> Inputs<f64> {
        let four = |first: usize| std::array::from_fn(|i| values[first + i]);
        Inputs {
            steer_rad: four(0),
            drive_n_m: four(4),
            brake_n_m: four(8),
            bank_rad: values[12],
            grade_rad: values[13],
            friction_scale: four(14),
            stiffness_scale: four(18),
        }
    }

    fn rate(&self, state: &State<f64>, inputs: &Inputs<f64>) -> State<f64> {
        four_wheel::derivative(self, state, inputs)
    }

    fn step(&self, state: &State<f64>, inputs: &Inputs<f64>, step_s: f64) -> State<f64> {
        four_wheel::step(self, state, inputs, step_s)
    }
}

fn input_row(inputs: &Inputs<f64>) -> Vec<f64> {
    let mut row = Vec::with_capacity(INPUTS.len());
    row.extend(inputs.steer_rad);
    row.extend(inputs.drive_n_m);
    row.extend(inputs.brake_n_m);
    row.extend([inputs.bank_rad, inputs.grade_rad]);
    row.extend(inputs.friction_scale);
    row.extend(inputs.stiffness_scale);
    row
}

fn output_row(outputs: &Outputs<f64>, row: &mut [f64]) {
    let lists = [
        outputs.load_n,
        outputs.longitudinal_n,
        outputs.lateral_n,
        outputs.aligning_n_m,
        outputs.slip_angle_rad,
        outputs.slip_ratio,
    ];
    row[..24].copy_from_slice(lists.as_flattened());
    row[24] = outputs.longitudinal_m_s2;
    row[25] = outputs.lateral_m_s2;
}

/// The non-linear four-wheel model: planar motion, roll, pitch, load transfer, bank and grade,
/// wheel spin and tyre relaxation (section 2.1.2 of the thesis, put right).
///
/// States are rows of 19 numbers (`STATES`), inputs rows of 22 (`INPUTS`); both take one axis of
/// runs before their own. Batches run on all cores, without Python's lock.
#[pyclass(frozen, module = "atvrec")]
pub struct FourWheel {
    parameters: Parameters,
}

type Array<'py> = Bound<'py, PyArrayDyn<f64>>;

#[pymethods]
impl FourWheel {
    /// Names of the states, with units.
    #[classattr]
    #[pyo3(name = "STATES")]
    fn states() -> [&'static str; four_wheel::STATES] {
        STATES
    }

    /// Names of the inputs, with units.
    #[classattr]
    #[pyo3(name = "INPUTS")]
    fn input_names() -> [&'static str; 22] {
        INPUTS
    }

    /// The model of a vehicle.
    #[new]
    fn new(vehicle: &Vehicle) -> Self {
        Self {
            parameters: Parameters::from_vehicle(&vehicle.inner),
        }
    }

    /// The state of rolling straight ahead: array (19,).
    fn rolling<'py>(&self, py: Python<'py>, speed_m_s: f64) -> PyResult<Array<'py>> {
        input::finite("speed_m_s", speed_m_s, "m/s")?;
        let state = State::<f64>::rolling(speed_m_s, &self.parameters);
        batch::vector(py, state.to_array().to_vec())
    }

    /// One row of inputs: array (22,). `front_steer_rad` turns both front wheels; the others take
    /// one number for all wheels or four.
    #[staticmethod]
    #[pyo3(signature = (
        front_steer_rad=None, *, steer_rad=None, drive_n_m=None, brake_n_m=None, bank_rad=0.0,
        grade_rad=0.0, friction_scale=None, stiffness_scale=None
    ))]
    #[allow(clippy::too_many_arguments)]
    fn inputs<'py>(
        py: Python<'py>,
        front_steer_rad: Option<f64>,
        steer_rad: Option<PerWheel>,
        drive_n_m: Option<PerWheel>,
        brake_n_m: Option<PerWheel>,
        bank_rad: f64,
        grade_rad: f64,
        friction_scale: Option<PerWheel>,
        stiffness_scale: Option<PerWheel>,
    ) -> PyResult<Array<'py>> {
        let mut inputs = Inputs::<f64>::coasting();
        let set = |place: &mut [f64; 4], value: Option<PerWheel>| {
            if let Some(value) = value {
                *place = value.each();
            }
        };
        set(&mut inputs.steer_rad, steer_rad);
        set(&mut inputs.drive_n_m, drive_n_m);
        set(&mut inputs.brake_n_m, brake_n_m);
        set(&mut inputs.friction_scale, friction_scale);
        set(&mut inputs.stiffness_scale, stiffness_scale);
        inputs.bank_rad = bank_rad;
        inputs.grade_rad = grade_rad;
        if let Some(angle) = front_steer_rad {
            inputs.steer_rad[0] = angle;
            inputs.steer_rad[1] = angle;
        }
        batch::input_row(py, &INPUTS, input_row(&inputs))
    }

    /// Rate of the state: array (19,) or (N, 19).
    fn derivative<'py>(
        &self,
        py: Python<'py>,
        state: Doubles<'py>,
        inputs: Doubles<'py>,
    ) -> PyResult<Array<'py>> {
        batch::rate(py, &self.parameters, &state, &inputs)
    }

    /// The state `steps` Runge-Kutta steps (fourth order) of `step_s` later, inputs held: array
    /// (19,) or (N, 19).
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

    /// States over time, the first included: array (K+1, 19) or (N, K+1, 19).
    ///
    /// `inputs` is (22,) for all steps, (T, 22) with one row a step, or (N, T, 22); `state` (19,) or
    /// (N, 19). Every `every`-th state is kept: K = steps // every.
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
        models: Vec<Py<FourWheel>>,
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

    /// Loads, forces, slips and accelerations as a dict of arrays (..., 4) or (...): `load_n`,
    /// `longitudinal_n`, `lateral_n` (wheel frame), `aligning_n_m`, `slip_angle_rad`, `slip_ratio`,
    /// `longitudinal_m_s2`, `lateral_m_s2` (of the centre of gravity, body axes).
    fn outputs<'py>(
        &self,
        py: Python<'py>,
        state: Doubles<'py>,
        inputs: Doubles<'py>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let width = OUTPUTS.iter().map(|(_, columns)| columns).sum();
        let all = batch::map(
            py,
            &self.parameters,
            &state,
            &inputs,
            &[width],
            |model, state, inputs, row| {
                output_row(&four_wheel::outputs(model, state, inputs), row);
            },
        )?;
        batch::split(py, &all, &OUTPUTS)
    }

    /// Exact Jacobian of the rate by the state: array (19, 19) or (N, 19, 19).
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        state: Doubles<'py>,
        inputs: Doubles<'py>,
    ) -> PyResult<Array<'py>> {
        let n = four_wheel::STATES;
        batch::map(
            py,
            &self.parameters,
            &state,
            &inputs,
            &[n, n],
            |model, state, inputs, out| {
                let jacobian = four_wheel::jacobian(model, state, inputs);
                out.copy_from_slice(jacobian.transpose().as_slice());
            },
        )
    }

    /// The steady turn at a longitudinal velocity on a radius (positive: to the left) as a dict:
    /// `state` (19,), `inputs` (22,) and all of `outputs`.
    ///
    /// Without `drive_front` the speed is held from outside; with it the engine holds it, with this
    /// part of the torque on the front axle. Raises SimulationError beyond the tyres' grip.
    #[pyo3(signature = (longitudinal_m_s, radius_m, drive_front=None))]
    fn steady_turn<'py>(
        &self,
        py: Python<'py>,
        longitudinal_m_s: f64,
        radius_m: f64,
        drive_front: Option<f64>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let drive = drive_front.map_or(Drive::Free, |front| Drive::Torque { front });
        let turn = py
            .detach(|| four_wheel::steady_turn(&self.parameters, longitudinal_m_s, radius_m, drive))
            .map_err(|e| errors::model(&e))?;
        let mut row = vec![0.0; OUTPUTS.iter().map(|(_, columns)| columns).sum()];
        output_row(&turn.outputs, &mut row);
        let dict = batch::split(py, &batch::vector(py, row)?, &OUTPUTS)?;
        dict.set_item("state", batch::vector(py, turn.state.to_array().to_vec())?)?;
        dict.set_item("inputs", batch::vector(py, input_row(&turn.inputs))?)?;
        Ok(dict)
    }
}
