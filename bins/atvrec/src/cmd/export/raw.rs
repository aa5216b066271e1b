//! `atvrec export --raw`: what the sources sent.

use std::collections::BTreeMap;
use std::io::{BufWriter, Write};

use acq::SourceKind;
use engine::Config;
use engine::output::Target;
use sample::{Arrival, CanFrame, LogTime, LossPlace, Notice, Payload, SourceId};
use store::{Reader, SourceKind as Kind};
use wire::can_log::{Direction, asc, candump};

use crate::cli::RawFormat;
use crate::cmd::origin::Origin;
use crate::exit::UsageError;
use crate::interrupt::Interrupt;
use crate::output;
use crate::progress::Progress;

/// Arrivals between two looks at signals and at the progress.
const ARRIVALS_BETWEEN: u64 = 4096;
/// Bytes that are written at a time.
const BUFFER: usize = 1 << 16;

/// Raw data of a log.
pub struct Raw<'r> {
    reader: &'r Reader,
    format: RawFormat,
    interrupt: Interrupt,
    /// Sources that are exported.
    sources: BTreeMap<SourceId, Source>,
}

/// A source of raw data.
#[derive(Default)]
struct Source {
    /// Name of the channel.
    channel: String,
    /// Number of the channel, in formats with numbers.
    number: u32,
    origin: Origin,
    /// Frames that the kernel lost.
    lost: u64,
}

impl<'r> Raw<'r> {
    /// The raw data of these sources; of all sources of a fitting kind if none is named.
    pub fn new(reader: &'r Reader, format: RawFormat, names: &[String]) -> anyhow::Result<Self> {
        let kind = match format {
            RawFormat::Candump | RawFormat::Asc => Kind::Can,
            RawFormat::Bytes => Kind::Serial,
        };
        let session = reader.session();
        let fitting: Vec<&store::Source> = session
            .sources
            .iter()
            .filter(|source| source.kind == kind)
            .collect();
        let known: Vec<&str> = fitting.iter().map(|source| source.name.as_str()).collect();
        let wrong = |problem: String| {
            let (what, known) = match kind {
                Kind::Can => ("CAN frames", known.join(", ")),
                _ => ("bytes", known.join(", ")),
            };
            let known = if known.is_empty() { "none" } else { &known };
            anyhow::Error::from(UsageError(format!(
                "{problem}; sources of the log with {what}: {known}"
            )))
        };
        if let Some(name) = names.iter().find(|name| !known.contains(&name.as_str())) {
            return Err(wrong(format!(
                "--source {name}: the log has no such source"
            )));
        }
        if format == RawFormat::Bytes && names.len() != 1 {
            return Err(wrong(
                "--raw bytes needs one source, --source NAME".to_owned(),
            ));
        }
        let config = Config::from_attachments(&reader.attachments()?).ok();
        let is_given = |source: &&&store::Source| names.is_empty() || names.contains(&source.name);
        let chosen: Vec<&store::Source> = fitting.iter().filter(is_given).copied().collect();
        let numbers = numbers(&chosen);
        let sources = chosen.iter().zip(numbers).map(|(source, number)| {
            let found = Source {
                channel: interface(config.as_ref(), &source.name),
                number,
                ..Source::default()
            };
            (source.id, found)
        });
        let sources: BTreeMap<SourceId, Source> = sources.collect();
        if sources.is_empty() {
            return Err(wrong("the log has nothing to export".to_owned()));
        }
        Ok(Self {
            reader,
            format,
            interrupt: Interrupt::listen()?,
            sources,
        })
    }

    /// Writes the arrivals of a span to the target, or to standard output.
    pub fn write(
        mut self,
        target: Option<&Target>,
        span: [LogTime; 2],
        progress: &Progress,
    ) -> anyhow::Result<()> {
        let Some(target) = target else {
            let sink = std::io::stdout().lock();
            let result = self.write_to(sink, span, progress).map(|_| ());
            return result.or_else(|error| match error.downcast::<std::io::Error>() {
                Ok(cause) => Ok(output::ignore_closed_pipe(cause)?),
                Err(other) => Err(other),
            });
        };
        let mut count = 0;
        target.write_by(|file| {
            let result = self.write_to(file, span, progress);
            count = result.map_err(|error| match error.downcast::<std::io::Error>() {
                Ok(cause) => cause.into(),
                Err(other) => other.into_boxed_dyn_error(),
            })?;
            Ok(())
        })?;
        let what = match self.format {
            RawFormat::Bytes => "bytes",
            _ => "frames",
        };
        println!("{}: {count} {what}", target.path().display());
        Ok(())
    }

