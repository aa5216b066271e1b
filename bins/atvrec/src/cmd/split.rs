//! `atvrec split`: a log as several ones.

use std::path::{Path, PathBuf};

use anyhow::Context;
use engine::output::Target;
use engine::{Error, Excerpt};
use sample::LogTime;
use store::Reader;

use super::cut;
use crate::cli::SplitArgs;
use crate::exit::{Outcome, UsageError};
use crate::interrupt::Interrupt;

/// Most logs that a command writes.
const PIECES_MAX: usize = 9_999;

/// Runs the command.
pub fn run(args: &SplitArgs) -> anyhow::Result<Outcome> {
    let reader = Reader::open(&args.logs)?;
    let begins = begins(args, &reader)?;
    let interrupt = Interrupt::listen()?;
    std::fs::create_dir_all(&args.directory)
        .with_context(|| format!("cannot create the directory {}", args.directory.display()))?;
    let stem = args.logs.first().and_then(|log| log.file_stem());
    let stem = stem.unwrap_or_default().to_string_lossy().into_owned();
    let path = |number: usize| args.directory.join(format!("{stem}-{number:04}.mcap"));
    let targets =
        (1..=begins.len()).map(|number| cut::target(&path(number), &args.logs, args.replace.force));
    let targets: Vec<Target> = targets.collect::<Result<_, _>>()?;
    let ends = begins
        .iter()
        .skip(1)
        .map(|next| *next + -1)
        .chain([LogTime(u64::MAX)]);
    let mut written = Written::default();
    for ((from, to), target) in begins.iter().zip(ends).zip(&targets) {
        let excerpt = match Excerpt::new(&reader, *from, to) {
            Err(Error::EmptyStretch { from_s, to_s, .. }) => {
                println!("nothing between {from_s:.1} s and {to_s:.1} s");
                continue;
            }
            other => other?,
        };
        cut::write(excerpt, target, &interrupt, None)?;
        written.0.push(target.path().to_owned());
    }
    cut::tell_missing(&reader);
    written.0.clear();
    Ok(Outcome::Good)
}

/// Logs of this command; removed if it does not reach its end.
#[derive(Default)]
struct Written(Vec<PathBuf>);

impl Drop for Written {
    fn drop(&mut self) {
        for path in &self.0 {
            // The first error is reported, not this one.
            let _: Result<(), _> = std::fs::remove_file(Path::new(path));
        }
    }
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
