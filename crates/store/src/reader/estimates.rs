//! Estimates, whose parts are messages of several topics.

use sample::{Estimate, ForceFrame, Motion, PerWheel, Rollover, TyreForce};

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
    /// Which parts of the open estimate are set.
    is_set: IsSet,
    /// Forces of the present message.
    forces: PerWheel<TyreForce>,
    /// Estimates of the caller that it needs no longer; the next ones take their memory.
    #[expect(clippy::vec_box, reason = "the boxes are passed on without a copy")]
    spare: Vec<Box<Estimate>>,
}

/// Parts of an estimate that a message has set. The memory of the others can hold an earlier estimate.
#[derive(Clone, Copy, Debug, Default)]
struct IsSet {
    motion: bool,
    carrier: bool,
    measured: bool,
    expected: bool,
    rollover: bool,
}

impl EstimateJoiner {
    /// A joiner of the estimates of a stage. Those of [`Stage::Estimate`] have the forces that the model
    /// expects, too.
    #[must_use]
    pub fn new(stage: Stage) -> Self {
        Self {
            stage,
            open: None,
            is_set: IsSet::default(),
            forces: PerWheel([TyreForce::default(); 4]),
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
        let is_done = self.open.as_ref().is_some_and(|open| open.time != time);
        let done = if is_done { self.take() } else { None };
        let spare = &mut self.spare;
        let estimate = self.open.get_or_insert_with(|| {
            let spare = spare.pop();
            spare.unwrap_or_else(|| Box::new(unknown_estimate(time)))
        });
        estimate.time = time;
        let is_set = &mut self.is_set;
        let bad = |cause| bad_message(*message)(cause);
        match part {
            Part::Motion => {
                convert::motion(message.data, &mut estimate.motion).map_err(bad)?;
                is_set.motion = true;
            }
            Part::Rollover => {
                estimate.rollover = convert::rollover(message.data).map_err(bad)?;
                is_set.rollover = true;
            }
            Part::Forces => {
                let frame = convert::forces(message.data, &mut self.forces).map_err(bad)?;
                let (forces, is_set) = match frame {
                    _ if stage != self.stage => (&mut estimate.expected, &mut is_set.expected),
                    ForceFrame::Contact => (&mut estimate.measured, &mut is_set.measured),
                    ForceFrame::WheelCarrier => (&mut estimate.carrier, &mut is_set.carrier),
                };
                *forces = self.forces;
                *is_set = true;
            }
        }
        Ok(done)
    }

    /// Takes the open estimate. What no message has set is unknown.
    fn take(&mut self) -> Option<Box<Estimate>> {
        let mut estimate = self.open.take()?;
        let is_set = std::mem::take(&mut self.is_set);
        let unknown = PerWheel([TyreForce::default(); 4]);
        if !is_set.motion {
            estimate.motion = Motion::default();
        }
        if !is_set.carrier {
            estimate.carrier = unknown;
        }
        if !is_set.measured {
            estimate.measured = unknown;
        }
        if !is_set.expected {
            estimate.expected = unknown;
        }
        if !is_set.rollover {
            estimate.rollover = Rollover::default();
        }
        Some(estimate)
    }

    /// The last estimate.
    #[must_use]
    pub fn finish(mut self) -> Option<Box<Estimate>> {
        self.take()
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

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::sync::Arc;

    use prost::Message as _;
    use sample::LogTime;

    use super::*;
    use crate::proto::atvrec as pb;

    fn channel(topic: &str, schema: &str) -> Arc<ChannelInfo> {
        Arc::new(ChannelInfo {
            topic: topic.to_owned(),
            schema: schema.to_owned(),
            schema_data: Arc::from([]),
            message_encoding: "protobuf".to_owned(),
            source: None,
            metadata: BTreeMap::new(),
            is_earlier: false,
        })
    }

    /// An estimate in the memory of another one has no value of it.
    #[test]
    fn parts_without_a_message_are_unknown() {
        let motion = channel("/truth/motion", "atvrec.Motion");
        let forces = channel("/truth/contact_forces", "atvrec.TyreForces");
        let of_motion = pb::Motion {
            velocity_x_m_s: 5.0,
            ..pb::Motion::default()
        };
        let of_forces = pb::TyreForces {
            frame: pb::ForceFrame::Contact.into(),
            wheels: vec![pb::TyreForce {
                axle: 1,
                side: "left".to_owned(),
                z_n: 900.0,
                ..pb::TyreForce::default()
            }],
        };
        let [of_motion, of_forces] = [of_motion.encode_to_vec(), of_forces.encode_to_vec()];
        let mut joiner = EstimateJoiner::new(Stage::Truth);
        let mut push = |channel: &Arc<ChannelInfo>, time, data: &[u8]| {
            let message = MessageRef {
                channel,
                sequence: 0,
                log_time: LogTime(time),
                publish_time: LogTime(time),
                data,
                place: (0, 0),
                part: part(channel),
            };
            let done = joiner.push(&message).expect("messages of the schema");
            if let Some(mut done) = done.clone() {
                done.expected = done.measured;
                done.rollover.load_transfer_ratio = 0.5;
                joiner.reuse(done);
            }
            done
        };
        assert!(push(&motion, 1, &of_motion).is_none() && push(&forces, 1, &of_forces).is_none());
        let both = push(&motion, 2, &of_motion).expect("the first");
        assert_eq!(both.measured[sample::Wheel::FrontLeft].force_n[2], 900.0);
        assert!(push(&forces, 3, &of_forces).is_some());
        let forces_alone = push(&motion, 4, &of_motion).expect("the third");
        let unknown = |estimate: &Estimate| format!("{estimate:?}");
        let expected = Estimate {
            measured: both.measured,
            ..unknown_estimate(LogTime(3))
        };
        assert_eq!(unknown(&forces_alone), unknown(&expected));
    }
}
