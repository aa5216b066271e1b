//! Session: metadata of a run in its logs.

use sample::{LogTime, SourceId};
use store::{DynamicMessage, Session, SignalSchema, Source, SourceKind};
use wire::dbc::{MessageDef, parameter_group};
use wire::gps_time::Utc;

use crate::config::{self, Config, Meaning};
use crate::engine::SILENCE_NS;

/// Program that writes a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Program {
    /// Version.
    pub version: &'static str,
    /// Commit of its source.
    pub git_hash: &'static str,
}

/// This program.
pub const PROGRAM: Program = Program {
    version: env!("CARGO_PKG_VERSION"),
    git_hash: env!("ATVREC_GIT_HASH"),
};

/// Date of the source of this program: an earlier clock is wrong.
pub fn build_time() -> LogTime {
    let seconds: u64 = env!("ATVREC_BUILD_UNIX_S").parse().unwrap_or(0);
    LogTime(seconds * 1_000_000_000)
}

/// Session of a simulation. It does not depend on this machine.
pub fn simulated(config: &Config, run_id: &str, started: LogTime) -> Session {
    Session {
        run_id: run_id.to_owned(),
        ..started_at(config, started)
    }
}

/// Session of a replay: the run of the original with a configuration that may differ.
pub fn replayed(config: &Config, original: &Session) -> Session {
    Session {
        run_id: format!("{}-replay", original.run_id),
        boot_id: original.boot_id.clone(),
        host: original.host.clone(),
        clock: original.clock,
        injected_faults: original.injected_faults.clone(),
        ..started_at(config, original.started)
    }
}

/// Session with only configuration and start.
pub fn started_at(config: &Config, started: LogTime) -> Session {
    let mut sources: Vec<Source> = config
        .sources
        .iter()
        .map(|source| Source {
            id: source.spec.id,
            name: source.spec.name.clone(),
            kind: match source.meaning {
                Meaning::Can(_) => SourceKind::Can,
                _ => SourceKind::Serial,
            },
        })
        .collect();
    sources.push(Source {
        id: SourceId::HOST,
        name: "recorder".to_owned(),
        kind: SourceKind::Recorder,
    });
    Session {
        started,
        version: PROGRAM.version.to_owned(),
        silence_ns: SILENCE_NS.cast_unsigned(),
        git_hash: PROGRAM.git_hash.to_owned(),
        sources,
        dynamic: dynamic(config),
        attachments: config.attachments.clone(),
        ..Session::default()
    }
}

/// All messages of the DBC files.
fn dynamic(config: &Config) -> Vec<DynamicMessage> {
    let sources = config.sources.iter();
    sources
        .flat_map(dynamic_of)
        .map(|(_, message)| message)
        .collect()
}

/// Messages of the DBC files of a source, with their names on the bus.
pub(crate) fn dynamic_of(source: &config::Source) -> Vec<(&str, DynamicMessage)> {
    let Meaning::Can(can) = &source.meaning else {
        return Vec::new();
    };
    let bus = &source.spec.name;
    let message = |message: &MessageDef, name| {
        let signals = message.signals.iter().map(|signal| SignalSchema {
            name: signal.name.clone(),
            unit: signal.unit.clone(),
            labels: signal.labels.clone(),
        });
        let signals = signals.collect();
        if message.j1939 {
            DynamicMessage::j1939(bus, name, parameter_group(message.id), signals)
        } else {
            DynamicMessage::can(bus, name, message.id, signals)
        }
    };
    config::can_messages(can)
        .map(|(_, definition, name)| (name, message(definition, name)))
        .collect()
}

/// UTC as `20261121T140500Z` from seconds since the UNIX epoch.
pub fn utc_compact(unix_s: u64) -> String {
    Utc::of_unix_s(unix_s).compact()
}
