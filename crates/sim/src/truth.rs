//! Truth files: a motion that some simulator wrote as Parquet or CSV.
//!
//! Files come from elsewhere: what one of them may cost is bounded, and a panic of a library that
//! reads it is an error.

mod csv_table;
mod ground;
mod members;
#[cfg(feature = "parquet")]
mod parquet_table;
mod substitute;
#[cfg(feature = "parquet")]
mod thrift;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use nalgebra::Vector3;
use sample::boundary::guarded;
use sample::{PerWheel, Wheel};

use crate::{Motion, SimError, TruthState, WheelTruth};

/// Columns of the whole vehicle that a truth file must have; [`substitute`] tells which of them other
/// columns replace.
const REQUIRED: [&str; 14] = [
    "t[s]",
    "roll[rad]",
    "pitch[rad]",
    "yaw[rad]",
    "p[rad/s]",
    "q[rad/s]",
    "r[rad/s]",
    "vx_body[m/s]",
    "vy_body[m/s]",
    "vz_body[m/s]",
    "fx_body[m/s2]",
    "fy_body[m/s2]",
    "fz_body[m/s2]",
    "handwheel[rad]",
];

/// Columns of each wheel that a truth file must have, after `FL_`, `FR_`, `RL_`, `RR_`.
const REQUIRED_OF_WHEEL: [&str; 5] = ["omega[rad/s]", "Fx[N]", "Fy[N]", "Fz[N]", "spring_len[m]"];

/// Columns of the whole vehicle that are used where they are found.
const OPTIONAL: [&str; 15] = [
    "X[m]",
    "Y[m]",
    "Z[m]",
    "pdot[rad/s2]",
    "qdot[rad/s2]",
    "rdot[rad/s2]",
    "ax_body[m/s2]",
    "ay_body[m/s2]",
    "az_body[m/s2]",
    "bank_base[rad]",
    "grade_base[rad]",
    "hitch_Fx[N]",
    "hitch_Fy[N]",
    "hitch_Fz[N]",
    "panhard_T[N]",
];

/// Columns of each wheel that are used where they are found.
const OPTIONAL_OF_WHEEL: [&str; 63] = [
    "Mx[Nm]",
    "My[Nm]",
    "Mz[Nm]",
    "steer[rad]",
    "alpha[rad]",
    "mu[-]",
    "UCA_tubeF_T[N]",
    "UCA_tubeB_T[N]",
    "LCA_tubeF_T[N]",
    "LCA_tubeB_T[N]",
    "tierod_T[N]",
    "LCA_ball_Fx[N]",
    "LCA_ball_Fy[N]",
    "LCA_ball_Fz[N]",
    "lbj_x[m]",
    "lbj_y[m]",
    "lbj_z[m]",
    "camber[rad]",
    "incl_body[rad]",
    "n_chassis_x[-]",
    "n_chassis_y[-]",
    "n_chassis_z[-]",
    "Fchassis_x[N]",
    "Fchassis_y[N]",
    "Fchassis_z[N]",
    "Mchassis_x[Nm]",
    "Mchassis_y[Nm]",
    "Mchassis_z[Nm]",
    "Fcar_x[N]",
    "Fcar_y[N]",
    "Fcar_z[N]",
    "Mcar_x[Nm]",
    "Mcar_y[Nm]",
    "Mcar_z[Nm]",
    "wc_x[m]",
    "wc_y[m]",
    "wc_z[m]",
    "cp_x[m]",
    "cp_y[m]",
    "cp_z[m]",
    "wcw_a_x[m/s2]",
    "wcw_a_y[m/s2]",
    "wcw_a_z[m/s2]",
    "wc_acc_x[m/s2]",
    "wc_acc_y[m/s2]",
    "wc_acc_z[m/s2]",
    "ma_hub_x[N]",
    "ma_hub_y[N]",
    "ma_hub_z[N]",
    "ground_z[m]",
    "kappa[-]",
    "LCA_legF_N[N]",
    "LCA_legB_N[N]",
    "strut_side_Fx[N]",
    "strut_side_Fy[N]",
    "strut_side_Fz[N]",
    "strut_dir_x[-]",
    "strut_dir_y[-]",
    "strut_dir_z[-]",
    "lower_T[N]",
    "upper_T[N]",
    "sec_Mx[Nm]",
    "sec_Mz[Nm]",
];

