//! A figure as plotly.js wants it.

use std::borrow::Cow;

use serde_json::{Map, Value, json};

use crate::decimate;

/// Most points that one curve is drawn with.
const POINTS: usize = 4_000;

/// One picture: one panel, or a panel for each wheel.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Anchor in the page.
    pub id: Cow<'static, str>,
    /// Title.
    pub title: Cow<'static, str>,
    /// What the reader should see in it.
    pub caption: Cow<'static, str>,
    /// The panels: one, or four in the wheels' order.
    pub panels: Vec<Panel>,
    /// Label of the abscissa.
    pub x_label: Cow<'static, str>,
    /// One metre to the right is one metre up (a map).
    pub equal_axes: bool,
}

/// One pair of axes.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Heading; empty for a figure of one panel.
    pub heading: String,
    /// Label of the ordinate, with unit.
    pub y_label: String,
    /// What is drawn.
    pub traces: Vec<Trace>,
}

/// One curve.
#[derive(Clone, Debug)]
pub struct Trace {
    /// In the legend.
    pub name: String,
    /// How it is drawn.
    pub pen: Pen,
    /// Abscissa.
    pub x: Vec<f64>,
    /// Ordinate.
    pub y: Vec<f64>,
}

/// How a curve is drawn: the same thing looks the same in all figures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pen {
    /// What was measured or estimated.
    Measured,
    /// What the model expects.
    Expected,
    /// What the simulation knows.
    Truth,
    /// A further curve, by number.
    Other(usize),
    /// Single points without a line, by number.
    Points(usize),
}

const OTHERS: [&str; 4] = ["#0f766e", "#b45309", "#7c3aed", "#be123c"];

impl Pen {
    fn line(self) -> Value {
        match self {
            Self::Measured => json!({"color": "#1d4ed8", "width": 1.4}),
            Self::Expected => json!({"color": "#ea580c", "width": 1.4}),
            Self::Truth => json!({"color": "#111827", "width": 1, "dash": "dot"}),
            Self::Other(index) | Self::Points(index) => {
                json!({"color": OTHERS[index % OTHERS.len()], "width": 1.4})
            }
        }
    }

    const fn mode(self) -> &'static str {
        match self {
            Self::Points(_) => "markers",
            _ => "lines",
        }
    }
}

impl Figure {
    /// Whether anything is drawn at all.
    pub fn has_data(&self) -> bool {
        self.panels
            .iter()
            .flat_map(|panel| &panel.traces)
            .any(|trace| trace.y.iter().any(|value| value.is_finite()))
    }

    /// The `data` and `layout` of plotly.js.
    pub fn to_plotly(&self) -> (Value, Value) {
        let mut data = Vec::new();
        let mut layout = self.layout();
        let mut shown = Vec::new();
        for (index, panel) in self.panels.iter().enumerate() {
            let suffix = if index == 0 {
                String::new()
            } else {
                (index + 1).to_string()
            };
            for trace in &panel.traces {
                let curve = decimate::extremes(&trace.x, &trace.y, POINTS);
                let first = !shown.contains(&trace.name);
                if first {
                    shown.push(trace.name.clone());
                }
                data.push(json!({
                    "type": "scatter", "mode": trace.pen.mode(), "name": trace.name,
                    "legendgroup": trace.name, "showlegend": first,
                    "x": numbers(&curve.x), "y": numbers(&curve.y), "line": trace.pen.line(),
                    "marker": {"size": 5, "opacity": 0.75, "color": trace.pen.line()["color"]},
                    "xaxis": format!("x{suffix}"), "yaxis": format!("y{suffix}"),
                    "hovertemplate": "%{y:.4g}",
                }));
            }
            self.add_axes(&mut layout, index, &suffix, panel);
        }
        (Value::Array(data), Value::Object(layout))
    }

    fn layout(&self) -> Map<String, Value> {
        let height = if self.panels.len() > 1 || self.equal_axes {
            560
        } else {
            340
        };
        let layout = json!({
            "height": height, "margin": {"l": 64, "r": 16, "t": 40, "b": 48},
            "font": {"family": "system-ui, sans-serif", "size": 12, "color": "#1f2937"},
            "paper_bgcolor": "white", "plot_bgcolor": "white",
            "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0, "xanchor": "left"},
            "hovermode": if self.equal_axes { "closest" } else { "x unified" },
            "annotations": self.headings(),
        });
        match layout {
            Value::Object(map) => map,
            _ => Map::new(),
        }
    }

