//! Writes imported lines as a log.

use std::path::Path;

use engine::Config;
use engine::config::Estimator;
use sample::{LogTime, NANOS_PER_SECOND, Payload, STANDARD_GRAVITY_M_S2};

use super::Output;
use super::decode::{Decoded, decode};
use super::plausible::Finding;
use super::run::{Log, TAIL_NS, Written};
use super::truth::TruthPoint;
use crate::exit::{Outcome, UsageError};
use crate::progress::Progress;
use engine::output::{Kind, Target};

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
    /// Rows or lines of data in it.
    pub rows: usize,
    /// Measurements that it makes, if it makes them alone.
    pub measurements: Option<usize>,
    /// Number of the run that the file begins, from zero.
    pub run: usize,
    /// Bytes of the file.
    pub bytes: Vec<u8>,
}

/// Writes the log, or a log for each run, and prints a summary. `pieces` must be in the order of their
/// runs, and of time within a run.
pub fn write(
    config: &Config,
    sources: &[Source<'_>],
    mut pieces: Vec<Piece>,
    truth: &[TruthPoint],
    output: &Output<'_>,
) -> anyhow::Result<Outcome> {
    if pieces.is_empty() {
        anyhow::bail!("no row has data; check the table [time] of the column map and the files");
    }
    let gaps = gaps(&pieces);
    if let (Some(first), false) = (
        gaps.first(),
        output.rows.is_some_and(|rows| rows.split_gaps),
    ) {
        return Err(UsageError(gap_text(sources, &pieces, *first, gaps.len())).into());
    }
    let mut runs = Vec::new();
    for begin in ends(&pieces, &gaps).into_iter().rev() {
        runs.push(pieces.split_off(begin));
    }
    runs.push(pieces);
    runs.reverse();
    let mut decoded = Vec::new();
    for run in &runs {
        decoded.push(decode(config, sources, run)?);
    }
    check_units(
        config,
        &decoded,
        output.rows.is_some_and(|rows| rows.accept_units),
    )?;
    print_summary(sources, &runs, truth);
    let targets = targets(output, runs.len())?;
    for ((run, decoded), target) in runs.into_iter().zip(decoded).zip(targets) {
        let span = run.first().zip(run.last()).map(|(a, b)| (a.time, b.time));
        let within = |point: &&TruthPoint| {
            span.is_some_and(|(first, last)| (first..=last + TAIL_NS).contains(&point.time))
        };
        let truth = truth.iter().filter(within).collect();
        let written = write_run(config, sources, run, truth, &decoded, &target, output)?;
        written.print(config, &target, |estimator| {
            why_nothing(estimator, &decoded)
        });
    }
    Ok(Outcome::Good)
}

/// Compares quantities that depend on each other, before anything is estimated.
fn check_units(config: &Config, decoded: &[Decoded], accept: bool) -> anyhow::Result<()> {
    let vehicle = config
        .estimator
        .as_ref()
        .map(|estimator| &estimator.vehicle);
    let radius_m = vehicle.map(|vehicle| {
        let load_n = 0.25 * vehicle.body.mass_kg * STANDARD_GRAVITY_M_S2;
        let radii = [&vehicle.front, &vehicle.rear].map(|a| a.tyre.rolling_radius_m(load_n));
        0.5 * (radii[0] + radii[1])
    });
    let mut errors = Vec::new();
    for finding in decoded.iter().flat_map(|run| run.drive.findings(radius_m)) {
        match finding {
            Finding::Error(text) if !accept && !errors.contains(&text) => errors.push(text),
            Finding::Error(text) | Finding::Warning(text) => tracing::warn!("{text}"),
        }
    }
    if errors.is_empty() {
        return Ok(());
    }
    Err(UsageError(format!(
        "{}\ncorrect the units in the column map, or give --accept-units to import the values as they are; \
         nothing was written",
        errors.join("\n")
    ))
    .into())
}

/// A time without rows that is too long for one run.
#[derive(Clone, Copy)]
struct Gap {
    /// Index of the first row after the gap.
    after: usize,
}

fn gaps(pieces: &[Piece]) -> Vec<Gap> {
    let pairs = pieces.windows(2).enumerate();
    pairs
        .filter(|(_, pair)| pair[0].run == pair[1].run && pair[1].time - pair[0].time > GAP_MAX_NS)
        .map(|(at, _)| Gap { after: at + 1 })
        .collect()
}

/// Indices of the first pieces of all runs but the first.
fn ends(pieces: &[Piece], gaps: &[Gap]) -> Vec<usize> {
    let pairs = pieces.windows(2).enumerate();
    let begun = pairs.filter(|(_, pair)| pair[0].run != pair[1].run);
    let mut ends: Vec<usize> = begun
        .map(|(at, _)| at + 1)
        .chain(gaps.iter().map(|gap| gap.after))
        .collect();
    ends.sort_unstable();
    ends
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
            "the files have {runs} runs, but the limit is {RUNS_MAX}; correct the times"
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
    decoded: &Decoded,
    target: &Target,
    output: &Output<'_>,
) -> anyhow::Result<Written> {
    let (Some(first), Some(last)) = (pieces.first(), pieces.last()) else {
        return Ok(Written::default());
    };
    let (start, end) = (first.time, last.time + TAIL_NS);
    let names: Vec<&str> = sources.iter().map(|source| source.name).collect();
    let mut log = Log::create(config, &names, start, target, truth)?;
    let ids = log.open(config, &names, "imported")?;
    let mut preambles: Vec<Vec<u8>> = sources.iter().map(|s| s.preamble.clone()).collect();
    let progress = Progress::seconds("import", end.seconds_since(start), output.quiet);
    for piece in pieces {
        output.interrupt.check()?;
        progress.set(piece.time.seconds_since(start));
        let mut bytes = std::mem::take(&mut preambles[piece.source]);
        bytes.extend(piece.bytes);
        log.push_data(ids[piece.source], piece.time, Payload::Bytes(bytes))?;
    }
    progress.finish();
    log.close(&ids, end)?;
    let expected = decoded.counts.iter().sum::<usize>();
    if log.written.measurements != expected {
        anyhow::bail!(
            "{}: {expected} measurements were read, but {} are in the log; the log was not written",
            target.path().display(),
            log.written.measurements
        );
    }
    log.finish()
}

/// Why nothing was estimated.
fn why_nothing(estimator: &Estimator, decoded: &Decoded) -> String {
    let lacks = decoded.drive.lacks();
    if estimator.vehicle.front.wishbone.is_some() {
        "its linkages need strain, strut lengths and an inertial unit with all axes, or GNSS velocity \
         and attitude"
            .to_owned()
    } else if lacks.is_empty() {
        "speed and steer angle do not occur within 0.25 s of each other".to_owned()
    } else {
        format!("the single-track model lacks {}", lacks.join(" and "))
    }
}

fn print_summary(sources: &[Source<'_>], runs: &[Vec<Piece>], truth: &[TruthPoint]) {
    for (source, name) in sources.iter().map(|source| source.name).enumerate() {
        let (mut steps, mut rows, mut driven_ns) = (Vec::new(), 0, 0);
        for run in runs {
            let pieces: Vec<&Piece> = run.iter().filter(|piece| piece.source == source).collect();
            rows += pieces.iter().map(|piece| piece.rows).sum::<usize>();
            let run_steps = pieces
                .windows(2)
                .map(|pair| pair[1].time.0 - pair[0].time.0);
            let begin = steps.len();
            steps.extend(run_steps);
            driven_ns += steps[begin..].iter().sum::<u64>();
        }
        if rows == 0 {
            println!("{name}: no rows");
            continue;
        }
        steps.sort_unstable();
        let usual = steps.get(steps.len() / 2).copied().unwrap_or(0);
        let gaps = steps
            .iter()
            .filter(|step| **step > GAP_FACTOR * usual.max(1));
        let rate_hz = if usual > 0 { 1e9 / usual as f64 } else { 0.0 };
        println!(
            "{name}: {rows} rows in {:.2} s, {rate_hz:.4} Hz, {} gaps, longest interval {:.3} s",
            driven_ns as f64 * 1e-9,
            gaps.count(),
            steps.last().copied().unwrap_or(0) as f64 * 1e-9,
        );
    }
    if !truth.is_empty() {
        println!("truth: {} rows of the reference", truth.len());
    }
}
