//! Fit of a device clock to the log clock.
//!
//! A message cannot arrive before it is sent. The messages with the smallest delay therefore show the
//! offset of the device clock; port, driver and scheduler delay the others. With device time d and log
//! time t, both relative to the first pair (d_0, t_0), each message gives
//!
//! r = (t - t_0) - (d - d_0) = o + k (d - d_0) + delay, delay >= 0
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | o | offset | s |
//! | k | drift: rate of the log clock relative to the device clock, minus 1 | s/s |
//!
//! The smallest r of each second is kept. k is the slope of a least-squares line through these minima,
//! and o is the largest value for which the line is below all of them. The delay of the fastest message
//! remains in o; the source's `latency_s` removes it if it is known.

use std::collections::VecDeque;

use sample::{DeviceTime, LogTime};
use wire::gps_time::{SECONDS_PER_DAY, SECONDS_PER_WEEK, gps_from_unix_ns, meant_week};

/// Device time over which a minimum is taken, s.
const WINDOW_S: f64 = 1.0;
/// Number of minima that are kept.
const WINDOWS_MAX: usize = 128;
/// Smallest span of the minima for which a drift is fitted, s.
const DRIFT_SPAN_MIN_S: f64 = 20.0;
/// Largest plausible drift of two crystal clocks, s/s.
const DRIFT_MAX: f64 = 500e-6;
/// Largest time before the line of a message that agrees with the fit, s.
const EARLY_MAX_S: f64 = 0.5;
/// Largest time after the line of a message that agrees with the fit, s.
const LATE_MAX_S: f64 = 2.0;
/// Number of consecutive messages outside these limits after which the fit is restarted, because the
/// device clock was set.
const CONTRADICTIONS_MAX: u32 = 8;
/// Week numbers below this may have ten bits only.
const WEEK_OF_TEN_BITS_END: u16 = 1024;

/// Time scale of a device time; each scale has its own fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Scale {
    /// GPS week and time of week.
    Gps,
    /// UTC time of day.
    UtcDay,
    /// Time since the start of the device.
    Device,
}

impl Scale {
    /// All scales.
    pub const ALL: [Self; 3] = [Self::Gps, Self::UtcDay, Self::Device];

    /// Scale of a device time; `None` for counters.
    pub const fn of(device: DeviceTime) -> Option<Self> {
        match device {
            DeviceTime::Gps { .. } => Some(Self::Gps),
            DeviceTime::UtcTimeOfDay(_) => Some(Self::UtcDay),
            DeviceTime::AdapterNanos(_) => Some(Self::Device),
            DeviceTime::Counter { .. } => None,
        }
    }
}

/// State of a fit for the log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockState {
    /// Time scale.
    pub scale: Scale,
    /// Device time of the last message, s on its scale.
    pub device_s: f64,
    /// The same instant on the log clock.
    pub log_time: LogTime,
    /// Drift k, s/s.
    pub drift: f64,
    /// Standard deviation of the delays in the last window, s.
    pub jitter_s: f64,
    /// Number of messages since the last start of the fit.
    pub messages: u64,
    /// Number of restarts because the device clock was set.
    pub restarts: u32,
    /// Whether the device time alone gives the date: GPS time with a week of more than ten bits. The
    /// high bits of a week of ten bits are taken from the log clock.
    pub is_dated: bool,
}

/// Lower-envelope fit of one device clock.
#[derive(Clone, Debug)]
pub struct ClockFit {
    scale: Scale,
    origin: Option<(f64, LogTime)>,
    minima: VecDeque<[f64; 2]>,
    window: Option<Window>,
    offset_s: f64,
    drift: f64,
    jitter_s: f64,
    last_device_s: f64,
    messages: u64,
    contradictions: u32,
    restarts: u32,
    is_dated: bool,
    /// By how much the last message has lowered the line at its device time, s.
    fell_s: f64,
}

#[derive(Clone, Copy, Debug)]
struct Window {
    start_s: f64,
    least: [f64; 2],
    late_sum_s: f64,
    late_square_sum_s2: f64,
    count: u32,
}

