//! `atvrec split`: a log as several ones.

use std::path::PathBuf;

use engine::output::Folder;
use engine::{Error, Excerpt};
use sample::LogTime;
use store::Reader;

use super::cut;
use crate::cli::SplitArgs;
use crate::exit::{Outcome, UsageError};
use crate::interrupt::Interrupt;

/// Most logs that a command writes.
const PIECES_MAX: usize = 9_999;

/// Runs the command. The pieces appear when all of them are complete.
pub fn run(args: &SplitArgs) -> anyhow::Result<Outcome> {
    let reader = Reader::open(&args.logs)?;
    let begins = begins(args, &reader)?;
    let interrupt = Interrupt::listen()?;
    let folder = Folder::open(&args.directory, |_| true)?;
    let stem = args.logs.first().and_then(|log| log.file_stem());
    let stem = stem.unwrap_or_default().to_string_lossy().into_owned();
    let name = |number: usize| PathBuf::from(format!("{stem}-{number:04}.mcap"));
    let names: Vec<PathBuf> = (1..=begins.len()).map(name).collect();
    for name in &names {
        cut::target(&args.directory.join(name), &args.logs, args.replace.force)?;
    }
    let ends = begins
        .iter()
        .skip(1)
        .map(|next| *next + -1)
        .chain([LogTime(u64::MAX)]);
    let mut written = Vec::new();
    for ((from, to), name) in begins.iter().zip(ends).zip(&names) {
        let excerpt = match Excerpt::new(&reader, *from, to) {
            Err(Error::EmptyStretch { from_s, to_s, .. }) => {
                println!("nothing between {from_s:.1} s and {to_s:.1} s");
                continue;
            }
            other => other?,
        };
        let target = cut::target(&folder.partial().join(name), &args.logs, false)?;
        written.push((name, cut::write(excerpt, &target, &interrupt, None)?));
    }
    for (name, copied) in written {
        let path = args.directory.join(name);
        let replaced = path.symlink_metadata().is_ok() && args.replace.force;
        folder.publish(name, name, replaced.then_some(name.as_path()))?;
        cut::print(&path, &copied);
    }
    cut::tell_missing(&reader);
    Ok(Outcome::Good)
}

/// Where the pieces begin.
fn begins(args: &SplitArgs, reader: &Reader) -> anyhow::Result<Vec<LogTime>> {
    let (first, last) = reader.info().span.unwrap_or_default();
    let mut begins = vec![first];
    match args.every_s {
        Some(every_s) => {
            let pieces = (last.seconds_since(first) / every_s).ceil();
            if pieces > PIECES_MAX as f64 {
                return Err(UsageError(format!(
                    "--every {every_s} s gives {pieces} logs, at most {PIECES_MAX} are written; use a larger value"
                ))
                .into());
            }
            let next = (1..pieces as u32).map(|k| first.offset_seconds(f64::from(k) * every_s));
            begins.extend(next);
        }
        None => {
            let marks = report::marks(reader)?;
            if marks.is_empty() {
                return Err(UsageError(
                    "the log has no mark; split it with --every SECONDS, or cut it with `atvrec cut --from --to`"
                        .to_owned(),
                )
                .into());
            }
            begins.extend(marks.into_iter().map(|(time, _)| time));
            begins.sort();
            begins.dedup();
        }
    }
    Ok(begins)
}
