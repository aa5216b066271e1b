//! Reads several topics of a log into columns, beside a plain loop that decodes the same.
//!
//! usage: `reading tables|loop LOG TOPIC...`: once by `Reader::tables`, or by the `mcap` crate with
//! prost and one vector for each field;
//! `reading stretch LOG HOURS OUTPUT`: writes the messages of a log again and again, until they have
//! so many hours; `reading topics COUNT OUTPUT`: writes a log of so many topics.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    reason = "it takes arguments and measures"
)]

mod plain;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::BufWriter;
use std::path::Path;
use std::time::Instant;

use anyhow::{Context, bail, ensure};
use mcap::records::MessageHeader;
use sample::LogTime;
use store::Reader;

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let texts: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match texts.as_slice() {
        ["tables", log, topics @ ..] => tables(log, topics),
        ["loop", log, topics @ ..] => {
            let begin = Instant::now();
            let rows = plain::read(Path::new(log), topics)?;
            print_row("plain loop", rows, begin);
            Ok(())
        }
        ["stretch", log, hours, output] => stretch(log, hours.parse()?, output),
        ["topics", count, output] => many_topics(count.parse()?, output),
        _ => bail!(
            "usage: reading tables|loop LOG TOPIC... | stretch LOG HOURS OUTPUT | topics COUNT OUTPUT"
        ),
    }
}

fn print_row(what: &str, rows: usize, begin: Instant) {
    println!(
        "{what:<20} {rows} messages in {:.3} s",
        begin.elapsed().as_secs_f64()
    );
}

/// No topics: all of them.
fn tables(log: &str, topics: &[&str]) -> anyhow::Result<()> {
    let begin = Instant::now();
    let reader = Reader::open([log])?;
    let mut topics: Vec<String> = topics.iter().map(|topic| (*topic).to_owned()).collect();
    if topics.is_empty() {
        topics = reader.info().channels.into_keys().collect();
    }
    let tables = reader.tables(&topics, LogTime(0), LogTime(u64::MAX))?;
    let rows = tables.iter().map(|table| table.log_time_ns.len()).sum();
    print_row("Reader::tables", rows, begin);
    Ok(())
}

fn stretch(log: &str, hours: f64, output: &str) -> anyhow::Result<()> {
    let data = std::fs::read(log)?;
    let summary = mcap::Summary::read(&data)?.context("the log has no summary")?;
    let statistics = summary.stats.context("the log has no statistics")?;
    let span = statistics.message_end_time - statistics.message_start_time + 10_000_000;
    let count = (hours * 3600e9 / span as f64).ceil() as u64;
    let file = BufWriter::new(std::fs::File::create(output)?);
    let mut writer = mcap::WriteOptions::new().profile("atvrec").create(file)?;
    for index in &summary.attachment_indexes {
        writer.attach(&mcap::read::attachment(&data, index)?)?;
    }
    for index in &summary.metadata_indexes {
        writer.write_metadata(&mcap::read::metadata(&data, index)?)?;
    }
    for turn in 0..count {
        for message in mcap::MessageStream::new(&data)? {
            let mut message = message?;
            message.log_time += turn * span;
            message.publish_time += turn * span;
            writer.write(&message)?;
        }
    }
    writer.finish()?;
    Ok(())
}

/// Each topic has a schema of its own with two numbers, as the messages of a DBC have.
fn many_topics(count: u16, output: &str) -> anyhow::Result<()> {
    const MESSAGES: u64 = 20;
    ensure!(count > 0, "the log needs a topic");
    let file = BufWriter::new(std::fs::File::create(output)?);
    let mut writer = mcap::Writer::new(file)?;
    let mut channels = Vec::new();
    for number in 0..count {
        let name = format!("Message{number}");
        let schema = plain::schema(&name);
        let schema = writer.add_schema(&format!("test.{name}"), "protobuf", &schema)?;
        let topic = format!("/can/can0/{name}");
        channels.push(writer.add_channel(schema, &topic, "protobuf", &BTreeMap::new())?);
    }
    for turn in 0..MESSAGES {
        for channel in &channels {
            let header = MessageHeader {
                channel_id: *channel,
                sequence: turn as u32,
                log_time: turn * 1_000_000,
                publish_time: turn * 1_000_000,
            };
            writer.write_to_known_channel(&header, &Cow::Owned(plain::message(turn)))?;
        }
    }
    writer.finish()?;
    Ok(())
}
