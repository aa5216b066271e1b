//! `atvrec info`: show the contents of a log.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use engine::{LeftOut, missing};
use sample::text::printable;
use sample::{LogTime, MessageCount};
use serde_json::json;
use store::{Info, Reader, Record, Selection, Session, UtcOffset, utc_ns};

use crate::cli::InfoArgs;
use crate::exit::Outcome;

/// Runs the command.
pub fn run(args: &InfoArgs) -> anyhow::Result<Outcome> {
    let reader = Reader::open(&args.logs)?;
    let mut info = reader.info();
    info.missing.extend(reader.changed()?);
    info.span = info.span.map(|span| recorded_span(&reader, span));
    let utc = reader.utc_offset()?;
    let undecoded = undecoded(&reader, &info);
    let trouble = trouble(&reader, &info);
    let left_out = LeftOut::of(&reader);
    if args.json {
        let mut shown = as_json(&info, &reader, utc);
        shown["undecoded"] = undecoded
            .iter()
            .map(|(name, list)| json!({ name: list }))
            .collect();
        shown["trouble_codes"] = trouble.iter().map(Trouble::as_json).collect();
        shown["left_out"] = left_out.topics().collect();
        println!("{shown:#}");
    } else {
        print!("{}", as_text(&info, &reader, utc));
        print!("{}", left_out_text(&left_out));
        print!("{}", undecoded_text(&undecoded));
        print!("{}", trouble_text(&trouble));
    }
    Ok(Outcome::Good)
}

/// Time before the end of a log in which its last counters are looked for: they come once a second.
const HEALTH_BEFORE_END_S: f64 = 5.0;

/// Messages that the decoders know by name and did not decode, by source.
fn undecoded(reader: &Reader, info: &Info) -> Vec<(String, Vec<MessageCount>)> {
    let Some((_, end)) = info.span else {
        return Vec::new();
    };
    let start = end.offset_seconds(-HEALTH_BEFORE_END_S);
    let last = Selection::topics(["/health"]).between(start, end);
    // A message that cannot be read is reported as missing.
    let records = reader
        .messages(last)
        .filter_map(|message| message.ok()?.record().ok()?);
    let health = records.filter_map(|record| match record {
        Record::Health(health) => Some(health),
        _ => None,
    });
    let sources = health.last().map_or_else(Vec::new, |health| health.sources);
    let named = sources
        .into_iter()
        .map(|source| (source.name, source.undecoded));
    named
        .filter(|(_, undecoded)| !undecoded.is_empty())
        .collect()
}

/// Topics that are not in the log, and that `export` decodes from the raw frames.
fn left_out_text(left_out: &LeftOut) -> String {
    let mut topics = left_out.topics().peekable();
    let mut text = String::new();
    if topics.peek().is_some() {
        text.push_str("\nnot written, decoded by export and replay (record.decoded)\n");
    }
    for topic in topics {
        let _ = writeln!(text, "{}", printable(topic));
    }
    text
}

fn undecoded_text(undecoded: &[(String, Vec<MessageCount>)]) -> String {
    let mut text = String::new();
    for (source, messages) in undecoded {
        for message in messages {
            let name = format!("{source}: {}", message.name);
            let _ = writeln!(text, "{:<36} {:>9}", printable(&name), message.count);
        }
    }
    if text.is_empty() {
        return text;
    }
    format!("\n{:<36} {:>9}\n{text}", "not decoded", "messages")
}

/// A J1939 trouble code that a controller reported (DM1).
struct Trouble {
    topic: String,
    source_address: u8,
    parameter: u32,
    failure: u8,
    /// Most occurrences that were reported.
    occurrences: u8,
}

impl Trouble {
    fn as_json(&self) -> serde_json::Value {
        json!({
            "topic": self.topic,
            "source_address": self.source_address,
            "spn": self.parameter,
            "fmi": self.failure,
            "occurrences": self.occurrences,
        })
    }
}

