//! Estimator that uses late samples at their own time.
//!
//! A step of the estimator takes what has arrived by then. If a sample is late, the steps after it did
//! without it. So before a step that lacks samples which were due, a copy of the estimator is kept with
//! what it gets from then on. When the samples have come, the copy takes all of them in the order in which
//! they would have arrived, repeats the steps, and replaces the estimator. What the repeated steps
//! estimate is not handed out again: it was estimated at its time. Estimates with a lag wait for what is
//! missing, for at most the delay of a sample that is used ([`Patience`]). They and all later steps are as
//! if nothing had been late.
//!
//! Without late samples nothing is repeated, and no estimate changes.

use std::collections::BTreeMap;

use estimator::{Estimator, EstimatorError, GRID_NANOS, Output};
use sample::{Event, EventKind, LogTime, Measurement, Sample, SourceId, Wheel};

/// Delay after an instant until its step, ns, as the estimator has it.
const HOLD_NS: i64 = 5_000_000;
/// Delay of a sample beyond its usual one up to which it is not missing, ns.
const SLACK_NS: i64 = 200_000;
/// Longest interval between two samples that is expected, ns.
const INTERVAL_MAX_NS: i64 = 50_000_000;
/// Part of the difference by which the expected interval falls to a shorter one.
const INTERVAL_PARTS: i64 = 16;

/// Delay from which a sample is not used, ns.
const LATE_MAX_NS: i64 = 100_000_000;
/// Time without data of any source that is a stall, ns.
const STALL_MIN_NS: i64 = 20_000_000;
/// Longest time without data of any source that is a stall and no silence, ns.
const STALL_MAX_NS: i64 = 1_000_000_000;

/// How late a sample may be. If the computer stalls, no data of any source comes: the length of the stall
/// is added to the delays that come from the sources.
#[derive(Clone, Copy, Debug, Default)]
pub struct Patience {
    last_data: Option<LogTime>,
    /// Length of the last stall, ns, and its end.
    stall: Option<(i64, LogTime)>,
}

impl Patience {
    /// Largest delay of a sample that is used, ns, at an arrival.
    pub fn limit_ns(&mut self, now: LogTime, has_data: bool) -> i64 {
        let gap_ns = self.last_data.map_or(0, |last| now - last);
        let is_stall = (STALL_MIN_NS..=STALL_MAX_NS).contains(&gap_ns);
        if has_data {
            self.last_data = Some(now);
            if is_stall {
                self.stall = Some((gap_ns, now));
            }
        }
        let of_last = self.stall.filter(|(_, end)| now - *end < LATE_MAX_NS);
        let stall_ns = match of_last {
            Some((length_ns, _)) => length_ns,
            None if is_stall => gap_ns,
            None => 0,
        };
        LATE_MAX_NS + stall_ns
    }
}

/// The samples of one kind of a source.
#[derive(Clone, Copy, Debug)]
struct Stream {
    newest: LogTime,
    /// Largest interval of late, ns.
    interval_ns: i64,
    /// Least time from validity to arrival, ns.
    delay_ns: i64,
}

impl Stream {
    /// Takes a sample. Returns by how much it is later than usual, ns.
    fn push(&mut self, sample: &Sample) -> i64 {
        let delay_ns = sample.log_time - sample.valid_time;
        self.delay_ns = self.delay_ns.min(delay_ns);
        let apart_ns = sample.valid_time - self.newest;
        if apart_ns > 0 {
            self.newest = sample.valid_time;
            let kept_ns = self.interval_ns - self.interval_ns / INTERVAL_PARTS;
            self.interval_ns = apart_ns.min(INTERVAL_MAX_NS).max(kept_ns);
        }
        delay_ns - self.delay_ns
    }

    /// Whether a sample was due before `deadline` that has not come, and may still be used when it comes.
    fn is_behind(&self, deadline: LogTime, limit_ns: i64) -> bool {
        let due = self.newest + self.interval_ns + self.delay_ns;
        (SLACK_NS..=limit_ns).contains(&(deadline - due))
    }
}

