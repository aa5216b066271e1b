//! The non-linear four-wheel model.

use std::sync::LazyLock;

use model::chassis::four_wheel::{self, Drive, Inputs, Outputs, Parameters, State};
use model::integrate::adaptive;
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

chassis_class! {
    /// The non-linear four-wheel model: planar motion, roll, pitch, load transfer, bank and grade,
    /// wheel spin and tyre relaxation (section 2.1.2 of the thesis, put right).
    ///
    /// States are rows of 19 numbers (`STATES`), inputs rows of 22 (`INPUTS`); both take one axis of
    /// runs before their own. Batches run on all cores, without Python's lock. Outputs are `load_n`,
    /// `longitudinal_n`, `lateral_n` (wheel frame), `aligning_n_m`, `slip_angle_rad`, `slip_ratio`
    /// for each wheel, and `longitudinal_m_s2`, `lateral_m_s2` of the centre of gravity (body axes).
    FourWheel, four_wheel,
    states: [
        one("longitudinal", "m_s"),
        one("lateral", "m_s"),
        one("yaw_rate", "rad_s"),
        one("roll", "rad"),
        one("roll_rate", "rad_s"),
        one("pitch", "rad"),
        one("pitch_rate", "rad_s"),
        each("slip_tangent", ""),
        each("slip_ratio", ""),
        each("wheel_speed", "rad_s"),
    ],
    inputs: [
        each("steer", "rad"),
        each("drive", "n_m"),
        each("brake", "n_m"),
        one("bank", "rad"),
        one("grade", "rad"),
        each("friction_scale", ""),
        each("stiffness_scale", ""),
    ],
    outputs: OUTPUTS, output_row,
    own: {
        /// The model of a vehicle.
        #[new]
        fn new(vehicle: &Bound<'_, Vehicle>) -> PyResult<Self> {
            Ok(Self {
                parameters: Parameters::from_vehicle(&vehicle.get().inner),
                origin: Origin::new(vehicle.py(), "", (vehicle,))?,
            })
        }

        /// The state of rolling straight ahead: array (19,).
        fn rolling<'py>(&self, py: Python<'py>, speed_m_s: f64) -> PyResult<Array<'py>> {
            input::finite("speed_m_s", speed_m_s, "m/s")?;
            let state = State::<f64>::rolling(speed_m_s, &self.parameters);
            batch::vector(py, state.to_array().to_vec())
        }

        /// One row of inputs: array (22,). `front_steer_rad` turns both front wheels; the others
        /// take one number for all wheels or four.
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
            input::set(&mut inputs.steer_rad, steer_rad);
            input::set(&mut inputs.drive_n_m, drive_n_m);
            input::set(&mut inputs.brake_n_m, brake_n_m);
            input::set(&mut inputs.friction_scale, friction_scale);
            input::set(&mut inputs.stiffness_scale, stiffness_scale);
            inputs.bank_rad = bank_rad;
            inputs.grade_rad = grade_rad;
            if let Some(angle) = front_steer_rad {
                inputs.steer_rad[..2].fill(angle);
            }
            batch::input_row(py, &INPUTS, inputs.to_array().to_vec())
        }

        /// The steady turn at a longitudinal velocity on a radius (positive: to the left) as a
        /// dict: `state` (19,), `inputs` (22,) and all of `outputs`.
        ///
        /// Without `drive_front` the speed is held from outside; with it the engine holds it, with
        /// this part of the torque on the front axle. Raises SimulationError beyond the tyres'
        /// grip.
        #[pyo3(signature = (longitudinal_m_s, radius_m, drive_front=None))]
        fn steady_turn<'py>(
            &self,
            py: Python<'py>,
            longitudinal_m_s: f64,
            radius_m: f64,
            drive_front: Option<f64>,
        ) -> PyResult<Bound<'py, PyDict>> {
            let drive = drive_front.map_or(Drive::Free, |front| Drive::Torque { front });
            let p = &self.parameters;
            let turn = py
                .detach(|| four_wheel::steady_turn(p, longitudinal_m_s, radius_m, drive))
                .map_err(|e| errors::model(&e))?;
            let mut row = vec![0.0; OUTPUTS.iter().map(|(_, columns)| columns).sum()];
            output_row(&turn.outputs, &mut row);
            let dict = batch::split(py, &batch::vector(py, row)?, &OUTPUTS)?;
            dict.set_item("state", batch::vector(py, turn.state.to_array().to_vec())?)?;
            dict.set_item("inputs", batch::vector(py, turn.inputs.to_array().to_vec())?)?;
            Ok(dict)
        }
    }
}
