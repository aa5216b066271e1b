//! Writes timed lines as a log.

use std::path::Path;

use sample::{Arrival, LogTime, NANOS_PER_SECOND, Notice, Payload, SourceId};
use store::{Record, Writer};

use super::truth::TruthPoint;
use crate::config::Config;
use crate::engine::Engine;
use crate::exit::Outcome;
use crate::session;

/// Interval of ticks, as the recorder has it, ns.
const TICK_NS: i64 = NANOS_PER_SECOND / 10;
/// Time runs on for this long behind the last line, so that its estimate comes out, ns.
const TAIL_NS: i64 = NANOS_PER_SECOND / 20;
/// An interval this many times the usual one is a gap.
const GAP_FACTOR: u64 = 5;

/// Bytes of one source and when they came.
pub struct Piece {
    /// Position of the source among the imported ones.
    pub source: usize,
    /// When.
    pub time: LogTime,
    /// The bytes, as they stand in the file.
    pub bytes: Vec<u8>,
}

/// Writes the log and tells what is in it. `pieces` stand by rising time.
pub fn write(
    config: &Config,
    names: &[String],
    pieces: Vec<Piece>,
    truth: &[TruthPoint],
    output: &Path,
) -> anyhow::Result<Outcome> {
    let Some(start) = pieces.first().map(|piece| piece.time) else {
        anyhow::bail!("no row has data; look at the column map's time and at the files");
    };
    tell(names, &pieces, truth);
    let ids: Vec<SourceId> = names
        .iter()
        .filter_map(|name| config.sources.iter().find(|s| s.spec.name == *name))
        .map(|source| source.spec.id)
        .collect();
    let run_id = format!("import-{}-{}", names.join("-"), start.0);
    let session = session::simulated(config, &run_id, start);
    let mut log = Log {
        engine: Engine::new(config)?,
        writer: Writer::create(output, session, config.storage.options.clone(), 0)?,
        truth: truth.iter().peekable(),
        sequence: 0,
        next_tick: start,
        records: Vec::new(),
    };
    for id in &ids {
        log.push(
            *id,
            start,
            Payload::Notice(Notice::Opened("imported".to_owned())),
        )?;
    }
    let end = pieces.last().map_or(start, |piece| piece.time) + TAIL_NS;
    for piece in pieces {
        log.tick_until(piece.time)?;
        log.push(ids[piece.source], piece.time, Payload::Bytes(piece.bytes))?;
    }
    log.tick_until(end)?;
    log.push(SourceId::HOST, end, Payload::Tick)?;
    let finished = log.finish()?;
    println!("{}: {finished} decoded messages", output.display());
    Ok(Outcome::Good)
}

/// The log being written and the engine that fills it.
struct Log<'t> {
    engine: Engine,
    writer: Writer,
    truth: std::iter::Peekable<std::slice::Iter<'t, TruthPoint>>,
    sequence: u64,
    next_tick: LogTime,
    records: Vec<Record>,
}

impl Log<'_> {
    fn tick_until(&mut self, time: LogTime) -> anyhow::Result<()> {
        while self.next_tick <= time {
            let tick = self.next_tick;
            self.push(SourceId::HOST, tick, Payload::Tick)?;
            self.next_tick = tick + TICK_NS;
        }
        Ok(())
    }

    fn push(&mut self, source: SourceId, time: LogTime, payload: Payload) -> anyhow::Result<()> {
        while let Some(point) = self.truth.next_if(|point| point.time <= time) {
            self.writer.record(&point.record());
        }
        let arrival = Arrival {
            sequence: self.sequence,
            source,
            log_time: time,
            realtime_ns: i64::try_from(time.0).unwrap_or(i64::MAX),
            payload,
        };
        self.sequence += 1;
        self.records.clear();
        self.engine.push(&arrival, &mut self.records);
        self.writer.push(arrival)?;
        for record in &self.records {
            self.writer.record(record);
        }
        Ok(())
    }

    fn finish(self) -> anyhow::Result<u64> {
        Ok(self.writer.finish()?.counters.messages)
    }
}

fn tell(names: &[String], pieces: &[Piece], truth: &[TruthPoint]) {
    for (source, name) in names.iter().enumerate() {
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
            "{name}: {} rows in {:.2} s, {rate_hz:.4} Hz, {} gaps, the longest {:.3} s",
            times.len(),
            (last - first) as f64 * 1e-9,
            gaps.count(),
            steps.last().copied().unwrap_or(0) as f64 * 1e-9,
        );
    }
    if !truth.is_empty() {
        println!("truth: {} instants of a reference", truth.len());
    }
}
