//! Truth files: a motion that some simulator wrote as Parquet or CSV.

mod columns;

use std::path::Path;

use nalgebra::Vector3;
use sample::{PerWheel, Wheel};

pub use columns::{Columns, read_columns};

use crate::{Motion, SimError, TruthState, WheelTruth};

/// Columns of the whole vehicle that a truth file must have.
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
const OPTIONAL: [&str; 9] = [
    "X[m]",
    "Y[m]",
    "Z[m]",
    "pdot[rad/s2]",
    "qdot[rad/s2]",
    "rdot[rad/s2]",
    "ax_body[m/s2]",
    "ay_body[m/s2]",
    "az_body[m/s2]",
];

/// Columns of each wheel that are used where they are found.
const OPTIONAL_OF_WHEEL: [&str; 17] = [
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
];

impl Motion {
    /// Reads a truth file, Parquet or CSV by its name's end. The columns are those of
    /// `docs/truth-files.md`; others are left alone.
    ///
    /// Position that is missing is integrated from the velocity, angular acceleration that is
    /// missing is the difference quotient of the rate.
    ///
    /// # Errors
    /// A file that cannot be read, columns missing or in another unit (all missing ones are named
    /// at once), cells that are not finite numbers, time that does not rise.
    pub fn open(path: &Path) -> Result<Self, SimError> {
        let columns = read_columns(path, |name| known_column(path, name))?;
        for (name, values) in &columns {
            check_finite(path, name, values)?;
        }
        let missing: Vec<String> = required_columns()
            .filter(|name| !columns.contains_key(name))
            .collect();
        if !missing.is_empty() {
            return Err(SimError::MissingColumns {
                path: path.to_owned(),
                columns: missing,
            });
        }
        let name = path.file_stem().and_then(|stem| stem.to_str());
        Self::new(name.unwrap_or("truth"), states(&columns))
    }
}

/// All columns that a truth file must have, as `name[unit]`.
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

/// The known column that a column of a file is, if it is one.
fn known_column(path: &Path, found: &str) -> Result<Option<String>, SimError> {
    let stem = |name: &str| name.split('[').next().unwrap_or_default().trim().to_owned();
    let found_stem = stem(found);
    match required_columns()
        .chain(optional_columns())
        .find(|known| stem(known) == found_stem)
    {
        Some(known) if known == found.trim() => Ok(Some(known)),
        Some(expected) => Err(SimError::WrongUnit {
            path: path.to_owned(),
            found: found.to_owned(),
            expected,
        }),
        None => Ok(None),
    }
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
    let three = |row: usize, names: [&str; 3]| names.map(|name| get(row, name));
    let rows = columns.get("t[s]").map_or(0, Vec::len);
    let mut states: Vec<TruthState> = (0..rows)
        .map(|row| TruthState {
            time_s: get(row, "t[s]"),
            position_m: three(row, ["X[m]", "Y[m]", "Z[m]"]),
            roll_rad: get(row, "roll[rad]"),
            pitch_rad: get(row, "pitch[rad]"),
            yaw_rad: get(row, "yaw[rad]"),
            velocity_body_m_s: three(row, ["vx_body[m/s]", "vy_body[m/s]", "vz_body[m/s]"]),
            rate_rad_s: three(row, ["p[rad/s]", "q[rad/s]", "r[rad/s]"]),
            rate_derivative_rad_s2: three(row, ["pdot[rad/s2]", "qdot[rad/s2]", "rdot[rad/s2]"]),
            specific_force_m_s2: three(row, ["fx_body[m/s2]", "fy_body[m/s2]", "fz_body[m/s2]"]),
            acceleration_m_s2: three(row, ["ax_body[m/s2]", "ay_body[m/s2]", "az_body[m/s2]"]),
            hand_wheel_rad: get(row, "handwheel[rad]"),
            // A truth file's ground is level.
            bank_rad: 0.0,
            grade_rad: 0.0,
            wheels: PerWheel::from_fn(|wheel| wheel_truth(wheel, |name| get(row, name))),
        })
        .collect();
    fill_missing(&mut states);
    states
}

fn wheel_truth(wheel: Wheel, get: impl Fn(&str) -> f64) -> WheelTruth {
    let get = |name: &str| get(&format!("{}_{name}", wheel.abbreviation()));
    WheelTruth {
        force_n: ["Fx[N]", "Fy[N]", "Fz[N]"].map(get),
        moment_n_m: ["Mx[Nm]", "My[Nm]", "Mz[Nm]"].map(get),
        angular_speed_rad_s: get("omega[rad/s]"),
        steer_rad: get("steer[rad]"),
        slip_angle_rad: get("alpha[rad]"),
        friction: get("mu[-]"),
        strut_length_m: get("spring_len[m]"),
        link_force_n: [
            "UCA_tubeF_T[N]",
            "UCA_tubeB_T[N]",
            "LCA_tubeF_T[N]",
            "LCA_tubeB_T[N]",
            "tierod_T[N]",
        ]
        .map(get),
        lower_ball_force_n: ["LCA_ball_Fx[N]", "LCA_ball_Fy[N]", "LCA_ball_Fz[N]"].map(get),
        lower_ball_m: ["lbj_x[m]", "lbj_y[m]", "lbj_z[m]"].map(get),
        ball_normal_n: f64::NAN,
    }
}

/// Integrates a missing position, differentiates rates where their derivative is missing, and
/// takes gravity off the specific force where the acceleration is missing.
pub(crate) fn fill_missing(states: &mut [TruthState]) {
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
