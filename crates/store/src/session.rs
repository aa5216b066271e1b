use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use sample::{LogTime, Measurement, Sample, SourceId};

use crate::{DynamicMessage, Record, UtcOffset};

/// Description of a run, which every file of the run contains.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Session {
    /// Names the run; the same in all its files.
    pub run_id: String,
    /// Log clock at the start of the run.
    pub started: LogTime,
    /// Version of the recorder.
    pub version: String,
    /// Commit that it was built from.
    pub git_hash: String,
    /// The kernel's boot id; empty in simulations.
    pub boot_id: String,
    /// Name of the host; empty in simulations.
    pub host: String,
    /// Number of the run in its log folder, which rises from run to run; `None` outside of a log
    /// folder and in logs of older versions.
    pub run_number: Option<u64>,
    /// State of the host's clock when the log clock was set to it.
    pub clock: ClockState,
    /// The recorder gives no estimate while no source has delivered anything for longer than this,
    /// ns; 0 in logs of versions that always gave estimates.
    pub silence_ns: u64,
    /// All sources of the resolved configuration.
    pub sources: Vec<Source>,
    /// Messages of the DBC files, so that their channels carry all signals from the first frame on.
    pub dynamic: Vec<DynamicMessage>,
    /// Configuration, vehicle, calibration and DBC files.
    pub attachments: Vec<Attachment>,
    /// Faults of sensors that a simulation injected; `None` if the log is not of a simulation, or of
    /// an older version.
    pub injected_faults: Option<Vec<InjectedFault>>,
    /// The run that this log is a stretch of; `None` for a log that was recorded or computed as a whole.
    pub origin: Option<Origin>,
}

/// The run that a log is a stretch of.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Origin {
    /// Its name.
    pub run_id: String,
    /// Log clock from which on the log has the data of the run.
    pub from: LogTime,
    /// Log clock up to which the log has the data of the run.
    pub to: LogTime,
    /// Whether the run has data before `from`, on which the estimates of the log depend.
    pub is_continued: bool,
    /// Counters of the run: its data and its losses.
    pub counters: BTreeMap<String, u64>,
}

impl Origin {
    /// Keys of the metadata that opens a file.
    fn put(&self, map: &mut BTreeMap<String, String>) {
        let counters = self.counters.iter();
        map.extend(
            counters.map(|(name, value)| (format!("{ORIGIN_COUNTER}{name}"), value.to_string())),
        );
        map.extend([
            ("origin.run_id".to_owned(), self.run_id.clone()),
            ("origin.from_ns".to_owned(), self.from.0.to_string()),
            ("origin.to_ns".to_owned(), self.to.0.to_string()),
            ("continued".to_owned(), self.is_continued.to_string()),
        ]);
    }

    fn of(map: &BTreeMap<String, String>) -> Option<Self> {
        let time = |key: &str| map.get(key)?.parse().ok().map(LogTime);
        let counters = map.iter().filter_map(|(key, value)| {
            let name = key.strip_prefix(ORIGIN_COUNTER)?;
            Some((name.to_owned(), value.parse().ok()?))
        });
        Some(Self {
            run_id: map.get("origin.run_id")?.clone(),
            from: time("origin.from_ns")?,
            to: time("origin.to_ns")?,
            is_continued: map.get("continued").is_some_and(|value| value == "true"),
            counters: counters.collect(),
        })
    }
}

/// A fault of a sensor that a simulation injected.
#[derive(Clone, Debug, PartialEq)]
pub struct InjectedFault {
    /// How the names of its channels begin in events, such as `FL lower_front` or `inertial unit`.
    pub sensor: String,
    /// When it begins, s from the start of the run.
    pub from_s: f64,
    /// When it ends, s.
    pub to_s: f64,
}

impl InjectedFault {
    /// Its value in the metadata: begin, end, sensor.
    fn to_text(&self) -> String {
        format!("{} {} {}", self.from_s, self.to_s, self.sensor)
    }

    fn from_text(text: &str) -> Option<Self> {
        let mut parts = text.splitn(3, ' ');
        Some(Self {
            from_s: parts.next()?.parse().ok()?,
            to_s: parts.next()?.parse().ok()?,
            sensor: parts.next()?.to_owned(),
        })
    }
}

