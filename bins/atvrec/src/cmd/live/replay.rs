//! `atvrec replay --live`: a log for the clients of a live recorder, with pause, position and speed.

use anyhow::Context;
use engine::config::Live;
use engine::{Config, Entry, Replay, ReplayOptions};
use live::{Control, Hub, Playback, Step, Topics};
use sample::LogTime;
use store::{Reader, TapDecoder, TapEncoder, TapFrame};
use tokio::sync::watch;

use super::{block_on, settings};
use crate::cli::ReplayArgs;
use crate::exit::Outcome;

/// Time between two time frames, ns.
const TIME_NS: i64 = 50_000_000;

/// Plays logs until SIGINT or SIGTERM.
pub fn run(args: &ReplayArgs, config: Config, rate: f64) -> anyhow::Result<Outcome> {
    let reader = Reader::open(&args.logs)?;
    let span = reader.info().span.context("the log contains no data")?;
    if config.estimator.is_none() {
        tracing::warn!("the log has no vehicle: there are no estimates, only decoded data");
    }
    let playback = Playback::new([span.0, span.1], rate);
    let hub = Hub::default();
    let player = Player {
        reader,
        config,
        playback: playback.clone(),
        wanted: hub.wanted(),
        hub: hub.clone(),
    };
    let settings = settings(Live::default(), args.listen, args.token_file.as_deref())?;
    let source = async move {
        let played = tokio::task::spawn_blocking(move || player.run());
        if let Ok(Err(error)) = played.await {
            tracing::error!("the replay has ended: {error:#}");
        }
    };
    block_on(
        settings,
        hub,
        Control::default(),
        Some(playback),
        None,
        source,
    )?;
    Ok(Outcome::Good)
}

struct Player {
    reader: Reader,
    config: Config,
    playback: Playback,
    wanted: watch::Receiver<Topics>,
    hub: Hub,
}

/// A client asked for a position before the present one.
#[derive(Debug, thiserror::Error)]
#[error("the replay begins again")]
struct Back(LogTime);

impl Player {
    fn run(mut self) -> anyhow::Result<()> {
        let mut from = self.playback.state().range[0];
        loop {
            from = match self.play(from) {
                Ok(()) => self.playback.end(),
                Err(error) => match error.downcast_ref::<Back>() {
                    Some(Back(time)) => *time,
                    None => return Err(error),
                },
            };
        }
    }

    /// Plays from a log time to the end. The estimator needs the data before it, which is replayed
    /// without waiting and without being shown.
    fn play(&mut self, mut from: LogTime) -> anyhow::Result<()> {
        let options = ReplayOptions {
            truth: true,
            ..ReplayOptions::default()
        };
        let replay = Replay::new(&self.reader, &self.config, options)?;
        let mut stream = Stream::new(&self.config, replay.session(), &self.hub);
        self.wanted.mark_changed();
        self.playback.begin(from);
        let mut now = LogTime::default();
        replay.run(|entry| {
            match entry {
                Entry::Arrival(arrival) => {
                    now = arrival.log_time;
                    if now >= from {
                        match self.playback.wait(now) {
                            Step::Play => {}
                            Step::Seek(time) if time > now => {
                                from = time;
                                self.playback.begin(time);
                            }
                            Step::Seek(time) => return Err(anyhow::Error::new(Back(time))),
                        }
                    }
                    if self.wanted.has_changed().unwrap_or(false) {
                        stream
                            .encoder
                            .select(Some(self.wanted.borrow_and_update().clone()));
                    }
                    stream.time(now, &self.hub);
                }
                Entry::Record(record) if now >= from => {
                    stream.encoder.record(&record, &mut stream.bytes);
                    stream.flush(&self.hub)?;
                }
                Entry::Record(_) => {}
            }
            Ok(())
        })?;
        Ok(())
    }
}

/// Frames of the replay on their way to the hub.
struct Stream {
    encoder: TapEncoder,
    decoder: TapDecoder,
    bytes: Vec<u8>,
    timed: LogTime,
}

impl Stream {
    fn new(config: &Config, session: &store::Session, hub: &Hub) -> Self {
        let mut stream = Self {
            encoder: TapEncoder::new(session),
            decoder: TapDecoder::default(),
            bytes: Vec::new(),
            timed: LogTime::default(),
        };
        let (_, hello) = crate::session::tap(config, LogTime::default());
        stream.encoder.begin(&hello, &mut stream.bytes);
        hub.connected();
        stream
    }

    fn time(&mut self, now: LogTime, hub: &Hub) {
        if now - self.timed >= TIME_NS {
            self.timed = now;
            hub.frame(TapFrame::Time(now));
        }
    }

    fn flush(&mut self, hub: &Hub) -> anyhow::Result<()> {
        if !self.bytes.is_empty() {
            self.decoder.push(&self.bytes);
            self.bytes.clear();
            while let Some(frame) = self.decoder.next_frame()? {
                hub.frame(frame);
            }
        }
        Ok(())
    }
}
