//! Compares what a replay computes with what was computed while recording, bit by bit.

use std::collections::{BTreeMap, VecDeque};
use std::fmt;
use std::io::Sink;

use sample::LogTime;
use store::{Encoded, LogWriter, Message, MessageIter, Reader, Record, Selection};

/// Schemas of the raw stream, which is what a replay starts from.
const RAW: &str = "atvrec.Raw";
/// Topics that the engine has no part in.
const FOREIGN: [&str; 1] = ["/truth/"];
/// Topics that only a log of a replay may have.
const SMOOTHED: &str = "/smoothed/";
/// A topic that logs of version 0.1.0 do not have.
const UTC_OFFSET: &str = "/utc_offset";
/// Schemas of states that every file of a run repeats at its beginning.
const REPEATED: [&str; 3] = ["atvrec.Health", "atvrec.ClockFit", "atvrec.UtcOffset"];
/// Differences that are told in full.
const TOLD_MAX: usize = 3;

/// Compares two streams of messages, topic by topic, in constant memory.
pub struct Verifier {
    encoder: LogWriter<Sink>,
    recorded: std::iter::Peekable<MessageIter>,
    waiting: BTreeMap<String, Waiting>,
    states: BTreeMap<String, Message>,
    /// Whether the log has smoothed estimates to compare with.
    smoothed: bool,
    /// Whether the log has offsets of UTC to compare with.
    utc_offset: bool,
    report: Report,
}

/// Messages of a topic whose counterpart has not come yet.
#[derive(Default)]
struct Waiting {
    recorded: VecDeque<Message>,
    computed: VecDeque<Encoded>,
}

/// What the comparison found.
#[derive(Debug, Default)]
pub struct Report {
    compared: BTreeMap<String, u64>,
    different: u64,
    only_recorded: BTreeMap<String, u64>,
    only_computed: BTreeMap<String, u64>,
    unfinished: bool,
    told: Vec<String>,
}

impl Verifier {
    /// Compares with what `reader` holds; `encoder` makes messages of the new records.
    pub fn new(reader: &Reader, encoder: LogWriter<Sink>) -> Self {
        let info = reader.info();
        let topics = info
            .channels
            .iter()
            .filter(|(topic, (schema, _))| {
                !schema.starts_with(RAW) && !FOREIGN.iter().any(|t| topic.starts_with(t))
            })
            .map(|(topic, _)| topic.clone());
        let report = Report {
            unfinished: !info.missing.is_empty() || reader.was_recovered(),
            ..Report::default()
        };
        Self {
            encoder,
            recorded: reader.messages(Selection::topics(topics)).peekable(),
            waiting: BTreeMap::new(),
            states: BTreeMap::new(),
            smoothed: info
                .channels
                .keys()
                .any(|topic| topic.starts_with(SMOOTHED)),
            utc_offset: info.channels.contains_key(UTC_OFFSET),
            report,
        }
    }

    /// Takes what followed from the arrival at `now`.
    pub fn expect(&mut self, records: &[Record], now: LogTime) -> anyhow::Result<()> {
        for record in records {
            for message in self.encoder.encode(record) {
                self.computed(message);
            }
        }
        while let Some(next) = self.recorded.next_if(|message| match message {
            Ok(message) => message.log_time <= now,
            Err(_) => true,
        }) {
            self.recorded(next?);
        }
        Ok(())
    }

    fn computed(&mut self, message: Encoded) {
        if message.topic.starts_with(SMOOTHED) && !self.smoothed
            || message.topic == UTC_OFFSET && !self.utc_offset
        {
            return;
        }
        let waiting = self.waiting.entry(message.topic.clone()).or_default();
        match waiting.recorded.pop_front() {
            Some(recorded) => self.report.compare(&recorded, &message),
            None => waiting.computed.push_back(message),
        }
    }

    fn recorded(&mut self, message: Message) {
        if self.is_repeated(&message) {
            return;
        }
        let waiting = self
            .waiting
            .entry(message.channel.topic.clone())
            .or_default();
        match waiting.computed.pop_front() {
            Some(computed) => self.report.compare(&message, &computed),
            None => waiting.recorded.push_back(message),
        }
    }

    /// Whether this state is the last one again, at the beginning of another file.
    fn is_repeated(&mut self, message: &Message) -> bool {
        if !REPEATED.contains(&message.channel.schema.as_str()) {
            return false;
        }
        let topic = message.channel.topic.clone();
        let same = self
            .states
            .get(&topic)
            .is_some_and(|last| last.log_time == message.log_time && last.data == message.data);
        if !same {
            self.states.insert(topic, message.clone());
        }
        same
    }