/// Trouble codes in the log, each once for its sender.
fn trouble(reader: &Reader, info: &Info) -> Vec<Trouble> {
    let ending = format!("/{}", engine::DM1);
    let topics = info
        .channels
        .keys()
        .filter(|topic| topic.ends_with(&ending));
    let topics: Vec<String> = topics.cloned().collect();
    if topics.is_empty() {
        return Vec::new();
    }
    let mut codes = BTreeMap::<(String, u8, u32, u8), u8>::new();
    // A message that cannot be read is reported as missing.
    for message in reader.messages(Selection::topics(topics)).flatten() {
        let Ok(signals) = message.signals() else {
            continue;
        };
        let value = |name: &str| {
            let signal = signals.iter().find(|signal| &*signal.name == name);
            signal.map(|signal| signal.value)
        };
        let source_address = value("j1939_source_address").unwrap_or(f64::NAN) as u8;
        for n in 1.. {
            let code = value(&format!("spn_{n}")).zip(value(&format!("fmi_{n}")));
            let Some((parameter, failure)) = code else {
                break;
            };
            let occurrences = value(&format!("count_{n}")).unwrap_or(0.0) as u8;
            let topic = message.channel.topic.clone();
            let key = (topic, source_address, parameter as u32, failure as u8);
            let most = codes.entry(key).or_default();
            *most = occurrences.max(*most);
        }
    }
    let codes = codes.into_iter();
    codes
        .map(
            |((topic, source_address, parameter, failure), occurrences)| Trouble {
                topic,
                source_address,
                parameter,
                failure,
                occurrences,
            },
        )
        .collect()
}

fn trouble_text(codes: &[Trouble]) -> String {
    if codes.is_empty() {
        return String::new();
    }
    let mut text = format!(
        "\n{:<36} {:>9} {:>9} {:>4} {:>11}\n",
        "trouble codes (DM1)", "sender", "SPN", "FMI", "occurrences"
    );
    for code in codes {
        let _ = writeln!(
            text,
            "{:<36} {:>9} {:>9} {:>4} {:>11}",
            printable(&code.topic),
            code.source_address,
            code.parameter,
            code.failure,
            code.occurrences
        );
    }
    text
}

/// Time span of the recorded data. A part begins with latched messages, whose times may be in the first
/// second of the run, so that the span begins with the first arrival.
fn recorded_span(reader: &Reader, (first, last): (LogTime, LogTime)) -> (LogTime, LogTime) {
    let arrival = reader.arrivals().find_map(Result::ok);
    (arrival.map_or(first, |arrival| arrival.log_time), last)
}

fn seconds(info: &Info) -> f64 {
    info.span
        .map_or(0.0, |(first, last)| last.seconds_since(first))
}

fn as_text(info: &Info, reader: &Reader, utc: Option<UtcOffset>) -> String {
    let session = reader.session();
    let mut text = String::new();
    let mut line = |label: &str, value: String| {
        let _ = writeln!(text, "{label:<10}{}", printable(&value));
    };
    for (path, bytes) in &info.files {
        line("file", format!("{} ({})", path.display(), size(*bytes)));
    }
    let number = session
        .run_number
        .map(|number| format!(", number {number}"));
    line("run", session.run_id.clone() + &number.unwrap_or_default());
    if let Some(origin) = &session.origin {
        let continued = match origin.is_continued {
            true => "; it continues the run: the data before it are not in the log",
            false => "",
        };
        line(
            "origin",
            format!(
                "stretch of the run {} from {} s to {} s{continued}",
                origin.run_id, origin.from, origin.to
            ),
        );
    }
    if !session.host.is_empty() {
        line(
            "host",
            format!("{}, boot {}", session.host, session.boot_id),
        );
    }
    line("program", program(session));
    line("contract", contract(reader));
    if let Some((first, _)) = info.span {
        let begin = engine::session::utc_compact(utc_ns(first, utc) / 1_000_000_000);
        line("time", format!("{begin}, {:.1} s", seconds(info)));
    }
    if let Some(text) = session.clock_statement(utc) {
        line("clock", text);
    }
    for missing in missing::summary(&info.missing) {
        line("missing", missing);
    }
    write_tables(&mut text, info);
    text
}

/// Program that wrote the log.
fn program(session: &Session) -> String {
    if session.version.is_empty() {
        return "another program".to_owned();
    }
    format!("atvrec {} ({})", session.version, session.git_hash)
}

