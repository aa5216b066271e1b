//! The page of a calibration or an identification: what was found, how sure it is, and the figures
//! to believe it by. It works without a network, zooms and prints.

use std::fmt::Write;

use sample::text::html as escape;
use serde_json::{Value, json};

use crate::Figure;
use crate::blob::Blob;
use crate::page::{document, section};

/// What the page shows.
#[derive(Clone, Debug, Default)]
pub struct Page {
    /// Headline, such as "Calibration: zero".
    pub title: String,
    /// Where the numbers come from, by name: logs, vehicle, span of time.
    pub facts: Vec<(String, String)>,
    /// What a person should look at before believing the rest.
    pub warnings: Vec<String>,
    /// Tables, in their order.
    pub tables: Vec<Table>,
    /// Figures, in their order; one without data is left out.
    pub figures: Vec<Figure>,
}

/// A table of texts.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// Heading above it.
    pub heading: String,
    /// Headings of the columns.
    pub columns: Vec<String>,
    /// Cells, row by row. A cell that is a number stands at the right.
    pub rows: Vec<Vec<String>>,
}

/// The page as HTML.
#[must_use]
pub fn html(page: &Page) -> String {
    let figures: Vec<&Figure> = page.figures.iter().filter(|f| f.has_data()).collect();
    let title = escape(&page.title);
    let mut body = format!("<h1>{title}</h1><p class=\"when\">");
    let facts: Vec<String> = page
        .facts
        .iter()
        .map(|(name, value)| format!("{}: {}", escape(name), escape(value)))
        .collect();
    let _ = write!(body, "{}</p>", facts.join(" · "));
    warnings(&page.warnings, &mut body);
    for table in &page.tables {
        table_of(table, &mut body);
    }
    for figure in &figures {
        section(figure, &mut body);
    }
    body.push_str("<footer>Drag to zoom, double-click to zoom out.</footer>");
    let mut blob = Blob::default();
    let drawn: Vec<Value> = figures.iter().map(|f| f.to_json(&mut blob)).collect();
    document(&page.title, &body, json!({"figures": drawn}), blob).to_string()
}

fn warnings(warnings: &[String], body: &mut String) {
    if warnings.is_empty() {
        return;
    }
    body.push_str("<div class=\"warning\"><b>Look at these first.</b><ul>");
    for warning in warnings {
        let _ = write!(body, "<li>{}</li>", escape(warning));
    }
    body.push_str("</ul></div>");
}

fn table_of(table: &Table, body: &mut String) {
    let _ = write!(
        body,
        "<h2>{}</h2><div class=\"wide\"><table><tr>",
        escape(&table.heading)
    );
    let numeric = |column: usize| {
        let mut cells = table.rows.iter().filter_map(|row| row.get(column));
        cells.any(|cell| cell.parse::<f64>().is_ok())
    };
    let class = |column| if numeric(column) { " class=\"n\"" } else { "" };
    for (column, heading) in table.columns.iter().enumerate() {
        let _ = write!(body, "<th{}>{}</th>", class(column), escape(heading));
    }
    body.push_str("</tr>");
    for row in &table.rows {
        body.push_str("<tr>");
        for (column, cell) in row.iter().enumerate() {
            let _ = write!(body, "<td{}>{}</td>", class(column), escape(cell));
        }
        body.push_str("</tr>");
    }
    body.push_str("</table></div>");
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Data, Kind, Panel, Pen, Trace};

    fn page() -> Page {
        Page {
            title: "Calibration: zero".into(),
            facts: vec![("log".into(), "stands <1>.mcap".into())],
            warnings: vec!["FR lower_front drifts".into()],
            tables: vec![Table {
                heading: "Findings".into(),
                columns: vec!["name".into(), "value".into()],
                rows: vec![vec!["FL offset".into(), "511.25".into()]],
            }],
            figures: vec![Figure {
                id: "counts".into(),
                title: "Counts & time".into(),
                caption: "Points are measured.".into(),
                panels: vec![Panel {
                    y_label: "counts".into(),
                    traces: vec![Trace {
                        name: "measured".into(),
                        pen: Pen::Points(0),
                        data: Data::Own {
                            x: vec![0.0, 1.0],
                            y: vec![2.0, 3.0],
                        },
                    }],
                    ..Panel::default()
                }],
                x_label: "time (s)".into(),
                kind: Kind::Plain,
            }],
        }
    }

    #[test]
    fn a_page_holds_its_table_its_warning_and_its_points() {
        let html = html(&page());
        for part in [
            "stands &lt;1&gt;.mcap",
            "FR lower_front drifts",
            "<td class=\"n\">511.25</td>",
            "Counts &amp; time",
            "\"p\":\"points0\"",
        ] {
            assert!(html.contains(part), "{part}");
        }
    }

    #[test]
    fn a_figure_without_data_is_left_out() {
        let mut page = page();
        page.figures[0].panels[0].traces[0].data = Data::Own {
            x: vec![0.0, 1.0],
            y: vec![f64::NAN; 2],
        };
        assert!(!html(&page).contains("counts-plot"));
    }
}
