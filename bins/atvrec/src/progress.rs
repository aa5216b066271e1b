//! Progress bars on standard error, where it is a terminal.

use std::io::IsTerminal;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

/// A bar that may be invisible.
pub struct Progress {
    bar: ProgressBar,
    unit: f64,
}

impl Progress {
    /// A bar over seconds of a drive.
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

    /// Moves the bar.
    pub fn set(&self, position: f64) {
        self.bar.set_position((position / self.unit) as u64);
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
