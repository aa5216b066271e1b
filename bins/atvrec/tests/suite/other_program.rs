//! Logs of other programs: a command says what they have, or why it cannot use them.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use mcap::records::MessageHeader;

use crate::support::{atvrec, stderr, stdout};

/// Topics of the log: name, schema, encoding of the schema, encoding of the messages, and a message.
const TOPICS: [(&str, &str, &str, &str, &[u8]); 5] = [
    (
        "/vehicle/speed",
        "Speed",
        "jsonschema",
        "json",
        b"{\"speed\": 3.5}",
    ),
    // Names that this program uses too, with other contents.
    (
        "/estimate/motion",
        "Motion",
        "jsonschema",
        "json",
        b"{\"speed\": 3.5}",
    ),
    (
        "/estimate/events",
        "Event",
        "jsonschema",
        "json",
        b"{\"text\": \"lift\"}",
    ),
    (
        "/health",
        "std_msgs/msg/String",
        "ros2msg",
        "cdr",
        b"\0\x01\0\0\x05\0\0\0good\0",
    ),
    ("/gnss/one", "", "", "", b"\x01\x02\x03"),
];
/// Messages of each topic.
const MESSAGES: u64 = 100;

fn write(path: &Path) {
    let file = BufWriter::new(File::create(path).expect("made"));
    let mut writer = mcap::Writer::new(file).expect("a log");
    let channels = TOPICS.map(|(topic, schema, encoding, message, data)| {
        let schema = match schema {
            "" => 0,
            name => writer
                .add_schema(name, encoding, b"{\"type\": \"object\"}")
                .expect("a schema"),
        };
        let channel = writer.add_channel(schema, topic, message, &BTreeMap::new());
        (channel.expect("a channel"), data)
    });
    for step in 0..MESSAGES {
        for (channel_id, data) in channels {
            let time = 1_700_000_000_000_000_000 + step * 10_000_000;
            let header = MessageHeader {
                channel_id,
                sequence: step as u32,
                log_time: time,
                publish_time: time,
            };
            writer
                .write_to_known_channel(&header, data)
                .expect("written");
        }
    }
    writer.finish().expect("closed");
}

#[test]
fn a_report_says_that_another_program_wrote_the_log_and_what_it_lacks() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    write(&here.join("other.mcap"));
    atvrec(here)
        .args(["report", "other.mcap", "-o", "other.html"])
        .assert()
        .success();
    let page = std::fs::read_to_string(here.join("other.html")).expect("a page");
    assert!(page.contains("another program"));
    assert!(page.contains("What this log lacks"));
    let assert = atvrec(here)
        .args(["report", "other.mcap", "--json"])
        .assert()
        .success();
    let found: serde_json::Value = serde_json::from_str(&stdout(&assert)).expect("JSON");
    assert_eq!(found["estimates"], 0);
    assert_eq!(
        found["figures"].as_array().map(Vec::len),
        Some(0),
        "{found:#}"
    );
    assert!(
        found["lacking"]
            .as_array()
            .is_some_and(|all| all.len() > 10)
    );
    let text = stdout(&atvrec(here).args(["info", "other.mcap"]).assert().success());
    assert!(
        text.contains("another program") && text.contains("/vehicle/speed"),
        "{text}"
    );
    assert!(text.contains("100"), "{text}");
}

#[test]
fn what_needs_more_than_another_program_wrote_is_a_clear_error() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    write(&here.join("other.mcap"));
    let error = |arguments: &[&str]| {
        let assert = atvrec(here).args(arguments).assert().code(1);
        stderr(&assert)
    };
    let text = error(&["export", "other.mcap", "--topic", "/vehicle/speed"]);
    assert!(
        text.contains("/vehicle/speed") && text.contains("json"),
        "{text}"
    );
    let text = error(&["export", "other.mcap", "--topic", "/estimate/motion"]);
    assert!(text.contains("json"), "{text}");
    let text = error(&["replay", "other.mcap"]);
    assert!(text.contains("configuration"), "{text}");
    let text = error(&["score", "other.mcap"]);
    assert!(text.contains("vehicle"), "{text}");
    let text = error(&["report", "other.mcap", "--around", "lift"]);
    assert!(text.contains("no event"), "{text}");
}
