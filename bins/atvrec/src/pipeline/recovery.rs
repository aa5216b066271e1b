//! Recovery of unfinished logs in the background, on a thread with idle priority.
//!
//! The process does not wait for the thread at its end. An interrupted recovery leaves the original
//! unchanged, and the next start continues.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::thread;

use store::{Error, Reader, RecoverOptions, Recovered, Summary};

use crate::folder::{LogName, Protected, RunName};

/// Starts the thread for `directory`. Runs in `protected` are not renamed.
pub fn start(directory: PathBuf, protected: Protected) {
    let run = move || {
        if let Err(error) = acq::run_at_idle_priority() {
            tracing::debug!(%error, "the recovery runs at normal priority");
        }
        recover(&directory);
        if let Err(error) = name_by_utc(&directory, &protected) {
            tracing::warn!(
                %error,
                "cannot rename logs whose names contain a wrong date; the next start tries again"
            );
        }
    };
    let started = thread::Builder::new()
        .name("recovery".to_owned())
        .spawn(run);
    if let Err(error) = started {
        tracing::error!(
            %error,
            "cannot start the recovery of unfinished logs; run `atvrec recover`, or start again"
        );
    }
}

fn recover(directory: &Path) {
    let logs = match store::recover_each(directory, RecoverOptions::default()) {
        Ok(logs) => logs,
        Err(error) => {
            tracing::error!(
                directory = %directory.display(),
                %error,
                "cannot list the unfinished logs; run `atvrec recover` on the directory"
            );
            return;
        }
    };
    for (path, result) in logs {
        match result {
            Ok(recovered) => report(&path, &recovered),
            Err(error @ Error::SetAside { .. }) => tracing::warn!(
                log = %path.display(),
                %error,
                "cannot recover an unfinished log; it was renamed and is not tried again"
            ),
            Err(error) => tracing::error!(
                log = %path.display(),
                %error,
                "cannot recover an unfinished log"
            ),
        }
    }
}

fn report(path: &Path, recovered: &Recovered) {
    if recovered.was_empty {
        let log = path.display();
        tracing::info!(%log, "removed an empty unfinished log (no messages)");
        return;
    }
    let log = recovered.path.display();
    tracing::warn!(%log, messages = recovered.messages, "recovered an unfinished log");
    if let (Some(lost), Some(original)) = (&recovered.loss, &recovered.original) {
        tracing::error!(
            %log,
            %lost,
            original = %original.display(),
            "a part of the log is lost; the damaged original is kept"
        );
    }
}

/// Completes interrupted renames, and renames runs that were killed by the date of a receiver.
fn name_by_utc(directory: &Path, protected: &Protected) -> anyhow::Result<()> {
    store::finish_renames(directory)?;
    let mut runs: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for entry in std::fs::read_dir(directory)? {
        let entry = entry?;
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let Some(parsed) = LogName::parse(&name) else {
            continue;
        };
        // A name without a run number was given by a person or by an older version.
        let stays = parsed.run.is_none_or(|run| protected.contains(run));
        if !stays && name.ends_with(".mcap") && entry.file_type()?.is_file() {
            runs.entry(parsed.stem.to_owned())
                .or_default()
                .push(entry.path());
        }
    }
    for (stem, mut parts) in runs {
        parts.sort();
        rename_run(directory, &stem, &parts)?;
    }
    Ok(())
}

fn rename_run(directory: &Path, stem: &str, parts: &[PathBuf]) -> anyhow::Result<()> {
    for path in parts.iter().rev() {
        let file = path.file_name().unwrap_or_default().to_string_lossy();
        let (Some(parsed), Some(summary)) = (LogName::parse(&file), Summary::read(path)?) else {
            continue;
        };
        let Some(number) = parsed.run.filter(|_| summary.utc_offsets > 0) else {
            continue;
        };
        let offset = match summary.utc_offset {
            Some(offset) => Some(offset),
            None => Reader::open([path])?.utc_offset()?,
        };
        let name = RunName {
            directory: directory.to_owned(),
            name: parsed.name.to_owned(),
            number,
            started: summary.session.started,
            clock: summary.session.clock,
        };
        if name.stem() == stem {
            name.rename(offset)?;
        }
        break;
    }
    Ok(())
}
