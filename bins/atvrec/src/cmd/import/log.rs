//! Writes imported lines as a log.

use std::path::Path;

use engine::{Config, Entry, Feed, SILENCE_NS};
use sample::{LogTime, NANOS_PER_SECOND, Notice, Payload, SourceId};

use super::Output;
use super::truth::TruthPoint;
use crate::exit::{Outcome, UsageError};
use engine::output::{Kind, LogFile, Target};

/// Interval of ticks, equal to that of the recorder, ns.
const TICK_NS: i64 = NANOS_PER_SECOND / 10;
/// Time that the log continues after the last line, so that the last estimate is computed, ns.
const TAIL_NS: i64 = NANOS_PER_SECOND / 20;
/// Longest time without rows within a run, ns.
const GAP_MAX_NS: i64 = 3600 * NANOS_PER_SECOND;
/// Most runs of an import.
const RUNS_MAX: usize = 1000;
/// Ratio of an interval to the median interval from which it counts as a gap.
const GAP_FACTOR: u64 = 5;

/// A file that is imported.
pub struct Source<'s> {
    /// Name in the log.
    pub name: &'s str,
    /// Path of the file.
    pub path: &'s Path,
    /// Lines before the first row; every log begins with them.
    pub preamble: Vec<u8>,
}

/// Bytes of a source and their time.
pub struct Piece {
    /// Position of the source among the imported ones.
    pub source: usize,
    /// Time of arrival.
    pub time: LogTime,
    /// Number of the line, from one.
    pub line: usize,
    /// Bytes of the file.
    pub bytes: Vec<u8>,
}

