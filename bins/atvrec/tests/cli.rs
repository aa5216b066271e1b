//! The program from outside: exit codes, messages, files.

#![allow(
    clippy::disallowed_types,
    clippy::disallowed_methods,
    reason = "the tests measure time and read the environment"
)]

#[path = "suite/calibrate.rs"]
mod calibrate;
#[path = "suite/compat.rs"]
mod compat;
#[path = "suite/configuration.rs"]
mod configuration;
#[path = "suite/estimate.rs"]
mod estimate;
#[path = "suite/export.rs"]
mod export;
#[path = "suite/folder.rs"]
mod folder;
#[path = "suite/hostile.rs"]
mod hostile;
#[path = "suite/identify.rs"]
mod identify;
#[path = "suite/import.rs"]
mod import;
#[cfg(target_os = "linux")]
#[path = "suite/losses.rs"]
mod losses;
#[path = "suite/outputs.rs"]
mod outputs;
#[path = "suite/outside.rs"]
mod outside;
#[path = "suite/passenger_car.rs"]
mod passenger_car;
#[path = "suite/record.rs"]
mod record;
#[path = "suite/recover.rs"]
mod recover;
#[path = "suite/replay.rs"]
mod replay;
#[path = "suite/report.rs"]
mod report;
#[path = "suite/score.rs"]
mod score;
#[path = "suite/silence.rs"]
mod silence;
#[path = "suite/support.rs"]
mod support;
