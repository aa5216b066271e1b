//! From a log to figures and tables: one HTML file that works without a network, zooms and prints;
//! and [`mod@score`], estimates against truth or against another log's.
//!
//! The figures are the thesis's kinds: steer and speed, angular rates, sideslip, slip angles, and
//! for each wheel the model's expected force against the measured one. Nothing is estimated here;
//! what the report shows is what the log says.

mod decimate;
mod drive;
mod figures;
pub mod findings;
mod page;
mod plot;
pub mod score;

use std::path::{Path, PathBuf};

use store::Reader;

pub use plot::{Figure, Panel, Pen, Trace};

/// Why a report could not be made.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The log could not be read.
    #[error(transparent)]
    Log(#[from] store::Error),
    /// The report could not be written.
    #[error("cannot write the report {path}; choose another place with -o")]
    Write {
        /// Where it should go.
        path: PathBuf,
        /// What the operating system says.
        source: std::io::Error,
    },
}

/// What went into a report.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// Seconds from the first to the last message.
    pub duration_s: f64,
    /// Instants with an estimate.
    pub estimates: usize,
    /// Figures drawn; those that the log has no data for are left out.
    pub figures: usize,
    /// Size of the report in bytes.
    pub bytes: u64,
}

/// Writes the report of one drive, recorded in `logs` (in their order), to `output`.
///
/// # Errors
/// If a log cannot be read or the report cannot be written. A log that was cut short is reported as
/// far as it goes, and the report says so.
pub fn write_html(logs: &[PathBuf], output: &Path) -> Result<Summary, Error> {
    let reader = Reader::open(logs)?;
    let drive = drive::Drive::read(&reader)?;
    let figures = figures::all(&drive);
    let html = page::render(&drive, &figures);
    write(output, &html)?;
    Ok(Summary {
        duration_s: drive.duration_s,
        estimates: drive.estimate.len(),
        figures: figures.len(),
        bytes: html.len() as u64,
    })
}

fn write(output: &Path, html: &str) -> Result<(), Error> {
    std::fs::write(output, html).map_err(|source| Error::Write {
        path: output.to_owned(),
        source,
    })
}
