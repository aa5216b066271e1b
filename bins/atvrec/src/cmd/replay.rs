//! `atvrec replay`: repeat the estimate from the raw data of a log.

use std::time::{Duration, Instant};

use engine::output::{Kind, Target};
use engine::session::PROGRAM;
use engine::{Changes, Config, Entry, Replay, ReplayOptions, Replayed, Verification, missing};
use sample::LogTime;
use sample::text::printable;
use store::{Reader, Session};

use crate::cli::{ReplayArgs, ReplayChanges};
use crate::exit::Outcome;
use crate::interrupt::Interrupt;
use crate::progress::Progress;

/// Runs the command.
pub fn run(args: &ReplayArgs, quiet: bool) -> anyhow::Result<Outcome> {
    let output = output(args)?;
    let reader = Reader::open(&args.logs)?;
    let config = match &args.config {
        Some(path) => Config::load(path)?,
        None => changes(&args.changes)
            .configuration(reader.attachments()?)
            .map_err(|error| super::name_options(error, &options_of(&args.changes)))?,
    };
    #[cfg(feature = "live")]
    if args.live {
        let rate = args.rate.unwrap_or(1.0);
        return super::live::replay(args, config, rate);
    }
    let begin = Instant::now();
    let options = ReplayOptions {
        smooth: args.smooth,
        verify: args.verify,
        truth: output.is_some(),
        without_records: output.is_none(),
    };
    let replay = Replay::new(&reader, &config, options)?;
    let mut log = output
        .map(|target| target.log(replay.session().clone(), replay.log_options().clone()))
        .transpose()?;
    let progress = Progress::seconds("replay", log_seconds(&reader), quiet);
    let mut pace = args.rate.map(Pace::new);
    let mut first = None;
    let interrupt = Interrupt::listen()?;
    let done = replay.run(|entry| -> anyhow::Result<()> {
        interrupt.check()?;
        if let Entry::Arrival(arrival) = &entry {
            let time = arrival.log_time;
            progress.set(time.seconds_since(*first.get_or_insert(time)));
            if let Some(pace) = &mut pace {
                pace.wait(time);
            }
        }
        match &mut log {
            Some(log) => Ok(log.push(entry)?),
            None => Ok(()),
        }
    })?;
    if let Some(log) = log {
        log.finish()?;
    }
    progress.finish();
    print_result(
        args,
        &done,
        other_program(reader.session()),
        begin.elapsed(),
    );
    Ok(outcome(&done))
}

fn changes(args: &ReplayChanges) -> Changes {
    Changes {
        vehicle: args.vehicle.clone().map(Into::into),
        overrides: args.overrides.iter().cloned().map(Into::into).collect(),
        sensors: args.sensors.clone().map(Into::into),
        calibration: args.calibration.clone().map(Into::into),
        payload: (!args.payload.is_empty()).then(|| args.payload.clone()),
        without: args.without.clone(),
        with: args.with.clone(),
        method: args.method.clone(),
    }
}

fn outcome(done: &Replayed) -> Outcome {
    match &done.verification {
        Some(found) if found.is_partial() && !done.changed => Outcome::DataLoss,
        Some(found) if !found.is_identical() || done.changed => Outcome::Failed,
        _ => Outcome::Good,
    }
}

/// Limits a replay to a multiple of real time.
struct Pace {
    rate: f64,
    start: Option<(Instant, LogTime)>,
}

impl Pace {
    const fn new(rate: f64) -> Self {
        Self { rate, start: None }
    }

    fn wait(&mut self, log_time: LogTime) {
        let (start, first) = *self.start.get_or_insert((Instant::now(), log_time));
        let due_s = log_time.seconds_since(first) / self.rate;
        let ahead_s = due_s - start.elapsed().as_secs_f64();
        if ahead_s > 0.0 {
            std::thread::sleep(Duration::from_secs_f64(ahead_s));
        }
    }
}

fn log_seconds(reader: &Reader) -> f64 {
    let span = reader.info().span;
    span.map_or(0.0, |(first, last)| last.seconds_since(first))
}

/// New log, if one is requested.
fn output(args: &ReplayArgs) -> anyhow::Result<Option<Target>> {
    let Some(path) = &args.output else {
        return Ok(None);
    };
    let changes = &args.changes;
    let files = [
        &args.config,
        &changes.vehicle,
        &changes.sensors,
        &changes.calibration,
    ];
    let inputs = args.logs.iter().chain(files.into_iter().flatten());
    let inputs = inputs.chain(&changes.overrides).map(|path| &**path);
    Ok(Some(Target::new(
        path,
        Kind::Log,
        args.replace.force,
        inputs,
    )?))
}

/// Program that wrote the log, if it was a different one.
fn other_program(original: &Session) -> Option<String> {
    let hash = &original.git_hash;
    (hash != PROGRAM.git_hash).then(|| format!("{} ({hash})", original.version))
}

fn print_result(args: &ReplayArgs, done: &Replayed, made_by: Option<String>, took: Duration) {
    let verification = done.verification.as_ref();
    let span_s = done.log_s();
    let took_s = took.as_secs_f64();
    if args.json {
        let mut value = done.to_json();
        value["took_s"] = took_s.into();
        println!("{value:#}");
        return;
    }
    println!(
        "replayed {span_s:.1} s in {took_s:.2} s ({:.0} times real time): {} arrivals, {} records",
        span_s / took_s.max(1e-9),
        done.arrivals,
        done.records
    );
    if done.skipped > 0 {
        println!(
            "  skipped {} arrivals, which the estimator skipped while recording too",
            done.skipped
        );
    }
    if done.during_silence > 0 {
        println!(
            "  {} estimates are during silence, for which this version gives no estimates",
            done.during_silence
        );
    }
    for line in missing::summary(&done.missing) {
        println!("  {line}");
    }
    if done.changed && verification.is_some_and(Verification::is_identical) {
        println!(
            "NOT VERIFIED: the estimates are identical, but other data in the log was changed"
        );
    } else if let Some(verification) = verification {
        print!("{verification}");
        if let Some(made_by) = made_by.filter(|_| !verification.is_identical()) {
            let made_by = printable(&made_by);
            println!("  atvrec {made_by} wrote the log; its estimator may differ from this one");
        }
    }
    if let Some(output) = &args.output {
        println!("  wrote {}", output.display());
    }
}

/// Options that change the configuration of the log, by the field that they change.
fn options_of(changes: &ReplayChanges) -> Vec<(&'static str, &'static str)> {
    let given = [
        (changes.vehicle.is_some(), "vehicle.file", "--vehicle"),
        (changes.sensors.is_some(), "vehicle.sensors", "--sensors"),
        (
            changes.calibration.is_some(),
            "vehicle.calibration",
            "--calibration",
        ),
        (changes.method.is_some(), "estimator.method", "--method"),
        (!changes.without.is_empty(), "estimator.ignore", "--without"),
    ];
    let given = given.into_iter().filter(|(given, ..)| *given);
    given.map(|(_, field, option)| (field, option)).collect()
}
