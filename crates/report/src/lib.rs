#![doc = include_str!("../README.md")]
//!
//! # Contents
//!
//! The page works without a network, and its figures can be zoomed and printed. They have the
//! quantities of the figures of the thesis: steer angle and speed, angular rates, sideslip, slip
//! angles, and for each wheel the expected force of the vehicle model and the measured force. The
//! crate estimates nothing: the page shows the values of the log. [`mod@score`] compares estimates
//! with the truth or with those of another log.

mod decimate;
mod drive;
mod figures;
pub mod findings;
mod page;
mod plot;
pub mod score;

use std::path::PathBuf;

use store::Reader;

pub use store;

pub use plot::{Figure, Panel, Pen, Trace};

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

/// The report of one drive, recorded in `logs` (in their order), as HTML.
///
/// `limits` are lines with what was not estimated, and why; the page begins with them.
///
/// # Errors
/// If a log cannot be read. A log that was cut short is reported as far as it goes, and the report
/// says so.
pub fn html(logs: &[PathBuf], limits: Vec<String>) -> store::Result<(String, Summary)> {
    let reader = Reader::open(logs)?;
    let mut drive = drive::Drive::read(&reader)?;
    drive.limits = limits;
    let figures = figures::all(&drive);
    let html = page::render(&drive, &figures);
    let summary = Summary {
        duration_s: drive.duration_s,
        estimates: drive.estimate.len(),
        figures: figures.len(),
        bytes: html.len() as u64,
    };
    Ok((html, summary))
}
