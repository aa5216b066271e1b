//! `atvrec simulate`: run a virtual vehicle at full speed and write a log.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Context;
use engine::output::{Kind, LogFile, Target};
use engine::{Config, Entry, VirtualDrive, simulate};
use sample::{Arrival, LogTime, NANOS_PER_SECOND};
use store::{ClockState, Options, Recorder, Session};

use crate::cli::SimulateArgs;
use crate::exit::Outcome;
use crate::folder::{self, Protected, RunName};
use crate::progress::Progress;
use crate::retention::{self, Limits};

/// Runs the command.
pub fn run(args: &SimulateArgs, quiet: bool) -> anyhow::Result<Outcome> {
    let (output, calibration) = outputs(args)?;
    let mut simulated = VirtualDrive::new(&args.drive.as_drive()?)?;
    let config = match &args.config {
        Some(path) => Config::load(path)?,
        None => simulated.config()?,
    };
    super::tell_scope(&config);
    let session = simulated.session(&config);
    let mut sink = Sink::open(output.as_ref(), &args.output, &config, session)?;
    if let Some(target) = calibration {
        target.write(&simulated.true_calibration.to_toml()?)?;
    }
    let progress = Progress::seconds("simulate", simulated.duration_s(), quiet);
    let start = simulated.start();
    let arrivals = simulate(&mut simulated, &config, |entry| {
        if let Entry::Arrival(arrival) = &entry {
            progress.set(arrival.log_time.seconds_since(start));
        }
        sink.push(entry)
    })?;
    let messages = sink.finish()?;
    progress.finish();
    println!(
        "{}: {:.1} s of {}, {arrivals} arrivals, {messages} decoded messages",
        args.output.display(),
        simulated.duration_s(),
        simulated.drive,
    );
    Ok(Outcome::Good)
}

/// Log, unless the output is a directory, and file of the true calibration.
fn outputs(args: &SimulateArgs) -> anyhow::Result<(Option<Target>, Option<Target>)> {
    let drive = &args.drive;
    let named = [&drive.vehicle, &drive.sensors].map(Path::new);
    let road = drive.road.iter().map(Path::new);
    let files = [&args.config, &drive.truth, &drive.options];
    let inputs = || {
        let files = files.into_iter().flatten();
        let files = files.map(|path| &**path).chain(named);
        files.chain(road.clone())
    };
    let force = args.replace.force;
    let calibration = args.true_calibration.as_ref();
    let calibration = calibration.map(|path| Target::new(path, Kind::Toml, force, inputs()));
    let is_log = !args.output.is_dir();
    let log = is_log.then(|| Target::new(&args.output, Kind::Log, force, inputs()));
    Ok((log.transpose()?, calibration.transpose()?))
}

/// Output of a simulation.
enum Sink {
    /// One log.
    File(Box<LogFile>),
    /// A directory, with rotation and retention as in a recording.
    Run(Box<Run>),
}

/// A run in a directory.
struct Run {
    recorder: Recorder,
    directory: PathBuf,
    limits: Limits,
    /// Time of the next retention check on the log clock.
    next_check: LogTime,
}

/// Most arrivals and records that wait for the writer. The limit prevents losses at full speed, and
/// limits the memory to that of a recording.
const WAITING_MAX: usize = 2_048;

/// Time between two retention checks on the log clock.
const CHECK_NANOS: i64 = 10 * NANOS_PER_SECOND;
/// Pause while more wait.
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
        let next_check = session.started;
        let name = RunName {
            directory: directory.to_owned(),
            name: config.storage.name.clone(),
            number: folder::next_run(directory)
                .with_context(|| format!("cannot read the directory {}", directory.display()))?,
            started: session.started,
            clock: ClockState::Unknown,
        };
        let recorder = Recorder::start(directory, &name.stem(), session, options)?;
        Ok(Self::Run(Box::new(Run {
            recorder,
            directory: directory.to_owned(),
            limits: config.storage.limits,
            next_check,
        })))
    }

    fn push(&mut self, entry: Entry) -> anyhow::Result<()> {
        match (self, entry) {
            (Self::File(log), entry) => log.push(entry)?,
            (Self::Run(run), Entry::Arrival(arrival)) => run.push(arrival)?,
            (Self::Run(run), Entry::Record(record)) => {
                run.recorder.record(record);
            }
        }
        Ok(())
    }

    /// Closes the files and returns the number of decoded messages in them.
    fn finish(self) -> anyhow::Result<u64> {
        match self {
            Self::File(log) => Ok(log.finish()?.counters.messages),
            Self::Run(run) => {
                let summary = run.recorder.finish()?;
                let lost = summary.losses.arrivals + summary.losses.records;
                anyhow::ensure!(
                    lost == 0,
                    "{lost} arrivals and records were not written: {}",
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
        if arrival.log_time >= self.next_check {
            self.next_check = arrival.log_time + CHECK_NANOS;
            retention::enforce(&self.directory, self.limits, &Protected::default()).with_context(
                || format!("cannot read the directory {}", self.directory.display()),
            )?;
        }
        self.recorder.push(arrival);
        Ok(())
    }
}
