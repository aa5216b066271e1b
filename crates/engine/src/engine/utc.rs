//! Offset of UTC from the log clock, from a receiver that sends date and time.
//!
//! The fit of the receiver's clock maps a device time d to the log clock t(d). With the date, d is
//! UTC u(d), and the offset is
//!
//! offset = u(d) - (t(d) - transport delay)
//!
//! Its standard deviation is sqrt(jitter² + delay²): the jitter of the messages, and the constant
//! delay between the time tag and the arrival of the fastest message, which the arrivals do not show.

use wire::gps_time::{GPS_EPOCH_UNIX_S, SECONDS_PER_DAY, gps_minus_utc_s, unix_s_of_date};
use wire::{Message, nmea, novatel, sbf};

use super::clock::{ClockFit, ClockState, Scale};

/// Unknown constant delay of receiver and port, s: receivers send a solution up to some 0.2 s after
/// its time tag, which as a uniform distribution from 0 has this root mean square (0.2 / sqrt 3).
const DELAY_UNKNOWN_SIGMA_S: f64 = 0.115;
/// Unknown constant delay if the configuration sets `latency_s`, s.
const DELAY_KNOWN_SIGMA_S: f64 = 0.02;
/// Smallest number of messages of a fit that is used.
const MESSAGES_MIN: u64 = 5;
/// Value of Septentrio's leap seconds for "unknown".
const SBF_UNKNOWN: i8 = -128;
/// Largest plausible leap seconds in a message, s.
const LEAP_SECONDS_MAX: i32 = 60;

/// UTC information that a receiver has sent.
#[derive(Clone, Debug, Default)]
pub struct UtcClock {
    /// GPS time minus UTC that the receiver sent, s.
    leap_seconds: Option<i32>,
    /// UNIX time at zero of the device time of day, s, and the number of restarts of the fit then.
    day: Option<(f64, u32)>,
    /// Messages of the fits at the last offset.
    messages_used: [u64; 3],
}

/// An offset to UTC.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offset {
    /// UTC minus log clock, ns.
    pub offset_ns: i64,
    /// Standard deviation, s.
    pub sigma_s: f64,
    /// GPS time minus UTC that the receiver sent, s.
    pub leap_seconds: Option<i32>,
}

impl UtcClock {
    /// Processes the date or leap seconds of a message; `fits` have processed its time already.
    pub fn push(&mut self, message: &Message, fits: &[ClockFit; 3]) {
        let leap_seconds = match message {
            Message::Sbf(block) => match block.body {
                sbf::Body::ReceiverTime { leap_seconds, .. } if leap_seconds != SBF_UNKNOWN => {
                    Some(i32::from(leap_seconds))
                }
                _ => None,
            },
            Message::Novatel(log) => match &log.body {
                // 0 is invalid, 2 a warning that the receiver's own table was used.
                novatel::Body::Time(time) if time.utc_status == 1 => {
                    Some((-time.utc_offset_s).round() as i32)
                }
                _ => None,
            },
            Message::Nmea(sentence) => {
                self.push_date(sentence, &fits[Scale::UtcDay as usize]);
                None
            }
            _ => None,
        };
        let plausible = leap_seconds.filter(|seconds| (0..=LEAP_SECONDS_MAX).contains(seconds));
        self.leap_seconds = plausible.or(self.leap_seconds);
    }

    fn push_date(&mut self, sentence: &nmea::Sentence, fit: &ClockFit) {
        let (utc_s, date) = match *sentence {
            nmea::Sentence::Rmc {
                utc_s,
                date,
                quality,
                ..
            } if quality.is_solved() => (utc_s, date),
            nmea::Sentence::Zda { utc_s, date } => (utc_s, date),
            _ => return,
        };
        let midnight = date.and_then(|(year, month, day)| unix_s_of_date(year, month, day));
        let (Some(utc_s), Some(midnight_s), Some(state)) = (utc_s, midnight, fit.state()) else {
            return;
        };
        // The fit does not roll over at midnight, so that its zero is a midnight too.
        let days = ((midnight_s as f64 + utc_s - state.device_s) / SECONDS_PER_DAY).round();
        self.day = Some((days * SECONDS_PER_DAY, state.restarts));
    }

    /// Offset from the better of the fits that have a date; `None` if there was no message since the
    /// last call.
    pub fn offset(&mut self, fits: &[ClockFit; 3], transport_delay_s: f64) -> Option<Offset> {
        let mut best: Option<Offset> = None;
        for (fit, messages_used) in fits.iter().zip(&mut self.messages_used) {
            let Some(state) = fit.state().filter(|state| state.messages >= MESSAGES_MIN) else {
                continue;
            };
            if std::mem::replace(messages_used, state.messages) == state.messages {
                continue;
            }
            let zero_s = match state.scale {
                Scale::Gps => gps_zero_unix_s(&state, self.leap_seconds),
                Scale::UtcDay => self
                    .day
                    .filter(|(_, restarts)| *restarts == state.restarts)
                    .map(|(zero_s, _)| zero_s),
                Scale::Device => None,
            };
            let Some(zero_s) = zero_s else { continue };
            let offset = offset(&state, zero_s, transport_delay_s, self.leap_seconds);
            if best.is_none_or(|best| offset.sigma_s < best.sigma_s) {
                best = Some(offset);
            }
        }
        best
    }
}

/// UNIX time at zero of GPS time, minus the leap seconds that were sent or are in the table; `None` for
/// weeks whose high bits are taken from the log clock.
fn gps_zero_unix_s(state: &ClockState, leap_seconds: Option<i32>) -> Option<f64> {
    if !state.is_dated {
        return None;
    }
    let leap_seconds = leap_seconds
        .unwrap_or_else(|| gps_minus_utc_s(GPS_EPOCH_UNIX_S + state.device_s.floor() as i64));
    Some(GPS_EPOCH_UNIX_S as f64 - f64::from(leap_seconds))
}

