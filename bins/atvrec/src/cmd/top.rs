//! `atvrec top`: the running recorder in the terminal.

use std::io::IsTerminal;
use std::time::Duration;

use anyhow::{Context, ensure};
use ratatui::Frame;
use ratatui::backend::TestBackend;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyModifiers};
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Paragraph, Row, Table};
use ratatui::{DefaultTerminal, Terminal};
use sample::Wheel;
use serde_json::Value;

use super::control::send;
use crate::cli::TopArgs;
use crate::control::Request;
use crate::exit::Outcome;
use crate::values::{self, sources, text};

/// Period of the view.
const PERIOD: Duration = Duration::from_millis(200);
/// Load of a full bar over the static load.
const BAR_LOAD: f64 = 2.0;
/// Size with `--once`.
const ONCE: (u16, u16) = (80, 24);
/// Most lines of the table of sources.
const SOURCES_MAX: u16 = 8;
/// Time for which an event is shown as new, s.
const NEW_EVENT_S: f64 = 5.0;

/// Runs the command.
pub fn run(args: &TopArgs) -> anyhow::Result<Outcome> {
    let first = send(&args.socket, &Request::Status)?;
    if args.once {
        print!("{}", screen(&first, ONCE)?);
        return Ok(Outcome::Good);
    }
    ensure!(
        std::io::stdout().is_terminal(),
        "standard output is not a terminal; `atvrec top --once` prints the view, and `atvrec status \
         --json` all values"
    );
    let mut terminal = ratatui::try_init().context("cannot use the terminal")?;
    let result = show(&mut terminal, args, first);
    ratatui::restore();
    result
}

fn show(terminal: &mut DefaultTerminal, args: &TopArgs, first: Value) -> anyhow::Result<Outcome> {
    let mut status = Ok(first);
    loop {
        terminal.draw(|frame| match &status {
            Ok(status) => draw(frame, status),
            Err(error) => {
                let text = format!("no recorder: {error:#}\n\nq ends this view");
                frame.render_widget(Paragraph::new(text), frame.area());
            }
        })?;
        if event::poll(PERIOD)?
            && let Event::Key(key) = event::read()?
        {
            let is_ctrl_c =
                key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
            if is_ctrl_c || matches!(key.code, KeyCode::Char('q') | KeyCode::Esc) {
                return Ok(Outcome::Good);
            }
        }
        status = send(&args.socket, &Request::Status);
    }
}

/// The view as text.
fn screen(status: &Value, (width, height): (u16, u16)) -> anyhow::Result<String> {
    let mut terminal = Terminal::new(TestBackend::new(width, height))?;
    terminal.draw(|frame| draw(frame, status))?;
    let buffer = terminal.backend().buffer();
    let row = |y: u16| {
        let cells = (0..width).map(|x| buffer[(x, y)].symbol());
        format!("{}\n", cells.collect::<String>().trim_end())
    };
    Ok((0..height).map(row).collect())
}

fn draw(frame: &mut Frame<'_>, status: &Value) {
    let sources = sources(status).count() as u16;
    let [head, wheels, motion, table, events] = Layout::vertical([
        Constraint::Length(2),
        Constraint::Length(6),
        Constraint::Length(3),
        Constraint::Length(sources.min(SOURCES_MAX) + 2),
        Constraint::Min(3),
    ])
    .areas(frame.area());
    frame.render_widget(Paragraph::new(head_lines(status)), head);
    draw_wheels(frame, wheels, status);
    frame.render_widget(Paragraph::new(motion_lines(status)), motion);
    draw_sources(frame, table, status);
    frame.render_widget(Paragraph::new(event_lines(status)), events);
}

fn head_lines(status: &Value) -> Vec<Line<'static>> {
    let disk = &status["disk"];
    let lasts = disk["lasts_s"].as_f64().map_or_else(
        || "disk: rate unknown".to_owned(),
        |lasts_s| format!("disk lasts {}", values::duration(lasts_s)),
    );
    let since = status["since_s"].as_f64().map(values::duration);
    let lost = status["lost"].as_object().into_iter().flatten();
    let lost: u64 = lost.filter_map(|(_, count)| count.as_u64()).sum();
    vec![
        Line::from(vec![
            Span::styled(
                text(&status["writing"]).to_uppercase(),
                Style::new().add_modifier(Modifier::BOLD),
            ),
            Span::raw(format!(
                " {}  {}  {lasts}  {lost} lost",
                since.unwrap_or_default(),
                values::size(disk["bytes"].as_f64().unwrap_or_default()),
            )),
        ]),
        Line::raw(text(&status["directory"]).into_owned()),
    ]
}

