//! GPS time, UNIX time and the civil date and time of UTC.
//!
//! GPS time began on 1980-01-06 00:00:00 UTC and has no leap seconds. UNIX time counts days of
//! 86,400 s: a leap second and the second after it have the same number.

/// Seconds in a day.
pub const SECONDS_PER_DAY: f64 = 86_400.0;
/// Seconds in a GPS week.
pub const SECONDS_PER_WEEK: f64 = 604_800.0;
/// Milliseconds in a GPS week.
pub const MILLISECONDS_PER_WEEK: u32 = 604_800_000;
/// UNIX time of the GPS epoch, s.
pub const GPS_EPOCH_UNIX_S: i64 = 315_964_800;

/// UNIX time from which GPS - UTC has the value beside it, s (IERS Bulletin C; none since 2017).
const LEAP_SECONDS: [(i64, i32); 18] = [
    (362_793_600, 1),
    (394_329_600, 2),
    (425_865_600, 3),
    (489_024_000, 4),
    (567_993_600, 5),
    (631_152_000, 6),
    (662_688_000, 7),
    (709_948_800, 8),
    (741_484_800, 9),
    (773_020_800, 10),
    (820_454_400, 11),
    (867_715_200, 12),
    (915_148_800, 13),
    (1_136_073_600, 14),
    (1_230_768_000, 15),
    (1_341_100_800, 16),
    (1_435_708_800, 17),
    (1_483_228_800, 18),
];

/// GPS minus UTC in whole seconds at a UNIX time.
#[must_use]
pub fn gps_minus_utc_s(unix_s: i64) -> i32 {
    LEAP_SECONDS
        .iter()
        .rev()
        .find(|(from, _)| unix_s >= *from)
        .map_or(0, |(_, seconds)| *seconds)
}

/// UNIX time in ns of a GPS instant, by the table of leap seconds.
#[must_use]
pub fn unix_ns_from_gps(week: u16, time_of_week_s: f64) -> i64 {
    let gps_ns = i64::from(week) * 604_800_000_000_000 + (time_of_week_s * 1e9).round() as i64;
    let unix_ns = gps_ns + GPS_EPOCH_UNIX_S * 1_000_000_000;
    let unix_s = unix_ns.div_euclid(1_000_000_000);
    // The table is in UTC: look with the first guess, then with the corrected one.
    let guess = i64::from(gps_minus_utc_s(unix_s));
    let offset = i64::from(gps_minus_utc_s(unix_s - guess));
    unix_ns - offset * 1_000_000_000
}

/// Midnight UTC of a Gregorian date as UNIX time, s; `None` for a date that does not exist (era
/// arithmetic with years that begin in March).
#[must_use]
pub fn unix_s_of_date(year: u16, month: u8, day: u8) -> Option<i64> {
    let is_leap = year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
    let days = match month {
        4 | 6 | 9 | 11 => 30,
        2 => 28 + u8::from(is_leap),
        1..=12 => 31,
        _ => return None,
    };
    if !(1..=days).contains(&day) {
        return None;
    }
    let (month, day) = (i64::from(month), i64::from(day));
    let shifted_year = i64::from(year) - i64::from(month <= 2);
    let era = shifted_year.div_euclid(400);
    let year_of_era = shifted_year - era * 400;
    let day_of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    let day_of_era = year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year;
    Some((era * 146_097 + day_of_era - 719_468) * 86_400)
}

/// GPS week and time of week of a UNIX time in ns. Instants before the GPS epoch give week 0.
#[must_use]
pub fn gps_from_unix_ns(unix_ns: i64) -> (u16, f64) {
    let offset = i64::from(gps_minus_utc_s(unix_ns.div_euclid(1_000_000_000)));
    let gps_ns = (unix_ns - (GPS_EPOCH_UNIX_S - offset) * 1_000_000_000).max(0);
    let week_ns = 604_800_000_000_000;
    ((gps_ns / week_ns) as u16, (gps_ns % week_ns) as f64 / 1e9)
}

/// The week with the low ten bits of `week` that lies nearest to `near`. GPS satellites send ten
/// bits, which roll over every 19.6 years; old receivers pass that on.
#[must_use]
pub fn unroll_week(week: u16, near: u16) -> u16 {
    let (low, near) = (i32::from(week) & 1023, i32::from(near));
    let base = near - (near & 1023) + low;
    [base - 1024, base, base + 1024]
        .into_iter()
        .filter(|candidate| (0..=i32::from(u16::MAX)).contains(candidate))
        .min_by_key(|candidate| (candidate - near).abs())
        .map_or(week, |candidate| candidate as u16)
}

/// The week that a receiver means by `week` where the host's clock says `near`.
///
/// Receivers lose the high bits of the week in two ways: old ones pass on the ten bits that the
/// satellites send, and ones whose firmware is past its base date are 1024 weeks behind. Hosts may
/// be wrong too (no battery behind their clock), by any number of years. So a week below 1024,
/// which ended in August 1999, is one of ten bits; a later one is corrected only where it is then
/// within a year of the host's; anything else is the receiver's word against the host's, and stays.
#[must_use]
pub fn meant_week(week: u16, near: u16) -> u16 {
    const YEAR_WEEKS: u16 = 52;
    let unrolled = unroll_week(week, near);
    if week < 1024 || unrolled.abs_diff(near) <= YEAR_WEEKS {
        unrolled
    } else {
        week
    }
}

/// Civil date and time, UTC, Gregorian calendar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Utc {
    /// Year.
    pub year: u32,
    /// Month, 1 to 12.
    pub month: u8,
    /// Day of the month, from 1.
    pub day: u8,
    /// Hour, 0 to 23.
    pub hour: u8,
    /// Minute, 0 to 59.
    pub minute: u8,
    /// Second, 0 to 59.
    pub second: u8,
}