/// Something that the estimator gets.
enum Input {
    Sample(Sample, Option<usize>),
    Mark(String),
}

/// The estimator before a step that lacks samples.
struct Point {
    estimator: Box<Estimator>,
    /// Instant of the step.
    step: LogTime,
    /// What came since, with the time at which it would have come without being late.
    inputs: Vec<(LogTime, Input)>,
    /// Kinds of the events that were handed out since.
    events: Vec<Event>,
    /// Estimates with a lag, and steps for the smoother, since. They wait for what is missing.
    held: Vec<Output>,
}

/// The estimator, and what is needed to repeat its last steps.
pub struct Timely {
    /// On the heap: it is large, and a thread's stack is small.
    estimator: Box<Estimator>,
    streams: BTreeMap<(SourceId, u32), Stream>,
    /// The next instant.
    next: Option<LogTime>,
    point: Option<Point>,
    /// Whether a late sample has come since the last step.
    is_due: bool,
    /// Largest delay of a sample that is used, ns.
    limit_ns: i64,
}

impl Timely {
    /// Hands out the steps that wait for late samples, at the end. Estimates with a lag do not come any more,
    /// as in a recording, which ends without a last call.
    pub fn finish(&mut self, out: &mut impl FnMut(Output)) {
        let held = self.point.take().map_or_else(Vec::new, |point| point.held);
        let is_step = |output: &Output| matches!(output, Output::Step(_));
        held.into_iter().filter(is_step).for_each(out);
    }

    /// Before the first sample.
    pub fn new(estimator: Estimator) -> Self {
        Self {
            estimator: Box::new(estimator),
            streams: BTreeMap::new(),
            next: None,
            point: None,
            is_due: false,
            limit_ns: LATE_MAX_NS,
        }
    }

    /// The same with an estimator that hands out its steps.
    pub fn traced(mut self) -> Self {
        *self.estimator = self.estimator.traced();
        self
    }

    /// The estimator after its last step.
    pub fn estimator(&self) -> &Estimator {
        &self.estimator
    }

    /// As [`Estimator::advance`]. `limit_ns` is the largest delay of a sample that is used.
    pub fn advance(&mut self, now: LogTime, limit_ns: i64, out: &mut impl FnMut(Output)) {
        self.limit_ns = limit_ns;
        let mut next = match self.next {
            Some(next) if now - next <= limit_ns => next,
            // The first call, or a jump over which the estimator alone decides where its grid continues.
            _ => return self.jump(now, out),
        };
        while now - next >= HOLD_NS {
            if self.is_due {
                self.repeat(out);
            }
            if self.is_behind(next) && self.point.is_none() {
                self.point = Some(self.point_before(next));
            }
            let deadline = next + HOLD_NS;
            next = next + GRID_NANOS.cast_signed();
            self.next = Some(next);
            match &mut self.point {
                None => self.estimator.advance(deadline, out),
                Some(point) => self
                    .estimator
                    .advance(deadline, &mut |output| match output {
                        output @ (Output::Step(_) | Output::Lagged(_)) => point.held.push(output),
                        Output::Event(event) => {
                            point.events.push(event.clone());
                            out(Output::Event(event));
                        }
                        output => out(output),
                    }),
            }
            self.drop_old(out);
        }
    }

    /// As [`Estimator::skip_to`].
    pub fn skip_to(&mut self, now: LogTime) {
        self.point = None;
        self.is_due = false;
        self.next = None;
        self.estimator.skip_to(now);
    }

    /// As [`Estimator::mark`].
    ///
    /// # Errors
    /// As there.
    pub fn mark(&mut self, now: LogTime, text: &str) -> Result<(), EstimatorError> {
        if let Some(point) = &mut self.point {
            point.inputs.push((now, Input::Mark(text.to_owned())));
        }
        self.estimator.mark(text)
    }

