//! Estimates, whose parts are messages of several topics.

use sample::{Estimate, ForceFrame};

use super::messages::bad_message;
use super::{ChannelInfo, MessageIter, MessageRef, unknown_estimate};
use crate::{Result, Stage, convert};

/// What a message tells of an estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    Motion,
    Forces,
    Rollover,
}

/// What the messages of a channel tell of the estimates of a stage.
pub(super) fn part(channel: &ChannelInfo) -> Option<(Part, Stage)> {
    let part = match channel.schema.as_str() {
        "atvrec.Motion" => Part::Motion,
        "atvrec.TyreForces" => Part::Forces,
        "atvrec.Rollover" => Part::Rollover,
        _ => return None,
    };
    Some((
        part,
        Stage::from_topic(&channel.topic).unwrap_or(Stage::Estimate),
    ))
}

/// Puts the estimates of a stage together from their parts, which are adjacent in the log.
#[derive(Clone, Debug)]
pub struct EstimateJoiner {
    stage: Stage,
    open: Option<Box<Estimate>>,
    /// Estimates of the caller that it needs no longer; the next ones take their memory.
    #[expect(
        clippy::vec_box,
        reason = "the boxes are passed on without a copy of 3 kB"
    )]
    spare: Vec<Box<Estimate>>,
}

impl EstimateJoiner {
    /// A joiner of the estimates of a stage. Those of [`Stage::Estimate`] have the forces that the model
    /// expects, too.
    #[must_use]
    pub const fn new(stage: Stage) -> Self {
        Self {
            stage,
            open: None,
            spare: Vec::new(),
        }
    }

    /// Gives back an estimate, whose memory the next one takes.
    pub fn reuse(&mut self, estimate: Box<Estimate>) {
        self.spare.push(estimate);
    }

    /// Whether a message is a part of the estimates of the stage.
    #[must_use]
    pub fn owns(&self, message: &MessageRef<'_>) -> bool {
        match message.part {
            Some((Part::Motion, stage)) => stage == self.stage,
            Some((Part::Forces, Stage::Model) | (Part::Rollover, _)) => {
                self.stage == Stage::Estimate
            }
            Some((Part::Forces, stage)) => stage == self.stage,
            None => false,
        }
    }

    /// Takes a message, and returns the estimate before it if the message is of another instant. Messages
    /// that the joiner does not own are left out.
    ///
    /// # Errors
    /// If the message does not follow its schema.
    pub fn push(&mut self, message: &MessageRef<'_>) -> Result<Option<Box<Estimate>>> {
        let Some((part, stage)) = message.part.filter(|_| self.owns(message)) else {
            return Ok(None);
        };
        let time = message.log_time;
        let done = self.open.take_if(|open| open.time != time);
        let spare = &mut self.spare;
        let estimate = self.open.get_or_insert_with(|| match spare.pop() {
            Some(mut estimate) => {
                *estimate = unknown_estimate(time);
                estimate
            }
            None => Box::new(unknown_estimate(time)),
        });
        let bad = |cause| bad_message(*message)(cause);
        match part {
            Part::Motion => estimate.motion = convert::motion(message.data).map_err(bad)?,
            Part::Rollover => estimate.rollover = convert::rollover(message.data).map_err(bad)?,
            Part::Forces => {
                let (frame, forces) = convert::forces(message.data).map_err(bad)?;
                match frame {
                    _ if stage != self.stage => estimate.expected = forces,
                    ForceFrame::Contact => estimate.measured = forces,
                    ForceFrame::WheelCarrier => estimate.carrier = forces,
                }
            }
        }
        Ok(done)
    }

    /// The last estimate.
    #[must_use]
    pub fn finish(self) -> Option<Box<Estimate>> {
        self.open
    }
}

/// Joins the parts of each instant.
pub(super) fn joined(
    mut messages: MessageIter,
    stage: Stage,
) -> impl Iterator<Item = Result<Estimate>> {
    // The model is joined with the estimates.
    let stage = match stage {
        Stage::Model => Stage::Estimate,
        stage => stage,
    };
    let mut joiner = Some(EstimateJoiner::new(stage));
    std::iter::from_fn(move || {
        loop {
            let Some(message) = messages.next_ref() else {
                return joiner.take()?.finish().map(|last| Ok(*last));
            };
            match message
                .and_then(|message| joiner.as_mut().map_or(Ok(None), |of| of.push(&message)))
            {
                Err(error) => return Some(Err(error)),
                Ok(None) => {}
                Ok(Some(done)) => return Some(Ok(*done)),
            }
        }
    })
}
