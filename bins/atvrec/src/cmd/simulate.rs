//! `atvrec simulate`: the virtual vehicle's bytes straight into a log, as fast as they can be made.

use std::path::Path;

use sample::{Arrival, LogTime, Notice, Payload, SourceId};
use sim::{Output, Port};
use store::{Record, Writer};

use crate::cli::SimulateArgs;
use crate::cmd::findings::write_whole;
use crate::config::Config;
use crate::engine::Engine;
use crate::exit::Outcome;
use crate::progress::Progress;
use crate::rig::{Ports, Rig};
use crate::session;

/// Interval of ticks, as the recorder has it, s.
const TICK_S: f64 = 0.1;
/// Interval of the truth, s.
const TRUTH_S: f64 = 0.01;

/// Drives and writes.
pub fn run(args: &SimulateArgs, quiet: bool) -> anyhow::Result<Outcome> {
    let mut rig = Rig::new(&args.drive)?;
    let ports = Ports {
        directory: Path::new("virtual"),
        can: None,
    };
    let text = rig.configuration(&ports);
    let config = match &args.config {
        Some(path) => Config::load(path)?,
        None => Config::from_text(&text, Path::new("."))?,
    };
    let run_id = format!("simulate-{}-{}", rig.drive, args.drive.seed);
    let session = session::simulated(&config, &run_id, rig.start());
    let mut log = Log {
        engine: Engine::new(&config)?,
        writer: Writer::create(&args.output, session, config.storage.options.clone(), 0)?,
        sequence: 0,
        records: Vec::new(),
    };
    if let Some(path) = &args.true_calibration {
        write_whole(path, &rig.true_calibration.to_toml()?)?;
    }
    let progress = Progress::seconds("simulate", rig.duration_s(), quiet);
    drive(&mut rig, &config, &mut log, &progress)?;
    let finished = log.writer.finish()?;
    progress.finish();
    println!(
        "{}: {:.1} s of {}, {} arrivals, {} decoded messages",
        args.output.display(),
        rig.duration_s(),
        rig.drive,
        log.sequence,
        finished.counters.messages,
    );
    Ok(Outcome::Good)
}

/// The log being written and the engine that fills it.
struct Log {
    engine: Engine,
    writer: Writer,
    sequence: u64,
    records: Vec<Record>,
}

impl Log {
    fn push(&mut self, source: SourceId, time: LogTime, payload: Payload) -> anyhow::Result<()> {
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
}

fn drive(rig: &mut Rig, config: &Config, log: &mut Log, progress: &Progress) -> anyhow::Result<()> {
    let start = rig.start();
    let source_of = |port: Port| {
        config
            .sources
            .iter()
            .find(|source| source.spec.name == port.name())
            .map(|source| source.spec.id)
    };
    for source in &config.sources {
        let opened = Notice::Opened("virtual vehicle".to_owned());
        log.push(source.spec.id, start, Payload::Notice(opened))?;
    }
    let (mut ticks, mut truths, mut noted) = (0_u64, 0_u64, 0);
    let duration_s = rig.duration_s();
    while let Some(emission) = rig.vehicle.next() {
        if emission.time_s > duration_s {
            break;
        }
        while truths as f64 * TRUTH_S <= emission.time_s {
            let truth = rig.truth(truths as f64 * TRUTH_S);
            log.writer.record(&truth);
            truths += 1;
        }
        while ticks as f64 * TICK_S <= emission.time_s {
            let time = start.offset_seconds(ticks as f64 * TICK_S);
            log.push(SourceId::HOST, time, Payload::Tick)?;
            ticks += 1;
            progress.set(ticks as f64 * TICK_S);
        }
        let marks = rig.vehicle.motion().marks();
        while let Some((time_s, text)) = marks.get(noted).filter(|m| m.0 <= emission.time_s) {
            let mark = Payload::Notice(Notice::Mark(text.clone()));
            log.push(SourceId::HOST, start.offset_seconds(*time_s), mark)?;
            noted += 1;
        }
        let Some(source) = source_of(emission.port) else {
            continue;
        };
        let payload = match emission.output {
            Output::Bytes(bytes) => Payload::Bytes(bytes),
            Output::Can(frame) => Payload::Can(vec![frame]),
        };
        log.push(source, start.offset_seconds(emission.time_s), payload)?;
    }
    Ok(())
}
