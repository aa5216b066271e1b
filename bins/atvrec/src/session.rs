//! Session of a recording on this machine.

use std::fs;

use engine::Config;
use engine::session::{build_time, started_at, utc_compact};
use sample::LogTime;
use store::{ClockState, Session};

/// Session of the run `run_number` of a log folder; `clock` is the state of the clock.
pub fn live(config: &Config, started: LogTime, run_number: u64, clock: ClockState) -> Session {
    let seconds = started.0 / 1_000_000_000;
    Session {
        run_number: Some(run_number),
        clock,
        run_id: format!("{}-{:06x}", utc_compact(seconds), started.0 & 0xFF_FFFF),
        boot_id: read_line("/proc/sys/kernel/random/boot_id"),
        host: read_line("/proc/sys/kernel/hostname"),
        ..started_at(config, started)
    }
}

/// Session of the tap, and what the tap says of the recorder.
pub fn tap(config: &Config, now: LogTime) -> (Session, String) {
    let estimator = config.estimator.as_ref();
    let hello = serde_json::json!({
        "version": env!("CARGO_PKG_VERSION"),
        "vehicle": estimator.map(|estimator| &estimator.vehicle.name),
        "configuration": config.attachments.first().map(|own| String::from_utf8_lossy(&own.data)),
        "static_load_n": estimator.map(|estimator| {
            sample::Wheel::ALL.map(|wheel| estimator.vehicle.static_load_n(wheel))
        }),
    });
    (started_at(config, now), hello.to_string())
}

/// State of the host's clock, which was at `anchor` when the log clock was set from it.
pub fn clock_state(anchor: LogTime) -> ClockState {
    if anchor < build_time() {
        return ClockState::BeforeBuild;
    }
    match acq::clock_is_synchronised() {
        Ok(true) => ClockState::Synchronised,
        Ok(false) => ClockState::Unsynchronised,
        Err(error) => {
            tracing::debug!(%error, "cannot read from the kernel whether the clock is synchronised");
            ClockState::Unknown
        }
    }
}

fn read_line(path: &str) -> String {
    fs::read_to_string(path)
        .unwrap_or_default()
        .trim()
        .to_owned()
}
