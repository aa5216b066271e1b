//! Session of a recording on this machine.

use std::fs;

use engine::Config;
use engine::session::{Program, started_at, utc_compact};
use sample::LogTime;
use store::{ClockState, Session};

/// This program.
pub const PROGRAM: Program = Program {
    version: env!("CARGO_PKG_VERSION"),
    git_hash: env!("ATVREC_GIT_HASH"),
};

/// Session of the run `run_number` of a log folder; `clock` is the state of the clock.
pub fn live(config: &Config, started: LogTime, run_number: u64, clock: ClockState) -> Session {
    let seconds = started.0 / 1_000_000_000;
    Session {
        run_number: Some(run_number),
        clock,
        run_id: format!("{}-{:06x}", utc_compact(seconds), started.0 & 0xFF_FFFF),
        boot_id: read_line("/proc/sys/kernel/random/boot_id"),
        host: read_line("/proc/sys/kernel/hostname"),
        ..started_at(config, PROGRAM, started)
    }
}

/// Date of the source of this program: an earlier clock is wrong.
pub fn build_time() -> LogTime {
    let seconds: u64 = env!("ATVREC_BUILD_UNIX_S").parse().unwrap_or(0);
    LogTime(seconds * 1_000_000_000)
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
