//! Verification: compares the messages of a replay with those of the recording, bit by bit.

use std::collections::{BTreeMap, BTreeSet, HashSet, VecDeque};
use std::fmt;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::Sink;

use sample::text::printable;
use sample::{LogTime, NANOS_PER_SECOND};
use store::{
    Encoded, LogWriter, Message, MessageIter, Reader, Record, Selection, same_force_values,
    same_health_without_late,
};

use crate::{LeftOut, Result};

/// Schemas of the raw data, which is the input of a replay.
const RAW: &str = "atvrec.Raw";
/// Topics that the engine does not compute.
const FOREIGN: [&str; 1] = ["/truth/"];
/// Topics that only the log of a replay can contain.
const SMOOTHED: &str = "/smoothed/";
/// Forces in the wheel-carrier frame.
const TYRE_FORCES: &str = "/estimate/tyre_forces";
/// Topics of the estimate with a lag. A vehicle with a force filter has them; a log without them is of an
/// earlier filter, whose numbers are others.
const LAGGED: &str = "/lagged/";
/// Counters of the sources.
const HEALTH: &str = "/health";
/// Topics of the estimator.
const ESTIMATED: [&str; 4] = ["/estimate/", "/model/", SMOOTHED, LAGGED];
/// Topics that logs of earlier versions do not contain.
const LATER: [&str; 5] = [
    "/utc_offset",
    TYRE_FORCES,
    "/smoothed/tyre_forces",
    "/tf",
    "/scene",
];
/// Schemas of latched messages, which every part of a run repeats at its beginning.
const REPEATED: [&str; 3] = ["atvrec.Health", "atvrec.ClockFit", "atvrec.UtcOffset"];
/// Most differences that are reported in full.
const REPORTED_MAX: usize = 3;
/// Most messages of a decoded record.
const MESSAGES_PER_RECORD_MAX: u64 = 5;
/// Time on the log clock for which a message waits for its counterpart: above the latency of both sides.
const WAIT_MAX_NANOS: i64 = 10 * NANOS_PER_SECOND;
/// Time before missing arrivals from which estimates may depend on them.
const DEPENDENCE_NANOS: i64 = NANOS_PER_SECOND;

/// Compares two streams of messages by topic and time, in bounded memory.
pub struct Verifier {
    encoder: LogWriter<Sink>,
    recorded: std::iter::Peekable<MessageIter>,
    waiting: BTreeMap<String, BTreeMap<LogTime, Waiting>>,
    states: BTreeMap<String, Message>,
    /// Messages that were recently found on both sides: a file after a failure may repeat them.
    found: HashSet<u64>,
    found_at: VecDeque<(LogTime, u64)>,
    settle_at: LogTime,
    /// Whether the log contains smoothed estimates.
    smoothed: bool,
    /// Whether the log contains estimates with a lag.
    lagged: bool,
    /// Topics that the log does not contain: it is too old, or its configuration leaves them out.
    absent: BTreeSet<String>,
    report: Verification,
}

/// Messages of a topic and a time without a counterpart so far.
#[derive(Default)]
struct Waiting {
    recorded: Vec<Message>,
    computed: Vec<Encoded>,
    /// Time of the last of them.
    since: LogTime,
}

/// Result of the comparison.
#[derive(Debug, Default)]
pub struct Verification {
    compared: BTreeMap<String, u64>,
    different: u64,
    only_recorded: BTreeMap<String, u64>,
    only_computed: BTreeMap<String, u64>,
    /// Messages of the log after missing arrivals that differ or have no counterpart.
    uncertain: u64,
    /// Number of the first missing arrival, and the time from which messages may depend on it.
    gap: Option<(u64, LogTime)>,
    /// Number of the first arrival of a log that does not begin at its beginning.
    begins_at: Option<u64>,
    /// Number of the last arrival of a log that does not end at its end.
    ends_before: Option<u64>,
    /// Lost decoded records by the counters of the log.
    lost_records: u64,
    unfinished: bool,
    /// The estimates of the log are of an earlier force filter: they are not compared.
    earlier_filter: bool,
    differences: Vec<String>,
}

