//! Figures as the page draws them.

use std::borrow::Cow;

use serde_json::{Value, json};

use crate::blob::{Blob, Id};

/// Most points that a curve of [`Data::Own`] is drawn with.
const POINTS: usize = 20_000;

/// One picture: one panel, or a panel for each wheel.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Anchor in the page.
    pub id: Cow<'static, str>,
    /// Title.
    pub title: Cow<'static, str>,
    /// What the reader should see in it.
    pub caption: Cow<'static, str>,
    /// The panels.
    pub panels: Vec<Panel>,
    /// Label of the abscissa.
    pub x_label: Cow<'static, str>,
    /// What the axes are.
    pub kind: Kind,
}

/// What the axes of a figure are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kind {
    /// The abscissa is the time of the drive, which all such figures share.
    Time,
    /// Any two quantities.
    #[default]
    Plain,
    /// Two quantities with the same scale.
    Equal,
    /// The same, a map whose points have the colour of a chosen value.
    Map,
}

/// One pair of axes.
#[derive(Clone, Debug, Default)]
pub struct Panel {
    /// Heading; empty for a figure of one panel.
    pub heading: String,
    /// Label of the ordinate, with unit.
    pub y_label: String,
    /// What is drawn.
    pub traces: Vec<Trace>,
    /// The panel belongs to the one before it and is low.
    pub is_error: bool,
}

/// One curve.
#[derive(Clone, Debug)]
pub struct Trace {
    /// In the legend.
    pub name: String,
    /// How it is drawn.
    pub pen: Pen,
    /// Its numbers.
    pub data: Data,
}

/// Numbers of a curve.
#[derive(Clone, Debug)]
pub enum Data {
    /// Abscissa and ordinate.
    Own {
        /// Abscissa.
        x: Vec<f64>,
        /// Ordinate.
        y: Vec<f64>,
    },
    /// Single samples, with a standard deviation, and with the time of each if the abscissa is no time.
    Samples {
        /// Abscissa.
        x: Id,
        /// Ordinate.
        y: Id,
        /// Standard deviation.
        sigma: Option<Id>,
        /// Time of each sample.
        time: Option<Id>,
    },
    /// Least and greatest values of short stretches of time.
    Envelope {
        /// Middle of the stretches.
        x: Id,
        /// Least value.
        low: Id,
        /// Greatest value.
        high: Id,
    },
}

/// How a curve is drawn: the same thing looks the same in all figures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pen {
    /// What was measured or estimated.
    Measured,
    /// What the model expects.
    Expected,
    /// What the simulation, a reference instrument or another run says.
    Truth,
    /// A further curve, by number.
    Other(usize),
    /// Single points without a line, by number.
    Points(usize),
}

/// Number of colours of [`Pen::Other`].
const OTHERS: usize = 4;

impl Pen {
    /// Class of the page's style.
    fn name(self) -> String {
        match self {
            Self::Measured => "measured".to_owned(),
            Self::Expected => "expected".to_owned(),
            Self::Truth => "truth".to_owned(),
            Self::Other(index) => format!("other{}", index % OTHERS),
            Self::Points(index) => format!("points{}", index % OTHERS),
        }
    }
}

impl Figure {
    /// Whether anything is drawn at all.
    #[must_use]
    pub fn has_data(&self) -> bool {
        let mut traces = self.panels.iter().flat_map(|panel| &panel.traces);
        traces.any(|trace| match &trace.data {
            Data::Own { y, .. } => y.iter().any(|value| value.is_finite()),
            // The blob takes no series without a finite value.
            Data::Samples { .. } | Data::Envelope { .. } => true,
        })
    }

    /// For the page; curves with numbers of their own move to `blob`.
    pub(crate) fn to_json(&self, blob: &mut Blob) -> Value {
        let panels = self.panels.iter().map(|panel| {
            let traces = panel.traces.iter().filter_map(|trace| trace.to_json(blob));
            json!({
                "h": panel.heading,
                "y": panel.y_label,
                "e": panel.is_error,
                "t": traces.collect::<Vec<Value>>(),
            })
        });
        json!({
            "id": self.id,
            "kind": match self.kind {
                Kind::Time => "time",
                Kind::Plain => "plain",
                Kind::Equal => "equal",
                Kind::Map => "map",
            },
            "x": self.x_label,
            "panels": panels.collect::<Vec<Value>>(),
        })
    }
}

impl Trace {
    pub(crate) fn to_json(&self, blob: &mut Blob) -> Option<Value> {
        let mut json = json!({"n": self.name, "p": self.pen.name()});
        match &self.data {
            Data::Own { x, y } => {
                let stride = y.len().div_ceil(POINTS).max(1);
                let thin = |list: &[f64]| -> Vec<f32> {
                    list.iter().step_by(stride).map(|v| *v as f32).collect()
                };
                json["x"] = blob.add(&thin(x))?.json();
                json["y"] = blob.add(&thin(y))?.json();
            }
            Data::Samples { x, y, sigma, time } => {
                json["x"] = x.json();
                json["y"] = y.json();
                if let Some(sigma) = sigma {
                    json["s"] = sigma.json();
                }
                if let Some(time) = time {
                    json["time"] = time.json();
                }
            }
            Data::Envelope { x, low, high } => {
                json["x"] = x.json();
                json["lo"] = low.json();
                json["hi"] = high.json();
            }
        }
        Some(json)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figure(y: Vec<f64>) -> Figure {
        Figure {
            id: "x".into(),
            title: "X".into(),
            caption: "".into(),
            x_label: "time (s)".into(),
            kind: Kind::Plain,
            panels: vec![Panel {
                traces: vec![Trace {
                    name: "measured".into(),
                    pen: Pen::Measured,
                    data: Data::Own {
                        x: vec![0.0, 1.0, 2.0],
                        y,
                    },
                }],
                ..Panel::default()
            }],
        }
    }

    #[test]
    fn a_figure_of_gaps_has_no_data() {
        assert!(!figure(vec![f64::NAN; 3]).has_data());
        let full = figure(vec![1.0, f64::NAN, 3.0]);
        assert!(full.has_data());
        let json = full.to_json(&mut Blob::default());
        assert_eq!(json["panels"][0]["t"][0]["p"], "measured");
        assert_eq!(json["panels"][0]["t"][0]["y"], 1);
    }
}
