//! The control socket of a running recorder: one JSON line asked, one JSON line answered.
//!
//! Only this user and group can open it; nothing listens on a network.

use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Weak};

use acq::Sequencer;
use anyhow::Context;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use store::{DiskState, Recorder};
use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader};
use tokio::net::{UnixListener, UnixStream};

use crate::config::Config;

/// Longest request, bytes.
const REQUEST_MAX: u64 = 4096;
/// Longest text of a mark, characters.
const MARK_MAX: usize = 1000;
/// Name of the socket in the storage directory.
const NAME: &str = "control";

/// What can be asked.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "command", rename_all = "snake_case", deny_unknown_fields)]
pub enum Request {
    /// Set a mark.
    Mark {
        /// Its text.
        text: String,
    },
    /// Tell how things are.
    Status,
}

/// Where a recorder with this configuration listens.
pub fn socket_path(config: &Config) -> PathBuf {
    match &config.control {
        Some(path) => path.clone(),
        None => config.storage.directory.join(NAME),
    }
}

/// The socket; removed when dropped.
pub struct Listener {
    listener: UnixListener,
    path: PathBuf,
}

impl Listener {
    /// Opens the socket. One that nobody listens to any more is replaced.
    pub fn open(path: &Path) -> anyhow::Result<Self> {
        if std::os::unix::net::UnixStream::connect(path).is_ok() {
            anyhow::bail!(
                "another recorder listens on {}; stop it, or give this one another \
                 storage.directory or control.socket",
                path.display()
            );
        }
        match std::fs::remove_file(path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        }
        .with_context(|| format!("cannot replace the old socket {}", path.display()))?;
        let listener = UnixListener::bind(path)
            .with_context(|| format!("cannot make the control socket {}", path.display()))?;
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o660))
            .with_context(|| format!("cannot set the permissions of {}", path.display()))?;
        Ok(Self {
            listener,
            path: path.to_owned(),
        })
    }

    /// Answers, one after the other, until it is dropped.
    pub async fn serve(&self, sequencer: Sequencer, recorder: Weak<Recorder>) {
        loop {
            match self.listener.accept().await {
                Ok((stream, _)) => {
                    let (sequencer, recorder) = (sequencer.clone(), recorder.clone());
                    tokio::spawn(async move {
                        if let Err(error) = answer(stream, &sequencer, &recorder).await {
                            tracing::debug!(%error, "a control request was not answered");
                        }
                    });
                }
                Err(error) => {
                    tracing::warn!(%error, "the control socket does not answer");
                    tokio::time::sleep(std::time::Duration::from_secs(1)).await;
                }
            }
        }
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        // The next start replaces what is left.
        let _ = std::fs::remove_file(&self.path);
    }
}

async fn answer(
    stream: UnixStream,
    sequencer: &Sequencer,
    recorder: &Weak<Recorder>,
) -> io::Result<()> {
    let (read, mut write) = stream.into_split();
    let mut line = String::new();
    BufReader::new(read.take(REQUEST_MAX))
        .read_line(&mut line)
        .await?;
    let value = match serde_json::from_str(&line) {
        Ok(Request::Mark { text }) => mark(sequencer, &text),
        Ok(Request::Status) => status(sequencer, recorder.upgrade()),
        Err(error) => json!({ "error": format!("not understood: {error}") }),
    };
    write.write_all(format!("{value}\n").as_bytes()).await
}

fn mark(sequencer: &Sequencer, text: &str) -> Value {
    if text.chars().count() > MARK_MAX {
        return json!({ "error": format!("the text is longer than {MARK_MAX} characters") });
    }
    json!({ "time_ns": sequencer.mark(text).0 })
}

fn status(sequencer: &Sequencer, recorder: Option<Arc<Recorder>>) -> Value {
    let sources: Vec<Value> = sequencer
        .counters()
        .into_iter()
        .map(|(id, counters)| {
            json!({
                "source": id,
                "open": counters.open,
                "state": counters.state,
                "items": counters.items,
                "bytes": counters.bytes,
                "lost": counters.lost,
                "last_data_ns": counters.last_data.map(|time| time.0),
            })
        })
        .collect();
    let disk = recorder.map(|recorder| {
        let status = recorder.status();
        let (state, detail) = match status.disk {
            DiskState::Writing(path) => ("writing", path.display().to_string()),
            DiskState::Failing { reason } => ("failing", reason),
            DiskState::Closed => ("closed", String::new()),
        };
        json!({
            "state": state,
            "detail": detail,
            "bytes": status.bytes,
            "waiting": status.waiting,
            "lost_arrivals": status.lost_arrivals,
            "lost_records": status.lost_records,
        })
    });
    json!({
        "now_ns": sequencer.clock().now().0,
        "arrivals": sequencer.next_sequence(),
        "sources": sources,
        "disk": disk,
    })
}