fn draw_wheels(frame: &mut Frame<'_>, area: Rect, status: &Value) {
    let Some(estimate) = values::recent(status) else {
        let block = Block::bordered().title("forces");
        let text = Paragraph::new("no estimate at present").block(block);
        frame.render_widget(text, area);
        return;
    };
    let mean_n: f64 = Wheel::ALL
        .into_iter()
        .filter_map(|wheel| load(estimate, wheel))
        .sum::<f64>()
        / 4.0;
    let rows = Wheel::ALL.map(|wheel| {
        let force = &estimate["carrier"][wheel.index()];
        let axis = |n: usize| {
            format!(
                "{:>6}±{:<4}",
                values::number(&force["force_n"][n], 0),
                values::number(&force["sigma_n"][n], 0)
            )
        };
        let part = load(estimate, wheel).unwrap_or_default() / (BAR_LOAD * mean_n.max(1.0));
        Row::new([
            wheel.to_string(),
            bar(part, 20),
            axis(0),
            axis(1),
            axis(2),
            values::lift(estimate, wheel),
        ])
    });
    let widths = [2, 20, 12, 12, 12, 6].map(Constraint::Length);
    let title = "F_z        F_x, F_y, F_z in N (wheel carrier)        lifts in s";
    let table = Table::new(rows, widths).block(Block::bordered().title(title));
    frame.render_widget(table, area);
}

fn load(estimate: &Value, wheel: Wheel) -> Option<f64> {
    estimate["carrier"][wheel.index()]["force_n"][2].as_f64()
}

/// A bar of text; `part` of it is filled.
fn bar(part: f64, width: usize) -> String {
    let filled = (part.clamp(0.0, 1.0) * width as f64).round() as usize;
    format!("{}{}", "█".repeat(filled), "·".repeat(width - filled))
}

fn motion_lines(status: &Value) -> Vec<Line<'static>> {
    let Some(estimate) = values::recent(status) else {
        return Vec::new();
    };
    let (motion, rollover) = (&estimate["motion"], &estimate["rollover"]);
    let parameters = &status["parameters"];
    let used = |axle: &str| {
        format!(
            "{} ± {}",
            values::number(&parameters[axle]["utilisation"], 2),
            values::number(&parameters[axle]["utilisation_sigma"], 2),
        )
    };
    let least = |axle: &str| values::number(&parameters[axle]["friction_min"], 2);
    vec![
        Line::raw(format!(
            "speed {} m/s   roll {}°   pitch {}°   sideslip {}°",
            values::number(&motion["velocity_x_m_s"], 1),
            values::degrees(&motion["roll_rad"]),
            values::degrees(&motion["pitch_rad"]),
            values::degrees(&motion["sideslip_rad"]),
        )),
        Line::raw(format!(
            "load-transfer ratio {} ± {}   grip at least: front {}, rear {}",
            values::number(&rollover["load_transfer_ratio"], 2),
            values::number(&rollover["load_transfer_ratio_sigma"], 2),
            least("front"),
            least("rear"),
        )),
        Line::raw(format!(
            "friction used: front {}, rear {}",
            used("front"),
            used("rear")
        )),
    ]
}

fn draw_sources(frame: &mut Frame<'_>, area: Rect, status: &Value) {
    let rows: Vec<Row<'_>> = sources(status).map(source_row).collect();
    let widths = [14, 7, 9, 9, 35].map(Constraint::Length);
    let block = Block::bordered().title("source         state   rate      age       port");
    let inside = block.inner(area);
    frame.render_widget(block, area);
    let fitting = usize::from(inside.height);
    let hidden = match rows.len() > fitting {
        true => rows.len() - fitting.saturating_sub(1),
        false => 0,
    };
    let shown = rows.len() - hidden;
    frame.render_widget(Table::new(rows.into_iter().take(shown), widths), inside);
    if let (1.., Some(last)) = (hidden, inside.rows().next_back()) {
        let text = format!("… and {hidden} more, see atvrec status");
        frame.render_widget(Paragraph::new(text), last);
    }
}

