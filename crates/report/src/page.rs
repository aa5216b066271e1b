//! The page around the figures.

use std::fmt::Write;

use chrono::DateTime;
use sample::text::{html, html_lines, json_in_html};
use sample::{Event, LogTime, LossPlace, Severity};
use serde_json::{Value, json};

use crate::drive::Drive;
use crate::plot::Figure;

pub(crate) const STYLE: &str = include_str!("../assets/report.css");
pub(crate) const SCRIPT: &str = include_str!("../assets/report.js");

/// The whole report.
pub fn render(drive: &Drive, figures: &[Figure]) -> String {
    let mut body = String::new();
    head(drive, &mut body);
    navigation(figures, &mut body);
    for figure in figures {
        let _ = write!(
            body,
            "<h2 id=\"{id}\">{title}</h2><p class=\"caption\">{caption}</p>\
             <figure id=\"{id}-plot\"></figure>",
            id = figure.id,
            title = figure.title,
            caption = figure.caption
        );
    }
    events(drive, &mut body);
    learnt(drive, &mut body);
    sources(drive, &mut body);
    clocks(drive, &mut body);
    files(drive, &mut body);
    format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <title>{title}</title><style>{STYLE}</style>{plotly}</head><body>{body}\
         <footer>Drag to zoom, double-click to zoom out; all time axes move together. Long drives \
         are drawn by the extremes of short stretches, so no peak is lost.</footer>\
         <script type=\"application/json\" id=\"figures\">{data}</script>\
         <script>{SCRIPT}</script></body></html>\n",
        title = html(&title(drive)),
        plotly = plotly_script(),
        data = json_in_html(&figures_json(figures).to_string()),
    )
}

/// plotly.js itself, with its licence in its head. The crate offers it together with a typesetter
/// of formulas, which no figure here needs.
pub(crate) fn plotly_script() -> String {
    const END: &str = "</script>";
    let scripts = plotly::Plot::offline_js_sources();
    let end = scripts
        .find(END)
        .map_or(scripts.len(), |start| start + END.len());
    scripts[..end].to_owned()
}

fn figures_json(figures: &[Figure]) -> Value {
    let drawn = figures.iter().map(|figure| {
        let (data, layout) = figure.to_plotly();
        json!({"id": figure.id, "timed": !figure.equal_axes, "data": data, "layout": layout})
    });
    Value::Array(drawn.collect())
}

fn title(drive: &Drive) -> String {
    let start_ns = store::utc_ns(drive.start, drive.utc_offset);
    format!("Drive of {}", utc(LogTime(start_ns)))
}

fn head(drive: &Drive, body: &mut String) {
    let _ = write!(body, "<h1>{}</h1><p class=\"when\">", html(&title(drive)));
    for (name, value) in &drive.facts {
        let _ = write!(body, "{}: {} · ", html(name), html(value));
    }
    let _ = write!(body, "{:.1} s</p><div class=\"cards\">", drive.duration_s);
    let lost = drive.health.iter().flat_map(|health| &health.sources);
    let lost: u64 = lost.flat_map(|source| source.lost).sum();
    let cards = [
        (
            format!(
                "{:.1} m/s",
                greatest(drive.estimate.map(|m| m.velocity_x_m_s))
            ),
            "top speed",
        ),
        (
            format!(
                "{:.2} m/s²",
                greatest(drive.estimate.map(|m| m.acceleration_m_s2[1].abs()))
            ),
            "greatest lateral acceleration",
        ),
        (
            format!("{:.0} N", least_load(drive)),
            "least measured wheel load",
        ),
        (drive.events.len().to_string(), "events"),
        (lost.to_string(), "items lost"),
    ];
    for (value, name) in cards {
        let value = if value.contains("inf") || value.contains("NaN") {
            "–".into()
        } else {
            value
        };
        let _ = write!(
            body,
            "<div class=\"card\"><b>{value}</b><span>{name}</span></div>"
        );
    }
    body.push_str("</div>");
    warning(body, "This log is not whole.", &drive.missing);
    warning(body, "Not everything is estimated.", &drive.limits);
}

/// A box with a title and lines, if there are lines.
fn warning(body: &mut String, title: &str, lines: &[String]) {
    if lines.is_empty() {
        return;
    }
    let _ = write!(body, "<div class=\"warning\"><b>{title}</b><ul>");
    for line in lines {
        let _ = write!(body, "<li>{}</li>", html(line));
    }
    body.push_str("</ul></div>");
}

fn greatest(values: Vec<f64>) -> f64 {
    values
        .into_iter()
        .filter(|value| value.is_finite())
        .fold(f64::NEG_INFINITY, f64::max)
}

