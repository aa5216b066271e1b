//! Times of the rows of a table.

use engine::config::{Clock, RowTime, Times};
use sample::LogTime;
use wire::gps_time::{unix_ns_from_gps, unix_s_of_date};
use wire::nanos;

use super::{START_DEFAULT_NS, UNIX_TIME_FROM_NS, log_time, shortened};

const SECOND_NS: i128 = 1_000_000_000;
const DAY_NS: i128 = 86_400 * SECOND_NS;
/// 1970-01-01 as spreadsheets count days.
const EXCEL_UNIX_DAYS: i128 = 25_569;
/// Days of a spreadsheet's dates that a recording can have: 1980 to 2100.
const EXCEL_DAYS: std::ops::Range<i128> = 29_221..73_051;

/// Reads the times of the rows in their order.
pub struct TimeReader<'m> {
    times: &'m Times,
    decimal_comma: bool,
    rows: u64,
    start_ns: Option<i128>,
    /// Times of day: the last one, and the begin of its day.
    last_ns: i128,
    day_ns: i128,
    /// Times of a column of numbers, as they are in the file.
    numbers_ns: Vec<i128>,
}

impl<'m> TimeReader<'m> {
    /// A reader before the first row.
    pub fn new(times: &'m Times, decimal_comma: bool) -> Self {
        Self {
            times,
            decimal_comma,
            rows: 0,
            start_ns: times.start_unix_ns.map(i128::from),
            last_ns: 0,
            day_ns: 0,
            numbers_ns: Vec::new(),
        }
    }

    /// The time of the next row, whose time and GPS week are `cells`.
    ///
    /// # Errors
    /// What is wrong with the cells.
    pub fn read(&mut self, cells: &[&str]) -> Result<LogTime, String> {
        let nanos = match &self.times.row {
            RowTime::Rate(rate_hz) => {
                let since_ns = (self.rows as f64 / rate_hz * 1e9).round() as i128;
                self.rows += 1;
                self.since_start(since_ns)
            }
            RowTime::Column {
                place, clock, week, ..
            } => {
                let cell = cells.first().copied().unwrap_or_default();
                let text = if self.decimal_comma {
                    cell.replace(',', ".")
                } else {
                    cell.to_owned()
                };
                let week = week
                    .as_ref()
                    .map(|_| cells.get(1).copied().unwrap_or_default());
                self.of_cell(*clock, &text, week).ok_or_else(|| {
                    format!(
                        "column {place}: \"{}\" is not a time{}",
                        shortened(cell),
                        hint(*clock, cell)
                    )
                })?
            }
        };
        log_time(nanos).ok_or_else(|| format!("the time {nanos} ns is out of range; correct it"))
    }

    fn of_cell(&mut self, clock: Clock, text: &str, week: Option<&str>) -> Option<i128> {
        match clock {
            Clock::Unit(unit_ns) => {
                let since_ns = nanos(text, unit_ns)?;
                if let Some(week) = week {
                    let week: u16 = week.trim().parse::<f64>().ok().map(|week| week as u16)?;
                    return gps(week, since_ns);
                }
                self.numbers_ns.push(since_ns);
                Some(self.since_start(since_ns))
            }
            Clock::Iso8601 => date_and_time(text),
            Clock::TimeOfDay => {
                let of_day = time_of_day(text)?;
                Some(self.within_days(of_day))
            }
            Clock::PackedTimeOfDay => {
                let of_day = unpacked(nanos(text, SECOND_NS as u64)?)?;
                Some(self.within_days(of_day))
            }
            Clock::ExcelDays => {
                let days_ns = nanos(text, DAY_NS as u64)?;
                let unix_ns = days_ns - EXCEL_UNIX_DAYS * DAY_NS;
                Some(if unix_ns < 0 {
                    self.since_start(days_ns)
                } else {
                    unix_ns
                })
            }
        }
    }

