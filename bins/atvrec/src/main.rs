//! `atvrec`: a telemetry recorder and tyre-force estimator for rugged vehicle PCs.

mod cli;
mod cmd;
mod config;
mod control;
mod devices;
mod engine;
mod exit;
mod missing;
mod pipeline;
mod progress;
mod read_ahead;
mod retention;
mod rig;
mod session;
mod verify;

use std::io::IsTerminal;
use std::process::ExitCode;

use clap::Parser;

use cli::{Cli, Command, ImportCommand};
use exit::Outcome;

fn main() -> ExitCode {
    let cli = Cli::parse();
    start_messages(cli.verbose, cli.quiet);
    match run(cli) {
        Ok(outcome) => outcome.into(),
        Err(error) => {
            eprintln!("error: {error:#}");
            exit::code_of(&error)
        }
    }
}

fn run(cli: Cli) -> anyhow::Result<Outcome> {
    let quiet = cli.quiet;
    match cli.command {
        Command::Record(args) => cmd::record::run(&args),
        Command::Replay(args) => cmd::replay::run(&args, quiet),
        Command::Report(args) => cmd::report::run(&args),
        Command::Score(args) => cmd::score::run(&args),
        Command::Demo(args) => cmd::demo::run(&args, quiet),
        Command::Virtual(args) => cmd::virtual_::run(&args),
        Command::Simulate(args) => cmd::simulate::run(&args, quiet),
        Command::Export(args) => cmd::export::run(&args),
        Command::Info(args) => cmd::info::run(&args),
        Command::Check(args) => cmd::check::run(&args),
        Command::Recover(args) => cmd::recover::run(&args),
        Command::Mark(args) => cmd::control::mark(&args),
        Command::Status(args) => cmd::control::status(&args),
        Command::Import(ImportCommand::Vehicle(args)) => cmd::import::run(&args),
        Command::Completions(args) => cmd::completions::run(&args),
    }
}

/// The program's own messages go to standard error; `ATVREC_LOG` filters them finer.
fn start_messages(verbose: u8, quiet: bool) {
    use tracing_subscriber::EnvFilter;
    let level = match (quiet, verbose) {
        (true, _) => "error",
        (false, 0) => "info",
        (false, 1) => "debug",
        (false, _) => "trace",
    };
    let filter = EnvFilter::try_from_env("ATVREC_LOG").unwrap_or_else(|_| EnvFilter::new(level));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .with_target(false)
        .compact()
        .init();
}
