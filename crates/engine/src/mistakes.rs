//! What the forces of a drive say of its configuration.

use estimator::MistakeReport;
use serde_json::{Value, json};
use store::Reader;

use crate::{Config, Error, Replay, ReplayOptions, Result};

/// Repeats the estimate of a log with a configuration, and weighs the mistakes of the configuration.
///
/// # Errors
/// If the configuration has no vehicle with linkages, or does not fit the log; if the log cannot be read.
pub fn find_mistakes(reader: &Reader, config: &Config) -> Result<MistakeReport> {
    let estimator = config.estimator.as_ref().ok_or(Error::NoVehicleToJudge)?;
    let options = ReplayOptions {
        without_records: true,
        ..ReplayOptions::default()
    };
    let done = Replay::new(reader, config, options)?.run(|_| Ok::<_, Error>(()))?;
    let name = || Error::NoForcesToJudge(estimator.vehicle.name.clone());
    done.mistakes.ok_or_else(name)
}

/// The report as JSON.
#[must_use]
pub fn mistakes_as_json(report: &MistakeReport) -> Value {
    let found = report.found.iter().map(|(found, words)| {
        json!({
            "time_ns": found.time.0,
            "subject": words.subject,
            "cause": words.cause,
            "help": words.remedy,
            "log_likelihood_ratio": found.judged.ratio,
            "corrected": found.corrected,
        })
    });
    let units = report.units.iter().map(|(time, unit)| {
        let words = unit.describe();
        json!({
            "time_ns": time.0,
            "subject": words.subject,
            "cause": words.cause,
            "help": words.remedy,
            "factor": unit.factor,
        })
    });
    let likeliest = report.likeliest.as_ref().map(|(words, ratio)| {
        json!({ "subject": words.subject, "cause": words.cause, "log_likelihood_ratio": ratio })
    });
    let parameters = &report.parameters;
    json!({
        "found": found.collect::<Vec<_>>(),
        "units": units.collect::<Vec<_>>(),
        "parameters": {
            "tolerance_factor": parameters.factor,
            "since_ns": parameters.since.map(|time| time.0),
            "tolerances_stated": parameters.are_stated,
        },
        "likeliest": likeliest,
        "used_s": report.driven.used_s,
        "decisive": report.is_decisive,
        "manoeuvre": report.manoeuvre,
    })
}
