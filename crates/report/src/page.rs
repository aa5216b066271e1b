//! The page around the figures.

mod events;
mod laps;
mod tables;
mod top;

use std::fmt::{self, Write};

use chrono::DateTime;
use sample::LogTime;
use sample::text::{html, json_in_html};
use serde_json::{Value, json};
use store::Attachment;

use crate::Error;
use crate::blob::{Blob, Packed};
use crate::drive::Drive;
use crate::figures::Figures;
use crate::laps::Laps;
use crate::options::{Options, Quantity};
use crate::plot::Figure;
use crate::summary::Summary;
use crate::tiles::Area;

/// Larger attachments become files beside the page, bytes.
const ATTACHMENT_MAX: usize = 1_000_000;
/// Style of all pages.
const STYLE: &str = concat!(
    include_str!("../assets/uplot/uPlot.min.css"),
    include_str!("../assets/report.css")
);
/// Drawing library, a module.
const UPLOT: &str = include_str!("../assets/uplot/uPlot.esm.js");
const UPLOT_LICENCE: &str = include_str!("../assets/uplot/LICENSE");
/// Own scripts: numbers, charts, diagrams, and the page.
const SCRIPTS: [&str; 4] = [
    include_str!("../assets/numbers.js"),
    include_str!("../assets/charts.js"),
    include_str!("../assets/diagrams.js"),
    include_str!("../assets/report.js"),
];
/// The page loads nothing from anywhere.
const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; \
                      img-src data:; base-uri 'none'; form-action 'none'";

/// What a page is made of.
pub struct Content<'a> {
    pub drive: &'a Drive,
    pub options: &'a Options,
    pub summary: &'a Summary,
    pub figures: &'a Figures,
    pub laps: Option<&'a Laps>,
    /// Attachments that become files, with their names.
    pub large: &'a [(String, Attachment)],
    /// Name of the directory of these files.
    pub directory: &'a str,
}

/// The whole report.
///
/// # Errors
/// If the picture or the tiles of the ground are not near the track.
pub fn render(content: &Content<'_>, mut blob: Blob) -> Result<Page, Error> {
    let Content {
        drive,
        options,
        summary,
        figures,
        ..
    } = *content;
    let mut body = String::new();
    top::write(drive, summary, &mut body);
    if let Some(laps) = content.laps {
        laps::table(laps, options, &mut body);
    }
    top::lacking(figures, &mut body);
    navigation(&figures.all, &mut body);
    body.push_str(
        "<div id=\"controls\"><button id=\"all\">Whole drive</button> \
         <label id=\"axis-label\" hidden>abscissa <select id=\"axis\">\
         <option value=\"time\">time</option><option value=\"distance\">distance</option>\
         </select></label></div>",
    );
    for figure in &figures.all {
        section(figure, &mut body);
    }
    events::table(drive, &mut body);
    tables::learnt(drive, &mut body);
    tables::sources(drive, &mut body);
    tables::clocks(drive, &mut body);
    tables::files(drive, content.large, content.directory, &mut body);
    body.push_str(
        "<footer>Drag in a figure to zoom; double-click to see the whole drive. All figures over time \
         move together.</footer>",
    );
    let drawn: Vec<Value> = figures.all.iter().map(|f| f.to_json(&mut blob)).collect();
    let colours = figures.colours.iter().filter_map(|c| c.to_json(&mut blob));
    let data = json!({
        "figures": drawn,
        "colours": colours.collect::<Vec<_>>(),
        "distance": figures.distance.map(|ids| ids.map(crate::blob::Id::json)),
        "over_distance": options.over_distance,
        "pictures": pictures(drive, options)?,
        "span": drive.span_s,
        "lines": events::lines(drive, summary, content.laps),
    });
    Ok(document(&title(drive), &body, data, blob))
}

/// Tiles and picture below the track; the picture is above the tiles.
fn pictures(drive: &Drive, options: &Options) -> Result<Vec<Value>, Error> {
    let Some((positions, origin)) = drive.positions() else {
        return Ok(Vec::new());
    };
    let unit = options.units.of(Quantity::Length).0;
    let mut all = Vec::new();
    if let (Some(tiles), Some(area)) = (&options.tiles, Area::around(positions, origin)) {
        all = tiles.to_json(&area, origin, unit)?;
    }
    if let Some(picture) = &options.picture {
        all.push(picture.to_json(origin, unit)?);
    }
    Ok(all)
}

/// A page. Its numbers are packed until it is shown: write it to a file with `write!`.
#[derive(Clone, Debug)]
pub struct Page {
    /// All up to the numbers.
    head: String,
    numbers: Packed,
}

/// A page with figures.
pub fn document(title: &str, body: &str, mut data: Value, mut blob: Blob) -> Page {
    data["series"] = blob.heads();
    let data = json_in_html(&data.to_string());
    let head = format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <meta name=\"color-scheme\" content=\"light dark\">\
         <title>{title}</title><style>{STYLE}</style></head><body>{body}\
         <script type=\"application/json\" id=\"data\">{data}</script>",
        title = html(title),
    );
    Page {
        head,
        numbers: blob.packed(),
    }
}

impl Page {
    /// Its size.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let mut count = Count(0);
        // Counting does not fail.
        let _ = write!(count, "{self}");
        count.0
    }
}

/// Counts the bytes that are written to it.
struct Count(usize);

impl Write for Count {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0 += text.len();
        Ok(())
    }
}

