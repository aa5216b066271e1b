//! `atvrec recover`.

use std::path::Path;

use engine::missing;
use sample::text::printable;
use store::{RecoverOptions, Recovered, recover_each, recover_with};

use crate::cli::RecoverArgs;
use crate::exit::Outcome;
use crate::messages;

/// Makes logs whole.
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
            messages::failed(&anyhow::anyhow!("{}: {error}", log.display()));
            failed = true;
        }
    };
    for path in &args.paths {
        if path.is_dir() {
            let mut is_empty = true;
            for (log, result) in recover_each(path, options.clone())? {
                is_empty = false;
                report(&log, result);
            }
            if is_empty {
                println!("{}: no unfinished log", path.display());
            }
        } else {
            report(path, recover_with(path, &options));
        }
    }
    Ok(match (failed, lost) {
        (true, _) => Outcome::Failed,
        (false, true) => Outcome::DataLoss,
        (false, false) => Outcome::Good,
    })
}

fn print(recovered: &Recovered) {
    let path = recovered.path.display();
    if recovered.was_whole {
        println!("{path}: whole, nothing to do");
        return;
    }
    if recovered.was_empty {
        println!("{path}: removed, no arrival had been recorded in it");
        return;
    }
    println!(
        "{path}: {} messages saved, {} arrivals from the journals",
        recovered.messages, recovered.arrivals_of_journal
    );
    if recovered.messages_of_cut_chunk > 0 {
        println!(
            "  {} of the messages stand in a chunk that was cut: no checksum confirms them",
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
