//! `atvrec simulate`: the virtual vehicle's bytes straight into a log, as fast as they can be made.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Context;
use engine::Config;
use engine::Engine;
use engine::{Ports, Rig};
use sample::{Arrival, LogTime, NANOS_PER_SECOND, Notice, Payload, SourceId};
use sim::{Output, Port};
use store::{ClockState, Options, Record, Recorder, Session};

use crate::cli::SimulateArgs;
use crate::exit::Outcome;
use crate::folder::{self, Protected, RunName};
use crate::output::target::{Kind, LogFile, Target};
use crate::progress::Progress;
use crate::retention::{self, Limits};
use crate::session::PROGRAM;

/// Interval of ticks, as the recorder has it, s.
const TICK_S: f64 = 0.1;
/// Interval of the truth, s.
const TRUTH_S: f64 = 0.01;

/// Drives and writes.
pub fn run(args: &SimulateArgs, quiet: bool) -> anyhow::Result<Outcome> {
    let (output, calibration) = outputs(args)?;
    let mut rig = Rig::new(&args.drive.as_drive()?)?;
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
    let session = engine::session::simulated(&config, PROGRAM, &run_id, rig.start());
    let mut log = Log {
        engine: Engine::new(&config)?,
        sink: Sink::open(output.as_ref(), &args.output, &config, session)?,
        sequence: 0,
        records: Vec::new(),
    };
    if let Some(target) = calibration {
        target.write(&rig.true_calibration.to_toml()?)?;
    }
    let progress = Progress::seconds("simulate", rig.duration_s(), quiet);
    drive(&mut rig, &config, &mut log, &progress)?;
    let messages = log.sink.finish()?;
    progress.finish();
    println!(
        "{}: {:.1} s of {}, {} arrivals, {messages} decoded messages",
        args.output.display(),
        rig.duration_s(),
        rig.drive,
        log.sequence,
    );
    Ok(Outcome::Good)
}

/// The log, unless the output is a directory, and the file of the true calibration.
fn outputs(args: &SimulateArgs) -> anyhow::Result<(Option<Target>, Option<Target>)> {
    let drive = &args.drive;
    let named = [&drive.vehicle, &drive.sensors].map(Path::new);
    let files = [&args.config, &drive.truth, &drive.options];
    let inputs = || {
        let files = files.into_iter().flatten();
        files.map(|path| &**path).chain(named)
    };
    let force = args.replace.force;
    let calibration = args.true_calibration.as_ref();
    let calibration = calibration.map(|path| Target::new(path, Kind::Toml, force, inputs()));
    let is_log = !args.output.is_dir();
    let log = is_log.then(|| Target::new(&args.output, Kind::Log, force, inputs()));
    Ok((log.transpose()?, calibration.transpose()?))
}

/// Where a simulation goes.
enum Sink {
    /// One log.
    File(Box<LogFile>),
    /// A directory, as a recording writes it: rotated, and kept within its limits.
    Run(Box<Run>),
}

/// A run of files.
struct Run {
    recorder: Recorder,
    directory: PathBuf,
    limits: Limits,
    /// When the limits are looked at next, on the log clock.
    look_at: LogTime,
}

/// More arrivals and records than this may not wait for the writer: nothing is to be lost because time
/// is fast, and as much memory is to be used as in a recording.
const WAITING_MAX: usize = 2_048;

/// Between two looks at the directory's limits, on the log clock.
const LOOK_NANOS: i64 = 10 * NANOS_PER_SECOND;
/// Wait for a writer that has fallen behind.
const WRITER_PAUSE: Duration = Duration::from_millis(1);

impl Sink {
    fn open(
        log: Option<&Target>,
        directory: &Path,
        config: &Config,
        session: Session,
    ) -> anyhow::Result<Self> {
        let options: Options = config.storage.options.clone();
        if let Some(log) = log {
            return Ok(Self::File(Box::new(log.log(session, options)?)));
        }
        let look_at = session.started;
        let name = RunName {
            directory: directory.to_owned(),
            name: config.storage.name.clone(),
            number: folder::next_run(directory)
                .with_context(|| format!("cannot read {}", directory.display()))?,
            started: session.started,
            clock: ClockState::Unknown,
        };
        let recorder = Recorder::start(directory, &name.stem(), session, options)?;
        Ok(Self::Run(Box::new(Run {
            recorder,
            directory: directory.to_owned(),
            limits: config.storage.limits,
            look_at,
        })))
    }

    fn push(&mut self, arrival: Arrival) -> anyhow::Result<()> {
        match self {
            Self::File(log) => Ok(log.writer().push(arrival)?),
            Self::Run(run) => run.push(arrival),
        }
    }

    fn record(&mut self, record: Record) {
        match self {
            Self::File(log) => log.writer().record(&record),
            Self::Run(run) => {
                run.recorder.record(record);
            }
        }
    }

    /// Closes the files; says how many decoded messages are in them.
    fn finish(self) -> anyhow::Result<u64> {
        match self {
            Self::File(log) => Ok(log.finish()?.counters.messages),
            Self::Run(run) => {
                let summary = run.recorder.finish()?;
                let lost = summary.losses.arrivals + summary.losses.records;
                anyhow::ensure!(
                    lost == 0,
                    "{lost} arrivals and records did not reach the disk: {}",
                    summary.last_failure.unwrap_or_default()
                );
                Ok(summary.files.iter().map(|f| f.counters.messages).sum())
            }
        }
    }
}

impl Run {
    fn push(&mut self, arrival: Arrival) -> anyhow::Result<()> {
        while self.recorder.waiting() > WAITING_MAX {
            std::thread::sleep(WRITER_PAUSE);
        }
        if arrival.log_time >= self.look_at {
            self.look_at = arrival.log_time + LOOK_NANOS;
            retention::enforce(&self.directory, self.limits, &Protected::default())
                .with_context(|| format!("cannot look after {}", self.directory.display()))?;
        }
        self.recorder.push(arrival);
        Ok(())
    }
}

/// The log being written and the engine that fills it.
struct Log {
    engine: Engine,
    sink: Sink,
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
        self.sink.push(arrival)?;
        for record in self.records.drain(..) {
            self.sink.record(record);
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
            log.sink.record(truth);
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
