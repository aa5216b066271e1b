//! `atvrec check`: errors of a configuration, and whether its devices send data.

mod with_log;

use std::collections::BTreeMap;

use acq::SourceCounters;
use engine::config::device_name;
use engine::{Config, Engine, Listened, Reception, bus_warnings, scope};
use sample::text::printable;
use sample::{LossPlace, SourceId};
use serde_json::json;
use store::Losses;

use crate::cli::CheckArgs;
use crate::exit::Outcome;
use crate::{listening, retention};

/// Result of listening to a device.
struct DeviceCheck {
    name: String,
    device: String,
    state: State,
    counters: SourceCounters,
    lost: [u64; LossPlace::ALL.len()],
    /// Time of listening, s.
    listened_s: f64,
    reception: Option<Reception>,
    values: Vec<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    SendsData,
    /// Data arrives, and no decoder understands it.
    NotUnderstood,
    Silent,
    NotOpen,
}

impl State {
    const fn name(self) -> &'static str {
        match self {
            Self::SendsData => "answers",
            Self::NotUnderstood => "not understood",
            Self::Silent => "silent",
            Self::NotOpen => "not open",
        }
    }
}

/// Runs the command.
pub fn run(args: &CheckArgs) -> anyhow::Result<Outcome> {
    let path = args.path();
    let config = match Config::load(path).map_err(anyhow::Error::from) {
        Ok(config) => config,
        Err(error) if args.json => {
            println!("{:#}", problems_as_json(&error));
            return Err(error);
        }
        Err(error) => return Err(error),
    };
    if !args.with_log.is_empty() {
        return with_log::run(args, &config);
    }
    // The engine checks the configuration further.
    let engine = Engine::new(&config)?;
    let (devices, listened) = if args.no_devices {
        (Vec::new(), Listened::default())
    } else {
        super::require_sources(path, &config)?;
        listen(&config, engine, args.listen_s)?
    };
    let storage = &config.storage;
    let rate = retention::last_rate(&storage.directory);
    let mut warnings =
        retention::warnings(&storage.directory, storage.limits, &storage.options, rate);
    warnings.extend(config.warnings());
    warnings.extend(bus_warnings(&config));
    warnings.extend(listened.warnings(&config));
    warnings.extend(scope::limits(&config));
    if args.json {
        println!("{:#}", as_json(&devices, &warnings));
    } else {
        println!(
            "{}: {} sources, no errors",
            path.display(),
            config.sources.len()
        );
        for warning in &warnings {
            println!("warning: {warning}");
        }
        print(&devices);
    }
    let all_send = devices
        .iter()
        .all(|device| device.state == State::SendsData);
    Ok(if all_send {
        Outcome::Good
    } else {
        Outcome::Failed
    })
}

fn listen(
    config: &Config,
    engine: Engine,
    listen_s: f64,
) -> anyhow::Result<(Vec<DeviceCheck>, Listened)> {
    let specs = config.sources.iter().map(|source| source.spec.clone());
    let state = (Listened::new(config), engine);
    let mut records = Vec::new();
    let heard = listening::listen(
        specs,
        listen_s,
        state,
        move |(listened, engine), arrival| {
            engine.push(arrival, &mut records);
            for record in records.drain(..) {
                listened.push(&record);
            }
        },
    )?;
    let (listened, engine) = heard.state;
    let (counters, losses) = (heard.counters, heard.losses);
    let mut devices = results(config, &counters, &losses);
    let receptions = engine.reception();
    for ((device, source), reception) in devices.iter_mut().zip(&config.sources).zip(receptions) {
        device.listened_s = listen_s;
        device.values = listened.values(source);
        if device.state == State::SendsData && reception.problem().is_some() {
            device.state = State::NotUnderstood;
        }
        device.reception = Some(reception);
    }
    Ok((devices, listened))
}

fn results(
    config: &Config,
    counters: &BTreeMap<SourceId, SourceCounters>,
    losses: &Losses,
) -> Vec<DeviceCheck> {
    config
        .sources
        .iter()
        .map(|source| {
            let counters = counters.get(&source.spec.id).cloned().unwrap_or_default();
            let state = match (counters.last_data, counters.open) {
                (Some(_), _) => State::SendsData,
                (None, true) => State::Silent,
                (None, false) => State::NotOpen,
            };
            DeviceCheck {
                name: source.spec.name.clone(),
                device: device_name(&source.spec.kind),
                state,
                counters,
                lost: losses.of(source.spec.id),
                listened_s: 0.0,
                reception: None,
                values: Vec::new(),
            }
        })
        .collect()
}

