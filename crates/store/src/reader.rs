//! Reading logs, whole or cut short.

mod arrivals;
mod definitions;
mod estimates;
mod index;
mod integrity;
mod messages;
mod parts;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use sample::{Estimate, LogTime, Motion, PerWheel, Rollover, Signal, SourceId, TyreForce};

pub use arrivals::ArrivalIter;
pub use estimates::EstimateJoiner;
pub use messages::{Message, MessageIter, MessageRef, Selection};

use crate::recovery::RECOVERED_METADATA;
use crate::session::{COUNTERS_METADATA, RUN_METADATA, UTC_METADATA};
use crate::{Attachment, Error, Record, Result, Session, Stage, UtcOffset};
pub(crate) use definitions::{Definitions, placeholder};
use index::attachment;
pub(crate) use index::{Index, Lost, ScanOptions};

/// One or more files of a run, read as one log.
pub struct Reader {
    pub(crate) files: Vec<Arc<LogFile>>,
    session: Session,
}

pub(crate) struct LogFile {
    pub path: PathBuf,
    pub index: Index,
}

/// A channel of a log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChannelInfo {
    /// Topic.
    pub topic: String,
    /// Name of the schema.
    pub schema: String,
    /// The schema itself: for protobuf a serialized `FileDescriptorSet`.
    pub schema_data: Arc<[u8]>,
    /// Encoding of the messages by the registry of MCAP, such as `protobuf` or `json`.
    pub message_encoding: String,
    /// The source that the channel belongs to, where it belongs to one.
    pub source: Option<SourceId>,
    /// Further metadata of the channel, such as units.
    pub metadata: BTreeMap<String, String>,
    /// Its messages are in the earlier layout; topic and schema are given in the present one.
    pub(crate) is_earlier: bool,
}

/// Data that is missing from a log.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Missing {
    /// The file has no summary: it was not closed. Its contents were found by reading through it.
    Unfinished {
        /// Which file.
        path: PathBuf,
    },
    /// The file ends inside of a record.
    Cut {
        /// Which file.
        path: PathBuf,
        /// Where the cut record begins.
        offset: u64,
    },
    /// A part of the file could not be read and was left out.
    Damaged {
        /// Which file.
        path: PathBuf,
        /// Where it begins.
        offset: u64,
        /// How long it is.
        bytes: u64,
        /// What it is.
        what: String,
    },
    /// A part of a damaged or unfinished file that no checksum confirms was left out.
    Unconfirmed {
        /// Which file.
        path: PathBuf,
        /// Where it begins.
        offset: u64,
        /// What it is.
        what: &'static str,
    },
    /// A closed file was changed.
    Changed {
        /// Which file.
        path: PathBuf,
        /// Which checksum is wrong.
        text: String,
    },
    /// A message does not follow its schema and was left out.
    BadMessage {
        /// Its topic.
        topic: String,
        /// Its log time.
        log_time: LogTime,
        /// What is wrong with it.
        text: String,
    },
    /// Parts of the run are not given.
    Parts {
        /// The first that is missing.
        first: u32,
        /// The last that is missing.
        last: u32,
    },
    /// A channel has no schema: its messages cannot be read, those of all other channels can.
    NoSchema {
        /// Which file.
        path: PathBuf,
        /// Topic of the channel.
        topic: String,
        /// Name of the schema that is not there.
        schema: String,
    },
    /// The recorder had to stop before everything was on the disk; see [`crate::losses_path`].
    Unwritten {
        /// The log beside the file that states this.
        path: PathBuf,
        /// Raw arrivals.
        arrivals: u64,
        /// Decoded records.
        records: u64,
    },
    /// Arrivals are missing from the sequence.
    Arrivals {
        /// Sequence of the first that is missing.
        first_sequence: u64,
        /// How many in a row.
        count: u64,
    },
}

