//! `atvrec clock-state`: whether the computer's clock is synchronised, for a recorder whose system call
//! filter does not let it ask.

use std::fs;
use std::io::ErrorKind;

use anyhow::Context;

use crate::cli::ClockStateArgs;
use crate::exit::Outcome;
use crate::session::{SYNCHRONISED, UNSYNCHRONISED};

/// Runs the command.
pub fn run(args: &ClockStateArgs) -> anyhow::Result<Outcome> {
    let file = args.file.display();
    // If the kernel does not answer, no old answer stays.
    match fs::remove_file(&args.file) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            return Err(error).with_context(|| format!("cannot remove the old {file}"));
        }
        _ => {}
    }
    let is_synchronised = acq::clock_is_synchronised()
        .context("cannot read from the kernel whether the clock is synchronised")?;
    let state = if is_synchronised {
        SYNCHRONISED
    } else {
        UNSYNCHRONISED
    };
    fs::write(&args.file, format!("{state}\n")).with_context(|| format!("cannot write {file}"))?;
    Ok(Outcome::Good)
}