/// State of the host's clock when the log clock was set to it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ClockState {
    /// Not known: a simulation, a log of an older version, or a kernel without this information.
    #[default]
    Unknown,
    /// Synchronised to a reference, by the kernel.
    Synchronised,
    /// Not synchronised, by the kernel.
    Unsynchronised,
    /// Before the date of the recorder's build: no battery, or never set.
    BeforeBuild,
}

impl ClockState {
    const ALL: [Self; 4] = [
        Self::Unknown,
        Self::Synchronised,
        Self::Unsynchronised,
        Self::BeforeBuild,
    ];

    /// Lower-case name, as in the log's metadata.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Unknown => "unknown",
            Self::Synchronised => "synchronised",
            Self::Unsynchronised => "unsynchronised",
            Self::BeforeBuild => "before_build",
        }
    }

    /// Whether the date of the log clock may be wrong.
    #[must_use]
    pub const fn is_implausible(self) -> bool {
        matches!(self, Self::Unsynchronised | Self::BeforeBuild)
    }

    fn from_name(name: &str) -> Self {
        let found = Self::ALL.into_iter().find(|state| state.name() == name);
        found.unwrap_or_default()
    }
}

/// One source of the configuration.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Source {
    /// Its position.
    pub id: SourceId,
    /// Its name; a part of topics.
    pub name: String,
    /// What it delivers.
    pub kind: SourceKind,
}

/// What a source delivers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SourceKind {
    /// Bytes of a serial port.
    Serial,
    /// Frames of a CAN bus.
    Can,
    /// The recorder itself: ticks and notices.
    Recorder,
}

impl SourceKind {
    /// Lower-case name, as in the log's metadata.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Serial => "serial",
            Self::Can => "can",
            Self::Recorder => "recorder",
        }
    }

    fn from_name(name: &str) -> Option<Self> {
        [Self::Serial, Self::Can, Self::Recorder]
            .into_iter()
            .find(|kind| kind.name() == name)
    }
}

/// A file carried inside the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Attachment {
    /// File name.
    pub name: String,
    /// Media type, such as `application/toml`.
    pub media_type: String,
    /// Contents.
    pub data: Vec<u8>,
}

/// How a log is written.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// A chunk of raw data is closed after this time on the log clock. Longer means fewer indexes
    /// and better compression.
    pub raw_interval: Duration,
    /// Raw data goes into a journal beside the log after at most this time, so that a kill costs no
    /// more; `None` for no journal (recorder only).
    pub journal_interval: Option<Duration>,
    /// Decoded records, which can be made again from the raw data, go into the log after at most
    /// this time.
    pub decoded_interval: Duration,
    /// A chunk of decoded records ends when it is larger than this, whatever its age.
    pub decoded_chunk_bytes: usize,
    /// zstd level; 0 is level 1 for the decoded messages of sensors, and zstd's own default for the rest.
    /// `None` writes chunks without compression.
    pub compression_level: Option<u32>,
    /// The file is synced to the disk this often (recorder only).
    pub sync_interval: Duration,
    /// A new file begins after this time on the log clock (recorder only).
    pub rotate_after: Option<Duration>,
    /// A new file begins when this many bytes are written (recorder only).
    pub rotate_bytes: Option<u64>,
    /// Arrivals and records that may wait for the writer (recorder only).
    pub queue_capacity: usize,
    /// Arrivals and records that are kept while the disk rejects them; more count as lost (recorder
    /// only).
    pub backlog_capacity: usize,
    /// A disk that failed is tried again this often (recorder only).
    pub retry_interval: Duration,
    /// Longest time to close the last file; data that is not written by then is counted as lost
    /// (recorder only).
    pub stop_within: Duration,
    /// Names of the decoded CAN messages of each source that are not written.
    pub left_out: BTreeMap<SourceId, BTreeSet<String>>,
}

impl Options {
    /// Whether the record is a decoded CAN message that is not written.
    pub(crate) fn leaves_out(&self, record: &Record) -> bool {
        match record {
            Record::Sample(Sample {
                source,
                measurement: Measurement::Signals(frame),
                ..
            }) => (self.left_out.get(source)).is_some_and(|names| names.contains(&*frame.message)),
            _ => false,
        }
    }
}

