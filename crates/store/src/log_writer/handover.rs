//! Data that one file of a run hands over to the next.

use std::collections::BTreeMap;
use std::sync::Arc;

use sample::{Arrival, Notice, Payload, SourceId};

use crate::channels::LATCHED;
use crate::convert::{self, Encoded, Envelope};
use crate::dynamic::DynamicMessage;
use crate::{Record, UtcOffset};

/// The last states, which the next file of a run repeats at its start, and the schemas made at run time,
/// without which the next file cannot describe its channels.
#[derive(Clone, Default)]
pub(crate) struct Latched {
    pub(super) notices: BTreeMap<SourceId, Arrival>,
    pub(super) messages: BTreeMap<(Arc<str>, Option<SourceId>), Encoded>,
    /// Messages of the DBC files and of controllers, by topic.
    pub(super) dynamic: BTreeMap<String, DynamicMessage>,
}

impl Latched {
    pub(super) fn see_arrival(&mut self, arrival: &Arrival) {
        if let Payload::Notice(Notice::Opened(_) | Notice::Closed(_)) = &arrival.payload {
            self.notices.insert(arrival.source, arrival.clone());
        }
    }

    /// The last offset of UTC, of this file or of the files before.
    pub(super) fn utc_offset(&self) -> Option<UtcOffset> {
        let message = self.messages.get(&("/utc_offset".into(), None))?;
        let envelope = Envelope {
            topic: &message.topic,
            schema: &message.schema,
            source: SourceId::HOST,
            log_time: message.log_time,
            publish_time: message.publish_time,
        };
        match convert::decode(&envelope, &message.data) {
            Ok(Some(Record::UtcOffset(offset))) => Some(offset),
            _ => None,
        }
    }

    pub(super) fn see_message(&mut self, message: &Encoded) {
        if LATCHED.contains(&&*message.schema) {
            let key = (message.topic.clone(), message.source);
            self.messages.insert(key, message.clone());
        }
    }
}

/// Data that a failed log could not take.
#[derive(Default)]
pub(crate) struct Pending {
    pub arrivals: Vec<Arrival>,
    /// Arrivals in the log that may not have reached the disk.
    pub unsynced: Vec<Arrival>,
    pub messages: Vec<Encoded>,
}

impl Pending {
    /// Adds the arrivals that may not have reached the disk to those for the next log.
    pub(crate) fn with_unsynced(mut self) -> Self {
        self.arrivals
            .splice(..0, std::mem::take(&mut self.unsynced));
        self
    }
}
