//! The control socket of a running recorder: one JSON line asked, one JSON line answered.
//!
//! Only this user and group can open it; nothing listens on a network.

use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use acq::Sequencer;
use anyhow::Context;
use sample::LossPlace;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use store::{DiskState, GoneLog, Losses};
use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader};
use tokio::net::{UnixListener, UnixStream};
use tokio::sync::{mpsc, oneshot};

pub use crate::board::{Board, Writing};
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
    /// Begin to write, until told otherwise.
    Start,
    /// End writing; sources and estimator go on.
    Stop,
    /// Read the configuration again.
    Reload,
}

/// What only the pipeline can do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Begin to write, until told otherwise.
    Start,
    /// End writing; sources and estimator go on.
    Stop,
    /// Read the configuration again.
    Reload,
}

/// What became of an order, in words.
pub type Answer = anyhow::Result<String>;

/// What requests are answered from.
#[derive(Clone)]
pub struct Desk {
    /// The stream.
    pub sequencer: Sequencer,
    /// What the pipeline says of itself.
    pub board: Arc<Board>,
    /// Where orders go.
    pub orders: mpsc::Sender<(Order, oneshot::Sender<Answer>)>,
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
    pub async fn serve(&self, desk: Desk) {
        loop {
            match self.listener.accept().await {
                Ok((stream, _)) => {
                    let desk = desk.clone();
                    tokio::spawn(async move {
                        if let Err(error) = answer(stream, &desk).await {
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

async fn answer(stream: UnixStream, desk: &Desk) -> io::Result<()> {
    let (read, mut write) = stream.into_split();
    let mut line = String::new();
    BufReader::new(read.take(REQUEST_MAX))
        .read_line(&mut line)
        .await?;
    let value = match serde_json::from_str(&line) {
        Ok(Request::Mark { text }) => mark(&desk.sequencer, &text),
        Ok(Request::Status) => status(desk),
        Ok(Request::Start) => order(desk, Order::Start).await,
        Ok(Request::Stop) => order(desk, Order::Stop).await,
        Ok(Request::Reload) => order(desk, Order::Reload).await,
        Err(error) => json!({ "error": format!("not understood: {error}") }),
    };
    write.write_all(format!("{value}\n").as_bytes()).await
}

async fn order(desk: &Desk, order: Order) -> Value {
    let (reply, answer) = oneshot::channel();
    // Both fail only when the recorder ends.
    let _ = desk.orders.send((order, reply)).await;
    match answer.await {
        Ok(Ok(said)) => json!({ "writing": said }),
        Ok(Err(error)) => json!({ "error": format!("{error:#}") }),
        Err(_) => json!({ "error": "the recorder is ending" }),
    }
}

fn mark(sequencer: &Sequencer, text: &str) -> Value {
    if text.chars().count() > MARK_MAX {
        return json!({ "error": format!("the text is longer than {MARK_MAX} characters") });
    }
    json!({ "time_ns": sequencer.mark(text).0 })
}

fn status(desk: &Desk) -> Value {
    let losses = desk.sequencer.ledger().losses();
    let sources: Vec<Value> = desk
        .sequencer
        .counters()
        .into_iter()
        .map(|(id, counters)| {
            json!({
                "source": id,
                "name": desk.board.source_name(id),
                "open": counters.open,
                "state": counters.state,
                "items": counters.items,
                "bytes": counters.bytes,
                "lost": losses.of(id),
                "last_data_ns": counters.last_data.map(|time| time.0),
            })
        })
        .collect();
    let now = desk.sequencer.clock().now();
    let kept_s = desk
        .sequencer
        .kept_since()
        .map(|since| now.seconds_since(since));
    json!({
        "now_ns": now.0,
        "arrivals": desk.sequencer.next_sequence(),
        "writing": desk.board.writing(),
        "memory_s": kept_s,
        "sources": sources,
        "lost": by_place(&losses),
        "faulty_sensors": desk.board.faulty_sensors(),
        "disk": disk(&desk.board),
        "retention": desk.board.retention(),
    })
}

fn disk(board: &Board) -> Value {
    let estimate = board.estimate();
    let mut disk = json!({
        "state": "closed",
        "detail": "",
        "bytes": 0,
        "waiting": 0,
        "room_bytes": estimate.room_bytes,
        "rate_bytes_s": estimate.rate_bytes_s,
        "lasts_s": estimate.lasts_s(),
        "estimate": estimate.to_string(),
    });
    if let Some(recorder) = board.recorder() {
        let status = recorder.status();
        let (state, detail) = match status.disk {
            DiskState::Writing(path) => ("writing", path.display().to_string()),
            DiskState::Failing { reason } => ("failing", reason),
            DiskState::Closed => ("closed", String::new()),
        };
        disk["state"] = state.into();
        disk["detail"] = detail.into();
        disk["bytes"] = status.bytes.into();
        disk["waiting"] = status.waiting.into();
        disk["lost_arrivals"] = status.losses.arrivals.into();
        disk["lost_records"] = status.losses.records.into();
        disk["raw_only"] = status.raw_only.into();
        disk["gone"] = status.gone.iter().map(gone).collect();
        let backlog = status.backlog;
        disk["backlog"] = json!({
            "arrivals": backlog.arrivals,
            "bytes": backlog.bytes,
            "seconds": backlog.span.as_secs_f64(),
            "queue_percent": backlog.queue_fill,
            "unsynced_s": backlog.unsynced.as_secs_f64(),
        });
    }
    disk
}

/// A file that was deleted or renamed while it was being written.
pub fn gone(gone: &GoneLog) -> Value {
    json!({
        "path": gone.path,
        "arrivals": gone.arrivals,
        "what": if gone.deleted { "deleted" } else { "renamed" },
    })
}

/// Items lost by place; on the way to the disk arrivals, and decoded records, which a replay computes
/// again.
pub fn by_place(losses: &Losses) -> Value {
    let mut lost: serde_json::Map<String, Value> = LossPlace::ALL
        .into_iter()
        .zip(losses.totals())
        .map(|(place, count)| (place.name().to_owned(), count.into()))
        .collect();
    lost.insert(LossPlace::Disk.name().to_owned(), losses.arrivals.into());
    lost.insert("records".to_owned(), losses.records.into());
    Value::Object(lost)
}
