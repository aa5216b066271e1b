//! The 14-degree-of-freedom model, in which a wheel really lifts.

use model::chassis::fourteen_dof::{self, Inputs, Outputs, Parameters, State};
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::batch::{self, Dynamics, Schedule};
use crate::errors;
use crate::input::{self, Doubles, PerWheel};
use crate::vehicle::Vehicle;

const STATES: [&str; fourteen_dof::STATES] = [
    "east_m",
    "north_m",
    "height_m",
    "roll_rad",
    "pitch_rad",
    "yaw_rad",
    "longitudinal_m_s",
    "lateral_m_s",
    "vertical_m_s",
    "roll_rate_rad_s",
    "pitch_rate_rad_s",
    "yaw_rate_rad_s",
    "jounce_fl_m",
    "jounce_fr_m",
    "jounce_rl_m",
    "jounce_rr_m",
    "jounce_rate_fl_m_s",
    "jounce_rate_fr_m_s",
    "jounce_rate_rl_m_s",
    "jounce_rate_rr_m_s",
    "wheel_speed_fl_rad_s",
    "wheel_speed_fr_rad_s",
    "wheel_speed_rl_rad_s",
    "wheel_speed_rr_rad_s",
    "slip_tangent_fl",
    "slip_tangent_fr",
    "slip_tangent_rl",
    "slip_tangent_rr",
    "slip_ratio_fl",
    "slip_ratio_fr",
    "slip_ratio_rl",
    "slip_ratio_rr",
];

const INPUTS: [&str; 30] = [
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
    "road_fl_m",
    "road_fr_m",
    "road_rl_m",
    "road_rr_m",
    "road_rate_fl_m_s",
    "road_rate_fr_m_s",
    "road_rate_rl_m_s",
    "road_rate_rr_m_s",
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
const OUTPUTS: [(&str, usize); 9] = [
    ("load_n", 4),
    ("deflection_m", 4),
    ("longitudinal_n", 4),
    ("lateral_n", 4),
    ("slip_angle_rad", 4),
    ("slip_ratio", 4),
    ("strut_length_m", 4),
    ("strut_force_n", 4),
    ("specific_force_m_s2", 3),
];
const OUTPUT_WIDTH: usize = 35;

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
            road_m: four(12),
            road_rate_m_s: four(16),
            bank_rad: values[20],
            grade_rad: values[21],
            friction_scale: four(22),
            stiffness_scale: four(26),
        }
    }

    fn rate(&self, state: &State<f64>, inputs: &Inputs<f64>) -> State<f64> {
        fourteen_dof::derivative(self, state, inputs)
    }

    fn step(&self, state: &State<f64>, inputs: &Inputs<f64>, step_s: f64) -> State<f64> {
        fourteen_dof::step(self, state, inputs, step_s)
    }
}

fn input_row(inputs: &Inputs<f64>) -> Vec<f64> {
    let mut row = Vec::with_capacity(INPUTS.len());
    row.extend(inputs.steer_rad);
    row.extend(inputs.drive_n_m);
    row.extend(inputs.brake_n_m);
    row.extend(inputs.road_m);
    row.extend(inputs.road_rate_m_s);
    row.extend([inputs.bank_rad, inputs.grade_rad]);
    row.extend(inputs.friction_scale);
    row.extend(inputs.stiffness_scale);
    row
}

fn output_row(outputs: &Outputs<f64>, row: &mut [f64]) {
    let lists = [
        outputs.load_n,
        outputs.deflection_m,
        outputs.longitudinal_n,
        outputs.lateral_n,
        outputs.slip_angle_rad,
        outputs.slip_ratio,
        outputs.strut_length_m,
        outputs.strut_force_n,
    ];
    row[..32].copy_from_slice(lists.as_flattened());
    row[32..].copy_from_slice(&outputs.specific_force_m_s2);
}

/// The 14-degree-of-freedom model: six of the body, four of the wheels' travel, four of their spin,
/// with tyres that push only and suspension stops, so that a wheel really lifts.
///
/// States are rows of 32 numbers (`STATES`), inputs rows of 30 (`INPUTS`); both take one axis of
/// runs before their own.
#[pyclass(frozen, module = "atvrec")]
pub struct FourteenDof {
    parameters: Parameters,
}

type Array<'py> = Bound<'py, PyArrayDyn<f64>>;

