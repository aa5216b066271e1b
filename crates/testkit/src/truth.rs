//! Truth runs of an independent simulator: the whole runs of `../shared/data/truth`, and the excerpts
//! in `testdata/truth`, which every clone of the project has.

use std::ops::Range;
use std::path::{Path, PathBuf};

use model::sensors::Sensors;
use model::vehicle::Vehicle;
use nalgebra::{Rotation3, Vector3};
use sample::{Sample, Wheel, WheelAxes};

use crate::once::Once;
use crate::{project, sensing, shared};

/// Rate of the truth files of the first vehicle, Hz.
pub const RATE_HZ: f64 = 200.0;

/// The columns of one run.
#[derive(Clone)]
pub struct Run {
    /// The file's name, without its end.
    pub name: String,
    /// Rows of each column.
    pub rows: usize,
    /// Columns by their name without unit.
    pub columns: sim::Columns,
}

impl Run {
    /// Reads a truth file.
    ///
    /// # Panics
    /// If it is absent or damaged.
    #[must_use]
    pub fn read(path: &Path) -> Self {
        let stem = |full: &str| full.split('[').next().map(str::to_owned);
        let columns = sim::read_columns(path, |full| Ok(stem(full)))
            .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let name = path.file_stem().unwrap_or_default();
        Self {
            name: name.to_string_lossy().into_owned(),
            rows: columns["t"].len(),
            columns,
        }
    }

    /// One column.
    ///
    /// # Panics
    /// If the run has no such column.
    #[must_use]
    pub fn column(&self, name: &str) -> &[f64] {
        self.columns
            .get(name)
            .unwrap_or_else(|| panic!("{} has no column {name}", self.name))
    }

    /// The values of three columns in a row.
    #[must_use]
    pub fn vector(&self, names: [&str; 3], row: usize) -> [f64; 3] {
        names.map(|name| self.column(name)[row])
    }

    /// Forces of the four tyres in the wheel-carrier frame, N: those of the ground on the tyre, resolved along
    /// the spindle that steer and inclination angle give.
    #[must_use]
    pub fn carrier_forces(&self, row: usize) -> [[f64; 3]; 4] {
        Wheel::ALL.map(|wheel| {
            let at = |name: &str| self.column(&format!("{}_{name}", wheel.abbreviation()))[row];
            let three =
                |name: &str| Vector3::from(["x", "y", "z"].map(|a| at(&format!("{name}_{a}"))));
            let has = |name: &str| {
                let name = format!("{}_{name}_x", wheel.abbreviation());
                self.columns.contains_key(&name)
            };
            let normal = if has("n_chassis") {
                three("n_chassis").normalize()
            } else {
                let [roll, pitch, yaw] = self.vector(["roll", "pitch", "yaw"], row);
                Rotation3::from_euler_angles(roll, pitch, yaw).inverse() * Vector3::z()
            };
            let spindle = spindle(at("steer"), at("camber"), &normal);
            let force = if has("Fchassis") {
                three("Fchassis")
            } else {
                let x = spindle.cross(&normal).normalize();
                x * at("Fx") + normal.cross(&x) * at("Fy") + normal * at("Fz")
            };
            let axes = WheelAxes::carrier(spindle.into());
            axes.rows().map(|axis| Vector3::from(axis).dot(&force))
        })
    }

    /// Time of the first row, s: an excerpt keeps the times of its run.
    #[must_use]
    pub fn start_s(&self) -> f64 {
        self.column("t")[0]
    }

    /// What the sensors of a file that ships read on this run of [`vehicle`]. The samples are made
    /// once in a process.
    #[must_use]
    pub fn samples(&'static self, sensors: &str, seed: u64) -> &'static [Sample] {
        static SAMPLES: Once<(usize, String, u64), Vec<Sample>> = Once::new();
        // A run of static lifetime is its address.
        let run = std::ptr::from_ref(self).addr();
        SAMPLES.get_or_init((run, sensors.to_owned(), seed), || {
            let sensors = Sensors::builtin(sensors).expect("sensors that ship");
            sensing::samples(self, vehicle(), &sensors, seed)
        })
    }
}

static RUNS: Once<PathBuf, Run> = Once::new();

fn read_once(path: PathBuf) -> &'static Run {
    RUNS.get_or_init(path.clone(), || Run::read(&path))
}

/// A whole run of `../shared/data/truth`; `None` where [`shared`] leaves it out.
#[must_use]
pub fn run(name: &str) -> Option<&'static Run> {
    shared(&format!("data/truth/{name}.parquet")).map(read_once)
}

