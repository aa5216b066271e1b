//! Estimates, whose parts are messages of several topics.

use sample::{Estimate, ForceFrame};

use super::{MessageIter, unknown_estimate};
use crate::{Record, Result, Stage};

/// Puts the estimates of a stage together from their parts, which are adjacent in the log.
#[derive(Clone, Debug)]
pub struct EstimateJoiner {
    stage: Stage,
    open: Option<Box<Estimate>>,
}

impl EstimateJoiner {
    /// A joiner of the estimates of a stage. Those of [`Stage::Estimate`] have the forces that the model
    /// expects, too.
    #[must_use]
    pub const fn new(stage: Stage) -> Self {
        Self { stage, open: None }
    }

    /// Takes a record, and returns the estimate before it if the record is of another instant. Records
    /// of other stages are left out.
    pub fn push(&mut self, record: &Record) -> Option<Box<Estimate>> {
        let is_own = |stage: Stage| {
            stage == self.stage || (self.stage == Stage::Estimate && stage == Stage::Model)
        };
        let time = match record {
            Record::Motion { time, stage, .. } if *stage == self.stage => *time,
            Record::TyreForces { time, stage, .. } if is_own(*stage) => *time,
            Record::Rollover { time, .. } if self.stage == Stage::Estimate => *time,
            _ => return None,
        };
        let done = self.open.take_if(|open| open.time != time);
        let estimate = self
            .open
            .get_or_insert_with(|| Box::new(unknown_estimate(time)));
        match record {
            Record::Motion { motion, .. } => estimate.motion = **motion,
            Record::Rollover { rollover, .. } => estimate.rollover = *rollover,
            Record::TyreForces {
                forces,
                frame,
                stage: of,
                ..
            } => match frame {
                _ if *of != self.stage => estimate.expected = **forces,
                ForceFrame::Contact => estimate.measured = **forces,
                ForceFrame::WheelCarrier => estimate.carrier = **forces,
            },
            _ => {}
        }
        done
    }

    /// The last estimate.
    #[must_use]
    pub fn finish(self) -> Option<Box<Estimate>> {
        self.open
    }
}

/// Joins the parts of each instant.
pub(super) fn joined(
    messages: MessageIter,
    stage: Stage,
) -> impl Iterator<Item = Result<Estimate>> {
    let mut messages = messages.fuse();
    // The model is joined with the estimates.
    let stage = match stage {
        Stage::Model => Stage::Estimate,
        stage => stage,
    };
    let mut joiner = Some(EstimateJoiner::new(stage));
    std::iter::from_fn(move || {
        loop {
            let Some(message) = messages.next() else {
                return joiner.take()?.finish().map(|last| Ok(*last));
            };
            match message.and_then(|message| message.record()) {
                Err(error) => return Some(Err(error)),
                Ok(None) => {}
                Ok(Some(record)) => {
                    if let Some(done) = joiner.as_mut()?.push(&record) {
                        return Some(Ok(*done));
                    }
                }
            }
        }
    })
}
