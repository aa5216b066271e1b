//! `atvrec import gnss`: convert what a GNSS receiver sent.
//!
//! The bytes of the file are those of the port. A message arrives at the receiver's own time of it. The
//! file is read twice, and is not kept in memory.

mod clock;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use anyhow::Context;
use engine::Config;
use engine::config::Meaning;
use sample::{LogTime, Payload};
use wire::can_log;
use wire::gnss::Decoder;

use self::clock::{Clock, First};
use super::run::{Log, TAIL_NS};
use super::{configuration_of, log_time, output, quoted, source_names};
use crate::cli::ImportGnssArgs;
use crate::exit::{Outcome, UsageError};
use crate::interrupt::Interrupt;
use crate::progress::Progress;

/// Bytes that are read at a time.
const PART: usize = 1 << 16;
/// Bytes without a message that wait for one: twice the longest message.
const WAITING_MAX: usize = 1 << 18;
/// Shortest jump of the time that is printed, s.
const JUMP_S: f64 = 10.0;

/// Runs the command.
pub fn run(args: &ImportGnssArgs, quiet: bool) -> anyhow::Result<Outcome> {
    let path = &args.input;
    let output = output(&args.into, None, [path], quiet)?;
    if std::fs::metadata(path).is_ok_and(|file| !file.is_file()) {
        let text = format!(
            "{} is no regular file, but an import reads its input twice; save it to a file",
            path.display()
        );
        return Err(UsageError(text).into());
    }
    let survey = survey(path, &output.interrupt)?;
    survey.print(path);
    let names = source_names(std::slice::from_ref(path));
    let config = configuration(args, &names[0])?;
    let name = source_name(&config, args, &names[0])?;
    let start = survey.first;
    let end = survey.last + TAIL_NS;
    let mut log = Log::create(&config, &[name], start, &output.log, Vec::new())?;
    let ids = log.open(&config, &[name], "imported")?;
    let progress = Progress::seconds("import", end.seconds_since(start), quiet);
    let clock = Clock::new(survey.dates);
    pieces(path, clock, survey.first_ns, &mut |piece| {
        output.interrupt.check()?;
        progress.set(piece.time.seconds_since(start));
        let id = *ids.first().context("the log has the source")?;
        log.push_data(id, piece.time, Payload::Bytes(piece.bytes.to_vec()))
    })?;
    progress.finish();
    log.close(&ids, end)?;
    let written = log.finish()?;
    written.print(&config, &output.log, |_| {
        "a receiver alone does not suffice for a model of the vehicle".to_owned()
    });
    Ok(Outcome::Good)
}

/// Configuration of the log: the user's file, or one with this source and the vehicle.
fn configuration(args: &ImportGnssArgs, name: &str) -> anyhow::Result<Config> {
    if let Some(path) = &args.into.config {
        return Ok(Config::load(path)?);
    }
    let file = args.input.file_name().unwrap_or_default().to_string_lossy();
    let text = format!(
        "[source.{name}]\nkind = \"gnss\"\ndevice = {}\nsilent_after_s = 0\n\n",
        quoted(&format!("imported/{name}/{file}")),
    );
    configuration_of(text, &args.into)
}

/// The source of the receiver: that with the name of the file, or the only one of its kind.
fn source_name<'c>(
    config: &'c Config,
    args: &ImportGnssArgs,
    name: &str,
) -> anyhow::Result<&'c str> {
    let sources = config.sources.iter();
    let fitting: Vec<&str> = sources
        .filter(|source| matches!(source.meaning, Meaning::Gnss { .. }))
        .map(|source| source.spec.name.as_str())
        .collect();
    let named = fitting.iter().find(|known| **known == name);
    match (named, fitting.as_slice()) {
        (Some(known), _) => Ok(known),
        (None, [only]) => Ok(only),
        _ => {
            let config = args.into.config.as_deref().unwrap_or(Path::new(""));
            Err(UsageError(format!(
                "{} has no source {name} of kind gnss; add a table [source.{name}] with kind = \"gnss\" and \
                 device, or rename the file like the source ({})",
                config.display(),
                fitting.join(", ")
            ))
            .into())
        }
    }
}