/// Writes the log, or a log for each run, and prints a summary. `pieces` must be in the order of time.
pub fn write(
    config: &Config,
    sources: &[Source<'_>],
    pieces: Vec<Piece>,
    truth: &[TruthPoint],
    output: &Output<'_>,
) -> anyhow::Result<Outcome> {
    if pieces.is_empty() {
        anyhow::bail!("no row has data; check the table [time] of the column map and the files");
    }
    let gaps = gaps(&pieces);
    if let (Some(first), false) = (gaps.first(), output.into.split_gaps) {
        return Err(UsageError(gap_text(sources, &pieces, *first, gaps.len())).into());
    }
    print_summary(sources, &pieces, truth);
    let targets = targets(output, gaps.len() + 1)?;
    let mut pieces = pieces.into_iter().peekable();
    let mut truth = truth.iter().peekable();
    let ends = gaps.iter().map(|gap| Some(gap.middle)).chain([None]);
    for (end, target) in ends.zip(targets) {
        let before = |time: LogTime| end.is_none_or(|end| time < end);
        let pieces = std::iter::from_fn(|| pieces.next_if(|piece| before(piece.time))).collect();
        let truth = std::iter::from_fn(|| truth.next_if(|point| before(point.time))).collect();
        write_run(config, sources, pieces, truth, &target)?;
    }
    Ok(Outcome::Good)
}

/// A time without rows that is too long for one run.
#[derive(Clone, Copy)]
struct Gap {
    /// Index of the first row after the gap.
    after: usize,
    middle: LogTime,
}

fn gaps(pieces: &[Piece]) -> Vec<Gap> {
    let pairs = pieces.windows(2).enumerate();
    pairs
        .filter_map(|(at, pair)| {
            let length_ns = pair[1].time - pair[0].time;
            (length_ns > GAP_MAX_NS).then(|| Gap {
                after: at + 1,
                middle: pair[0].time + length_ns / 2,
            })
        })
        .collect()
}

fn gap_text(sources: &[Source<'_>], pieces: &[Piece], gap: Gap, count: usize) -> String {
    let [before, after] = [&pieces[gap.after - 1], &pieces[gap.after]];
    let row = |piece: &Piece| {
        let path = sources[piece.source].path.display();
        format!("{path}:{} (at {} s)", piece.line, piece.time)
    };
    let more = match count {
        1 => String::new(),
        _ => format!(" (the first of {count} such gaps)"),
    };
    format!(
        "the gap between {} and {} is {:.1} h, but the limit is 1 h{more}; correct the times, or \
         write one run for the rows on each side of a gap with --split-gaps",
        row(before),
        row(after),
        after.time.seconds_since(before.time) / 3600.0,
    )
}

/// The log, or those of the runs: `NAME-1.mcap` and so on.
fn targets(output: &Output<'_>, runs: usize) -> anyhow::Result<Vec<Target>> {
    if runs == 1 {
        return Ok(vec![output.log.clone()]);
    }
    if runs > RUNS_MAX {
        return Err(UsageError(format!(
            "gaps of more than 1 h give {runs} runs, but the limit is {RUNS_MAX}; correct the times"
        ))
        .into());
    }
    let path = output.log.path();
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    let dot = if extension.is_empty() { "" } else { "." };
    (1..=runs)
        .map(|number| {
            let path = path.with_file_name(format!("{stem}-{number}{dot}{extension}"));
            let inputs = output.inputs.iter().copied();
            Ok(Target::new(
                &path,
                Kind::Log,
                output.into.replace.force,
                inputs,
            )?)
        })
        .collect()
}

fn write_run(
    config: &Config,
    sources: &[Source<'_>],
    pieces: Vec<Piece>,
    truth: Vec<&TruthPoint>,
    target: &Target,
) -> anyhow::Result<()> {
    let (Some(first), Some(last)) = (pieces.first(), pieces.last()) else {
        return Ok(());
    };
    let (start, end) = (first.time, last.time + TAIL_NS);
    let ids: Vec<SourceId> = sources
        .iter()
        .filter_map(|source| config.sources.iter().find(|s| s.spec.name == source.name))
        .map(|source| source.spec.id)
        .collect();
    let names: Vec<&str> = sources.iter().map(|source| source.name).collect();
    let run_id = format!("import-{}-{}", names.join("-"), start.0);
    let session = engine::session::simulated(config, &run_id, start);
    let mut log = Log {
        feed: Feed::new(config)?,
        file: target.log(session, config.storage.options.clone())?,
        truth: truth.into_iter().peekable(),
        start,
        next_tick: start,
        last_data: start,
    };
    for id in &ids {
        let opened = Payload::Notice(Notice::Opened("imported".to_owned()));
        log.push(*id, start, opened)?;
    }
    let mut preambles: Vec<Vec<u8>> = sources.iter().map(|s| s.preamble.clone()).collect();
    for piece in pieces {
        log.tick_until(piece.time)?;
        let mut bytes = std::mem::take(&mut preambles[piece.source]);
        bytes.extend(piece.bytes);
        log.push(ids[piece.source], piece.time, Payload::Bytes(bytes))?;
        log.last_data = piece.time;
    }
    log.tick_until(end)?;
    log.push(SourceId::HOST, end, Payload::Tick)?;
    let finished = log.finish()?;
    println!("{}: {finished} decoded messages", target.path().display());
    Ok(())
}

/// Log that is being written, and the feed of its engine.
struct Log<'t> {
    feed: Feed,
    file: LogFile,
    truth: std::iter::Peekable<std::vec::IntoIter<&'t TruthPoint>>,
    start: LogTime,
    next_tick: LogTime,
    last_data: LogTime,
}

impl Log<'_> {
    /// Writes ticks until `time`. During silence, in which there are no estimates, there are no ticks,
    /// so that the size of the log depends on the size of the input only.
    fn tick_until(&mut self, time: LogTime) -> anyhow::Result<()> {
        let silent = self.last_data + (SILENCE_NS + TICK_NS);
        while self.next_tick <= time {
            if self.next_tick > silent {
                let ticks = (time - self.start) / TICK_NS;
                self.next_tick = self.start + ticks * TICK_NS;
                if self.next_tick < time {
                    self.next_tick = self.next_tick + TICK_NS;
                }
                return Ok(());
            }
            let tick = self.next_tick;
            self.push(SourceId::HOST, tick, Payload::Tick)?;
            self.next_tick = tick + TICK_NS;
        }
        Ok(())
    }

    fn push(&mut self, source: SourceId, time: LogTime, payload: Payload) -> anyhow::Result<()> {
        while let Some(point) = self.truth.next_if(|point| point.time <= time) {
            self.file.push(Entry::Record(point.record()))?;
        }
        let file = &mut self.file;
        let mut sink = |entry: Entry| file.push(entry);
        Ok(self.feed.push(source, time, payload, &mut sink)?)
    }

    fn finish(self) -> anyhow::Result<u64> {
        Ok(self.file.finish()?.counters.messages)
    }
}

fn print_summary(sources: &[Source<'_>], pieces: &[Piece], truth: &[TruthPoint]) {
    for (source, name) in sources.iter().map(|source| source.name).enumerate() {
        let times: Vec<u64> = pieces
            .iter()
            .filter(|piece| piece.source == source)
            .map(|piece| piece.time.0)
            .collect();
        let mut steps: Vec<u64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let (Some(first), Some(last)) = (times.first(), times.last()) else {
            println!("{name}: no rows");
            continue;
        };
        steps.sort_unstable();
        let usual = steps.get(steps.len() / 2).copied().unwrap_or(0);
        let gaps = steps
            .iter()
            .filter(|step| **step > GAP_FACTOR * usual.max(1));
        let rate_hz = if usual > 0 { 1e9 / usual as f64 } else { 0.0 };
        println!(
            "{name}: {} rows in {:.2} s, {rate_hz:.4} Hz, {} gaps, longest interval {:.3} s",
            times.len(),
            (last - first) as f64 * 1e-9,
            gaps.count(),
            steps.last().copied().unwrap_or(0) as f64 * 1e-9,
        );
    }
    if !truth.is_empty() {
        println!("truth: {} rows of the reference", truth.len());
    }
}
