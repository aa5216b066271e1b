//! Logs as outputs.

use std::path::PathBuf;
use std::sync::mpsc::Receiver;

use store::Writer;

use crate::behind::Behind;
use crate::{Entry, Error, Result};

/// A log that is being written on a thread of its own; removed when it is dropped before it is
/// finished.
pub struct LogFile {
    /// `None` after the log is finished.
    writing: Option<Behind<Entry, Result<Writer>>>,
    active: PathBuf,
    force: bool,
}

impl LogFile {
    /// Starts the thread that writes.
    pub(super) fn start(writer: Writer, active: PathBuf, force: bool) -> Self {
        Self {
            writing: Some(Behind::start(|entries| write(writer, entries))),
            active,
            force,
        }
    }

    /// Appends an entry to the log.
    ///
    /// # Errors
    /// If the disk fails, for this entry or for earlier ones.
    pub fn push(&mut self, entry: Entry) -> Result<()> {
        let writing = self.writing.as_mut();
        let writing = writing.expect("only `finish` takes it, and it consumes the log");
        if writing.push(entry) {
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

fn write(mut writer: Writer, entries: Receiver<Vec<Entry>>) -> Result<Writer> {
    for entry in entries.into_iter().flatten() {
        match entry {
            Entry::Arrival(arrival) => writer.push(arrival)?,
            Entry::Record(record) => writer.record(&record),
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
