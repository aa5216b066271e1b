//! `atvrec import alog`: convert a MOOS log.

use engine::config::{GAVLAB, Meaning, Problems, alog_map};
use sample::LogTime;
use wire::alog::{Format, Line, Value, is_remark, log_start};
use wire::column::Quantity;
use wire::csv::MAX_LINE;

use super::log::{self, Piece, Source};
use super::truth::Reference;
use super::{
    RowErrors, START_DEFAULT_NS, Table, UNIX_TIME_FROM_NS, configuration, listed, log_time, output,
    refuse, shortened, source_names, text,
};
use crate::cli::ImportAlogArgs;
use crate::exit::{Outcome, UsageError};

/// Runs the command.
pub fn run(args: &ImportAlogArgs, quiet: bool) -> anyhow::Result<Outcome> {
    let output = output(
        &args.into,
        Some(args.rows),
        args.columns.iter().chain([&args.input]),
        quiet,
    )?;
    let map_name = args
        .columns
        .as_ref()
        .map_or_else(|| GAVLAB.to_owned(), |path| path.display().to_string());
    let map_text = match &args.columns {
        Some(path) => text::read(path)?,
        None => engine::config::GAVLAB_MAP.to_owned(),
    };
    let map = alog_map(&map_name, &map_text).map_err(Problems)?;
    refuse(map.contradictions(&map_name))?;
    let format = map.format;
    let text = text::read(&args.input)?;
    let mut errors = RowErrors::default();
    let path = args.input.display().to_string();
    let lines = lines(&path, &text, &format, &mut errors);
    errors.finish()?;
    if !lines.iter().any(|line| line.wanted) {
        return Err(UsageError(format!(
            "{path} contains none of the variables of the map {map_name}; it contains: {}",
            listed(&variables(&text))
        ))
        .into());
    }
    let unordered = lines.windows(2).filter(|p| p[1].order() < p[0].order());
    let unordered = unordered.count();
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
        held: Vec::new(),
        meaning: Meaning::Alog(format),
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
    /// Number of the run, from zero; each `LOGSTART` after the first begins one.
    run: usize,
    time: LogTime,
    /// Number of the line, from one.
    number: usize,
    /// Text of the line, with the comments before it.
    text: &'t str,
    line: Line<'t>,
    wanted: bool,
}

impl Timed<'_> {
    const fn order(&self) -> (usize, LogTime) {
        (self.run, self.time)
    }
}

/// Time zero of the lines that follow.
#[derive(Default)]
struct Start {
    unix_ns: Option<i128>,
    runs: usize,
}

impl Start {
    /// Takes a comment, which may be a `LOGSTART`; whether it begins a further run.
    fn take(&mut self, comment: &str) {
        if let Some(start_s) = log_start(comment) {
            self.runs += 1;
            self.unix_ns = Some((start_s * 1e9).round() as i128);
        }
    }

    fn time(&self, line: &Line<'_>) -> Option<LogTime> {
        let zero_ns = if line.time_ns > UNIX_TIME_FROM_NS {
            0
        } else {
            self.unix_ns.unwrap_or(i128::from(START_DEFAULT_NS))
        };
        log_time(zero_ns + line.time_ns)
    }
}

fn lines<'t>(path: &str, text: &'t str, format: &Format, errors: &mut RowErrors) -> Vec<Timed<'t>> {
    let mut start = Start::default();
    let (mut at, mut begin) = (0, 0);
    let mut lines: Vec<Timed<'t>> = Vec::new();
    for (number, raw) in text.split_inclusive('\n').enumerate() {
        at += raw.len();
        if is_remark(raw) {
            start.take(raw);
            continue;
        }
        let place = || format!("{path}:{}", number + 1);
        // The last line may be cut, even within its number, because the writing program was killed.
        if !raw.ends_with('\n') {
            tracing::warn!("{}: the last line has no end; it is left out", place());
            continue;
        }
        let Some(line) = Line::parse(raw) else {
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
        let Some(time) = start.time(&line) else {
            errors.add(|| {
                format!(
                    "{}: the time {} s is out of range; correct the line",
                    place(),
                    line.time_ns as f64 * 1e-9
                )
            });
            continue;
        };
        lines.push(Timed {
            run: start.runs.saturating_sub(1),
            time,
            number: number + 1,
            text: &text[begin..at],
            line,
            wanted,
        });
        begin = at;
    }
    // A run without lines is none.
    let mut runs: Vec<usize> = lines.iter().map(|line| line.run).collect();
    runs.dedup();
    for line in &mut lines {
        line.run = runs.partition_point(|run| *run < line.run);
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
        if value == Value::Other {
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
        if let (Quantity::Truth(truth), Value::Number(value)) = (variable.column.quantity, value) {
            let time = line.time.offset_seconds(-variable.column.latency_s);
            reference.push(truth, time, value);
        }
    }
}

/// One piece per instant, in the order of runs and time; lines of one instant keep their order.
fn pieces(mut lines: Vec<Timed<'_>>) -> Vec<Piece> {
    lines.sort_by_key(Timed::order);
    let mut pieces: Vec<Piece> = Vec::new();
    for line in lines {
        let mut bytes = line.text.as_bytes().to_vec();
        if !bytes.ends_with(b"\n") {
            bytes.push(b'\n');
        }
        match pieces.last_mut() {
            Some(last) if (last.run, last.time) == line.order() => {
                last.rows += usize::from(line.wanted);
                last.bytes.extend(bytes);
            }
            _ => pieces.push(Piece {
                source: 0,
                time: line.time,
                line: line.number,
                rows: usize::from(line.wanted),
                measurements: None,
                run: line.run,
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