    fn since_start(&mut self, since_ns: i128) -> i128 {
        let start_ns = self
            .start_ns
            .get_or_insert(if since_ns > UNIX_TIME_FROM_NS {
                0
            } else {
                i128::from(START_DEFAULT_NS)
            });
        *start_ns + since_ns
    }

    /// A time of day as the time since the begin of the first day.
    fn within_days(&mut self, of_day_ns: i128) -> i128 {
        if !self.times.sort && of_day_ns < self.last_ns - DAY_NS / 2 {
            self.day_ns += DAY_NS;
        }
        self.last_ns = of_day_ns;
        let since_ns = self.day_ns + of_day_ns;
        self.since_start(since_ns)
    }

    /// Why the numbers of the time column are probably of another clock.
    pub fn doubt(&self) -> Option<String> {
        let RowTime::Column {
            clock: Clock::Unit(_),
            place,
            ..
        } = &self.times.row
        else {
            return None;
        };
        let unit = |name: &str, why: String| {
            Some(format!(
                "column {place}: {why}; set unit = \"{name}\" under [time] of the column map"
            ))
        };
        if let Some((before, after)) = packed_minute(&self.numbers_ns) {
            let why = format!(
                "the times are HHMMSS and not seconds: {} follows {}",
                as_seconds(after),
                as_seconds(before)
            );
            return unit("HHMMSS", why);
        }
        let days = self.numbers_ns.first().map(|first| first / SECOND_NS);
        let span_ns = self.numbers_ns.last().zip(self.numbers_ns.first());
        let span_ns = span_ns.map_or(0, |(last, first)| last - first);
        let rows = self.numbers_ns.len() as i128;
        if rows > 2
            && days.is_some_and(|days| EXCEL_DAYS.contains(&days))
            && span_ns < rows * 20_000
        {
            let why = "the times are days of a spreadsheet and not seconds".to_owned();
            return unit("Excel days", why);
        }
        None
    }
}

fn as_seconds(nanos: i128) -> f64 {
    nanos as f64 / 1e9
}

/// What a text that is no time of `clock` could be.
fn hint(clock: Clock, cell: &str) -> String {
    let found = if date_and_time(cell).is_some() {
        Clock::Iso8601
    } else if time_of_day(cell).is_some() {
        Clock::TimeOfDay
    } else {
        return "; correct the cell".to_owned();
    };
    let name = match found {
        _ if found == clock => return "; correct the cell".to_owned(),
        Clock::Iso8601 => "ISO 8601",
        _ => "HH:MM:SS",
    };
    format!("; set unit = \"{name}\" under [time] of the column map")
}

/// UNIX time of a GPS time, ns.
fn gps(week: u16, of_week_ns: i128) -> Option<i128> {
    // The leap seconds are those of the second; the rest is exact.
    let (whole_s, part_ns) = (
        of_week_ns.div_euclid(SECOND_NS),
        of_week_ns.rem_euclid(SECOND_NS),
    );
    let valid = (0..=7 * 86_400).contains(&whole_s);
    valid.then(|| i128::from(unix_ns_from_gps(week, whole_s as f64)) + part_ns)
}

/// Two adjacent times that differ by the 40 that HHMMSS leaves out at a full minute, if all times are
/// such numbers.
fn packed_minute(times_ns: &[i128]) -> Option<(i128, i128)> {
    let of_day: Option<Vec<i128>> = times_ns.iter().map(|time| unpacked(*time)).collect();
    let of_day = of_day?;
    let mut steps: Vec<i128> = of_day.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_unstable();
    let usual = steps.get(steps.len() / 2).copied()?;
    let pairs = times_ns.windows(2).zip(of_day.windows(2));
    let mut jumps = pairs.filter_map(|(raw, time)| {
        let (raw_step, step) = (raw[1] - raw[0], time[1] - time[0]);
        let is_usual = step > 0 && (usual / 2..=usual.saturating_mul(2)).contains(&step);
        let is_minute = raw_step - step >= 40 * SECOND_NS && is_usual;
        is_minute.then_some((raw[0], raw[1]))
    });
    jumps.next()
}