impl fmt::Display for Page {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { head, numbers } = self;
        write!(
            out,
            "{head}<script type=\"text/plain\" id=\"numbers\">{numbers}</script>\
             <script type=\"module\">/*\n{UPLOT_LICENCE}*/\n{}",
            uplot()
        )?;
        // A block of its own: the library has short names at its top level.
        out.write_str("{\n")?;
        SCRIPTS
            .iter()
            .try_for_each(|script| out.write_str(script))?;
        out.write_str("}\n</script></body></html>\n")
    }
}

/// The library without its last statement, which exports it from its module.
fn uplot() -> &'static str {
    let end = UPLOT.rfind("export {").unwrap_or(UPLOT.len());
    &UPLOT[..end]
}

/// Heading, caption and place of a figure.
pub fn section(figure: &Figure, body: &mut String) {
    let _ = write!(
        body,
        "<section><h2 id=\"{id}\">{title}</h2><p class=\"caption\">{caption}</p>\
         <figure id=\"{id}-plot\"></figure></section>",
        id = html(&figure.id),
        title = html(&figure.title),
        caption = html(&figure.caption)
    );
}

/// Takes the large attachments, with names for files.
pub fn large_files(attachments: &mut Vec<Attachment>) -> Vec<(String, Attachment)> {
    let all = std::mem::take(attachments);
    let (large, small) = all
        .into_iter()
        .partition(|attachment| attachment.data.len() > ATTACHMENT_MAX);
    *attachments = small;
    let named = |(number, attachment): (usize, Attachment)| {
        let is_safe = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '_');
        let name = attachment.name.chars();
        let name: String = name
            .map(|c| if is_safe(c) { c } else { '_' })
            .take(80)
            .collect();
        // The number keeps names apart, and no name begins with a dot.
        (format!("{number}-{name}"), attachment)
    };
    let large: Vec<Attachment> = large;
    large.into_iter().enumerate().map(named).collect()
}

fn title(drive: &Drive) -> String {
    let start_ns = store::utc_ns(drive.start, drive.utc_offset);
    format!("Drive of {}", utc(LogTime(start_ns)))
}

fn navigation(figures: &[Figure], body: &mut String) {
    body.push_str("<nav>");
    for figure in figures {
        let (id, title) = (html(&figure.id), html(&figure.title));
        let _ = write!(body, "<a href=\"#{id}\">{title}</a>");
    }
    body.push_str(
        "<a href=\"#events\">Events</a><a href=\"#learnt\">Learnt</a>\
         <a href=\"#sources\">Sources</a><a href=\"#files\">Files</a></nav>",
    );
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

    #[test]
    fn times_are_utc() {
        assert_eq!(
            utc(LogTime(1_351_700_000_123_456_789)),
            "2012-10-31 16:13:20 UTC"
        );
    }

    #[test]
    fn the_drawing_library_is_carried_with_its_licence_and_exports_nothing() {
        let page = document("x", "", json!({"figures": []}), Blob::default()).to_string();
        assert!(page.contains("Leon Sorokin") && page.contains("Permission is hereby granted"));
        assert!(!page.contains("export {"));
        assert!(!uplot().contains("</script"));
    }

    /// A log whose texts were made to leave their place in the page.
    #[test]
    fn texts_of_a_log_cannot_leave_their_place() {
        const NAME: &str = "<!--<script>\u{1b}\u{202e}";
        let mut drive = Drive::default();
        drive.files = vec![(NAME.into(), 1)];
        drive.limits = vec!["no hard-points".to_owned()];
        drive.missing = vec![NAME.into()];
        drive.facts = vec![(NAME.into(), NAME.into())];
        drive.attachments = vec![Attachment {
            name: NAME.into(),
            media_type: String::new(),
            data: NAME.into(),
        }];
        drive.span_s = [0.0, 1.0];
        drive.marks = vec![(LogTime(0), NAME.into())];
        let mut frame = crate::frame::Frame::at(vec![0.0, 1.0]);
        for name in [
            "velocity_m_s.east",
            "velocity_m_s.north",
            "east_m",
            "north_m",
        ] {
            frame.set(name, vec![1.0, 2.0]);
        }
        drive.sensors.insert(format!("/gnss/{NAME}"), frame);
        let options = Options::default();
        let summary = Summary::of(&drive, &options);
        let mut blob = Blob::default();
        let figures = Figures::of(&mut drive, None, None, &options, &mut blob);
        assert!(figures.all.len() > 1, "names reach the figures");
        let large = [(
            "0-x".to_owned(),
            Attachment {
                name: NAME.into(),
                media_type: String::new(),
                data: Vec::new(),
            },
        )];
        let content = Content {
            drive: &drive,
            options: &options,
            summary: &summary,
            figures: &figures,
            laps: None,
            large: &large,
            directory: NAME,
        };
        let page = render(&content, blob).expect("a page");
        let mut own = page.to_string().replace(uplot(), "");
        for script in SCRIPTS {
            own = own.replace(script, "");
        }
        assert!(!own.contains(NAME) && !own.contains("<!--"));
        assert!(!own.contains(['\u{1b}', '\u{202e}']));
        assert_eq!(own.matches("<script").count(), 3);
    }

    #[test]
    fn large_attachments_get_harmless_names() {
        let mut all = vec![
            Attachment {
                name: "../../etc/passwd".into(),
                media_type: String::new(),
                data: vec![0; ATTACHMENT_MAX + 1],
            },
            Attachment {
                name: "small".into(),
                media_type: String::new(),
                data: Vec::new(),
            },
        ];
        let large = large_files(&mut all);
        assert_eq!(large[0].0, "0-.._.._etc_passwd");
        assert_eq!((all.len(), all[0].name.as_str()), (1, "small"));
    }
}
