//! `atvrec merge`: several logs as one.

use std::path::PathBuf;

use engine::{Entry, Excerpt, Merge};
use store::Reader;

use super::cut;
use crate::cli::MergeArgs;
use crate::exit::Outcome;
use crate::interrupt::Interrupt;
use crate::progress::Progress;

/// Runs the command.
pub fn run(args: &MergeArgs, quiet: bool) -> anyhow::Result<Outcome> {
    let target = cut::target(&args.output, &args.logs, args.replace.force)?;
    let readers = runs(&args.logs)?;
    let interrupt = Interrupt::listen()?;
    let span = |reader: &Reader| reader.info().span;
    let spans = readers.iter().filter_map(span);
    let all = spans.reduce(|(first, last), (begin, end)| (first.min(begin), last.max(end)));
    let (first, last) = all.unwrap_or_default();
    let progress = Progress::seconds("merge", last.seconds_since(first), quiet);
    if let [reader] = &readers[..] {
        let excerpt = Excerpt::whole(reader)?;
        let written = cut::write(excerpt, &target, &interrupt, Some(&progress))?;
        progress.finish();
        cut::print(target.path(), &written);
        cut::tell_missing(reader);
        return Ok(Outcome::Good);
    }
    for reader in readers
        .iter()
        .filter(|reader| reader.session().clock.is_implausible())
    {
        tracing::warn!(
            "the clock of run {} was not synchronised: its data may be at a wrong place among those of the other \
             runs",
            reader.session().run_id
        );
    }
    let merge = Merge::new(&readers, args.rename)?;
    let mut log = target.log(merge.session().clone(), merge.log_options().clone())?;
    let sources = merge.session().sources.iter();
    let sources: Vec<String> = sources.map(|source| source.name.clone()).collect();
    let merged = merge.run(|entry| -> anyhow::Result<()> {
        interrupt.check()?;
        if let Entry::Arrival(arrival) = &entry {
            progress.set(arrival.log_time.seconds_since(first));
        }
        Ok(log.push(entry)?)
    })?;
    let finished = log.finish()?;
    progress.finish();
    println!(
        "{}: {} runs, {:.1} s, {} arrivals, {} records, sources {}",
        finished.path.display(),
        readers.len(),
        last.seconds_since(first),
        merged.arrivals,
        merged.records,
        sources.join(", ")
    );
    readers.iter().for_each(cut::tell_missing);
    Ok(Outcome::Good)
}

/// The runs of files, each with its parts.
fn runs(logs: &[PathBuf]) -> anyhow::Result<Vec<Reader>> {
    let mut runs: Vec<(String, Vec<&PathBuf>)> = Vec::new();
    for log in logs {
        let run_id = Reader::open([log])?.session().run_id.clone();
        match runs.iter_mut().find(|(known, _)| *known == run_id) {
            Some((_, files)) => files.push(log),
            None => runs.push((run_id, vec![log])),
        }
    }
    let readers = runs.iter().map(|(_, files)| Reader::open(files));
    Ok(readers.collect::<store::Result<_>>()?)
}
