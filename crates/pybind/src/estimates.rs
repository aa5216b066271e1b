//! Estimates as arrays.

use numpy::ndarray::{ArrayD, IxDyn};
use numpy::{IntoPyArray, PyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use sample::{AxleGrip, Estimate, Event, ForceFrame, ForceSource, Parameters, PerWheel, TyreForce};

use estimator::Output;

/// What an estimator gave, in order.
#[derive(Default)]
pub struct Collected {
    estimates: Vec<Estimate>,
    parameters: Vec<Parameters>,
    events: Vec<Event>,
}

impl Collected {
    /// Takes an output of the estimator.
    pub fn push(&mut self, output: Output) {
        match output {
            Output::Estimate(estimate) => self.estimates.push(estimate),
            Output::Parameters(parameters) => self.parameters.push(parameters),
            Output::Event(event) => self.events.push(event),
            Output::Lagged(_)
            | Output::LaggedRoad(_)
            | Output::Limits(_)
            | Output::Road(_)
            | Output::Step(_)
            | Output::Terrain(_) => {}
        }
    }

    /// Takes a record of the engine.
    pub fn record(&mut self, record: store::Record) {
        match record {
            store::Record::Estimate(estimate) => self.estimates.push(*estimate),
            store::Record::Parameters(parameters) => self.parameters.push(*parameters),
            store::Record::Event(event) => self.events.push(event),
            _ => {}
        }
    }

    /// Dicts of arrays for estimates and parameters, and a list of dicts for events.
    pub fn into_python(
        self,
        py: Python<'_>,
    ) -> PyResult<(Bound<'_, PyDict>, Bound<'_, PyDict>, Bound<'_, PyList>)> {
        let events = PyList::empty(py);
        for event in &self.events {
            events.append(self::event(py, event)?)?;
        }
        let parameters = parameters(py, &self.parameters)?;
        Ok((estimates(py, &self.estimates)?, parameters, events))
    }
}

/// Rows of one kind that become columns.
struct Table<'a, 'py, T> {
    py: Python<'py>,
    rows: &'a [T],
    columns: Bound<'py, PyDict>,
}

impl<'a, 'py, T> Table<'a, 'py, T> {
    fn new(py: Python<'py>, rows: &'a [T], time: impl Fn(&T) -> u64) -> PyResult<Self> {
        let columns = PyDict::new(py);
        let times: Vec<i64> = rows.iter().map(|row| time(row).cast_signed()).collect();
        columns.set_item("time_ns", times.into_pyarray(py))?;
        Ok(Self { py, rows, columns })
    }

    fn one(&self, name: &str, value: impl Fn(&T) -> f64) -> PyResult<()> {
        let values: Vec<f64> = self.rows.iter().map(value).collect();
        self.columns.set_item(name, values.into_pyarray(self.py))
    }

    fn several<const N: usize>(&self, name: &str, value: impl Fn(&T) -> [f64; N]) -> PyResult<()> {
        let values = self.rows.iter().flat_map(value).collect();
        self.columns
            .set_item(name, self.shaped(&[self.rows.len(), N], values))
    }

    fn forces(&self, name: &str, of: impl Fn(&T) -> &PerWheel<TyreForce>) -> PyResult<()> {
        self.wheels(&format!("{name}_n"), &of, |force| force.force_n)?;
        self.wheels(&format!("{name}_sigma_n"), &of, |force| force.sigma_n)
    }

    /// A vector of each wheel.
    fn wheels(
        &self,
        name: &str,
        of: impl Fn(&T) -> &PerWheel<TyreForce>,
        value: fn(&TyreForce) -> [f64; 3],
    ) -> PyResult<()> {
        let forces = self.rows.iter().flat_map(|row| of(row).0.iter());
        let values = forces.flat_map(value).collect();
        self.columns
            .set_item(name, self.shaped(&[self.rows.len(), 4, 3], values))
    }

    fn shaped(&self, shape: &[usize], values: Vec<f64>) -> Bound<'py, PyArrayDyn<f64>> {
        let array = ArrayD::from_shape_vec(IxDyn(shape), values);
        array
            .expect("as many values as the shape has")
            .into_pyarray(self.py)
    }
}

