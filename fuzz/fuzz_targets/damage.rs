//! A sound log with bytes changed: recovery invents no message. Each four bytes of the input are the
//! place and the value of one change.
#![no_main]

use std::collections::{BTreeMap, HashSet};
use std::io::Cursor;
use std::sync::LazyLock;
use std::time::Duration;

use libfuzzer_sys::fuzz_target;
use sample::{Arrival, LogTime, Payload, SourceId};
use store::{LogWriter, Options, Session};

type Key = (u16, u64, Vec<u8>);

static LOG: LazyLock<(Vec<u8>, HashSet<Key>)> = LazyLock::new(|| {
    let options = Options {
        raw_interval: Duration::from_millis(50),
        ..Options::default()
    };
    let mut writer =
        LogWriter::new(Vec::new(), Session::default(), options, 0).expect("a vector takes all");
    for sequence in 0..40 {
        let arrival = Arrival {
            sequence,
            source: SourceId((sequence % 2) as u16),
            log_time: LogTime(sequence * 10_000_000),
            realtime_ns: sequence as i64,
            payload: Payload::Bytes(vec![sequence as u8; 20]),
        };
        writer.push(arrival).expect("a vector takes all");
    }
    let log = writer.finish(&BTreeMap::new()).expect("a vector takes all");
    let messages = messages(&log);
    (log, messages)
});

fn messages(log: &[u8]) -> HashSet<Key> {
    mcap::MessageStream::new(log)
        .expect("it is MCAP")
        .map(|message| {
            let message = message.expect("checksums hold");
            (
                message.channel.id,
                message.log_time,
                message.data.into_owned(),
            )
        })
        .collect()
}

fuzz_target!(|data: &[u8]| {
    let (log, whole) = &*LOG;
    let mut damaged = log.clone();
    for change in data.chunks_exact(4) {
        let place = u32::from_le_bytes([change[0], change[1], change[2], 0]) as usize;
        let place = place % damaged.len();
        damaged[place] = change[3];
    }
    let mut output = Vec::new();
    if store::salvage(Cursor::new(&damaged), &[], &mut output).is_ok() {
        assert!(messages(&output).is_subset(whole));
    }
});
