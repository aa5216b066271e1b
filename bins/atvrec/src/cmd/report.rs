//! `atvrec report`: write an HTML report.

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use anyhow::Context;
use engine::output::{Kind, Target};
use engine::{Config, scope};
use report::{Gates, Options, Picture, Report, TileFile, Units};
use store::Reader;

use crate::cli::{Axis, ReportArgs, UnitSystem};
use crate::exit::Outcome;
use crate::interrupt::Interrupt;
use crate::progress::Progress;

/// Runs the command.
pub fn run(args: &ReportArgs, quiet: bool) -> anyhow::Result<Outcome> {
    let options = Options {
        from_s: args.stretch.from_s,
        to_s: args.stretch.to_s,
        around: args.stretch.around.clone(),
        against: args.against.clone(),
        by_distance: args.by == Axis::Distance,
        units: match args.units {
            UnitSystem::Si => Units::Si,
            UnitSystem::Metric => Units::Metric,
            UnitSystem::Us => Units::Us,
        },
        smoothed: args.smoothed,
        full: args.full,
        gates: match (args.laps, args.gate.is_empty()) {
            (true, _) => Gates::Start,
            (false, true) => Gates::None,
            (false, false) => Gates::At(args.gate.clone()),
        },
        over_distance: args.axis == Axis::Distance,
        picture: args.map.as_deref().map(picture).transpose()?,
        tiles: args.tiles.as_deref().map(tiles).transpose()?,
        limits: limits(&args.logs)?,
    };
    if args.json {
        let found = make(&args.logs, &options, "", quiet)?;
        println!("{:#}", found.numbers);
        return Ok(Outcome::Good);
    }
    write_with(
        &args.logs,
        &options,
        &args.output,
        args.replace.force,
        quiet,
    )
    .map(|()| Outcome::Good)
}

/// Writes the report with the default options, and prints its path and size.
pub fn write(logs: &[PathBuf], output: &Path, force: bool) -> anyhow::Result<()> {
    let options = Options {
        limits: limits(logs)?,
        ..Options::default()
    };
    write_with(logs, &options, output, force, true)
}

fn write_with(
    logs: &[PathBuf],
    options: &Options,
    output: &Path,
    force: bool,
    quiet: bool,
) -> anyhow::Result<()> {
    let inputs = logs.iter().chain(&options.against).map(|log| &**log);
    let target = Target::new(output, Kind::Page, force, inputs)?;
    let stem = output.file_stem().unwrap_or_default().to_string_lossy();
    let directory = format!("{stem}-files");
    let found = make(logs, options, &directory, quiet)?;
    target.write_by(|file| {
        let mut sink = BufWriter::new(file);
        write!(sink, "{}", found.page)?;
        Ok(sink.flush()?)
    })?;
    write_files(&found, &output.with_file_name(&directory), force)?;
    println!(
        "{}: {:.1} s, {} estimates, {} figures, {:.1} MB",
        output.display(),
        found.duration_s,
        found.estimates,
        found.figures,
        found.page.bytes() as f64 / 1e6
    );
    Ok(())
}

fn make(
    logs: &[PathBuf],
    options: &Options,
    directory: &str,
    quiet: bool,
) -> anyhow::Result<Report> {
    let interrupt = Interrupt::listen()?;
    let bytes = logs.iter().chain(&options.against).map(|log| {
        let found = log.metadata();
        found.map_or(0, |found| found.len())
    });
    let progress = Progress::bytes("report", bytes.sum(), quiet);
    let found = report::report(logs, options, directory, &mut |part| {
        progress.set_part(part);
        interrupt.check().map_err(|_| report::Error::Interrupted)
    });
    progress.finish();
    Ok(found?)
}

/// Writes the attachments that are too large for the page.
fn write_files(found: &Report, directory: &Path, force: bool) -> anyhow::Result<()> {
    if found.files.is_empty() {
        return Ok(());
    }
    std::fs::create_dir_all(directory)
        .with_context(|| format!("cannot create the directory {}", directory.display()))?;
    for (name, attachment) in &found.files {
        let target = Target::new(&directory.join(name), Kind::Any, force, None)?;
        target.write_by(|mut file| Ok(file.write_all(&attachment.data)?))?;
    }
    Ok(())
}

fn tiles(path: &Path) -> anyhow::Result<TileFile> {
    Ok(TileFile::open(path).map_err(report::Error::from)?)
}

/// Extensions of a world file. Programs that write maps put it beside the picture.
const WORLD_FILES: [&str; 5] = ["pgw", "jgw", "wld", "pngw", "jpgw"];

/// A picture of the ground with its world file.
fn picture(path: &Path) -> anyhow::Result<Picture> {
    let shown = path.display();
    let image = std::fs::read(path).with_context(|| format!("cannot read the picture {shown}"))?;
    let mut names = WORLD_FILES
        .iter()
        .map(|extension| path.with_extension(extension));
    let world = names.find(|name| name.exists()).with_context(|| {
        format!("the picture {shown} has no world file beside it; export it with one, such as .pgw")
    })?;
    let text = std::fs::read_to_string(&world)
        .with_context(|| format!("cannot read the world file {}", world.display()))?;
    Picture::new(image, &text).with_context(|| format!("the picture {shown} cannot be used"))
}

/// What was not estimated in a log with a configuration, and why.
fn limits(logs: &[PathBuf]) -> anyhow::Result<Vec<String>> {
    let attachments = Reader::open(logs)?.attachments()?;
    // A log of another program, or of a version whose configuration is not read any more, says nothing.
    let config = Config::from_attachments(&attachments);
    Ok(config.map_or_else(|_| Vec::new(), |config| scope::limits(&config)))
}
