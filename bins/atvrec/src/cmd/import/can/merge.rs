//! The records of several logs of CAN frames in the order of time.

use std::iter::Peekable;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{self, ScopedJoinHandle};
use std::vec::IntoIter;

use sample::{CanFrame, LogTime};
use wire::can_log::{Format, Record};

use super::super::log_time;
use super::frame_of;
use super::survey::read_frames;
use crate::exit::UsageError;

/// Records that a reader passes at a time.
const BATCH: usize = 1024;
/// Batches that wait.
const WAITING: usize = 8;

/// A file that is read.
pub struct Input<'s> {
    pub format: Format,
    pub path: &'s Path,
    /// UNIX time of time zero, ns.
    pub zero_ns: i64,
    /// First stamp, ns from time zero.
    pub first_ns: i64,
    /// Bus of each channel.
    pub buses: Vec<usize>,
    /// Bus of frames without channel.
    pub unnamed: usize,
}

impl Input<'_> {
    /// Time of a stamp.
    pub fn time(&self, stamp_ns: i64) -> LogTime {
        // The survey has checked the range of the stamps.
        log_time(i128::from(self.zero_ns) + i128::from(stamp_ns)).unwrap_or(LogTime(0))
    }
}

/// A record with its time and its bus.
pub struct Item {
    pub time: LogTime,
    pub bus: usize,
    pub content: Content,
}

/// Content of a record.
#[allow(clippy::large_enum_variant, reason = "nearly all records are frames")]
pub enum Content {
    Frame(CanFrame),
    /// Frames were lost.
    Lost(u64),
}

/// Calls `take` with the records of all files in the order of time. Records of a file keep their order:
/// a record with an earlier stamp has the time of the record before it.
pub fn merge(
    inputs: Vec<Input<'_>>,
    mut take: impl FnMut(Item) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    thread::scope(|scope| {
        let mut feeds: Vec<Feed<'_>> = inputs
            .into_iter()
            .map(|input| {
                let (sender, receiver) = sync_channel(WAITING);
                Feed {
                    receiver,
                    batch: Vec::new().into_iter().peekable(),
                    reader: Some(scope.spawn(move || read_file(&input, &sender))),
                }
            })
            .collect();
        loop {
            let mut next: Option<(LogTime, usize)> = None;
            for (at, feed) in feeds.iter_mut().enumerate() {
                if let Some(time) = feed.next_time()?
                    && next.is_none_or(|(earliest, _)| time < earliest)
                {
                    next = Some((time, at));
                }
            }
            let Some((_, at)) = next else { return Ok(()) };
            if let Some(item) = feeds[at].batch.next() {
                take(item)?;
            }
        }
    })
}

/// A file that a thread reads.
struct Feed<'s> {
    receiver: Receiver<Vec<Item>>,
    batch: Peekable<IntoIter<Item>>,
    reader: Option<ScopedJoinHandle<'s, anyhow::Result<()>>>,
}

impl Feed<'_> {
    /// Time of the next record; `None` at the end.
    fn next_time(&mut self) -> anyhow::Result<Option<LogTime>> {
        while self.batch.peek().is_none() {
            match self.receiver.recv() {
                Ok(batch) => self.batch = batch.into_iter().peekable(),
                Err(_) => return self.finish().map(|()| None),
            }
        }
        Ok(self.batch.peek().map(|item| item.time))
    }

    /// The result of the reader, once.
    fn finish(&mut self) -> anyhow::Result<()> {
        match self.reader.take().map(ScopedJoinHandle::join) {
            None => Ok(()),
            Some(Ok(result)) => result,
            Some(Err(panic)) => std::panic::resume_unwind(panic),
        }
    }
}

fn read_file(input: &Input<'_>, sender: &SyncSender<Vec<Item>>) -> anyhow::Result<()> {
    let mut batch = Vec::with_capacity(BATCH);
    let mut last = input.time(input.first_ns);
    let mut is_known = true;
    read_frames(input.format, input.path, &mut |record| {
        let (channel, content) = match record {
            Record::Frame(entry) => {
                let stamp_ns = input.zero_ns.saturating_add(entry.stamp_ns);
                last = last.max(input.time(entry.stamp_ns));
                (entry.channel, Content::Frame(frame_of(&entry, stamp_ns)))
            }
            Record::Lost { channel, count } => (channel, Content::Lost(count)),
        };
        let bus = match channel {
            None => Some(input.unnamed),
            Some(channel) => input.buses.get(usize::from(channel)).copied(),
        };
        is_known &= bus.is_some();
        batch.push(Item {
            time: last,
            bus: bus.unwrap_or(0),
            content,
        });
        if !is_known {
            return ControlFlow::Break(());
        }
        if batch.len() == BATCH {
            let full = std::mem::replace(&mut batch, Vec::with_capacity(BATCH));
            if sender.send(full).is_err() {
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    })?;
    if !is_known {
        let text = format!(
            "{} changed while it was imported; repeat the command",
            input.path.display()
        );
        return Err(UsageError(text).into());
    }
    // The receiver is gone if the import failed, which reports its own error.
    let _ = sender.send(batch);
    Ok(())
}
