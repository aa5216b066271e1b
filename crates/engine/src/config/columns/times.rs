//! Times of the rows of a table.

use model::file::{ErrorCollector, Field, Section};
use wire::csv;

use super::PlaceValue;

/// Clocks of a time column by their names in a map, without blanks, `_` and `-`, in small letters; the
/// first of equal clocks is the name in messages.
const CLOCKS: [(&str, Clock); 15] = [
    ("s", Clock::Unit(1_000_000_000)),
    ("ms", Clock::Unit(1_000_000)),
    ("us", Clock::Unit(1_000)),
    ("ns", Clock::Unit(1)),
    ("min", Clock::Unit(60_000_000_000)),
    ("iso8601", Clock::Iso8601),
    ("hh:mm:ss", Clock::TimeOfDay),
    ("hhmmss", Clock::PackedTimeOfDay),
    ("exceldays", Clock::ExcelDays),
    ("excel", Clock::ExcelDays),
    ("exceldate", Clock::ExcelDays),
    ("iso", Clock::Iso8601),
    ("gps", Clock::Unit(1_000_000_000)),
    ("gpss", Clock::Unit(1_000_000_000)),
    ("gpsms", Clock::Unit(1_000_000)),
];
/// The clocks in messages.
const NAMES: &str = "s, ms, us, ns, min, ISO 8601, HH:MM:SS, HHMMSS, Excel days; for GPS time s or ms, \
                     with week = \"<column>\"";

/// What the cells of a time column are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// Numbers of units of this length, ns.
    Unit(u64),
    /// Dates with times, as `2026-03-01T12:30:15.5Z`; without a zone in UTC.
    Iso8601,
    /// Times of day, as `12:30:15.5`; the day changes at midnight.
    TimeOfDay,
    /// Times of day without colons, as `123015.5`.
    PackedTimeOfDay,
    /// Days since 1899-12-30, as spreadsheets count them.
    ExcelDays,
}

/// Source of the time of a row.
#[derive(Clone, Debug, PartialEq)]
pub enum RowTime {
    /// A column.
    Column {
        /// Its place.
        place: csv::Place,
        /// What its cells are.
        clock: Clock,
        /// Column of the GPS week, in which the time counts.
        week: Option<csv::Place>,
    },
    /// Rows at a constant rate, Hz, the first at time zero.
    Rate(f64),
}

/// Conversion of the time of a table to the log clock.
#[derive(Clone, Debug, PartialEq)]
pub struct Times {
    /// Source of the time of a row.
    pub row: RowTime,
    /// UNIX time of time zero, ns; `None` leaves it to the importer.
    pub start_unix_ns: Option<u64>,
    /// Whether the rows are sorted by time.
    pub sort: bool,
}

impl RowTime {
    /// Columns that the time needs.
    #[must_use]
    pub fn places(&self) -> Vec<csv::Place> {
        match self {
            Self::Column { place, week, .. } => {
                std::iter::once(place).chain(week).cloned().collect()
            }
            Self::Rate(_) => Vec::new(),
        }
    }

    /// Whether the times are dates, which need no time zero.
    const fn is_absolute(&self) -> bool {
        match self {
            Self::Column { clock, week, .. } => {
                week.is_some() || matches!(clock, Clock::Iso8601 | Clock::ExcelDays)
            }
            Self::Rate(_) => false,
        }
    }
}

/// Reads the table `[time]` of a map.
pub(super) fn read(mut section: Section<'_>, collector: &mut ErrorCollector<'_>) -> Times {
    let column = section.optional::<PlaceValue>("column", collector);
    let week = section.optional::<PlaceValue>("week", collector);
    let rate = section.optional::<f64>("rate_hz", collector);
    let unit = section.optional::<String>("unit", collector);
    let start = section.optional::<f64>("start_unix_s", collector);
    let sort = section.or("sort", false, collector);
    let clock = unit
        .as_ref()
        .map_or(CLOCKS[0].1, |field| read_clock(field, collector));
    if let Some(week) = &week
        && !matches!(clock, Clock::Unit(_))
    {
        let message = "a GPS week needs seconds or milliseconds of the week";
        collector.add(
            &week.span,
            &week.name,
            message,
            "set unit = \"s\" or \"ms\"",
        );
    }
    let is_gps = unit
        .as_ref()
        .is_some_and(|field| plain(&field.value).starts_with("gps"));
    if is_gps && week.is_none() {
        let help =
            "set week = \"<column>\", or unit = \"s\" or \"ms\" for times of an unknown week";
        collector.add(
            &section.span(),
            "time.week",
            "GPS time needs its week",
            help,
        );
    }
    let week = week.map(|field| field.value.0);
    let row = match (column, rate) {
        (Some(column), None) => RowTime::Column {
            place: column.value.0,
            clock,
            week,
        },
        (None, Some(rate)) => RowTime::Rate(read_rate(&rate, collector)),
        (given, _) => {
            let message = match given {
                Some(_) => "both a column and a rate are set",
                None => "missing",
            };
            let help = "set either column = \"<name>\" or rate_hz = <number>";
            collector.add(&section.span(), "time", message, help);
            RowTime::Rate(1.0)
        }
    };
    if let Some(start) = start.as_ref().filter(|_| row.is_absolute()) {
        let message = "the times of the column have a date, so that they have no time zero";
        collector.add(&start.span, &start.name, message, "remove start_unix_s");
    }
    section.finish(collector);
    Times {
        row,
        start_unix_ns: start.map(|field| (field.value.max(0.0) * 1e9).round() as u64),
        sort,
    }
}

fn plain(name: &str) -> String {
    name.to_lowercase().replace([' ', '_', '-'], "")
}

fn read_clock(field: &Field<String>, collector: &mut ErrorCollector<'_>) -> Clock {
    let name = plain(&field.value);
    let found = CLOCKS.iter().find(|(known, _)| *known == name);
    found.map_or_else(
        || {
            collector.add(
                &field.span,
                &field.name,
                format!("\"{}\" is no clock", field.value),
                format!("use one of: {NAMES}"),
            );
            Clock::Unit(1)
        },
        |(_, clock)| *clock,
    )
}

fn read_rate(rate: &Field<f64>, collector: &mut ErrorCollector<'_>) -> f64 {
    if rate.value > 0.0 && rate.value <= 1e6 {
        return rate.value;
    }
    collector.add(
        &rate.span,
        &rate.name,
        format!("{} Hz is out of range", rate.value),
        "use a rate above 0 and up to 1000000",
    );
    1.0
}
