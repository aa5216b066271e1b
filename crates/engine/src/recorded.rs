//! Estimates of a log as arrays for identification.

use estimator::calibration::Resolved;
use estimator::finding::Refusal;
use estimator::identification::toe::differences_rad;
use estimator::identification::{Method, Motion, Recorded, Sense, TyreForces};
use model::sensors::Sensors;
use model::vehicle::Vehicle;
use sample::{LogTime, PerWheel, Wheel};
use store::{Reader, Table, Values};

use crate::config::ControlValue;
use crate::config::{FileKind, Files};
use crate::recording::{STEERING, recording_of};
use crate::{Config, Error, Result};

/// Interval of the estimates, s.
const DT_S: f64 = estimator::GRID_NANOS as f64 * 1e-9;
/// Value of `source` of a tyre force of the fusion filter.
const FUSION: i32 = 3;
/// Topics of the estimates.
const MOTION: &str = "/estimate/motion";
const CONTACT_FORCES: &str = "/estimate/contact_forces";
const CARRIER_FORCES: &str = "/estimate/tyre_forces";
const PARAMETERS: &str = "/estimate/parameters";
/// Abbreviations of the wheels in the columns' names.
const WHEELS: [&str; 4] = ["fl", "fr", "rl", "rr"];

/// Which part of a log is taken, s since its first estimate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Window {
    /// Begin.
    pub from_s: f64,
    /// End; `None` takes all that is left.
    pub to_s: Option<f64>,
}

/// Reads the estimates of a drive, which a method is applied to. The vehicle is the log's, or the
/// one given in its place.
///
/// # Errors
/// As [`vehicle_of`]. If the log lacks what one of the senses measures, as its estimates are the vehicle file's then;
/// if it holds no estimates in the window; if a table cannot be read.
pub fn read_drive(
    reader: &Reader,
    given: Option<Vehicle>,
    window: Window,
    method: &Method,
) -> Result<Recorded> {
    let vehicle = vehicle_of(reader, given)?;
    require(reader, method.what(), method.senses())?;
    let grid = Grid::read(reader, MOTION, window)?;
    let each = |name: &str| grid.column(name);
    let wheels = |name: &str| PerWheel(WHEELS.map(|wheel| each(&format!("{wheel}.{name}"))));
    let motion = Motion {
        dt_s: DT_S,
        velocity_m_s: ["velocity_x_m_s", "velocity_y_m_s"].map(each),
        acceleration_m_s2: ["x", "y", "z"].map(|axis| each(&format!("acceleration_m_s2.{axis}"))),
        sideslip_rad: each("sideslip_rad"),
        yaw_rate_rad_s: each("yaw_rate_rad_s"),
        roll_rad: each("roll_rad"),
        pitch_rad: each("pitch_rad"),
        slope_rad: ["bank_rad", "grade_rad"].map(each),
        steer_rad: wheels("steer_rad"),
        slip_angle_rad: wheels("slip_angle_rad"),
        longitudinal_slip: wheels("longitudinal_slip"),
        steer_offset_rad: learnt_offset(reader, &grid)?,
    };
    let forces = read_forces(reader, window, &grid)?;
    let reads_pressures = vehicle.depends_on_pressure() || matches!(method, Method::Tyre(_));
    let mut recorded = Recorded::new(vehicle, motion, forces);
    if reads_pressures {
        recorded = recorded.with_pressures(&read_pressures(reader, &grid)?);
    }
    match method {
        Method::Toe => {
            let toe_rad = read_toe(reader, &recorded.vehicle, &grid)?;
            Ok(recorded.with_toe(toe_rad))
        }
        _ => Ok(recorded),
    }
}

/// Reads the mean inflation pressure of each tyre in the time of the grid, Pa; `NaN` without a sensor.
fn read_pressures(reader: &Reader, motion: &Grid) -> Result<PerWheel<f64>> {
    let mut pressures_pa = PerWheel([f64::NAN; 4]);
    let channels = reader.info().channels;
    for topic in channels.keys().filter(|t| t.starts_with("/control/")) {
        let control = Grid {
            table: reader.table(topic, LogTime(0), LogTime(u64::MAX))?,
            first_ns: motion.first_ns,
            rows: motion.rows,
        };
        for wheel in Wheel::ALL {
            let values = control.column(&ControlValue::TyrePressure(wheel).name());
            let known = values.iter().filter(|value| value.is_finite());
            let (sum, count) = known.fold((0.0, 0.0), |(sum, n), value| (sum + value, n + 1.0));
            if count > 0.0 {
                pressures_pa[wheel] = sum / count;
            }
        }
    }
    Ok(pressures_pa)
}

