//! `atvrec identify mistakes`: what in the configuration contradicts a drive.

use std::fmt::Write as _;
use std::path::Path;

use engine::{find_mistakes, mistakes_as_json};
use estimator::mistakes::Described;
use estimator::{Calibration, MistakeReport, ParameterErrors};
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
    Ok(if report.is_clean() {
        Outcome::Good
    } else {
        Outcome::Failed
    })
}

/// Text of the corrected calibration, with what it cannot contain as comments.
fn calibration(report: &MistakeReport, mut corrected: Calibration) -> anyhow::Result<String> {
    let mut text = String::from("# Result of `atvrec identify mistakes`.\n");
    let units = report.units.iter().map(|(_, unit)| unit.describe());
    let found = report.found.iter().map(|(_, words)| words.clone());
    for words in units.chain(found) {
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
    for (_, unit) in &report.units {
        print_mistake(&unit.describe());
    }
    for (found, words) in &report.found {
        print_mistake(words);
        println!(
            "    logarithm of the ratio of likelihoods: {:.0}",
            found.judged.ratio
        );
    }
    let count = report.found.len() + report.units.len();
    println!(
        "{count} mistake{} found; {:.0} s of driving were used{}",
        if count == 1 { "" } else { "s" },
        report.driven.used_s,
        if report.is_clean() {
            ""
        } else {
            " after the last correction"
        }
    );
    if report.found.iter().all(|(found, _)| found.corrected) {
        print_undecided(report);
    } else {
        println!("the search ended with a mistake that the estimator cannot correct");
    }
    println!("{}", parameters(&report.parameters));
    if let Some(output) = output {
        println!("wrote {}", output.display());
    }
}

/// What is likely without proof, and what would decide.
fn print_undecided(report: &MistakeReport) {
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
}

fn print_mistake(words: &Described) {
    println!("mistake: {}", printable(&words.subject));
    println!("    likely cause: {}", printable(&words.cause));
    println!("    next step: {}", printable(&words.remedy));
}

/// What the drive says of the errors of the parameters within their tolerances.
fn parameters(errors: &ParameterErrors) -> String {
    let factor = errors.factor;
    if errors.are_stated {
        format!(
            "parameters: errors of about {factor:.1} times the tolerances that the files state; the standard \
             deviations of the forces contain them from the start"
        )
    } else if let Some(since_s) = errors.since_s {
        format!(
            "parameters: the readings contradict exact ones, as errors of about {factor:.1} times the tolerances of a careful workshop do; the standard \
             deviations of the forces contain them from {since_s:.1} s on; give the vehicle file and the sensors file a \
             table [tolerances], so that they contain them from the start"
        )
    } else {
        "parameters: the readings agree with exact parameters".to_owned()
    }
}