/// What a file contains.
struct Survey {
    /// Messages by protocol.
    protocols: BTreeMap<&'static str, u64>,
    bytes: u64,
    checksum_errors: u64,
    skipped_bytes: u64,
    /// What the messages tell of the date.
    dates: First,
    /// UNIX time of the first message with a time, ns.
    first_ns: i64,
    first: LogTime,
    last: LogTime,
    /// Messages with a time before that of an earlier message.
    backwards: u64,
    /// Jumps of the time.
    jumps: u64,
}

/// Reads the file for its messages and their times.
fn survey(path: &Path, interrupt: &Interrupt) -> anyhow::Result<Survey> {
    let shown = path.display();
    // The date may come after the first times of day.
    let dates = clock::first_dates(path, interrupt)?;
    let mut clock = Clock::new(dates);
    let mut protocols: BTreeMap<&'static str, u64> = BTreeMap::new();
    let (mut first, mut last_ns) = (None, 0);
    let (mut backwards, mut jumps) = (0, 0);
    let mut decoder = Decoder::new();
    let bytes = each_part(path, |part| {
        interrupt.check()?;
        let mut take = |item: wire::Item<'_>| {
            *protocols.entry(item.protocol.name()).or_default() += 1;
            let Some(ns) = clock.time_ns(&item) else {
                return;
            };
            if first.is_none() {
                first = Some(ns);
                last_ns = ns;
            }
            backwards += u64::from(ns < last_ns);
            jumps += u64::from((ns - last_ns) as f64 > JUMP_S * 1e9);
            last_ns = last_ns.max(ns);
        };
        match part {
            Some(bytes) => decoder.push(bytes, &mut take),
            None => decoder.finish(&mut take),
        }
        Ok(())
    })?;
    let statistics = decoder.statistics();
    if statistics.messages == 0 {
        return Err(UsageError(no_message(path)?).into());
    }
    let Some(first_ns) = first else {
        return Err(UsageError(format!(
            "{shown}: no message has the receiver's time, so that the messages have no times; let the \
             receiver send its position (GGA and RMC, NAV-PVT, BESTPOS or PVTGeodetic)"
        ))
        .into());
    };
    let time = |ns: i64| {
        let time = log_time(i128::from(ns));
        time.ok_or_else(|| UsageError(format!("{shown}: the time {ns} ns is out of range")))
    };
    Ok(Survey {
        protocols,
        bytes,
        checksum_errors: statistics.checksum_errors,
        skipped_bytes: statistics.skipped_bytes,
        dates,
        first_ns,
        first: time(first_ns)?,
        last: time(last_ns)?,
        backwards,
        jumps,
    })
}

/// What a file without a message of a receiver is.
fn no_message(path: &Path) -> anyhow::Result<String> {
    let mut head = Vec::new();
    let file = File::open(path).with_context(|| format!("cannot read {}", path.display()))?;
    file.take(can_log::HEAD_BYTES as u64)
        .read_to_end(&mut head)?;
    let shown = path.display();
    let lacks = "has no message of NovAtel, SBF, UBX or NMEA";
    Ok(match can_log::recognise(&head) {
        _ if head.is_empty() => format!("{shown} is empty"),
        Some(can_log::Format::Other(name, help)) => {
            format!("{shown} is {name} and {lacks}; {help}")
        }
        Some(format) => format!(
            "{shown} is {} and {lacks}; `atvrec import --help` lists the commands",
            format.name()
        ),
        None => format!("{shown} {lacks}; was it recorded at another baud rate?"),
    })
}

