//! Rate limit of equal messages: repetitions are counted instead of printed, so that a device that
//! repeats an error a thousand times per second does not fill the journal.

use std::collections::HashMap;
use std::fmt::{Debug, Write};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::{LazyLock, Mutex, Once, PoisonError};
use std::time::{Duration, Instant};

use tracing::field::{Field, Visit};
use tracing::{Event, Level, Metadata, Subscriber};
use tracing_subscriber::layer::{Context, Filter};

/// Time over which equal messages are counted.
const INTERVAL: Duration = Duration::from_secs(10);
/// Most equal messages that are printed in one interval. Messages are equal if they have the same
/// place in the program, the same source or file, and the same words (numbers are ignored).
const EQUAL_MAX: u64 = 5;
/// Most messages of one place in the program about one source or file that are printed in one
/// interval, whatever their words.
const PLACE_MAX: u64 = 100;
/// Most counters that are kept. Above this number, all messages of one place share a counter.
const COUNTERS_MAX: usize = 4_096;
/// Target of the reports of repetitions, which are not limited.
const REPORT: &str = "repeated";
/// Most characters of a message that its report contains.
const TEXT_MAX: usize = 200;

/// Filter that prints a message or counts it.
pub struct Limit;

impl<S: Subscriber> Filter<S> for Limit {
    fn enabled(&self, _: &Metadata<'_>, _: &Context<'_, S>) -> bool {
        true
    }

    fn event_enabled(&self, event: &Event<'_>, _: &Context<'_, S>) -> bool {
        let level = *event.metadata().level();
        if level > Level::INFO || event.metadata().target() == REPORT {
            return true;
        }
        let mut words = Words::default();
        event.record(&mut words);
        let mut place = DefaultHasher::new();
        event.metadata().callsite().hash(&mut place);
        words.identity.hash(&mut place);
        let admitted = lock().admit(Instant::now(), place.finish(), level, words);
        if !admitted {
            start_reports();
        }
        admitted
    }
}

/// Reports the repetitions of the intervals that are over, or of all intervals.
pub fn report(now: Instant, all: bool) {
    // The lock is released before the reports are printed, because printing takes it.
    let over = lock().take_over(now, all);
    for Counter {
        level,
        words,
        suppressed,
        ..
    } in over
    {
        let Words { identity, text, .. } = words;
        match level {
            Level::ERROR => {
                tracing::error!(target: REPORT, "{identity}{text} … repeated {suppressed} more times in 10 s");
            }
            Level::WARN => {
                tracing::warn!(target: REPORT, "{identity}{text} … repeated {suppressed} more times in 10 s");
            }
            _ => {
                tracing::info!(target: REPORT, "{identity}{text} … repeated {suppressed} more times in 10 s")
            }
        }
    }
}

/// Starts, once, the thread that reports every second.
fn start_reports() {
    static THREAD: Once = Once::new();
    THREAD.call_once(|| {
        let thread = std::thread::Builder::new().name("messages".to_owned());
        // If the thread cannot start, the report at the end of the program remains.
        let _ = thread.spawn(|| {
            loop {
                std::thread::sleep(Duration::from_secs(1));
                report(Instant::now(), false);
            }
        });
    });
}

fn lock() -> std::sync::MutexGuard<'static, Counters> {
    static COUNTERS: LazyLock<Mutex<Counters>> = LazyLock::new(Mutex::default);
    COUNTERS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Identity and words of a message, by which messages are compared.
#[derive(Clone, Debug, Default)]
struct Words {
    /// Source or file of the message.
    identity: String,
    /// Beginning of the message.
    text: String,
    /// Hash of all other fields without digits.
    hash: DefaultHasher,
}

impl Visit for Words {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        let value = format!("{value:?}");
        match field.name() {
            "source" | "log" | "path" | "file" | "interface" => {
                value.hash(&mut self.hash);
                let _ = write!(self.identity, "{}={value} ", field.name());
            }
            name => {
                name.hash(&mut self.hash);
                value
                    .chars()
                    .filter(|c| !c.is_ascii_digit())
                    .for_each(|c| c.hash(&mut self.hash));
                if name == "message" {
                    self.text = value.chars().take(TEXT_MAX).collect();
                }
            }
        }
    }
}

/// Counter of equal messages in one interval.
#[derive(Clone, Debug)]
struct Counter {
    since: Instant,
    level: Level,
    /// Words of the first message that was not printed.
    words: Words,
    printed: u64,
    suppressed: u64,
}