impl Missing {
    /// Description without the name of the file.
    #[must_use]
    pub(crate) fn without_path(&self) -> String {
        match self {
            Self::Unfinished { .. } => "the file was not closed".to_owned(),
            Self::Cut { offset, .. } => {
                format!("the file ends inside of the record at byte {offset}")
            }
            Self::Damaged {
                offset,
                bytes,
                what,
                ..
            } => format!("the {what} at byte {offset} cannot be read; {bytes} bytes are left out"),
            Self::Unconfirmed { offset, what, .. } => {
                format!("no checksum covers the {what} at byte {offset}; it is left out")
            }
            Self::Changed { text, .. } => format!("bytes were changed since it was closed: {text}"),
            Self::BadMessage {
                topic,
                log_time,
                text,
            } => format!("a message on {topic} at {log_time} s is malformed: {text}"),
            Self::Parts { first, last } if first == last => format!("part {first} is missing"),
            Self::Parts { first, last } => format!("parts {first} to {last} are missing"),
            Self::NoSchema { topic, schema, .. } => format!(
                "the channel {topic} has no schema {schema}: its messages cannot be read, those of \
                 all other channels can"
            ),
            Self::Unwritten {
                arrivals, records, ..
            } => format!(
                "{arrivals} arrivals and {records} decoded records did not reach the disk, as the \
                 recorder stated in a file beside the log"
            ),
            Self::Arrivals {
                first_sequence,
                count,
            } => format!("{count} arrivals are missing from number {first_sequence} on"),
        }
    }
}

impl std::fmt::Display for Missing {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Self::Unfinished { path }
        | Self::Cut { path, .. }
        | Self::Damaged { path, .. }
        | Self::Unconfirmed { path, .. }
        | Self::Changed { path, .. }
        | Self::NoSchema { path, .. }
        | Self::Unwritten { path, .. } = self
        {
            write!(f, "{}: ", path.display())?;
        }
        f.write_str(&self.without_path())
    }
}

/// Contents of a log, in numbers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Info {
    /// Files, in order, with their sizes in bytes.
    pub files: Vec<(PathBuf, u64)>,
    /// Log time of the first and the last message.
    pub span: Option<(LogTime, LogTime)>,
    /// Messages of each topic, with the schema's name; exact for closed files.
    pub channels: BTreeMap<String, (String, u64)>,
    /// Chunks.
    pub chunks: u64,
    /// Counters of the closed and the recovered files, summed where they are numbers; of
    /// `first_sequence` the least, of `last_sequence` the greatest.
    pub counters: BTreeMap<String, u64>,
    /// Names, media types and sizes of the attachments.
    pub attachments: Vec<(String, String, u64)>,
    /// Missing data, as far as it is known without reading through the log.
    pub missing: Vec<Missing>,
}

impl Reader {
    /// Opens files of one run, in any order.
    ///
    /// # Errors
    /// If no file is given, one is given twice, cannot be read, is no MCAP file, or belongs to
    /// another run. A file that is cut or damaged is no error: see [`Info::missing`].
    pub fn open<P: AsRef<Path>>(paths: impl IntoIterator<Item = P>) -> Result<Self> {
        let mut files = Vec::new();
        for path in paths {
            let path = path.as_ref().to_owned();
            let index = Index::read(&path)?;
            if index.length == 0 {
                return Err(Error::EmptyFile { path });
            }
            files.push(LogFile { path, index });
        }
        parts::refuse_twice(&files)?;
        let part = |file: &LogFile| (parts::number(file), file.index.span.map(|span| span.0));
        files.sort_by_key(part);
        let sessions: Vec<Session> = files
            .iter()
            .map(|file| {
                let run = file.index.metadata.get(RUN_METADATA);
                run.map(Session::from_metadata).unwrap_or_default()
            })
            .collect();
        let Some(session) = sessions.first().cloned() else {
            return Err(Error::NoFiles);
        };
        for (file, other) in files.iter().zip(&sessions) {
            if other.run_id != session.run_id {
                return Err(Error::MixedRuns {
                    path: file.path.clone(),
                    expected: session.run_id,
                    found: other.run_id.clone(),
                });
            }
        }
        Ok(Self {
            files: files.into_iter().map(Arc::new).collect(),
            session,
        })
    }

    /// The description of the run. Attachments are read by [`Reader::attachments`].
    #[must_use]
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// Version of the contract that the log follows; `None` for a log of the layout before it, whose
    /// channels and messages are given in the present layout.
    #[must_use]
    pub fn contract(&self) -> Option<u32> {
        let mut files = self.files.iter();
        let run = files.find_map(|file| file.index.metadata.get(RUN_METADATA));
        run?.get("contract")?.parse().ok()
    }

