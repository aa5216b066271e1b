//! The 14-degree-of-freedom model, in which a wheel really lifts.

use std::sync::LazyLock;

use model::chassis::fourteen_dof::{self, Inputs, Outputs, Parameters, State};
use model::integrate::adaptive;
use model::simulation::{ContactChange, with_events};
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::batch::{self, Dynamics, Schedule};
use crate::chassis::{self, chassis_class, each, one};
use crate::errors;
use crate::input::{self, Doubles, PerWheel};
use crate::origin::{Origin, Reduced};
use crate::vehicle::Vehicle;

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

fn change_name(change: ContactChange) -> &'static str {
    match change {
        ContactChange::LiftOff => "lift-off",
        ContactChange::TouchDown => "touch-down",
        ContactChange::DroopStop => "droop-stop",
        ContactChange::DroopFree => "droop-free",
        ContactChange::BumpStop => "bump-stop",
        ContactChange::BumpFree => "bump-free",
    }
}

chassis_class! {
    /// The 14-degree-of-freedom model: six of the body, four of the wheels' travel, four of their
    /// spin, with tyres that push only and suspension stops, so that a wheel really lifts.
    ///
    /// States are rows of 32 numbers (`STATES`), inputs rows of 30 (`INPUTS`); both take one axis of
    /// runs before their own. Outputs are for each wheel `load_n`, `deflection_m`,
    /// `longitudinal_n`, `lateral_n` (contact frame), `slip_angle_rad`, `slip_ratio`,
    /// `strut_length_m`, `strut_force_n`, and `specific_force_m_s2` (3, body axes) at the sprung
    /// part's centre of gravity.
    FourteenDof, fourteen_dof,
    states: [
        one("east", "m"),
        one("north", "m"),
        one("height", "m"),
        one("roll", "rad"),
        one("pitch", "rad"),
        one("yaw", "rad"),
        one("longitudinal", "m_s"),
        one("lateral", "m_s"),
        one("vertical", "m_s"),
        one("roll_rate", "rad_s"),
        one("pitch_rate", "rad_s"),
        one("yaw_rate", "rad_s"),
        each("jounce", "m"),
        each("jounce_rate", "m_s"),
        each("wheel_speed", "rad_s"),
        each("slip_tangent", ""),
        each("slip_ratio", ""),
    ],
    inputs: [
        each("steer", "rad"),
        each("drive", "n_m"),
        each("brake", "n_m"),
        each("road", "m"),
        each("road_rate", "m_s"),
        one("bank", "rad"),
        one("grade", "rad"),
        each("friction_scale", ""),
        each("stiffness_scale", ""),
    ],
    outputs: OUTPUTS, output_row,
    own: {
        /// The model of a vehicle. Raises VehicleError where it has no struts or unsprung masses.
        #[new]
        fn new(vehicle: &Bound<'_, Vehicle>) -> PyResult<Self> {
            let parameters = Parameters::from_vehicle(&vehicle.get().inner);
            Ok(Self {
                parameters: parameters.map_err(|e| errors::model(&e))?,
                origin: Origin::new(vehicle.py(), "", (vehicle,))?,
            })
        }

        /// The state of rolling straight ahead on level ground, springs and tyres carrying the
        /// vehicle: array (32,).
        fn rolling<'py>(&self, py: Python<'py>, speed_m_s: f64) -> PyResult<Array<'py>> {
            input::finite("speed_m_s", speed_m_s, "m/s")?;
            let rest = fourteen_dof::at_rest(&self.parameters).map_err(|e| errors::model(&e))?;
            let state = rest.rolling(speed_m_s, &self.parameters);
            batch::vector(py, state.to_array().to_vec())
        }

        /// One row of inputs: array (30,). `front_steer_rad` turns both front wheels; the others
        /// take one number for all wheels or four.
        #[staticmethod]
        #[pyo3(signature = (
            front_steer_rad=None, *, steer_rad=None, drive_n_m=None, brake_n_m=None, road_m=None,
            road_rate_m_s=None, bank_rad=0.0, grade_rad=0.0, friction_scale=None,
            stiffness_scale=None
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
            input::set(&mut inputs.steer_rad, steer_rad);
            input::set(&mut inputs.drive_n_m, drive_n_m);
            input::set(&mut inputs.brake_n_m, brake_n_m);
            input::set(&mut inputs.road_m, road_m);
            input::set(&mut inputs.road_rate_m_s, road_rate_m_s);
            input::set(&mut inputs.friction_scale, friction_scale);
            input::set(&mut inputs.stiffness_scale, stiffness_scale);
            inputs.bank_rad = bank_rad;
            inputs.grade_rad = grade_rad;
            if let Some(angle) = front_steer_rad {
                inputs.steer_rad[..2].fill(angle);
            }
            batch::input_row(py, &INPUTS, inputs.to_array().to_vec())
        }

        /// States over time with every change of contact found to the instant, inputs held, as a
        /// dict: `time_s` (K,), `states` (K, 32) after every step, the start first, and `events`, a
        /// list of (time in s, wheel, change). A step ends at an event; changes are lift-off,
        /// touch-down, droop-stop, droop-free, bump-stop and bump-free.
        fn simulate_events<'py>(
            &self,
            py: Python<'py>,
            state: Doubles<'py>,
            inputs: Doubles<'py>,
            duration_s: f64,
            step_s: f64,
        ) -> PyResult<Bound<'py, PyDict>> {
            let [start, held] = batch::single::<Parameters>(&state, &inputs)?;
            let held = <Parameters as Dynamics>::inputs(&held);
            let start = <Parameters as Dynamics>::state(&start);
            let (mut times, mut rows) = (vec![0.0], start.to_array().to_vec());
            let observe = |time_s: f64, state: &State<f64>| {
                times.push(time_s);
                rows.extend(state.to_array());
            };
            let p = &self.parameters;
            let (_, events) = py
                .detach(|| with_events(p, &start, duration_s, step_s, |_| held, observe))
                .map_err(|e| errors::model(&e))?;
            let names = ["fl", "fr", "rl", "rr"];
            let events: Vec<(f64, &str, &str)> = events
                .iter()
                .map(|event| {
                    let wheel = names[event.wheel.index()];
                    (event.time_s, wheel, change_name(event.change))
                })
                .collect();
            let dict = PyDict::new(py);
            let shape = [times.len(), fourteen_dof::STATES];
            dict.set_item("time_s", batch::vector(py, times)?)?;
            dict.set_item("states", batch::shaped(py, &shape, rows)?)?;
            dict.set_item("events", events)?;
            Ok(dict)
        }
    }
}