impl Window {
    fn jitter_s(&self) -> f64 {
        let count = f64::from(self.count);
        let mean_s = self.late_sum_s / count;
        (self.late_square_sum_s2 / count - mean_s * mean_s)
            .max(0.0)
            .sqrt()
    }
}

impl ClockFit {
    /// Fit before the first message.
    pub fn new(scale: Scale) -> Self {
        Self {
            scale,
            origin: None,
            minima: VecDeque::new(),
            window: None,
            offset_s: 0.0,
            drift: 0.0,
            jitter_s: 0.0,
            last_device_s: 0.0,
            messages: 0,
            contradictions: 0,
            restarts: 0,
            is_dated: false,
            fell_s: 0.0,
        }
    }

    /// Processes a device time that arrived at `log_time` and returns its instant on the log clock,
    /// which is never later than `log_time`. `None` if the device time has another scale or is not
    /// finite.
    pub fn push(&mut self, device: DeviceTime, log_time: LogTime) -> Option<LogTime> {
        self.fell_s = 0.0;
        let device_s = self.unroll(device, log_time)?;
        self.is_dated = matches!(device, DeviceTime::Gps { week: Some(week), .. } if week >= WEEK_OF_TEN_BITS_END);
        let Some((device_0, log_0)) = self.origin else {
            self.restart(device_s, log_time);
            return Some(log_time);
        };
        let elapsed_s = device_s - device_0;
        let residual_s = log_time.seconds_since(log_0) - elapsed_s;
        let before_s = self.offset_s + self.drift * elapsed_s;
        let late_s = residual_s - self.offset_s - self.drift * elapsed_s;
        if !(-EARLY_MAX_S..=LATE_MAX_S).contains(&late_s) {
            self.contradictions += 1;
            if self.contradictions >= CONTRADICTIONS_MAX {
                self.restarts += 1;
                self.restart(device_s, log_time);
                return Some(log_time);
            }
            // Until the restart, a late message is treated as a message of a backlog.
            return Some(self.map(device_s).min(log_time));
        }
        self.contradictions = 0;
        self.messages += 1;
        self.last_device_s = device_s;
        self.add(elapsed_s, residual_s, late_s.max(0.0));
        if late_s < 0.0 {
            self.offset_s += late_s;
        }
        self.fell_s = before_s - self.offset_s - self.drift * elapsed_s;
        Some(self.map(device_s).min(log_time))
    }

    /// By how much the last message has lowered the instants of device times, ns; negative if it has
    /// raised them.
    pub fn fell_ns(&self) -> i64 {
        (self.fell_s * 1e9) as i64
    }

    /// State for the log; `None` before the first message.
    pub fn state(&self) -> Option<ClockState> {
        self.origin?;
        Some(ClockState {
            scale: self.scale,
            device_s: self.last_device_s,
            log_time: self.map(self.last_device_s),
            drift: self.drift,
            jitter_s: self.jitter_s,
            messages: self.messages,
            restarts: self.restarts,
            is_dated: self.is_dated,
        })
    }

    fn map(&self, device_s: f64) -> LogTime {
        let Some((device_0, log_0)) = self.origin else {
            return LogTime::default();
        };
        let elapsed_s = device_s - device_0;
        log_0.offset_seconds(elapsed_s + self.offset_s + self.drift * elapsed_s)
    }

    fn restart(&mut self, device_s: f64, log_time: LogTime) {
        self.origin = Some((device_s, log_time));
        self.minima.clear();
        self.window = None;
        self.offset_s = 0.0;
        self.drift = 0.0;
        self.contradictions = 0;
        self.messages = 1;
        self.last_device_s = device_s;
        self.add(0.0, 0.0, 0.0);
    }

