//! `atvrec import candump`, `asc`, `trc`, `blf`, `mf4`: convert a log of CAN frames.
//!
//! The files are read twice: first for what they contain, so that an error is found before anything is
//! written, then frame by frame into the log. Memory does not depend on their length.

mod buses;
mod merge;
mod survey;

use engine::config::{Estimator, Meaning};
use engine::{Config, output::Target};
use sample::{CanFrame, LogTime, Notice, Payload};
use wire::can_log::candump::Style;
use wire::can_log::{Direction, Entry, Format};

use self::buses::Bus;
use self::merge::{Content, Input, Item, merge};
use self::survey::{Survey, survey};
use super::run::{Log, TAIL_NS, Written};
use super::{Output, START_DEFAULT_NS, log_time, output};
use crate::cli::ImportCanArgs;
use crate::cmd::origin::Origin;
use crate::exit::{Outcome, UsageError};
use crate::progress::Progress;

/// Frames between two looks at signals and at the progress.
const FRAMES_BETWEEN: usize = 4096;

/// Runs the command.
pub fn run(format: Format, args: &ImportCanArgs, quiet: bool) -> anyhow::Result<Outcome> {
    let dbc_files = buses::dbc_files(&args.dbc);
    let inputs = args.input.iter().chain(&dbc_files);
    let output = output(&args.into, None, inputs, quiet)?;
    let mut surveys = Vec::new();
    for path in &args.input {
        surveys.push(survey(format, path, &output.interrupt)?);
    }
    let zeros = zeros(&surveys)?;
    let buses = buses::of(&surveys);
    for (survey, zero_ns) in surveys.iter().zip(&zeros) {
        survey.print(*zero_ns);
    }
    buses::print(&buses);
    let config = buses::configuration(&buses, args)?;
    let names = buses::source_names(&config, &buses, args)?;
    buses::check_databases(&config, &names, &buses)?;
    let inputs = inputs_of(format, &surveys, &zeros, &buses);
    let target = output.log.clone();
    let written = write(
        &config,
        (&names, &buses),
        &surveys,
        inputs,
        &target,
        &output,
    )?;
    written.print(&config, &target, |estimator| {
        why_nothing(&config, estimator)
    });
    Ok(Outcome::Good)
}

/// UNIX time of time zero of each file, ns.
fn zeros(surveys: &[Survey]) -> anyhow::Result<Vec<i64>> {
    let zeros = surveys.iter().map(|survey| {
        let zero_ns = survey.zero_ns().unwrap_or(START_DEFAULT_NS.cast_signed());
        let (first_ns, last_ns) = (survey.least_ns, survey.greatest_ns);
        let is_time =
            |stamp_ns: i64| log_time(i128::from(zero_ns) + i128::from(stamp_ns)).is_some();
        if is_time(first_ns) && is_time(last_ns) {
            return Ok(zero_ns);
        }
        Err(UsageError(format!(
            "{} has stamps from {} s to {} s, which are no times; correct them",
            survey.path.display(),
            first_ns as f64 * 1e-9,
            last_ns as f64 * 1e-9
        ))
        .into())
    });
    zeros.collect()
}

fn inputs_of<'s>(
    format: Format,
    surveys: &'s [Survey],
    zeros: &[i64],
    buses: &[Bus],
) -> Vec<Input<'s>> {
    let files = surveys.iter().zip(zeros).enumerate();
    let inputs = files.map(|(file, (survey, zero_ns))| {
        let bus_of = |channel| {
            let bus = buses.iter().position(|bus| bus.has(file, channel));
            bus.unwrap_or(0)
        };
        let channels = u16::try_from(survey.summary.channels.len()).unwrap_or(u16::MAX);
        Input {
            format,
            path: &survey.path,
            zero_ns: *zero_ns,
            first_ns: survey.first_ns,
            buses: (0..channels).map(|channel| bus_of(Some(channel))).collect(),
            unnamed: bus_of(None),
        }
    });
    inputs.collect()
}

/// Writes the log.
fn write(
    config: &Config,
    (names, buses): (&[&str], &[Bus]),
    surveys: &[Survey],
    inputs: Vec<Input<'_>>,
    target: &Target,
    output: &Output<'_>,
) -> anyhow::Result<Written> {
    let first = inputs.iter().map(|input| input.time(input.first_ns)).min();
    let start = first.unwrap_or(LogTime(START_DEFAULT_NS));
    let lasts = inputs.iter().zip(surveys);
    let last = lasts
        .map(|(input, survey)| input.time(survey.greatest_ns))
        .max();
    let end = last.unwrap_or(start) + TAIL_NS;
    let mut log = Log::create(config, names, start, target, Vec::new())?;
    let mut ids = Vec::new();
    for (name, bus) in names.iter().zip(buses) {
        let origin = origin(surveys, &inputs, bus);
        ids.extend(log.open(config, &[name], &origin.to_string())?);
    }
    let progress = Progress::seconds("import", end.seconds_since(start), output.quiet);
    let mut count = 0_usize;
    merge(inputs, |item: Item| {
        if count.is_multiple_of(FRAMES_BETWEEN) {
            output.interrupt.check()?;
            progress.set(item.time.seconds_since(start));
        }
        count += 1;
        let payload = match item.content {
            Content::Frame(frame) => Payload::Can(vec![frame]),
            Content::Lost(count) => {
                let place = sample::LossPlace::Kernel;
                Payload::Notice(Notice::Lost { place, count })
            }
        };
        log.push_data(ids[item.bus], item.time, payload)
    })?;
    progress.finish();
    log.close(&ids, end)?;
    log.finish()
}

/// What an export needs to write the frames of a log of candump as they were. Of another log, it writes
/// UNIX times and the names of the buses.
fn origin(surveys: &[Survey], inputs: &[Input<'_>], bus: &Bus) -> Origin {
    let style = surveys.iter().find_map(|survey| survey.summary.style);
    match (style, inputs.first()) {
        (Some(style), Some(input)) => Origin {
            zero_ns: input.zero_ns,
            style,
            channel: bus.channel.clone(),
        },
        _ => Origin {
            zero_ns: 0,
            style: Style {
                direction: surveys.iter().any(Survey::has_direction),
                ..Style::default()
            },
            channel: bus.name.clone(),
        },
    }
}

/// The frame of a log, with its stamp.
fn frame_of(entry: &Entry, stamp_ns: i64) -> CanFrame {
    let mut frame = entry.frame.clone();
    frame.kernel_ns = Some(stamp_ns);
    frame.flags.local_echo = matches!(
        entry.direction,
        Some(Direction::Sent | Direction::SendRequest)
    );
    frame
}

/// Why nothing was estimated.
fn why_nothing(config: &Config, _: &Estimator) -> String {
    let roles = config.sources.iter().any(|source| match &source.meaning {
        Meaning::Can(can) => !can.roles.is_empty(),
        _ => false,
    });
    match roles {
        true => "the signals with roles do not suffice for a model of the vehicle".to_owned(),
        false => "no signal has a role; give roles in the tables [source.<name>.roles] of a configuration, \
                  and the configuration with -c"
            .to_owned(),
    }
}