impl Motion {
    /// Reads a truth file, Parquet or CSV by its name's end. The columns are those of
    /// `docs/truth-files.md`; others are left alone.
    ///
    /// Velocity that is missing is the derivative of the position, position that is missing the
    /// integral of the velocity, angular acceleration that is missing the difference quotient of the
    /// rate, and a contact force that is missing that in vehicle axes or in the wheel-carrier frame.
    ///
    /// # Errors
    /// A file that cannot be read, columns missing or in another unit (all missing ones are named
    /// at once), cells that are not finite numbers, time that does not rise.
    pub fn open(path: &Path) -> Result<Self, SimError> {
        let known = Known::new();
        let columns = read_columns(path, |found| known.find(path, found))?;
        for (name, values) in &columns {
            check_finite(path, name, values)?;
        }
        let missing = substitute::missing(&columns, required_columns());
        if !missing.is_empty() {
            return Err(SimError::MissingColumns {
                path: path.to_owned(),
                columns: missing,
            });
        }
        let name = path.file_stem().and_then(|stem| stem.to_str());
        let states = states(&columns);
        for (row, pair) in states.windows(2).enumerate() {
            let gap_s = pair[1].time_s - pair[0].time_s;
            if gap_s > GAP_MAX_S {
                return Err(SimError::Gap {
                    previous: row + 1,
                    row: row + 2,
                    gap_s,
                    most_s: GAP_MAX_S,
                });
            }
        }
        Self::new(name.unwrap_or("truth"), states)
    }
}

/// All columns that a truth file must have, as `name[unit]`. Other columns replace some of them
/// (`docs/truth-files.md`).
pub fn required_columns() -> impl Iterator<Item = String> {
    with_wheels(&REQUIRED, &REQUIRED_OF_WHEEL)
}

/// All columns that are used where a truth file has them, as `name[unit]`.
pub fn optional_columns() -> impl Iterator<Item = String> {
    with_wheels(&OPTIONAL, &OPTIONAL_OF_WHEEL)
}

fn with_wheels(
    whole: &'static [&'static str],
    of_wheel: &'static [&'static str],
) -> impl Iterator<Item = String> {
    let wheels = Wheel::ALL.into_iter().flat_map(move |wheel| {
        of_wheel
            .iter()
            .map(move |name| format!("{}_{name}", wheel.abbreviation()))
    });
    whole.iter().map(|&name| name.to_owned()).chain(wheels)
}

/// Columns by name; all are of one length.
pub type Columns = BTreeMap<String, Vec<f64>>;

/// The name under which a column of a file is kept, by its name in the file; `None` leaves it out.
type Wanted<'a> = &'a dyn Fn(&str) -> Result<Option<String>, SimError>;

/// Longest time between two rows, s: over a longer one a motion means nothing.
const GAP_MAX_S: f64 = 10.0;
/// Largest truth file, bytes.
const FILE_MAX: u64 = 1 << 30;
/// Most columns of a truth file, used or not.
const COLUMNS_MAX: usize = 10_000;
/// Most numbers that are taken from a truth file: 0.8 GB.
const NUMBERS_MAX: usize = 100_000_000;
/// Characters of a name or a cell that a message shows.
const SHOWN_CHARS: usize = 60;

