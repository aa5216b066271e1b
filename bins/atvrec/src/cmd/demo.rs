//! `atvrec demo`: the complete chain without hardware and without privileges.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::Context;
use engine::{Config, Ports, VirtualDrive};

use super::{record, replay};
use crate::cli::{DemoArgs, DriveArgs, Replace, ReplayArgs, ReplayChanges};
use crate::devices::{Devices, Sent};
use crate::exit::Outcome;
use crate::pipeline::{Extras, Summary};
use engine::output::{Kind, Target};

/// Default directory.
const DIRECTORY: &str = "atvrec-demo";
/// Files in the directory beside ports and logs.
const CONFIGURATION: &str = "atvrec.toml";
const PAGE: &str = "report.html";

/// Time for which the recording begins before the drive and ends after it.
const MARGIN: Duration = Duration::from_millis(300);

/// Runs the command.
pub fn run(args: &DemoArgs, quiet: bool) -> anyhow::Result<Outcome> {
    let begin = Instant::now();
    let chosen = directory(args)?;
    std::fs::create_dir_all(&chosen)
        .with_context(|| format!("cannot create the directory {}", chosen.display()))?;
    let directory = chosen
        .canonicalize()
        .with_context(|| format!("cannot resolve the path {}", chosen.display()))?;
    let config_path = directory.join(CONFIGURATION);

    step(
        1,
        "record a virtual vehicle on pseudo-terminals and SLCAN in real time",
    );
    let (summary, sent) = drive_and_record(args, &directory, &config_path)?;
    for sent in &sent {
        println!("  {sent}");
    }
    print!("{}", record::as_text(&summary));

    step(2, "repeat the estimate from the raw data and compare");
    let verified = replay::run(&replay_args(&summary.files), quiet)?;

    step(3, "write the report");
    let page = directory.join(PAGE);
    super::report::write(&summary.files, &page, args.replace.force)?;

    println!(
        "\nFinished in {:.0} s. All files are in {}:",
        begin.elapsed().as_secs_f64(),
        directory.display()
    );
    println!("  {:<44} configuration", config_path.display());
    for file in &summary.files {
        println!(
            "  {:<44} log: open it in Foxglove, PlotJuggler or Rerun",
            file.display()
        );
    }
    println!("  {:<44} report: open it in a browser", page.display());
    Ok(match verified {
        Outcome::Good => record::outcome(&summary),
        other => other,
    })
}

/// Directory of the command line, or the first default directory without a demonstration.
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
        .context("every directory atvrec-demo-N is used; choose another one with --directory")?;
    if name != DIRECTORY {
        println!("{DIRECTORY} contains an earlier demonstration; the new one is in {name}");
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
        road: None,
        vehicle: "prowler".to_owned(),
        sensors: "thesis-10bit".to_owned(),
        payload: Vec::new(),
        seed: args.seed,
        options: None,
        duration_s: Some(args.duration_s),
    };
    let mut simulated = VirtualDrive::new(&drive.as_drive()?)?;
    let ports_directory = directory.join("ports");
    let mut devices = Devices::new(&ports_directory, true)?;
    let ports = Ports {
        directory: &ports_directory,
        can: None,
    };
    let text = simulated.configuration(&ports);
    Target::new(config_path, Kind::Toml, args.replace.force, [])?.write(&text)?;
    let config = Config::load(config_path)?;
    let limit = Duration::from_secs_f64(simulated.duration_s()) + 2 * MARGIN;
    println!("  {}, {:.0} s", simulated.drive, simulated.duration_s());

    let stop = Arc::new(AtomicBool::new(false));
    let stopped = Arc::clone(&stop);
    let driver = std::thread::Builder::new()
        .name("virtual".to_owned())
        .spawn(move || {
            std::thread::sleep(MARGIN);
            devices.drive(&mut simulated, &stopped, &mut |_| Ok(()))?;
            // The ports are kept until the recorder has closed them.
            while !stopped.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(10));
            }
            anyhow::Ok(devices.sent())
        })
        .context("cannot start the thread of the virtual vehicle")?;
    let summary = record::block_on(config, Extras::default(), Some(limit));
    stop.store(true, Ordering::Relaxed);
    let sent = driver.join().map_err(|_| {
        anyhow::anyhow!("the virtual vehicle panicked; its message is printed above")
    })??;
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
        #[cfg(feature = "live")]
        live: false,
        #[cfg(feature = "live")]
        listen: None,
        json: false,
    }
}
