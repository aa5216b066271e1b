//! Latencies of messages that the configuration does not know: which they are, and what a drive says of them.

use estimator::{LATENCIES_MAX, LatencyEstimate, LatencyPrior};
use sample::SourceId;
use serde_json::{Value, json};
use store::Reader;
use toml::Table;

use crate::config::{Meaning, Source};
use crate::{Config, Error, Replay, ReplayOptions, Result};

/// A message, or a source without messages, whose latency has a standard deviation in the configuration.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Uncertain {
    pub source: SourceId,
    /// Database and place in it of a message on a bus.
    pub message: Option<[usize; 2]>,
    pub prior: LatencyPrior,
}

/// All of them, in the order in which the estimator numbers them. On a bus, only the messages with roles count.
pub(crate) fn uncertain(sources: &[Source]) -> Vec<Uncertain> {
    let mut all: Vec<Uncertain> = sources.iter().flat_map(of_source).collect();
    all.truncate(LATENCIES_MAX);
    all
}

fn of_source(source: &Source) -> Vec<Uncertain> {
    let spec = &source.spec;
    let one = |message, name: String, latency_s, sigma_s| Uncertain {
        source: spec.id,
        message,
        prior: LatencyPrior {
            name,
            latency_s,
            sigma_s,
        },
    };
    let Meaning::Can(can) = &source.meaning else {
        let (latency_s, sigma_s) = (source.transport_delay_s, source.latency_sigma_s);
        let alone = one(None, spec.name.clone(), latency_s, sigma_s);
        return Some(alone).filter(|_| sigma_s > 0.0).into_iter().collect();
    };
    let mut found = Vec::new();
    for (database, names) in can.names.iter().enumerate() {
        for (message, name) in names.iter().enumerate() {
            let mut roles = can.roles.iter();
            let is_measured =
                roles.any(|role| (role.database, role.message) == (database, message));
            let is_marked = can
                .sync
                .as_ref()
                .is_some_and(|sync| sync.marks[database][message]);
            // What the source says is the time to the arrival of the message, not of the sync frame.
            let of_source_s = if is_marked {
                0.0
            } else {
                source.latency_sigma_s
            };
            let sigma_s = can.latency_sigmas_s[database][message].unwrap_or(of_source_s);
            if is_measured && sigma_s > 0.0 {
                let latency_s = can.latencies_s[database][message];
                found.push(one(
                    Some([database, message]),
                    format!("{}.{name}", spec.name),
                    latency_s.unwrap_or(source.transport_delay_s),
                    sigma_s,
                ));
            }
        }
    }
    found
}

/// Repeats the estimate of a log with a configuration, and tells what the drive says of the latencies.
///
/// # Errors
/// If the configuration has no vehicle or no `latency_sigma_s`, or does not fit the log; if the log cannot be read.
pub fn find_latencies(reader: &Reader, config: &Config) -> Result<Vec<LatencyEstimate>> {
    let estimator = config.estimator.as_ref().ok_or(Error::NoVehicleToJudge)?;
    if uncertain(&config.sources).is_empty() {
        return Err(Error::NoUncertainLatency);
    }
    let options = ReplayOptions {
        without_records: true,
        ..ReplayOptions::default()
    };
    let done = Replay::new(reader, config, options)?.run(|_| Ok::<_, Error>(()))?;
    match done.mistakes {
        Some(_) => Ok(done.latencies),
        None => Err(Error::NoForcesToJudge(estimator.vehicle.name.clone())),
    }
}

/// What a drive says, in words.
#[must_use]
pub fn describe_latency(found: &LatencyEstimate) -> String {
    let ms = |s: f64| 1e3 * s;
    let [from_s, to_s] = found.interval_s();
    format!(
        "latency of {}: {:.2} ms, with a probability of 95 % between {:.2} and {:.2} ms (configured: {:.2} ± {:.2} ms)",
        found.prior.name,
        ms(found.latency_s),
        ms(from_s),
        ms(to_s),
        ms(found.prior.latency_s),
        ms(found.prior.sigma_s),
    )
}

/// The latencies as JSON.
#[must_use]
pub fn latencies_as_json(found: &[LatencyEstimate]) -> Value {
    let each = found.iter().map(|one| {
        json!({
            "message": one.prior.name,
            "latency_s": one.latency_s,
            "sigma_s": one.sigma_s,
            "interval_s": one.interval_s(),
            "is_found": one.is_found,
            "configured_latency_s": one.prior.latency_s,
            "configured_sigma_s": one.prior.sigma_s,
        })
    });
    json!({ "latencies": each.collect::<Vec<_>>() })
}

/// Text of a configuration with the latencies of a drive in it.
///
/// # Errors
/// If `text` is no TOML.
pub fn with_latencies(text: &str, found: &[LatencyEstimate]) -> Result<String> {
    let mut table: Table = text.parse().map_err(Error::AttachedConfiguration)?;
    for one in found {
        let (source, message) = match one.prior.name.split_once('.') {
            Some((source, message)) => (source, Some(message)),
            None => (one.prior.name.as_str(), None),
        };
        let Some(source) = table
            .get_mut("source")
            .and_then(|sources| sources.get_mut(source))
            .and_then(toml::Value::as_table_mut)
        else {
            continue;
        };
        // Microseconds are enough.
        let rounded = |s: f64| toml::Value::Float((s * 1e6).round() / 1e6);
        let values = [rounded(one.latency_s.max(0.0)), rounded(one.sigma_s)];
        match message {
            None => {
                for (key, value) in ["latency_s", "latency_sigma_s"].into_iter().zip(values) {
                    source.insert(key.to_owned(), value);
                }
            }
            Some(message) => {
                let tables = ["message_latency_s", "message_latency_sigma_s"];
                for (key, value) in tables.into_iter().zip(values) {
                    let inner = source
                        .entry(key)
                        .or_insert_with(|| toml::Value::Table(Table::new()));
                    if let Some(inner) = inner.as_table_mut() {
                        inner.insert(message.to_owned(), value);
                    }
                }
            }
        }
    }
    let text = toml::to_string_pretty(&table)?;
    Ok(format!(
        "# With the latencies that `atvrec identify latency` found.\n{text}"
    ))
}