/// Indentation of the lines below a device.
const BELOW: &str = "                ";

fn print(devices: &[DeviceCheck]) {
    for device in devices {
        let lost: u64 = device.lost.iter().sum();
        println!(
            "  {:<13} {:<31} {:<15}{:>8} items {:>9} bytes{}",
            device.name,
            printable(&device.device),
            device.state.name(),
            device.counters.items,
            device.counters.bytes,
            if lost > 0 {
                format!(", {lost} lost")
            } else {
                String::new()
            },
        );
        let silent = matches!(device.state, State::Silent | State::NotOpen);
        if silent && !device.counters.state.is_empty() {
            println!("{BELOW}{}", printable(&device.counters.state));
        }
        let Some(reception) = &device.reception else {
            continue;
        };
        if device.state == State::NotUnderstood
            && let Some(problem) = reception.problem()
        {
            println!("{BELOW}{}", printable(&problem));
        }
        for (label, messages) in [
            ("messages", device.rates(reception.messages.decoded())),
            (
                "not decoded",
                device.rates(reception.messages.not_decoded()),
            ),
            ("values", device.values.join(", ")),
        ] {
            if !messages.is_empty() {
                println!("{BELOW}{label}: {}", printable(&messages));
            }
        }
    }
}

impl DeviceCheck {
    /// Names with messages per second.
    fn rates<'m>(&self, messages: impl Iterator<Item = (&'m str, u64)>) -> String {
        let rate = |count: u64| count as f64 / self.listened_s.max(1e-3);
        let texts = messages.map(|(name, count)| format!("{name} {:.1} Hz", rate(count)));
        texts.collect::<Vec<_>>().join(", ")
    }

    /// Names, counts and rates for JSON.
    fn messages(&self) -> Vec<serde_json::Value> {
        let Some(reception) = &self.reception else {
            return Vec::new();
        };
        let decoded = reception.messages.decoded().map(|message| (message, true));
        let others = reception.messages.not_decoded();
        let all = decoded.chain(others.map(|message| (message, false)));
        let as_json = |((name, count), decoded): ((&str, u64), bool)| {
            let rate_hz = count as f64 / self.listened_s.max(1e-3);
            json!({ "name": name, "count": count, "rate_hz": rate_hz, "decoded": decoded })
        };
        all.map(as_json).collect()
    }
}

fn as_json(devices: &[DeviceCheck], warnings: &[String]) -> serde_json::Value {
    let devices: Vec<_> = devices
        .iter()
        .map(|device| {
            let lost: serde_json::Map<_, _> = LossPlace::ALL
                .into_iter()
                .zip(device.lost)
                .map(|(place, count)| (place.name().to_owned(), count.into()))
                .collect();
            json!({
                "source": device.name,
                "device": device.device,
                "state": device.state.name(),
                "items": device.counters.items,
                "bytes": device.counters.bytes,
                "lost": lost,
                "said": device.counters.state,
                "problem": device.reception.as_ref().and_then(Reception::problem),
                "looks_like": device.reception.as_ref().and_then(|r| r.format).map(|f| f.name()),
                "messages": device.messages(),
                "values": device.values,
            })
        })
        .collect();
    json!({ "errors": [], "warnings": warnings, "devices": devices })
}

fn problems_as_json(error: &anyhow::Error) -> serde_json::Value {
    let errors = match error.downcast_ref() {
        Some(engine::Error::Configuration(problems)) => problems
            .0
            .iter()
            .map(|problem| {
                json!({
                    "file": problem.file,
                    "line": problem.line,
                    "column": problem.column,
                    "field": problem.field,
                    "message": problem.statement(),
                    "help": problem.help,
                })
            })
            .collect(),
        _ => vec![json!({ "message": format!("{error:#}") })],
    };
    json!({ "errors": errors, "warnings": [], "devices": [] })
}
