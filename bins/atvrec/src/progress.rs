//! Progress bars on standard error, if it is a terminal.

use std::io::IsTerminal;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

/// Progress bar; hidden if standard error is not a terminal.
pub struct Progress {
    bar: ProgressBar,
    unit: f64,
}

impl Progress {
    /// Bar of the seconds of a drive.
    pub fn seconds(what: &'static str, total_s: f64, quiet: bool) -> Self {
        Self::new(
            what,
            total_s,
            1e-3,
            "{prefix} {wide_bar} {percent}% {eta}",
            quiet,
        )
    }

    fn new(what: &'static str, total: f64, unit: f64, template: &str, quiet: bool) -> Self {
        if quiet || !std::io::stderr().is_terminal() {
            return Self {
                bar: ProgressBar::hidden(),
                unit,
            };
        }
        let bar = ProgressBar::new((total / unit) as u64).with_prefix(what);
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.enable_steady_tick(Duration::from_millis(200));
        Self { bar, unit }
    }

    /// Sets the position.
    pub fn set(&self, position: f64) {
        self.bar.set_position((position / self.unit) as u64);
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