/// Tables of topics, attachments and counters.
fn write_tables(text: &mut String, info: &Info) {
    let _ = writeln!(
        text,
        "\n{:<36}{:>10}{:>10}  schema",
        "topic", "messages", "Hz"
    );
    for (topic, (schema, count)) in &info.channels {
        // One instant has no rate.
        let duration_s = seconds(info);
        let rate = if duration_s > 0.0 {
            format!("{:.1}", *count as f64 / duration_s)
        } else {
            "-".to_owned()
        };
        let _ = writeln!(
            text,
            "{:<36} {count:>9} {rate:>9}  {}",
            printable(topic),
            printable(schema)
        );
    }
    if !info.attachments.is_empty() {
        let _ = writeln!(text, "\n{:<36}{:>10}  type", "attachment", "bytes");
        for (name, media_type, bytes) in &info.attachments {
            let _ = writeln!(
                text,
                "{:<36}{bytes:>10}  {}",
                printable(name),
                printable(media_type)
            );
        }
    }
    if !info.counters.is_empty() {
        let _ = writeln!(text, "\n{:<36}{:>10}", "counter", "value");
        for (name, value) in &info.counters {
            let _ = writeln!(text, "{:<36}{value:>10}", printable(name));
        }
    }
}

/// Version of the log's contract.
fn contract(reader: &Reader) -> String {
    reader.contract().map_or_else(
        || "none: an earlier layout, shown in the present one".to_owned(),
        |version| format!("version {version}"),
    )
}

fn as_json(info: &Info, reader: &Reader, utc: Option<UtcOffset>) -> serde_json::Value {
    let session = reader.session();
    let channels: serde_json::Map<_, _> = info
        .channels
        .iter()
        .map(|(topic, (schema, count))| {
            (
                topic.clone(),
                json!({ "schema": schema, "messages": count }),
            )
        })
        .collect();
    let sources: Vec<_> = session
        .sources
        .iter()
        .map(|s| json!({ "id": s.id, "name": s.name, "kind": s.kind.name() }))
        .collect();
    json!({
        "files": info.files.iter().map(|(path, bytes)| json!({ "path": path, "bytes": bytes })).collect::<Vec<_>>(),
        "run_id": session.run_id,
        "run_number": session.run_number,
        "origin": session.origin.as_ref().map(|origin| json!({
            "run_id": origin.run_id,
            "from_ns": origin.from.0,
            "to_ns": origin.to.0,
            "continued": origin.is_continued,
            "counters": origin.counters,
        })),
        "clock": session.clock.name(),
        "utc_offset": utc.map(|utc| json!({
            "offset_ns": utc.offset_ns,
            "sigma_s": utc.sigma_s,
            "source": session.source_name(utc.source),
            "leap_seconds": utc.leap_seconds,
        })),
        "version": session.version,
        "git_hash": session.git_hash,
        "contract": reader.contract(),
        "host": session.host,
        "boot_id": session.boot_id,
        "start_ns": info.span.map(|(first, _)| first.0),
        "utc_start_ns": info.span.map(|(first, _)| utc_ns(first, utc)),
        "end_ns": info.span.map(|(_, last)| last.0),
        "duration_s": seconds(info),
        "sources": sources,
        "channels": channels,
        "chunks": info.chunks,
        "attachments": info.attachments.iter().map(|(name, media_type, bytes)| {
            json!({ "name": name, "media_type": media_type, "bytes": bytes })
        }).collect::<Vec<_>>(),
        "counters": info.counters,
        "missing": info.missing.iter().map(ToString::to_string).collect::<Vec<_>>(),
    })
}

/// Size in a suitable unit.
fn size(bytes: u64) -> String {
    match bytes {
        0..1_000 => format!("{bytes} B"),
        1_000..1_000_000 => format!("{:.1} kB", bytes as f64 / 1e3),
        1_000_000..1_000_000_000 => format!("{:.1} MB", bytes as f64 / 1e6),
        _ => format!("{:.2} GB", bytes as f64 / 1e9),
    }
}