fn offset(
    state: &ClockState,
    zero_unix_s: f64,
    transport_delay_s: f64,
    leap_seconds: Option<i32>,
) -> Offset {
    let nanos = |seconds: f64| (seconds * 1e9).round() as i64;
    let log_ns = i64::try_from(state.log_time.0).unwrap_or(i64::MAX);
    let unix_ns = nanos(zero_unix_s).saturating_add(nanos(state.device_s));
    let delay_sigma_s = if transport_delay_s > 0.0 {
        DELAY_KNOWN_SIGMA_S
    } else {
        DELAY_UNKNOWN_SIGMA_S
    };
    Offset {
        offset_ns: unix_ns
            .saturating_sub(log_ns)
            .saturating_add(nanos(transport_delay_s)),
        sigma_s: math::hypot(state.jitter_s, delay_sigma_s),
        leap_seconds,
    }
}

#[cfg(test)]
mod tests {
    use sample::{DeviceTime, FixQuality, LogTime};

    use super::*;

    /// 2002-01-01 00:00:05: a computer whose clock has no battery.
    const WRONG: LogTime = LogTime(1_009_843_205_000_000_000);
    /// 2026-11-21 23:59:50.
    const TRUE_S: f64 = 1_795_305_590.0;

    fn fits() -> [ClockFit; 3] {
        Scale::ALL.map(ClockFit::new)
    }

    fn rmc(utc_s: f64, date: (u16, u8, u8), valid: bool) -> Message {
        Message::Nmea(nmea::Sentence::Rmc {
            utc_s: Some(utc_s),
            quality: if valid {
                FixQuality::Single
            } else {
                FixQuality::None
            },
            position_deg: None,
            speed_m_s: None,
            course_deg: None,
            date: Some(date),
        })
    }

    /// A sentence per second across midnight, 30 to 60 ms late.
    fn drive_nmea(valid: bool) -> Option<Offset> {
        let (mut fits, mut utc) = (fits(), UtcClock::default());
        let mut last = None;
        for k in 0..30_u32 {
            let elapsed_s = f64::from(k);
            let arrival =
                WRONG.offset_seconds(elapsed_s + 0.03 + 0.03 * f64::from(k * 7 % 5) / 4.0);
            let time_of_day_s = (86_390.0 + elapsed_s) % SECONDS_PER_DAY;
            let date = if k < 10 {
                (2026, 11, 21)
            } else {
                (2026, 11, 22)
            };
            fits[1].push(DeviceTime::UtcTimeOfDay(time_of_day_s), arrival);
            utc.push(&rmc(time_of_day_s, date, valid), &fits);
            last = utc.offset(&fits, 0.0).or(last);
        }
        last
    }

    #[test]
    fn a_date_over_midnight_gives_the_offset_of_a_clock_that_is_decades_off() {
        let offset = drive_nmea(true).expect("date and time came");
        let error_s = offset.offset_ns as f64 * 1e-9 - (TRUE_S - WRONG.0 as f64 * 1e-9);
        // The fastest sentence is 30 ms late.
        assert!((error_s + 0.03).abs() < 0.005, "{error_s} s");
        assert!(
            error_s.abs() < 3.0 * offset.sigma_s && offset.sigma_s < 0.15,
            "{offset:?}"
        );
    }

    #[test]
    fn a_date_without_a_fix_is_ignored() {
        assert_eq!(drive_nmea(false), None);
    }

    fn drive_gps(week: u16, leap_seconds: Option<i8>) -> Option<Offset> {
        let (mut fits, mut utc) = (fits(), UtcClock::default());
        if let Some(leap_seconds) = leap_seconds {
            let body = sbf::Body::ReceiverTime {
                utc: [-128; 6],
                leap_seconds,
                sync_level: 7,
            };
            let block = sbf::Block::new(5914, 0, week, 0, body);
            utc.push(&Message::Sbf(block), &fits);
        }
        let mut last = None;
        for k in 0..10_u32 {
            let time_of_week_s = 1000.0 + f64::from(k);
            let device = DeviceTime::Gps {
                week: Some(week),
                time_of_week_s,
            };
            fits[0].push(device, WRONG.offset_seconds(f64::from(k)));
            last = utc.offset(&fits, 0.0).or(last);
        }
        last
    }

    #[test]
    fn leap_seconds_come_from_the_receiver_or_the_table() {
        let by_table = drive_gps(2367, None).expect("a date");
        let utc_ns = wire::gps_time::unix_ns_from_gps(2367, 1000.0);
        assert!((by_table.offset_ns - (utc_ns - WRONG.0 as i64)).abs() < 1_000);
        let sent = drive_gps(2367, Some(19)).expect("a date");
        assert!((by_table.offset_ns - sent.offset_ns - 1_000_000_000).abs() < 1_000);
        assert_eq!(sent.leap_seconds, Some(19));
        assert_eq!(drive_gps(2367, Some(SBF_UNKNOWN)), Some(by_table));
    }

    #[test]
    fn a_week_of_ten_bits_gives_no_date() {
        assert_eq!(drive_gps(2367 % 1024, None), None);
    }

    #[test]
    fn without_a_new_message_there_is_no_new_offset() {
        let (mut fits, mut utc) = (fits(), UtcClock::default());
        for k in 0..10_u32 {
            let device = DeviceTime::Gps {
                week: Some(2367),
                time_of_week_s: f64::from(k),
            };
            fits[0].push(device, WRONG.offset_seconds(f64::from(k)));
        }
        assert!(utc.offset(&fits, 0.0).is_some());
        assert_eq!(utc.offset(&fits, 0.0), None);
    }
}