impl Verifier {
    /// Verifier of the messages of `reader`; `encoder` converts the records of the replay to messages.
    pub fn new(reader: &Reader, encoder: LogWriter<Sink>, left_out: &LeftOut) -> Self {
        let info = reader.info();
        let topics = info
            .channels
            .iter()
            .filter(|(topic, (schema, _))| {
                !schema.starts_with(RAW) && !FOREIGN.iter().any(|t| topic.starts_with(t))
            })
            .map(|(topic, _)| topic.clone());
        let cut = |missing: &store::Missing| !matches!(missing, store::Missing::NoSchema { .. });
        let lost_records = info.counters.get("lost_records").copied();
        let report = Verification {
            unfinished: info.missing.iter().any(cut) || reader.was_recovered(),
            lost_records: lost_records.unwrap_or_default(),
            ..Verification::default()
        };
        Self {
            encoder,
            recorded: reader.messages(Selection::topics(topics)).peekable(),
            waiting: BTreeMap::new(),
            states: BTreeMap::new(),
            found: HashSet::new(),
            found_at: VecDeque::new(),
            settle_at: LogTime(0),
            smoothed: info
                .channels
                .keys()
                .any(|topic| topic.starts_with(SMOOTHED)),
            lagged: info.channels.keys().any(|topic| topic.starts_with(LAGGED)),
            absent: LATER
                .into_iter()
                .filter(|topic| !info.channels.contains_key(*topic))
                .chain(left_out.topics())
                .map(str::to_owned)
                .collect(),
            report,
        }
    }

    /// Reports that arrivals from number `first` on are missing, and that the last arrival before them
    /// has the time `time`. Messages from then on cannot be verified.
    pub fn arrivals_missing(&mut self, first: u64, time: LogTime) {
        self.report
            .gap
            .get_or_insert((first, time + -DEPENDENCE_NANOS));
    }

    /// Reports that the log begins with arrival number `first`: another tool removed those before it,
    /// on which everything can depend.
    pub fn beginning_missing(&mut self, first: u64) {
        self.report.begins_at = Some(first);
        self.report.gap = Some((0, LogTime(0)));
    }

    /// Reports that the log ends before arrival number `last`, which its counters state as the last.
    pub fn end_missing(&mut self, last: u64) {
        self.report.ends_before = Some(last);
        self.report.unfinished = true;
    }

    /// Compares the records of the arrival at `now`.
    pub fn expect(&mut self, records: &[Record], now: LogTime) -> Result<()> {
        for record in records {
            for message in self.encoder.encode(record) {
                self.computed(message, now);
            }
        }
        while let Some(next) = self.recorded.next_if(|message| match message {
            Ok(message) => message.log_time <= now,
            Err(_) => true,
        }) {
            self.recorded(next?, now);
        }
        if now >= self.settle_at {
            self.settle_at = LogTime(now.0.saturating_add(NANOS_PER_SECOND as u64));
            self.settle(now + -WAIT_MAX_NANOS);
        }
        Ok(())
    }

    /// From the first estimate with a lag on that only the replay has, estimates are not compared.
    fn leave_out_estimates(&mut self) {
        self.report.earlier_filter = true;
        let (waiting, report) = (&mut self.waiting, &mut self.report);
        waiting.retain(|topic, _| !is_estimated(topic));
        report.compared.retain(|topic, _| !is_estimated(topic));
    }

    fn computed(&mut self, message: Encoded, now: LogTime) {
        if !self.lagged && !self.report.earlier_filter && message.topic.starts_with(LAGGED) {
            self.leave_out_estimates();
        }
        if self.report.earlier_filter && is_estimated(&message.topic) {
            return;
        }
        if message.topic.starts_with(SMOOTHED) && !self.smoothed
            || self.absent.contains(&message.topic)
        {
            return;
        }
        let values_alone = self.values_alone();
        let topic = self.waiting.entry(message.topic.clone()).or_default();
        let waiting = topic.entry(message.log_time).or_default();
        let same = |recorded: &Message| is_same(recorded, &message, values_alone);
        match waiting.recorded.iter().position(same) {
            Some(position) => {
                waiting.recorded.remove(position);
                if waiting.is_empty() {
                    topic.remove(&message.log_time);
                }
                self.identical(&message.topic, message.log_time, &message.data, now);
            }
            None => {
                waiting.since = now;
                waiting.computed.push(message);
            }
        }
    }

    fn recorded(&mut self, message: Message, now: LogTime) {
        let name = &message.channel.topic;
        if self.report.earlier_filter && is_estimated(name) || self.is_repeated(&message) {
            return;
        }
        let name = &message.channel.topic;
        let values_alone = self.values_alone();
        let topic = self.waiting.entry(name.clone()).or_default();
        let waiting = topic.entry(message.log_time).or_default();
        let same = |computed: &Encoded| is_same(&message, computed, values_alone);
        match waiting.computed.iter().position(same) {
            Some(position) => {
                waiting.computed.remove(position);
                if waiting.is_empty() {
                    topic.remove(&message.log_time);
                }
                self.identical(name, message.log_time, &message.data, now);
            }
            None => {
                waiting.since = now;
                waiting.recorded.push(message);
            }
        }
    }