fn source_row(source: &Value) -> Row<'static> {
    let age = source["age_s"].as_f64();
    Row::new([
        text(&source["name"]).into_owned(),
        match source["open"] == true {
            true => "open".to_owned(),
            false => "closed".to_owned(),
        },
        format!("{}/s", values::number(&source["rate_hz"], 0)),
        age.map_or_else(|| "–".to_owned(), values::duration),
        text(&source["state"]).into_owned(),
    ])
}

fn event_lines(status: &Value) -> Vec<Line<'static>> {
    let mut lines = Vec::new();
    for name in status["faulty_sensors"].as_array().into_iter().flatten() {
        lines.push(Line::raw(format!(
            "excluded by the estimator: {}",
            text(name)
        )));
    }
    let events = status["events"].as_array().into_iter().flatten().rev();
    lines.extend(events.map(|event| {
        let age_s = values::age_s(status, &event["time"]).unwrap_or_default();
        let line = format!("{} ago: {}", values::duration(age_s), text(&event["text"]));
        match age_s < NEW_EVENT_S {
            true => Line::styled(line, Style::new().add_modifier(Modifier::REVERSED)),
            false => Line::raw(line),
        }
    }));
    lines
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn status() -> Value {
        let force =
            |load: f64| json!({"force_n": [12.0, -340.0, load], "sigma_n": [9.0, 8.0, 7.0]});
        let source = |name: &str| {
            json!({"name": name, "open": true, "rate_hz": 100.0, "age_s": 0.004,
                   "state": "/dev/ttyS0 at 115200 baud"})
        };
        let names = [
            "imu",
            "novatel",
            "septentrio",
            "can0",
            "steering",
            "throttle",
            "brake",
        ];
        json!({
            "now_ns": 10_000_000_000_u64,
            "writing": "recording",
            "since_s": 75.0,
            "directory": "/var/lib/atvrec",
            "sources": names.map(source),
            "lost": {"device": 0},
            "disk": {"bytes": 2_500_000, "lasts_s": 36_000.0},
            "faulty_sensors": ["FL deflection"],
            "events": [{"time": 9_000_000_000_u64, "text": "FR lifts in 0.4 s"}],
            "parameters": {"front": {"utilisation": 0.4}, "rear": {"utilisation": 0.5}},
            "estimate": {
                "time": 9_990_000_000_u64,
                "motion": {"velocity_x_m_s": 8.04, "roll_rad": 0.1},
                "carrier": [force(1000.0), force(3000.0), force(500.0), force(0.0)],
                "rollover": {"load_transfer_ratio": 0.05, "time_to_lift_s": [2.0, null, 0.5, 0.0]},
            },
        })
    }

    #[test]
    fn everything_is_visible_on_80_by_24() {
        let screen = screen(&status(), ONCE).expect("drawn");
        for word in [
            "RECORDING",
            "75.0 s",
            "disk lasts 10.0 h",
            "0 lost",
            "/var/lib/atvrec",
            "FL",
            "RR",
            "-340±8",
            "1000±7",
            "in air",
            "0.05",
            "8.0 m/s",
            "roll 5.7°",
            "friction used: front 0.40",
            "imu",
            "brake",
            "100/s",
            "4 ms",
            "excluded by the estimator: FL deflection",
            "1.0 s ago: FR lifts in 0.4 s",
        ] {
            assert!(screen.contains(word), "{word} is missing:\n{screen}");
        }
        assert_eq!(screen.lines().count(), 24);
        assert!(
            screen.lines().all(|line| line.chars().count() <= 80),
            "{screen}"
        );
    }

    #[test]
    fn sources_without_a_line_are_counted() {
        let mut status = status();
        let names = (1..=12).map(|n| json!({"name": format!("can{n}"), "open": true}));
        status["sources"] = names.collect();
        let screen = screen(&status, ONCE).expect("drawn");
        for word in [
            "can1 ",
            "can7",
            "… and 5 more, see atvrec status",
            "FR lifts",
        ] {
            assert!(screen.contains(word), "{word} is missing:\n{screen}");
        }
        assert!(!screen.contains("can8"), "{screen}");
        assert_eq!(screen.lines().count(), 24);
    }

    #[test]
    fn a_narrow_terminal_and_a_recorder_without_estimates_are_shown() {
        screen(&status(), (20, 5)).expect("drawn");
        let none = screen(&json!({"writing": "stopped"}), ONCE).expect("drawn");
        assert!(none.contains("no estimate at present"), "{none}");
    }
}