/// Reads what the steer angles of the front wheels differ from those of rack and linkage, rad.
fn read_toe(reader: &Reader, vehicle: &Vehicle, grid: &Grid) -> Result<[Vec<f64>; 2]> {
    let config = Config::from_attachments(&reader.attachments()?)?;
    let given = config.estimator.ok_or(Error::NoVehicle)?;
    let calibration = Resolved::new(&given.sensors, &given.calibration)?;
    let recording = recording_of(
        reader,
        &STEERING,
        "the log".to_owned(),
        vehicle,
        &given.sensors,
    )?;
    let start = reader.info().span.map_or(LogTime(0), |span| span.0);
    let first = LogTime(u64::try_from(grid.first_ns).unwrap_or_default());
    let first_s = first.seconds_since(start);
    let times_s: Vec<f64> = (0..grid.rows)
        .map(|row| first_s + DT_S * row as f64)
        .collect();
    let vehicle = given.calibration.applied(vehicle);
    Ok(differences_rad(
        &recording,
        &vehicle,
        &calibration,
        &times_s,
    )?)
}

/// Reads the rate about `axis` (`x`, `y` or `z`) of the log's first inertial unit, which swings with
/// what hangs, rad/s, and the interval of its grid, s.
///
/// # Errors
/// If the log has no inertial unit, or nothing in the window.
pub fn read_swing(reader: &Reader, window: Window, axis: &str) -> Result<(Vec<f64>, f64)> {
    let channels = reader.info().channels;
    let topic = channels
        .iter()
        .find(|(_, (schema, _))| schema == schema_of(Sense::Inertia))
        .map(|(topic, _)| topic.clone())
        .ok_or_else(|| Refusal::Missing {
            what: "moment of inertia".to_owned(),
            channel: Sense::Inertia.name().to_owned(),
            help: "attach an inertial unit to the pendulum and record it".to_owned(),
        })?;
    let grid = Grid::read(reader, &topic, window)?;
    Ok((grid.column(&format!("angular_rate_rad_s.{axis}")), DT_S))
}

/// The vehicle of a log, or the one given in its place.
///
/// # Errors
/// If the log's configuration names no vehicle, or one of another name.
pub fn vehicle_of(reader: &Reader, given: Option<Vehicle>) -> Result<Vehicle> {
    let config = Config::from_attachments(&reader.attachments()?)?;
    let own = config.estimator.ok_or(Error::NoVehicle)?.vehicle;
    let Some(given) = given else {
        return Ok(own);
    };
    if given.name == own.name {
        return Ok(given);
    }
    let refusal = Refusal::OtherVehicle {
        what: "identification".to_owned(),
        expected: given.name,
        found: own.name,
    };
    Err(refusal.into())
}

/// The vehicle of a file, or of one of the program's own.
///
/// # Errors
/// If the file cannot be read or has errors.
pub fn vehicle_file(name: &str) -> Result<Vehicle> {
    let text = Files::on_disk(std::path::PathBuf::new()).read_text(name, FileKind::Vehicle)?;
    Ok(Vehicle::from_toml(&text, name)?)
}

/// The sensors of a file, or of one of the program's own.
///
/// # Errors
/// If the file cannot be read or has errors.
pub fn sensors_file(name: &str) -> Result<Sensors> {
    let text = Files::on_disk(std::path::PathBuf::new()).read_text(name, FileKind::Sensors)?;
    Ok(Sensors::from_toml(&text, name)?)
}

const fn schema_of(sense: Sense) -> &'static str {
    match sense {
        Sense::Inertia => "atvrec.Imu",
        Sense::Velocity => "atvrec.GnssVelocity",
        Sense::Steer => "atvrec.Steer",
        Sense::Strain => "atvrec.Strain",
        Sense::WheelSpeed => "atvrec.WheelSpeed",
    }
}

/// Returns an error if the estimates of motion or forces depend on the model alone.
fn require(reader: &Reader, what: &str, senses: &[Sense]) -> std::result::Result<(), Refusal> {
    let channels = reader.info().channels;
    let is_there = |sense: Sense| {
        let mut all = channels.values();
        all.any(|(schema, count)| schema == schema_of(sense) && *count > 0)
    };
    match senses.iter().find(|sense| !is_there(**sense)) {
        None => Ok(()),
        Some(sense) => Err(Refusal::Missing {
            what: what.to_owned(),
            channel: sense.name().to_owned(),
            help: "record it: without it, the estimates only repeat the vehicle file".to_owned(),
        }),
    }
}