    /// Whether the log is of a version whose forces are all in the contact frame. Their standard
    /// deviations do not include the unknown normal of the ground, so that only the values are compared.
    fn values_alone(&self) -> bool {
        self.absent.contains(TYRE_FORCES)
    }

    fn identical(&mut self, topic: &str, log_time: LogTime, data: &[u8], now: LogTime) {
        self.report.count(topic);
        let hash = hash_of(topic, log_time, data);
        self.found.insert(hash);
        self.found_at.push_back((now, hash));
    }

    /// Whether the message repeats the last latched message at the beginning of another part.
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

    /// Settles the messages that have waited since before `before`: they have no counterpart.
    fn settle(&mut self, before: LogTime) {
        let (found, report) = (&self.found, &mut self.report);
        for (topic, instants) in &mut self.waiting {
            instants.retain(|time, waiting| {
                if waiting.since >= before {
                    return true;
                }
                let twice = |m: &Message| found.contains(&hash_of(topic, *time, &m.data));
                waiting.recorded.retain(|message| !twice(message));
                report.settle(topic, *time, std::mem::take(waiting));
                false
            });
        }
        while self.found_at.front().is_some_and(|(at, _)| *at < before) {
            if let Some((_, hash)) = self.found_at.pop_front() {
                self.found.remove(&hash);
            }
        }
    }

    /// Result after the last arrival.
    pub fn finish(mut self) -> Result<Verification> {
        const END: LogTime = LogTime(u64::MAX);
        while let Some(message) = self.recorded.next() {
            self.recorded(message?, LogTime(0));
        }
        self.settle(END);
        Ok(self.report)
    }
}

impl Waiting {
    fn is_empty(&self) -> bool {
        self.recorded.is_empty() && self.computed.is_empty()
    }
}

/// Compares two messages of a topic. `values_alone`: forces of the contact frame without their standard
/// deviations.
fn is_same(recorded: &Message, computed: &Encoded, values_alone: bool) -> bool {
    let same = recorded.data == computed.data
        || values_alone
            && computed.topic.ends_with("/contact_forces")
            && same_force_values(&recorded.data, &computed.data)
        || computed.topic == HEALTH && same_health_without_late(&recorded.data, &computed.data);
    recorded.publish_time == computed.publish_time && same
}

fn is_estimated(topic: &str) -> bool {
    ESTIMATED.iter().any(|prefix| topic.starts_with(prefix))
}

fn hash_of(topic: &str, log_time: LogTime, data: &[u8]) -> u64 {
    let mut hasher = DefaultHasher::new();
    (topic, log_time.0, data).hash(&mut hasher);
    hasher.finish()
}

impl Verification {
    /// Whether all messages that both sides can contain are bit-identical. Decoded records that the log
    /// states as lost are no differences. In a log that was cut short, messages on one side only are no
    /// differences either, because decoded messages are written later or earlier than the raw data.
    pub fn is_identical(&self) -> bool {
        let is_whole = self.begins_at.is_none() && self.uncertain == 0 && !self.earlier_filter;
        !self.has_differences() && is_whole && !self.compared.is_empty()
    }

    /// Whether there is no difference, but raw data of the recording is missing or its estimates are of an
    /// earlier force filter.
    pub fn is_partial(&self) -> bool {
        let is_part = self.uncertain > 0 || self.begins_at.is_some() || self.earlier_filter;
        !self.has_differences() && is_part
    }

    fn has_differences(&self) -> bool {
        let explained = self.lost_records.saturating_mul(MESSAGES_PER_RECORD_MAX);
        let complete = self.only_recorded.is_empty() && Self::sum(&self.only_computed) <= explained;
        self.different > 0 || !(complete || self.unfinished)
    }

