//! The pass over a log that scores it: estimates are compared with the truth part by part.

use std::collections::{BTreeMap, VecDeque};
use std::rc::Rc;

use model::vehicle::Vehicle;
use sample::{Estimate, Event, LogTime, PerWheel};
use store::{EstimateJoiner, Reader, Record, Selection, Stage};

use super::forces::{ForceScore, Forces, Frames, LowPassed, known_frames};
use super::innovations::{self, Judged};
use super::landings::Landings;
use super::lifts::Courses;
use super::road::Ground;
use super::signals::Signals;
use super::stops::{self, Stops};
use super::surfaces::Surfaces;
use super::{
    INTERVAL_S, LowPassedScore, PART_PAIRS, Pairs, SETTLING_S, Score, ScoreError, ScoreOptions,
    SharedEstimate, TILE_PAIRS, channels, counts, static_loads,
};

/// Instants that wait for their counterpart at most: 41 s at 100 Hz.
pub(super) const WAITING_MAX: usize = 4096;
/// Instants of the truth that are kept although both outputs have later estimates.
const PAST_KEPT: usize = 64;
/// Instants from which the frames of the forces are found: 10 s. The filters settle in less time.
const HEAD_PAIRS: usize = 1024;

/// What was read so far.
pub(super) struct Pass<'a> {
    stage: Stage,
    from_s: f64,
    low_pass_hz: Option<f64>,
    loads: PerWheel<f64>,
    start: Option<LogTime>,
    /// The last instants of the truth.
    truth: BTreeMap<LogTime, SharedEstimate>,
    /// Estimates and truths that were compared; their memory is used again.
    #[expect(clippy::vec_box, reason = "the boxes are passed on without a copy")]
    spare: Vec<Box<Estimate>>,
    /// Of the stage, and of the estimates with a lag.
    outputs: [Output; 2],
    signals: Signals,
    /// Number of instants of the stage that were compared.
    count: usize,
    courses: Courses,
    stops: Stops,
    surfaces: Surfaces,
    ground: Ground<'a>,
    events: Vec<Event>,
    reports: Vec<Judged>,
}

/// An output of the estimator.
struct Output {
    /// Estimates whose truth was not read yet.
    waiting: VecDeque<Box<Estimate>>,
    /// Time of the last estimate that found its truth.
    paired: Option<LogTime>,
    /// Pairs that were not compared yet.
    pairs: Pairs,
    /// Number of pairs of the present part that were compared.
    part: usize,
    /// The compared frames, after a force was known.
    frames: Option<Frames>,
    forces: Forces,
    low_passed: Option<LowPassed>,
    landings: Landings,
}

impl Output {
    fn new(low_pass_hz: Option<f64>) -> Self {
        Self {
            waiting: VecDeque::new(),
            paired: None,
            pairs: Vec::new(),
            part: 0,
            frames: None,
            forces: Forces::default(),
            low_passed: low_pass_hz.map(LowPassed::new),
            landings: Landings::default(),
        }
    }

    /// Pairs the estimates whose truth is known, and leaves out those that have none.
    fn pair(&mut self, truth: &BTreeMap<LogTime, SharedEstimate>, from: LogTime) {
        while let Some(first) = self.waiting.front() {
            let found = truth.get(&first.time);
            if found.is_none() && self.waiting.len() <= WAITING_MAX {
                let last = truth.keys().next_back();
                if last.is_none_or(|last| *last < first.time) {
                    return;
                }
            }
            if let (Some(estimate), Some(truth)) = (self.waiting.pop_front(), found) {
                self.paired = Some(estimate.time);
                if estimate.time >= from {
                    self.pairs.push((estimate, Rc::clone(truth)));
                }
            }
        }
    }

    /// Number of pairs whose neighbourhood in the truth is known.
    fn ready(&self, truth: &BTreeMap<LogTime, SharedEstimate>) -> usize {
        let last = truth.keys().next_back().copied().unwrap_or_default();
        let until = last.offset_seconds(-stops::AHEAD_S);
        self.pairs
            .partition_point(|(estimate, _)| estimate.time <= until)
    }
}

