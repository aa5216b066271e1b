//! Listening to devices for some seconds, without a recording.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use acq::{LogClock, QueueSizes, Sequencer, SourceCounters, SourceSpec, Supervisor};
use sample::{Arrival, SourceId};
use store::Losses;

/// Longest time that sources may take to end.
const STOP_DEADLINE: Duration = Duration::from_secs(1);

/// What came from devices.
pub struct Heard<S> {
    /// What was made of the arrivals.
    pub state: S,
    /// Counters of each device.
    pub counters: BTreeMap<SourceId, SourceCounters>,
    /// What was lost.
    pub losses: Losses,
}

/// Opens the devices, takes each arrival for `listen_s`, and closes the devices.
pub fn listen<S: Send + 'static>(
    specs: impl IntoIterator<Item = SourceSpec>,
    listen_s: f64,
    mut state: S,
    mut take: impl FnMut(&mut S, &Arc<Arrival>) + Send + 'static,
) -> anyhow::Result<Heard<S>> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()?;
    runtime.block_on(async {
        let sizes = QueueSizes {
            estimator: 0,
            ..QueueSizes::default()
        };
        let (sequencer, mut streams) = Sequencer::new(LogClock::start(), sizes);
        let drain = tokio::spawn(async move {
            while let Some(arrival) = streams.recorder.recv().await {
                take(&mut state, &arrival);
            }
            state
        });
        let mut supervisor = Supervisor::new(sequencer.clone());
        for spec in specs {
            supervisor.spawn(spec);
        }
        tokio::time::sleep(Duration::from_secs_f64(listen_s)).await;
        let counters = sequencer.counters();
        if let Err(stuck) = supervisor.stop(STOP_DEADLINE).await {
            tracing::warn!(%stuck, "sources did not end in time and were aborted");
        }
        sequencer.finish();
        Ok(Heard {
            state: drain.await?,
            counters,
            losses: sequencer.ledger().losses(),
        })
    })
}
