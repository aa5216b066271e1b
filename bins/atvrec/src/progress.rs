//! Progress bars on standard error, if it is a terminal.

use std::cell::Cell;
use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Work that takes less time shows no bar.
const SHOWN_AFTER: Duration = Duration::from_secs(2);
/// Steps of the bar.
const STEPS: f64 = 10_000.0;

/// Progress bar with the rate and the remaining time; hidden if standard error is not a terminal.
pub struct Progress {
    bar: ProgressBar,
    /// What is done at the end, and its unit for the rate.
    total: f64,
    unit: &'static str,
    begin: Instant,
    is_shown: Cell<bool>,
    is_terminal: bool,
}

impl Progress {
    /// Bar of the seconds of a drive.
    pub fn seconds(what: &'static str, total_s: f64, quiet: bool) -> Self {
        Self::new(what, total_s, "times real time", quiet)
    }

    /// Bar of the megabytes of files.
    pub fn bytes(what: &'static str, total: u64, quiet: bool) -> Self {
        Self::new(what, total as f64 / 1e6, "MB/s", quiet)
    }

    fn new(what: &'static str, total: f64, unit: &'static str, quiet: bool) -> Self {
        let bar = ProgressBar::with_draw_target(Some(STEPS as u64), ProgressDrawTarget::hidden());
        if let Ok(style) =
            ProgressStyle::with_template("{prefix} {wide_bar} {percent}% {msg} {eta}")
        {
            bar.set_style(style);
        }
        bar.set_prefix(what);
        Self {
            bar,
            total,
            unit,
            begin: Instant::now(),
            is_shown: Cell::new(false),
            is_terminal: !quiet && std::io::stderr().is_terminal(),
        }
    }

    /// Sets the position in the unit of the total.
    pub fn set(&self, position: f64) {
        self.set_part(position / self.total.max(f64::MIN_POSITIVE));
    }

    /// Sets the position as a part of the total, from 0 to 1.
    pub fn set_part(&self, part: f64) {
        let took = self.begin.elapsed();
        if !self.is_terminal || took < SHOWN_AFTER {
            return;
        }
        if !self.is_shown.replace(true) {
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
        }
        let rate = part * self.total / took.as_secs_f64();
        self.bar.set_message(format!("{rate:.0} {}", self.unit));
        self.bar.set_position((part * STEPS) as u64);
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// One line of text on standard error, if it is a terminal.
pub struct StatusLine(ProgressBar);

impl StatusLine {
    /// Empty line.
    pub fn new() -> Self {
        let bar = ProgressBar::new_spinner();
        if let Ok(style) = ProgressStyle::with_template("{wide_msg}") {
            bar.set_style(style);
        }
        Self(bar)
    }

    /// Shows a text.
    pub fn show(&self, text: &str) {
        self.0.set_message(text.to_owned());
        self.0.tick();
    }
}

impl Drop for StatusLine {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
