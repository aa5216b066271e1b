//! `atvrec identify latency`: latencies of messages that the configuration does not know.

use engine::{describe_latency, find_latencies, latencies_as_json, with_latencies};
use sample::text::printable;

use super::judged;
use crate::cli::IdentifyLatencyArgs;
use crate::exit::Outcome;

/// Runs the command.
pub fn run(args: &IdentifyLatencyArgs) -> anyhow::Result<Outcome> {
    let (target, reader, config) = judged(&args.run, args.output.as_deref())?;
    let found = find_latencies(&reader, &config)?;
    if let Some(target) = target {
        target.write(&with_latencies(config.text()?, &found)?)?;
    }
    if args.run.json {
        println!("{:#}", latencies_as_json(&found));
    } else {
        for one in &found {
            let rest = if one.is_found {
                ""
            } else {
                "; the drive tells too little of it"
            };
            println!("{}{rest}", printable(&describe_latency(one)));
        }
        println!("to decide more: slalom for a minute, or rough ground");
        if let Some(output) = &args.output {
            println!("wrote {}", output.display());
        }
    }
    let is_any = found.iter().any(|one| one.is_found);
    Ok(if is_any {
        Outcome::Good
    } else {
        Outcome::Failed
    })
}
