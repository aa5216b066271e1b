//! The summary at the end of a closed log, without reading through the log.

use std::path::Path;

use sample::LogTime;

use crate::reader::Index;
use crate::session::{RUN_METADATA, UTC_METADATA};
use crate::{Result, Session, UtcOffset};

/// The summary at the end of a closed log.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Summary {
    /// The run; attachments and dynamic messages stay empty.
    pub session: Session,
    /// Part of the run, from 0.
    pub part: Option<u32>,
    /// Log time of the first and the last message.
    pub span: Option<(LogTime, LogTime)>,
    /// Marks in it.
    pub marks: u64,
    /// The last offset of UTC, where the metadata states it.
    pub utc_offset: Option<UtcOffset>,
    /// Messages on `/utc_offset`.
    pub utc_offsets: u64,
}

impl Summary {
    /// Reads the end of a log: a few reads whose size depends on the number of chunks alone. `None`
    /// for a log without a sound summary, as an unfinished or damaged one.
    ///
    /// # Errors
    /// If the file cannot be read or is no MCAP file.
    pub fn read(path: &Path) -> Result<Option<Self>> {
        let Some(index) = Index::of_closed(path)? else {
            return Ok(None);
        };
        let count = |topic: &str| {
            let of_topic = index.channels.iter().filter(|(_, c)| c.topic == topic);
            of_topic
                .filter_map(|(id, _)| index.counts.get(id))
                .sum::<u64>()
        };
        let run = index.metadata.get(RUN_METADATA);
        let utc = index.metadata.get(UTC_METADATA);
        Ok(Some(Self {
            session: run.map(Session::from_metadata).unwrap_or_default(),
            part: run.and_then(|run| run.get("part")?.parse().ok()),
            span: index.span,
            marks: count("/mark"),
            utc_offset: utc.and_then(UtcOffset::from_metadata),
            utc_offsets: count("/utc_offset"),
        }))
    }
}
