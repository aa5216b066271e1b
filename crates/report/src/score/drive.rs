//! What a score needs of a log. The lagged estimates are read after the others are judged: all
//! estimates together need too much memory.

use std::rc::Rc;

use sample::{Estimate, Event, LogTime, Parameters, PerWheel};
use store::{EstimateJoiner, Reader, Record, Selection, Stage};

use super::{ScoreError, TruthByTime};

/// Truth, estimates, and what else is judged.
#[derive(Default)]
pub(super) struct Drive {
    pub truth: TruthByTime,
    pub estimates: Vec<Estimate>,
    pub events: Vec<Event>,
    pub reports: Vec<Parameters>,
    /// Friction coefficients of the truth.
    pub friction: Vec<(LogTime, PerWheel<f64>)>,
}

impl Drive {
    /// Reads a log; the estimates are those of `stage`.
    pub fn read(
        reader: &Reader,
        stage: Stage,
        progress: &mut dyn FnMut(f64) -> Result<(), ScoreError>,
    ) -> Result<Self, ScoreError> {
        let mut drive = Self::default();
        let bytes: u64 = reader.info().files.iter().map(|(_, bytes)| bytes).sum();
        let own = match stage {
            Stage::Estimate => "/model/tyre_forces".to_owned(),
            stage => format!("/{}/*", stage.name()),
        };
        let topics = ["/estimate/*", "/truth/*"].map(str::to_owned);
        let topics = topics.into_iter().chain([own]);
        let mut messages = reader.messages(Selection::topics(topics));
        let mut joiners = [Stage::Truth, stage].map(EstimateJoiner::new);
        let mut count = 0_u32;
        while let Some(message) = messages.next_ref() {
            if let Some(record) = message?.record()? {
                for (output, joiner) in joiners.iter_mut().enumerate() {
                    if let Some(done) = joiner.push(&record) {
                        drive.add(output, done);
                    }
                }
                drive.take(record);
            }
            count += 1;
            if count.is_multiple_of(1024) {
                progress(messages.bytes_done() as f64 / bytes.max(1) as f64)?;
            }
        }
        for (output, joiner) in joiners.into_iter().enumerate() {
            if let Some(done) = joiner.finish() {
                drive.add(output, done);
            }
        }
        Ok(drive)
    }

    /// The first instant of the truth.
    pub fn start(&self) -> Option<LogTime> {
        self.truth.keys().next().copied()
    }

    fn add(&mut self, output: usize, estimate: Estimate) {
        match output {
            0 => {
                self.truth.insert(estimate.time, Rc::new(estimate));
            }
            _ => self.estimates.push(estimate),
        }
    }

    fn take(&mut self, record: Record) {
        match record {
            Record::Event(event) => self.events.push(event),
            Record::Parameters(parameters) => self.reports.push(parameters),
            Record::Friction { time, coefficient } => self.friction.push((time, coefficient)),
            _ => {}
        }
    }
}