fn least_load(drive: &Drive) -> f64 {
    let loads = drive
        .measured
        .values
        .iter()
        .flat_map(|forces| forces.0.map(|f| f.force_n[2]));
    loads
        .filter(|load| load.is_finite())
        .fold(f64::INFINITY, f64::min)
}

fn navigation(figures: &[Figure], body: &mut String) {
    body.push_str("<nav>");
    for figure in figures {
        let _ = write!(body, "<a href=\"#{}\">{}</a>", figure.id, figure.title);
    }
    body.push_str(
        "<a href=\"#events\">Events</a><a href=\"#learnt\">Learnt</a>\
         <a href=\"#sources\">Sources</a>\
         <a href=\"#files\">Files</a></nav>",
    );
}

fn events(drive: &Drive, body: &mut String) {
    body.push_str("<h2 id=\"events\">Events, marks and messages</h2>");
    let mut rows: Vec<(LogTime, String, String)> = Vec::new();
    for event in &drive.events {
        rows.push((event.time, "event".into(), event_text(event)));
    }
    for (time, text) in &drive.marks {
        rows.push((*time, "mark".into(), text.clone()));
    }
    for message in &drive.messages {
        let kind = match message.severity {
            Severity::Info => "message",
            Severity::Warning => "warning",
            Severity::Error => "error",
        };
        rows.push((
            message.time,
            kind.into(),
            format!("{}: {}", message.name, message.text),
        ));
    }
    if rows.is_empty() {
        body.push_str("<p class=\"caption\">None.</p>");
        return;
    }
    rows.sort_by_key(|row| row.0);
    body.push_str(
        "<div class=\"wide\"><table><tr><th class=\"n\">time (s)</th><th></th><th></th></tr>",
    );
    for (time, kind, text) in rows {
        let _ = write!(
            body,
            "<tr><td class=\"n\">{:.2}</td><td>{kind}</td><td>{}</td></tr>",
            time.seconds_since(drive.start),
            html(&text)
        );
    }
    body.push_str("</table></div>");
}

fn event_text(event: &Event) -> String {
    match event.probability {
        Some(probability) => format!("{} (probability {probability:.2})", event.text),
        None => event.text.clone(),
    }
}

fn learnt(drive: &Drive, body: &mut String) {
    let Some(learnt) = drive.learnt.values.last() else {
        return;
    };
    body.push_str(
        "<h2 id=\"learnt\">Learnt</h2><p class=\"caption\">What the estimator had found of the \
         sensors by the drive's end, beyond the calibration, with standard deviations.</p>\
         <div class=\"wide\"><table><tr><th></th><th class=\"n\">value</th>\
         <th class=\"n\">deviation</th><th></th></tr>",
    );
    let mut row = |name: &str, value: f64, sigma: f64, unit: &str| {
        let _ = write!(
            body,
            "<tr><td>{name}</td><td class=\"n\">{value:.3}</td><td class=\"n\">{sigma:.3}</td>\
             <td>{unit}</td></tr>"
        );
    };
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        row(
            &format!("accelerometer bias, {name}"),
            learnt.accel_bias_m_s2[axis],
            learnt.accel_bias_sigma_m_s2[axis],
            "m/s²",
        );
        row(
            &format!("gyro bias, {name}"),
            learnt.gyro_bias_rad_s[axis].to_degrees(),
            learnt.gyro_bias_sigma_rad_s[axis].to_degrees(),
            "deg/s",
        );
    }
    row(
        "steer offset at the road wheels, left positive",
        learnt.steer_offset_rad.to_degrees(),
        learnt.steer_offset_sigma_rad.to_degrees(),
        "deg",
    );
    body.push_str("</table></div>");
}

fn sources(drive: &Drive, body: &mut String) {
    let Some(health) = &drive.health else { return };
    body.push_str(
        "<h2 id=\"sources\">Sources</h2><div class=\"wide\"><table><tr><th>source</th>\
         <th>state</th><th class=\"n\">messages</th><th class=\"n\">bytes</th>\
         <th class=\"n\">bad checksums</th><th class=\"n\">skipped bytes</th>\
         <th class=\"n\">gaps</th><th class=\"n\">malformed</th><th class=\"n\">reopened</th>",
    );
    for place in LossPlace::ALL {
        let _ = write!(body, "<th class=\"n\">lost: {}</th>", place.name());
    }
    body.push_str("</tr>");
    for source in &health.sources {
        let state = match (source.open, source.silent) {
            (false, _) => "closed",
            (true, true) => "silent",
            (true, false) => "open",
        };
        let _ = write!(body, "<tr><td>{}</td><td>{state}</td>", html(&source.name));
        let counters = [
            source.messages,
            source.bytes,
            source.checksum_errors,
            source.skipped_bytes,
            source.gaps,
            source.malformed,
            source.reopened,
        ];
        for value in counters.into_iter().chain(source.lost) {
            let _ = write!(body, "<td class=\"n\">{value}</td>");
        }
        body.push_str("</tr>");
    }
    body.push_str("</table></div>");
    if !health.faulty_sensors.is_empty() {
        let names = html(&health.faulty_sensors.join(", "));
        let _ = write!(
            body,
            "<p>Found faulty and left out at the end: {names}.</p>"
        );
    }
}

