//! A configuration against a recording of about a minute: what does not fit, the likely cause, and the next
//! step.
//!
//! The arrivals of the log are decoded with the configuration. The readings are averaged over 0.1 s and compared
//! with the speed and the course of the GNSS receiver, with each other, and with the balances of the vehicle
//! file.

mod at_rest;
mod columns;
mod line;
mod mistakes;
mod motion;
mod reference;
mod roles;
#[cfg(test)]
mod tests;
mod tilt;
mod wheels;

use std::fmt;
use std::ops::Range;

use estimator::EstimatorError;
use estimator::calibration::Resolved;
use model::vehicle::Vehicle;
use store::{Reader, Record};

use crate::{Config, Entry, Error, Listened, Replay, ReplayOptions, Result};
use columns::Columns;
use reference::Reference;
use roles::Messages;

/// Something that does not fit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Misfit {
    /// Sensor, channel or role.
    pub subject: String,
    /// What the recording has.
    pub found: String,
    /// Likely cause.
    pub cause: String,
    /// Next step.
    pub remedy: String,
}

impl fmt::Display for Misfit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            subject,
            found,
            cause,
            remedy,
        } = self;
        write!(
            f,
            "{subject}: {found}; likely cause: {cause}; next step: {remedy}"
        )
    }
}

/// Something that the recording does not decide.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Undecided {
    /// Sensor, channel or role.
    pub subject: String,
    /// Manoeuvre that decides.
    pub manoeuvre: String,
}

/// Result of the comparison.
#[derive(Clone, Debug, Default)]
pub struct Judgement {
    /// What does not fit.
    pub misfits: Vec<Misfit>,
    /// What the recording does not decide.
    pub undecided: Vec<Undecided>,
    /// What fits, with its value.
    pub fits: Vec<String>,
    /// Messages that arrive and have no role.
    pub without_role: Vec<String>,
}

impl Judgement {
    fn undecided(&mut self, subject: &str, manoeuvre: &str) {
        self.undecided.push(Undecided {
            subject: subject.to_owned(),
            manoeuvre: manoeuvre.to_owned(),
        });
    }

    /// Judges a ratio to the expectation; `place` is where the unit is stated.
    fn ratio(
        &mut self,
        subject: &str,
        against: &str,
        ratio: f64,
        fits: &Range<f64>,
        units: &[&str],
        place: &str,
    ) {
        if fits.contains(&ratio) {
            self.fits.push(format!("{subject}: {ratio:.2} {against}"));
            return;
        }
        let cause = line::unit_of(ratio, 2.0, units);
        self.misfits.push(Misfit {
            subject: subject.to_owned(),
            found: format!("{ratio:.3} times the expected size {against}"),
            cause: cause.unwrap_or("the unit or the scale is wrong").to_owned(),
            remedy: format!("correct {place}"),
        });
    }
}

/// Collects the records of a recording.
pub struct Fit<'c> {
    config: &'c Config,
    vehicle: Vehicle,
    calibration: Resolved,
    columns: Columns,
    listened: Listened,
    messages: Messages,
}

impl<'c> Fit<'c> {
    /// A comparison without any record.
    ///
    /// # Errors
    /// If the configuration has no vehicle, or a calibration that cannot be used.
    pub fn new(config: &'c Config) -> Result<Self> {
        let settings = config.estimator.as_ref().ok_or(Error::NoVehicleToJudge)?;
        let loaded = settings
            .vehicle
            .loaded(&settings.settings.payload)
            .map_err(EstimatorError::from)?;
        let sensors = loaded.sensors(&settings.sensors);
        Ok(Self {
            config,
            calibration: Resolved::new(&sensors, &settings.calibration)?,
            vehicle: settings.calibration.applied(&loaded.vehicle),
            columns: Columns::default(),
            listened: Listened::new(config),
            messages: Messages::default(),
        })
    }

    /// Takes a record of the engine.
    pub fn push(&mut self, record: &Record) {
        let Record::Sample(sample) = record else {
            return;
        };
        self.listened.push(record);
        self.messages.push(sample);
        self.columns.push(sample, &self.calibration);
    }

    /// Compares what was recorded with the configuration.
    #[must_use]
    pub fn judge(&self) -> Judgement {
        let mut judgement = Judgement::default();
        self.messages.judge(self.config, &mut judgement);
        for warning in self.listened.rates_and_hubs(self.config) {
            judgement.misfits.push(Misfit {
                subject: "sensors file".to_owned(),
                found: warning,
                cause: "the sensors file is that of other sensors or settings".to_owned(),
                remedy: "correct the sensors file".to_owned(),
            });
        }
        for wrong in self.listened.wrong_ranges(self.config) {
            judgement.misfits.push(Misfit {
                found: wrong.beyond.found(),
                remedy: wrong.beyond.remedy(),
                subject: wrong.channels,
                cause: "the sensors file is that of another converter".to_owned(),
            });
        }
        let (columns, vehicle, calibration) = (&self.columns, &self.vehicle, &self.calibration);
        let reference = Reference::new(columns, vehicle, calibration);
        let tilt_deg = motion::gravity(columns, &reference, &mut judgement);
        let unit_stands = tilt_deg.is_none_or(|tilt_deg| tilt_deg <= motion::TILT_CERTAIN_DEG);
        motion::yaw_rates(&reference, unit_stands, &mut judgement);
        if unit_stands {
            motion::horizontal_axes(columns, &reference, &mut judgement);
            // Only readings that fit otherwise show the tilt.
            let of_unit = |misfit: &Misfit| misfit.subject.starts_with(motion::UNIT);
            if !judgement.misfits.iter().any(of_unit) {
                tilt::rates(columns, &reference, &mut judgement);
            }
        } else {
            judgement.undecided(
                "inertial unit, other axes",
                "correct the direction of gravity, and check again",
            );
        }
        motion::wheel_speeds(columns, &reference, &mut judgement);
        wheels::speed_sides(columns, vehicle, &reference, &mut judgement);
        wheels::deflections(columns, vehicle, &reference, &mut judgement);
        wheels::strains(columns, vehicle, &reference, &mut judgement);
        if tilt_deg.is_some_and(|tilt_deg| tilt_deg <= motion::TILT_MAX_DEG) {
            at_rest::deflections(columns, vehicle, calibration, &reference, &mut judgement);
            at_rest::strains(columns, vehicle, calibration, &reference, &mut judgement);
        } else {
            judgement.undecided(
                "loads at rest",
                "let the vehicle stand for 10 s on level ground",
            );
        }
        judgement
    }
}

/// Decodes a log with a configuration and compares both.
///
/// # Errors
/// As [`Fit::new`]; if the configuration does not have the sources of the log; if the log cannot be read.
pub fn judge_log(reader: &Reader, config: &Config) -> Result<Judgement> {
    let mut fit = Fit::new(config)?;
    let replay = Replay::new(reader, config, ReplayOptions::default())?;
    let done = replay.run(|entry| {
        if let Entry::Record(record) = &entry {
            fit.push(record);
        }
        Ok::<_, Error>(())
    })?;
    let mut judgement = fit.judge();
    if let Some(report) = &done.mistakes {
        mistakes::judge(report, &mut judgement);
    }
    Ok(judgement)
}
