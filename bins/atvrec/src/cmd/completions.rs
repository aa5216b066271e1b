//! `atvrec completions`: print the completion script of a shell.

use clap::CommandFactory;

use crate::cli::{Cli, CompletionsArgs};
use crate::exit::Outcome;

/// Runs the command.
pub fn run(args: &CompletionsArgs) -> anyhow::Result<Outcome> {
    let mut command = Cli::command();
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, "atvrec", &mut script);
    print!("{}", String::from_utf8_lossy(&script));
    Ok(Outcome::Good)
}
