//! The file beside a log that states losses which the log itself cannot state.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::path::Path;

use crate::file::{losses_path, sync_directory};
use crate::{Error, Losses, Result, Session};

/// Longest file that is read, bytes: far more than a file of any configuration has.
const LENGTH_MAX: u64 = 1 << 20;

/// Writes the losses beside the log `log`, with the names of the log's counters. The file is TOML.
pub(super) fn write(log: &Path, session: &Session, losses: &Losses, reason: &str) -> Result<()> {
    let path = losses_path(log);
    let mut counters = BTreeMap::new();
    losses.put(session, &mut counters);
    let mut text = format!(
        "# Lost, and not stated in {}:\n# {}.\n",
        log.display(),
        reason.replace('\n', " ")
    );
    for (name, count) in counters {
        text.push_str(&format!("{name:?} = {count}\n"));
    }
    File::create(&path)
        .and_then(|mut file| {
            file.write_all(text.as_bytes())?;
            file.sync_data()
        })
        .map_err(Error::file("write", &path))?;
    sync_directory(&path)
}

/// The counters in the file beside a log; empty if there is no such file, or it cannot be read.
pub(crate) fn read(log: &Path) -> BTreeMap<String, String> {
    use std::io::Read as _;
    let mut text = String::new();
    let file = File::open(losses_path(log)).map(|file| file.take(LENGTH_MAX));
    if file
        .and_then(|mut file| file.read_to_string(&mut text))
        .is_err()
    {
        return BTreeMap::new();
    }
    let lines = text.lines().filter_map(|line| {
        let (name, count) = line.rsplit_once(" = ")?;
        let name = name.strip_prefix('"')?.strip_suffix('"')?;
        count.parse::<u64>().ok()?;
        Some((name.to_owned(), count.to_owned()))
    });
    lines.collect()
}