#[pymethods]
impl FourteenDof {
    /// Names of the states, with units.
    #[classattr]
    #[pyo3(name = "STATES")]
    fn states() -> [&'static str; fourteen_dof::STATES] {
        STATES
    }

    /// Names of the inputs, with units.
    #[classattr]
    #[pyo3(name = "INPUTS")]
    fn input_names() -> [&'static str; 30] {
        INPUTS
    }

    /// The model of a vehicle. Raises VehicleError where it has no struts or unsprung masses.
    #[new]
    fn new(vehicle: &Vehicle) -> PyResult<Self> {
        let parameters = Parameters::from_vehicle(&vehicle.inner);
        parameters
            .map(|parameters| Self { parameters })
            .map_err(|e| errors::model(&e))
    }

    /// The state of rolling straight ahead on level ground, springs and tyres carrying the vehicle:
    /// array (32,).
    fn rolling<'py>(&self, py: Python<'py>, speed_m_s: f64) -> PyResult<Array<'py>> {
        input::finite("speed_m_s", speed_m_s, "m/s")?;
        let rest = fourteen_dof::at_rest(&self.parameters).map_err(|e| errors::model(&e))?;
        let state = rest.rolling(speed_m_s, &self.parameters);
        batch::vector(py, state.to_array().to_vec())
    }

    /// One row of inputs: array (30,). `front_steer_rad` turns both front wheels; the others take
    /// one number for all wheels or four.
    #[staticmethod]
    #[pyo3(signature = (
        front_steer_rad=None, *, steer_rad=None, drive_n_m=None, brake_n_m=None, road_m=None,
        road_rate_m_s=None, bank_rad=0.0, grade_rad=0.0, friction_scale=None, stiffness_scale=None
    ))]
    #[allow(clippy::too_many_arguments)]
    fn inputs<'py>(
        py: Python<'py>,
        front_steer_rad: Option<f64>,
        steer_rad: Option<PerWheel>,
        drive_n_m: Option<PerWheel>,
        brake_n_m: Option<PerWheel>,
        road_m: Option<PerWheel>,
        road_rate_m_s: Option<PerWheel>,
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
        set(&mut inputs.road_m, road_m);
        set(&mut inputs.road_rate_m_s, road_rate_m_s);
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

    /// Rate of the state: array (32,) or (N, 32).
    fn derivative<'py>(
        &self,
        py: Python<'py>,
        state: Doubles<'py>,
        inputs: Doubles<'py>,
    ) -> PyResult<Array<'py>> {
        batch::rate(py, &self.parameters, &state, &inputs)
    }

    /// The state `steps` Runge-Kutta steps (fourth order) of `step_s` later, inputs held: array
    /// (32,) or (N, 32).
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

    /// States over time, the first included: array (K+1, 32) or (N, K+1, 32).
    ///
    /// `inputs` is (30,) for all steps, (T, 30) with one row a step, or (N, T, 30); `state` (32,) or
    /// (N, 32). Every `every`-th state is kept: K = steps // every.
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

    /// Loads, forces, slips and struts as a dict of arrays (..., 4): `load_n` (zero in the air),
    /// `deflection_m` of the tyres (negative: clearance), `longitudinal_n`, `lateral_n` (contact
    /// frame), `slip_angle_rad`, `slip_ratio`, `strut_length_m`, `strut_force_n`; and
    /// `specific_force_m_s2` (..., 3) at the sprung part's centre of gravity.
    fn outputs<'py>(
        &self,
        py: Python<'py>,
        state: Doubles<'py>,
        inputs: Doubles<'py>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let all = batch::map(
            py,
            &self.parameters,
            &state,
            &inputs,
            &[OUTPUT_WIDTH],
            |model, state, inputs, row| {
                output_row(&fourteen_dof::outputs(model, state, inputs), row);
            },
        )?;
        batch::split(py, &all, &OUTPUTS)
    }

    /// Exact Jacobian of the rate by the state: array (32, 32) or (N, 32, 32).
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        state: Doubles<'py>,
        inputs: Doubles<'py>,
    ) -> PyResult<Array<'py>> {
        let n = fourteen_dof::STATES;
        batch::map(
            py,
            &self.parameters,
            &state,
            &inputs,
            &[n, n],
            |model, state, inputs, out| {
                let jacobian = fourteen_dof::jacobian(model, state, inputs);
                out.copy_from_slice(jacobian.transpose().as_slice());
            },
        )
    }
}
