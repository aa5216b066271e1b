//! `atvrec record`: record the configured sources.

use std::fmt::Write as _;
use std::io::IsTerminal;
use std::time::Duration;

use anyhow::Context;
use engine::Config;
use sample::LossPlace;
use sample::text::printable;
use tokio::signal::unix::{SignalKind, signal};

use crate::cli::RecordArgs;
use crate::control;
use crate::exit::Outcome;
use crate::pipeline::{self, Extras, Summary};

/// Runs the command.
pub fn run(args: &RecordArgs, quiet: bool) -> anyhow::Result<Outcome> {
    let with_directory = |mut config: Config| {
        if let Some(directory) = &args.directory {
            config.storage.directory.clone_from(directory);
        }
        config
    };
    let reload = || Ok(with_directory(Config::load_again(&args.config)?));
    let limit = args.duration_s.map(Duration::from_secs_f64);
    let config = Config::load(&args.config)?;
    let extras = Extras {
        reload: Some(&reload),
        // Commands without --directory find the recorder too.
        also_found_at: match &args.directory {
            Some(_) => control::paths(&config),
            None => Vec::new(),
        },
        clock_state: args.clock_state.clone(),
        shows_line: !quiet && std::io::stderr().is_terminal(),
        ..Extras::default()
    };
    let config = with_directory(config);
    super::require_sources(&args.config, &config)?;
    for warning in config.warnings() {
        tracing::warn!("{warning}");
    }
    super::tell_scope(&config);
    let extras = Extras {
        also_found_at: match control::paths(&config) == extras.also_found_at {
            true => Vec::new(),
            false => extras.also_found_at,
        },
        ..extras
    };
    let summary = block_on(config, extras, limit)?;
    if args.json {
        println!("{:#}", as_json(&summary));
    } else {
        print!("{}", as_text(&summary));
    }
    Ok(outcome(&summary))
}

/// Records with `config` until SIGINT, SIGTERM or the end of `limit`. At SIGHUP, the configuration is
/// read again.
pub fn block_on(
    config: Config,
    extras: Extras<'_>,
    limit: Option<Duration>,
) -> anyhow::Result<Summary> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .thread_name("sources")
        .enable_all()
        .build()
        .context("cannot start the threads of the sources")?;
    runtime.block_on(async {
        let mut interrupt = signal(SignalKind::interrupt())?;
        let mut terminate = signal(SignalKind::terminate())?;
        let stop = async {
            tokio::select! {
                _ = interrupt.recv() => tracing::info!("received SIGINT, stopping"),
                _ = terminate.recv() => tracing::info!("received SIGTERM, stopping"),
                () = after(limit) => {}
            }
        };
        pipeline::record(config, extras, stop).await
    })
}

async fn after(limit: Option<Duration>) {
    match limit {
        Some(limit) => tokio::time::sleep(limit).await,
        None => std::future::pending().await,
    }
}

/// Outcome of a recording: whether data was lost, or of no use.
pub fn outcome(summary: &Summary) -> Outcome {
    if summary.has_loss() || !summary.useless().is_empty() {
        Outcome::DataLoss
    } else {
        Outcome::Good
    }
}

/// Summary as text.
pub fn as_text(summary: &Summary) -> String {
    let mut text = String::new();
    let _ = writeln!(
        text,
        "recorded {:.1} s, {} arrivals",
        summary.duration_s, summary.arrivals
    );
    let _ = writeln!(
        text,
        "  {:<14}{:>12}{:>12}{:>10}{:>8}{:>8}",
        "source", "messages", "bytes", "checksum", "gaps", "lost"
    );
    for source in &summary.health.sources {
        let state = match (source.bytes, source.silent) {
            (0, _) => "  nothing received",
            (_, true) => "  silent at the end",
            _ => "",
        };
        let _ = writeln!(
            text,
            "  {:<14}{:>12}{:>12}{:>10}{:>8}{:>8}{state}",
            source.name,
            source.messages,
            source.bytes,
            source.checksum_errors,
            source.gaps,
            source.lost.iter().sum::<u64>(),
        );
    }
    for source in &summary.health.sources {
        if source.late + source.too_late > 0 {
            let _ = writeln!(
                text,
                "  {}: {} messages were 5 to 100 ms late and used at their own time, {} later and not used",
                source.name, source.late, source.too_late
            );
        }
    }
    for name in &summary.health.faulty_sensors {
        let _ = writeln!(
            text,
            "  excluded by the estimator at the end: {}",
            printable(name)
        );
    }
    write_losses(&mut text, summary);
    for file in &summary.files {
        let _ = writeln!(text, "  {}", printable(&file.to_string_lossy()));
    }
    write_undecoded(&mut text, summary);
    let useless = summary.useless();
    if !useless.is_empty() {
        let _ = writeln!(text, "{}", printable(&useless.join("; ")));
    }
    text
}

/// Messages that the decoders know by name and do not decode.
fn write_undecoded(text: &mut String, summary: &Summary) {
    for source in &summary.health.sources {
        let names = source.undecoded.iter();
        let names: Vec<String> = names.map(|m| format!("{} {}", m.name, m.count)).collect();
        if !names.is_empty() {
            let _ = writeln!(text, "  {}: not decoded: {}", source.name, names.join(", "));
        }
    }
}

/// Losses, and logs that were deleted, renamed or not closed.
fn write_losses(text: &mut String, summary: &Summary) {
    for (place, count) in LossPlace::ALL.into_iter().zip(summary.lost()) {
        if count > 0 {
            let _ = writeln!(text, "  lost in {}: {count}", place.name());
        }
    }
    if summary.losses.records > 0 {
        let _ = writeln!(
            text,
            "  {} decoded records were not written; `atvrec replay` computes them again",
            summary.losses.records
        );
    }
    if let Some(left) = summary.left {
        let _ = writeln!(
            text,
            "  the estimator was behind at the stop: the log has no results of the last {:.1} s; \
             `atvrec replay -o` computes them",
            left.span_s
        );
    }
    for gone in &summary.recorder.gone {
        let what = if gone.deleted { "deleted" } else { "renamed" };
        let _ = writeln!(
            text,
            "  {} was {what} while it was being written: {} arrivals lost",
            gone.path.display(),
            gone.arrivals
        );
    }
    if let Some(reason) = &summary.recorder.cut_off {
        let _ = writeln!(text, "  the logs were not closed in time: {reason}");
    }
    for file in &summary.recorder.unfinished {
        let _ = writeln!(
            text,
            "  {} is unfinished; the next start recovers it",
            file.display()
        );
    }
}

fn as_json(summary: &Summary) -> serde_json::Value {
    let lost: serde_json::Map<_, _> = LossPlace::ALL
        .into_iter()
        .zip(summary.lost())
        .map(|(place, count)| (place.name().to_owned(), count.into()))
        .collect();
    serde_json::json!({
        "duration_s": summary.duration_s,
        "arrivals": summary.arrivals,
        "files": summary.files,
        "lost": lost,
        "lost_records": summary.losses.records,
        "gone": summary.recorder.gone.iter().map(control::gone_log).collect::<Vec<_>>(),
        "without_results_s": summary.left.map(|left| left.span_s),
        "cut_off": summary.recorder.cut_off,
        "unfinished": summary.recorder.unfinished,
        "stuck": summary.stuck,
        "useless": summary.useless(),
        "sources": summary.health.sources,
        "faulty_sensors": summary.health.faulty_sensors,
    })
}
