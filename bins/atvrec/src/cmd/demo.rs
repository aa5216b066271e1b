//! `atvrec demo`: the whole chain without hardware and without privileges.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::Context;
use engine::{Config, Ports, Rig};

use super::{record, replay};
use crate::cli::{DemoArgs, DriveArgs, Replace, ReplayArgs, ReplayChanges};
use crate::devices::{Devices, Sent};
use crate::exit::Outcome;
use crate::output::target::{Kind, Target};
use crate::pipeline::Summary;

/// Directory of a demonstration that names none.
const DIRECTORY: &str = "atvrec-demo";
/// Files in it beside ports and logs.
const CONFIGURATION: &str = "atvrec.toml";
const PAGE: &str = "report.html";

/// The recording begins before the drive and ends after it by this much.
const MARGIN: Duration = Duration::from_millis(300);

/// Drives, records, replays and reports.
pub fn run(args: &DemoArgs, quiet: bool) -> anyhow::Result<Outcome> {
    let begin = Instant::now();
    let named = directory(args)?;
    std::fs::create_dir_all(&named)
        .with_context(|| format!("cannot make the directory {}", named.display()))?;
    let directory = named
        .canonicalize()
        .with_context(|| format!("cannot find {}", named.display()))?;
    let config_path = directory.join(CONFIGURATION);

    step(
        1,
        "a virtual vehicle on pseudo-terminals and SLCAN, recorded in real time",
    );
    let (summary, sent) = drive_and_record(args, &directory, &config_path)?;
    for sent in &sent {
        println!("  {sent}");
    }
    print!("{}", record::as_text(&summary));

    step(2, "the same estimate from the recorded bytes");
    let verified = replay::run(&replay_args(&summary.files), quiet)?;

    step(3, "the report");
    let page = directory.join(PAGE);
    super::report::write(&summary.files, &page, args.replace.force)?;

    println!(
        "\nDone in {:.0} s. Everything is in {}:",
        begin.elapsed().as_secs_f64(),
        directory.display()
    );
    println!("  {:<44} configuration", config_path.display());
    for file in &summary.files {
        println!(
            "  {:<44} log: opens in Foxglove, PlotJuggler, Rerun",
            file.display()
        );
    }
    println!("  {:<44} report: opens in any browser", page.display());
    Ok(match verified {
        Outcome::Good => record::outcome(&summary),
        other => other,
    })
}

/// The directory that is named, or the first of a row that holds no demonstration yet.
fn directory(args: &DemoArgs) -> anyhow::Result<PathBuf> {
    let files = |directory: &Path| [CONFIGURATION, PAGE].map(|name| directory.join(name));
    if let Some(directory) = &args.directory {
        if directory.exists() {
            for path in files(directory) {
                Target::new(&path, Kind::Any, args.replace.force, [])?;
            }
        }
        return Ok(directory.clone());
    }
    let numbered = (2..).map(|number| format!("{DIRECTORY}-{number}"));
    let mut names = std::iter::once(DIRECTORY.to_owned()).chain(numbered);
    let is_free = |name: &String| {
        let used = |path: PathBuf| path.symlink_metadata().is_ok();
        args.replace.force || !files(Path::new(name)).into_iter().any(used)
    };
    let name = names
        .find(is_free)
        .context("every directory atvrec-demo-N is used; name one with -d")?;
    if name != DIRECTORY {
        println!("{DIRECTORY} holds an earlier demonstration; this one goes to {name}");
    }
    Ok(name.into())
}

fn step(number: u32, text: &str) {
    println!("\n[{number}/3] {text}");
}

fn drive_and_record(
    args: &DemoArgs,
    directory: &Path,
    config_path: &Path,
) -> anyhow::Result<(Summary, Vec<Sent>)> {
    let drive = DriveArgs {
        manoeuvre: Some(args.manoeuvre.clone()),
        truth: None,
        vehicle: "prowler".to_owned(),
        sensors: "thesis-10bit".to_owned(),
        seed: args.seed,
        options: None,
        duration_s: Some(args.duration_s),
    };
    let mut rig = Rig::new(&drive.as_drive()?)?;
    let ports_directory = directory.join("ports");
    let mut devices = Devices::new(&ports_directory, true)?;
    let ports = Ports {
        directory: &ports_directory,
        can: None,
    };
    let text = rig.configuration(&ports);
    Target::new(config_path, Kind::Toml, args.replace.force, [])?.write(&text)?;
    let config = Config::load(config_path)?;
    let limit = Duration::from_secs_f64(rig.duration_s()) + 2 * MARGIN;
    println!("  {}, {:.0} s", rig.drive, rig.duration_s());

    let stop = Arc::new(AtomicBool::new(false));
    let told = Arc::clone(&stop);
    let driver = std::thread::Builder::new()
        .name("virtual".to_owned())
        .spawn(move || {
            std::thread::sleep(MARGIN);
            devices.drive(&mut rig, &told, &mut |_| Ok(()))?;
            // The ports stay until the recorder is done with them.
            while !told.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(10));
            }
            anyhow::Ok(devices.sent())
        })
        .context("cannot start the virtual vehicle's thread")?;
    let summary = record::block_on(config, None, Some(limit));
    stop.store(true, Ordering::Relaxed);
    let sent = driver
        .join()
        .map_err(|_| anyhow::anyhow!("the virtual vehicle ended with a panic"))??;
    Ok((summary?, sent))
}

fn replay_args(files: &[PathBuf]) -> ReplayArgs {
    ReplayArgs {
        logs: files.to_vec(),
        output: None,
        replace: Replace::default(),
        config: None,
        rate: None,
        changes: ReplayChanges::default(),
        smooth: false,
        verify: true,
        json: false,
    }
}
