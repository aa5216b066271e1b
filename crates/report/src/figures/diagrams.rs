//! Diagrams of two quantities: friction circles, g-g, handling, track.

use std::borrow::Cow;

use super::curves::Curves;
use super::{Candidate, NO_ESTIMATES, WHEELS, panel};
use crate::frame::Frame;
use crate::laps::Laps;
use crate::options::Quantity;
use crate::plot::{Data, Figure, Kind, Pen, Trace};
use crate::reference::distance_m;

/// Most points of a diagram.
const POINTS: usize = 6_000;
/// A wheel with less load has no friction circle, N.
const LOAD_MIN_N: f32 = 50.0;
/// Handling means little below this speed, m/s.
const HANDLING_MIN_M_S: f32 = 3.0;
/// Acceleration of gravity, m/s².
const GRAVITY_M_S2: f64 = 9.806_65;

/// All diagrams.
pub fn all(curves: &mut Curves<'_>, all: &mut Vec<Candidate>) {
    friction_circles(curves, all);
    accelerations(curves, all);
    handling(curves, all);
    track(curves, all);
}

/// Points (time, x, y), thinned, without those that are not finite.
fn points(frame: &Frame, pick: impl Fn(usize) -> Option<[f64; 2]>) -> Vec<[f64; 3]> {
    let stride = frame.len().div_ceil(POINTS).max(1);
    let rows = (0..frame.len()).step_by(stride);
    rows.filter_map(|row| {
        let [x, y] = pick(row)?;
        (x.is_finite() && y.is_finite()).then_some([frame.time_s[row], x, y])
    })
    .collect()
}

fn diagram(
    id: &'static str,
    title: &'static str,
    caption: &'static str,
    x_label: impl Into<Cow<'static, str>>,
    panels: Vec<crate::plot::Panel>,
) -> Figure {
    Figure {
        id: id.into(),
        title: title.into(),
        caption: caption.into(),
        panels,
        x_label: x_label.into(),
        kind: Kind::Equal,
    }
}

fn friction_circles(curves: &mut Curves<'_>, all: &mut Vec<Candidate>) {
    let forces = &curves.drive.forces;
    let mut panels = Vec::new();
    for (wheel, heading) in WHEELS {
        let axes = ["x", "y", "z"].map(|axis| forces.get(&format!("{wheel}.{axis}_n")));
        let [Some(x), Some(y), Some(z)] = axes else {
            continue;
        };
        let found = points(forces, |row| {
            (z[row] > LOAD_MIN_N).then(|| [f64::from(y[row] / z[row]), f64::from(x[row] / z[row])])
        });
        let mut one = panel("Fx / Fz", curves.points("estimate", Pen::Points(0), &found));
        one.heading = heading.to_owned();
        panels.push(one);
    }
    let caption = "Force along the ground over the load of each wheel. The distance from the middle \
                   is the friction that the wheel uses.";
    let figure = diagram(
        "friction-circles",
        "Friction circles",
        caption,
        "Fy / Fz",
        panels,
    );
    all.push((figure, "no forces in all three axes are estimated"));
}

fn accelerations(curves: &mut Curves<'_>, all: &mut Vec<Candidate>) {
    let motion = &curves.drive.motion;
    let axes = ["x", "y"].map(|axis| motion.get(&format!("acceleration_m_s2.{axis}")));
    let mut panels = Vec::new();
    if let [Some(x), Some(y)] = axes {
        let g = |value: f32| f64::from(value) / GRAVITY_M_S2;
        let found = points(motion, |row| Some([g(y[row]), g(x[row])]));
        panels.push(panel(
            "forward (g)",
            curves.points("estimate", Pen::Points(0), &found),
        ));
    }
    let caption = "Acceleration of the centre of gravity.";
    all.push((
        diagram("gg", "g-g diagram", caption, "leftward (g)", panels),
        NO_ESTIMATES,
    ));
}

