//! What a calibration or an identification found, how sure it is, and why it refuses.

use serde::Serialize;

use crate::statistics::interval_95;

/// A parameter that was found in data.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// Name: the quantity in words, such as `cornering_stiffness_front`.
    pub name: String,
    /// Value, in `unit`.
    pub value: f64,
    /// Unit, SI; `-` for a ratio.
    pub unit: String,
    /// Standard deviation, correlation of the residuals taken into account, in `unit`.
    pub sigma: f64,
    /// Interval that holds the truth with 95 %, from a seeded block bootstrap, in `unit`.
    pub interval: Option<[f64; 2]>,
    /// Condition number of the regression, its columns brought to equal size.
    pub condition: f64,
    /// How strongly the data move what this parameter hangs on.
    pub excitation: Option<Excitation>,
    /// What the residuals still hold.
    pub whiteness: Option<Whiteness>,
    /// The data that were used.
    pub span: Span,
}

impl Finding {
    /// A value with its standard deviation and the interval of a normal distribution, from a number of rows that move
    /// its regressor by `excitation`, root mean square and unit. The condition number is 1.
    pub(crate) fn of_rows(
        name: String,
        [value, sigma]: [f64; 2],
        unit: &str,
        (rms, of): (f64, &str),
        rows: usize,
    ) -> Self {
        Self {
            name,
            value,
            unit: unit.to_owned(),
            sigma,
            interval: Some(interval_95(value, sigma)),
            condition: 1.0,
            excitation: Some(Excitation {
                rms,
                unit: of.to_owned(),
            }),
            whiteness: None,
            span: Span {
                rows,
                ..Span::default()
            },
        }
    }
}

/// How strongly the data move a parameter's regressor.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Excitation {
    /// Root mean square of the part of the regressor that no other regressor explains.
    pub rms: f64,
    /// The regressor's unit.
    pub unit: String,
}

/// Whether residuals are white.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Whiteness {
    /// Durbin-Watson statistic: 2 for white residuals, towards 0 the slower they wander.
    pub durbin_watson: f64,
    /// Probability that white residuals would have autocorrelations as large as these (Ljung-Box).
    pub ljung_box_p: f64,
    /// Lags that the Ljung-Box test took in.
    pub lags: usize,
}

/// The data that a result rests on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Span {
    /// First instant used, s from the start of the data.
    pub from_s: f64,
    /// Last instant used, s from the start of the data.
    pub to_s: f64,
    /// Time of the used rows put together, s.
    pub used_s: f64,
    /// Rows used.
    pub rows: usize,
}

/// Everything that one command found.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Findings {
    /// What was looked for, in words: `cornering stiffness`.
    pub what: String,
    /// The parameters.
    pub findings: Vec<Finding>,
    /// Covariance of the parameters, in their order and the product of their units; empty where
    /// only the single deviations are known.
    pub covariance: Vec<Vec<f64>>,
    /// Values beside the point, for comparison or for a person who judges: name, value, unit.
    pub beside: Vec<(String, f64, String)>,
    /// What a person should know before using the values.
    pub notes: Vec<String>,
    /// Pictures to believe it by.
    #[serde(skip)]
    pub figures: Vec<Figure>,
}

impl Findings {
    /// The finding of this name.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&Finding> {
        self.findings.iter().find(|finding| finding.name == name)
    }

    /// The finding of this name as value and standard deviation; `NaN` twice if there is none.
    #[must_use]
    pub fn value(&self, name: &str) -> [f64; 2] {
        self.get(name)
            .map_or([f64::NAN; 2], |finding| [finding.value, finding.sigma])
    }
}

/// A picture of data and fit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figure {
    /// What it shows.
    pub title: String,
    /// Abscissa with unit.
    pub x_label: String,
    /// Ordinate with unit.
    pub y_label: String,
    /// Its series.
    pub series: Vec<Series>,
}

/// One series of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Its name.
    pub name: String,
    /// Drawn as a line (a model) rather than as points (data).
    pub line: bool,
    /// Abscissae.
    pub x: Vec<f64>,
    /// Ordinates, as many.
    pub y: Vec<f64>,
}