    /// As [`Estimator::push`]. A sample that is later than the limit is not used. `is_too_late` says it of
    /// the samples whose time of validity does not show it: GNSS has latencies that change.
    /// `message` is its place among the messages whose latencies are not known.
    pub fn push(&mut self, sample: &Sample, message: Option<usize>, is_too_late: bool) {
        let Some(kind) = kind(&sample.measurement) else {
            if is_too_late {
                return;
            }
            if let Some(point) = &mut self.point {
                let input = Input::Sample(sample.clone(), message);
                point.inputs.push((sample.log_time, input));
            }
            return self.estimator.push_of(sample, message);
        };
        let stream = self.streams.entry((sample.source, kind));
        let late_ns = stream
            .or_insert(Stream {
                newest: sample.valid_time,
                interval_ns: INTERVAL_MAX_NS,
                delay_ns: i64::MAX,
            })
            .push(sample);
        if late_ns > self.limit_ns {
            return;
        }
        if let Some(point) = &mut self.point {
            let due = sample.log_time.offset_nanos(-late_ns);
            let input = Input::Sample(sample.clone(), message);
            point.inputs.push((due, input));
            let missed = self.next.map(|next| next - due);
            self.is_due |= missed.is_some_and(|ns| ns > GRID_NANOS.cast_signed() - HOLD_NS);
        }
        self.estimator.push_of(sample, message);
    }

    fn jump(&mut self, now: LogTime, out: &mut impl FnMut(Output)) {
        if let Some(point) = self.point.take() {
            point.held.into_iter().for_each(&mut *out);
        }
        self.is_due = false;
        let mut newest = None;
        self.estimator.advance(now, &mut |output| {
            if let Output::Estimate(estimate) = &output {
                newest = Some(estimate.time);
            }
            out(output);
        });
        let grid = GRID_NANOS.cast_signed();
        let from = newest.map(|newest: LogTime| newest + grid);
        let first = LogTime(now.0.div_ceil(GRID_NANOS) * GRID_NANOS);
        self.next = Some(
            from.or(self.next)
                .filter(|next| now - *next < HOLD_NS)
                .unwrap_or(first),
        );
    }

    fn is_behind(&self, instant: LogTime) -> bool {
        let mut streams = self.streams.values();
        streams.any(|stream| stream.is_behind(instant + HOLD_NS, self.limit_ns))
    }

    fn point_before(&self, step: LogTime) -> Point {
        Point {
            estimator: self.estimator.clone(),
            step,
            inputs: Vec::new(),
            events: Vec::new(),
            held: Vec::new(),
        }
    }

    /// Forgets the point if nothing is missing any more, or what is missing would not be used.
    fn drop_old(&mut self, out: &mut impl FnMut(Output)) {
        let Some(next) = self.next else { return };
        let last = next.offset_nanos(-GRID_NANOS.cast_signed());
        let is_over = self.point.as_ref().is_some_and(|point| {
            last - point.step > self.limit_ns || !self.is_due && !self.is_behind(last)
        });
        if is_over && let Some(point) = self.point.take() {
            point.held.into_iter().for_each(&mut *out);
            self.is_due = false;
        }
    }

