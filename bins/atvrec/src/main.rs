//! `atvrec`: a telemetry recorder and tyre-force estimator for rugged vehicle PCs.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(atvrec_program::run_program(std::env::args_os()))
}
