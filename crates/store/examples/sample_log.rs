//! Writes a short log with every kind of channel, for trying readers on.
//!
//! `cargo run -p atvrec-store --example sample_log -- /tmp/sample.mcap`

#![allow(clippy::disallowed_methods, reason = "it takes arguments")]

#[path = "../tests/common/mod.rs"]
mod common;

use atvrec_store::{Options, Record, Writer};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args_os()
        .nth(1)
        .ok_or("usage: sample_log LOG.mcap")?;
    let mut writer = Writer::create(path.as_ref(), common::session(), Options::default(), 0)?;
    for arrival in common::arrivals(1, 2_000) {
        let time = arrival.log_time;
        if arrival.sequence % 100 == 0 {
            for record in common::records(time) {
                writer.record(&record);
            }
        }
        if arrival.sequence % 10 == 0 {
            writer.record(&Record::Estimate(common::estimate(time)));
        }
        writer.push(arrival)?;
    }
    let finished = writer.finish()?;
    println!("{} ({} bytes)", finished.path.display(), finished.bytes);
    Ok(())
}