impl<'a> Pass<'a> {
    pub fn new(vehicle: &'a Vehicle, options: ScoreOptions) -> Self {
        let low_pass_hz = options.low_pass_hz;
        Self {
            stage: options.stage,
            from_s: options.from_s,
            low_pass_hz,
            loads: static_loads(vehicle),
            start: None,
            truth: BTreeMap::new(),
            spare: Vec::new(),
            outputs: [Output::new(low_pass_hz), Output::new(low_pass_hz)],
            signals: Signals::default(),
            count: 0,
            courses: Courses::default(),
            stops: Stops::new(vehicle),
            surfaces: Surfaces::default(),
            ground: Ground::new(vehicle),
            events: Vec::new(),
            reports: Vec::new(),
        }
    }

    /// Reads the log. `progress` is called with the part of the log that was read, from 0 to 1.
    pub fn read(
        &mut self,
        reader: &Reader,
        progress: &mut dyn FnMut(f64) -> Result<(), ScoreError>,
    ) -> Result<(), ScoreError> {
        let bytes: u64 = reader.info().files.iter().map(|(_, bytes)| bytes).sum();
        let mut messages = reader.messages(Selection::topics(topics(self.stage)));
        let mut joiners = [Stage::Truth, self.stage, Stage::Lagged].map(EstimateJoiner::new);
        let mut count = 0_u32;
        while let Some(message) = messages.next_ref() {
            let message = message?;
            let owner = joiners.iter().position(|joiner| joiner.owns(&message));
            if let Some(of) = owner {
                if let Some(done) = joiners[of].push(&message)? {
                    self.add(of, done);
                    if let Some(spare) = self.spare.pop() {
                        joiners[of].reuse(spare);
                    }
                }
            } else if let Some(record) = message.record()? {
                self.take(record);
            }
            count += 1;
            if count.is_multiple_of(1024) {
                progress(messages.bytes_done() as f64 / bytes.max(1) as f64)?;
            }
        }
        for (of, joiner) in joiners.into_iter().enumerate() {
            if let Some(done) = joiner.finish() {
                self.add(of, done);
            }
        }
        Ok(())
    }

    /// Takes an instant of the truth (0), of the stage (1) or of the estimates with a lag (2).
    fn add(&mut self, of: usize, estimate: Box<Estimate>) {
        if of > 0 {
            self.outputs[of - 1].waiting.push_back(estimate);
            if self.outputs[of - 1].waiting.len() > WAITING_MAX {
                self.pair();
            }
            return;
        }
        let start = *self.start.get_or_insert(estimate.time);
        self.courses.push(&estimate, start, &self.loads);
        self.stops.push(&estimate, start, &self.loads);
        self.surfaces.push(&estimate, start, &self.loads);
        self.ground
            .push_truth(&estimate, start.offset_seconds(self.from_s));
        self.truth.insert(estimate.time, Rc::new(estimate));
        self.pair();
        self.forget_truth();
    }

    /// Leaves out the instants of the truth that no estimate needs: the fewer they are, the more of them stay in
    /// the processor's cache.
    fn forget_truth(&mut self) {
        let [one, other] = self.outputs.each_ref().map(|output| output.paired);
        // A log may lack one of the outputs.
        let paired = one.zip(other).map(|(one, other)| one.min(other));
        while let Some(first) = self.truth.keys().next()
            && self.truth.len() > PAST_KEPT
        {
            let is_past = paired.is_some_and(|paired| *first < paired);
            if !is_past && self.truth.len() <= WAITING_MAX {
                return;
            }
            let first = self.truth.pop_first();
            self.spare
                .extend(first.and_then(|(_, truth)| Rc::into_inner(truth)));
        }
    }

    fn pair(&mut self) {
        let Some(start) = self.start else {
            return;
        };
        let from = start.offset_seconds(self.from_s);
        for output in 0..self.outputs.len() {
            self.outputs[output].pair(&self.truth, from);
            // A few pairs at a time, which are still in the processor's cache.
            let due = match self.outputs[output].frames {
                Some(_) => TILE_PAIRS,
                None => HEAD_PAIRS,
            };
            let part = self.outputs[output].part;
            let count = self.outputs[output].ready(&self.truth);
            if count >= due || part + count >= PART_PAIRS {
                self.compare(output, count);
            }
        }
    }

