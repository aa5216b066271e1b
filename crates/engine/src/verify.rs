//! Verification: compares the messages of a replay with those of the recording, bit by bit.

mod comparison;

use std::collections::BTreeMap;
use std::fmt;
use std::io::Sink;
use std::sync::mpsc::Receiver;

use sample::text::printable;
use sample::{LogTime, NANOS_PER_SECOND};
use store::{Encoded, LogWriter, Message, Origin, Reader, Record};

use crate::behind::Behind;
use crate::{LeftOut, Result};
use comparison::{Comparison, Waiting};

/// Most differences that are reported in full.
const REPORTED_MAX: usize = 3;
/// Topics of decoded CAN messages.
const CAN: &str = "/can/";
/// Beginnings of the topics of other measurements whose values do not depend on data of more than some seconds
/// before them, unless a table has held values. Their times of validity can depend on the fit of a device's clock.
const MEASURED: [&str; 9] = [
    "/control/",
    "/deflection",
    "/gnss/",
    "/ground_speed",
    "/hub_acceleration",
    "/imu/",
    "/steer",
    "/strain",
    "/wheel_speed",
];
/// End of the topics of fixes, which have the offset of UTC.
const FIX: &str = "/fix";
/// Time after the begin of a log that continues another run until messages of several frames are complete.
const SETTLED_NANOS: i64 = 2 * NANOS_PER_SECOND;
/// Most messages of a decoded record.
const MESSAGES_PER_RECORD_MAX: u64 = 5;

/// Compares the messages of a replay with those of the log, on a thread of its own.
pub struct Verifier {
    comparing: Behind<Step, Result<Verification>>,
}

/// What the comparison has to take into account, in the order of the replay.
enum Step {
    /// Record of the present arrival. The thread of the comparison encodes it: it has less work than that of
    /// the replay.
    Computed(Record),
    /// End of the arrival at a time.
    Arrival(LogTime),
    /// Missing arrivals from a number on, and the time of the last arrival before them.
    ArrivalsMissing(u64, LogTime),
    /// Number of the first arrival of a log without its beginning.
    BeginningMissing(u64),
    /// Number of the last arrival of a log without its end.
    EndMissing(u64),
    /// The log continues another run, and whether a source of it is a table.
    Continued(Origin, bool),
}

impl Verifier {
    /// Verifier of the messages of `reader`; `encoder` converts the records of the replay to messages.
    pub fn new(reader: &Reader, mut encoder: LogWriter<Sink>, left_out: &LeftOut) -> Self {
        let mut comparison = Comparison::new(reader, left_out);
        let compare = move |steps: Receiver<Vec<Step>>| {
            let mut messages = Vec::new();
            for step in steps.into_iter().flatten() {
                match step {
                    Step::Computed(record) => messages.extend(encoder.encode(&record)),
                    Step::Arrival(now) => comparison.expect(&mut messages, now)?,
                    Step::ArrivalsMissing(first, time) => comparison.arrivals_missing(first, time),
                    Step::BeginningMissing(first) => comparison.beginning_missing(first),
                    Step::EndMissing(last) => comparison.end_missing(last),
                    Step::Continued(origin, has_table) => comparison.continued(origin, has_table),
                }
            }
            comparison.finish()
        };
        Self {
            comparing: Behind::start(compare),
        }
    }

    /// Reports that arrivals from number `first` on are missing, and that the last arrival before them
    /// has the time `time`. Messages from then on cannot be verified.
    pub fn arrivals_missing(&mut self, first: u64, time: LogTime) {
        self.comparing.push(Step::ArrivalsMissing(first, time));
    }

    /// Reports that the log begins with arrival number `first`: another tool removed those before it,
    /// on which everything can depend.
    pub fn beginning_missing(&mut self, first: u64) {
        self.comparing.push(Step::BeginningMissing(first));
    }

    /// Reports that the log ends before arrival number `last`, which its counters state as the last.
    pub fn end_missing(&mut self, last: u64) {
        self.comparing.push(Step::EndMissing(last));
    }

    /// Reports that the log is a stretch of a run that has earlier data, on which everything can depend.
    /// `has_table`: a source is a table, whose held values depend on its earlier rows.
    pub fn continued(&mut self, origin: Origin, has_table: bool) {
        self.comparing.push(Step::Continued(origin, has_table));
    }