fn handling(curves: &mut Curves<'_>, all: &mut Vec<Candidate>) {
    let motion = &curves.drive.motion;
    let slip = WHEELS.map(|(wheel, _)| motion.get(&format!("{wheel}.slip_angle_rad")));
    let lateral = motion.get("acceleration_m_s2.y");
    let speed = motion.get("velocity_x_m_s");
    let mut panels = Vec::new();
    if let ([Some(fl), Some(fr), Some(rl), Some(rr)], Some(lateral), Some(speed)) =
        (slip, lateral, speed)
    {
        let found = points(motion, |row| {
            let difference = 0.5 * (fl[row] + fr[row] - rl[row] - rr[row]);
            (speed[row] > HANDLING_MIN_M_S).then(|| {
                // A left turn has negative slip angles: the sign of understeer is positive.
                [
                    f64::from(lateral[row]) / GRAVITY_M_S2,
                    f64::from(-difference).to_degrees(),
                ]
            })
        });
        let traces = curves.points("estimate", Pen::Points(0), &found);
        panels.push(panel("front less rear slip angle (deg)", traces));
    }
    let caption = "Difference of the slip angles of the axles over the lateral acceleration. In a left \
                   turn (right half), positive values are understeer.";
    let figure = Figure {
        kind: Kind::Plain,
        ..diagram(
            "handling",
            "Handling diagram",
            caption,
            "lateral acceleration (g)",
            panels,
        )
    };
    all.push((figure, NO_ESTIMATES));
}

/// Most laps that are drawn over each other.
const LAPS_MAX: usize = 20;

/// Speed and lateral acceleration of each lap over the distance from its begin.
pub fn laps(curves: &Curves<'_>, laps: &Laps, all: &mut Vec<Candidate>) {
    let motion = &curves.drive.motion;
    let travelled_m = distance_m(motion);
    let (length, unit) = curves.options.units.of(Quantity::Length);
    let specs = [
        ("speed", "velocity_x_m_s", Quantity::Speed),
        (
            "lateral acceleration",
            "acceleration_m_s2.y",
            Quantity::Acceleration,
        ),
    ];
    let panels = specs.into_iter().filter_map(|(name, column, quantity)| {
        let values = motion.get(column)?;
        let (factor, of) = curves.options.units.of(quantity);
        let traces = laps
            .laps
            .iter()
            .take(LAPS_MAX)
            .enumerate()
            .map(|(index, lap)| {
                let [from, to] = lap
                    .span_s
                    .map(|at_s| motion.time_s.partition_point(|time| *time < at_s));
                let begin_m = travelled_m.get(from).copied().unwrap_or_default();
                let x = travelled_m[from..to]
                    .iter()
                    .map(|at_m| (at_m - begin_m) * length);
                let y = values[from..to]
                    .iter()
                    .map(|value| f64::from(*value) * factor);
                Trace {
                    name: format!("lap {}", index + 1),
                    pen: Pen::Other(index),
                    data: Data::Own {
                        x: x.collect(),
                        y: y.collect(),
                    },
                }
            });
        let mut one = panel(format!("{name} ({of})"), traces);
        one.heading = name.to_owned();
        Some(one)
    });
    let caption = "The laps over the distance from their begin.";
    let label = format!("distance ({unit})");
    let figure = Figure {
        kind: Kind::Plain,
        ..diagram(
            "laps-over-distance",
            "Laps",
            caption,
            label,
            panels.collect(),
        )
    };
    all.push((figure, "the path passes no gate twice"));
}

fn track(curves: &mut Curves<'_>, all: &mut Vec<Candidate>) {
    let (factor, unit) = curves.options.units.of(Quantity::Length);
    let drive = curves.drive;
    let mut one = panel(format!("north ({unit})"), None);
    for (index, (topic, frame)) in drive.sensors.iter().enumerate() {
        let [Some(east), Some(north)] = ["east_m", "north_m"].map(|name| frame.get(name)) else {
            continue;
        };
        let found = points(frame, |row| {
            Some([east[row], north[row]].map(|place| f64::from(place) * factor))
        });
        let name = topic.trim_start_matches("/gnss/");
        one.traces
            .extend(curves.points(name, Pen::Other(index), &found));
    }
    let figure = Figure {
        kind: Kind::Map,
        ..diagram(
            "track",
            "Track",
            "Path of the antennas from their first position. The colour shows the chosen value.",
            format!("east ({unit})"),
            vec![one],
        )
    };
    all.push((figure, "no satellite receiver gave a position"));
}
