//! Session: metadata of a run in its logs.

use sample::{LogTime, SourceId};
use store::{DynamicMessage, Session, SignalSchema, Source, SourceKind};
use wire::gps_time::Utc;

use crate::config::{Config, Meaning};
use crate::engine::SILENCE_NS;

/// Program that writes a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Program {
    /// Version.
    pub version: &'static str,
    /// Commit of its source.
    pub git_hash: &'static str,
}

/// Session of a simulation. It does not depend on this machine.
pub fn simulated(config: &Config, program: Program, run_id: &str, started: LogTime) -> Session {
    Session {
        run_id: run_id.to_owned(),
        ..started_at(config, program, started)
    }
}

/// Session of a replay: the run of the original with a configuration that may differ.
pub fn replayed(config: &Config, program: Program, original: &Session) -> Session {
    Session {
        run_id: format!("{}-replay", original.run_id),
        boot_id: original.boot_id.clone(),
        host: original.host.clone(),
        clock: original.clock,
        ..started_at(config, program, original.started)
    }
}

/// Session with only configuration, program and start.
pub fn started_at(config: &Config, program: Program, started: LogTime) -> Session {
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
        version: program.version.to_owned(),
        silence_ns: SILENCE_NS.cast_unsigned(),
        git_hash: program.git_hash.to_owned(),
        sources,
        dynamic: dynamic(config),
        attachments: config.attachments.clone(),
        ..Session::default()
    }
}

/// All messages of the DBC files.
fn dynamic(config: &Config) -> Vec<DynamicMessage> {
    let mut messages = Vec::new();
    for source in &config.sources {
        let Meaning::Can(can) = &source.meaning else {
            continue;
        };
        for message in can.databases.iter().flat_map(|d| d.messages()) {
            let signals = message
                .signals
                .iter()
                .map(|signal| SignalSchema {
                    name: signal.name.clone(),
                    unit: signal.unit.clone(),
                })
                .collect();
            messages.push(DynamicMessage::can(
                &source.spec.name,
                &message.name,
                message.id,
                signals,
            ));
        }
    }
    messages
}

/// UTC as `20261121T140500Z` from seconds since the UNIX epoch.
pub fn utc_compact(unix_s: u64) -> String {
    Utc::of_unix_s(unix_s).compact()
}