    /// Repeats the steps since the point with what has come since. If something is still missing, the
    /// point moves to the first step that lacks it.
    fn repeat(&mut self, out: &mut impl FnMut(Output)) {
        self.is_due = false;
        let (Some(point), Some(next)) = (self.point.take(), self.next) else {
            return;
        };
        self.estimator = point.estimator;
        let mut inputs = point.inputs;
        inputs.sort_by_key(|(due, _)| *due);
        let mut inputs = inputs.into_iter().peekable();
        let (mut held, mut events) = (Vec::new(), Vec::new());
        let mut step = point.step;
        while step < next {
            let deadline = step + HOLD_NS;
            while let Some((due, input)) = inputs.next_if(|(due, _)| *due < deadline) {
                self.give(due, input);
            }
            if self.point.is_none() && self.is_behind(step) {
                held.drain(..).for_each(&mut *out);
                self.point = Some(self.point_before(step));
            }
            self.estimator
                .advance(deadline, &mut |output| match output {
                    Output::Event(event) => events.push(event),
                    output @ (Output::Step(_) | Output::Lagged(_)) => held.push(output),
                    _ => {}
                });
            step = step + GRID_NANOS.cast_signed();
        }
        for (due, input) in inputs {
            self.give(due, input);
        }
        match &mut self.point {
            None => held.into_iter().for_each(&mut *out),
            Some(point) => {
                point.held = held;
                point.events.clone_from(&events);
            }
        }
        correct(&point.events, events, out);
    }

    /// Gives an input to the estimator, and keeps it if the steps after it may be repeated.
    fn give(&mut self, due: LogTime, input: Input) {
        match &input {
            Input::Sample(sample, message) => self.estimator.push_of(sample, *message),
            // The first time has reported an error.
            Input::Mark(text) => drop(self.estimator.mark(text)),
        }
        if let Some(point) = &mut self.point {
            point.inputs.push((due, input));
        }
    }
}

/// Kind of the measurements that may be late, by wheel and by the channels that come together in a frame.
/// GNSS has its latency in the motion filter.
fn kind(measurement: &Measurement) -> Option<u32> {
    let of_wheel =
        |kind: u32, wheel: Wheel, channels: u32| kind | (wheel.index() as u32) << 3 | channels << 8;
    Some(match measurement {
        Measurement::Imu(_) => 0,
        Measurement::Steer(_) => 1,
        Measurement::WheelSpeed(speeds) => 2 | present(&speeds.angular_speed_rad_s.0) << 8,
        Measurement::Corner(corner) => {
            let deflection = u32::from(corner.deflection_counts.is_some());
            let strain = present(&corner.strain_counts);
            of_wheel(3, corner.wheel, strain << 1 | deflection)
        }
        Measurement::HubAcceleration(hub) => {
            of_wheel(4, hub.wheel, present(&hub.specific_force_m_s2))
        }
        _ => return None,
    })
}

/// A bit for each channel that has a value.
fn present<T>(channels: &[Option<T>]) -> u32 {
    let bits = channels.iter().enumerate();
    bits.map(|(n, channel)| u32::from(channel.is_some()) << n)
        .sum()
}

/// Hands out the events of repeated steps that were not handed out before, and takes back faults, and the
/// ends of faults, that the repeated steps do not have.
fn correct(before: &[Event], now: Vec<Event>, out: &mut impl FnMut(Output)) {
    for event in before {
        let opposite = match &event.kind {
            EventKind::SensorFault(name) => EventKind::SensorRecovered(name.clone()),
            EventKind::SensorRecovered(name) => EventKind::SensorFault(name.clone()),
            _ => continue,
        };
        if !now.iter().any(|other| other.kind == event.kind) {
            let text = format!("{}: late samples have shown otherwise", opposite.name());
            let kind = opposite;
            out(Output::Event(Event {
                kind,
                text,
                ..event.clone()
            }));
        }
    }
    for event in now {
        if !before.iter().any(|other| is_same(&other.kind, &event.kind)) {
            out(Output::Event(event));
        }
    }
}

/// Whether two events are of one kind and one wheel, axle, side or sensor.
fn is_same(a: &EventKind, b: &EventKind) -> bool {
    match (a, b) {
        (EventKind::LiftWarning(a, _), EventKind::LiftWarning(b, _)) => a == b,
        (EventKind::TwoWheelLiftWarning(a, _), EventKind::TwoWheelLiftWarning(b, _)) => a == b,
        (EventKind::SurfaceChange(a, _), EventKind::SurfaceChange(b, _)) => a == b,
        _ => a == b,
    }
}
