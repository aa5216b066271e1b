//! `atvrec recover`.

use std::path::{Path, PathBuf};

use store::{Recovered, recover, recover_directory};

use crate::cli::RecoverArgs;
use crate::exit::Outcome;

/// Makes logs whole.
pub fn run(args: &RecoverArgs) -> anyhow::Result<Outcome> {
    let mut outcome = Outcome::Good;
    for path in &args.paths {
        for (log, result) in of_path(path)? {
            match result {
                Ok(recovered) => tell(&recovered),
                Err(error) => {
                    eprintln!("error: {}: {error}", log.display());
                    outcome = Outcome::Failed;
                }
            }
        }
    }
    Ok(outcome)
}

fn of_path(path: &Path) -> anyhow::Result<Vec<(PathBuf, store::Result<Recovered>)>> {
    if path.is_dir() {
        let found = recover_directory(path)?;
        if found.is_empty() {
            println!("{}: no unfinished log", path.display());
        }
        return Ok(found);
    }
    Ok(vec![(path.to_owned(), recover(path))])
}

fn tell(recovered: &Recovered) {
    let path = recovered.path.display();
    if recovered.was_whole {
        println!("{path}: whole, nothing to do");
        return;
    }
    if recovered.was_empty {
        println!("{path}: removed, nothing had been recorded in it yet");
        return;
    }
    println!(
        "{path}: {} messages saved, {} of them from a chunk that was cut",
        recovered.messages, recovered.messages_of_cut_chunk
    );
    for missing in &recovered.missing {
        println!("  {missing}");
    }
}
