//! `atvrec demo`: the complete chain without hardware and without privileges.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::Context;
use engine::{Config, Ports, VirtualDrive};
use sample::ForceFrame;
use store::{Reader, Stage};

use super::{record, replay};
use crate::cli::{DemoArgs, DriveArgs, Replace, ReplayArgs, ReplayChanges};
use crate::devices::{Devices, Sent, Stalls, TruthSink};
use crate::exit::Outcome;
use crate::pipeline::{Extras, Summary};
use engine::output::{Kind, Target};

/// Default directory.
const DIRECTORY: &str = "atvrec-demo";
/// Files in the directory beside ports and logs.
const CONFIGURATION: &str = "atvrec.toml";
const PAGE: &str = "report.html";

/// Time in which the estimator converges, s; not part of the accuracy.
const CONVERGED_S: f64 = 2.0;
/// Most records of the truth that wait for the recorder.
const TRUTH_QUEUE: usize = 1_024;
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
    let driven = drive_and_record(args, &directory, &config_path)?;
    let summary = &driven.summary;
    for sent in &driven.sent {
        println!("  {sent}");
    }
    print!("{}", record::as_text(summary));
    if let Some(text) = stall_text(driven.stalls) {
        println!("  {text}");
    }

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
    println!("{}", accuracy(summary)?);
    println!("{}", verdict(&driven, &verified));
    println!("report: {}", page.display());
    Ok(match verified {
        Outcome::Good => record::outcome(summary),
        other => other,
    })
}

/// What was driven and recorded.
struct Driven {
    summary: Summary,
    sent: Vec<Sent>,
    stalls: Stalls,
}

fn stall_text(stalls: Stalls) -> Option<String> {
    (stalls.count > 0).then(|| {
        format!(
            "the machine stalled {} times, for up to {:.0} ms: other programs took the processor, and \
             the sensors' data came late",
            stalls.count,
            stalls.longest.as_secs_f64() * 1e3
        )
    })
}

/// Errors of the forces against the truth in one line.
fn accuracy(summary: &Summary) -> anyhow::Result<String> {
    let reader = Reader::open(&summary.files)?;
    let score = match report::score::score(&reader, Stage::Estimate, CONVERGED_S) {
        Ok(score) => score,
        // A drive that ends before the estimator has converged.
        Err(error) => return Ok(format!("accuracy: {error}")),
    };
    let carrier = score.forces.iter().find(|forces| {
        forces.output == Stage::Estimate.name() && forces.frame == ForceFrame::WheelCarrier
    });
    let percent = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.1}"));
    let [x, y, z] = carrier
        .map_or([None; 3], |forces| forces.worst_percent)
        .map(percent);
    Ok(format!(
        "accuracy: root mean square errors of F_x {x}, F_y {y}, F_z {z} % of the larger of peak force \
         and static load (worst wheel, wheel-carrier frame)"
    ))
}

fn verdict(driven: &Driven, verified: &Outcome) -> String {
    let summary = &driven.summary;
    let mut problems = Vec::new();
    if summary.has_loss() {
        problems.push("data was lost".to_owned());
    }
    if !matches!(verified, Outcome::Good) {
        problems.push("the replay differs from the recording".to_owned());
    }
    let faulty = &summary.health.faulty_sensors;
    if !faulty.is_empty() {
        problems.push(format!("excluded sensors: {}", faulty.join(", ")));
    }
    match (problems.is_empty(), driven.stalls.count) {
        (true, 0) => "verdict: good; no data was lost, and the replay is identical".to_owned(),
        (true, _) => {
            "verdict: good; no data was lost, and the replay is identical, although the machine \
             stalled"
                .to_owned()
        }
        (false, _) => format!("verdict: not good; {}", problems.join("; ")),
    }
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
) -> anyhow::Result<Driven> {
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
    println!("  compute the drive");
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

    let _live = live_page(args, &config)?;
    let stop = Arc::new(AtomicBool::new(false));
    let stopped = Arc::clone(&stop);
    let (clock, clock_set) = std::sync::mpsc::channel();
    let (queue, truth) = tokio::sync::mpsc::channel(TRUTH_QUEUE);
    let driver = std::thread::Builder::new()
        .name("virtual".to_owned())
        .spawn(move || {
            let sink = clock_set
                .recv()
                .ok()
                .map(|clock| TruthSink::new(clock, queue));
            std::thread::sleep(MARGIN);
            let stalls = devices.drive(&mut simulated, &stopped, &mut |_| Ok(()), sink)?;
            // The ports are kept until the recorder has closed them.
            while !stopped.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(10));
            }
            anyhow::Ok((devices.sent(), stalls))
        })
        .context("cannot start the thread of the virtual vehicle")?;
    let extras = Extras {
        truth: Some(truth),
        clock: Some(clock),
        ..Extras::default()
    };
    let summary = record::block_on(config, extras, Some(limit));
    stop.store(true, Ordering::Relaxed);
    let (sent, stalls) = driver.join().map_err(|_| {
        anyhow::anyhow!("the virtual vehicle panicked; its message is printed above")
    })??;
    Ok(Driven {
        summary: summary?,
        sent,
        stalls,
    })
}

/// Serves the live page while the returned runtime exists.
#[cfg(feature = "live")]
fn live_page(args: &DemoArgs, config: &Config) -> anyhow::Result<Option<tokio::runtime::Runtime>> {
    if args.no_live {
        return Ok(None);
    }
    let token = live::random_token().context("cannot make a token")?;
    let runtime = super::live::runtime()?;
    match runtime.block_on(super::live::beside(config, token.clone())) {
        Ok(address) => {
            let text = super::live::address_text(address, "http", Some(&token));
            println!("  {}", text.replace('\n', "\n  "));
        }
        Err(error) => println!("  there is no live page: {error:#}"),
    }
    Ok(Some(runtime))
}

#[cfg(not(feature = "live"))]
#[allow(clippy::unnecessary_wraps, reason = "as with the feature")]
fn live_page(_: &DemoArgs, _: &Config) -> anyhow::Result<()> {
    Ok(())
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
        #[cfg(feature = "live")]
        token_file: None,
        json: false,
    }
}
