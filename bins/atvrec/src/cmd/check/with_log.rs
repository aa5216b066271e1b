//! `atvrec check --with`: a configuration against a log.

use engine::{Config, Judgement, judge_log};
use sample::text::printable;
use serde_json::json;
use store::Reader;

use crate::cli::CheckArgs;
use crate::exit::Outcome;

/// Compares the configuration with the log.
pub fn run(args: &CheckArgs, config: &Config) -> anyhow::Result<Outcome> {
    let reader = Reader::open(&args.with_log)?;
    let judgement = judge_log(&reader, config)?;
    if args.json {
        println!("{:#}", as_json(&judgement));
    } else {
        let logs: Vec<String> = args
            .with_log
            .iter()
            .map(|log| log.display().to_string())
            .collect();
        println!("{} with {}", args.path().display(), logs.join(", "));
        print(&judgement);
    }
    Ok(match judgement.misfits.is_empty() {
        true => Outcome::Good,
        false => Outcome::Failed,
    })
}

fn print(judgement: &Judgement) {
    for misfit in &judgement.misfits {
        println!("does not fit: {}", printable(&misfit.subject));
        println!("    found: {}", printable(&misfit.found));
        println!("    likely cause: {}", printable(&misfit.cause));
        println!("    next step: {}", printable(&misfit.remedy));
    }
    for undecided in &judgement.undecided {
        println!("not decided: {}", printable(&undecided.subject));
        println!(
            "    manoeuvre that decides: {}",
            printable(&undecided.manoeuvre)
        );
    }
    for fits in &judgement.fits {
        println!("fits: {}", printable(fits));
    }
    for message in &judgement.without_role {
        println!("without a role: {}", printable(message));
    }
    println!(
        "{} misfits, {} not decided, {} fit",
        judgement.misfits.len(),
        judgement.undecided.len(),
        judgement.fits.len()
    );
}

fn as_json(judgement: &Judgement) -> serde_json::Value {
    let misfits = judgement.misfits.iter().map(|misfit| {
        json!({
            "subject": misfit.subject,
            "found": misfit.found,
            "cause": misfit.cause,
            "help": misfit.remedy,
        })
    });
    let undecided = judgement
        .undecided
        .iter()
        .map(|undecided| json!({ "subject": undecided.subject, "manoeuvre": undecided.manoeuvre }));
    json!({
        "errors": [],
        "misfits": misfits.collect::<Vec<_>>(),
        "undecided": undecided.collect::<Vec<_>>(),
        "fits": judgement.fits,
        "without_role": judgement.without_role,
    })
}
