//! A drive as arrays.

use sample::PerWheel;

use crate::finding::{Refusal, Series, Span};

/// What a drive's motion was, on an even time grid, `NaN` where unknown. All columns have the same
/// length; one that is empty was not recorded.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drive {
    /// Interval of the grid, s.
    pub dt_s: f64,
    /// Horizontal speed of the centre of gravity, m/s.
    pub speed_m_s: Vec<f64>,
    /// Sideslip angle at the centre of gravity, rad.
    pub sideslip_rad: Vec<f64>,
    /// Yaw rate, left positive, rad/s.
    pub yaw_rate_rad_s: Vec<f64>,
    /// Horizontal acceleration of the centre of gravity across the heading, to the left, m/s^2.
    pub lateral_m_s2: Vec<f64>,
    /// Horizontal acceleration of the centre of gravity along the heading, m/s^2.
    pub longitudinal_m_s2: Vec<f64>,
    /// Mean steer angle of the front road wheels, left positive, rad.
    pub steer_rad: Vec<f64>,
    /// Roll angle, right side down positive, rad.
    pub roll_rad: Vec<f64>,
    /// Pitch angle, nose down positive, rad.
    pub pitch_rad: Vec<f64>,
    /// Load of each wheel, N.
    pub loads_n: PerWheel<Vec<f64>>,
}

impl Drive {
    /// Rows of the drive: those of its longest column.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.columns()
            .iter()
            .map(|(_, column)| column.len())
            .max()
            .unwrap_or(0)
    }

    fn columns(&self) -> [(&'static str, &[f64]); 8] {
        [
            ("speed", &self.speed_m_s),
            ("sideslip", &self.sideslip_rad),
            ("yaw rate", &self.yaw_rate_rad_s),
            ("lateral acceleration", &self.lateral_m_s2),
            ("longitudinal acceleration", &self.longitudinal_m_s2),
            ("steer angle", &self.steer_rad),
            ("roll angle", &self.roll_rad),
            ("pitch angle", &self.pitch_rad),
        ]
    }

    /// Checks that the named columns are there and of one length, and that the grid is one.
    ///
    /// # Errors
    /// A column that is empty or all unknown, lengths that differ, an interval that is none.
    pub fn require(&self, what: &str, names: &[&str]) -> Result<(), Refusal> {
        if !(self.dt_s > 0.0 && self.dt_s < 1.0) {
            return Err(Refusal::Value {
                what: what.to_owned(),
                name: "interval of the time grid".to_owned(),
                value: self.dt_s,
                expected: "between 0 and 1 s".to_owned(),
            });
        }
        let expected = self.rows();
        for (name, column) in self.columns() {
            let needed = names.contains(&name);
            if needed && column.iter().all(|value| !value.is_finite()) {
                return Err(Refusal::Missing {
                    what: what.to_owned(),
                    channel: name.to_owned(),
                    help: source_of(name).to_owned(),
                });
            }
            same_length(what, name, column, expected)?;
        }
        for load_n in &self.loads_n.0 {
            same_length(what, "wheel load", load_n, expected)?;
        }
        Ok(())
    }
}

/// Refuses a column of another length than the others; one that was not recorded is none.
fn same_length(what: &str, name: &str, column: &[f64], expected: usize) -> Result<(), Refusal> {
    if column.is_empty() || column.len() == expected {
        return Ok(());
    }
    Err(Refusal::Length {
        what: what.to_owned(),
        name: name.to_owned(),
        found: column.len(),
        expected,
    })
}

/// Where a signal comes from, for a person who lacks it.
fn source_of(name: &str) -> &'static str {
    match name {
        "speed" | "sideslip" => "it needs a GNSS receiver's velocity with an inertial unit",
        "steer angle" => {
            "it needs the steering-wheel encoder and a vehicle file with a steering gear"
        }
        _ => "it needs the inertial unit",
    }
}

/// The span of the rows that were used, which stand `dt_s` apart.
#[must_use]
pub fn span_of(rows: &[usize], dt_s: f64, stride: usize) -> Span {
    let at = |row: Option<&usize>| row.map_or(0.0, |row| *row as f64 * dt_s);
    Span {
        from_s: at(rows.first()),
        to_s: at(rows.last()),
        used_s: rows.len() as f64 * stride as f64 * dt_s,
        rows: rows.len(),
    }
}

pub(super) fn series(name: &str, line: bool, x: Vec<f64>, y: Vec<f64>) -> Series {
    Series {
        name: name.to_owned(),
        line,
        x,
        y,
    }
}