/// Why data do not tell a parameter.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// The data lack a channel, or all its values are unknown.
    #[error("{what}: there is no {channel}; {help}")]
    Missing {
        /// What was looked for.
        what: String,
        /// The channel.
        channel: String,
        /// What to do.
        help: String,
    },
    /// Too little data.
    #[error("{what}: {found_s:.1} s of usable data, {needed_s:.1} s are needed; {help}")]
    TooShort {
        /// What was looked for.
        what: String,
        /// Usable data, s.
        found_s: f64,
        /// Least that is needed, s.
        needed_s: f64,
        /// What to do.
        help: String,
    },
    /// The manoeuvre does not move what the parameter hangs on.
    #[error("{what}: {quantity} is {found:.4} {unit}, at least {needed} {unit} is needed; {help}")]
    NotExcited {
        /// What was looked for.
        what: String,
        /// What moves too little.
        quantity: String,
        /// How much it moves.
        found: f64,
        /// How much is needed.
        needed: f64,
        /// Unit of both.
        unit: String,
        /// What to do.
        help: String,
    },
    /// The data cannot tell the parameters apart.
    #[error(
        "{what}: the data cannot tell the parameters apart (condition number {condition:.1e}); {help}"
    )]
    Singular {
        /// What was looked for.
        what: String,
        /// Condition number that was found; infinite where a column is empty.
        condition: f64,
        /// What to do.
        help: String,
    },
    /// A fit that does not come to rest.
    #[error("{what}: the fit did not converge in {iterations} iterations; {help}")]
    NotConverged {
        /// What was looked for.
        what: String,
        /// Iterations made.
        iterations: usize,
        /// What to do.
        help: String,
    },
    /// A value that cannot be.
    #[error("{what}: {name} = {value} is not usable; expected {expected}")]
    Value {
        /// What was looked for.
        what: String,
        /// Name of the value.
        name: String,
        /// The value.
        value: f64,
        /// What would do.
        expected: String,
    },
    /// Columns of different length.
    #[error("{what}: {name} has {found} values, the first column has {expected}")]
    Length {
        /// What was looked for.
        what: String,
        /// Name of the column.
        name: String,
        /// Its length.
        found: usize,
        /// Length of the first column.
        expected: usize,
    },
    /// The log is of another vehicle.
    #[error(
        "{what}: the log is of vehicle \"{found}\", the file is for \"{expected}\"; \
         take a log of that vehicle, or the right file"
    )]
    OtherVehicle {
        /// What was looked for.
        what: String,
        /// Vehicle that the file is for.
        expected: String,
        /// Vehicle of the log.
        found: String,
    },
}

impl Refusal {
    /// The same refusal, said of something else; a regression does not know what it is for.
    #[must_use]
    pub fn of(mut self, said_of: &str) -> Self {
        match &mut self {
            Self::Missing { what, .. }
            | Self::TooShort { what, .. }
            | Self::NotExcited { what, .. }
            | Self::Singular { what, .. }
            | Self::NotConverged { what, .. }
            | Self::Value { what, .. }
            | Self::Length { what, .. }
            | Self::OtherVehicle { what, .. } => said_of.clone_into(what),
        }
        self
    }

    /// The same refusal with other advice.
    #[must_use]
    pub fn advise(mut self, advice: &str) -> Self {
        match &mut self {
            Self::Missing { help, .. }
            | Self::TooShort { help, .. }
            | Self::NotExcited { help, .. }
            | Self::Singular { help, .. }
            | Self::NotConverged { help, .. } => advice.clone_into(help),
            Self::Value { .. } | Self::Length { .. } | Self::OtherVehicle { .. } => {}
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_tells_what_is_lacking_and_what_to_do() {
        let refusal = Refusal::NotExcited {
            what: "regression".to_owned(),
            quantity: "lateral acceleration (rms)".to_owned(),
            found: 0.123_456,
            needed: 0.8,
            unit: "m/s^2".to_owned(),
            help: "-".to_owned(),
        };
        assert_eq!(
            refusal
                .of("cornering stiffness")
                .advise("steer more")
                .to_string(),
            "cornering stiffness: lateral acceleration (rms) is 0.1235 m/s^2, at least 0.8 m/s^2 \
             is needed; steer more"
        );
    }
}