    /// The result, when the last arrival is replayed.
    pub fn finish(mut self) -> anyhow::Result<Report> {
        while let Some(message) = self.recorded.next() {
            self.recorded(message?);
        }
        let mut report = self.report;
        for (topic, waiting) in self.waiting {
            if let Some(first) = waiting.recorded.front() {
                report.tell(format!(
                    "{topic} at {} s is in the log, the replay does not compute it",
                    first.log_time
                ));
                let count = waiting.recorded.len() as u64;
                report.only_recorded.insert(topic.clone(), count);
            }
            if let Some(first) = waiting.computed.front() {
                report.tell(format!(
                    "{topic} at {} s is computed by the replay, the log does not have it",
                    first.log_time
                ));
                let count = waiting.computed.len() as u64;
                report.only_computed.insert(topic, count);
            }
        }
        Ok(report)
    }
}

impl Report {
    /// Whether every message is bit-identical. In a log that was cut short, the end that only one
    /// side has does not count: what was computed is written later than the raw bytes, or earlier.
    pub fn is_identical(&self) -> bool {
        let complete = self.only_recorded.is_empty() && self.only_computed.is_empty();
        self.different == 0 && (complete || self.unfinished) && !self.compared.is_empty()
    }

    fn compare(&mut self, recorded: &Message, computed: &Encoded) {
        *self.compared.entry(computed.topic.clone()).or_default() += 1;
        let same = recorded.log_time == computed.log_time
            && recorded.publish_time == computed.publish_time
            && recorded.data == computed.data;
        if same {
            return;
        }
        self.different += 1;
        self.tell(difference(recorded, computed));
    }

    fn tell(&mut self, text: String) {
        if self.told.len() < TOLD_MAX {
            self.told.push(text);
        }
    }

    fn sum(counts: &BTreeMap<String, u64>) -> u64 {
        counts.values().sum()
    }

    /// The result for scripts.
    pub fn as_json(&self) -> serde_json::Value {
        serde_json::json!({
            "identical": self.is_identical(),
            "compared": self.compared,
            "different": self.different,
            "only_recorded": self.only_recorded,
            "only_computed": self.only_computed,
            "first_differences": self.told,
        })
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let compared = Self::sum(&self.compared);
        if self.is_identical() {
            writeln!(
                f,
                "verified: {compared} messages on {} topics are bit-identical",
                self.compared.len()
            )?;
            let (recorded, computed) = (
                Self::sum(&self.only_recorded),
                Self::sum(&self.only_computed),
            );
            if recorded + computed > 0 {
                writeln!(
                    f,
                    "  the log was cut short: {recorded} messages at its end have no raw bytes, \
                     {computed} were not written"
                )?;
            }
            return Ok(());
        }
        if compared == 0 {
            writeln!(f, "NOT VERIFIED: the log holds nothing to compare with")?;
            return Ok(());
        }
        writeln!(
            f,
            "NOT IDENTICAL: {} of {compared} messages differ, {} are only in the log, \
             {} only in the replay",
            self.different,
            Self::sum(&self.only_recorded),
            Self::sum(&self.only_computed)
        )?;
        for text in &self.told {
            writeln!(f, "  {text}")?;
        }
        Ok(())
    }
}

/// Where two messages part.
fn difference(recorded: &Message, computed: &Encoded) -> String {
    let topic = &computed.topic;
    if recorded.log_time != computed.log_time {
        return format!(
            "{topic}: the log has a message at {} s where the replay has one at {} s",
            recorded.log_time, computed.log_time
        );
    }
    let at = recorded.log_time;
    if recorded.publish_time != computed.publish_time {
        return format!(
            "{topic} at {at} s: true at {} s in the log, at {} s in the replay",
            recorded.publish_time, computed.publish_time
        );
    }
    let position = recorded
        .data
        .iter()
        .zip(&computed.data)
        .position(|(a, b)| a != b)
        .unwrap_or_else(|| recorded.data.len().min(computed.data.len()));
    let around = |data: &[u8]| {
        let end = (position + 8).min(data.len());
        let shown = data.get(position..end).unwrap_or_default();
        shown
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect::<String>()
    };
    format!(
        "{topic} at {at} s: byte {position} of {}: {} in the log, {} in the replay",
        recorded.data.len(),
        around(&recorded.data),
        around(&computed.data)
    )
}
