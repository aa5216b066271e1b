//! Control socket of a running recorder: a client sends a request as one JSON line and receives the
//! response as one JSON line.
//!
//! Only the recorder's user and group can open the socket. The recorder listens on no network.

mod socket;

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use acq::Sequencer;
use sample::LossPlace;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use store::{DiskState, GoneLog, Losses};
use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader};
use tokio::net::UnixStream;
use tokio::sync::{mpsc, oneshot};
use tokio::time::timeout;

pub use crate::status::{RecorderStatus, Writing};
use crate::tap::Tap;
pub use socket::{Listener, paths, tap_paths};

/// Longest request, bytes: a mark of [`MARK_MAX`] characters, each escaped.
const REQUEST_MAX: u64 = 16_384;
/// Longest text of a mark, characters.
pub const MARK_MAX: usize = 1000;
/// Longest time in which a client sends its request, and in which it reads the response.
const CLIENT_TIMEOUT: Duration = Duration::from_secs(10);

/// Request of a client.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "command", rename_all = "snake_case", deny_unknown_fields)]
pub enum Request {
    /// Add a mark.
    Mark {
        /// Text of the mark.
        text: String,
    },
    /// Report the recorder's state.
    Status,
    /// Start writing logs, until a stop.
    Start,
    /// Stop writing logs; sources and estimator continue.
    Stop,
    /// Reload the configuration.
    Reload,
}

/// Command to the pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// Start writing logs, until a stop.
    Start,
    /// Stop writing logs; sources and estimator continue.
    Stop,
    /// Reload the configuration.
    Reload,
}

/// Result of a command: the recorder's state after it, in words.
pub type CommandResult = anyhow::Result<String>;

/// Handles the requests of clients.
#[derive(Clone)]
pub struct ControlHandler {
    /// Sequencer of the sources.
    pub sequencer: Sequencer,
    /// State of the recorder.
    pub status: Arc<RecorderStatus>,
    /// Queue of commands to the pipeline, each with the channel of its result.
    pub commands: mpsc::Sender<(Command, oneshot::Sender<CommandResult>)>,
    /// Tap of the live process.
    pub tap: Tap,
}

impl ControlHandler {
    /// Reads one request, handles it, and writes the response. `busy` is true while the request is
    /// handled.
    async fn serve_client(&self, stream: UnixStream, busy: &AtomicBool) -> io::Result<()> {
        let (read, mut write) = stream.into_split();
        let mut line = Vec::new();
        let mut read = BufReader::new(read.take(REQUEST_MAX));
        timeout(CLIENT_TIMEOUT, read.read_until(b'\n', &mut line)).await??;
        busy.store(true, Ordering::Relaxed);
        let value = self.handle_request(&line).await;
        busy.store(false, Ordering::Relaxed);
        let text = format!("{value}\n");
        timeout(CLIENT_TIMEOUT, write.write_all(text.as_bytes())).await?
    }

    async fn handle_request(&self, line: &[u8]) -> Value {
        if !line.ends_with(b"\n") && line.len() as u64 >= REQUEST_MAX {
            return json!({ "error": format!("the request is longer than {REQUEST_MAX} bytes") });
        }
        match serde_json::from_slice(line) {
            Ok(Request::Mark { text }) => mark(&self.sequencer, &text),
            Ok(Request::Status) => status(self),
            Ok(Request::Start) => self.run_command(Command::Start).await,
            Ok(Request::Stop) => self.run_command(Command::Stop).await,
            Ok(Request::Reload) => self.run_command(Command::Reload).await,
            Err(error) => json!({ "error": format!("the request is not valid: {error}") }),
        }
    }

    async fn run_command(&self, command: Command) -> Value {
        let (reply, result) = oneshot::channel();
        // Both fail only when the recorder ends.
        let _ = self.commands.send((command, reply)).await;
        match result.await {
            Ok(Ok(state)) => json!({ "writing": state }),
            Ok(Err(error)) => json!({ "error": format!("{error:#}") }),
            Err(_) => json!({ "error": "the recorder is ending" }),
        }
    }
}

fn mark(sequencer: &Sequencer, text: &str) -> Value {
    let length = text.chars().count();
    if length > MARK_MAX {
        return json!({
            "error": format!("the text has {length} characters; the limit is {MARK_MAX}")
        });
    }
    json!({ "time_ns": sequencer.mark(text).0 })
}

/// State of the recorder as JSON.
pub fn status(handler: &ControlHandler) -> Value {
    let losses = handler.sequencer.ledger().losses();
    let now = handler.sequencer.clock().now();
    let sources: Vec<Value> = handler
        .sequencer
        .counters()
        .into_iter()
        .map(|(id, counters)| {
            let name = handler.status.source_name(id);
            let [late, too_late] = handler.status.late(id);
            json!({
                "source": id,
                "open": counters.open,
                "state": counters.state,
                "undecoded": handler.status.undecoded(id),
                "items": counters.items,
                "bytes": counters.bytes,
                "lost": losses.of(id),
                "late": late,
                "too_late": too_late,
                "last_data_ns": counters.last_data.map(|time| time.0),
                "age_s": counters.last_data.map(|time| now.seconds_since(time)),
                "rate_hz": handler.status.rate_hz(&name),
                "name": name,
            })
        })
        .collect();
    let kept_s = handler
        .sequencer
        .kept_since()
        .map(|since| now.seconds_since(since));
    let mut status = json!({
        "now_ns": now.0,
        "version": env!("CARGO_PKG_VERSION"),
        "arrivals": handler.sequencer.next_sequence(),
        "writing": handler.status.writing().to_string(),
        "memory_s": kept_s,
        "sources": sources,
        "lost": by_place(&losses),
        "faulty_sensors": handler.status.faulty_sensors(),
        "disk": disk(&handler.status),
        "retention": handler.status.retention(),
        "tap": { "clients": handler.tap.clients(), "lost": handler.tap.dropped() },
    });
    handler.status.add_to(&mut status);
    status
}

fn disk(status: &RecorderStatus) -> Value {
    let forecast = status.disk_forecast();
    let mut disk = json!({
        "state": "closed",
        "detail": "",
        "bytes": 0,
        "waiting": 0,
        "room_bytes": forecast.available_bytes,
        "rate_bytes_s": forecast.rate_bytes_s,
        "lasts_s": forecast.lasts_s(),
        "estimate": forecast.to_string(),
    });
    if let Some(recorder) = status.recorder() {
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
        disk["gone"] = status.gone.iter().map(gone_log).collect();
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

/// A log that was deleted or renamed while it was written.
pub fn gone_log(gone: &GoneLog) -> Value {
    json!({
        "path": gone.path,
        "arrivals": gone.arrivals,
        "what": if gone.deleted { "deleted" } else { "renamed" },
    })
}

/// Lost items by place. For the disk these are arrivals; `records` are decoded records, which a replay
/// computes again.
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