/// A whole run of `../shared/data/truth-rough`; `None` where [`shared`] leaves it out.
#[must_use]
pub fn rough_run(name: &str) -> Option<&'static Run> {
    shared(&format!("data/truth-rough/{name}.parquet")).map(read_once)
}

/// A window of time of a truth run, whose excerpt is in `testdata/truth`.
pub struct Window {
    /// Folder in `../shared/data`.
    pub folder: &'static str,
    /// Name of the run and of the excerpt, without the file's end.
    pub name: &'static str,
    /// First and last time, s.
    pub span_s: [f64; 2],
}

const fn window(folder: &'static str, name: &'static str, from_s: f64, to_s: f64) -> Window {
    Window {
        folder,
        name,
        span_s: [from_s, to_s],
    }
}

/// All excerpts: the runs on flat ground, those on rough ground, and one of the second vehicle.
pub const WINDOWS: [Window; 8] = [
    window("truth", "b_circle", 0.0, 54.095),
    window("truth", "c_sine03", 0.0, 20.0),
    window("truth", "d_sine_mu", 12.0, 31.0),
    window("truth", "f_launch_brake", 0.0, 15.0),
    window("truth-rough", "r2_iso_e_a", 26.0, 31.5),
    window("truth-rough", "r6_jump", 11.5, 17.0),
    window("truth-rough", "r8_trail_a", 64.0, 69.5),
    window("truth-second", "f1_slalom_a", 5.0, 15.0),
];

impl Window {
    /// The whole run; `None` where [`shared`] leaves it out.
    #[must_use]
    pub fn source(&self) -> Option<PathBuf> {
        shared(&format!("data/{}/{}.parquet", self.folder, self.name))
    }

    /// Rows of the window in the run's column of time.
    #[must_use]
    pub fn rows(&self, time_s: &[f64]) -> Range<usize> {
        let [first_s, last_s] = self.span_s;
        let first = time_s.partition_point(|time| *time < first_s - ROUNDING_S);
        let end = time_s.partition_point(|time| *time < last_s + ROUNDING_S);
        first..end
    }
}

/// Rounding of the column of time, s.
const ROUNDING_S: f64 = 1e-4;

/// Resolution of a column of an excerpt by the unit in its name: a power of two below a
/// hundredth of the noise of the sensor that reads it.
///
/// # Panics
/// If the unit is unknown.
#[must_use]
pub fn resolution(name: &str) -> f64 {
    let unit = name.split(['[', ']']).nth(1).unwrap_or_default();
    let exponent = match unit {
        "s" => -30,
        "m" | "rad" => -20,
        "rad/s" => -17,
        "m/s" | "m/s2" | "-" => -14,
        "rad/s2" => -10,
        "N" => -6,
        _ => panic!("the unit of {name} is unknown"),
    };
    f64::powi(2.0, exponent)
}

/// Path of an excerpt in `testdata/truth`.
#[must_use]
pub fn excerpt_path(name: &str) -> PathBuf {
    project().join(format!("testdata/truth/{name}.parquet"))
}

/// An excerpt in `testdata/truth`.
///
/// # Panics
/// If there is none of this name.
#[must_use]
pub fn excerpt(name: &str) -> &'static Run {
    read_once(excerpt_path(name))
}

/// The vehicle of the runs, as a workshop could measure it.
///
/// # Panics
/// If `testdata/truth/params.json` is damaged.
#[must_use]
pub fn vehicle() -> &'static Vehicle {
    static VEHICLE: Once<(), Vehicle> = Once::new();
    VEHICLE.get_or_init((), || {
        let path = project().join("testdata/truth/params.json");
        let text = std::fs::read_to_string(path).expect("the parameters of the vehicle");
        sim::vehicle_from_truth_params(&text).expect("the parameters of a vehicle")
    })
}

/// The spindle's direction in vehicle axes: turned by the steer angle about z, and inclined by the angle
/// against the ground with this normal.
fn spindle(steer_rad: f64, inclination_rad: f64, normal: &Vector3<f64>) -> Vector3<f64> {
    let (sin, cos) = math::sin_cos(steer_rad);
    let along = cos * normal.y - sin * normal.x;
    let lean = math::asin(math::sin(inclination_rad) / math::hypot(along, normal.z))
        - math::atan2(along, normal.z);
    let (up, level) = math::sin_cos(lean);
    Vector3::new(-sin * level, cos * level, up)
}