    /// Contents of the log, in numbers.
    #[must_use]
    pub fn info(&self) -> Info {
        let mut info = Info {
            files: Vec::new(),
            span: None,
            channels: BTreeMap::new(),
            chunks: 0,
            counters: BTreeMap::new(),
            attachments: Vec::new(),
            missing: Vec::new(),
        };
        for file in &self.files {
            let index = &file.index;
            info.files.push((file.path.clone(), index.length));
            info.span = match (info.span, index.span) {
                (Some((a, b)), Some((c, d))) => Some((a.min(c), b.max(d))),
                (a, b) => a.or(b),
            };
            for (id, channel) in &index.channels {
                let count = index.counts.get(id).copied().unwrap_or_default();
                info.channels
                    .entry(channel.topic.clone())
                    .or_insert_with(|| (channel.schema.clone(), 0))
                    .1 += count;
            }
            info.chunks += index.parts.len() as u64;
            if let Some(counters) = index.metadata.get(COUNTERS_METADATA) {
                add_counters(&mut info.counters, counters);
            }
            for a in &index.attachments {
                let entry = (a.name.clone(), a.media_type.clone(), a.data_size);
                if !info.attachments.contains(&entry) {
                    info.attachments.push(entry);
                }
            }
            info.missing.extend(index.missing.iter().cloned());
            let without = index.channels.values().filter(|c| c.has_no_schema());
            info.missing
                .extend(without.map(|channel| channel.without_schema(&file.path)));
            info.missing.extend(file.unwritten(&mut info.counters));
        }
        info.missing.extend(self.missing_parts());
        info
    }

    /// The last offset of UTC against the log clock that a receiver gave: from the metadata of the
    /// last file that has it, else from the last message of `/utc_offset`.
    ///
    /// # Errors
    /// If a file can no longer be read.
    pub fn utc_offset(&self) -> Result<Option<UtcOffset>> {
        let in_metadata = self.files.iter().rev().find_map(|file| {
            let metadata = file.index.metadata.get(UTC_METADATA)?;
            UtcOffset::from_metadata(metadata)
        });
        if in_metadata.is_some() {
            return Ok(in_metadata);
        }
        let mut last = None;
        for message in self.messages(Selection::topics(["/utc_offset"])) {
            if let Ok(Some(Record::UtcOffset(offset))) = message?.record() {
                last = Some(offset);
            }
        }
        Ok(last)
    }

    /// Parts of the run that are not among the files, before the last one that is.
    #[must_use]
    pub fn missing_parts(&self) -> Vec<Missing> {
        parts::missing(self.files.iter().filter_map(|file| parts::number(file)))
    }

    /// Whether one of the files was repaired by [`crate::recover`].
    #[must_use]
    pub fn was_recovered(&self) -> bool {
        self.files
            .iter()
            .any(|file| file.index.metadata.contains_key(RECOVERED_METADATA))
    }

    /// All channels of all files, in order.
    pub fn channels(&self) -> impl Iterator<Item = &Arc<ChannelInfo>> {
        self.files
            .iter()
            .flat_map(|file| file.index.channels.values())
    }

    /// Metadata records of all files by name; where files differ, the last one's.
    #[must_use]
    pub fn metadata(&self) -> BTreeMap<String, BTreeMap<String, String>> {
        let all = self.files.iter().flat_map(|file| &file.index.metadata);
        all.map(|(name, map)| (name.clone(), map.clone())).collect()
    }

    /// The files carried inside the log; each once, though every file of a run repeats them.
    ///
    /// # Errors
    /// If a file can no longer be read.
    pub fn attachments(&self) -> Result<Vec<Attachment>> {
        let mut attachments: Vec<Attachment> = Vec::new();
        for file in &self.files {
            for index in &file.index.attachments {
                if let Some(found) = attachment(&file.path, index)?
                    && !attachments.contains(&found)
                {
                    attachments.push(found);
                }
            }
        }
        Ok(attachments)
    }

    /// Messages in the order of writing. Within a topic that is the order of log time.
    #[must_use]
    pub fn messages(&self, selection: Selection) -> MessageIter {
        MessageIter::new(self.files.clone(), selection)
    }

    /// The ordered stream: all arrivals by their sequence, in bounded memory.
    #[must_use]
    pub fn arrivals(&self) -> ArrivalIter {
        self.arrivals_between(LogTime(0), LogTime(u64::MAX))
    }

