//! What a log of CAN frames contains.

use std::collections::HashSet;
use std::fs::File;
use std::io::{BufReader, Read};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use anyhow::Context;
use wire::can_log::{self, Direction, Entry, Error, Format, HEAD_BYTES, Record, Stamps, Summary};
use wire::gps_time::Utc;

use crate::exit::UsageError;
use crate::interrupt::Interrupt;

/// Most identifiers of a channel that are kept.
const IDENTIFIERS_MAX: usize = 1 << 16;
/// Frames between two looks at signals.
const FRAMES_BETWEEN: u64 = 1 << 14;

/// Contents of a file.
pub struct Survey {
    pub path: PathBuf,
    pub format: Format,
    pub summary: Summary,
    /// What each channel has, in the order of the summary; what has no channel is the last.
    pub channels: Vec<Channel>,
    /// First stamp, and range of the stamps, ns from time zero.
    pub first_ns: i64,
    pub least_ns: i64,
    pub greatest_ns: i64,
    /// Stamps that are below the greatest one before them.
    backwards: u64,
    /// Frames that were lost, as the file says.
    lost: u64,
}

/// Contents of a channel.
#[derive(Clone, Default)]
pub struct Channel {
    pub frames: u64,
    error: u64,
    remote: u64,
    fd: u64,
    extended: u64,
    sent: u64,
    requests: u64,
    directions: u64,
    /// Identifiers of data frames, and whether they have 29 bits.
    pub identifiers: HashSet<(u32, bool)>,
}

/// Reads a file for what it contains.
///
/// # Errors
/// The file cannot be read, is of another format, or has no frame.
pub fn survey(format: Format, path: &Path, interrupt: &Interrupt) -> anyhow::Result<Survey> {
    check_format(format, path)?;
    let mut survey = Survey {
        path: path.to_owned(),
        format,
        summary: Summary::default(),
        channels: Vec::new(),
        first_ns: 0,
        least_ns: 0,
        greatest_ns: 0,
        backwards: 0,
        lost: 0,
    };
    let mut frames = 0;
    let mut unnamed = Channel::default();
    let mut stopped = Ok(());
    survey.summary = read(format, path, &mut |record| {
        frames += 1;
        if frames % FRAMES_BETWEEN == 0 {
            stopped = interrupt.check();
        }
        match record {
            Record::Frame(entry) => survey.take(&entry, &mut unnamed),
            Record::Lost { count, .. } => survey.lost += count,
        }
        match stopped {
            Ok(()) => ControlFlow::Continue(()),
            Err(_) => ControlFlow::Break(()),
        }
    })?;
    stopped?;
    survey
        .channels
        .resize_with(survey.summary.channels.len(), Channel::default);
    survey.channels.push(unnamed);
    if survey.summary.frames == 0 {
        let left_out = survey.summary.left_out.iter();
        let kinds: Vec<String> = left_out.map(|(kind, n)| format!("{n} {kind}")).collect();
        let kinds = match kinds.is_empty() {
            true => String::new(),
            false => format!(" (it has {})", kinds.join(", ")),
        };
        let text = format!(
            "{} has no CAN frame{kinds}; nothing was written",
            path.display()
        );
        return Err(UsageError(text).into());
    }
    Ok(survey)
}

/// Reads a file of this format for its contents.
fn read(format: Format, path: &Path, sink: &mut can_log::Sink<'_>) -> anyhow::Result<Summary> {
    told(path, |file| can_log::read(format, file, sink))
}

/// Reads the frames of a file again.
pub fn read_frames(
    format: Format,
    path: &Path,
    sink: &mut can_log::Sink<'_>,
) -> anyhow::Result<()> {
    told(path, |file| can_log::read_frames(format, file, sink)).map(drop)
}

