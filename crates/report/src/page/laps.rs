//! The table of laps.

use std::fmt::Write;

use sample::text::html;

use super::top::number;
use crate::laps::{Lap, Laps};
use crate::options::{Options, Quantity};

/// The table; a click on a row shows its begin.
pub fn table(laps: &Laps, options: &Options, body: &mut String) {
    body.push_str("<h2 id=\"laps\">Laps</h2>");
    if let Some(problem) = &laps.problem {
        let _ = write!(body, "<p class=\"caption\">{}.</p>", html(problem));
    }
    if laps.laps.is_empty() {
        return;
    }
    let (_, length) = options.units.of(Quantity::Length);
    let _ = write!(
        body,
        "<div class=\"wide\"><table><tr><th class=\"n\">lap</th><th>gates</th>\
         <th class=\"n\">begin (s)</th><th class=\"n\">time (s)</th>\
         <th class=\"n\">distance ({length})</th>\
         <th class=\"n\">greatest lateral acceleration (m/s²)</th>\
         <th class=\"n\">greatest load-transfer ratio</th></tr>"
    );
    let times = laps.laps.iter().map(Lap::time_s);
    let best_s = times.fold(f64::INFINITY, f64::min);
    for (index, lap) in laps.laps.iter().enumerate() {
        row(index + 1, lap, lap.time_s() <= best_s, options, body);
    }
    body.push_str("</table></div>");
}

fn row(index: usize, lap: &Lap, is_best: bool, options: &Options, body: &mut String) {
    let (factor, _) = options.units.of(Quantity::Length);
    let time = match is_best {
        true => format!("<strong>{:.2}</strong>", lap.time_s()),
        false => format!("{:.2}", lap.time_s()),
    };
    let _ = write!(
        body,
        "<tr data-at=\"{at:.3}\"><td class=\"n\">{index}</td><td>{from} to {to}</td>\
         <td class=\"n\">{at:.2}</td><td class=\"n\">{time}</td><td class=\"n\">{distance:.0}</td>\
         <td class=\"n\">{lateral}</td><td class=\"n\">{ratio}</td></tr>",
        at = lap.span_s[0],
        from = lap.gates[0],
        to = lap.gates[1],
        distance = lap.distance_m * factor,
        lateral = number(lap.lateral_m_s2),
        ratio = number(lap.ratio),
    );
}