    /// Number of frames, or of bytes, that were written.
    fn write_to(
        &mut self,
        sink: impl Write,
        [start, end]: [LogTime; 2],
        progress: &Progress,
    ) -> anyhow::Result<u64> {
        let mut sink = BufWriter::with_capacity(BUFFER, sink);
        // The texts of the notices tell what the arrivals of the span mean.
        for notice in self.reader.notices() {
            let notice = notice?;
            if let Payload::Notice(Notice::Opened(text)) = &notice.payload
                && let Some(source) = self.sources.get_mut(&notice.source)
                && let Ok(origin) = text.parse::<Origin>()
            {
                source.open(origin);
            }
        }
        let mut text = Vec::new();
        let (mut count, mut arrivals) = (0, 0_u64);
        let mut zero_ns = None;
        let begin = self
            .reader
            .info()
            .span
            .map_or(start, |(first, _)| first.max(start));
        for arrival in self.reader.arrivals_between(start, end) {
            let arrival = arrival?;
            if arrivals.is_multiple_of(ARRIVALS_BETWEEN) {
                self.interrupt.check()?;
                progress.set(arrival.log_time.seconds_since(begin));
            }
            arrivals += 1;
            let Some(source) = self.sources.get_mut(&arrival.source) else {
                continue;
            };
            text.clear();
            count += match self.format {
                RawFormat::Candump => source.candump(&arrival, &mut text),
                RawFormat::Asc => source.asc(&arrival, &mut zero_ns, &mut text),
                RawFormat::Bytes => match &arrival.payload {
                    Payload::Bytes(bytes) => {
                        text.extend_from_slice(bytes);
                        bytes.len() as u64
                    }
                    _ => 0,
                },
            };
            sink.write_all(&text)?;
        }
        if self.format == RawFormat::Asc && zero_ns.is_some() {
            sink.write_all(asc::END.as_bytes())?;
        }
        sink.flush()?;
        progress.finish();
        Ok(count)
    }
}

impl Source {
    fn open(&mut self, origin: Origin) {
        if !origin.channel.is_empty() {
            self.channel.clone_from(&origin.channel);
        }
        self.origin = origin;
    }

    fn direction(&self, frame: &CanFrame) -> Option<Direction> {
        Some(match frame.flags.local_echo {
            true => Direction::Sent,
            false => Direction::Received,
        })
    }

    /// Appends the lines of candump; the number of frames.
    fn candump(&mut self, arrival: &Arrival, text: &mut Vec<u8>) -> u64 {
        let style = self.origin.style;
        match &arrival.payload {
            Payload::Can(frames) => {
                for frame in frames {
                    let stamp_ns = stamp_ns(arrival, frame).saturating_sub(self.origin.zero_ns);
                    let direction = self.direction(frame);
                    style.write(text, stamp_ns, &self.channel, frame, direction);
                }
                frames.len() as u64
            }
            Payload::Notice(Notice::Lost {
                place: LossPlace::Kernel,
                count,
            }) => {
                self.lost += count;
                candump::write_loss(text, &style, &self.channel, *count, self.lost);
                0
            }
            _ => 0,
        }
    }

    /// Appends the lines of ASC, before the first ones the head; the number of frames. `zero_ns` is the
    /// time of the head.
    fn asc(&self, arrival: &Arrival, zero_ns: &mut Option<i64>, text: &mut Vec<u8>) -> u64 {
        let Payload::Can(frames) = &arrival.payload else {
            return 0;
        };
        for frame in frames {
            let stamp_ns = stamp_ns(arrival, frame);
            let zero_ns = *zero_ns.get_or_insert_with(|| {
                let zero_ns = match self.origin.zero_ns {
                    // The date in the head has milliseconds.
                    0 => stamp_ns - stamp_ns.rem_euclid(1_000_000),
                    zero_ns => zero_ns,
                };
                asc::write_head(text, zero_ns);
                zero_ns
            });
            let direction = self.direction(frame);
            asc::write_frame(text, stamp_ns - zero_ns, self.number, frame, direction);
        }
        frames.len() as u64
    }
}

/// UNIX time of a frame, ns: of the kernel, or of the arrival.
fn stamp_ns(arrival: &Arrival, frame: &CanFrame) -> i64 {
    frame.kernel_ns.unwrap_or(arrival.realtime_ns)
}

/// Numbers of the channels in formats with numbers: those of the names `can1`, `can2` and so on, or
/// from 1 on in the order of the sources.
fn numbers(sources: &[&store::Source]) -> Vec<u32> {
    let number = |source: &&store::Source| -> Option<u32> {
        let digits = source.name.strip_prefix("can")?;
        digits.parse().ok().filter(|number| *number > 0)
    };
    let named: Option<Vec<u32>> = sources.iter().map(number).collect();
    named.unwrap_or_else(|| (1..).take(sources.len()).collect())
}

/// Name of the interface of a source.
fn interface(config: Option<&Config>, name: &str) -> String {
    let mut sources = config.iter().flat_map(|config| &config.sources);
    let found = sources.find(|source| source.spec.name == name);
    match found.map(|source| &source.spec.kind) {
        Some(SourceKind::Can(can)) => can.interface.clone(),
        _ => name.to_owned(),
    }
}
