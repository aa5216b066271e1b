//! Tap: decoded and estimated records for the live process, through a Unix socket.
//!
//! A client has a queue of its own. The engine puts records into it without waiting; if the queue is
//! full, the oldest record is dropped and counted. A thread for each client encodes what the client
//! selected and writes it to the socket. Without a client, the engine does one comparison for each
//! record.
//!
//! A client sends lines of JSON: `{"topics": ["/tf"]}` selects topics, `{"topics": null}` selects all.

use std::collections::{BTreeSet, VecDeque};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::Shutdown;
use std::os::unix::net::UnixStream;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use acq::LogClock;
use anyhow::Context;
use serde::Deserialize;
use store::{Record, Session, TapEncoder};

use crate::control::Listener;

/// Most records in the queue of a client: about 2 s of a vehicle with four CAN buses.
const QUEUE: usize = 8_192;
/// Most clients.
const CLIENTS_MAX: usize = 4;
/// Period in which a client's thread looks into its queue.
const PERIOD: Duration = Duration::from_millis(5);
/// Period in which a client gets the time.
const TIME_PERIOD: Duration = Duration::from_millis(100);
/// Longest line of a client, bytes.
const LINE_MAX: u64 = 1 << 20;

/// Hands records to the clients. Clones share the clients.
#[derive(Clone)]
pub struct Tap(Arc<Shared>);

struct Shared {
    clock: LogClock,
    /// Whether there is a client.
    open: AtomicBool,
    clients: Mutex<Vec<Arc<Client>>>,
    /// Records that were dropped because a client was slow.
    dropped: AtomicU64,
    session: Mutex<Arc<(Session, String)>>,
}

struct Client {
    stream: UnixStream,
    queue: Mutex<VecDeque<Arc<Record>>>,
    dropped: AtomicU64,
    closed: AtomicBool,
    /// New selection of the client.
    selected: Mutex<Option<Selection>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Selection {
    topics: Option<BTreeSet<String>>,
}

impl Tap {
    /// Tap without clients of a recorder with this session.
    pub fn new(clock: LogClock, session: Session, hello: String) -> Self {
        Self(Arc::new(Shared {
            clock,
            open: AtomicBool::new(false),
            clients: Mutex::default(),
            dropped: AtomicU64::new(0),
            session: Mutex::new(Arc::new((session, hello))),
        }))
    }

    /// Sets the session of a new configuration. All clients are disconnected, and connect again.
    pub fn restart(&self, session: Session, hello: String) {
        *lock(&self.0.session) = Arc::new((session, hello));
        self.close();
    }

    /// Gives a record to all clients; never waits for a client.
    pub fn push(&self, record: &Record) {
        if !self.0.open.load(Ordering::Relaxed) {
            return;
        }
        let record = Arc::new(record.clone());
        for client in lock(&self.0.clients).iter() {
            let mut queue = lock(&client.queue);
            if queue.len() == QUEUE {
                queue.pop_front();
                client.dropped.fetch_add(1, Ordering::Relaxed);
                self.0.dropped.fetch_add(1, Ordering::Relaxed);
            }
            queue.push_back(Arc::clone(&record));
        }
    }

    /// Number of clients.
    pub fn clients(&self) -> usize {
        lock(&self.0.clients).len()
    }

    /// Records that were dropped because a client was slow.
    pub fn dropped(&self) -> u64 {
        self.0.dropped.load(Ordering::Relaxed)
    }

    /// Accepts clients until the future is dropped.
    pub async fn serve(self, listener: Listener) {
        loop {
            let accepted = match listener.accept().await {
                Ok(stream) => stream.into_std().context("cannot use the connection"),
                Err(error) => Err(error).context("cannot accept a client"),
            };
            if let Err(error) = accepted.and_then(|stream| self.admit(stream)) {
                tracing::warn!("tap: {error:#}; the next attempt is in 1 s");
                tokio::time::sleep(Duration::from_secs(1)).await;
            }
        }
    }

    fn admit(&self, stream: UnixStream) -> anyhow::Result<()> {
        if self.clients() >= CLIENTS_MAX {
            tracing::warn!(
                limit = CLIENTS_MAX,
                "tap: a client is refused: too many clients"
            );
            return Ok(());
        }
        stream.set_nonblocking(false)?;
        let client = Arc::new(Client {
            stream: stream.try_clone()?,
            queue: Mutex::new(VecDeque::with_capacity(QUEUE)),
            dropped: AtomicU64::new(0),
            closed: AtomicBool::new(false),
            selected: Mutex::default(),
        });
        lock(&self.0.clients).push(Arc::clone(&client));
        self.0.open.store(true, Ordering::Relaxed);
        let (tap, writing) = (self.clone(), Arc::clone(&client));
        thread::Builder::new()
            .name("tap".to_owned())
            .spawn(move || {
                if let Err(error) = tap.write_to(&writing) {
                    tracing::debug!(%error, "a client of the tap has left");
                }
                tap.forget(&writing);
            })?;
        thread::Builder::new()
            .name("tap selection".to_owned())
            .spawn(move || client.read_selections())?;
        Ok(())
    }

