//! Logs as outputs.

use std::path::PathBuf;
use std::sync::mpsc::Receiver;

use store::{Encoded, Writer};

use crate::behind::Behind;
use crate::{Entry, Error, Result};

/// A log that is being written on a thread of its own; removed when it is dropped before it is
/// finished.
pub struct LogFile {
    /// `None` after the log is finished.
    writing: Option<Behind<Item, Result<Writer>>>,
    active: PathBuf,
    force: bool,
}

/// What is written.
#[allow(
    clippy::large_enum_variant,
    reason = "items are passed one by one and not stored"
)]
enum Item {
    Entry(Entry),
    Message(Encoded),
}

impl LogFile {
    /// Starts the thread that writes.
    pub(super) fn start(writer: Writer, active: PathBuf, force: bool) -> Self {
        Self {
            writing: Some(Behind::start(|items| write(writer, items))),
            active,
            force,
        }
    }

    /// Appends an entry to the log.
    ///
    /// # Errors
    /// If the disk fails, for this entry or for earlier ones.
    pub fn push(&mut self, entry: Entry) -> Result<()> {
        self.push_item(Item::Entry(entry))
    }

    /// Appends a message of another log, whose schema is one of the program's own.
    ///
    /// # Errors
    /// As [`push`](Self::push).
    pub fn push_message(&mut self, message: Encoded) -> Result<()> {
        self.push_item(Item::Message(message))
    }

    fn push_item(&mut self, item: Item) -> Result<()> {
        let writing = self.writing.as_mut();
        let writing = writing.expect("only `finish` takes it, and it consumes the log");
        if writing.push(item) {
            return Ok(());
        }
        match writing.finish() {
            Some(Err(error)) => Err(error),
            Some(Ok(_)) | None => Err(Error::LogClosed(self.active.clone())),
        }
    }

    /// Closes the log and renames it to the target.
    ///
    /// # Errors
    /// If the disk fails, or if a file of that name was created meanwhile and `force` is not set. The
    /// log is removed then.
    pub fn finish(mut self) -> Result<store::Finished> {
        let mut writing = self.writing.take().expect("`finish` consumes the log");
        let written = (writing.finish()).unwrap_or(Err(Error::LogClosed(self.active.clone())));
        let finished = written.and_then(|writer| {
            Ok(if self.force {
                writer.finish_replacing()?
            } else {
                writer.finish()?
            })
        });
        if finished.is_err() {
            self.remove();
        }
        finished
    }

    fn remove(&self) {
        // The first error is reported, not this one.
        let _ = std::fs::remove_file(&self.active);
    }
}

fn write(mut writer: Writer, items: Receiver<Vec<Item>>) -> Result<Writer> {
    for item in items.into_iter().flatten() {
        match item {
            Item::Entry(Entry::Arrival(arrival)) => writer.push(arrival)?,
            Item::Entry(Entry::Record(record)) => writer.record(&record),
            Item::Message(message) => writer.message(&message),
        }
    }
    Ok(writer)
}

impl Drop for LogFile {
    fn drop(&mut self) {
        // The thread ends before the file is removed.
        if self.writing.take().is_some() {
            self.remove();
        }
    }
}
