//! `atvrec identify mistakes`: what in the configuration contradicts a drive.

use std::fmt::Write as _;
use std::path::Path;

use engine::output::{Kind, Target};
use engine::{Config, Error, Replay, ReplayOptions};
use estimator::{Calibration, MistakeReport};
use sample::text::printable;
use serde_json::json;
use store::Reader;

use crate::cli::IdentifyMistakesArgs;
use crate::exit::Outcome;

/// Runs the command.
pub fn run(args: &IdentifyMistakesArgs) -> anyhow::Result<Outcome> {
    let target = args
        .output
        .as_ref()
        .map(|path| {
            let inputs = args.logs.iter().chain(&args.config).map(|path| &**path);
            Target::new(path, Kind::Toml, args.replace.force, inputs)
        })
        .transpose()?;
    let reader = Reader::open(&args.logs)?;
    let config = match &args.config {
        Some(path) => Config::load(path)?,
        None => Config::from_attachments(&reader.attachments()?)?,
    };
    let estimator = config.estimator.as_ref().ok_or(Error::NoVehicleToJudge)?;
    let options = ReplayOptions {
        without_records: true,
        ..ReplayOptions::default()
    };
    let done = Replay::new(&reader, &config, options)?.run(|_| Ok::<_, Error>(()))?;
    let Some(report) = done.mistakes else {
        anyhow::bail!(
            "the vehicle {} has no linkages in its vehicle file, so that forces cannot be compared; use \
             `atvrec check --with LOG`",
            estimator.vehicle.name
        );
    };
    if let Some(target) = target {
        let text = calibration(&report, &estimator.calibration)?;
        target.write(&text)?;
    }
    if args.json {
        println!("{:#}", as_json(&report));
    } else {
        print(&report, args.output.as_deref());
    }
    Ok(if report.found.is_empty() {
        Outcome::Good
    } else {
        Outcome::Failed
    })
}

/// Text of the corrected calibration, with what it cannot contain as comments.
fn calibration(report: &MistakeReport, known: &Calibration) -> anyhow::Result<String> {
    let mut text = String::from("# Result of `atvrec identify mistakes`.\n");
    for (_, words) in &report.found {
        writeln!(
            text,
            "# {}: {}; {}",
            words.subject, words.cause, words.remedy
        )?;
    }
    if let Some(load) = &report.payload {
        writeln!(text, "# To add to the vehicle file:")?;
        writeln!(
            text,
            "# [[payload]]\n# name = \"load\"\n# mass_kg = {:.1}",
            load.mass_kg
        )?;
        let [x, y, z] = load.position_m;
        writeln!(text, "# position_m = [{x:.3}, {y:.3}, {z:.3}]")?;
    }
    let mut corrected = known.clone();
    report.changes.apply(&mut corrected);
    text.push_str(&toml::to_string_pretty(&corrected)?);
    Ok(text)
}

fn print(report: &MistakeReport, output: Option<&Path>) {
    for (found, words) in &report.found {
        println!("mistake: {}", printable(&words.subject));
        println!("    likely cause: {}", printable(&words.cause));
        println!("    next step: {}", printable(&words.remedy));
        println!(
            "    logarithm of the ratio of likelihoods: {:.0}",
            found.judged.ratio
        );
    }
    println!(
        "{} mistakes found; {:.0} s of driving were used{}",
        report.found.len(),
        report.used_s,
        if report.found.is_empty() {
            ""
        } else {
            " after the last correction"
        }
    );
    if let Some((words, ratio)) = report.likeliest.as_ref().filter(|(_, ratio)| *ratio > 0.0) {
        println!(
            "likeliest beside: {}: {} (logarithm of the ratio {ratio:.1}: not proved)",
            printable(&words.subject),
            printable(&words.cause)
        );
    }
    println!("to decide more: {}", report.manoeuvre());
    if let Some(output) = output {
        println!("wrote {}", output.display());
    }
}

fn as_json(report: &MistakeReport) -> serde_json::Value {
    let found = report.found.iter().map(|(found, words)| {
        json!({
            "time_ns": found.time.0,
            "subject": words.subject,
            "cause": words.cause,
            "help": words.remedy,
            "log_likelihood_ratio": found.judged.ratio,
            "corrected": found.corrected,
        })
    });
    let likeliest = report.likeliest.as_ref().map(|(words, ratio)| {
        json!({ "subject": words.subject, "cause": words.cause, "log_likelihood_ratio": ratio })
    });
    json!({
        "found": found.collect::<Vec<_>>(),
        "likeliest": likeliest,
        "used_s": report.used_s,
        "manoeuvre": report.manoeuvre(),
    })
}