/// Time of day from a number of the form HHMMSS, whose seconds are `number_ns`; `None` if it has no
/// such form.
fn unpacked(number_ns: i128) -> Option<i128> {
    let (number, part_ns) = (
        number_ns.div_euclid(SECOND_NS),
        number_ns.rem_euclid(SECOND_NS),
    );
    let (hours, minutes, seconds) = (number / 10_000, number / 100 % 100, number % 100);
    let valid = number >= 0 && hours < 24 && minutes < 60 && seconds <= 60;
    valid.then(|| ((hours * 60 + minutes) * 60 + seconds) * SECOND_NS + part_ns)
}

/// `12:30:15.5`, `12:30`.
fn time_of_day(text: &str) -> Option<i128> {
    let mut parts = text.trim().split(':');
    let (hours, minutes) = (parts.next()?, parts.next()?);
    let seconds = parts.next().unwrap_or("0");
    if parts.next().is_some() {
        return None;
    }
    let number = |text: &str, limit: i128| {
        let number: i128 = text.parse().ok()?;
        (0..limit).contains(&number).then_some(number)
    };
    let seconds_ns = nanos(seconds, SECOND_NS as u64)?;
    (0..61 * SECOND_NS).contains(&seconds_ns).then_some(())?;
    Some((number(hours, 24)? * 60 + number(minutes, 60)?) * 60 * SECOND_NS + seconds_ns)
}

/// UNIX time of `2026-03-01T12:30:15.5+01:00` or of the compact form `20260301T123015.5Z`, ns.
fn date_and_time(text: &str) -> Option<i128> {
    let text = text.trim();
    let at = text.find(['T', 't', ' '])?;
    let (date, time) = (&text[..at], text[at + 1..].trim());
    let digits: String = date
        .chars()
        .filter(|c| !matches!(c, '-' | '/' | '.'))
        .collect();
    let separators = date.len() - digits.len();
    if digits.len() != 8 || !digits.is_ascii() || !matches!(separators, 0 | 2) {
        return None;
    }
    if separators == 2 && date.find(|c: char| !c.is_ascii_digit()) != Some(4) {
        // Day or month first is not clear.
        return None;
    }
    let part = |range: std::ops::Range<usize>| digits[range].parse::<u16>().ok();
    let (month, day) = (part(4..6)? as u8, part(6..8)? as u8);
    let day_s = unix_s_of_date(part(0..4)?, month, day)?;
    let zone_at = time.find(['Z', 'z', '+', '-']).unwrap_or(time.len());
    let (clock, zone) = time.split_at(zone_at);
    let clock = clock.trim().replace(',', ".");
    let of_day = match clock.contains(':') {
        true => time_of_day(&clock)?,
        false => unpacked(nanos(&clock, SECOND_NS as u64)?)?,
    };
    Some(i128::from(day_s) * SECOND_NS + of_day - zone_offset(zone)?)
}

