//! `atvrec`: a telemetry recorder and tyre-force estimator for rugged vehicle PCs.

#![allow(
    clippy::disallowed_methods,
    reason = "the program reads its command line"
)]

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(atvrec_program::run_program(std::env::args_os()))
}