    /// The notices of the ordered stream alone; the rest is not decoded.
    #[must_use]
    pub fn notices(&self) -> ArrivalIter {
        ArrivalIter::notices(self.files.clone())
    }

    /// The ordered stream from `start` to `end`, both included.
    #[must_use]
    pub fn arrivals_between(&self, start: LogTime, end: LogTime) -> ArrivalIter {
        ArrivalIter::new(self.files.clone(), start, end)
    }

    /// The estimates of the log, put together from their channels.
    pub fn estimates(&self) -> impl Iterator<Item = Result<Estimate>> {
        self.of_stage(Stage::Estimate)
    }

    /// The truth of a simulated log: motion, and forces as `measured`; `expected` is unknown.
    pub fn truth(&self) -> impl Iterator<Item = Result<Estimate>> {
        self.of_stage(Stage::Truth)
    }

    /// Estimates of a stage. Only the causal estimates have the forces that the vehicle model expects, and
    /// the rollover indicators.
    pub fn of_stage(&self, stage: Stage) -> impl Iterator<Item = Result<Estimate>> {
        let of = |name: &str| format!("/{}/{name}", stage.name());
        let mut topics = vec![of("motion"), of("tyre_forces"), of("contact_forces")];
        if matches!(stage, Stage::Estimate | Stage::Model) {
            topics = vec![
                "/estimate/motion".to_owned(),
                "/estimate/tyre_forces".to_owned(),
                "/estimate/contact_forces".to_owned(),
                "/estimate/rollover".to_owned(),
                "/model/tyre_forces".to_owned(),
            ];
        }
        let messages = self.messages(Selection::topics(topics));
        estimates::joined(messages, stage)
    }
}

impl ChannelInfo {
    /// Whether the schema that its messages follow is not in the log.
    pub(crate) fn has_no_schema(&self) -> bool {
        self.schema_data.is_empty() && self.schema.contains('.')
    }

    /// Statement that the schema is not in the file at `path`.
    pub(crate) fn without_schema(&self, path: &Path) -> Missing {
        Missing::NoSchema {
            path: path.to_owned(),
            topic: self.topic.clone(),
            schema: self.schema.clone(),
        }
    }
}

impl LogFile {
    /// Adds the losses in the file beside the log to the counters, and describes them.
    fn unwritten(&self, counters: &mut BTreeMap<String, u64>) -> Option<Missing> {
        let beside = crate::recorder::read_losses(&self.path);
        let count = |name: &str| beside.get(name)?.parse().ok();
        let missing = Missing::Unwritten {
            path: self.path.clone(),
            arrivals: count("lost_arrivals").unwrap_or_default(),
            records: count("lost_records").unwrap_or_default(),
        };
        add_counters(counters, &beside);
        (!beside.is_empty()).then_some(missing)
    }
}

impl Message {
    /// The record of this message; `None` for raw batches, for positions that repeat others for viewers,
    /// and for messages of other programs.
    ///
    /// # Errors
    /// If the message does not follow its schema.
    pub fn record(&self) -> Result<Option<Record>> {
        messages::record(self.by_ref())
    }

    /// Named values of a message whose schema was made at run time (a DBC message, a controller).
    ///
    /// # Errors
    /// If the message does not follow its schema.
    pub fn signals(&self) -> Result<Vec<Signal>> {
        messages::signals(self.by_ref())
    }
}

fn add_counters(sums: &mut BTreeMap<String, u64>, counters: &BTreeMap<String, String>) {
    for (key, value) in counters {
        let Ok(value) = value.parse::<u64>() else {
            continue;
        };
        let sum = sums.entry(key.clone());
        match key.as_str() {
            "first_sequence" => sum.and_modify(|first| *first = value.min(*first)),
            "last_sequence" => sum.and_modify(|last| *last = value.max(*last)),
            _ => sum.and_modify(|sum| *sum = sum.saturating_add(value)),
        }
        .or_insert(value);
    }
}

pub(crate) fn unknown_estimate(time: LogTime) -> Estimate {
    Estimate {
        time,
        motion: Motion::default(),
        carrier: PerWheel([TyreForce::default(); 4]),
        measured: PerWheel([TyreForce::default(); 4]),
        expected: PerWheel([TyreForce::default(); 4]),
        rollover: Rollover::default(),
    }
}
