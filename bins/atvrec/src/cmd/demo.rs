//! `atvrec demo`: the whole chain without hardware and without privileges.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::Context;

use super::{record, replay};
use crate::cli::{DemoArgs, DriveArgs, ReplayArgs, ReplayChanges};
use crate::config::Config;
use crate::devices::{Devices, Sent};
use crate::exit::Outcome;
use crate::pipeline::Summary;
use crate::rig::{Ports, Rig};

/// The recording begins before the drive and ends after it by this much.
const MARGIN: Duration = Duration::from_millis(300);

/// Drives, records, replays and reports.
pub fn run(args: &DemoArgs, quiet: bool) -> anyhow::Result<Outcome> {
    let begin = Instant::now();
    std::fs::create_dir_all(&args.directory)
        .with_context(|| format!("cannot make the directory {}", args.directory.display()))?;
    let directory = args
        .directory
        .canonicalize()
        .with_context(|| format!("cannot find {}", args.directory.display()))?;
    let config_path = directory.join("atvrec.toml");

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
    let page = directory.join("report.html");
    super::report::write(&summary.files, &page)?;

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
    let mut rig = Rig::new(&drive)?;
    let ports_directory = directory.join("ports");
    let mut devices = Devices::new(&ports_directory, true)?;
    let ports = Ports {
        directory: &ports_directory,
        can: None,
    };
    let text = rig.configuration(&ports);
    std::fs::write(config_path, &text)
        .with_context(|| format!("cannot write {}", config_path.display()))?;
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
        config: None,
        rate: None,
        changes: ReplayChanges::default(),
        smooth: false,
        verify: true,
        json: false,
    }
}
