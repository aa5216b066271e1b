//! `atvrec events`: list the events of a log, and write the time around each.

use std::path::{Path, PathBuf};

use anyhow::Context;
use engine::Excerpt;
use engine::output::{Kind, Target};
use report::AROUND_S;
use sample::text::printable;
use sample::{Event, LogTime};
use serde_json::{Value, json};
use store::Reader;

use crate::cli::EventsArgs;
use crate::exit::Outcome;
use crate::interrupt::Interrupt;

/// Runs the command.
pub fn run(args: &EventsArgs) -> anyhow::Result<Outcome> {
    let reader = Reader::open(&args.logs)?;
    let events = report::events(&reader)?;
    let start = reader.info().span.unwrap_or_default().0;
    if let Some(directory) = &args.snapshot {
        let interrupt = Interrupt::listen()?;
        std::fs::create_dir_all(directory)
            .with_context(|| format!("cannot create the directory {}", directory.display()))?;
        for (index, event) in events.iter().enumerate() {
            interrupt.check()?;
            let snapshot = Snapshot {
                reader: &reader,
                event,
                number: index + 1,
                start,
            };
            let path = snapshot.write(args, directory)?;
            if !args.json {
                println!("{}", path.display());
            }
        }
    }
    let rows = events.iter().enumerate();
    let rows: Vec<Value> = rows
        .map(|(index, event)| row(index + 1, event, start))
        .collect();
    if args.json {
        println!("{:#}", json!({ "events": rows }));
    } else if args.snapshot.is_none() {
        println!("{:>6}{:>11}  {:<24}text", "number", "at s", "kind");
        for (index, event) in events.iter().enumerate() {
            println!(
                "{:>6}{:>11.2}  {:<24}{}",
                index + 1,
                event.time.seconds_since(start),
                event.kind.name(),
                printable(&event.text)
            );
        }
    }
    Ok(Outcome::Good)
}

fn row(number: usize, event: &Event, start: LogTime) -> Value {
    json!({
        "number": number,
        "at_s": event.time.seconds_since(start),
        "onset_s": event.onset.seconds_since(start),
        "kind": event.kind.name(),
        "probability": event.probability,
        "text": event.text,
    })
}

/// The time around an event.
struct Snapshot<'a> {
    reader: &'a Reader,
    event: &'a Event,
    number: usize,
    start: LogTime,
}

impl Snapshot<'_> {
    /// Writes a log and a file with the values, and returns the path of the log.
    fn write(&self, args: &EventsArgs, directory: &Path) -> anyhow::Result<PathBuf> {
        let name = format!("event-{}-{}", self.number, self.event.kind.name());
        let log = directory.join(format!("{name}.mcap"));
        let inputs = || args.logs.iter().map(|log| &**log);
        let force = args.replace.force;
        let target = Target::new(&log, Kind::Log, force, inputs())?;
        let values = directory.join(format!("{name}.json"));
        let values = Target::new(&values, Kind::Any, force, inputs())?;
        self.write_log(&target)?;
        let numbers = self.numbers(&args.logs)?;
        values.write(&format!("{numbers:#}\n"))?;
        Ok(log)
    }

    fn span(&self) -> [LogTime; 2] {
        [-AROUND_S, AROUND_S].map(|offset_s| self.event.time.offset_seconds(offset_s))
    }

    /// The raw data and the estimates of the log, as they are.
    fn write_log(&self, target: &Target) -> anyhow::Result<()> {
        let [from, to] = self.span();
        let excerpt = Excerpt::new(self.reader, from, to)?;
        let mut log = target.log(excerpt.session().clone(), excerpt.log_options().clone())?;
        excerpt.copy_to(&mut log, |_| Ok::<_, engine::Error>(()))?;
        log.finish()?;
        Ok(())
    }

    /// The event, and the numbers of the report of its time.
    fn numbers(&self, logs: &[PathBuf]) -> anyhow::Result<Value> {
        let [from_s, to_s] = self.span().map(|time| time.seconds_since(self.start));
        let options = report::Options {
            from_s: Some(from_s),
            to_s: Some(to_s),
            ..report::Options::default()
        };
        let found = report::report(logs, &options, "", &mut |_| Ok(()))?;
        Ok(json!({
            "event": row(self.number, self.event, self.start),
            "numbers": found.numbers,
        }))
    }
}