fn told(
    path: &Path,
    read: impl FnOnce(&mut BufReader<File>) -> Result<Summary, Error>,
) -> anyhow::Result<Summary> {
    let shown = path.display();
    let file = File::open(path).with_context(|| format!("cannot read {shown}"))?;
    read(&mut BufReader::new(file)).map_err(|error| {
        let help = match error {
            Error::OnlySignals { .. } => "; import them with a column map: --columns MAP.toml",
            _ => "",
        };
        UsageError(format!("{shown}: {error}{help}")).into()
    })
}

/// Refuses a file whose first bytes are of another format.
fn check_format(format: Format, path: &Path) -> anyhow::Result<()> {
    let shown = path.display();
    if std::fs::metadata(path).is_ok_and(|file| !file.is_file()) {
        let text = format!(
            "{shown} is no regular file, but an import reads its input twice; save it to a file"
        );
        return Err(UsageError(text).into());
    }
    let mut head = Vec::new();
    File::open(path)
        .and_then(|file| file.take(HEAD_BYTES as u64).read_to_end(&mut head))
        .with_context(|| format!("cannot read {shown}"))?;
    let name = format.name();
    let text = match can_log::recognise(&head) {
        Some(found) if found == format => return Ok(()),
        _ if head.iter().all(u8::is_ascii_whitespace) => {
            format!("{shown} is empty; give {name}")
        }
        Some(Format::Other(found, help)) => format!("{shown} is {found}, not {name}; {help}"),
        Some(found) => {
            let command = command_of(found);
            let found = found.name();
            format!("{shown} is {found}, not {name}; use `atvrec import {command}`")
        }
        None => format!("{shown} is not {name}: no line or header of that format is in it"),
    };
    Err(UsageError(text).into())
}

const fn command_of(format: Format) -> &'static str {
    match format {
        Format::Asc => "asc",
        Format::Trc => "trc",
        Format::Blf => "blf",
        Format::Mf4 => "mf4",
        _ => "candump",
    }
}

impl Survey {
    fn take(&mut self, entry: &Entry, unnamed: &mut Channel) {
        let is_first = self.channels.is_empty() && unnamed.frames == 0;
        if is_first {
            self.first_ns = entry.stamp_ns;
            self.least_ns = entry.stamp_ns;
            self.greatest_ns = entry.stamp_ns;
        }
        self.backwards += u64::from(entry.stamp_ns < self.greatest_ns);
        self.least_ns = self.least_ns.min(entry.stamp_ns);
        self.greatest_ns = self.greatest_ns.max(entry.stamp_ns);
        let channel = match entry.channel.map(usize::from) {
            Some(channel) => {
                if channel >= self.channels.len() {
                    self.channels.resize_with(channel + 1, Channel::default);
                }
                &mut self.channels[channel]
            }
            None => unnamed,
        };
        channel.take(entry);
    }

    /// UNIX time of time zero, ns, if the file tells it.
    pub fn zero_ns(&self) -> Option<i64> {
        match self.summary.stamps {
            Stamps::Unix | Stamps::LocalDate => Some(0),
            _ => self.summary.start_ns,
        }
    }

    /// Whether the file tells the direction of frames.
    pub fn has_direction(&self) -> bool {
        self.channels.iter().any(|channel| channel.directions > 0)
    }

