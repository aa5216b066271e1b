//! Channels and messages of the recorder, and who wants which.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use sample::LogTime;
use serde_json::Value;
use store::{ChannelInfo, TapFrame, TapMessage};
use tokio::sync::{Notify, watch};

/// Most messages that wait for a client; then the oldest is dropped and counted.
const QUEUE: usize = 2_048;
/// Distance of the channel numbers of two connections to a recorder.
const NUMBERS: u64 = 1 << 16;

/// Topics that somebody wants.
pub type Topics = BTreeSet<String>;

/// Passes messages from one source to all subscribers. Clones share it.
#[derive(Clone, Default)]
pub struct Hub(Arc<Shared>);

struct Shared {
    state: Mutex<State>,
    /// Topics that any subscriber wants.
    wanted: watch::Sender<Topics>,
}

impl Default for Shared {
    fn default() -> Self {
        Self {
            state: Mutex::default(),
            wanted: watch::Sender::new(Topics::new()),
        }
    }
}

#[derive(Default)]
struct State {
    channels: BTreeMap<u64, Arc<ChannelInfo>>,
    /// Number of the connection to the source.
    connection: u64,
    is_connected: bool,
    hello: Arc<Value>,
    lost: u64,
    time: Option<(LogTime, Instant)>,
    subscribers: Vec<Arc<Inbox>>,
}

/// Messages that wait for one subscriber.
#[derive(Default)]
struct Inbox {
    topics: Mutex<Topics>,
    messages: Mutex<VecDeque<Arc<Received>>>,
    dropped: AtomicU64,
    notify: Notify,
}

/// A message with its channel.
pub struct Received {
    /// Number of the channel.
    pub channel: u64,
    /// The channel.
    pub info: Arc<ChannelInfo>,
    /// The message.
    pub message: TapMessage,
}

/// What is known of the source.
#[derive(Clone, Debug, Default)]
pub struct SourceState {
    /// Whether there is a connection.
    pub is_connected: bool,
    /// What the source says of itself.
    pub hello: Arc<Value>,
    /// Records that the source dropped because this process was slow.
    pub lost: u64,
    /// Log time of the source now; `None` before the first connection.
    pub now: Option<LogTime>,
}

impl Hub {
    /// Begins a connection to the source: earlier channels end.
    pub fn connected(&self) {
        let mut state = self.state();
        state.channels.clear();
        state.connection += 1;
        state.is_connected = true;
        state.lost = 0;
        wake(&state);
    }

    /// The connection to the source has ended.
    pub fn disconnected(&self) {
        let mut state = self.state();
        state.is_connected = false;
        wake(&state);
    }

    /// Takes a frame of the source.
    pub fn frame(&self, frame: TapFrame) {
        let mut state = self.state();
        match frame {
            TapFrame::Channel(channel) => {
                let number = state.connection * NUMBERS + u64::from(channel.id);
                let topic = &channel.info.topic;
                // A topic whose schema has grown continues in a new channel.
                state.channels.retain(|_, known| {
                    known.topic != *topic || known.source != channel.info.source
                });
                state.channels.insert(number, channel.info);
                wake(&state);
            }
            TapFrame::Message(message) => {
                let channel = state.connection * NUMBERS + u64::from(message.channel);
                let Some(info) = state.channels.get(&channel).map(Arc::clone) else {
                    return;
                };
                let received = Arc::new(Received {
                    channel,
                    info,
                    message,
                });
                for inbox in &state.subscribers {
                    inbox.push(&received);
                }
            }
            TapFrame::Lost(count) => state.lost = count,
            TapFrame::Time(now) => state.time = Some((now, Instant::now())),
            TapFrame::Hello(text) => {
                state.hello = Arc::new(serde_json::from_str(&text).unwrap_or_default());
            }
        }
    }

    /// What is known of the source.
    #[must_use]
    pub fn source(&self) -> SourceState {
        let state = self.state();
        SourceState {
            is_connected: state.is_connected,
            hello: Arc::clone(&state.hello),
            lost: state.lost,
            now: state.time.map(|(time, at)| match state.is_connected {
                true => time.offset_seconds(at.elapsed().as_secs_f64().min(0.5)),
                false => time,
            }),
        }
    }

    /// All channels by their numbers, which differ between connections to the source.
    #[must_use]
    pub fn channels(&self) -> BTreeMap<u64, Arc<ChannelInfo>> {
        self.state().channels.clone()
    }

    /// Adds a subscriber, which wants no topic so far.
    #[must_use]
    pub fn subscribe(&self) -> Subscriber {
        let inbox = Arc::new(Inbox::default());
        self.state().subscribers.push(Arc::clone(&inbox));
        Subscriber {
            hub: self.clone(),
            inbox,
        }
    }

