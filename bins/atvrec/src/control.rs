//! The control socket of a running recorder: one JSON line is the request, one JSON line the answer.
//!
//! Only this user and group can open it; nothing listens on a network.

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

pub use crate::board::{Board, Writing};
pub use socket::{Listener, paths};

/// Longest request, bytes: a mark of [`MARK_MAX`] characters, each escaped.
const REQUEST_MAX: u64 = 16_384;
/// Longest text of a mark, characters.
const MARK_MAX: usize = 1000;
/// Time in which a client sends its request, and in which it reads the answer.
const IDLE_MAX: Duration = Duration::from_secs(10);

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

/// Reads one request, carries it out, writes its answer. `busy` is true while it is carried out.
async fn answer(stream: UnixStream, desk: &Desk, busy: &AtomicBool) -> io::Result<()> {
    let (read, mut write) = stream.into_split();
    let mut line = Vec::new();
    let mut read = BufReader::new(read.take(REQUEST_MAX));
    timeout(IDLE_MAX, read.read_until(b'\n', &mut line)).await??;
    busy.store(true, Ordering::Relaxed);
    let value = carry_out(&line, desk).await;
    busy.store(false, Ordering::Relaxed);
    let text = format!("{value}\n");
    timeout(IDLE_MAX, write.write_all(text.as_bytes())).await?
}

async fn carry_out(line: &[u8], desk: &Desk) -> Value {
    if !line.ends_with(b"\n") && line.len() as u64 >= REQUEST_MAX {
        return json!({ "error": format!("the request is longer than {REQUEST_MAX} bytes") });
    }
    match serde_json::from_slice(line) {
        Ok(Request::Mark { text }) => mark(&desk.sequencer, &text),
        Ok(Request::Status) => status(desk),
        Ok(Request::Start) => order(desk, Order::Start).await,
        Ok(Request::Stop) => order(desk, Order::Stop).await,
        Ok(Request::Reload) => order(desk, Order::Reload).await,
        Err(error) => json!({ "error": format!("the request is not valid: {error}") }),
    }
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