impl Default for Options {
    fn default() -> Self {
        Self {
            raw_interval: Duration::from_secs(1),
            journal_interval: Some(Duration::from_millis(50)),
            decoded_interval: Duration::from_secs(1),
            decoded_chunk_bytes: 1 << 20,
            compression_level: Some(0),
            sync_interval: Duration::from_millis(500),
            rotate_after: Some(Duration::from_secs(600)),
            rotate_bytes: Some(1 << 30),
            queue_capacity: 1 << 16,
            backlog_capacity: 1 << 17,
            retry_interval: Duration::from_secs(1),
            stop_within: Duration::from_secs(20),
            left_out: BTreeMap::new(),
        }
    }
}

/// Version of the log's contract (docs/log.md) that is written. The layout before it has none.
pub(crate) const CONTRACT: u32 = 0;
/// A topic that is kept for states of the estimator. Nothing writes it yet.
pub(crate) const RESERVED_TOPIC: &str = "/checkpoint";
/// How the keys with the counters of the run begin that a log is a stretch of.
const ORIGIN_COUNTER: &str = "origin.counter.";
/// Name of the metadata record that opens each file.
pub(crate) const RUN_METADATA: &str = "atvrec.run";
/// Name of the metadata record with the last offset of UTC.
pub(crate) const UTC_METADATA: &str = "atvrec.utc_offset";
/// Name of the metadata record that closes each file.
pub(crate) const COUNTERS_METADATA: &str = "atvrec.counters";

impl Session {
    /// Name of a source, for topics.
    #[must_use]
    pub fn source_name(&self, id: SourceId) -> String {
        self.sources
            .iter()
            .find(|source| source.id == id)
            .map_or_else(|| format!("source{}", id.0), |source| source.name.clone())
    }

    /// What is known of the log clock's date, in words; `None` if nothing is.
    #[must_use]
    pub fn clock_statement(&self, utc: Option<UtcOffset>) -> Option<String> {
        let state = match self.clock {
            ClockState::Unsynchronised => Some("not synchronised at the start"),
            ClockState::BeforeBuild => Some("not set at the start"),
            ClockState::Synchronised => Some("synchronised at the start"),
            ClockState::Unknown => None,
        };
        let by_receiver = utc.map(|utc| {
            format!(
                "UTC minus log clock is {:.3} s, standard deviation {:.3} s, by {}",
                utc.offset_ns as f64 * 1e-9,
                utc.sigma_s,
                self.source_name(utc.source)
            )
        });
        let is_doubtful = self.clock.is_implausible() && by_receiver.is_none();
        let doubt = is_doubtful.then(|| "the date may be wrong".to_owned());
        let parts = [state.map(str::to_owned), by_receiver, doubt];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        (!parts.is_empty()).then(|| parts.join("; "))
    }

    pub(crate) fn to_metadata(&self, part: u32) -> BTreeMap<String, String> {
        let mut map = BTreeMap::from([
            ("run_id".to_owned(), self.run_id.clone()),
            ("part".to_owned(), part.to_string()),
            ("contract".to_owned(), CONTRACT.to_string()),
            ("started_ns".to_owned(), self.started.0.to_string()),
            ("version".to_owned(), self.version.clone()),
            ("git_hash".to_owned(), self.git_hash.clone()),
            ("boot_id".to_owned(), self.boot_id.clone()),
            ("host".to_owned(), self.host.clone()),
            ("silence_ns".to_owned(), self.silence_ns.to_string()),
        ]);
        if let Some(number) = self.run_number {
            map.insert("run_number".to_owned(), number.to_string());
        }
        if self.clock != ClockState::Unknown {
            map.insert("clock".to_owned(), self.clock.name().to_owned());
        }
        if let Some(faults) = &self.injected_faults {
            map.insert("injected_faults".to_owned(), faults.len().to_string());
            for (i, fault) in faults.iter().enumerate() {
                map.insert(format!("injected_fault.{i:05}"), fault.to_text());
            }
        }
        if let Some(origin) = &self.origin {
            origin.put(&mut map);
        }
        for source in &self.sources {
            map.insert(
                format!("source.{:05}", source.id.0),
                format!("{} {}", source.kind.name(), source.name),
            );
        }
        map
    }