#[derive(Default)]
struct Counters(HashMap<(u64, Option<u64>), Counter>);

impl Counters {
    fn admit(&mut self, now: Instant, place: u64, level: Level, words: Words) -> bool {
        let words_hash = words.hash.finish();
        if self.0.len() >= COUNTERS_MAX {
            self.0
                .retain(|_, counter| counter.suppressed > 0 || now - counter.since < INTERVAL);
        }
        if self.0.len() < COUNTERS_MAX {
            let equal = self.counter(now, (place, Some(words_hash)), level, &words);
            if equal.printed >= EQUAL_MAX {
                equal.count_suppressed(words);
                return false;
            }
            equal.printed += 1;
        }
        let all = self.counter(now, (place, None), level, &words);
        if all.printed >= PLACE_MAX {
            all.count_suppressed(words);
            return false;
        }
        all.printed += 1;
        true
    }

    fn counter(
        &mut self,
        now: Instant,
        key: (u64, Option<u64>),
        level: Level,
        words: &Words,
    ) -> &mut Counter {
        let new = || Counter {
            since: now,
            level,
            words: words.clone(),
            printed: 0,
            suppressed: 0,
        };
        let counter = self.0.entry(key).or_insert_with(new);
        if counter.suppressed == 0 && now - counter.since >= INTERVAL {
            *counter = new();
        }
        counter
    }

    /// Removes and returns the counters with repetitions whose interval is over, or all of them.
    fn take_over(&mut self, now: Instant, all: bool) -> Vec<Counter> {
        let over = |counter: &Counter| all || now - counter.since >= INTERVAL;
        let mut found: Vec<_> = self
            .0
            .extract_if(|_, counter| over(counter))
            .map(|(_, counter)| counter)
            .filter(|counter| counter.suppressed > 0)
            .collect();
        found.sort_by_key(|counter| counter.since);
        found
    }
}

impl Counter {
    fn count_suppressed(&mut self, words: Words) {
        if self.suppressed == 0 {
            self.words = words;
        }
        self.suppressed += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(identity: &str, text: &str) -> Words {
        let mut words = Words {
            identity: identity.to_owned(),
            text: text.to_owned(),
            ..Words::default()
        };
        (identity, text.replace(|c: char| c.is_ascii_digit(), "")).hash(&mut words.hash);
        words
    }

    #[test]
    fn equal_messages_are_counted_and_others_pass() {
        let (mut counters, start) = (Counters::default(), Instant::now());
        let mut printed = 0;
        for number in 0..28_797_u64 {
            let now = start + Duration::from_micros(300 * number);
            let text = format!("fault {number}");
            printed += u64::from(counters.admit(now, 1, Level::WARN, words("source=imu ", &text)));
        }
        assert_eq!(printed, EQUAL_MAX);
        let late = start + Duration::from_secs(9);
        assert!(counters.admit(late, 1, Level::WARN, words("source=gnss ", "fault 1")));
        assert!(counters.admit(late, 1, Level::WARN, words("source=imu ", "no data")));
        assert!(counters.admit(late, 2, Level::ERROR, words("source=imu ", "fault 1")));
        assert!(counters.take_over(late, false).is_empty());
        let over = counters.take_over(start + INTERVAL, false);
        assert_eq!(over.len(), 1);
        assert_eq!(over[0].suppressed, 28_797 - EQUAL_MAX);
        assert_eq!(over[0].words.identity, "source=imu ");
        let again = start + INTERVAL;
        assert!(counters.admit(again, 1, Level::WARN, words("source=imu ", "fault 1")));
    }

    #[test]
    fn messages_that_all_differ_are_limited_and_cost_bounded_memory() {
        let (mut counters, now) = (Counters::default(), Instant::now());
        let mut printed = 0;
        for number in 0..20_000_u32 {
            let letters: String = number
                .to_string()
                .bytes()
                .map(|b| char::from(b + 49))
                .collect();
            printed += u64::from(counters.admit(now, 1, Level::INFO, words("", &letters)));
        }
        assert_eq!(printed, PLACE_MAX);
        assert!(counters.0.len() <= COUNTERS_MAX + 1);
        let suppressed: u64 = counters
            .take_over(now, true)
            .iter()
            .map(|c| c.suppressed)
            .sum();
        assert_eq!(suppressed, 20_000 - PLACE_MAX);
    }
}
