//! The program from outside: exit codes, messages, files.

#![allow(
    clippy::disallowed_types,
    clippy::disallowed_methods,
    reason = "the tests measure time and read the environment"
)]

mod calibrate;
mod calibrate_second;
mod calibrate_temperature;
mod check_with_log;
mod compat;
mod configuration;
#[cfg(feature = "live")]
mod controllers;
mod cut;
#[cfg(feature = "live")]
mod demo;
mod estimate;
mod export;
#[cfg(feature = "formats")]
mod export_many;
mod files;
mod folder;
mod guide;
mod hostile;
mod identify;
mod identify_imported;
mod import;
mod import_can;
mod import_gnss;
mod import_kinds;
mod init;
mod inputs;
#[cfg(target_os = "linux")]
mod interrupt;
mod left_out;
mod limits;
#[cfg(feature = "live")]
mod live;
#[cfg(target_os = "linux")]
mod losses;
mod other_program;
mod outputs;
mod outside;
mod passenger_car;
mod record;
mod recover;
mod replay;
mod report;
mod score;
mod silence;
mod support;
