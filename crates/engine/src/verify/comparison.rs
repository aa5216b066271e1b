//! Comparison of two streams of messages.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet, VecDeque};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

use sample::{LogTime, NANOS_PER_SECOND};
use store::{
    Encoded, Message, MessageIter, Origin, Reader, Selection, same_force_values,
    same_health_without_late,
};

use super::Verification;
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
const LATER: [&str; 7] = [
    "/utc_offset",
    "/estimate/limits",
    "/estimate/terrain",
    TYRE_FORCES,
    "/smoothed/tyre_forces",
    "/tf",
    "/scene",
];
/// Schemas of latched messages, which every part of a run repeats at its beginning.
const REPEATED: [&str; 3] = ["atvrec.Health", "atvrec.ClockFit", "atvrec.UtcOffset"];
/// Time on the log clock for which a message waits for its counterpart: above the latency of both sides.
const WAIT_MAX_NANOS: i64 = 10 * NANOS_PER_SECOND;
/// Time before missing arrivals from which estimates may depend on them.
const DEPENDENCE_NANOS: i64 = NANOS_PER_SECOND;

/// Compares two streams of messages by topic and time, in bounded memory.
pub(super) struct Comparison {
    recorded: MessageIter,
    waiting: HashMap<Arc<str>, BTreeMap<LogTime, Waiting>>,
    states: BTreeMap<String, Message>,
    /// Whether messages may be in the log twice, because a file after a failure repeats them.
    may_repeat: bool,
    /// Messages that were recently found on both sides, if they may be in the log twice.
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
pub(super) struct Waiting {
    pub(super) recorded: Vec<Message>,
    pub(super) computed: Vec<Encoded>,
    /// Time of the last of them.
    since: LogTime,
}

impl Comparison {
    /// Comparison with the messages of `reader`.
    pub(super) fn new(reader: &Reader, left_out: &LeftOut) -> Self {
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
            unfinished: info.missing.iter().any(cut)
                || reader.was_recovered()
                || reader.session().origin.is_some(),
            lost_records: lost_records.unwrap_or_default(),
            ..Verification::default()
        };
        Self {
            recorded: reader.messages(Selection::topics(topics)),
            waiting: HashMap::new(),
            states: BTreeMap::new(),
            may_repeat: info.files.len() > 1 || reader.was_recovered(),
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
    pub(super) fn arrivals_missing(&mut self, first: u64, time: LogTime) {
        self.report
            .gap
            .get_or_insert((first, time + -DEPENDENCE_NANOS));
    }

    /// Reports that the log begins with arrival number `first`: another tool removed those before it,
    /// on which everything can depend.
    pub(super) fn beginning_missing(&mut self, first: u64) {
        self.report.begins_at = Some(first);
        self.report.gap = Some((0, LogTime(0)));
    }

    /// Reports that the log is a stretch of a run that has earlier data, on which everything can depend.
    pub(super) fn continued(&mut self, origin: Origin, has_table: bool) {
        self.report.continued = Some(origin);
        self.report.has_table = has_table;
        self.report.gap = Some((0, LogTime(0)));
    }

    /// Reports that the log ends before arrival number `last`, which its counters state as the last.
    pub(super) fn end_missing(&mut self, last: u64) {
        self.report.ends_before = Some(last);
        self.report.unfinished = true;
    }

    /// Compares the messages of the arrival at `now`. A log usually contains the messages in the order
    /// in which they are computed: a message that is identical to the next one needs no search.
    pub(super) fn expect(&mut self, messages: &mut Vec<Encoded>, now: LogTime) -> Result<()> {
        let mut computed = messages.drain(..).peekable();
        loop {
            while computed.next_if(|message| !self.takes(message)).is_some() {}
            let Some(next) = self.recorded.next_ref_if(|time| time <= now) else {
                break;
            };
            let next = next?;
            let is_next = |message: &Encoded| {
                *message.topic == *next.channel.topic
                    && message.log_time == next.log_time
                    && message.publish_time == next.publish_time
                    && message.data == next.data
            };
            let is_state = REPEATED.contains(&&*next.channel.schema);
            match computed.next_if(|message| !is_state && is_next(message)) {
                Some(message) => {
                    self.identical(&message.topic, message.log_time, &message.data, now);
                }
                None => {
                    let next = next.to_message();
                    for message in computed.by_ref() {
                        self.computed(message, now);
                    }
                    self.recorded(next, now);
                }
            }
        }
        for message in computed {
            self.computed(message, now);
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

    /// Whether a computed message is compared.
    fn takes(&mut self, message: &Encoded) -> bool {
        if !self.lagged && !self.report.earlier_filter && message.topic.starts_with(LAGGED) {
            self.leave_out_estimates();
        }
        let is_left_out = self.report.earlier_filter && is_estimated(&message.topic)
            || message.topic.starts_with(SMOOTHED) && !self.smoothed
            || self.absent.contains(&*message.topic);
        !is_left_out
    }

    fn computed(&mut self, message: Encoded, now: LogTime) {
        if !self.takes(&message) {
            return;
        }
        let values_alone = self.values_alone();
        let topic = topic_of(&mut self.waiting, &message.topic);
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
        let topic = topic_of(&mut self.waiting, name);
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
        if !self.may_repeat {
            return;
        }
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

    /// Settles the messages that have waited since before `before`: they have no counterpart. Differences are
    /// reported in the order of their times.
    fn settle(&mut self, before: LogTime) {
        let mut due = Vec::new();
        for (topic, instants) in &mut self.waiting {
            instants.retain(|time, waiting| {
                let is_due = waiting.since < before;
                if is_due {
                    due.push((*time, Arc::clone(topic), std::mem::take(waiting)));
                }
                !is_due
            });
        }
        due.sort_by(|(a, one, _), (b, other, _)| (a, one).cmp(&(b, other)));
        for (time, topic, mut waiting) in due {
            let twice = |m: &Message| self.found.contains(&hash_of(&topic, time, &m.data));
            waiting.recorded.retain(|message| !twice(message));
            self.report.settle(&topic, time, waiting);
        }
        while self.found_at.front().is_some_and(|(at, _)| *at < before) {
            if let Some((_, hash)) = self.found_at.pop_front() {
                self.found.remove(&hash);
            }
        }
    }

    /// Result after the last arrival.
    pub(super) fn finish(mut self) -> Result<Verification> {
        const END: LogTime = LogTime(u64::MAX);
        while let Some(message) = self.recorded.next_ref() {
            let message = message?.to_message();
            self.recorded(message, LogTime(0));
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
        || &*computed.topic == HEALTH && same_health_without_late(&recorded.data, &computed.data);
    recorded.publish_time == computed.publish_time && same
}

fn topic_of<'w>(
    waiting: &'w mut HashMap<Arc<str>, BTreeMap<LogTime, Waiting>>,
    topic: &str,
) -> &'w mut BTreeMap<LogTime, Waiting> {
    if !waiting.contains_key(topic) {
        waiting.insert(topic.into(), BTreeMap::new());
    }
    (waiting.get_mut(topic)).expect("the topic was inserted above")
}

fn is_estimated(topic: &str) -> bool {
    ESTIMATED.iter().any(|prefix| topic.starts_with(prefix))
}

fn hash_of(topic: &str, log_time: LogTime, data: &[u8]) -> u64 {
    let mut hasher = DefaultHasher::new();
    (topic, log_time.0, data).hash(&mut hasher);
    hasher.finish()
}