fn read_forces(reader: &Reader, window: Window, motion: &Grid) -> Result<TyreForces> {
    if !reader.info().channels.contains_key(CONTACT_FORCES) {
        return Ok(TyreForces::default());
    }
    let forces = Grid {
        first_ns: motion.first_ns,
        rows: motion.rows,
        ..Grid::read(reader, CONTACT_FORCES, window)?
    };
    let source = forces.table.columns.iter().find(|c| c.name == "fl.source");
    let axes =
        |wheel: &str| ["x", "y", "z"].map(|axis| forces.column(&format!("{wheel}.{axis}_n")));
    let mut aligning_n_m = PerWheel::default();
    if reader.info().channels.contains_key(CARRIER_FORCES) {
        let carrier = Grid {
            first_ns: motion.first_ns,
            rows: motion.rows,
            ..Grid::read(reader, CARRIER_FORCES, window)?
        };
        aligning_n_m =
            PerWheel(WHEELS.map(|wheel| carrier.column(&format!("{wheel}.moment_z_n_m"))));
    }
    Ok(TyreForces {
        force_n: PerWheel(WHEELS.map(axes)),
        aligning_n_m,
        fused: matches!(
            source.map(|column| &column.values),
            Some(Values::I32(values)) if values.contains(&FUSION)
        ),
    })
}

/// What the estimator has learnt of the steering encoder's zero, on the grid of the motion.
fn learnt_offset(reader: &Reader, motion: &Grid) -> Result<Vec<f64>> {
    if !reader.info().channels.contains_key(PARAMETERS) {
        return Ok(vec![0.0; motion.rows]);
    }
    let learnt = Grid {
        table: reader.table(PARAMETERS, LogTime(0), LogTime(u64::MAX))?,
        first_ns: motion.first_ns,
        rows: motion.rows,
    };
    Ok(learnt.line("steer_offset_rad"))
}

/// Rows of a topic on the grid of the estimates.
struct Grid {
    table: Table,
    first_ns: i64,
    rows: usize,
}

impl Grid {
    fn read(reader: &Reader, topic: &str, window: Window) -> Result<Self> {
        let table = reader
            .table(topic, LogTime(0), LogTime(u64::MAX))
            .map_err(|source| Error::NoEstimates {
                topic: topic.to_owned(),
                source: Box::new(source),
            })?;
        let times = &table.publish_time_ns;
        let (Some(first), Some(last)) = (times.iter().min(), times.iter().max()) else {
            return Err(Error::Empty(topic.to_owned()));
        };
        let nanos = |seconds: f64| (seconds * 1e9).round() as i64;
        let from = first + nanos(window.from_s.max(0.0));
        let end = window.to_s.map(|to_s| first + nanos(to_s));
        let to = end.map_or(*last, |end| end.min(*last));
        if to <= from {
            return Err(Error::EmptyWindow {
                topic: topic.to_owned(),
                span_s: (last - first) as f64 * 1e-9,
            });
        }
        let rows = ((to - from) as f64 * 1e-9 / DT_S).round() as usize + 1;
        Ok(Self {
            table,
            first_ns: from,
            rows,
        })
    }

    /// A column on straight lines between its rows, at either end as it was last; 0 without rows.
    fn line(&self, name: &str) -> Vec<f64> {
        let column = self.table.columns.iter().find(|column| column.name == name);
        let Some(Values::F64(values)) = column.map(|column| &column.values) else {
            return vec![0.0; self.rows];
        };
        let at = |time: &i64| (time - self.first_ns) as f64 * 1e-9 / DT_S;
        let mut known = self.table.publish_time_ns.iter().map(at).zip(values);
        let Some(mut before) = known.next() else {
            return vec![0.0; self.rows];
        };
        let mut after = known.next();
        let mut line = Vec::with_capacity(self.rows);
        for row in 0..self.rows {
            let row = row as f64;
            while let Some(next) = after.filter(|next| next.0 <= row) {
                before = next;
                after = known.next();
            }
            let slope = after.map_or(0.0, |next| (next.1 - before.1) / (next.0 - before.0));
            line.push(before.1 + slope * (row - before.0).max(0.0));
        }
        line
    }

    /// Column with this name; NaN without a row or a column.
    fn column(&self, name: &str) -> Vec<f64> {
        let mut grid = vec![f64::NAN; self.rows];
        let column = self.table.columns.iter().find(|column| column.name == name);
        if let Some(Values::F64(values)) = column.map(|column| &column.values) {
            for (time, value) in self.table.publish_time_ns.iter().zip(values) {
                let row = ((time - self.first_ns) as f64 * 1e-9 / DT_S).round();
                if row >= 0.0 && (row as usize) < self.rows {
                    grid[row as usize] = *value;
                }
            }
        }
        grid
    }
}
