//! A log that an import writes.

use engine::config::Estimator;
use engine::output::{LogFile, Target};
use engine::{Config, Entry, Feed, SILENCE_NS};
use sample::text::printable;
use sample::{LogTime, NANOS_PER_SECOND, Notice, Payload, SourceId};
use store::Record;

use super::truth::TruthPoint;

/// Interval of ticks, equal to that of the recorder, ns.
const TICK_NS: i64 = NANOS_PER_SECOND / 10;
/// Time that the log continues after the last data, so that the last estimate is computed, ns.
pub const TAIL_NS: i64 = NANOS_PER_SECOND / 20;
/// Text of the notice of a source that ended normally.
const STOPPED: &str = "stopped";

/// Records of a log.
#[derive(Default)]
pub struct Written {
    /// Decoded messages.
    pub measurements: usize,
    estimates: usize,
    /// Estimates with a motion or a force.
    known: usize,
}

impl Written {
    fn add(&mut self, record: &Record) {
        match record {
            Record::Sample(_) => self.measurements += 1,
            Record::Estimate(estimate) => {
                self.estimates += 1;
                let force_n = estimate.carrier.0.iter().flat_map(|force| force.force_n);
                let known = estimate.motion.velocity_x_m_s.is_finite()
                    || force_n.into_iter().any(f64::is_finite);
                self.known += usize::from(known);
            }
            _ => {}
        }
    }

    /// Prints how many messages and estimates the log has. `why` tells why there are no estimates.
    pub fn print(&self, config: &Config, target: &Target, why: impl FnOnce(&Estimator) -> String) {
        let path = target.path().display();
        let Some(estimator) = &config.estimator else {
            println!("{path}: {} decoded messages", self.measurements);
            println!("nothing is estimated: no vehicle was given; --vehicle FILE gives one");
            return;
        };
        println!(
            "{path}: {} decoded messages, {} of {} estimates have a motion or a force",
            self.measurements, self.known, self.estimates
        );
        if self.known == 0 {
            let name = printable(&estimator.vehicle.name);
            tracing::warn!("nothing was estimated for {name}: {}", why(estimator));
        }
    }
}

/// Log that is being written, and the feed of its engine.
pub struct Log<'t> {
    feed: Feed,
    file: LogFile,
    truth: std::iter::Peekable<std::vec::IntoIter<&'t TruthPoint>>,
    start: LogTime,
    next_tick: LogTime,
    last_data: LogTime,
    /// What was written so far.
    pub written: Written,
}

impl<'t> Log<'t> {
    /// Begins a log of these sources, whose first data are of `start`.
    pub fn create(
        config: &Config,
        names: &[&str],
        start: LogTime,
        target: &Target,
        truth: Vec<&'t TruthPoint>,
    ) -> anyhow::Result<Self> {
        let run_id = format!("import-{}-{}", names.join("-"), start.0);
        let session = engine::session::simulated(config, &run_id, start);
        Ok(Self {
            feed: Feed::new(config)?,
            file: target.log(session, config.storage.options.clone())?,
            truth: truth.into_iter().peekable(),
            start,
            next_tick: start,
            last_data: start,
            written: Written::default(),
        })
    }

    /// Writes a notice that these sources of the configuration were opened, with this text; their
    /// numbers.
    pub fn open(
        &mut self,
        config: &Config,
        names: &[&str],
        text: &str,
    ) -> anyhow::Result<Vec<SourceId>> {
        let found = names
            .iter()
            .filter_map(|name| config.sources.iter().find(|s| s.spec.name == *name));
        let ids: Vec<SourceId> = found.map(|source| source.spec.id).collect();
        for id in &ids {
            let opened = Payload::Notice(Notice::Opened(text.to_owned()));
            self.push(*id, self.start, opened)?;
        }
        Ok(ids)
    }

    /// Writes data of a source, and the ticks before them.
    pub fn push_data(
        &mut self,
        source: SourceId,
        time: LogTime,
        payload: Payload,
    ) -> anyhow::Result<()> {
        self.tick_until(time)?;
        self.push(source, time, payload)?;
        self.last_data = time;
        Ok(())
    }

    /// Writes what follows the last data.
    pub fn close(&mut self, ids: &[SourceId], end: LogTime) -> anyhow::Result<()> {
        self.tick_until(end)?;
        for id in ids {
            let closed = Payload::Notice(Notice::Closed(STOPPED.to_owned()));
            self.push(*id, end, closed)?;
        }
        self.push(SourceId::HOST, end, Payload::Tick)
    }

    /// Writes ticks until `time`. During silence, in which there are no estimates, there are no ticks,
    /// so that the size of the log depends on the size of the input only.
    fn tick_until(&mut self, time: LogTime) -> anyhow::Result<()> {
        let silent = self.last_data + (SILENCE_NS + TICK_NS);
        while self.next_tick <= time {
            if self.next_tick > silent {
                let ticks = (time - self.start) / TICK_NS;
                self.next_tick = self.start + ticks * TICK_NS;
                if self.next_tick < time {
                    self.next_tick = self.next_tick + TICK_NS;
                }
                return Ok(());
            }
            let tick = self.next_tick;
            self.push(SourceId::HOST, tick, Payload::Tick)?;
            self.next_tick = tick + TICK_NS;
        }
        Ok(())
    }

    /// Writes an arrival, and the truth before it.
    pub fn push(
        &mut self,
        source: SourceId,
        time: LogTime,
        payload: Payload,
    ) -> anyhow::Result<()> {
        while let Some(point) = self.truth.next_if(|point| point.time <= time) {
            self.file.push(Entry::Record(point.record()))?;
        }
        let (file, written) = (&mut self.file, &mut self.written);
        let mut sink = |entry: Entry| {
            if let Entry::Record(record) = &entry {
                written.add(record);
            }
            file.push(entry)
        };
        Ok(self.feed.push(source, time, payload, &mut sink)?)
    }

    /// Closes the log.
    pub fn finish(self) -> anyhow::Result<Written> {
        self.file.finish()?;
        Ok(self.written)
    }
}