fn clocks(drive: &Drive, body: &mut String) {
    if drive.clocks.is_empty() {
        return;
    }
    body.push_str(
        "<h2 id=\"clocks\">Clocks</h2><p class=\"caption\">Each device's clock against the log \
         clock, as fitted at the end of the drive.</p><div class=\"wide\"><table><tr>\
         <th>source</th><th class=\"n\">offset (s)</th><th class=\"n\">drift (ppm)</th>\
         <th class=\"n\">residual (ms)</th><th class=\"n\">steps</th></tr>",
    );
    for (name, fit) in &drive.clocks {
        let _ = write!(
            body,
            "<tr><td>{}</td><td class=\"n\">{:.4}</td><td class=\"n\">{:.1}</td>\
             <td class=\"n\">{:.2}</td><td class=\"n\">{}</td></tr>",
            html(name),
            fit.offset_s,
            fit.drift_ppm,
            1e3 * fit.residual_sigma_s,
            fit.steps
        );
    }
    body.push_str("</table></div>");
}

fn files(drive: &Drive, body: &mut String) {
    body.push_str("<h2 id=\"files\">Files</h2><ul>");
    for (path, bytes) in &drive.files {
        let _ = write!(
            body,
            "<li>{} ({:.1} MB)</li>",
            html(path),
            *bytes as f64 / 1e6
        );
    }
    body.push_str("</ul>");
    for attachment in &drive.attachments {
        let text = String::from_utf8_lossy(&attachment.data);
        let _ = write!(
            body,
            "<details><summary>{} ({} bytes, in the log)</summary><pre>{}</pre></details>",
            html(&attachment.name),
            attachment.data.len(),
            html_lines(&text)
        );
    }
}

fn utc(time: LogTime) -> String {
    let seconds = i64::try_from(time.0 / 1_000_000_000).unwrap_or(0);
    DateTime::from_timestamp(seconds, 0).map_or_else(
        || time.to_string(),
        |utc| utc.format("%Y-%m-%d %H:%M:%S UTC").to_string(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Series;

    #[test]
    fn times_are_utc() {
        assert_eq!(
            utc(LogTime(1_351_700_000_123_456_789)),
            "2012-10-31 16:13:20 UTC"
        );
    }

    #[test]
    fn the_drawing_library_is_carried_with_its_licence_and_nothing_else() {
        let script = plotly_script();
        assert!(script.contains("plotly.js v"));
        assert!(script.contains("MIT license"));
        assert_eq!(script.matches("</script>").count(), 1);
    }

    /// A log whose texts were made to leave their place in the page.
    #[test]
    fn texts_of_a_log_cannot_leave_their_place() {
        const NAME: &str = "<!--<script>\u{1b}\u{202e}";
        let series = || Series {
            time_s: vec![0.0, 1.0],
            values: vec![1.0, 2.0],
        };
        let drive = Drive {
            files: vec![(NAME.into(), 1)],
            limits: vec!["no hard-points".to_owned()],
            missing: vec![NAME.into()],
            facts: vec![(NAME.into(), NAME.into())],
            attachments: vec![store::Attachment {
                name: NAME.into(),
                media_type: String::new(),
                data: NAME.into(),
            }],
            start: LogTime(0),
            duration_s: 1.0,
            estimate: Series::default(),
            measured: Series::default(),
            expected: Series::default(),
            truth: Series::default(),
            truth_forces: Series::default(),
            rollover: Series::default(),
            learnt: Series::default(),
            steering_wheel_rad: Series::default(),
            gnss_speed_m_s: [(NAME.to_owned(), series())].into(),
            track_m: [(NAME.to_owned(), vec![[0.0; 2], [1.0; 2]])].into(),
            events: Vec::new(),
            marks: vec![(LogTime(0), NAME.into())],
            messages: Vec::new(),
            health: None,
            utc_offset: None,
            clocks: std::collections::BTreeMap::new(),
        };
        let figures: Vec<Figure> = crate::figures::all(&drive)
            .into_iter()
            .filter(Figure::has_data)
            .collect();
        assert!(figures.len() > 1, "names reach the figures");
        let page = render(&drive, &figures);
        let own = page.replace(plotly_script().as_str(), "");
        assert!(!own.contains(NAME) && !own.contains("<!--"));
        assert!(!own.contains(['\u{1b}', '\u{202e}']));
        assert_eq!(own.matches("<script").count(), 2);
    }
}