fn estimates<'py>(py: Python<'py>, rows: &[Estimate]) -> PyResult<Bound<'py, PyDict>> {
    let table = Table::new(py, rows, |row| row.time.0)?;
    table.one("velocity_x_m_s", |row| row.motion.velocity_x_m_s)?;
    table.one("velocity_y_m_s", |row| row.motion.velocity_y_m_s)?;
    table.one("sideslip_rad", |row| row.motion.sideslip_rad)?;
    table.one("sideslip_sigma_rad", |row| row.motion.sideslip_sigma_rad)?;
    table.one("roll_rad", |row| row.motion.roll_rad)?;
    table.one("pitch_rad", |row| row.motion.pitch_rad)?;
    table.several("rate_rad_s", |row| row.motion.rate_rad_s)?;
    table.several("acceleration_m_s2", |row| row.motion.acceleration_m_s2)?;
    table.several("steer_rad", |row| row.motion.steer_rad.0)?;
    table.several("slip_angle_rad", |row| row.motion.slip_angle_rad.0)?;
    table.several("longitudinal_slip", |row| row.motion.longitudinal_slip.0)?;
    table.several("longitudinal_slip_sigma", |row| {
        row.motion.longitudinal_slip_sigma.0
    })?;
    table.one("bank_rad", |row| row.motion.bank_rad)?;
    table.one("grade_rad", |row| row.motion.grade_rad)?;
    table.forces("force", |row| &row.carrier)?;
    table.wheels(
        "force_moment_n_m",
        |row| &row.carrier,
        |force| force.moment_n_m,
    )?;
    table.wheels(
        "force_moment_sigma_n_m",
        |row| &row.carrier,
        |force| force.moment_sigma_n_m,
    )?;
    table.forces("contact_force", |row| &row.measured)?;
    table.forces("expected_force", |row| &row.expected)?;
    table.one("load_transfer_ratio", |row| {
        row.rollover.load_transfer_ratio
    })?;
    table.one("load_transfer_ratio_sigma", |row| {
        row.rollover.load_transfer_ratio_sigma
    })?;
    table.several("axle_load_transfer_ratio", |row| {
        row.rollover.axle_load_transfer_ratio
    })?;
    table.several("time_to_lift_s", |row| row.rollover.time_to_lift_s.0)?;
    table.several("time_to_two_wheel_lift_s", |row| {
        row.rollover.time_to_two_wheel_lift_s
    })?;
    let sources: Vec<[&str; 4]> = rows
        .iter()
        .map(|row| row.carrier.0.map(|force| source_name(force.source)))
        .collect();
    let columns = table.columns;
    columns.set_item("force_source", sources)?;
    columns.set_item("force_frame", ForceFrame::WheelCarrier.name())?;
    Ok(columns)
}

/// A value of an axle.
type OfAxle = fn(&AxleGrip) -> f64;

fn parameters<'py>(py: Python<'py>, rows: &[Parameters]) -> PyResult<Bound<'py, PyDict>> {
    let table = Table::new(py, rows, |row| row.time.0)?;
    table.several("accel_bias_m_s2", |row| row.accel_bias_m_s2)?;
    table.several("accel_bias_sigma_m_s2", |row| row.accel_bias_sigma_m_s2)?;
    table.several("gyro_bias_rad_s", |row| row.gyro_bias_rad_s)?;
    table.several("gyro_bias_sigma_rad_s", |row| row.gyro_bias_sigma_rad_s)?;
    table.one("steer_offset_rad", |row| row.steer_offset_rad)?;
    table.one("steer_offset_sigma_rad", |row| row.steer_offset_sigma_rad)?;
    let axles: [(&str, OfAxle); 7] = [
        ("stiffness_factor", |axle| axle.stiffness_factor),
        ("stiffness_factor_sigma", |axle| axle.stiffness_factor_sigma),
        ("friction", |axle| axle.friction.unwrap_or(f64::NAN)),
        ("friction_sigma", |axle| {
            axle.friction_sigma.unwrap_or(f64::NAN)
        }),
        ("friction_min", |axle| axle.friction_min),
        ("utilisation", |axle| axle.utilisation),
        ("utilisation_sigma", |axle| axle.utilisation_sigma),
    ];
    for (name, value) in axles {
        table.several(name, |row| [value(&row.front), value(&row.rear)])?;
    }
    Ok(table.columns)
}

fn event<'py>(py: Python<'py>, event: &Event) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("time_ns", event.time.0)?;
    dict.set_item("onset_ns", event.onset.0)?;
    dict.set_item("kind", event.kind.name())?;
    dict.set_item("text", &event.text)?;
    dict.set_item("probability", event.probability)?;
    dict.set_item("load_transfer_ratio", event.load_transfer_ratio)?;
    Ok(dict)
}

const fn source_name(source: ForceSource) -> &'static str {
    match source {
        ForceSource::None => "none",
        ForceSource::Deflection => "deflection",
        ForceSource::Statics => "statics",
        ForceSource::Fusion => "fusion",
        ForceSource::Model => "model",
        ForceSource::Inertial => "inertial",
        ForceSource::ModelFound => "model_found",
    }
}