impl Utc {
    /// Civil date and time of a UNIX time, s, up to the year 11,000,000.
    #[must_use]
    pub fn of_unix_s(unix_s: u64) -> Self {
        let (year, month, day) = civil_date((unix_s / 86_400) as u32);
        let second = unix_s % 86_400;
        Self {
            year,
            month,
            day,
            hour: (second / 3_600) as u8,
            minute: (second / 60 % 60) as u8,
            second: (second % 60) as u8,
        }
    }

    /// The basic format of ISO 8601, `20261121T140500Z`.
    #[must_use]
    pub fn compact(self) -> String {
        let Self {
            year,
            month,
            day,
            hour,
            minute,
            second,
        } = self;
        format!("{year:04}{month:02}{day:02}T{hour:02}{minute:02}{second:02}Z")
    }
}

/// Year, month and day of days since 1970-01-01 (era arithmetic with years that begin in March, so
/// that the leap day is the last day of a year).
fn civil_date(unix_days: u32) -> (u32, u8, u8) {
    let shifted = u64::from(unix_days) + 719_468;
    let era = shifted / 146_097;
    let day_of_era = shifted % 146_097;
    let year_of_era =
        (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = (month_from_march + 2) % 12 + 1;
    let year = era * 400 + year_of_era + u64::from(month <= 2);
    (year as u32, month as u8, day as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn civil_dates_of_unix_time() {
        for (unix_s, text) in [
            (0, "19700101T000000Z"),
            (315_964_799, "19800105T235959Z"),
            (951_782_400, "20000229T000000Z"),
            (1_239_753_600, "20090415T000000Z"),
            (1_709_251_199, "20240229T235959Z"),
            (1_709_251_200, "20240301T000000Z"),
            (1_795_273_261, "20261121T150101Z"),
            (4_107_542_399, "21000228T235959Z"),
            (4_107_542_400, "21000301T000000Z"),
        ] {
            assert_eq!(Utc::of_unix_s(unix_s).compact(), text);
        }
        let far = Utc::of_unix_s(u64::from(u32::MAX) * 86_400);
        assert_eq!(
            (far.year, far.month, far.day),
            (11_761_191, 1, 20),
            "{far:?}"
        );
    }

    #[test]
    fn a_date_and_its_unix_time_are_inverse() {
        for day in (0..80_000_u64).step_by(7) {
            let utc = Utc::of_unix_s(day * 86_400);
            let back = unix_s_of_date(utc.year as u16, utc.month, utc.day);
            assert_eq!(back, Some(day as i64 * 86_400), "{utc:?}");
        }
    }

    #[test]
    fn a_receiver_is_corrected_only_where_its_host_bears_that_out() {
        // Ten bits of week 2367, and the same receiver a week on either side of a rollover.
        assert_eq!(meant_week(2367 % 1024, 2367), 2367);
        assert_eq!(meant_week(1023, 2048), 2047);
        assert_eq!(meant_week(0, 2047), 2048);
        // Firmware past its base date: 2005 for 2025.
        assert_eq!(meant_week(2367 - 1024, 2370), 2367);
        // The host's clock stands in 2002, the receiver is right in 2014.
        assert_eq!(meant_week(1790, 1147), 1790);
        assert_eq!(meant_week(1790, 1790), 1790);
    }

    #[test]
    fn leap_seconds_change_on_their_day() {
        assert_eq!(gps_minus_utc_s(0), 0);
        assert_eq!(gps_minus_utc_s(1_483_228_799), 17);
        assert_eq!(gps_minus_utc_s(1_483_228_800), 18);
        // 2014-06-01: the thesis's years.
        assert_eq!(gps_minus_utc_s(1_401_580_800), 16);
    }

    #[test]
    fn dates_are_days_since_1970() {
        assert_eq!(unix_s_of_date(1970, 1, 1), Some(0));
        assert_eq!(unix_s_of_date(2000, 2, 29), Some(951_782_400));
        assert_eq!(unix_s_of_date(2017, 1, 1), Some(1_483_228_800));
        for (year, month, day) in [
            (2023, 2, 29),
            (1900, 2, 29),
            (2023, 0, 1),
            (2023, 4, 31),
            (2023, 13, 1),
            (2023, 1, 0),
        ] {
            assert_eq!(unix_s_of_date(year, month, day), None);
        }
    }

    #[test]
    fn weeks_and_unix_time_agree() {
        // Receiver record of 2025-05-23 14:11:00 UTC: week 2367, 483078 s, 18 leap seconds.
        assert_eq!(unix_ns_from_gps(2367, 483_078.0), 1_748_009_460_000_000_000);
        for unix_s in [
            400_000_000,
            1_000_000_000,
            1_483_228_799,
            1_483_228_801,
            1_748_009_460_i64,
        ] {
            let (week, tow) = gps_from_unix_ns(unix_s * 1_000_000_000);
            assert_eq!(unix_ns_from_gps(week, tow), unix_s * 1_000_000_000);
        }
    }

    #[test]
    fn weeks_unroll_to_the_nearest() {
        assert_eq!(unroll_week(2367, 2360), 2367);
        assert_eq!(unroll_week(2367 & 1023, 2360), 2367);
        assert_eq!(unroll_week(1687 & 1023, 1700), 1687);
        assert_eq!(unroll_week(1023, 2048), 2047);
        assert_eq!(unroll_week(0, 2047), 2048);
        assert_eq!(unroll_week(5, 0), 5);
    }
}
