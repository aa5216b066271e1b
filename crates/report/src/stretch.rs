//! The part of a log that a command uses.

use sample::{Event, LogTime};
use store::{Reader, Record, Selection};

use crate::Error;

/// Time before and after an event or a mark, s.
pub const AROUND_S: f64 = 5.0;

/// Which part of a log is used: from and to a time, or around an event or a mark.
#[derive(Clone, Copy, Debug, Default)]
pub struct Stretch<'a> {
    /// Begin, s from the first message of the log.
    pub from_s: Option<f64>,
    /// End, s from the first message of the log.
    pub to_s: Option<f64>,
    /// Only [`AROUND_S`] around an event (its number from 1, or the first one of a kind) or the first mark
    /// with this text.
    pub around: Option<&'a str>,
}

impl Stretch<'_> {
    /// Begin and end in `reader`, s from its first message.
    ///
    /// # Errors
    /// If the log has no such event or mark, if the stretch is empty, or if the log cannot be read.
    pub fn seconds(&self, reader: &Reader) -> Result<[f64; 2], Error> {
        let (first, last) = reader.info().span.unwrap_or_default();
        let whole_s = last.seconds_since(first);
        let span_s = match self.around {
            Some(around) => {
                let at_s = moment(reader, around)?.seconds_since(first);
                [(at_s - AROUND_S).max(0.0), (at_s + AROUND_S).min(whole_s)]
            }
            None => [
                self.from_s.unwrap_or(0.0).max(0.0),
                self.to_s.unwrap_or(whole_s).min(whole_s),
            ],
        };
        if span_s[0] > span_s[1] {
            return Err(Error::Span {
                from_s: span_s[0],
                to_s: span_s[1],
                whole_s,
            });
        }
        Ok(span_s)
    }

    /// Begin and end in `reader`.
    ///
    /// # Errors
    /// As [`seconds`](Self::seconds).
    pub fn times(&self, reader: &Reader) -> Result<[LogTime; 2], Error> {
        let (first, _) = reader.info().span.unwrap_or_default();
        let span_s = self.seconds(reader)?;
        Ok(span_s.map(|time_s| first.offset_seconds(time_s)))
    }
}

/// The events of a log, in their order.
///
/// # Errors
/// If the log cannot be read.
pub fn events(reader: &Reader) -> store::Result<Vec<Event>> {
    let mut events = Vec::new();
    for message in reader.messages(Selection::topics(["/estimate/events"])) {
        if let Some(Record::Event(event)) = message?.record()? {
            events.push(event);
        }
    }
    Ok(events)
}

/// The marks of a log, in their order: time and text.
///
/// # Errors
/// If the log cannot be read.
pub fn marks(reader: &Reader) -> store::Result<Vec<(LogTime, String)>> {
    let mut marks = Vec::new();
    for message in reader.messages(Selection::topics(["/mark"])) {
        if let Some(Record::Mark { time, text }) = message?.record()? {
            marks.push((time, text));
        }
    }
    Ok(marks)
}

/// Time of the event with a number from 1, of the first of a kind, or of the first mark with a text.
fn moment(reader: &Reader, wanted: &str) -> Result<LogTime, Error> {
    let events = events(reader)?;
    let event = match wanted.parse::<usize>() {
        Ok(number) => number.checked_sub(1).and_then(|index| events.get(index)),
        Err(_) => events.iter().find(|event| event.kind.name() == wanted),
    };
    if let Some(event) = event {
        return Ok(event.time);
    }
    let marks = marks(reader)?;
    if let Some((time, _)) = marks.iter().find(|(_, text)| text == wanted) {
        return Ok(*time);
    }
    let mut kinds: Vec<&str> = events.iter().map(|event| event.kind.name()).collect();
    kinds.sort_unstable();
    kinds.dedup();
    Err(Error::NoEvent {
        wanted: wanted.to_owned(),
        count: events.len(),
        kinds: kinds.join(", "),
        marks: marks.into_iter().map(|(_, text)| text).collect(),
    })
}
