#![doc = include_str!("../README.md")]
//!
//! # Contents
//!
//! The page works without a network, and its figures can be zoomed and printed. It has a verdict in
//! words, tables of the wheels and of the vehicle, figures of motion and forces with the events, the
//! standard deviations and the truth where the log has them, and a list of what the log lacks. The crate
//! estimates nothing: the page shows the values of the log. [`mod@score`] compares estimates with the
//! truth or with those of another log.

mod blob;
mod cycles;
pub mod drawing;
mod drive;
mod figures;
pub mod findings;
mod frame;
mod laps;
mod options;
mod page;
mod picture;
mod plot;
mod reference;
pub mod score;
mod stretch;
mod summary;
mod tiles;

use std::path::PathBuf;

use store::{Attachment, Reader};

pub use store;

pub use cycles::{Cycle, rainflow};
pub use options::{Gate, Gates, Options, Quantity, Units};
pub use page::Page;
pub use picture::{Picture, PictureError};
pub use plot::{Data, Figure, Kind, Panel, Pen, Trace};
pub use stretch::{AROUND_S, Stretch, events, marks};
pub use tiles::{Area, TileFile, TilesError};

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A log could not be read.
    #[error(transparent)]
    Log(#[from] store::Error),
    /// The log has no such event and no such mark.
    #[error(
        "the log has no event and no mark {wanted:?}; it has {count} events{} and {}; use a number from 1 or a \
         kind (`atvrec events` lists them), or the text of a mark", kinds_of(.kinds), marks_of(.marks)
    )]
    NoEvent {
        /// What was asked for.
        wanted: String,
        /// Events of the log.
        count: usize,
        /// Their kinds.
        kinds: String,
        /// Texts of its marks.
        marks: Vec<String>,
    },
    /// The end is before the begin, or the begin after the end of the log.
    #[error(
        "nothing is between {from_s:.1} s and {to_s:.1} s: the log has {whole_s:.1} s; use other \
         values of --from and --to"
    )]
    Span {
        /// Begin.
        from_s: f64,
        /// End.
        to_s: f64,
        /// Length of the log.
        whole_s: f64,
    },
    /// The log has no smoothed estimates.
    #[error(
        "the log has no smoothed estimates (/smoothed/motion); make them with `atvrec replay \
         --smooth -o OUTPUT` and report that log"
    )]
    NotSmoothed,
    /// The picture below the track cannot be used.
    #[error("the picture of the ground cannot be used")]
    Picture(#[from] PictureError),
    /// The tiles below the track cannot be used.
    #[error("the tiles of the ground cannot be used")]
    Tiles(#[from] TilesError),
    /// Two runs have nothing to compare.
    #[error(
        "the log of --against has no estimated motion to compare with; use a log with estimates"
    )]
    NoReference,
    /// The user interrupted the work.
    #[error("interrupted; nothing was written")]
    Interrupted,
}

fn kinds_of(kinds: &str) -> String {
    match kinds {
        "" => String::new(),
        kinds => format!(" ({kinds})"),
    }
}

fn marks_of(marks: &[String]) -> String {
    const SHOWN: usize = 20;
    let shown = marks.iter().take(SHOWN).map(|text| format!("{text:?}"));
    let shown: Vec<String> = shown.collect();
    match marks.len() {
        0 => "no mark".to_owned(),
        count => {
            let more = if count > SHOWN { ", ..." } else { "" };
            let plural = if count == 1 { "" } else { "s" };
            format!("{count} mark{plural} ({}{more})", shown.join(", "))
        }
    }
}

/// Called with the part of the work that is done, from 0 to 1. An error ends the work.
pub type Progress<'a> = dyn FnMut(f64) -> Result<(), Error> + 'a;

/// A report.
#[derive(Clone, Debug)]
pub struct Report {
    /// The page.
    pub page: Page,
    /// The numbers behind it, by the keys of `docs/report.md`.
    pub numbers: serde_json::Value,
    /// Seconds that are shown.
    pub duration_s: f64,
    /// Instants with an estimate.
    pub estimates: usize,
    /// Figures drawn.
    pub figures: usize,
    /// Attachments of the log that are too large for the page. The page links to them as files in a
    /// directory.
    pub files: Vec<(String, Attachment)>,
}

/// The report of one drive, recorded in `logs` (in their order). `directory` is the name of the
/// directory for large attachments.
///
/// # Errors
/// If a log cannot be read, or lacks what the options ask for. A log that was cut short is reported as
/// far as it goes, and the report says so.
pub fn report(
    logs: &[PathBuf],
    options: &Options,
    directory: &str,
    progress: &mut Progress<'_>,
) -> Result<Report, Error> {
    let reader = Reader::open(logs)?;
    let mut drive = drive::Drive::read(&reader, options, progress)?;
    drive.limits.clone_from(&options.limits);
    let summary = summary::Summary::of(&drive, options);
    let files = page::large_files(&mut drive.attachments);
    let reference = reference::Reference::choose(&mut drive, options, progress)?;
    let mut blob = blob::Blob::default();
    let laps = laps::Laps::of(&drive, options);
    let figures = figures::Figures::of(&mut drive, reference, laps.as_ref(), options, &mut blob);
    drive.free_samples();
    let content = page::Content {
        drive: &drive,
        options,
        summary: &summary,
        figures: &figures,
        laps: laps.as_ref(),
        large: &files,
        directory,
    };
    let page = page::render(&content, blob)?;
    let mut numbers = summary.to_json(&drive, options);
    if let Some(laps) = &laps {
        numbers["laps"] = laps.to_json(options);
    }
    numbers["figures"] = figures.names();
    numbers["lacking"] = figures.lacking_json();
    Ok(Report {
        page,
        numbers,
        duration_s: drive.duration_s(),
        estimates: drive.motion.samples(),
        figures: figures.all.len(),
        files,
    })
}
