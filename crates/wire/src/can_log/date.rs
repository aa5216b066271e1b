//! Dates in the heads of logs. They are of the clock of the writer's computer and have no zone; the
//! results are UNIX times as if that clock showed UTC.

use super::number::{decimal, unsigned, words};
use crate::gps_time::unix_s_of_date;

const NANOS: i64 = 1_000_000_000;
const DAY_NS: i64 = 86_400 * NANOS;
/// Days from 1899-12-30, day zero of OLE dates, to 1970-01-01.
const OLE_UNIX_DAYS: i64 = 25_569;

/// Beginnings of the names of months in English, German, French, Spanish and Italian, in small letters
/// without accents.
const MONTHS: [&[&[u8]]; 12] = [
    &[b"jan", b"ene", b"gen"],
    &[b"feb", b"fev"],
    &[b"mar", b"mrz", b"mae"],
    &[b"apr", b"avr", b"abr"],
    &[b"may", b"mai", b"mag"],
    &[b"jun", b"juin", b"giu"],
    &[b"jul", b"juil", b"lug"],
    &[b"aug", b"aou", b"ago"],
    &[b"sep", b"set"],
    &[b"oct", b"okt", b"ott"],
    &[b"nov"],
    &[b"dec", b"dez", b"dic"],
];

/// UNIX time of a date (year, month, day) and a time of day (hour, minute, seconds in ns).
pub(super) fn unix_ns(date: [u32; 3], time: [u32; 2], second_ns: i64) -> Option<i64> {
    let [year, month, day] = date;
    let (year, month, day) = (year.try_into(), month.try_into(), day.try_into());
    let day_s = unix_s_of_date(year.ok()?, month.ok()?, day.ok()?)?;
    let [hour, minute] = time;
    let valid = hour < 24 && minute < 60 && (0..60 * NANOS).contains(&second_ns);
    let minutes = i64::from(60 * hour + minute);
    let of_day_ns = minutes.checked_mul(60 * NANOS)?.checked_add(second_ns)?;
    let unix = day_s.checked_mul(NANOS)?.checked_add(of_day_ns)?;
    valid.then_some(unix)
}

/// Begin of the day of a UNIX time.
pub(super) const fn midnight_ns(unix_ns: i64) -> i64 {
    unix_ns - unix_ns.rem_euclid(DAY_NS)
}

/// The date of a Vector log, after the word `date` or `Begin TriggerBlock`:
/// `Sat Sep 30 10:06:13.191 PM 2017`.
pub(super) fn vector_date(text: &[u8]) -> Option<i64> {
    let mut words = words(text);
    words.next()?;
    let month = month_of(words.next()?)?;
    let day = unsigned(words.next()?)?;
    let mut time = words.next()?.split(|byte| *byte == b':');
    let (hour, minute) = (unsigned(time.next()?)?, unsigned(time.next()?)?);
    let second_ns = decimal(time.next().unwrap_or(b"0"), 9)?;
    let mut year = words.next()?;
    let half = year.to_ascii_lowercase();
    // With an hour above 12, the clock is one of 24 h, whatever the letters say.
    let hour = match half.as_slice() {
        b"am" if hour == 12 => 0,
        b"pm" if hour < 12 => hour + 12,
        _ => hour,
    };
    if matches!(half.as_slice(), b"am" | b"pm") {
        year = words.next()?;
    }
    unix_ns([unsigned(year)?, month, day], [hour, minute], second_ns)
}

/// Number of a month by its name in UTF-8 or Windows-1252.
fn month_of(name: &[u8]) -> Option<u32> {
    let mut plain = Vec::with_capacity(name.len());
    let utf8 = std::str::from_utf8(name);
    let letters: Vec<char> = match utf8 {
        Ok(text) => text.chars().collect(),
        Err(_) => name.iter().map(|byte| char::from(*byte)).collect(),
    };
    plain.extend(letters.iter().filter_map(|letter| match letter {
        'ä' | 'Ä' | 'á' | 'à' => Some(b'a'),
        'é' | 'è' | 'É' => Some(b'e'),
        'û' | 'ü' | 'ù' | 'Û' => Some(b'u'),
        letter if letter.is_ascii_alphabetic() => Some(letter.to_ascii_lowercase() as u8),
        _ => None,
    }));
    let starts = |names: &&[&[u8]]| names.iter().any(|name| plain.starts_with(name));
    let position = MONTHS.iter().position(starts)?;
    u32::try_from(position + 1).ok()
}

/// UNIX time of an OLE date: days since 1899-12-30 as a decimal number.
pub(super) fn ole_date(text: &[u8]) -> Option<i64> {
    // Thirteen digits of the fraction are 8.64 ns.
    const DIGITS: u32 = 13;
    let scaled = i128::from(decimal(text, DIGITS)?);
    let ns =
        (scaled * i128::from(DAY_NS) + 5 * 10_i128.pow(DIGITS - 1)).div_euclid(10_i128.pow(DIGITS));
    let unix = ns - i128::from(OLE_UNIX_DAYS) * i128::from(DAY_NS);
    i64::try_from(unix).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ole_dates_count_from_the_end_of_1899() {
        // 2023-10-31T12:00:00 UTC.
        assert_eq!(ole_date(b"45230.5"), Some(1_698_753_600 * NANOS));
        let start = ole_date(b"45628.8602098843").expect("a date");
        // 2024-12-02T20:38:42.134 UTC; the text has ten digits, 8.64 us.
        assert!((start - 1_733_171_922_134_003_520).abs() < 9_000, "{start}");
    }

    #[test]
    fn months_of_latin_1_are_read() {
        let day = vector_date(b"Mon M\xE4r 2 07:08:09.010 2020");
        assert_eq!(day, vector_date("Mon Mär 2 07:08:09.010 2020".as_bytes()));
        assert_eq!(day, unix_ns([2020, 3, 2], [7, 8], 9 * NANOS + 10_000_000));
    }
}