    /// Counts the messages of a topic and a time that have no identical counterpart.
    fn settle(&mut self, topic: &str, time: LogTime, waiting: Waiting) {
        let mut recorded = waiting.recorded.into_iter();
        let mut computed = waiting.computed.into_iter();
        let behind_gap = self.gap.is_some_and(|(_, since)| time >= since);
        loop {
            let what = match (recorded.next(), computed.next()) {
                (None, None) => return,
                (Some(_), _) if behind_gap => {
                    self.uncertain += 1;
                    continue;
                }
                (None, Some(_)) if behind_gap => continue,
                (Some(recorded), Some(computed)) => {
                    self.count(topic);
                    self.different += 1;
                    difference(&recorded, &computed)
                }
                (Some(_), None) => {
                    *self.only_recorded.entry(topic.to_owned()).or_default() += 1;
                    format!("{topic} at {time} s is in the log, but not in the replay")
                }
                (None, Some(_)) => {
                    *self.only_computed.entry(topic.to_owned()).or_default() += 1;
                    format!("{topic} at {time} s is in the replay, but not in the log")
                }
            };
            if self.differences.len() < REPORTED_MAX {
                self.differences.push(what);
            }
        }
    }

    fn count(&mut self, topic: &str) {
        *self.compared.entry(topic.to_owned()).or_default() += 1;
    }

    fn sum(counts: &BTreeMap<String, u64>) -> u64 {
        counts.values().sum()
    }

    /// Result as JSON.
    pub fn as_json(&self) -> serde_json::Value {
        serde_json::json!({
            "identical": self.is_identical(),
            "compared": self.compared,
            "different": self.different,
            "only_recorded": self.only_recorded,
            "only_computed": self.only_computed,
            "uncertain": self.uncertain,
            "earlier_filter": self.earlier_filter,
            "begins_at_arrival": self.begins_at,
            "ends_before_arrival": self.ends_before,
            "first_missing_arrival": self.gap.map(|(first, _)| first),
            "lost_records": self.lost_records,
            "first_differences": self.differences,
        })
    }
}

impl fmt::Display for Verification {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let compared = Self::sum(&self.compared);
        let (recorded, computed) = (
            Self::sum(&self.only_recorded),
            Self::sum(&self.only_computed),
        );
        if let Some(first) = self.begins_at {
            return writeln!(
                f,
                "NOT VERIFIED: the log does not begin at its beginning: its first arrival is number {first}, \
                 those before it are missing. {compared} messages are bit-identical, {} depend on them and \
                 cannot be verified; verify the whole run",
                self.uncertain
            );
        }
        if compared == 0 && self.different == 0 {
            return writeln!(
                f,
                "NOT VERIFIED: the log contains no decoded or estimated message to compare with"
            );
        }
        if self.has_differences() {
            writeln!(
                f,
                "NOT IDENTICAL: {} of {compared} messages differ, {recorded} are only in the log, \
                 {computed} only in the replay",
                self.different
            )?;
            for text in &self.differences {
                writeln!(f, "  {}", printable(text))?;
            }
            return Ok(());
        }
        if let Some((first, _)) = self.gap.filter(|_| self.uncertain > 0) {
            writeln!(
                f,
                "VERIFIED IN PART: {compared} messages are bit-identical, but {} cannot be \
                 verified, because they depend on arrivals from number {first} on, which are \
                 missing in the log",
                self.uncertain
            )?;
        } else if self.earlier_filter {
            writeln!(
                f,
                "VERIFIED IN PART: {compared} messages on {} topics are bit-identical; the estimates in \
                 the log are those of an earlier force filter and are not compared (`replay -o` writes \
                 new ones)",
                self.compared.len()
            )?;
        } else {
            writeln!(
                f,
                "verified: {compared} messages on {} topics are bit-identical",
                self.compared.len()
            )?;
        }
        if computed > 0 && self.lost_records > 0 {
            writeln!(
                f,
                "  {computed} messages of the replay are not in the log, which states {} decoded \
                 records as lost on the way to the disk",
                self.lost_records
            )?;
        } else if let Some(last) = self.ends_before {
            writeln!(
                f,
                "  the log does not end at its end, arrival number {last}: {recorded} messages have no raw \
                 bytes, {computed} messages of the replay are missing"
            )?;
        } else if recorded + computed > 0 {
            writeln!(
                f,
                "  the log was cut short: {recorded} messages at its end have no raw bytes, \
                 {computed} were not written"
            )?;
        }
        Ok(())
    }
}

/// Where two messages part.
fn difference(recorded: &Message, computed: &Encoded) -> String {
    let topic = &computed.topic;
    let at = recorded.log_time;
    if recorded.publish_time != computed.publish_time {
        return format!(
            "{topic} at {at} s: time of validity {} s in the log, {} s in the replay",
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
