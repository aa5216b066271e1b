//! `atvrec report`.

use std::path::{Path, PathBuf};

use crate::cli::ReportArgs;
use crate::exit::Outcome;

/// Runs the command.
pub fn run(args: &ReportArgs) -> anyhow::Result<Outcome> {
    write(&args.logs, &args.output)?;
    Ok(Outcome::Good)
}

/// Writes the report and says where it is.
pub fn write(logs: &[PathBuf], output: &Path) -> anyhow::Result<()> {
    let summary = report::write_html(logs, output)?;
    println!(
        "{}: {:.1} s, {} estimates, {} figures, {:.1} MB",
        output.display(),
        summary.duration_s,
        summary.estimates,
        summary.figures,
        summary.bytes as f64 / 1e6
    );
    Ok(())
}