    /// The session that a file's metadata states; attachments and dynamic messages stay empty.
    pub(crate) fn from_metadata(map: &BTreeMap<String, String>) -> Self {
        let text = |key: &str| map.get(key).cloned().unwrap_or_default();
        let sources = map
            .iter()
            .filter_map(|(key, value)| {
                let id = key.strip_prefix("source.")?.parse().ok()?;
                let (kind, name) = value.split_once(' ')?;
                Some(Source {
                    id: SourceId(id),
                    name: name.to_owned(),
                    kind: SourceKind::from_name(kind)?,
                })
            })
            .collect();
        Self {
            run_id: text("run_id"),
            started: LogTime(text("started_ns").parse().unwrap_or_default()),
            version: text("version"),
            git_hash: text("git_hash"),
            boot_id: text("boot_id"),
            host: text("host"),
            run_number: text("run_number").parse().ok(),
            clock: ClockState::from_name(&text("clock")),
            silence_ns: text("silence_ns").parse().unwrap_or_default(),
            sources,
            dynamic: Vec::new(),
            attachments: Vec::new(),
            origin: Origin::of(map),
            injected_faults: map.contains_key("injected_faults").then(|| {
                let faults = map
                    .iter()
                    .filter(|(key, _)| key.starts_with("injected_fault."));
                faults
                    .filter_map(|(_, text)| InjectedFault::from_text(text))
                    .collect()
            }),
        }
    }
}

/// UTC of a log time, ns since 1970: by a receiver if one sent the date, otherwise by the log clock.
#[must_use]
pub fn utc_ns(time: LogTime, utc: Option<UtcOffset>) -> u64 {
    let by_receiver = utc.and_then(|utc| u64::try_from(utc.utc_ns(time)).ok());
    by_receiver.unwrap_or(time.0)
}

impl UtcOffset {
    /// The metadata record that closes a file. Keys: `time_ns` (log clock), `offset_ns`, `sigma_s`,
    /// `source` (position), `source_name`, `leap_seconds` (absent if not sent).
    pub(crate) fn to_metadata(self, session: &Session) -> BTreeMap<String, String> {
        let mut map = BTreeMap::from([
            ("time_ns".to_owned(), self.time.0.to_string()),
            ("offset_ns".to_owned(), self.offset_ns.to_string()),
            ("sigma_s".to_owned(), self.sigma_s.to_string()),
            ("source".to_owned(), self.source.0.to_string()),
            ("source_name".to_owned(), session.source_name(self.source)),
        ]);
        if let Some(seconds) = self.leap_seconds {
            map.insert("leap_seconds".to_owned(), seconds.to_string());
        }
        map
    }

    /// The offset that a metadata record states; `None` if it is incomplete.
    pub(crate) fn from_metadata(map: &BTreeMap<String, String>) -> Option<Self> {
        Some(Self {
            time: LogTime(map.get("time_ns")?.parse().ok()?),
            offset_ns: map.get("offset_ns")?.parse().ok()?,
            sigma_s: map.get("sigma_s")?.parse().ok()?,
            source: SourceId(map.get("source")?.parse().ok()?),
            leap_seconds: map.get("leap_seconds").and_then(|text| text.parse().ok()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metadata_keeps_run_number_clock_and_offset() {
        for clock in ClockState::ALL {
            let session = Session {
                run_number: Some(42),
                clock,
                injected_faults: Some(vec![InjectedFault {
                    sensor: "FL lower_front".to_owned(),
                    from_s: 5.5,
                    to_s: f64::INFINITY,
                }]),
                origin: Some(Origin {
                    run_id: "a-run".to_owned(),
                    from: LogTime(5),
                    to: LogTime(u64::MAX),
                    is_continued: true,
                    counters: BTreeMap::from([("arrivals".to_owned(), 12)]),
                }),
                ..Session::default()
            };
            assert_eq!(Session::from_metadata(&session.to_metadata(3)), session);
        }
        let offset = UtcOffset {
            time: LogTime(7),
            offset_ns: -86_400_000_000_123,
            sigma_s: 0.1,
            source: SourceId(3),
            leap_seconds: Some(18),
        };
        let map = offset.to_metadata(&Session::default());
        assert_eq!(UtcOffset::from_metadata(&map), Some(offset));
    }

    #[test]
    fn a_doubtful_date_is_stated_until_a_receiver_gives_one() {
        let session = Session {
            clock: ClockState::BeforeBuild,
            ..Session::default()
        };
        let text = session.clock_statement(None).expect("a statement");
        assert!(text.contains("may be wrong"), "{text}");
        assert_eq!(Session::default().clock_statement(None), None);
    }
}
