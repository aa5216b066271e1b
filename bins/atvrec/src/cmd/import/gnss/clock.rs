//! UNIX time of the messages of a receiver, from its own time.

use std::path::Path;

use sample::DeviceTime;
use wire::gnss::Decoder;
use wire::gps_time::{unix_ns_from_gps, unix_s_of_date};
use wire::{Item, Message, nmea};

use super::super::START_DEFAULT_NS;
use super::each_part;
use crate::interrupt::Interrupt;

const NANOS: i64 = 1_000_000_000;
const DAY_NS: i64 = 86_400 * NANOS;
const WEEK_S: f64 = 604_800.0;
/// GPS week of 2000-01-01, for files without a week.
const WEEK_DEFAULT: u16 = 1042;

/// The dates that the messages of a file tell first.
#[derive(Clone, Copy, Default)]
pub struct First {
    /// UNIX time of the midnight before the first message with a time of day, ns.
    pub midnight_ns: Option<i64>,
    /// GPS week.
    pub week: Option<u16>,
}

/// What earlier messages say about the time of later ones.
pub struct Clock {
    /// UNIX time of the midnight that times of day count from, ns.
    midnight_ns: i64,
    /// GPS week and time of week of the last message, s.
    week: (u16, f64),
    /// Last time, ns.
    last_ns: Option<i64>,
}

impl Clock {
    /// A clock before the first message.
    pub fn new(first: First) -> Self {
        let default_ns = START_DEFAULT_NS.cast_signed();
        Self {
            midnight_ns: first.midnight_ns.unwrap_or(default_ns),
            week: (first.week.unwrap_or(WEEK_DEFAULT), 0.0),
            last_ns: None,
        }
    }

    /// UNIX time of a message, ns; `None` if it has no time.
    pub fn time_ns(&mut self, item: &Item<'_>) -> Option<i64> {
        let midnight_ns = midnight_of(&item.message);
        let has_date = midnight_ns.is_some();
        self.midnight_ns = midnight_ns.unwrap_or(self.midnight_ns);
        let ns = match item.device_time? {
            DeviceTime::Gps {
                week: Some(week),
                time_of_week_s,
            } => {
                self.week = (week, time_of_week_s);
                unix_ns_from_gps(week, time_of_week_s)
            }
            DeviceTime::Gps {
                week: None,
                time_of_week_s,
            } => {
                let (mut week, last_s) = self.week;
                // A fall of half a week is the beginning of the next one.
                week = week.saturating_add((time_of_week_s < last_s - 0.5 * WEEK_S).into());
                self.week = (week, time_of_week_s);
                unix_ns_from_gps(week, time_of_week_s)
            }
            DeviceTime::UtcTimeOfDay(utc_s) => {
                let ns = self.midnight_ns + of_day_ns(utc_s);
                // After midnight, the date comes later than the first time of day.
                match self.last_ns {
                    Some(last_ns) if !has_date && ns < last_ns - DAY_NS / 2 => ns + DAY_NS,
                    _ => ns,
                }
            }
            DeviceTime::Counter { .. } | DeviceTime::AdapterNanos(_) => return None,
        };
        self.last_ns = Some(self.last_ns.map_or(ns, |last_ns| last_ns.max(ns)));
        Some(ns)
    }
}

/// UNIX time of the midnight before a message with a date, ns. A receiver without a solution may have
/// no valid date.
fn midnight_of(message: &Message) -> Option<i64> {
    let date = match message {
        Message::Nmea(nmea::Sentence::Rmc { date, quality, .. }) if quality.is_solved() => date,
        Message::Nmea(nmea::Sentence::Zda { date, .. }) => date,
        _ => return None,
    };
    let (year, month, day) = (*date)?;
    unix_s_of_date(year, month, day)?.checked_mul(NANOS)
}

/// A time of day, ns.
fn of_day_ns(utc_s: f64) -> i64 {
    (utc_s * NANOS as f64).round() as i64
}

/// The dates that the messages of a file tell first.
pub fn first_dates(path: &Path, interrupt: &Interrupt) -> anyhow::Result<First> {
    let mut decoder = Decoder::new();
    let mut first_ns = None;
    let mut found = First::default();
    each_part(path, |part| {
        interrupt.check()?;
        let is_known = found.midnight_ns.is_some() && found.week.is_some();
        let take = |item: Item<'_>| match item.device_time {
            Some(DeviceTime::Gps { week, .. }) => found.week = found.week.or(week),
            Some(DeviceTime::UtcTimeOfDay(utc_s)) => {
                let ns = of_day_ns(utc_s);
                let first_ns = *first_ns.get_or_insert(ns);
                // A file can begin before midnight, and have its first date after it.
                let is_next_day = ns < first_ns - DAY_NS / 2;
                let midnight_ns = midnight_of(&item.message);
                let first = midnight_ns.map(|ns| ns - if is_next_day { DAY_NS } else { 0 });
                found.midnight_ns = found.midnight_ns.or(first);
            }
            _ => {}
        };
        if let (Some(bytes), false) = (part, is_known) {
            decoder.push(bytes, take);
        }
        Ok(())
    })?;
    Ok(found)
}
