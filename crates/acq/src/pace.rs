//! When to look at a CAN bus.
//!
//! To be woken costs several times the work on a frame, and the kernel stamps a frame when it comes,
//! however late it is read. So a busy bus is not watched but looked at from time to time, as often as
//! a handful of frames have come. A slow one is watched: its frames are read at once, and silence
//! costs nothing.

use std::io;
use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::time::{Duration, Instant};

use socketcan::CanSocket;
use tokio::io::Interest;
use tokio::io::unix::AsyncFd;

use crate::sys;

/// Times between two looks. The shortest, that of a full bus of 1 Mbit/s, is within what a frame may
/// wait to be read (1 ms).
const PERIODS: [Duration; 5] = [
    Duration::from_micros(500),
    Duration::from_micros(1_000),
    Duration::from_micros(2_000),
    Duration::from_micros(4_000),
    Duration::from_micros(6_000),
];
/// Frames at one look: more are too many, fewer too few.
const FRAMES_MOST: f64 = 6.5;
const FRAMES_LEAST: f64 = 2.5;
/// A watched bus with more frames a second is looked at instead, and one with fewer watched again.
const BUSY_FRAMES_S: f64 = 500.0;
const QUIET_FRAMES_S: f64 = 300.0;
/// A bus is judged after so many frames, or after this time.
const JUDGED_FRAMES: usize = 64;
const JUDGED_AFTER: Duration = Duration::from_millis(64);

/// How a bus is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pace {
    /// Watched: each frame wakes.
    Awaited,
    /// Looked at with this time in between.
    Every(Duration),
}

/// Judges how busy a bus is.
#[derive(Debug)]
pub(crate) struct Pacer {
    pace: Pace,
    longest: Duration,
    frames: usize,
    since: Instant,
}

impl Pacer {
    /// A bus that is watched from `now` on, and of which no frame may wait longer than `longest`.
    pub fn new(now: Instant, longest: Duration) -> Self {
        Self {
            pace: Pace::Awaited,
            longest,
            frames: 0,
            since: now,
        }
    }

    /// At a look there were so many frames; the pace from here on, if it is another one.
    pub fn looked(&mut self, now: Instant, frames: usize) -> Option<Pace> {
        self.frames += frames;
        let time = now.saturating_duration_since(self.since);
        if self.frames < JUDGED_FRAMES && time < JUDGED_AFTER {
            return None;
        }
        let pace = self.judge(self.frames as f64 / time.as_secs_f64());
        self.frames = 0;
        self.since = now;
        (pace != std::mem::replace(&mut self.pace, pace)).then_some(pace)
    }

    fn judge(&self, frames_s: f64) -> Pace {
        let each = |period: Duration| frames_s * period.as_secs_f64();
        match self.pace {
            Pace::Awaited if frames_s <= BUSY_FRAMES_S => return Pace::Awaited,
            Pace::Every(_) if frames_s < QUIET_FRAMES_S => return Pace::Awaited,
            Pace::Every(period) if (FRAMES_LEAST..=FRAMES_MOST).contains(&each(period)) => {
                return self.pace;
            }
            _ => {}
        }
        let fits = |period: &&Duration| **period <= self.longest && each(**period) <= FRAMES_MOST;
        let longest = PERIODS.iter().rev().find(fits);
        Pace::Every(*longest.unwrap_or(&PERIODS[0]))
    }
}

/// What wakes the reader of a bus.
pub(crate) enum Wake {
    Frame(AsyncFd<Arc<CanSocket>>),
    Timer(AsyncFd<OwnedFd>),
}

impl Wake {
    /// Frames that came before wake, too.
    pub fn new(socket: &Arc<CanSocket>, pace: Pace) -> io::Result<Self> {
        Ok(match pace {
            Pace::Awaited => Self::Frame(sys::watch_socket(Arc::clone(socket))?),
            Pace::Every(period) => Self::Timer(sys::watch_timer(period)?),
        })
    }

