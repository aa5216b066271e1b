//! ASAM MDF 4 (`.mf4`): [`read`] gives the frames of files that log CAN buses, [`Tables`] the measured
//! signals of all files.
//!
//! Source: ASAM MDF 4.1 and its associated standard "Bus Logging". The reader reads sorted and
//! unsorted data, plain, listed and compressed data blocks (`DT`, `DL`, `HL`, `DZ`), values of their
//! own length in groups and in `SD` blocks, and files that their writer did not finish, whose counters
//! and last length are not valid. It reads records part by part; its memory is bounded by the largest
//! compressed block and by a window of frames that are sorted by time.
//!
//! The crate `mdf4-rs` 0.3.3, the newest for the toolchain of the project, is not used. It does not
//! read compressed blocks, does not give the parts of `CAN_DataFrame`, loses frames of unfinished
//! files with several groups, keeps the whole file and all values in memory, and panics on damaged
//! files.

mod block;
mod bus;
mod channel;
mod conversion;
mod data;
mod formula;
mod layout;
mod source;
mod table;
mod text;
mod values;

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use std::io::{Read, Seek};
use std::ops::ControlFlow;

use super::bytes::{u16_at, u64_at};
use super::defects::Defects;
use super::{Error, Record, Sink, Summary};
pub use conversion::Physical;
pub use table::{Column, RowSink, Table, Tables, Value};

use block::File;
use layout::DataGroup;
use source::{Context, Ready, Source};

/// Frames that wait to be sorted by time. Groups of a file are sorted in themselves; records of
/// several groups that share data blocks are nearly so.
const WINDOW: usize = 16 * 1024;
/// Flag of an unfinished file: offsets of values in groups of their own are not valid.
const NO_OFFSETS: u16 = 1 << 6;
/// Place of the header block.
const HEADER_PLACE: u64 = 64;
/// Names of signals in an error.
const NAMES_MAX: usize = 5;

/// Reads a file. The frames of all groups come sorted by time; frames of the same time come in the
/// order of their groups, and of their records. The stamps are ns since the start of the measurement.
/// The summary has the start as UTC, or as local time if the file states it as local time only.
///
/// # Errors
/// The file cannot be read; it is no MDF file, or an MDF 3 file; its header block is damaged; it has
/// measured signals only. Every other defect is counted in the summary.
pub fn read(input: &mut (impl Read + Seek), sink: &mut Sink<'_>) -> Result<Summary, Error> {
    let mut file = File::new(input)?;
    let mut defects = Defects::default();
    let mut summary = Summary::default();
    let (data_groups, start_ns) = open(&mut file, &mut defects)?;
    summary.start_ns = start_ns;
    let names = names(&data_groups);
    let mut sources = Vec::new();
    let mut order = 0;
    for data_group in data_groups {
        let count = data_group.groups.len();
        count_other(&data_group, file.unfinished, &mut summary.left_out);
        sources.extend(Source::new(data_group, order, file.unfinished));
        order += count;
    }
    if sources.is_empty() {
        return Err(Error::OnlySignals { signals: names });
    }
    let mut merge = Merge {
        file,
        sources,
        defects,
        summary,
    };
    // `Break`: the sink wants no more frames.
    let _ = merge.run(sink)?;
    Ok(merge.summary.with(merge.defects))
}

/// Checks the identification and reads the header: data groups and start time.
fn open<R: Read + Seek>(
    file: &mut File<'_, R>,
    defects: &mut Defects,
) -> Result<(Vec<DataGroup>, Option<i64>), Error> {
    let start = file.read_at(0, HEADER_PLACE)?;
    file.unfinished = start.starts_with(b"UnFinMF ");
    file.by_order = file.unfinished && u16_at(&start, 60) & NO_OFFSETS != 0;
    if !file.unfinished && !start.starts_with(b"MDF     ") {
        return Err(Error::other_format("an MDF 4 file", &start));
    }
    let version = u16_at(&start, 28);
    if !(400..500).contains(&version) {
        return Err(Error::OtherVersion {
            expected: "MDF 4",
            found: format!(
                "an MDF file of version {}.{:02}",
                version / 100,
                version % 100
            ),
            advice: "convert it to MDF 4 with the program that wrote it, or with asammdf",
        });
    }
    let Some(header) = file.block(HEADER_PLACE, *b"HD")? else {
        return Err(Error::Damaged {
            what: "the header block",
            place: HEADER_PLACE,
        });
    };
    let data_groups = layout::read(file, defects, header.link(0))?;
    let start_ns = i64::try_from(u64_at(&header.data, 0)).ok();
    Ok((data_groups, start_ns.filter(|start| *start != 0)))
}

