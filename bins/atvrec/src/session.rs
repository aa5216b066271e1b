//! Session of a recording on this machine.

use std::path::Path;
use std::{fs, io};

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

/// Contents of the file of `atvrec clock-state`.
pub const SYNCHRONISED: &str = "synchronised";
/// See [`SYNCHRONISED`].
pub const UNSYNCHRONISED: &str = "unsynchronised";

/// State of the host's clock, which was at `anchor` when the log clock was set from it; by `file` if the
/// kernel does not say it.
pub fn clock_state(anchor: LogTime, file: Option<&Path>) -> ClockState {
    if anchor < build_time() {
        return ClockState::BeforeBuild;
    }
    state_of(acq::clock_is_synchronised(), file)
}

fn state_of(kernel: io::Result<bool>, file: Option<&Path>) -> ClockState {
    let error = match kernel {
        Ok(true) => return ClockState::Synchronised,
        Ok(false) => return ClockState::Unsynchronised,
        Err(error) => error,
    };
    let state = file.map(|file| read_line(&file.to_string_lossy()));
    match state.as_deref() {
        Some(SYNCHRONISED) => ClockState::Synchronised,
        Some(UNSYNCHRONISED) => ClockState::Unsynchronised,
        _ => {
            tracing::warn!(
                %error,
                file = file.map(|file| file.display().to_string()),
                "neither the kernel nor a file says whether the clock is synchronised"
            );
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_says_what_the_kernel_does_not() {
        let directory = tempfile::tempdir().expect("a directory");
        let file = directory.path().join("state");
        let refused = || Err(io::Error::from(io::ErrorKind::PermissionDenied));
        assert_eq!(state_of(refused(), None), ClockState::Unknown);
        assert_eq!(state_of(refused(), Some(&file)), ClockState::Unknown);
        fs::write(&file, "unsynchronised\n").expect("written");
        assert_eq!(state_of(refused(), Some(&file)), ClockState::Unsynchronised);
        assert_eq!(state_of(Ok(true), Some(&file)), ClockState::Synchronised);
        fs::write(&file, "synchronised\n").expect("written");
        assert_eq!(state_of(refused(), Some(&file)), ClockState::Synchronised);
        assert_eq!(state_of(Ok(false), Some(&file)), ClockState::Unsynchronised);
    }
}
