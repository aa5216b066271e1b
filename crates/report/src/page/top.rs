//! The top of a report.

use std::fmt::Write;

use sample::text::html;

use super::title;
use crate::drive::Drive;
use crate::figures::Figures;
use crate::summary::{Axis, Summary, WheelRow};

/// Headline, verdict, tables and warnings.
pub fn write(drive: &Drive, summary: &Summary, body: &mut String) {
    let _ = write!(body, "<h1>{}</h1><p class=\"when\">", html(&title(drive)));
    let mut facts: Vec<String> = Vec::new();
    if let Some(vehicle) = &summary.vehicle {
        facts.push(format!("Vehicle: {}", html(vehicle)));
    }
    if !summary.payload.is_empty() {
        facts.push(format!("Payload: {}", html(&summary.payload.join(", "))));
    }
    facts.push(format!("{:.1} s", drive.duration_s()));
    if drive.span_s[0] > 0.0 {
        facts.push(format!("from {:.1} s of the log", drive.span_s[0]));
    }
    if summary.distance_m > 0.0 {
        facts.push(format!("{:.2} km", summary.distance_m / 1e3));
    }
    if drive.stage == "smoothed" {
        facts.push("smoothed estimates".to_owned());
    }
    for (name, value) in &drive.facts {
        facts.push(format!("{}: {}", html(name), html(value)));
    }
    let _ = write!(body, "{}</p>", facts.join(" · "));
    let _ = write!(
        body,
        "<p id=\"verdict\">{}.</p>",
        html(&capitalised(&summary.verdict.join("; ")))
    );
    warning(body, "This log is not whole.", &drive.missing);
    warning(body, "Not everything is estimated.", &drive.limits);
    wheels(summary, drive.force_frame, body);
    vehicle(summary, body);
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next();
    first.map_or_else(String::new, |first| {
        first.to_uppercase().chain(letters).collect()
    })
}

/// A box with a title and lines, if there are lines.
fn warning(body: &mut String, title: &str, lines: &[String]) {
    const LINES_MAX: usize = 50;
    if lines.is_empty() {
        return;
    }
    let _ = write!(body, "<div class=\"warning\"><b>{title}</b><ul>");
    for line in lines.iter().take(LINES_MAX) {
        let _ = write!(body, "<li>{}</li>", html(line));
    }
    if lines.len() > LINES_MAX {
        let _ = write!(body, "<li>{} more</li>", lines.len() - LINES_MAX);
    }
    body.push_str("</ul></div>");
}

fn wheels(summary: &Summary, frame: &str, body: &mut String) {
    if summary.wheels.is_empty() {
        return;
    }
    let frame = match frame {
        "contact" => "contact frame",
        _ => "wheel-carrier frame",
    };
    let _ = write!(
        body,
        "<h2 id=\"wheels\">Wheels</h2><p class=\"caption\">Tyre forces ({}) in the {frame}. Sigma is the \
         median of the stated standard deviation. The utilisation is the force along the ground over \
         the load that 0.1 % of the time exceeds.</p><div class=\"wide\"><table><tr><th>wheel</th>\
         <th>force</th><th class=\"n\">min</th><th class=\"n\">max</th><th class=\"n\">RMS</th>\
         <th class=\"n\">95 %</th><th class=\"n\">sigma</th><th class=\"n\">utilisation</th>\
         <th class=\"n\">lifts</th></tr>",
        summary.force_unit
    );
    for row in &summary.wheels {
        wheel(row, body);
    }
    body.push_str("</table></div>");
}

fn wheel(row: &WheelRow, body: &mut String) {
    for (index, name) in ["F<sub>x</sub>", "F<sub>y</sub>", "F<sub>z</sub>"]
        .into_iter()
        .enumerate()
    {
        let first = if index == 0 { row.name } else { "" };
        let _ = write!(body, "<tr><td>{first}</td><td>{name}</td>");
        let cells = row.axes[index].map(|axis: Axis| {
            [
                Some(axis.least),
                Some(axis.greatest),
                Some(axis.rms),
                Some(axis.percentile_95),
                axis.sigma,
            ]
        });
        for value in cells.unwrap_or_default() {
            let _ = write!(body, "<td class=\"n\">{}</td>", number(value));
        }
        let utilisation = row.utilisation.filter(|_| index == 0);
        let utilisation = utilisation.map_or_else(String::new, |part| format!("{part:.2}"));
        let lifts = match index {
            0 => row.lifts.to_string(),
            _ => String::new(),
        };
        let _ = write!(
            body,
            "<td class=\"n\">{utilisation}</td><td class=\"n\">{lifts}</td></tr>"
        );
    }
}

/// Four significant digits, not more than needed; a dash for nothing.
pub fn number(value: Option<f64>) -> String {
    match value {
        None => "–".to_owned(),
        Some(value) if value.abs() >= 100.0 => format!("{value:.0}"),
        Some(value) if value.abs() >= 10.0 => format!("{value:.1}"),
        Some(value) => format!("{value:.2}"),
    }
}

fn vehicle(summary: &Summary, body: &mut String) {
    if summary.vehicle_rows.is_empty() {
        return;
    }
    body.push_str("<h2 id=\"vehicle\">Vehicle</h2><div class=\"wide\"><table>");
    for row in &summary.vehicle_rows {
        let _ = write!(
            body,
            "<tr><td>{}</td><td class=\"n\">{}</td><td>{}</td></tr>",
            row.name,
            number(Some(row.value)),
            row.unit
        );
    }
    body.push_str("</table></div>");
}

/// Figures that are not drawn, each once with the reason.
pub fn lacking(figures: &Figures, body: &mut String) {
    if figures.lacking.is_empty() {
        return;
    }
    let mut by_reason: Vec<(&str, Vec<String>)> = Vec::new();
    for (title, reason) in &figures.lacking {
        let title = html(title);
        match by_reason.iter_mut().find(|(other, _)| other == reason) {
            Some((_, titles)) => titles.push(title),
            None => by_reason.push((reason, vec![title])),
        }
    }
    body.push_str("<details id=\"lacking\" open><summary>What this log lacks</summary><ul>");
    for (reason, titles) in by_reason {
        let _ = write!(body, "<li>{}: {}.</li>", titles.join(", "), html(reason));
    }
    body.push_str("</ul></details>");
}
