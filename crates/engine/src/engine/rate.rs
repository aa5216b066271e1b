//! Instants of messages that come at a nominal rate, where time stamps are missing or coarse.
//!
//! With the interval P, message n is made at o + n P. A message cannot arrive before that, so o is the least
//! difference of arrival and n P of the last seconds: that of a message without delay. A stalled computer
//! gives many messages the same arrival; by n, each has its own time. Without a stated rate, one of
//! [`RATES_HZ`] must explain the first arrivals: their earliest ones stay in step with it, however late the
//! others are. A message that is hardly late keeps the time of its arrival.
//!
//! n follows from the device's counter, or from the coarse stamps of an adapter. A device without either
//! does not say that a message was lost. The messages after a loss are all late by an interval, and after
//! [`BEHIND_MAX`] of them, o is found again.

use std::collections::{BTreeMap, VecDeque};

use sample::{CanFrame, LogTime, NANOS_PER_SECOND};

/// Rates of devices, Hz.
const RATES_HZ: [f64; 13] = [
    10.0, 20.0, 25.0, 40.0, 50.0, 80.0, 100.0, 125.0, 200.0, 250.0, 400.0, 500.0, 1000.0,
];
/// Largest relative difference of a mean rate from the nominal one: one loss in fifty messages.
const RATE_TOLERANCE: f64 = 0.02;
/// Numbers of messages from which a rate is learnt. After the largest, the search begins again.
const LEARN: [usize; 3] = [50, 100, 200];
/// Largest relative difference of a mean rate from a nominal one while many messages are late.
const LATE_RATE_TOLERANCE: f64 = 0.12;
/// Largest difference between the least delays of the parts of the arrivals, s.
const STEP_MAX_S: f64 = 0.002;
/// Number of these parts.
const PARTS: usize = 4;
/// Delay of a message that is not late, s, and the part of the messages that are not.
const PUNCTUAL_S: f64 = 0.005;
/// See [`PUNCTUAL_S`].
const PUNCTUAL_PART: f64 = 0.25;
/// Largest spread of the arrivals against the nominal rate while it is learnt, s. Messages that are
/// sent on events spread more.
const SPREAD_MAX_S: f64 = 0.04;
/// Delay up to which a message keeps the time of its arrival, s: the delays of ports and schedulers on a
/// machine that is not busy.
const PORT_TOLERANCE_S: f64 = 0.0002;
/// The same of a device that writes lines: long lines take longer.
const LINE_TOLERANCE_S: f64 = 0.006;
/// The same on a bus without stamps, on which a frame waits for others.
const BUS_TOLERANCE_S: f64 = 0.001;
/// Part of the interval by which the messages after a loss are late.
const LOST_PART: f64 = 0.75;
/// Part of the interval between two arrivals that are no part of a backlog.
const SPACED_PART: f64 = 0.5;
/// Time over which a minimum is taken, s.
const WINDOW_S: f64 = 1.0;
/// Number of minima that are kept: within their time, the clocks drift apart by some tenths of a
/// millisecond at most.
const WINDOWS: usize = 5;
/// Largest difference of a fitted time from the stamp of an adapter, ns: half its resolution, and the least
/// delay and the drift that its offset contains.
const STAMP_TOLERANCE_NS: i64 = 1_100_000;
/// Number of consecutive late messages after which one was lost.
const BEHIND_MAX: u32 = 20;
/// Time without a message after which the origin is found again, s: of devices that do not count, and of
/// devices that count their messages.
const GAP_MAX_S: [f64; 2] = [1.0, 10.0];
/// Number of new beginnings within [`WRONG_WITHIN_S`] that show a wrong rate.
const WRONG_AFTER: usize = 3;
/// See [`WRONG_AFTER`], s.
const WRONG_WITHIN_S: f64 = 10.0;

/// Number of messages since the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Steps {
    /// By the device.
    Known(u64),
    /// One, unless some were lost.
    Unknown,
    /// The device has started again.
    Restart,
}

/// Clock of a device with a nominal rate.
#[derive(Clone, Debug)]
pub struct RateClock {
    interval_s: Option<f64>,
    tolerance_s: f64,
    /// Arrival of message 0.
    origin: LogTime,
    number: u64,
    last: Option<LogTime>,
    /// Least differences of arrival and time of the last seconds, the newest last, s.
    least_s: VecDeque<f64>,
    /// Begin of the newest of them, s since the origin.
    window_s: f64,
    /// Messages from which the rate is learnt: when each was sent, as far as that is known without the rate,
    /// and when it arrived.
    learning: Vec<[LogTime; 2]>,
    /// Consecutive messages that are late by an interval, and the least delay of them, s.
    behind: (u32, f64),
    /// Last times at which the offset was found again.
    begun: Vec<LogTime>,
    is_off: bool,
}

