//! Connections to the recorder: its tap, and its control socket.

use std::io;
use std::path::PathBuf;
use std::time::Duration;

use serde_json::{Value, json};
use store::TapDecoder;
use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader};
use tokio::net::UnixStream;
use tokio::time::{sleep, timeout};

use crate::Hub;
use crate::hub::Topics;

/// Pause before the next attempt to connect.
const PAUSE: Duration = Duration::from_millis(300);
/// Number of failures after which a recorder is reported as absent.
const FAILURES_REPORTED: u32 = 5;
/// Time without a frame after which the connection is closed; a recorder sends the time ten times a
/// second.
const SILENCE: Duration = Duration::from_secs(5);
/// Timeout of a request; starting and stopping closes files.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(60);
/// Longest response, bytes.
const RESPONSE_MAX: u64 = 16 << 20;

/// Reads the tap at the first of `paths` that has one, for ever, and gives its frames to the hub.
pub async fn follow(paths: Vec<PathBuf>, hub: Hub) {
    let mut failures = 0;
    loop {
        match connect(&paths).await {
            Ok(stream) => {
                failures = 0;
                tracing::info!("connected to the recorder");
                hub.connected();
                let ended = read(stream, &hub).await;
                hub.disconnected();
                let reason = ended
                    .err()
                    .map_or_else(String::new, |error| error.to_string());
                tracing::warn!(%reason, "the connection to the recorder has ended; trying again");
            }
            Err(error) => {
                failures += 1;
                // A recorder that starts at the same time needs a moment.
                if failures == FAILURES_REPORTED {
                    tracing::warn!(%error, "cannot connect to the recorder; trying again until it runs");
                }
            }
        }
        sleep(PAUSE).await;
    }
}

async fn connect(paths: &[PathBuf]) -> io::Result<UnixStream> {
    let mut reasons = Vec::new();
    for path in paths {
        match UnixStream::connect(path).await {
            Ok(stream) => return Ok(stream),
            Err(error) => reasons.push(format!("{}: {error}", path.display())),
        }
    }
    Err(io::Error::new(io::ErrorKind::NotFound, reasons.join("; ")))
}

async fn read(stream: UnixStream, hub: &Hub) -> io::Result<()> {
    let (mut reader, mut writer) = stream.into_split();
    let mut wanted = hub.wanted();
    let topics = wanted.borrow_and_update().clone();
    send_topics(&mut writer, &topics).await?;
    let mut decoder = TapDecoder::default();
    let mut buffer = vec![0; 1 << 16];
    loop {
        tokio::select! {
            count = timeout(SILENCE, reader.read(&mut buffer)) => {
                let count = count.map_err(|_| io::Error::from(io::ErrorKind::TimedOut))??;
                if count == 0 {
                    return Ok(());
                }
                decoder.push(&buffer[..count]);
                while let Some(frame) = decoder.next_frame().map_err(io::Error::other)? {
                    hub.frame(frame);
                }
            }
            changed = wanted.changed() => {
                changed.map_err(io::Error::other)?;
                let topics = wanted.borrow_and_update().clone();
                send_topics(&mut writer, &topics).await?;
            }
        }
    }
}

async fn send_topics(writer: &mut (impl AsyncWriteExt + Unpin), topics: &Topics) -> io::Result<()> {
    let line = format!("{}\n", json!({ "topics": topics }));
    writer.write_all(line.as_bytes()).await
}

/// Requests to the control socket of the recorder.
#[derive(Clone, Debug, Default)]
pub struct Control {
    paths: Vec<PathBuf>,
}

impl Control {
    /// Requests to the first of these sockets that accepts a connection.
    #[must_use]
    pub fn new(paths: Vec<PathBuf>) -> Self {
        Self { paths }
    }

    /// Sends a request and returns the response.
    ///
    /// # Errors
    /// A text for people, if the recorder does not answer or rejects the request.
    pub async fn request(&self, request: &Value) -> Result<Value, String> {
        if self.paths.is_empty() {
            return Err("a log is played: there is no recorder".to_owned());
        }
        let answer = timeout(REQUEST_TIMEOUT, self.exchange(request)).await;
        let answer = answer.map_err(|_| "the recorder did not respond".to_owned())?;
        let answer = answer.map_err(|error| {
            format!("cannot reach the recorder ({error}); check that it runs and that this user may open its control socket")
        })?;
        match answer["error"].as_str() {
            Some(error) => Err(error.to_owned()),
            None => Ok(answer),
        }
    }

    /// Adds a mark.
    ///
    /// # Errors
    /// As [`Control::request`].
    pub async fn mark(&self, text: &str) -> Result<Value, String> {
        if text.trim().is_empty() {
            return Err("a mark needs a text".to_owned());
        }
        let length = text.chars().count();
        if length > MARK_MAX {
            return Err(format!(
                "the text has {length} characters; the limit is {MARK_MAX}"
            ));
        }
        self.request(&json!({ "command": "mark", "text": text }))
            .await
    }

    async fn exchange(&self, request: &Value) -> io::Result<Value> {
        let mut stream = connect(&self.paths).await?;
        stream.write_all(format!("{request}\n").as_bytes()).await?;
        let mut line = String::new();
        BufReader::new(stream.take(RESPONSE_MAX))
            .read_line(&mut line)
            .await?;
        serde_json::from_str(&line).map_err(io::Error::other)
    }
}

/// Longest text of a mark, characters.
pub(crate) const MARK_MAX: usize = 1000;