    fn headings(&self) -> Vec<Value> {
        let domains = self.domains();
        self.panels
            .iter()
            .zip(domains)
            .filter(|(panel, _)| !panel.heading.is_empty())
            .map(|(panel, (x, y))| {
                json!({
                    "text": format!("<b>{}</b>", panel.heading), "showarrow": false,
                    "xref": "paper", "yref": "paper", "x": x[0] + 0.008, "y": y[1],
                    "xanchor": "left", "yanchor": "top",
                })
            })
            .collect()
    }

    /// Where each panel stands, in parts of the figure: the wheels as seen from above.
    fn domains(&self) -> Vec<([f64; 2], [f64; 2])> {
        if self.panels.len() != 4 {
            return vec![([0.0, 1.0], [0.0, 1.0])];
        }
        let (left, right) = ([0.0, 0.47], [0.53, 1.0]);
        let (front, rear) = ([0.54, 1.0], [0.0, 0.46]);
        vec![(left, front), (right, front), (left, rear), (right, rear)]
    }

    fn add_axes(&self, layout: &mut Map<String, Value>, index: usize, suffix: &str, panel: &Panel) {
        let (x_domain, y_domain) = self.domains()[index];
        let bottom = self.panels.len() == 1 || index >= 2;
        let mut x = json!({
            "domain": x_domain, "anchor": format!("y{suffix}"), "gridcolor": "#e5e7eb",
            "zeroline": false, "title": {"text": if bottom { &*self.x_label } else { "" }},
            "showticklabels": true,
        });
        if index > 0 {
            x["matches"] = json!("x");
        }
        let mut y = json!({
            "domain": y_domain, "anchor": format!("x{suffix}"), "gridcolor": "#e5e7eb",
            "zerolinecolor": "#9ca3af", "title": {"text": panel.y_label},
        });
        if self.equal_axes {
            y["scaleanchor"] = json!("x");
        } else if index > 0 {
            y["matches"] = json!("y");
        }
        layout.insert(format!("xaxis{suffix}"), x);
        layout.insert(format!("yaxis{suffix}"), y);
    }
}

/// Seven significant digits, more than a screen shows; what is not finite becomes null, a gap.
fn numbers(values: &[f64]) -> Vec<Value> {
    values
        .iter()
        .map(|&value| {
            if value.is_finite() {
                format!("{value:.6e}")
                    .parse()
                    .map_or(Value::Null, |v: f64| json!(v))
            } else {
                Value::Null
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figure(panels: usize) -> Figure {
        Figure {
            id: "x".into(),
            title: "X".into(),
            caption: "".into(),
            x_label: "time (s)".into(),
            equal_axes: false,
            panels: (0..panels)
                .map(|index| Panel {
                    heading: format!("P{index}"),
                    y_label: "y (m)".into(),
                    traces: vec![Trace {
                        name: "measured".into(),
                        pen: Pen::Measured,
                        x: vec![0.0, 1.0, 2.0],
                        y: vec![1.0, f64::NAN, 1.0 / 3.0],
                    }],
                })
                .collect(),
        }
    }

    #[test]
    fn gaps_are_null_and_digits_are_few() {
        let (data, _) = figure(1).to_plotly();
        assert_eq!(data[0]["y"].to_string(), "[1.0,null,0.3333333]");
    }

    #[test]
    fn four_panels_share_their_axes_and_one_legend_entry() {
        let (data, layout) = figure(4).to_plotly();
        assert_eq!(layout["xaxis4"]["matches"], "x");
        assert_eq!(data[3]["xaxis"], "x4");
        let entries = (0..4).filter(|&i| data[i]["showlegend"] == true).count();
        assert_eq!(entries, 1);
    }

    #[test]
    fn a_figure_of_gaps_has_no_data() {
        let mut empty = figure(1);
        empty.panels[0].traces[0].y = vec![f64::NAN; 3];
        assert!(!empty.has_data());
        assert!(figure(1).has_data());
    }
}