    /// Compares the records of the arrival at `now`.
    ///
    /// # Errors
    /// If the messages of the log cannot be read; also those of earlier arrivals.
    pub fn expect(&mut self, records: impl Iterator<Item = Record>, now: LogTime) -> Result<()> {
        let mut steps = records.map(Step::Computed).chain([Step::Arrival(now)]);
        if steps.all(|step| self.comparing.push(step)) {
            return Ok(());
        }
        self.result().map(drop)
    }

    /// Result after the last arrival.
    pub fn finish(mut self) -> Result<Verification> {
        self.result()
    }

    fn result(&mut self) -> Result<Verification> {
        // After an error the replay ends, so that no second result is requested.
        self.comparing
            .finish()
            .unwrap_or_else(|| Ok(Verification::default()))
    }
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
    /// The run that the log is a stretch of, if it has earlier data.
    continued: Option<Origin>,
    /// A source of the log is a table.
    has_table: bool,
    /// Lost decoded records by the counters of the log.
    lost_records: u64,
    unfinished: bool,
    /// The estimates of the log are of an earlier force filter: they are not compared.
    earlier_filter: bool,
    differences: Vec<String>,
}

impl Verification {
    /// Whether all messages that both sides can contain are bit-identical. Decoded records that the log
    /// states as lost are no differences. In a log that was cut short, messages on one side only are no
    /// differences either, because decoded messages are written later or earlier than the raw data.
    pub fn is_identical(&self) -> bool {
        let is_whole = self.begins_at.is_none()
            && self.continued.is_none()
            && self.uncertain == 0
            && !self.earlier_filter;
        !self.has_differences() && is_whole && !self.compared.is_empty()
    }

    /// Whether there is no difference, but raw data of the recording is missing, the log continues another
    /// run, or its estimates are of an earlier force filter.
    pub fn is_partial(&self) -> bool {
        let is_part = self.uncertain > 0
            || self.begins_at.is_some()
            || self.continued.is_some()
            || self.earlier_filter;
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
        let is_independent = self.is_independent(topic, time);
        let behind_gap = self.gap.is_some_and(|(_, since)| time >= since) && !is_independent;
        loop {
            let what = match (recorded.next(), computed.next()) {
                (None, None) => return,
                (Some(recorded), Some(computed))
                    if is_independent && recorded.data == computed.data =>
                {
                    self.uncertain += 1;
                    continue;
                }
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

    /// Whether the values of a message of a log that continues another run do not depend on the data before the
    /// log.
    fn is_independent(&self, topic: &str, time: LogTime) -> bool {
        let since = |origin: &Origin| time >= origin.from + SETTLED_NANOS;
        let is_measured = !self.has_table
            && MEASURED.iter().any(|begin| topic.starts_with(begin))
            && !topic.ends_with(FIX);
        self.continued.as_ref().is_some_and(since) && (topic.starts_with(CAN) || is_measured)
    }

    fn count(&mut self, topic: &str) {
        match self.compared.get_mut(topic) {
            Some(count) => *count += 1,
            None => drop(self.compared.insert(topic.to_owned(), 1)),
        }
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
            "continued_from": self.continued.as_ref().map(|origin| serde_json::json!({
                "run_id": origin.run_id,
                "at_ns": origin.from.0,
            })),
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
        if let (Some(origin), false) = (&self.continued, self.has_differences()) {
            return self.write_continued(f, origin);
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

impl Verification {
    fn write_continued(&self, f: &mut fmt::Formatter<'_>, origin: &Origin) -> fmt::Result {
        writeln!(
            f,
            "VERIFIED IN PART: the log continues the run {} from {} s on: {} messages on {} topics are \
             bit-identical, and no {} after the first {} s has other values. {} messages, such as estimates, depend on the data before this time, which are not in the log, and cannot be compared; \
             verify the whole run",
            printable(&origin.run_id),
            origin.from,
            Self::sum(&self.compared),
            self.compared.len(),
            if self.has_table {
                "decoded CAN message"
            } else {
                "decoded message"
            },
            SETTLED_NANOS / NANOS_PER_SECOND,
            self.uncertain
        )
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
