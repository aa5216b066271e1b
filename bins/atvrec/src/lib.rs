//! The program `atvrec` as a function: the binary and the command of the Python package call it.

#![allow(
    clippy::disallowed_types,
    reason = "the live pipeline and the progress display use the clock"
)]

#[macro_use]
mod output;

mod cli;
mod cmd;
mod control;
mod devices;
mod exit;
mod folder;
mod interrupt;
mod listening;
mod messages;
mod output_can;
mod pipeline;
mod progress;
mod retention;
mod session;
mod status;
mod tap;
mod values;

use std::ffi::OsString;

use clap::Parser;

use cli::{Cli, Command};
use control::Request;
use exit::Outcome;

/// Runs the program with its arguments, the first of which is its name, and gives its exit code. Wrong
/// arguments end the process with a message and exit code 2.
pub fn run_program(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let cli = Cli::parse_from(arguments);
    // `init` prints the state of each device itself, and opens each one several times.
    let is_init = matches!(cli.command, Command::Init(_));
    messages::start(cli.verbose, cli.quiet || (is_init && cli.verbose == 0));
    let result = run(cli);
    messages::finish();
    match result {
        Ok(outcome) => outcome.code(),
        Err(error) => {
            messages::failed(&error);
            exit::code_of(&error)
        }
    }
}

fn run(cli: Cli) -> anyhow::Result<Outcome> {
    store::set_max_chunk(cli.max_chunk << 20);
    let quiet = cli.quiet;
    match cli.command {
        Command::Init(args) => cmd::init::run(&args),
        Command::Record(args) => cmd::record::run(&args, quiet),
        Command::Replay(args) => cmd::replay::run(&args, quiet),
        Command::Report(args) => cmd::report::run(&args, quiet),
        Command::Events(args) => cmd::events::run(&args),
        Command::Cut(args) => cmd::cut::run(&args, quiet),
        Command::Merge(args) => cmd::merge::run(&args, quiet),
        Command::Split(args) => cmd::split::run(&args),
        Command::Score(args) => cmd::score::run(&args, quiet),
        Command::Demo(args) => cmd::demo::run(&args, quiet),
        Command::Virtual(args) => cmd::virtual_::run(&args),
        Command::Simulate(args) => cmd::simulate::run(&args, quiet),
        Command::Export(args) => cmd::export::run(&args, quiet),
        Command::Info(args) => cmd::info::run(&args),
        Command::Check(args) => cmd::check::run(&args),
        Command::Calibrate(command) => cmd::calibrate::run(&command),
        Command::Recover(args) => cmd::recover::run(&args),
        Command::Identify(command) => cmd::identify::run(&command),
        Command::Mark(args) => cmd::control::mark(&args),
        Command::Status(args) => cmd::control::status(&args),
        #[cfg(feature = "live")]
        Command::Live(args) => cmd::live::run(&args),
        #[cfg(feature = "live")]
        Command::Top(args) => cmd::top::run(&args),
        Command::Start(args) => cmd::control::command(&args, &Request::Start),
        Command::Stop(args) => cmd::control::command(&args, &Request::Stop),
        Command::Reload(args) => cmd::control::command(&args, &Request::Reload),
        Command::Vehicle(command) => cmd::files::vehicle(&command),
        Command::Sensors(command) => cmd::files::sensors(&command),
        Command::Link(args) => cmd::link::run(&args),
        Command::ClockState(args) => cmd::clock_state::run(&args),
        Command::Import(command) => cmd::import::run(&command, quiet),
        Command::Completions(args) => cmd::completions::run(&args),
        Command::Man(args) => cmd::man::run(&args),
    }
}