    fn add(&mut self, elapsed_s: f64, residual_s: f64, late_s: f64) {
        match &mut self.window {
            Some(window) if elapsed_s - window.start_s < WINDOW_S => {
                if residual_s < window.least[1] {
                    window.least = [elapsed_s, residual_s];
                }
                window.late_sum_s += late_s;
                window.late_square_sum_s2 += late_s * late_s;
                window.count += 1;
            }
            window => {
                let full = window.replace(Window {
                    start_s: elapsed_s,
                    least: [elapsed_s, residual_s],
                    late_sum_s: late_s,
                    late_square_sum_s2: late_s * late_s,
                    count: 1,
                });
                if let Some(full) = full {
                    self.jitter_s = full.jitter_s();
                    if self.minima.len() == WINDOWS_MAX {
                        self.minima.pop_front();
                    }
                    self.minima.push_back(full.least);
                    self.fit();
                }
            }
        }
    }

    fn fit(&mut self) {
        let (Some(first), Some(last)) = (self.minima.front(), self.minima.back()) else {
            return;
        };
        if last[0] - first[0] >= DRIFT_SPAN_MIN_S {
            self.drift = slope(&self.minima).clamp(-DRIFT_MAX, DRIFT_MAX);
        }
        let drift = self.drift;
        self.offset_s = self
            .minima
            .iter()
            .map(|[elapsed_s, residual_s]| residual_s - drift * elapsed_s)
            .fold(f64::INFINITY, f64::min);
    }

    /// Device time as seconds that do not roll over. The high bits of a week of ten bits follow from the
    /// log clock, which starts as UTC.
    fn unroll(&self, device: DeviceTime, log_time: LogTime) -> Option<f64> {
        let (value, period_s) = match (self.scale, device) {
            (
                Scale::Gps,
                DeviceTime::Gps {
                    week: Some(week),
                    time_of_week_s,
                },
            ) => {
                let (near, _) = gps_from_unix_ns(i64::try_from(log_time.0).unwrap_or(i64::MAX));
                let week = meant_week(week, near);
                (f64::from(week) * SECONDS_PER_WEEK + time_of_week_s, None)
            }
            (
                Scale::Gps,
                DeviceTime::Gps {
                    week: None,
                    time_of_week_s,
                },
            ) => (time_of_week_s, Some(SECONDS_PER_WEEK)),
            (Scale::UtcDay, DeviceTime::UtcTimeOfDay(time_of_day_s)) => {
                (time_of_day_s, Some(SECONDS_PER_DAY))
            }
            (Scale::Device, DeviceTime::AdapterNanos(ns)) => (ns as f64 * 1e-9, None),
            _ => return None,
        };
        if !value.is_finite() {
            return None;
        }
        Some(match (period_s, self.origin) {
            (Some(period_s), Some(_)) => {
                let turns = ((self.last_device_s - value) / period_s).round();
                value + turns * period_s
            }
            _ => value,
        })
    }
}

