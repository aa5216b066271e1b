//! `atvrec identify mistakes`: what in the configuration contradicts a drive.

use std::fmt::Write as _;
use std::path::Path;

use engine::{find_mistakes, mistakes_as_json};
use estimator::{Calibration, MistakeReport};
use sample::text::printable;

use super::judged;
use crate::cli::IdentifyMistakesArgs;
use crate::exit::Outcome;

/// Runs the command.
pub fn run(args: &IdentifyMistakesArgs) -> anyhow::Result<Outcome> {
    let (target, reader, config) = judged(&args.run, args.output.as_deref())?;
    let report = find_mistakes(&reader, &config)?;
    if let Some(target) = target {
        let known = config
            .estimator
            .as_ref()
            .map(|estimator| &estimator.calibration);
        let text = calibration(&report, known.cloned().unwrap_or_default())?;
        target.write(&text)?;
    }
    if args.run.json {
        println!("{:#}", mistakes_as_json(&report));
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
fn calibration(report: &MistakeReport, mut corrected: Calibration) -> anyhow::Result<String> {
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
        report.driven.used_s,
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
    if !report.is_decisive || report.is_suspected {
        println!("not decided; manoeuvre that decides: {}", report.manoeuvre);
    }
    if let Some(output) = output {
        println!("wrote {}", output.display());
    }
}