    /// Prints what the file contains.
    pub fn print(&self, zero_ns: i64) {
        let (path, summary) = (self.path.display(), &self.summary);
        let frames = summary.frames;
        let span_s = self.greatest_ns.saturating_sub(self.least_ns) as f64 * 1e-9;
        println!(
            "{path}: {}, {frames} frames in {span_s:.3} s",
            self.format.name()
        );
        let start = date(zero_ns);
        let clock = match (summary.stamps, summary.start_ns) {
            (Stamps::Unix, _) => "UNIX time".to_owned(),
            (Stamps::LocalDate, _) => {
                "date and time of the writer's computer, without a zone; they are taken as UTC"
                    .to_owned()
            }
            (stamps, start_ns) => {
                let meaning = match stamps {
                    Stamps::Differences => {
                        "the times since the record before (relative), which are summed"
                    }
                    Stamps::OfDay => "times of day",
                    _ => "times since the start of the measurement (absolute)",
                };
                let source = match start_ns {
                    Some(_) => "by the clock of the writer's computer",
                    None => "because the file has no start",
                };
                format!("{meaning}; time zero is {start} UTC, {source}")
            }
        };
        println!("{path}: its stamps are {clock}");
        for (kind, count) in &summary.left_out {
            println!("{path}: left out: {count} {kind}");
        }
        if self.lost > 0 {
            let lost = self.lost;
            println!("{path}: it reports that {lost} frames were lost when it was recorded");
        }
        if self.backwards > 0 {
            let count = self.backwards;
            println!(
                "{path}: {count} frames have stamps before that of an earlier frame; the frames keep the order \
                 of the file and their stamps"
            );
        }
        if summary.restyled > 0 {
            let count = summary.restyled;
            println!("{path}: {count} lines have another form than `export --raw candump` writes");
        }
        self.warn();
    }

    fn warn(&self) {
        let path = self.path.display();
        for defect in &self.summary.defects {
            tracing::warn!("{path}: {defect}");
        }
        let more = self.summary.defect_count - self.summary.defects.len() as u64;
        if more > 0 {
            tracing::warn!("{path}: and {more} more defects");
        }
    }
}

/// A UNIX time as date and time.
fn date(unix_ns: i64) -> String {
    let seconds = u64::try_from(unix_ns.div_euclid(1_000_000_000)).unwrap_or(0);
    let utc = Utc::of_unix_s(seconds);
    let millis = unix_ns.rem_euclid(1_000_000_000) / 1_000_000;
    format!(
        "{:04}-{:02}-{:02} {:02}:{:02}:{:02}.{millis:03}",
        utc.year, utc.month, utc.day, utc.hour, utc.minute, utc.second
    )
}

impl Channel {
    fn take(&mut self, entry: &Entry) {
        let frame = &entry.frame;
        let flags = frame.flags;
        self.frames += 1;
        self.error += u64::from(flags.error);
        self.remote += u64::from(flags.remote);
        self.fd += u64::from(flags.fd);
        self.extended += u64::from(flags.extended);
        self.directions += u64::from(entry.direction.is_some());
        self.sent += u64::from(entry.direction == Some(Direction::Sent));
        self.requests += u64::from(entry.direction == Some(Direction::SendRequest));
        let is_data = !flags.error && !flags.remote;
        if is_data && self.identifiers.len() < IDENTIFIERS_MAX {
            self.identifiers.insert((frame.id, flags.extended));
        }
    }

    /// Adds the counts of a channel of the same bus.
    pub fn add(&mut self, other: &Self) {
        self.frames += other.frames;
        self.error += other.error;
        self.remote += other.remote;
        self.fd += other.fd;
        self.extended += other.extended;
        self.sent += other.sent;
        self.requests += other.requests;
        self.directions += other.directions;
        self.identifiers.extend(&other.identifiers);
    }

    /// Numbers of frames in words.
    pub fn words(&self) -> String {
        let kinds = [
            (self.extended, "with 29-bit identifiers"),
            (self.fd, "of CAN FD"),
            (self.remote, "remote frames"),
            (self.error, "error frames"),
            (self.sent, "sent by the logger"),
            (self.requests, "requests to send"),
        ];
        let kinds: Vec<String> = kinds
            .iter()
            .filter(|(count, _)| *count > 0)
            .map(|(count, kind)| format!("{count} {kind}"))
            .collect();
        let identifiers = self.identifiers.len();
        let kinds = match kinds.is_empty() {
            true => String::new(),
            false => format!("; {}", kinds.join(", ")),
        };
        format!("{} frames of {identifiers} identifiers{kinds}", self.frames)
    }
}