    /// Writes to a client until it leaves. A client that does not read blocks this thread alone.
    fn write_to(&self, client: &Client) -> std::io::Result<()> {
        let session = Arc::clone(&lock(&self.0.session));
        let (session, hello) = &*session;
        let mut encoder = TapEncoder::new(session);
        let mut bytes = Vec::new();
        encoder.begin(hello, &mut bytes);
        let mut reported = 0;
        let mut timed = None::<Instant>;
        while !client.closed.load(Ordering::Relaxed) {
            if let Some(selection) = lock(&client.selected).take() {
                encoder.select(selection.topics);
            }
            let records = std::mem::take(&mut *lock(&client.queue));
            for record in &records {
                encoder.record(record, &mut bytes);
            }
            let dropped = client.dropped.load(Ordering::Relaxed);
            if dropped != reported {
                reported = dropped;
                encoder.lost(dropped, &mut bytes);
            }
            if timed.is_none_or(|at| at.elapsed() >= TIME_PERIOD) {
                timed = Some(Instant::now());
                encoder.time(self.0.clock.now(), &mut bytes);
            }
            if bytes.is_empty() {
                thread::sleep(PERIOD);
                continue;
            }
            (&client.stream).write_all(&bytes)?;
            bytes.clear();
        }
        Ok(())
    }

    fn forget(&self, client: &Arc<Client>) {
        client.close();
        let mut clients = lock(&self.0.clients);
        clients.retain(|known| !Arc::ptr_eq(known, client));
        self.0.open.store(!clients.is_empty(), Ordering::Relaxed);
    }

    /// Disconnects all clients.
    pub fn close(&self) {
        for client in lock(&self.0.clients).iter() {
            client.close();
        }
    }
}

impl Client {
    fn read_selections(&self) {
        let mut reader = BufReader::new((&self.stream).take(LINE_MAX));
        let mut line = String::new();
        while reader.read_line(&mut line).is_ok_and(|count| count > 0) {
            match serde_json::from_str(&line) {
                Ok(selection) => *lock(&self.selected) = Some(selection),
                Err(error) => {
                    tracing::warn!(%error, "tap: a client sent a line that is not valid");
                    break;
                }
            }
            line.clear();
            reader.get_mut().set_limit(LINE_MAX);
        }
        self.close();
    }

    fn close(&self) {
        self.closed.store(true, Ordering::Relaxed);
        // The connection may be closed already.
        let _ = self.stream.shutdown(Shutdown::Both);
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use sample::LogTime;

    use super::*;

    fn mark(n: usize) -> Record {
        Record::Mark {
            time: LogTime(n as u64),
            text: "x".repeat(100),
        }
    }

    /// A client that does not read: the queue stays bounded, the oldest records are dropped and
    /// counted, and each push takes a short time. Then the client is disconnected although its thread
    /// waits in a write.
    #[test]
    fn a_client_that_does_not_read_costs_counted_records_only() {
        let tap = Tap::new(LogClock::start(), Session::default(), "{}".to_owned());
        let (ours, mut theirs) = UnixStream::pair().expect("a pair");
        tap.admit(ours).expect("admitted");
        theirs.write_all(b"{\"topics\":null}\n").expect("written");
        thread::sleep(10 * PERIOD);
        let count = 40 * QUEUE;
        let begin = Instant::now();
        let mut longest = Duration::ZERO;
        for n in 0..count {
            let before = Instant::now();
            tap.push(&mark(n));
            longest = longest.max(before.elapsed());
        }
        let mean = begin.elapsed() / count as u32;
        assert!(tap.dropped() > count as u64 / 2, "{}", tap.dropped());
        assert!(mean < Duration::from_micros(100), "mean {mean:?}");
        assert!(longest < Duration::from_millis(500), "longest {longest:?}");
        assert_eq!(tap.clients(), 1);
        tap.close();
        let deadline = Instant::now() + Duration::from_secs(5);
        while tap.clients() > 0 && Instant::now() < deadline {
            thread::sleep(PERIOD);
        }
        assert_eq!(tap.clients(), 0);
    }
}
