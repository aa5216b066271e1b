//! The last of the stream, kept in memory for a recording that begins before its trigger.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use sample::{Arrival, CanFrame, LogTime, LossPlace, Notice, Payload, SourceId};

use crate::{Reading, RingLimits};

/// The last arrivals, and the states that lasted before the first of them.
#[derive(Debug, Default)]
pub(crate) struct Ring {
    limits: RingLimits,
    arrivals: VecDeque<Arc<Arrival>>,
    bytes: usize,
    states: BTreeMap<SourceId, Notice>,
}

impl Ring {
    pub(crate) fn set_limits(&mut self, limits: RingLimits) {
        self.limits = limits;
        self.shrink();
    }

    pub(crate) fn push(&mut self, arrival: &Arc<Arrival>) {
        if self.limits.bytes == 0 {
            see(&mut self.states, arrival);
            return;
        }
        let arrival = without_run(arrival);
        self.bytes += memory(&arrival);
        self.arrivals.push_back(arrival);
        self.shrink();
    }

    fn shrink(&mut self) {
        while let (Some(first), Some(last)) = (self.arrivals.front(), self.arrivals.back()) {
            let age_ns = u128::try_from(last.log_time - first.log_time).unwrap_or(0);
            if self.bytes <= self.limits.bytes && age_ns <= self.limits.duration.as_nanos() {
                return;
            }
            if let Some(arrival) = self.arrivals.pop_front() {
                self.bytes -= memory(&arrival);
                see(&mut self.states, &arrival);
            }
        }
    }

    pub(crate) fn first_time(&self) -> Option<LogTime> {
        self.arrivals.front().map(|first| first.log_time)
    }

    /// What is kept from `since` on, nothing with `None`, behind the open states that lasted then.
    /// These get the numbers before the first one's, which are of arrivals that are not given, and
    /// its stamps; `next_sequence` and `boundary` where there is no first one.
    pub(crate) fn since(
        &self,
        since: Option<LogTime>,
        next_sequence: u64,
        boundary: Reading,
    ) -> Vec<Arc<Arrival>> {
        let mut states = self.states.clone();
        let mut kept = Vec::new();
        for arrival in &self.arrivals {
            if since.is_some_and(|since| arrival.log_time >= since) {
                kept.push(Arc::clone(arrival));
            } else {
                see(&mut states, arrival);
            }
        }
        let (sequence, stamps) = match kept.first() {
            Some(first) => (
                first.sequence,
                Reading {
                    log_time: first.log_time,
                    realtime_ns: first.realtime_ns,
                },
            ),
            None => (next_sequence, boundary),
        };
        let count = states.len() as u64;
        let states = states.into_iter().zip(0..).map(|((source, notice), n)| {
            Arc::new(Arrival {
                sequence: (sequence + n).saturating_sub(count),
                source,
                log_time: stamps.log_time,
                realtime_ns: stamps.realtime_ns,
                payload: Payload::Notice(notice),
            })
        });
        states.chain(kept).collect()
    }

    /// Sources have other numbers from now on; those that are not named are gone.
    pub(crate) fn renumber(&mut self, numbers: &BTreeMap<SourceId, SourceId>) {
        for arrival in std::mem::take(&mut self.arrivals) {
            see(&mut self.states, &arrival);
        }
        self.bytes = 0;
        self.states = std::mem::take(&mut self.states)
            .into_iter()
            .filter_map(|(source, notice)| Some((*numbers.get(&source)?, notice)))
            .collect();
    }
}

fn see(states: &mut BTreeMap<SourceId, Notice>, arrival: &Arrival) {
    if let Payload::Notice(notice @ (Notice::Opened(_) | Notice::Closed(_))) = &arrival.payload {
        states.insert(arrival.source, notice.clone());
    }
}

/// The arrival as a later recording sees it: what an earlier one left out, it does not.
fn without_run(arrival: &Arc<Arrival>) -> Arc<Arrival> {
    let of_a_run = matches!(
        &arrival.payload,
        Payload::Notice(
            Notice::EstimatorSkipped { .. }
                | Notice::Lost {
                    place: LossPlace::Queue | LossPlace::Disk,
                    ..
                }
        )
    );
    if !of_a_run {
        return Arc::clone(arrival);
    }
    Arc::new(Arrival {
        source: SourceId::HOST,
        payload: Payload::Tick,
        ..**arrival
    })
}

