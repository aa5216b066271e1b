//! Control of a replay: pause, position and speed.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use sample::LogTime;

/// Slowest and fastest speed, times real time.
const SPEEDS: [f64; 2] = [0.01, 100.0];
/// Longest wait at once, so that the end of the process is noticed.
const WAIT_MAX: Duration = Duration::from_millis(200);

/// Control of a replay. Clones share it.
#[derive(Clone)]
pub struct Playback(Arc<(Mutex<State>, Condvar)>);

struct State {
    range: [LogTime; 2],
    is_playing: bool,
    has_ended: bool,
    speed: f64,
    seek: Option<LogTime>,
    /// Log time that was reached, and when.
    reached: (LogTime, Instant),
    changes: u64,
}

/// State of a replay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaybackState {
    /// First and last log time.
    pub range: [LogTime; 2],
    /// Whether it plays.
    pub is_playing: bool,
    /// Whether the end is reached.
    pub has_ended: bool,
    /// Multiple of real time.
    pub speed: f64,
    /// Log time that was reached.
    pub time: LogTime,
    /// Number of changes by clients.
    pub changes: u64,
}

/// What the replay does next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Give the entry to the clients.
    Play,
    /// Begin again at this log time.
    Seek(LogTime),
}

impl Playback {
    /// Replay of `range` at `speed` times real time.
    #[must_use]
    pub fn new(range: [LogTime; 2], speed: f64) -> Self {
        let state = State {
            range,
            is_playing: true,
            has_ended: false,
            speed,
            seek: None,
            reached: (range[0], Instant::now()),
            changes: 0,
        };
        Self(Arc::new((Mutex::new(state), Condvar::new())))
    }

    /// State now.
    #[must_use]
    pub fn state(&self) -> PlaybackState {
        let state = self.lock();
        PlaybackState {
            range: state.range,
            is_playing: state.is_playing && !state.has_ended,
            has_ended: state.has_ended,
            speed: state.speed,
            time: state.seek.unwrap_or(state.reached.0),
            changes: state.changes,
        }
    }

    /// Plays or pauses, at a speed, from a position if there is one.
    pub fn set(&self, is_playing: bool, speed: Option<f64>, seek: Option<LogTime>) {
        let mut state = self.lock();
        // Time passes at the new speed from here on.
        state.reached.1 = Instant::now();
        state.is_playing = is_playing;
        if let Some(speed) = speed.filter(|speed| speed.is_finite()) {
            state.speed = speed.clamp(SPEEDS[0], SPEEDS[1]);
        }
        let [first, last] = state.range;
        let begins_again = is_playing && state.has_ended;
        let seek = seek.or(begins_again.then_some(first));
        if let Some(time) = seek {
            state.seek = Some(time.clamp(first, last));
        }
        state.changes += 1;
        self.0.1.notify_all();
    }

    /// Waits until the entry at `time` is due, or until a client asks for another position.
    #[must_use]
    pub fn wait(&self, time: LogTime) -> Step {
        let mut state = self.lock();
        loop {
            if let Some(seek) = state.seek {
                return Step::Seek(seek);
            }
            let (reached, at) = state.reached;
            let due_s = time.seconds_since(reached) / state.speed;
            let ahead =
                Duration::from_secs_f64(due_s.clamp(0.0, 3600.0)).saturating_sub(at.elapsed());
            if state.is_playing && ahead.is_zero() {
                state.reached = (time, at + Duration::from_secs_f64(due_s.max(0.0)));
                return Step::Play;
            }
            let wait = if state.is_playing {
                ahead.min(WAIT_MAX)
            } else {
                WAIT_MAX
            };
            let waited = self.0.1.wait_timeout(state, wait);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
            if !state.is_playing {
                state.reached.1 = Instant::now();
            }
        }
    }

    /// Begins at a position; the entries before it are given without waiting.
    pub fn begin(&self, time: LogTime) {
        let mut state = self.lock();
        state.seek = None;
        state.has_ended = false;
        state.reached = (time, Instant::now());
    }

    /// Waits at the end of the log until a client asks for another position.
    #[must_use]
    pub fn end(&self) -> LogTime {
        let mut state = self.lock();
        state.has_ended = true;
        state.changes += 1;
        loop {
            if let Some(seek) = state.seek {
                return seek;
            }
            let waited = self.0.1.wait_timeout(state, WAIT_MAX);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const START: LogTime = LogTime(1_000_000_000);

    fn playback(speed: f64) -> Playback {
        Playback::new([START, START.offset_seconds(10.0)], speed)
    }

    #[test]
    fn entries_come_at_the_speed() {
        let playback = playback(10.0);
        playback.begin(START);
        let begin = Instant::now();
        for n in 1..=5 {
            let step = playback.wait(START.offset_seconds(0.1 * f64::from(n)));
            assert_eq!(step, Step::Play);
        }
        let took = begin.elapsed();
        assert!(took >= Duration::from_millis(49), "{took:?}");
        assert!(took < Duration::from_millis(500), "{took:?}");
        assert_eq!(playback.state().time, START.offset_seconds(0.5));
    }

    #[test]
    fn a_pause_holds_the_entries_and_a_position_ends_the_wait() {
        let playback = playback(1.0);
        playback.begin(START);
        playback.set(false, None, None);
        assert!(!playback.state().is_playing);
        let other = playback.clone();
        let waiting = std::thread::spawn(move || other.wait(START.offset_seconds(0.01)));
        std::thread::sleep(Duration::from_millis(100));
        assert!(!waiting.is_finished());
        playback.set(true, Some(2.0), Some(START.offset_seconds(99.0)));
        let step = waiting.join().expect("no panic");
        assert_eq!(step, Step::Seek(START.offset_seconds(10.0)), "limited");
        assert_eq!(playback.state().speed, 2.0);
    }
}