/// Reads columns of numbers from a Parquet or CSV file; the end of the file's name says which.
/// `wanted` gives the name under which a column of the file is kept, or `None` to leave it out.
///
/// # Errors
/// A file that cannot be read, is damaged or too large, a wanted column that holds anything but
/// numbers (nulls included), and the errors of `wanted`.
pub fn read_columns(
    path: &Path,
    wanted: impl Fn(&str) -> Result<Option<String>, SimError>,
) -> Result<Columns, SimError> {
    let read: fn(&Path, Vec<u8>, Wanted<'_>) -> Result<Columns, SimError> =
        match path.extension().and_then(|end| end.to_str()) {
            #[cfg(feature = "parquet")]
            Some("parquet") => parquet_table::read,
            Some("csv") => csv_table::read,
            _ => {
                return Err(SimError::UnknownKind {
                    path: path.to_owned(),
                });
            }
        };
    let bytes = read_file(path)?;
    guarded(|| read(path, bytes, &wanted)).unwrap_or_else(|panic| {
        Err(SimError::Unreadable {
            path: path.to_owned(),
            what: format!("its reader failed: {panic}"),
        })
    })
}

fn read_file(path: &Path) -> Result<Vec<u8>, SimError> {
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(FILE_MAX + 1).read_to_end(&mut bytes))
        .map_err(|cause| SimError::Read {
            path: path.to_owned(),
            cause,
        })?;
    if bytes.len() as u64 > FILE_MAX {
        return too_much(path, "bytes", FILE_MAX);
    }
    Ok(bytes)
}

fn too_much<T>(path: &Path, what: &'static str, most: u64) -> Result<T, SimError> {
    Err(SimError::TooMuch {
        path: path.to_owned(),
        what,
        most,
    })
}

fn shown(text: &str) -> String {
    text.chars().take(SHOWN_CHARS).collect()
}

/// The columns that are known, by what stands before the unit.
struct Known(BTreeMap<String, String>);

impl Known {
    fn new() -> Self {
        let all = required_columns().chain(optional_columns());
        Self(all.map(|name| (stem(&name).to_owned(), name)).collect())
    }

    /// The known column that a column of a file is, if it is one.
    fn find(&self, path: &Path, found: &str) -> Result<Option<String>, SimError> {
        match self.0.get(stem(found)) {
            Some(known) if known == found.trim() => Ok(Some(known.clone())),
            Some(expected) => Err(SimError::WrongUnit {
                path: path.to_owned(),
                found: shown(found),
                expected: expected.clone(),
            }),
            None => Ok(None),
        }
    }
}

fn stem(name: &str) -> &str {
    name.split('[').next().unwrap_or_default().trim()
}

fn check_finite(path: &Path, name: &str, values: &[f64]) -> Result<(), SimError> {
    match values.iter().position(|value| !value.is_finite()) {
        None => Ok(()),
        Some(at) => Err(SimError::BadValue {
            path: path.to_owned(),
            row: at + 1,
            column: name.to_owned(),
            value: values[at].to_string(),
        }),
    }
}

/// The rows of columns that have been found complete.
fn states(columns: &Columns) -> Vec<TruthState> {
    let get = |row: usize, name: &str| columns.get(name).map_or(f64::NAN, |column| column[row]);
    let known = |name: &str, row: usize| columns.get(name).map(|column| column[row]);
    let three = |row: usize, names: [&str; 3]| names.map(|name| get(row, name));
    let rows = columns.get("t[s]").map_or(0, Vec::len);
    let mut states: Vec<TruthState> = (0..rows)
        .map(|row| {
            let mut state = TruthState {
                time_s: get(row, "t[s]"),
                position_m: three(row, ["X[m]", "Y[m]", "Z[m]"]),
                roll_rad: get(row, "roll[rad]"),
                pitch_rad: get(row, "pitch[rad]"),
                yaw_rad: get(row, "yaw[rad]"),
                velocity_body_m_s: three(row, ["vx_body[m/s]", "vy_body[m/s]", "vz_body[m/s]"]),
                rate_rad_s: three(row, ["p[rad/s]", "q[rad/s]", "r[rad/s]"]),
                rate_derivative_rad_s2: three(
                    row,
                    ["pdot[rad/s2]", "qdot[rad/s2]", "rdot[rad/s2]"],
                ),
                specific_force_m_s2: three(
                    row,
                    ["fx_body[m/s2]", "fy_body[m/s2]", "fz_body[m/s2]"],
                ),
                acceleration_m_s2: three(row, ["ax_body[m/s2]", "ay_body[m/s2]", "az_body[m/s2]"]),
                steering_wheel_rad: get(row, "handwheel[rad]"),
                bank_rad: known("bank_base[rad]", row).unwrap_or(0.0),
                // The file's grade is positive uphill.
                grade_rad: -known("grade_base[rad]", row).unwrap_or(0.0),
                hitch_force_n: (columns.contains_key("hitch_Fx[N]"))
                    .then(|| three(row, ["hitch_Fx[N]", "hitch_Fy[N]", "hitch_Fz[N]"]))
                    .filter(|force| force.iter().all(|axis| axis.is_finite())),
                wheels: PerWheel::from_fn(|wheel| wheel_truth(wheel, |name| get(row, name))),
            };
            ground::tell(&mut state, |name| get(row, name));
            state
        })
        .collect();
    fill_missing(&mut states);
    states
}

