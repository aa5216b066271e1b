//! Figure of what the vehicle can still do.

use sample::{Limit, Limits};

use super::curves::Curves;
use super::{Candidate, panel, timed};
use crate::options::Quantity;
use crate::plot::{Data, Panel, Pen, Trace};

/// The value of a limit, or its bound.
type Part = fn(Limit) -> f64;
/// One of the limits.
type Pick = fn(&Limits) -> Limit;

/// Lateral acceleration, speeds and slopes.
pub fn all(curves: &Curves<'_>, all: &mut Vec<Candidate>) {
    let unit = |quantity: Quantity| curves.options.units.of(quantity);
    let (acceleration, speed, angle) = (
        unit(Quantity::Acceleration),
        unit(Quantity::Speed),
        unit(Quantity::Angle),
    );
    let panels = vec![
        of(
            curves,
            format!("lateral acceleration left ({})", acceleration.1),
            acceleration.0,
            &[("to the side of the tyre forces", |l| l.lateral_m_s2)],
        ),
        of(
            curves,
            format!("speed ({})", speed.1),
            speed.0,
            &[
                ("in the present curvature", |l| l.speed_m_s),
                ("in the set curve", |l| l.curve_speed_m_s),
            ],
        ),
        of(
            curves,
            format!("slope ({})", angle.1),
            angle.0,
            &[
                ("side slope", |l| l.side_slope_rad),
                ("grade", |l| l.grade_rad),
            ],
        ),
    ];
    let caption = "What the vehicle can still do on the ground of the last 10 s. The limit is at least the value \
                   of the points with a probability of 0.95. While too little of the grip is used, there are \
                   points alone.";
    all.push((
        timed("limits", "Limits", caption, panels),
        "the log has no limits (/estimate/limits)",
    ));
}

fn of(curves: &Curves<'_>, label: String, factor: f64, picks: &[(&str, Pick)]) -> Panel {
    let drawn = &curves.drive.reachable;
    let x: Vec<f64> = drawn.iter().map(|(time_s, _)| *time_s).collect();
    let mut one = panel(label, None);
    for (colour, (name, pick)) in picks.iter().enumerate() {
        let lines: [(String, Pen, Part); 2] = [
            ((*name).to_owned(), Pen::Other(colour), |limit| limit.value),
            (
                format!("{name}, at least"),
                Pen::Points(2 + colour),
                |limit| limit.at_least,
            ),
        ];
        for (name, pen, part) in lines {
            let y: Vec<f64> = drawn
                .iter()
                .map(|(_, limits)| factor * part(pick(limits)))
                .collect();
            if y.iter().any(|value| value.is_finite()) {
                let data = Data::Own { x: x.clone(), y };
                one.traces.push(Trace { name, pen, data });
            }
        }
    }
    one
}
