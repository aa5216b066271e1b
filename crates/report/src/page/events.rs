//! Events, marks and messages: the table, and the lines and bands in the figures.

use std::fmt::Write;

use sample::text::html;
use sample::{Event, EventKind, LogTime, Severity, Wheel};
use serde_json::{Value, json};

use crate::drive::Drive;
use crate::laps::Laps;
use crate::summary::{Summary, fault_spans, many};

/// Rows of the table, and lines in the figures.
const ROWS_MAX: usize = 1_000;

/// The table.
pub fn table(drive: &Drive, body: &mut String) {
    body.push_str("<h2 id=\"events\">Events, marks and messages</h2>");
    let mut rows: Vec<(LogTime, &str, String)> = Vec::new();
    for event in &drive.events {
        rows.push((event.time, "event", event_text(event)));
    }
    for (time, text) in &drive.marks {
        rows.push((*time, "mark", text.clone()));
    }
    for message in &drive.messages {
        let kind = match message.severity {
            Severity::Info => "message",
            Severity::Warning => "warning",
            Severity::Error => "error",
        };
        rows.push((
            message.time,
            kind,
            format!("{}: {}", message.name, message.text),
        ));
    }
    if rows.is_empty() {
        body.push_str("<p class=\"caption\">None.</p>");
        return;
    }
    rows.sort_by_key(|row| row.0);
    let hidden = rows.len().saturating_sub(ROWS_MAX);
    body.push_str(
        "<div class=\"wide\"><table><tr><th class=\"n\">time (s)</th><th>kind</th>\
         <th>text</th></tr>",
    );
    for (time, kind, text) in rows.into_iter().take(ROWS_MAX) {
        let _ = write!(
            body,
            "<tr data-at=\"{at:.3}\"><td class=\"n\">{at:.2}</td><td>{kind}</td><td>{}</td></tr>",
            html(&text),
            at = drive.seconds(time),
        );
    }
    body.push_str("</table></div>");
    if hidden > 0 {
        let rows = many(hidden, "row is", "rows are");
        let _ = write!(
            body,
            "<p class=\"caption\">{rows} left out; `atvrec events` and `atvrec export` have all.</p>"
        );
    }
}

fn event_text(event: &Event) -> String {
    match event.probability {
        Some(probability) => format!("{} (probability {probability:.2})", event.text),
        None => event.text.clone(),
    }
}

/// Lines and bands for the figures: begin, end or nothing, kind and text.
pub fn lines(drive: &Drive, summary: &Summary, laps: Option<&Laps>) -> Value {
    let mut lines: Vec<Value> = Vec::new();
    for (gate, at_s) in laps.iter().flat_map(|laps| &laps.passes) {
        lines.push(json!([at_s, null, "gate", format!("gate {gate}")]));
    }
    for gap in &summary.gaps_s {
        lines.push(json!([gap[0], gap[1], "gap", "no estimates"]));
    }
    for (name, [from, to]) in fault_spans(drive) {
        lines.push(json!([from, to, "fault", format!("fault of {name}")]));
    }
    for (wheel, [from, to]) in lifts(drive) {
        lines.push(json!([from, to, "lift", format!("{wheel} off the ground")]));
    }
    for event in &drive.events {
        let kind = match event.kind {
            EventKind::Lift(_)
            | EventKind::Touchdown(_)
            | EventKind::SensorFault(_)
            | EventKind::SensorRecovered(_) => continue,
            EventKind::SurfaceChange(..) => "surface",
            _ => "event",
        };
        lines.push(json!([drive.seconds(event.time), null, kind, event.text]));
    }
    for (time, text) in &drive.marks {
        lines.push(json!([drive.seconds(*time), null, "mark", text]));
    }
    lines.truncate(ROWS_MAX);
    Value::Array(lines)
}

/// Lifts of wheels with begin and end, s.
fn lifts(drive: &Drive) -> Vec<(Wheel, [f64; 2])> {
    let mut lifts: Vec<(Wheel, [f64; 2])> = Vec::new();
    for event in &drive.events {
        let at_s = drive.seconds(event.time);
        match event.kind {
            EventKind::Lift(wheel) => lifts.push((wheel, [at_s, drive.span_s[1]])),
            EventKind::Touchdown(wheel) => {
                let open = lifts.iter_mut().rev().find(|(other, _)| *other == wheel);
                if let Some((_, [_, end])) = open {
                    *end = end.min(at_s);
                }
            }
            _ => {}
        }
    }
    lifts
}
