//! What a log states about its run.

use std::fs;

use sample::{LogTime, SourceId};
use store::{ClockState, DynamicMessage, Session, SignalSchema, Source, SourceKind};

use crate::config::{Config, Meaning};
use crate::engine::SILENCE_NS;

/// The session of a recording on this machine: run `run_number` of its log folder, by a clock whose
/// state was `clock`.
pub fn live(config: &Config, started: LogTime, run_number: u64, clock: ClockState) -> Session {
    let seconds = started.0 / 1_000_000_000;
    Session {
        run_number: Some(run_number),
        clock,
        run_id: format!("{}-{:06x}", utc_compact(seconds), started.0 & 0xFF_FFFF),
        boot_id: read_line("/proc/sys/kernel/random/boot_id"),
        host: read_line("/proc/sys/kernel/hostname"),
        ..common(config, started)
    }
}

/// Date of the source that this program is built from: a clock that stands before it is wrong.
pub fn build_time() -> LogTime {
    let seconds: u64 = env!("ATVREC_BUILD_UNIX_S").parse().unwrap_or(0);
    LogTime(seconds * 1_000_000_000)
}

/// State of the host's clock, which stood at `anchor` when the log clock was set to it.
pub fn clock_state(anchor: LogTime) -> ClockState {
    if anchor < build_time() {
        return ClockState::BeforeBuild;
    }
    match acq::clock_is_synchronised() {
        Ok(true) => ClockState::Synchronised,
        Ok(false) => ClockState::Unsynchronised,
        Err(error) => {
            tracing::debug!(%error, "the kernel does not say whether the clock is synchronised");
            ClockState::Unknown
        }
    }
}

/// The session of a simulation: nothing in it depends on this machine.
pub fn simulated(config: &Config, run_id: &str, started: LogTime) -> Session {
    Session {
        run_id: run_id.to_owned(),
        ..common(config, started)
    }
}

/// The session of a replay: the original's run under a configuration that may be another.
pub fn replayed(config: &Config, original: &Session) -> Session {
    Session {
        run_id: format!("{}-replay", original.run_id),
        boot_id: original.boot_id.clone(),
        host: original.host.clone(),
        clock: original.clock,
        ..common(config, original.started)
    }
}

fn common(config: &Config, started: LogTime) -> Session {
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
        version: env!("CARGO_PKG_VERSION").to_owned(),
        silence_ns: SILENCE_NS.cast_unsigned(),
        git_hash: env!("ATVREC_GIT_HASH").to_owned(),
        sources,
        dynamic: dynamic(config),
        attachments: config.attachments.clone(),
        ..Session::default()
    }
}

/// All messages of the buses' DBC files.
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

fn read_line(path: &str) -> String {
    fs::read_to_string(path)
        .unwrap_or_default()
        .trim()
        .to_owned()
}

/// `20261121T140500Z` of seconds since the UNIX epoch.
pub fn utc_compact(unix_s: u64) -> String {
    let (year, month, day) = civil_date(unix_s / 86_400);
    let second = unix_s % 86_400;
    format!(
        "{year:04}{month:02}{day:02}T{:02}{:02}{:02}Z",
        second / 3_600,
        second / 60 % 60,
        second % 60
    )
}

/// Gregorian date of days since 1970-01-01 (era arithmetic with years that begin in March).
fn civil_date(days: u64) -> (u64, u64, u64) {
    let shifted = days + 719_468;
    let era = shifted / 146_097;
    let day_of_era = shifted % 146_097;
    let year_of_era =
        (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = (month_from_march + 2) % 12 + 1;
    let year = era * 400 + year_of_era + u64::from(month <= 2);
    (year, month, day)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates() {
        assert_eq!(utc_compact(0), "19700101T000000Z");
        assert_eq!(utc_compact(951_782_400), "20000229T000000Z");
        assert_eq!(utc_compact(1_795_269_600 + 3_661), "20261121T150101Z");
    }
}
