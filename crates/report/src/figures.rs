//! Which figures a report has, and why others are not drawn.

mod curves;
mod diagrams;
mod limits;
mod sensors;
mod steer;
mod terrain;
mod vehicle;

use std::borrow::Cow;

use serde_json::{Value, json};

use crate::blob::Blob;
use crate::drive::Drive;
use crate::laps::Laps;
use crate::options::Options;
use crate::plot::{Figure, Kind, Panel, Trace};
use crate::reference::{Reference, distance_m};
use curves::Curves;

const TIME: &str = "time since the start (s)";
/// Wheels in the order of the panels, with the beginning of their columns.
pub const WHEELS: [(&str, &str); 4] = [
    ("fl", "front left"),
    ("fr", "front right"),
    ("rl", "rear left"),
    ("rr", "rear right"),
];
/// Reason for a figure that needs estimates.
const NO_ESTIMATES: &str = "the log has no estimates of this; `atvrec replay -o OUTPUT` computes what \
     its sensors and its vehicle file allow";

/// Figures and what they need.
pub struct Figures {
    /// Those with data.
    pub all: Vec<Figure>,
    /// Titles of the others, and the reason.
    pub lacking: Vec<(Cow<'static, str>, &'static str)>,
    /// Distance along the path at each instant of the motion: abscissa in place of the time.
    pub distance: Option<[crate::blob::Id; 2]>,
    /// Values by which the track is coloured: name and numbers.
    pub colours: Vec<Trace>,
}

/// A figure, and the reason why it may have no data.
type Candidate = (Figure, &'static str);

impl Figures {
    /// All figures of a drive. Their numbers move to `blob`, and samples that no further figure needs are
    /// freed: an hour has 150 MB of them.
    pub fn of(
        drive: &mut Drive,
        mut reference: Option<Reference>,
        laps: Option<&Laps>,
        options: &Options,
        blob: &mut Blob,
    ) -> Self {
        let (mut candidates, mut of_sensors) = (Vec::new(), Vec::new());
        sensors::all(
            &mut Curves::new(drive, None, options, blob),
            &mut of_sensors,
        );
        drive.travel.clear();
        drive.ground.free();
        let mut curves = Curves::new(drive, reference.as_ref(), options, blob);
        vehicle::forces(&mut curves, &mut candidates);
        drive.model.free();
        if let Some(reference) = &mut reference {
            reference.forces.free();
        }
        let mut curves = Curves::new(drive, reference.as_ref(), options, blob);
        vehicle::motion(&mut curves, &mut candidates);
        vehicle::grip(&mut curves, &mut candidates);
        limits::all(&curves, &mut candidates);
        terrain::all(&curves, &mut candidates);
        drop(reference);
        let mut curves = Curves::new(drive, None, options, blob);
        diagrams::all(&mut curves, &mut candidates);
        if let Some(laps) = laps {
            diagrams::laps(&curves, laps, &mut candidates);
        }
        candidates.append(&mut of_sensors);
        let colours = vehicle::colours(&mut curves);
        let distance = distance(drive, blob);
        let (mut all, mut lacking) = (Vec::new(), Vec::new());
        for (mut figure, reason) in candidates {
            figure.panels.retain(|panel| !panel.traces.is_empty());
            if figure.has_data() {
                all.push(figure);
            } else {
                lacking.push((figure.title, reason));
            }
        }
        Self {
            all,
            lacking,
            distance,
            colours,
        }
    }

    /// Names of the figures, for the numbers.
    pub fn names(&self) -> Value {
        self.all.iter().map(|figure| json!(figure.id)).collect()
    }

    /// What is lacking, for the numbers.
    pub fn lacking_json(&self) -> Value {
        let lacking = self.lacking.iter();
        lacking
            .map(|(figure, reason)| json!({"figure": figure, "reason": reason}))
            .collect()
    }
}

fn distance(drive: &Drive, blob: &mut Blob) -> Option<[crate::blob::Id; 2]> {
    let distance: Vec<f32> = distance_m(&drive.motion)
        .iter()
        .map(|d| *d as f32)
        .collect();
    let moves = distance.last().is_some_and(|last| *last > 0.0);
    if !moves {
        return None;
    }
    let y = blob.add(&distance)?;
    Some([blob.add_times(&drive.motion.time_s), y])
}

/// A figure over the time of the drive.
fn timed(
    id: &'static str,
    title: &'static str,
    caption: &'static str,
    panels: Vec<Panel>,
) -> Figure {
    Figure {
        id: id.into(),
        title: title.into(),
        caption: caption.into(),
        panels,
        x_label: TIME.into(),
        kind: Kind::Time,
    }
}

fn panel(y_label: impl Into<String>, traces: impl IntoIterator<Item = Trace>) -> Panel {
    Panel {
        y_label: y_label.into(),
        traces: traces.into_iter().collect(),
        ..Panel::default()
    }
}