impl RateClock {
    /// Clock of a device with a nominal interval, s; `None` learns it.
    pub fn new(interval_s: Option<f64>) -> Self {
        Self {
            interval_s,
            tolerance_s: PORT_TOLERANCE_S,
            origin: LogTime::default(),
            number: 0,
            last: None,
            least_s: VecDeque::new(),
            window_s: 0.0,
            learning: Vec::new(),
            behind: (0, f64::INFINITY),
            begun: Vec::new(),
            is_off: false,
        }
    }

    /// Clock of a device that writes lines.
    pub fn of_lines() -> Self {
        Self {
            tolerance_s: LINE_TOLERANCE_S,
            ..Self::new(None)
        }
    }

    /// Instant of the next message, which arrived at `arrived`; never later than that.
    pub fn push(&mut self, steps: Steps, arrived: LogTime) -> LogTime {
        self.push_sent(steps, arrived, arrived)
    }

    /// The same of a message that was sent at about `sent`.
    fn push_sent(&mut self, steps: Steps, arrived: LogTime, sent: LogTime) -> LogTime {
        let before = self.last.replace(arrived);
        if self.is_off {
            return arrived;
        }
        let Some(interval_s) = self.interval_s else {
            self.learn([sent, arrived]);
            return arrived;
        };
        let gap_s = before.map_or(f64::INFINITY, |before| arrived.seconds_since(before));
        self.number += match steps {
            Steps::Known(steps) => steps,
            Steps::Unknown => 1,
            Steps::Restart => 0,
        };
        let gap_max_s = GAP_MAX_S[usize::from(steps != Steps::Unknown)];
        if steps == Steps::Restart || gap_s > gap_max_s {
            self.restart(arrived);
            return arrived;
        }
        let late_s = self.late_s(interval_s, arrived);
        if late_s > LOST_PART * interval_s && gap_s > SPACED_PART * interval_s {
            self.behind = (self.behind.0 + 1, self.behind.1.min(late_s));
        } else {
            self.behind = (0, f64::INFINITY);
        }
        if self.behind.0 >= BEHIND_MAX {
            return self.begin_again(arrived, late_s);
        }
        if late_s > self.tolerance_s {
            arrived.offset_seconds(-late_s)
        } else {
            arrived
        }
    }

    /// How late a message is, s; not negative.
    fn late_s(&mut self, interval_s: f64, arrived: LogTime) -> f64 {
        let since_s = arrived.seconds_since(self.origin);
        let difference_s = since_s - self.number as f64 * interval_s;
        if since_s - self.window_s > WINDOW_S || self.least_s.is_empty() {
            if self.least_s.len() == WINDOWS {
                self.least_s.pop_front();
            }
            self.least_s.push_back(difference_s);
            self.window_s = since_s;
        }
        if let Some(newest_s) = self.least_s.back_mut() {
            *newest_s = newest_s.min(difference_s);
        }
        let least_s = self.least_s.iter().copied().fold(f64::INFINITY, f64::min);
        difference_s - least_s
    }

    /// A message at `instant` is message 0.
    fn restart(&mut self, instant: LogTime) {
        self.origin = instant;
        self.number = 0;
        self.least_s = VecDeque::from([0.0]);
        self.window_s = 0.0;
        self.behind = (0, f64::INFINITY);
    }

    /// The messages have been late for so long that one was lost, or the rate is another one.
    fn begin_again(&mut self, arrived: LogTime, late_s: f64) -> LogTime {
        let instant = arrived.offset_seconds(self.behind.1 - late_s);
        self.restart(instant);
        self.begun
            .retain(|time| arrived.seconds_since(*time) < WRONG_WITHIN_S);
        self.begun.push(arrived);
        self.is_off = self.begun.len() >= WRONG_AFTER;
        instant
    }

    fn learn(&mut self, message: [LogTime; 2]) {
        self.learning.push(message);
        let count = self.learning.len();
        if !LEARN.contains(&count) {
            return;
        }
        let most = LEARN[LEARN.len() - 1];
        let sent: Vec<LogTime> = self.learning.iter().map(|[sent, _]| *sent).collect();
        let learnt = punctual_interval(&sent);
        let learnt = learnt.or_else(|| interval(&sent).filter(|_| count == most));
        let Some(interval_s) = learnt else {
            if count == most {
                self.learning.clear();
            }
            return;
        };
        let messages = std::mem::take(&mut self.learning);
        self.interval_s = Some(interval_s);
        for (number, [_, arrived]) in (0..).zip(messages) {
            if number == 0 {
                self.restart(arrived);
            }
            self.number = number;
            self.late_s(interval_s, arrived);
        }
    }

