//! Raw messages inside of a sound log: the first byte chooses the schema, the rest is the message.
#![no_main]

use std::collections::BTreeMap;
use std::io::Cursor;

use atvrec_fuzz::{as_file, read_all};
use libfuzzer_sys::fuzz_target;
use mcap::records::MessageHeader;

const SCHEMAS: [(&str, &str); 4] = [
    ("atvrec.RawBytes", "/raw/imu"),
    ("atvrec.RawCan", "/raw/can0"),
    ("atvrec.RawTicks", "/clock"),
    ("atvrec.RawNotices", "/notice"),
];

fn log(data: &[u8]) -> mcap::McapResult<Vec<u8>> {
    let (choice, message) = data.split_at(data.len().min(1));
    let choice = usize::from(choice.first().copied().unwrap_or_default());
    let (schema, topic) = SCHEMAS[choice % SCHEMAS.len()];
    let mut bytes = Vec::new();
    let options = mcap::WriteOptions::new()
        .use_chunks(false)
        .calculate_data_section_crc(false);
    let mut writer = options.create(Cursor::new(&mut bytes))?;
    let schema = writer.add_schema(schema, "protobuf", &[])?;
    let channel = writer.add_channel(schema, topic, "protobuf", &BTreeMap::new())?;
    let header = MessageHeader {
        channel_id: channel,
        sequence: 0,
        log_time: 1,
        publish_time: 1,
    };
    writer.write_to_known_channel(&header, message)?;
    writer.finish()?;
    drop(writer);
    Ok(bytes)
}

fuzz_target!(|data: &[u8]| {
    let log = log(data).expect("a vector takes all");
    read_all(&as_file("raw", &log));
});