    /// Topics that any subscriber wants, and their changes.
    #[must_use]
    pub fn wanted(&self) -> watch::Receiver<Topics> {
        self.0.wanted.subscribe()
    }

    fn count_wanted(&self) {
        let state = self.state();
        let inboxes = state.subscribers.iter();
        let all = inboxes.flat_map(|inbox| lock(&inbox.topics).clone());
        let all: Topics = all.collect();
        self.0.wanted.send_if_modified(|wanted| {
            let differs = *wanted != all;
            *wanted = all;
            differs
        });
    }

    fn state(&self) -> MutexGuard<'_, State> {
        lock(&self.0.state)
    }
}

impl Inbox {
    fn push(&self, received: &Arc<Received>) {
        if !lock(&self.topics).contains(&received.info.topic) {
            return;
        }
        let mut messages = lock(&self.messages);
        if messages.len() == QUEUE {
            messages.pop_front();
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
        messages.push_back(Arc::clone(received));
        self.notify.notify_one();
    }
}

fn wake(state: &State) {
    for inbox in &state.subscribers {
        inbox.notify.notify_one();
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Receives the messages of the topics that it wants, until it is dropped.
pub struct Subscriber {
    hub: Hub,
    inbox: Arc<Inbox>,
}

impl Subscriber {
    /// Sets the wanted topics.
    pub fn want(&self, topics: Topics) {
        *lock(&self.inbox.topics) = topics;
        self.hub.count_wanted();
    }

    /// Waits for messages, new channels, or a change of the connection.
    pub async fn changed(&self) {
        self.inbox.notify.notified().await;
    }

    /// The messages that wait.
    #[must_use]
    pub fn take(&self) -> VecDeque<Arc<Received>> {
        std::mem::take(&mut *lock(&self.inbox.messages))
    }

    /// Messages that were dropped because this subscriber was slow.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.inbox.dropped.load(Ordering::Relaxed)
    }
}

impl Drop for Subscriber {
    fn drop(&mut self) {
        let inbox = &self.inbox;
        self.hub
            .state()
            .subscribers
            .retain(|known| !Arc::ptr_eq(known, inbox));
        self.hub.count_wanted();
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use store::{Record, Session, TapDecoder, TapEncoder};

    use super::*;

    /// Frames of records.
    pub(crate) fn frames(records: &[Record]) -> Vec<TapFrame> {
        let mut encoder = TapEncoder::new(&Session::default());
        encoder.select(None);
        let mut bytes = Vec::new();
        encoder.begin("{\"vehicle\":\"test\"}", &mut bytes);
        for record in records {
            encoder.record(record, &mut bytes);
        }
        let mut decoder = TapDecoder::default();
        decoder.push(&bytes);
        std::iter::from_fn(|| decoder.next_frame().expect("valid")).collect()
    }

    pub(crate) fn mark(time: u64) -> Record {
        Record::Mark {
            time: LogTime(time),
            text: "gravel".to_owned(),
        }
    }

    #[test]
    fn subscribers_get_what_they_want_and_lose_the_oldest() {
        let hub = Hub::default();
        let (marks, none) = (hub.subscribe(), hub.subscribe());
        let mut wanted = hub.wanted();
        marks.want(Topics::from(["/mark".to_owned()]));
        assert!(wanted.has_changed().expect("open"));
        assert_eq!(wanted.borrow_and_update().len(), 1);
        hub.connected();
        let many: Vec<Record> = (0..3_000).map(mark).collect();
        for frame in frames(&many) {
            hub.frame(frame);
        }
        let found = marks.take();
        assert_eq!(found.len(), QUEUE);
        assert_eq!(found[0].message.log_time, LogTime(3_000 - QUEUE as u64));
        assert_eq!(marks.dropped(), 3_000 - QUEUE as u64);
        assert!(none.take().is_empty());
        drop(marks);
        assert!(wanted.borrow_and_update().is_empty());
    }

    #[test]
    fn a_new_connection_has_new_channels() {
        let hub = Hub::default();
        let all = frames(&[]);
        let mut numbers = Vec::new();
        for _ in 0..2 {
            hub.connected();
            all.iter().for_each(|frame| hub.frame(frame.clone()));
            numbers.push(hub.channels().into_keys().collect::<Vec<_>>());
            assert!(hub.source().is_connected);
        }
        assert!(numbers[0].iter().all(|number| !numbers[1].contains(number)));
        assert_eq!(hub.source().hello["vehicle"], "test");
    }
}