    /// Number of messages in a time, s.
    fn steps_in(&self, time_s: f64) -> Steps {
        match self
            .interval_s
            .map(|interval_s| (time_s / interval_s).round())
        {
            Some(steps) if steps >= 0.0 => Steps::Known(steps as u64),
            Some(_) => Steps::Restart,
            None => Steps::Unknown,
        }
    }
}

/// Most identifiers of a bus whose rates are followed.
const IDENTIFIERS_MAX: usize = 256;

/// Clocks of the identifiers on a bus, each with the last stamp.
#[derive(Clone, Debug, Default)]
pub struct RateClocks(BTreeMap<(u32, bool), (RateClock, Option<i64>)>);

impl RateClocks {
    /// How late a frame is, ns; zero if it is not late, or if its identifier has no nominal rate. `coarse` is
    /// how late it is by the stamp of its adapter, if it has one.
    pub fn lateness_ns(&mut self, frame: &CanFrame, arrived: LogTime, coarse: Option<i64>) -> i64 {
        let key = (frame.id, frame.flags.extended);
        let otherwise = coarse.unwrap_or(0);
        if self.0.len() >= IDENTIFIERS_MAX && !self.0.contains_key(&key) {
            return otherwise;
        }
        let (clock, last_stamp) = self.0.entry(key).or_insert_with(|| {
            let clock = RateClock {
                tolerance_s: coarse.map_or(BUS_TOLERANCE_S, |_| PORT_TOLERANCE_S),
                ..RateClock::new(None)
            };
            (clock, None)
        });
        let before = std::mem::replace(last_stamp, frame.hardware_ns);
        let steps = match (before, frame.hardware_ns) {
            (Some(before), Some(now)) => {
                clock.steps_in((now - before) as f64 / NANOS_PER_SECOND as f64)
            }
            _ => Steps::Unknown,
        };
        let sent = LogTime(arrived.0.saturating_add_signed(-otherwise));
        let late_ns = arrived - clock.push_sent(steps, arrived, sent);
        match coarse {
            Some(coarse) if (late_ns - coarse).abs() > STAMP_TOLERANCE_NS => coarse,
            _ => late_ns,
        }
    }
}

/// Number of messages from one counter to the next, each with its modulus.
pub fn counted(before: Option<(u32, u32)>, now: Option<(u32, u32)>) -> Steps {
    let (Some((before, _)), Some((now, modulus))) = (before, now) else {
        return Steps::Unknown;
    };
    let steps = (now + modulus - before % modulus) % modulus;
    if (1..=modulus / 2).contains(&steps) {
        Steps::Known(u64::from(steps))
    } else {
        Steps::Restart
    }
}

/// The nominal interval of arrivals of which many may be late, s. A message is never early: in each part of
/// the arrivals, the least delay is the same.
fn punctual_interval(arrivals: &[LogTime]) -> Option<f64> {
    let first = *arrivals.first()?;
    let mean_hz = (arrivals.len() - 1) as f64 / arrivals.last()?.seconds_since(first);
    let is_near = |rate: &f64| (mean_hz / rate - 1.0).abs() < LATE_RATE_TOLERANCE;
    let explains = |rate: &f64| {
        let delays = arrivals.iter().enumerate();
        let delays = delays.map(|(number, at)| at.seconds_since(first) - number as f64 / rate);
        let delays: Vec<f64> = delays.collect();
        let least = |delays: &[f64]| delays.iter().copied().fold(f64::INFINITY, f64::min);
        let of_parts = delays.chunks(arrivals.len().div_ceil(PARTS)).map(least);
        let least_s = least(&delays);
        let steps_s = of_parts.fold(0.0, |most, of_part| f64::max(most, of_part - least_s));
        let punctual = delays.iter().filter(|delay| **delay - least_s < PUNCTUAL_S);
        steps_s < STEP_MAX_S && punctual.count() as f64 >= PUNCTUAL_PART * delays.len() as f64
    };
    let mut near = RATES_HZ.into_iter().filter(is_near);
    near.find(explains).map(|rate| 1.0 / rate)
}

/// The nominal interval of arrivals, s.
fn interval(arrivals: &[LogTime]) -> Option<f64> {
    let first = *arrivals.first()?;
    let span_s = arrivals.last()?.seconds_since(first);
    let mean_hz = (arrivals.len() - 1) as f64 / span_s;
    let rate_hz = RATES_HZ
        .into_iter()
        .find(|rate| (mean_hz / rate - 1.0).abs() < RATE_TOLERANCE)?;
    let (mut least_s, mut most_s) = (f64::INFINITY, f64::NEG_INFINITY);
    for (number, arrived) in arrivals.iter().enumerate() {
        let residual_s = arrived.seconds_since(first) - number as f64 / rate_hz;
        least_s = residual_s.min(least_s);
        most_s = residual_s.max(most_s);
    }
    (most_s - least_s < SPREAD_MAX_S).then_some(1.0 / rate_hz)
}