/// Number of the signals and the names of the first ones.
fn names(data_groups: &[DataGroup]) -> String {
    let groups = data_groups.iter().flat_map(|data_group| &data_group.groups);
    let channels = groups.flat_map(|group| &group.channels);
    let is_signal = |channel: &&channel::Channel| channel.kind != channel::Kind::Master;
    let names: Vec<_> = channels
        .filter(is_signal)
        .map(|channel| channel.name.as_str())
        .collect();
    let more = if names.len() > NAMES_MAX { " …" } else { "" };
    let first = &names[..names.len().min(NAMES_MAX)];
    format!("{} ({}{more})", names.len(), first.join(", "))
}

/// Counts the records of data groups without frames, which are not read.
fn count_other(data_group: &DataGroup, unfinished: bool, left_out: &mut BTreeMap<String, u64>) {
    let is_frames = |group: &layout::Group| bus::FrameGroup::of(group).is_some();
    if unfinished || data_group.groups.iter().any(is_frames) {
        return;
    }
    for group in data_group.groups.iter().filter(|group| group.records > 0) {
        if !group.variable_length {
            let name = group.name.as_deref().unwrap_or("a group without name");
            *left_out.entry(format!("records of {name}")).or_default() += group.records;
        }
    }
}

/// The sources, merged by time.
struct Merge<'r, R> {
    file: File<'r, R>,
    sources: Vec<Source>,
    defects: Defects,
    summary: Summary,
}

/// A frame that waits. The order is that of the keys.
struct Waiting(Ready);

impl PartialEq for Waiting {
    fn eq(&self, other: &Self) -> bool {
        self.0.key == other.0.key
    }
}

impl Eq for Waiting {}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.key.cmp(&other.0.key)
    }
}

impl<R: Read + Seek> Merge<'_, R> {
    fn next(&mut self, source: usize) -> Result<Option<Ready>, Error> {
        self.sources[source].next(&mut Context {
            file: &mut self.file,
            defects: &mut self.defects,
            left_out: &mut self.summary.left_out,
        })
    }

    fn run(&mut self, sink: &mut Sink<'_>) -> Result<ControlFlow<()>, Error> {
        let mut heads = BinaryHeap::new();
        let mut next = Vec::new();
        for source in 0..self.sources.len() {
            let head = self.next(source)?;
            if let Some(ready) = &head {
                heads.push(Reverse((ready.key, source)));
            }
            next.push(head);
        }
        let mut window = BinaryHeap::new();
        while let Some(Reverse((_, source))) = heads.pop() {
            window.extend(next[source].take().map(|ready| Reverse(Waiting(ready))));
            next[source] = self.next(source)?;
            heads.extend(
                next[source]
                    .as_ref()
                    .map(|ready| Reverse((ready.key, source))),
            );
            if window.len() > WINDOW && self.give(window.pop(), sink).is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        while let Some(waiting) = window.pop() {
            if self.give(Some(waiting), sink).is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    fn give(&mut self, waiting: Option<Reverse<Waiting>>, sink: &mut Sink<'_>) -> ControlFlow<()> {
        let Some(Reverse(Waiting(mut ready))) = waiting else {
            return ControlFlow::Continue(());
        };
        self.summary.frames += 1;
        ready.entry.channel = ready.bus.and_then(|bus| self.summary.channel(&bus));
        sink(Record::Frame(ready.entry))
    }
}
