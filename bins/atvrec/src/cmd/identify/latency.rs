//! `atvrec identify latency`: latencies of messages that the configuration does not know.

use engine::output::{Kind, Target};
use engine::{Config, describe_latency, find_latencies, latencies_as_json, with_latencies};
use sample::text::printable;
use store::Reader;

use crate::cli::IdentifyLatencyArgs;
use crate::exit::Outcome;

/// Runs the command.
pub fn run(args: &IdentifyLatencyArgs) -> anyhow::Result<Outcome> {
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
    let found = find_latencies(&reader, &config)?;
    if let Some(target) = target {
        target.write(&with_latencies(config.text()?, &found)?)?;
    }
    if args.json {
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