/// Offset of a zone from UTC, ns: `Z`, `+01:00`, `-0530`, `+01` or nothing.
fn zone_offset(zone: &str) -> Option<i128> {
    let zone = zone.trim();
    if zone.is_empty() || zone.eq_ignore_ascii_case("z") {
        return Some(0);
    }
    let digits: String = zone[1..].chars().filter(|c| *c != ':').collect();
    let minutes: i128 = match digits.len() {
        2 => digits.parse::<i128>().ok()? * 60,
        4 => digits[..2].parse::<i128>().ok()? * 60 + digits[2..].parse::<i128>().ok()?,
        _ => return None,
    };
    let sign = if zone.starts_with('-') { -1 } else { 1 };
    Some(sign * minutes * 60 * SECOND_NS)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(clock: Clock, cells: &[&str]) -> Vec<i128> {
        let times = Times {
            row: RowTime::Column {
                place: wire::csv::Place::Number(1),
                clock,
                week: None,
            },
            start_unix_ns: None,
            sort: false,
        };
        let mut reader = TimeReader::new(&times, false);
        let read = |cell: &&str| reader.read(&[cell]).map(|time| i128::from(time.0));
        cells
            .iter()
            .map(read)
            .collect::<Result<_, _>>()
            .expect("times")
    }

    #[test]
    fn dates_and_times_of_day() {
        // date -u -d '2015-03-20 12:30:15' +%s
        let expected = 1_426_854_615_500_000_000;
        for text in [
            "2015-03-20T12:30:15.5Z",
            "2015-03-20 12:30:15.5",
            "2015-03-20T13:30:15.500+01:00",
            "2015/03/20 07:00:15.5-0530",
            "20150320T123015.5",
            "2015-03-20T12:30:15,5",
        ] {
            assert_eq!(date_and_time(text), Some(expected), "{text}");
        }
        for text in [
            "20.03.2015 12:30:15",
            "2015-03-20",
            "12:30:15",
            "2015-13-20T00:00:00",
        ] {
            assert_eq!(date_and_time(text), None, "{text}");
        }
        let start = i128::from(START_DEFAULT_NS);
        let found = times(Clock::TimeOfDay, &["23:59:59.5", "00:00:00.25"]);
        assert_eq!(found[1] - found[0], 750_000_000);
        assert_eq!(found[0] - start, 86_399 * SECOND_NS + 500_000_000);
        let found = times(Clock::PackedTimeOfDay, &["95959.5", "100000"]);
        assert_eq!(found[1] - found[0], 500_000_000);
        assert_eq!(found[0] - start, 35_999 * SECOND_NS + 500_000_000);
    }

    #[test]
    fn days_of_a_spreadsheet_and_gps_weeks() {
        // 42083.5 is noon of 2015-03-20.
        let found = times(Clock::ExcelDays, &["42083.5"]);
        assert_eq!(found, [1_426_852_800 * SECOND_NS]);
        // GPS week 1836, second 475216 is 2015-03-20 12:00:00 UTC: 16 leap seconds.
        let of_week = 475_216 * SECOND_NS + 250;
        assert_eq!(gps(1836, of_week), Some(1_426_852_800 * SECOND_NS + 250));
        assert_eq!(gps(1836, 700_000 * SECOND_NS), None);
    }

    #[test]
    fn times_of_another_clock_are_doubted() {
        let doubt = |cells: &[String]| {
            let times = Times {
                row: RowTime::Column {
                    place: wire::csv::Place::Number(1),
                    clock: Clock::Unit(SECOND_NS as u64),
                    week: None,
                },
                start_unix_ns: None,
                sort: false,
            };
            let mut reader = TimeReader::new(&times, false);
            for cell in cells {
                reader.read(&[cell]).expect("a number");
            }
            reader.doubt()
        };
        let packed: Vec<String> = (0..100)
            .map(|s| format!("{}", 123_000 + s / 60 * 100 + s % 60))
            .collect();
        let text = doubt(&packed).expect("a doubt");
        assert!(
            text.contains("123100 follows 123059") && text.contains("HHMMSS"),
            "{text}"
        );
        let seconds: Vec<String> = (0..1000).map(|s| format!("{}.5", 123_000 + s)).collect();
        assert_eq!(doubt(&seconds), None);
        assert_eq!(
            doubt(&["0.0".to_owned(), "59.0".to_owned(), "100.0".to_owned()]),
            None
        );
        let days: Vec<String> = (0..1000)
            .map(|row| format!("{:.9}", 42_083.5 + 0.01 / 86_400.0 * f64::from(row)))
            .collect();
        assert!(doubt(&days).expect("a doubt").contains("Excel days"));
        let text = hint(Clock::Unit(1), "12:30:15.5");
        assert!(text.contains("HH:MM:SS"), "{text}");
    }
}
