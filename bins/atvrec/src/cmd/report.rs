//! `atvrec report`: write an HTML report.

use std::path::{Path, PathBuf};

use crate::cli::ReportArgs;
use crate::exit::Outcome;
use engine::output::{Kind, Target};
use engine::{Config, scope};
use store::Reader;

/// Runs the command.
pub fn run(args: &ReportArgs) -> anyhow::Result<Outcome> {
    write(&args.logs, &args.output, args.replace.force)?;
    Ok(Outcome::Good)
}

/// Writes the report and prints its path and size.
pub fn write(logs: &[PathBuf], output: &Path, force: bool) -> anyhow::Result<()> {
    let inputs = logs.iter().map(|log| &**log);
    let target = Target::new(output, Kind::Page, force, inputs)?;
    let (html, summary) = report::html(logs, limits(logs)?)?;
    target.write(&html)?;
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

/// What was not estimated in a log with a configuration, and why.
fn limits(logs: &[PathBuf]) -> anyhow::Result<Vec<String>> {
    let attachments = Reader::open(logs)?.attachments()?;
    // A log of another program, or of a version whose configuration is not read any more, says nothing.
    let config = Config::from_attachments(&attachments);
    Ok(config.map_or_else(|_| Vec::new(), |config| scope::limits(&config)))
}