/// Memory that an arrival takes, its place in the ring included.
fn memory(arrival: &Arrival) -> usize {
    let payload = match &arrival.payload {
        Payload::Bytes(bytes) => bytes.capacity(),
        Payload::Can(frames) => frames.capacity() * size_of::<CanFrame>(),
        Payload::Notice(Notice::Opened(text) | Notice::Closed(text) | Notice::Mark(text)) => {
            text.capacity()
        }
        Payload::Tick | Payload::Notice(_) => 0,
    };
    // The counters of the shared pointer and the pointer.
    size_of::<Arrival>() + 3 * size_of::<usize>() + payload
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    fn arrival(sequence: u64, payload: Payload) -> Arc<Arrival> {
        Arc::new(Arrival {
            sequence,
            source: SourceId(1),
            log_time: LogTime(sequence * 1_000_000),
            realtime_ns: 0,
            payload,
        })
    }

    fn ring(bytes: usize) -> Ring {
        let mut ring = Ring::default();
        ring.set_limits(RingLimits {
            duration: Duration::from_millis(50),
            bytes,
        });
        ring
    }

    const NOW: Reading = Reading {
        log_time: LogTime(1_000_000_000),
        realtime_ns: 7,
    };

    #[test]
    fn time_and_memory_bound_what_is_kept() {
        let mut by_time = ring(1 << 20);
        let mut by_memory = ring(2_000);
        for sequence in 0..1_000 {
            let arrival = arrival(sequence, Payload::Bytes(vec![0; 100]));
            by_time.push(&arrival);
            by_memory.push(&arrival);
            assert!(by_memory.bytes <= 2_000);
        }
        let kept = by_time.since(Some(LogTime(0)), 1_000, NOW);
        assert_eq!(kept.len(), 51);
        assert_eq!(kept[0].sequence, 949);
        let some = by_time.since(Some(LogTime(980_000_000)), 1_000, NOW);
        assert_eq!((some.len(), some[0].sequence), (20, 980));
        let few = by_memory.since(Some(LogTime(0)), 1_000, NOW);
        assert!((5..20).contains(&few.len()), "{}", few.len());
    }

    #[test]
    fn states_of_before_stand_before_what_is_kept_with_numbers_that_are_free() {
        let mut ring = ring(1 << 20);
        let opened = Payload::Notice(Notice::Opened("port".to_owned()));
        ring.push(&arrival(5, opened.clone()));
        for sequence in 6..200 {
            ring.push(&arrival(sequence, Payload::Tick));
        }
        let kept = ring.since(Some(LogTime(190_000_000)), 200, NOW);
        assert_eq!(kept[0].payload, opened);
        assert_eq!((kept[0].sequence, kept[1].sequence), (189, 190));
        assert_eq!(kept[0].log_time, kept[1].log_time);
        let none = ring.since(None, 200, NOW);
        assert_eq!((none.len(), none[0].sequence), (1, 199));
        assert_eq!(none[0].log_time, NOW.log_time);
    }

    #[test]
    fn what_an_earlier_run_lost_is_not_lost_again() {
        let mut ring = ring(1 << 20);
        let skipped = Notice::EstimatorSkipped {
            first_sequence: 1,
            count: 2,
        };
        ring.push(&arrival(3, Payload::Notice(skipped)));
        let kernel = Notice::Lost {
            place: LossPlace::Kernel,
            count: 2,
        };
        ring.push(&arrival(4, Payload::Notice(kernel.clone())));
        let kept = ring.since(Some(LogTime(0)), 5, NOW);
        assert_eq!(kept[0].payload, Payload::Tick);
        assert_eq!(kept[0].source, SourceId::HOST);
        assert_eq!(kept[1].payload, Payload::Notice(kernel));
    }

    #[test]
    fn other_numbers_keep_the_states() {
        let mut ring = ring(1 << 20);
        let opened = Notice::Opened("port".to_owned());
        ring.push(&arrival(5, Payload::Notice(opened.clone())));
        ring.renumber(&BTreeMap::from([(SourceId(1), SourceId(4))]));
        let kept = ring.since(Some(LogTime(0)), 9, NOW);
        assert_eq!(kept.len(), 1);
        assert_eq!(kept[0].source, SourceId(4));
        assert_eq!(kept[0].payload, Payload::Notice(opened));
    }
}