    /// Waits until it is time to read.
    pub async fn wait(&self) -> io::Result<()> {
        match self {
            // Cleared before the read: what comes after it wakes again.
            Self::Frame(socket) => {
                let mut ready = socket.ready(Interest::READABLE | Interest::ERROR).await?;
                ready.clear_ready();
                Ok(())
            }
            Self::Timer(timer) => {
                timer.readable().await?.clear_ready();
                sys::read_timer(timer.get_ref())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bus that is read as its pacer says.
    struct Bus {
        pacer: Pacer,
        pace: Pace,
        now: Instant,
        changes: usize,
    }

    impl Bus {
        fn new(longest: Duration) -> Self {
            let now = Instant::now();
            Self {
                pacer: Pacer::new(now, longest),
                pace: Pace::Awaited,
                now,
                changes: 0,
            }
        }

        /// Frames come at this rate for a while; the pace at its end.
        fn run(&mut self, frames_s: u32, time: Duration) -> Pace {
            let end = self.now + time;
            let mut due = 0.0;
            while self.now < end {
                let step = match self.pace {
                    Pace::Every(period) => period,
                    Pace::Awaited if frames_s == 0 => {
                        self.now = end;
                        break;
                    }
                    Pace::Awaited => Duration::from_secs_f64(1.0 / f64::from(frames_s)),
                };
                self.now += step;
                due += f64::from(frames_s) * step.as_secs_f64() + 1e-9;
                let frames = due as usize;
                due -= frames as f64;
                if let Some(pace) = self.pacer.looked(self.now, frames) {
                    self.pace = pace;
                    self.changes += 1;
                }
            }
            self.pace
        }
    }

    const SECOND: Duration = Duration::from_secs(1);

    #[test]
    fn a_busy_bus_is_looked_at_and_a_quiet_one_watched() {
        let mut bus = Bus::new(PERIODS[3]);
        assert_eq!(bus.run(100, SECOND), Pace::Awaited);
        assert_eq!(bus.run(8_000, SECOND), Pace::Every(PERIODS[0]));
        assert_eq!(bus.run(900, SECOND), Pace::Every(PERIODS[3]));
        assert_eq!(bus.run(0, SECOND / 8), Pace::Awaited);
        assert_eq!(bus.run(400, SECOND), Pace::Awaited);
        let mut patient = Bus::new(PERIODS[4]);
        assert_eq!(patient.run(900, SECOND), Pace::Every(PERIODS[4]));
    }

    #[test]
    fn a_steady_bus_keeps_its_pace() {
        for frames_s in (20..20_000).step_by(37) {
            let mut bus = Bus::new(PERIODS[4]);
            bus.run(frames_s, SECOND);
            let (pace, changes) = (bus.pace, bus.changes);
            assert!(changes <= 2, "{frames_s} frames/s: {changes} changes");
            assert_eq!(bus.run(frames_s, SECOND), pace, "{frames_s} frames/s");
            assert_eq!(bus.changes, changes, "{frames_s} frames/s");
        }
    }

    #[test]
    fn a_bus_that_fills_up_is_looked_at_more_often_within_some_milliseconds() {
        let mut bus = Bus::new(PERIODS[3]);
        assert_eq!(bus.run(900, SECOND), Pace::Every(PERIODS[3]));
        let pace = bus.run(8_000, Duration::from_millis(20));
        assert_eq!(pace, Pace::Every(PERIODS[0]));
    }

    #[tokio::test]
    async fn the_timer_wakes_again_and_again_and_never_early() {
        let wake = Wake::Timer(sys::watch_timer(PERIODS[2]).expect("a timer"));
        let begin = Instant::now();
        for _ in 0..20 {
            wake.wait().await.expect("it goes on");
        }
        // The first time is at once, the second at a multiple of the period.
        assert!(begin.elapsed() > 18 * PERIODS[2]);
    }
}