    /// Compares the first `count` pairs of an output.
    fn compare(&mut self, output: usize, count: usize) {
        let of = &mut self.outputs[output];
        let estimates = || of.pairs[..count].iter().map(|(estimate, _)| &**estimate);
        of.frames = of.frames.or_else(|| known_frames(estimates()));
        let frames = of.frames.as_ref();
        for tile in of.pairs[..count].chunks(TILE_PAIRS) {
            let masks = self.stops.masks(tile);
            of.forces.push(tile, frames, Some(&masks));
            of.landings.push(tile, &self.loads);
            if let Some(low_passed) = &mut of.low_passed {
                low_passed.push(tile, frames);
            }
            if output == 0 {
                self.count += tile.len();
                self.signals.push(tile, frames);
            }
        }
        of.part += count;
        for (estimate, truth) in of.pairs.drain(..count) {
            self.spare.push(estimate);
            self.spare.extend(Rc::into_inner(truth));
        }
        if of.part >= PART_PAIRS {
            self.end_part(output);
        }
    }

    /// Ends the part of an output.
    fn end_part(&mut self, output: usize) {
        let of = &mut self.outputs[output];
        of.part = 0;
        of.forces.end_part();
        if output == 0 {
            self.signals.end_part();
        }
    }

    fn take(&mut self, record: Record) {
        match record {
            Record::Event(event) => self.events.push(event),
            Record::Parameters(parameters) => self.reports.push(Judged::new(&parameters)),
            Record::Friction { time, coefficient } => {
                self.surfaces.push_friction(time, coefficient)
            }
            Record::Road { stage, road, .. } => self.ground.push_road(stage, *road),
            Record::Ground { time, ground } => {
                self.stops.push_ground(time, &ground);
                self.ground.push_ground(time, *ground);
            }
            _ => {}
        }
    }

    pub fn finish(mut self, reader: &Reader) -> Result<Score, ScoreError> {
        let start = self.start.ok_or(ScoreError::NoTruth)?;
        for output in 0..self.outputs.len() {
            // What waits has no truth: the last truth was read.
            self.outputs[output].pair(&self.truth, start.offset_seconds(self.from_s));
            self.compare(output, self.outputs[output].pairs.len());
            self.end_part(output);
        }
        if self.count == 0 {
            return Err(ScoreError::NoPair("truth"));
        }
        let from_s = if self.from_s > SETTLING_S {
            self.from_s
        } else {
            0.0
        };
        let mut forces: Vec<ForceScore> = Vec::new();
        let mut low_passed = Vec::new();
        let mut landings = Vec::new();
        for (of, stage) in self.outputs.into_iter().zip([self.stage, Stage::Lagged]) {
            forces.extend(of.forces.finish(stage.name(), &self.loads));
            let filtered = of.low_passed;
            low_passed.extend(filtered.map(|of| of.finish(stage.name(), &self.loads)));
            landings.extend(of.landings.finish(stage.name()));
        }
        let [lifts, two_wheel_lifts] = self.courses.finish(start, from_s, &self.events);
        let injected = reader.session().injected_faults.as_ref();
        Ok(Score {
            seconds: self.count as f64 * INTERVAL_S,
            signals: self.signals.finish(&self.loads),
            forces,
            low_passed: self.low_pass_hz.map(|hz| LowPassedScore {
                hz,
                forces: low_passed.into_iter().flatten().collect(),
            }),
            landings,
            innovations: innovations::judged(&self.reports, self.from_s),
            lifts,
            two_wheel_lifts,
            stops: self.stops.finish(),
            surface_changes: self.surfaces.finish(start, from_s, &self.events),
            road: self.ground.finish(start.offset_seconds(self.from_s)),
            channels: injected
                .map(|injected| channels::find(injected, start, from_s, &self.events)),
            events: counts(&self.events, start.offset_seconds(from_s)),
        })
    }
}

/// The topics that a score needs.
fn topics(stage: Stage) -> Vec<String> {
    // Of the estimates with a lag, only forces and road are compared.
    let always = [
        "/truth/motion",
        "/truth/tyre_forces",
        "/truth/contact_forces",
        "/truth/friction",
        "/truth/ground",
        "/lagged/tyre_forces",
        "/lagged/contact_forces",
        "/lagged/road",
        "/estimate/events",
        "/estimate/parameters",
        "/estimate/road",
    ];
    let of_stage = ["motion", "tyre_forces", "contact_forces", "road"];
    let of_stage = of_stage.map(|topic| format!("/{}/{topic}", stage.name()));
    let model = (stage == Stage::Estimate).then(|| "/model/tyre_forces".to_owned());
    let always = always.into_iter().map(str::to_owned);
    always.chain(of_stage).chain(model).collect()
}
