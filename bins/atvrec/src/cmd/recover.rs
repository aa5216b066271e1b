//! `atvrec recover`: recover logs that were cut short or damaged.

use std::path::Path;

use engine::missing;
use sample::text::printable;
use store::{RecoverOptions, Recovered, recover_each, recover_with};

use crate::cli::RecoverArgs;
use crate::exit::Outcome;
use crate::messages;

/// Runs the command.
pub fn run(args: &RecoverArgs) -> anyhow::Result<Outcome> {
    let options = RecoverOptions {
        unchecked: args.unchecked,
        ..RecoverOptions::default()
    };
    let (mut failed, mut lost) = (false, false);
    let mut report = |log: &Path, result: store::Result<Recovered>| match result {
        Ok(recovered) => {
            lost |= recovered.loss.is_some();
            print(&recovered);
        }
        Err(error) => {
            messages::failed(&with_path(log, &error));
            failed = true;
        }
    };
    for path in &args.paths {
        if !path.is_dir() {
            report(path, recover_with(path, &options));
            continue;
        }
        match recover_each(path, options.clone()) {
            Ok(logs) => {
                let mut is_empty = true;
                for (log, result) in logs {
                    is_empty = false;
                    report(&log, result);
                }
                if is_empty {
                    println!("{}: no unfinished log", path.display());
                }
            }
            Err(error) => report(path, Err(error)),
        }
    }
    Ok(match (failed, lost) {
        (true, _) => Outcome::Failed,
        (false, true) => Outcome::DataLoss,
        (false, false) => Outcome::Good,
    })
}

/// The error with the path of the log, which most errors already contain.
fn with_path(log: &Path, error: &store::Error) -> anyhow::Error {
    let (log, text) = (log.display().to_string(), error.to_string());
    if text.contains(&log) {
        anyhow::anyhow!(text)
    } else {
        anyhow::anyhow!("{log}: {text}")
    }
}

fn print(recovered: &Recovered) {
    let path = recovered.path.display();
    if recovered.was_whole {
        println!("{path}: the log is complete, nothing to recover");
        return;
    }
    if recovered.was_empty {
        println!("{path}: removed the empty log (no arrivals)");
        return;
    }
    println!(
        "{path}: {} messages saved, {} arrivals from the journals",
        recovered.messages, recovered.arrivals_of_journal
    );
    if recovered.messages_of_cut_chunk > 0 {
        println!(
            "  {} of the messages are from a chunk that was cut; no checksum confirms them",
            recovered.messages_of_cut_chunk
        );
    }
    for line in missing::summary(&recovered.missing) {
        println!("  {line}");
    }
    if let Some(loss) = &recovered.loss {
        println!("  lost: {}", printable(&loss.to_string()));
    }
    if let Some(original) = &recovered.original {
        println!("  the damaged original is kept as {}", original.display());
    }
}