fn wheel_truth(wheel: Wheel, whole: impl Fn(&str) -> f64) -> WheelTruth {
    let get = |name: &str| whole(&format!("{}_{name}", wheel.abbreviation()));
    WheelTruth {
        rod_shift_m: 0.0,
        force_n: ["Fx[N]", "Fy[N]", "Fz[N]"].map(get),
        moment_n_m: ["Mx[Nm]", "My[Nm]", "Mz[Nm]"].map(get),
        angular_speed_rad_s: get("omega[rad/s]"),
        steer_rad: get("steer[rad]"),
        slip_angle_rad: get("alpha[rad]"),
        longitudinal_slip: get("kappa[-]"),
        friction: get("mu[-]"),
        strut_length_m: get("spring_len[m]"),
        link_force_n: members::axial_n(wheel, get, &whole),
        lower_ball_force_n: ["LCA_ball_Fx[N]", "LCA_ball_Fy[N]", "LCA_ball_Fz[N]"].map(get),
        lower_ball_m: ["lbj_x[m]", "lbj_y[m]", "lbj_z[m]"].map(get),
        ball_normal_n: f64::NAN,
        tube_bending_n_m: ["sec_Mx[Nm]", "sec_Mz[Nm]"].map(get),
        ground: None,
        motion: None,
    }
}

/// Differentiates the position where the velocity is missing and the other way round, differentiates
/// rates where their derivative is missing, and takes gravity off the specific force where the
/// acceleration is missing.
pub(crate) fn fill_missing(states: &mut [TruthState]) {
    substitute::velocities(states);
    for row in 0..states.len() {
        let (before, after) = (row.saturating_sub(1), (row + 1).min(states.len() - 1));
        let span_s = states[after].time_s - states[before].time_s;
        let change: [f64; 3] = std::array::from_fn(|axis| {
            states[after].rate_rad_s[axis] - states[before].rate_rad_s[axis]
        });
        let state = &mut states[row];
        let up_body = state.up_body();
        for (axis, up) in up_body.iter().enumerate() {
            if state.rate_derivative_rad_s2[axis].is_nan() {
                let quotient = change[axis] / span_s;
                state.rate_derivative_rad_s2[axis] = if span_s > 0.0 { quotient } else { 0.0 };
            }
            if state.acceleration_m_s2[axis].is_nan() {
                state.acceleration_m_s2[axis] =
                    state.specific_force_m_s2[axis] - sample::STANDARD_GRAVITY_M_S2 * up;
            }
        }
    }
    for axis in 0..3 {
        let mut position_m = 0.0;
        let mut previous: Option<(f64, f64)> = None;
        for state in states.iter_mut() {
            let velocity = state.earth_from_body() * Vector3::from(state.velocity_body_m_s);
            let velocity_m_s = velocity[axis];
            if let Some((time_s, earlier_m_s)) = previous {
                position_m += 0.5 * (earlier_m_s + velocity_m_s) * (state.time_s - time_s);
            }
            previous = Some((state.time_s, velocity_m_s));
            if state.position_m[axis].is_nan() {
                state.position_m[axis] = position_m;
            }
        }
    }
}