/// Slope of the least-squares line through points (x, y).
fn slope(points: &VecDeque<[f64; 2]>) -> f64 {
    let count = points.len() as f64;
    let mean_x = points.iter().map(|p| p[0]).sum::<f64>() / count;
    let mean_y = points.iter().map(|p| p[1]).sum::<f64>() / count;
    let (mut xy, mut xx) = (0.0, 0.0);
    for [x, y] in points {
        xy += (x - mean_x) * (y - mean_y);
        xx += (x - mean_x) * (x - mean_x);
    }
    if xx > 0.0 { xy / xx } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    const START: LogTime = LogTime(1_700_000_000_000_000_000);

    fn gps(seconds: f64) -> DeviceTime {
        let week = (seconds / SECONDS_PER_WEEK).floor();
        DeviceTime::Gps {
            week: Some(week as u16),
            time_of_week_s: seconds - week * SECONDS_PER_WEEK,
        }
    }

    /// Pseudo-random delays between 0 and 15 ms.
    fn delay_s(k: u32) -> f64 {
        f64::from(k.wrapping_mul(2_654_435_761) >> 16) / 65_536.0 * 0.015
    }

    #[test]
    fn offset_and_drift_are_found_under_jitter() {
        let mut fit = ClockFit::new(Scale::Gps);
        let (device_0, drift) = (1_000_000.0, 40e-6);
        let mut worst_s: f64 = 0.0;
        for k in 0..6_000 {
            let elapsed_s = f64::from(k) * 0.05;
            let truth = START.offset_seconds(elapsed_s * (1.0 + drift));
            let arrived = truth.offset_seconds(delay_s(k));
            let mapped = fit
                .push(gps(device_0 + elapsed_s), arrived)
                .expect("GPS time fits the scale");
            assert!(mapped <= arrived);
            if k > 2_000 {
                worst_s = worst_s.max(mapped.seconds_since(truth).abs());
            }
        }
        let state = fit.state().expect("messages came");
        assert!(worst_s < 1.0e-3, "mapped time is off by {worst_s} s");
        assert!((state.drift - drift).abs() < 5e-6, "{state:?}");
        assert_eq!(state.restarts, 0);
    }

    #[test]
    fn week_rollover_and_day_rollover_are_continuous() {
        let mut fit = ClockFit::new(Scale::Gps);
        for k in 0..40 {
            let tow_s = (SECONDS_PER_WEEK - 1.0 + f64::from(k) * 0.05) % SECONDS_PER_WEEK;
            let device = DeviceTime::Gps {
                week: None,
                time_of_week_s: tow_s,
            };
            let arrived = START.offset_seconds(f64::from(k) * 0.05);
            assert_eq!(fit.push(device, arrived), Some(arrived));
        }
        let mut fit = ClockFit::new(Scale::UtcDay);
        for k in 0..4 {
            let device =
                DeviceTime::UtcTimeOfDay((SECONDS_PER_DAY - 2.0 + f64::from(k)) % SECONDS_PER_DAY);
            let arrived = START.offset_seconds(f64::from(k));
            assert_eq!(fit.push(device, arrived), Some(arrived));
        }
    }

    /// A receiver that sends ten bits of the week crosses a rollover (2019-04-07, week 2048).
    #[test]
    fn weeks_of_ten_bits_are_completed_by_the_log_clock() {
        let mut fit = ClockFit::new(Scale::Gps);
        // 18 leap seconds: week 2048 begins at 23:59:42 UTC.
        let rollover = LogTime(1_554_595_182_000_000_000);
        for k in 0..40 {
            let after_s = f64::from(k) - 20.0;
            let device = DeviceTime::Gps {
                week: Some(if after_s < 0.0 { 1023 } else { 0 }),
                time_of_week_s: after_s.rem_euclid(SECONDS_PER_WEEK),
            };
            let arrived = rollover.offset_seconds(after_s + 0.03);
            assert_eq!(fit.push(device, arrived), Some(arrived), "{after_s} s");
        }
        let state = fit.state().expect("messages came");
        assert_eq!((state.restarts, state.messages), (0, 40));
        assert_eq!(state.device_s, 2048.0 * SECONDS_PER_WEEK + 19.0);
    }

    #[test]
    fn a_set_clock_restarts_the_fit_and_no_time_is_after_its_arrival() {
        let mut fit = ClockFit::new(Scale::Gps);
        let mut device_s = 5_000.0;
        for k in 0..200 {
            if k == 100 {
                device_s += 3_600.0;
            }
            let arrived = START.offset_seconds(f64::from(k) * 0.1);
            let mapped = fit.push(gps(device_s), arrived).expect("GPS time");
            assert!(mapped <= arrived);
            device_s += 0.1;
        }
        let state = fit.state().expect("messages came");
        assert_eq!(state.restarts, 1);
        assert_eq!(state.log_time, START.offset_seconds(19.9));
    }

    #[test]
    fn other_scales_and_nan_are_rejected() {
        let mut fit = ClockFit::new(Scale::Gps);
        assert_eq!(fit.push(DeviceTime::UtcTimeOfDay(1.0), START), None);
        assert_eq!(fit.push(gps(f64::NAN), START), None);
        assert!(fit.state().is_none());
    }
}
