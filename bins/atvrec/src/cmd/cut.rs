//! `atvrec cut`: write a stretch of a log as a log.

use std::path::{Path, PathBuf};

use engine::output::{Kind, LogFile, Target};
use engine::{Copied, Excerpt, missing};
use sample::text::printable;
use store::Reader;

use crate::cli::CutArgs;
use crate::exit::Outcome;
use crate::interrupt::Interrupt;
use crate::progress::Progress;

/// Runs the command.
pub fn run(args: &CutArgs, quiet: bool) -> anyhow::Result<Outcome> {
    let target = target(&args.output, &args.logs, args.replace.force)?;
    let reader = Reader::open(&args.logs)?;
    let [from, to] = args.stretch.of_log().times(&reader)?;
    let excerpt = Excerpt::new(&reader, from, to)?;
    let interrupt = Interrupt::listen()?;
    let progress = Progress::seconds("cut", to.seconds_since(from), quiet);
    let written = write(excerpt, &target, &interrupt, Some(&progress))?;
    progress.finish();
    print(target.path(), &written);
    tell_missing(&reader);
    Ok(Outcome::Good)
}

/// Prints what is missing in a log that was read.
pub fn tell_missing(reader: &Reader) {
    for line in missing::summary(&reader.info().missing) {
        println!("  {}: {line}", printable(&reader.session().run_id));
    }
}

/// A log to write.
pub fn target(output: &Path, logs: &[PathBuf], force: bool) -> engine::Result<Target> {
    Target::new(output, Kind::Log, force, logs.iter().map(PathBuf::as_path))
}

/// A log that was written.
pub struct Written {
    copied: Copied,
    span_s: f64,
    bytes: u64,
}

/// Writes a stretch.
pub fn write(
    excerpt: Excerpt,
    target: &Target,
    interrupt: &Interrupt,
    progress: Option<&Progress>,
) -> anyhow::Result<Written> {
    let mut log: LogFile = target.log(excerpt.session().clone(), excerpt.log_options().clone())?;
    let mut span = None;
    let copied = excerpt.copy_to(&mut log, |time| -> anyhow::Result<()> {
        interrupt.check()?;
        let (first, last) = span.get_or_insert((time, time));
        *last = time.max(*last);
        if let Some(progress) = progress {
            progress.set(time.seconds_since(*first));
        }
        Ok(())
    })?;
    let bytes = log.finish()?.bytes;
    let span_s = span.map_or(0.0, |(first, last)| last.seconds_since(first));
    Ok(Written {
        copied,
        span_s,
        bytes,
    })
}

/// Prints what a log has.
pub fn print(path: &Path, written: &Written) {
    let copied = &written.copied;
    println!(
        "{}: {:.1} s, {} arrivals, {} decoded and estimated messages, {:.1} MB",
        path.display(),
        written.span_s,
        copied.arrivals,
        copied.records,
        written.bytes as f64 / 1e6
    );
    if copied.foreign > 0 {
        println!(
            "  {} messages of other programs are left out",
            copied.foreign
        );
    }
}