#[cfg(test)]
mod tests {
    use super::*;

    const START: LogTime = LogTime(1_700_000_000_000_000_000);

    /// Arrivals of a 100 Hz device with 50 ppm of drift: delays up to 1 ms, and gaps of 36 and 53 ms.
    fn arrival(number: u32) -> (LogTime, LogTime) {
        let made = START.offset_seconds(f64::from(number) * 0.01 * (1.0 + 50e-6));
        let since_s = made.seconds_since(START);
        let mut delay_s = f64::from(number.wrapping_mul(2_654_435_761) >> 16) / 65_536.0 * 0.001;
        for (begin_s, gap_s) in [(6.0, 0.036), (8.0, 0.053)] {
            let end_s = begin_s + gap_s;
            if (begin_s..end_s).contains(&since_s) {
                delay_s = end_s - since_s;
            }
        }
        (made, made.offset_seconds(delay_s))
    }

    fn worst_s(mut clock: RateClock, counter: bool, lost: &[u32], from: u32) -> f64 {
        let mut worst_s: f64 = 0.0;
        let mut before = None;
        for number in (0..3_000).filter(|number| !lost.contains(number)) {
            let (made, arrived) = arrival(number);
            let now = counter.then_some((number % 1_000, 1_000));
            let steps = counted(std::mem::replace(&mut before, now), now);
            let instant = clock.push(steps, arrived);
            assert!(instant <= arrived);
            if number >= from {
                worst_s = worst_s.max(instant.seconds_since(made).abs());
            }
        }
        worst_s
    }

    #[test]
    fn messages_of_a_burst_have_their_own_times() {
        for (clock, counter) in [
            (RateClock::new(Some(0.01)), false),
            (RateClock::new(Some(0.01)), true),
            (RateClock::new(None), false),
        ] {
            let worst_s = worst_s(clock, counter, &[], 250);
            assert!(worst_s < 1.1e-3, "{worst_s}");
        }
    }

    /// On a busy machine most readings of a 50 Hz device are late, by up to 60 ms, from the start.
    #[test]
    fn a_rate_is_learnt_from_late_messages() {
        let mut clock = RateClock::of_lines();
        let mut random = math::Random::new(3);
        let mut arrived = START;
        let mut worst_s: f64 = 0.0;
        for number in 0..1_000 {
            let made = START.offset_seconds(f64::from(number) * 0.02);
            let is_punctual = number % 7 < 3;
            let delay_s = random.between(0.0, if is_punctual { 0.001 } else { 0.06 });
            arrived = arrived.max(made.offset_seconds(delay_s));
            let instant = clock.push(Steps::Unknown, arrived);
            if number >= 200 {
                worst_s = worst_s.max(instant.seconds_since(made).abs());
            }
        }
        assert!(worst_s < LINE_TOLERANCE_S + 1e-3, "{worst_s}");
    }

    #[test]
    fn a_loss_is_counted_by_the_device_or_found_by_what_follows() {
        let lost = [1_000, 1_001];
        let worst = worst_s(RateClock::new(Some(0.01)), true, &lost, 0);
        assert!(worst < 1.1e-3, "{worst}");
        // Two intervals are missing until the clock begins again.
        let worst = worst_s(RateClock::new(Some(0.01)), false, &lost, 0);
        assert!((0.015..0.021).contains(&worst), "{worst}");
        let worst = worst_s(RateClock::new(Some(0.01)), false, &lost, 1_030);
        assert!(worst < 1.1e-3, "{worst}");
    }

    #[test]
    fn events_and_other_rates_keep_their_arrivals() {
        let mut clock = RateClock::new(None);
        let mut at = START;
        let mut random = math::Random::new(1);
        for _ in 0..5_000 {
            at = at.offset_seconds(random.between(0.0, 0.02));
            assert_eq!(clock.push(Steps::Unknown, at), at);
        }
        // 90 Hz is not nominal, and 100 Hz is stated where 96 Hz come.
        let mut learnt = RateClock::new(None);
        let mut stated = RateClock::new(Some(0.01));
        for number in 0..3_000_u32 {
            let at = START.offset_seconds(f64::from(number) / 90.0);
            assert_eq!(learnt.push(Steps::Unknown, at), at);
            let at = START.offset_seconds(f64::from(number) / 96.0);
            let instant = stated.push(Steps::Unknown, at);
            assert!(number < 500 || instant == at, "{number}");
        }
    }
}