impl Survey {
    fn print(&self, path: &Path) {
        let shown = path.display();
        let protocols = self.protocols.iter();
        let protocols: Vec<String> = protocols.map(|(name, n)| format!("{n} {name}")).collect();
        let span_s = self.last.seconds_since(self.first);
        println!(
            "{shown}: {} bytes in {span_s:.3} s, messages: {}",
            self.bytes,
            protocols.join(", ")
        );
        let from = match (self.dates.midnight_ns, self.dates.week) {
            (_, Some(_)) => "from its GPS time",
            (Some(_), None) => "from its time and date",
            (None, None) => {
                "from its time of day or of the week; no message has a date, and the day or the week is that of \
                 2000-01-01"
            }
        };
        println!("{shown}: the messages arrive at the receiver's own time, UTC, {from}");
        for (count, text) in [
            (self.skipped_bytes, "bytes belong to no message"),
            (self.checksum_errors, "messages have a wrong checksum"),
            (
                self.backwards,
                "messages have a time before that of an earlier message; they arrive with the message before \
                 them",
            ),
            (self.jumps, "times the time jumps by more than 10 s"),
        ] {
            if count > 0 {
                println!("{shown}: {count} {text}");
            }
        }
    }
}

/// Calls `take` with each part of a file, and at the end with `None`; the number of bytes.
fn each_part(
    path: &Path,
    mut take: impl FnMut(Option<&[u8]>) -> anyhow::Result<()>,
) -> anyhow::Result<u64> {
    let failed = || format!("cannot read {}", path.display());
    let mut file = File::open(path).with_context(failed)?;
    let mut buffer = vec![0; PART];
    let mut bytes = 0;
    loop {
        let count = match file.read(&mut buffer) {
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => continue,
            count => count.with_context(failed)?,
        };
        if count == 0 {
            take(None)?;
            return Ok(bytes);
        }
        bytes += count as u64;
        take(Some(&buffer[..count]))?;
    }
}

/// Bytes of the file and their time.
struct Piece<'b> {
    time: LogTime,
    bytes: &'b [u8],
}

/// Calls `take` with the bytes of the file: each message with what is before it. A message without a
/// time, and one with an earlier time, has the time of the message before it; `first_ns` is that of the
/// first ones.
fn pieces(
    path: &Path,
    mut clock: Clock,
    first_ns: i64,
    take: &mut dyn FnMut(Piece<'_>) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let mut decoder = Decoder::new();
    let mut waiting: Vec<u8> = Vec::new();
    let (mut position, mut last_ns) = (0_u64, first_ns);
    each_part(path, |part| {
        let mut ends: Vec<(u64, Option<i64>)> = Vec::new();
        let mut found = |item: wire::Item<'_>| ends.push((item.range.end, clock.time_ns(&item)));
        match part {
            Some(bytes) => {
                waiting.extend_from_slice(bytes);
                decoder.push(bytes, &mut found);
            }
            None => decoder.finish(&mut found),
        }
        let mut used = 0;
        let mut push = |end: usize, ns: i64, used: &mut usize| -> anyhow::Result<()> {
            // The survey has checked the range of the times.
            let time = log_time(i128::from(ns)).unwrap_or(LogTime(0));
            let bytes = &waiting[*used..end];
            *used = end;
            if bytes.is_empty() {
                return Ok(());
            }
            take(Piece { time, bytes })
        };
        for (end, ns) in ends {
            last_ns = last_ns.max(ns.unwrap_or(last_ns));
            let end = usize::try_from(end - position).unwrap_or(usize::MAX);
            // A message of several instants has one end.
            if end > used {
                push(end, last_ns, &mut used)?;
            }
        }
        let rest = waiting.len() - used;
        if part.is_none() {
            push(waiting.len(), last_ns, &mut used)?;
        } else if rest > WAITING_MAX {
            push(used + rest / 2, last_ns, &mut used)?;
        }
        waiting.drain(..used);
        position += used as u64;
        Ok(())
    })?;
    Ok(())
}
