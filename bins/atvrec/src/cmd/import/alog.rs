//! `atvrec import alog`: convert a MOOS log.

use engine::config::{GAVLAB, Problems, alog_map};
use sample::LogTime;
use wire::alog::{Format, Line, is_remark, log_start};
use wire::column::Quantity;
use wire::csv::MAX_LINE;

use super::log::{self, Piece, Source};
use super::truth::Reference;
use super::{
    RowErrors, START_DEFAULT_NS, Table, UNIX_TIME_FROM_NS, configuration, listed, log_time, nanos,
    output, read_text, shortened, source_names,
};
use crate::cli::ImportAlogArgs;
use crate::exit::{Outcome, UsageError};

/// Runs the command.
pub fn run(args: &ImportAlogArgs) -> anyhow::Result<Outcome> {
    let output = output(&args.into, args.columns.iter().chain([&args.input]))?;
    let map_name = args
        .columns
        .as_ref()
        .map_or_else(|| GAVLAB.to_owned(), |path| path.display().to_string());
    let map_text = match &args.columns {
        Some(path) => read_text(path)?,
        None => engine::config::GAVLAB_MAP.to_owned(),
    };
    let format = alog_map(&map_name, &map_text).map_err(Problems)?;
    let text = read_text(&args.input)?;
    let mut errors = RowErrors::default();
    let lines = lines(
        &args.input.display().to_string(),
        &text,
        &format,
        &mut errors,
    );
    errors.finish()?;
    if !lines.iter().any(|line| line.wanted) {
        return Err(UsageError(format!(
            "{} contains none of the variables of the map {map_name}; it contains: {}",
            args.input.display(),
            listed(&variables(&text))
        ))
        .into());
    }
    let unordered = lines.windows(2).filter(|p| p[1].time < p[0].time).count();
    if unordered > 0 {
        println!("{unordered} lines are not in the order of time; the log has them in this order");
    }
    let mut reference = Reference::default();
    for line in &lines {
        take_reference(line, &format, &mut reference);
    }
    let pieces = pieces(lines);
    let names = source_names(std::slice::from_ref(&args.input));
    let table = Table {
        kind: "alog",
        path: &args.input,
        columns: &map_name,
    };
    let config = configuration(&names, &[table], &args.into)?;
    let truth = reference.on_grid();
    let source = Source {
        name: &names[0],
        path: &args.input,
        preamble: Vec::new(),
    };
    log::write(&config, &[source], pieces, &truth, &output)
}

/// A line with its time.
struct Timed<'t> {
    time: LogTime,
    /// Number of the line, from one.
    number: usize,
    /// Text of the line, with the comments before it.
    text: &'t str,
    line: Line<'t>,
    wanted: bool,
}

fn lines<'t>(path: &str, text: &'t str, format: &Format, errors: &mut RowErrors) -> Vec<Timed<'t>> {
    let mut start_ns: Option<i128> = None;
    let (mut at, mut begin) = (0, 0);
    let mut lines = Vec::new();
    for (number, raw) in text.split_inclusive('\n').enumerate() {
        at += raw.len();
        if is_remark(raw) {
            if let Some(start_s) = log_start(raw) {
                start_ns.get_or_insert((start_s * 1e9).round() as i128);
            }
            continue;
        }
        let place = || format!("{path}:{}", number + 1);
        let Some(line) = Line::parse(raw) else {
            // The last line may be incomplete because the writing program was killed.
            if !raw.ends_with('\n') {
                continue;
            }
            errors.add(|| {
                format!(
                    "{}: \"{}\" does not have the form `time variable source value`; correct the \
                     line",
                    place(),
                    shortened(raw.trim_end())
                )
            });
            continue;
        };
        if raw.len() > MAX_LINE {
            errors.add(|| {
                let bytes = raw.len();
                format!(
                    "{}: the line has {bytes} bytes, but the limit is {MAX_LINE}; split it",
                    place()
                )
            });
            continue;
        }
        let wanted = check_values(&line, format, &place, errors);
        let word = raw.split_whitespace().next().unwrap_or_default();
        let since_ns = nanos(word, 1_000_000_000).unwrap_or(0);
        let zero_ns = if since_ns > UNIX_TIME_FROM_NS {
            0
        } else {
            start_ns.unwrap_or(i128::from(START_DEFAULT_NS))
        };
        let Some(time) = log_time(zero_ns + since_ns) else {
            errors.add(|| {
                format!(
                    "{}: the time {} s is out of range; correct the line",
                    place(),
                    shortened(word)
                )
            });
            continue;
        };
        lines.push(Timed {
            time,
            number: number + 1,
            text: &text[begin..at],
            line,
            wanted,
        });
        begin = at;
    }
    lines
}

/// Whether the map contains the variable of the line. A value without the number of the map is an
/// error.
fn check_values(
    line: &Line<'_>,
    format: &Format,
    place: &impl Fn() -> String,
    errors: &mut RowErrors,
) -> bool {
    let mut wanted = false;
    for (_, variable, value) in format.values(line) {
        wanted = true;
        if value.is_none() {
            errors.add(|| {
                format!(
                    "{}: variable {}: \"{}\" does not contain the number of the column map; correct \
                     the line or the map",
                    place(),
                    variable.name,
                    shortened(line.value)
                )
            });
        }
    }
    wanted
}

fn take_reference(line: &Timed<'_>, format: &Format, reference: &mut Reference) {
    for (_, variable, value) in format.values(&line.line) {
        if let (Quantity::Truth(truth), Some(value)) = (variable.column.quantity, value) {
            let time = line.time.offset_seconds(-variable.column.delay_s);
            reference.push(truth, time, value);
        }
    }
}

/// One piece per instant, in the order of time; lines of one instant keep their order.
fn pieces(mut lines: Vec<Timed<'_>>) -> Vec<Piece> {
    lines.sort_by_key(|line| line.time);
    let mut pieces: Vec<Piece> = Vec::new();
    for line in lines {
        let mut bytes = line.text.as_bytes().to_vec();
        if !bytes.ends_with(b"\n") {
            bytes.push(b'\n');
        }
        match pieces.last_mut() {
            Some(last) if last.time == line.time => last.bytes.extend(bytes),
            _ => pieces.push(Piece {
                source: 0,
                time: line.time,
                line: line.number,
                bytes,
            }),
        }
    }
    pieces
}

/// All variables of a file, each once.
fn variables(text: &str) -> Vec<&str> {
    let mut names: Vec<&str> = text
        .lines()
        .filter(|line| !is_remark(line))
        .filter_map(Line::parse)
        .map(|line| line.variable)
        .collect();
    names.sort_unstable();
    names.dedup();
    names
}
