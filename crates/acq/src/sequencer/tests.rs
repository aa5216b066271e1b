use std::collections::BTreeSet;

use proptest::prelude::*;

use sample::LossPlace;

use super::state::NOTICE_RESERVE;
use super::*;

const PORT: SourceId = SourceId(3);

fn sequencer(recorder: usize, estimator: usize) -> (Sequencer, Streams) {
    Sequencer::new(
        LogClock::start(),
        QueueSizes {
            recorder,
            estimator,
        },
    )
}

fn drain(queue: &mut mpsc::Receiver<Arc<Arrival>>) -> Vec<Arc<Arrival>> {
    std::iter::from_fn(|| queue.try_recv().ok()).collect()
}

/// What the ledger holds of [`PORT`].
fn lost(sequencer: &Sequencer) -> [u64; LossPlace::ALL.len()] {
    sequencer.ledger().losses().of(PORT)
}

fn bytes(value: u8) -> Payload {
    Payload::Bytes(vec![value])
}

#[test]
fn threads_get_one_order_without_gaps() {
    let (sequencer, mut streams) = sequencer(10_000, 10_000);
    let threads: Vec<_> = (0..4)
        .map(|source| {
            let sequencer = sequencer.clone();
            std::thread::spawn(move || {
                for value in 0..500 {
                    sequencer.push(SourceId(source), bytes(value as u8));
                }
            })
        })
        .collect();
    for thread in threads {
        thread.join().expect("pushing does not panic");
    }
    let recorded = drain(&mut streams.recorder);
    assert_eq!(recorded.len(), 2000);
    for (index, pair) in recorded.windows(2).enumerate() {
        assert_eq!(pair[0].sequence, index as u64);
        assert!(pair[0].log_time <= pair[1].log_time);
    }
    let estimated = drain(streams.estimator.as_mut().expect("a queue"));
    assert_eq!(recorded, estimated);
}

#[test]
fn a_full_recorder_queue_counts_and_reports() {
    let (sequencer, mut streams) = sequencer(8, 0);
    for value in 0..20 {
        sequencer.push(PORT, bytes(value));
    }
    let kept = drain(&mut streams.recorder);
    assert_eq!(kept.len(), 8);
    sequencer.push(PORT, bytes(99));
    let after = drain(&mut streams.recorder);
    assert_eq!(
        after[0].payload,
        Payload::Notice(Notice::Lost {
            place: LossPlace::Queue,
            count: 12
        })
    );
    assert_eq!(after[0].sequence, 20);
    assert_eq!(after[1].payload, bytes(99));
    assert_eq!(lost(&sequencer), [0, 0, 12, 0]);
    assert_eq!(sequencer.counters()[&PORT].items, 21);
}

#[test]
fn a_notice_of_loss_that_is_itself_lost_is_told_again_and_counted_once() {
    let (sequencer, mut streams) = sequencer(2, 0);
    sequencer.push(PORT, bytes(0));
    sequencer.push(PORT, bytes(0));
    for _ in 0..NOTICE_RESERVE {
        sequencer.mark("no room behind this");
    }
    let (place, count) = (LossPlace::Kernel, 5);
    sequencer.notice(PORT, Notice::Lost { place, count });
    assert_eq!(lost(&sequencer), [0, count, 0, 0]);
    assert_eq!(drain(&mut streams.recorder).len(), 2 + NOTICE_RESERVE);
    sequencer.push(PORT, bytes(1));
    let after = drain(&mut streams.recorder);
    assert_eq!(
        after[0].payload,
        Payload::Notice(Notice::Lost { place, count })
    );
    assert_eq!(after[1].payload, bytes(1));
    assert_eq!(after.len(), 2);
    assert_eq!(lost(&sequencer), [0, count, 0, 0]);
}

#[test]
fn notices_pass_a_full_queue() {
    let (sequencer, mut streams) = sequencer(1, 0);
    sequencer.push(PORT, bytes(0));
    sequencer.push(PORT, bytes(1));
    sequencer.mark("gravel");
    let kept = drain(&mut streams.recorder);
    assert_eq!(
        kept.last().expect("a mark").payload,
        Payload::Notice(Notice::Mark("gravel".to_owned()))
    );
}

#[test]
fn a_slow_estimator_is_told_what_it_missed_and_the_recorder_too() {
    let (sequencer, mut streams) = sequencer(100, 4);
    for value in 0..10 {
        sequencer.push(PORT, bytes(value));
    }
    let queue = streams.estimator.as_mut().expect("a queue");
    assert_eq!(drain(queue).len(), 4);
    sequencer.push(PORT, bytes(10));
    let seen = drain(queue);
    let expected = Payload::Notice(Notice::EstimatorSkipped {
        first_sequence: 4,
        count: 6,
    });
    assert_eq!(seen[0].payload, expected);
    assert_eq!(seen[0].sequence, 10);
    assert_eq!(seen[1].sequence, 11);
    let recorded = drain(&mut streams.recorder);
    assert_eq!(recorded.len(), 12);
    assert_eq!(recorded[10].payload, expected);
}

#[test]
fn an_estimator_that_died_is_told_of_at_the_end() {
    let (sequencer, mut streams) = sequencer(100, 4);
    sequencer.push(PORT, bytes(0));
    streams.estimator = None;
    sequencer.push(PORT, bytes(1));
    sequencer.push(PORT, bytes(2));
    sequencer.finish();
    let recorded = drain(&mut streams.recorder);
    assert_eq!(
        recorded.last().expect("a notice").payload,
        Payload::Notice(Notice::EstimatorSkipped {
            first_sequence: 1,
            count: 3
        })
    );
    assert!(streams.recorder.blocking_recv().is_none());
}

/// While sources push without a pause, the stream changes hands again and again: every arrival
/// is in exactly one run, and both consumers of a run get the same.
#[test]
fn the_stream_changes_hands_between_two_arrivals() {
    let sizes = QueueSizes {
        recorder: 100_000,
        estimator: 100_000,
    };
    let (sequencer, first) = sequencer(sizes.recorder, sizes.estimator);
    let mut runs = vec![first];
    let threads: Vec<_> = (0..4)
        .map(|source| {
            let sequencer = sequencer.clone();
            std::thread::spawn(move || {
                for value in 0..5_000 {
                    sequencer.push(SourceId(source), bytes(value as u8));
                }
            })
        })
        .collect();
    while threads.iter().any(|thread| !thread.is_finished()) {
        runs.push(sequencer.begin(sizes, None, &BTreeMap::new()));
    }
    for thread in threads {
        thread.join().expect("pushing does not panic");
    }
    sequencer.finish();
    let mut next = 0;
    for mut run in runs {
        assert_eq!(run.backlog, []);
        let recorded = drain(&mut run.recorder);
        assert_eq!(recorded, drain(run.estimator.as_mut().expect("a queue")));
        for arrival in recorded {
            assert_eq!(arrival.sequence, next);
            next += 1;
        }
    }
    assert_eq!(next, 20_000);
}

#[test]
fn nothing_lies_between_what_was_kept_and_what_comes() {
    let sequencer = Sequencer::idle(LogClock::start());
    sequencer.keep(RingLimits {
        duration: std::time::Duration::from_secs(60),
        bytes: 1 << 20,
    });
    sequencer.notice(PORT, Notice::Opened("port".to_owned()));
    for value in 0..10 {
        sequencer.push(PORT, bytes(value));
    }
    let since = sequencer.kept_since().expect("something is kept");
    let sizes = QueueSizes::default();
    let mut run = sequencer.begin(sizes, Some(since), &BTreeMap::new());
    sequencer.push(PORT, bytes(10));
    sequencer.pause();
    sequencer.push(PORT, bytes(11));
    let mut all = run.backlog.clone();
    all.extend(drain(&mut run.recorder));
    let numbers: Vec<u64> = all.iter().map(|arrival| arrival.sequence).collect();
    assert_eq!(numbers, (0..12).collect::<Vec<_>>());
    // What came while nobody recorded is in the next run's memory, and is not lost.
    assert_eq!(lost(&sequencer), [0; 4]);
    let next = sequencer.begin(sizes, Some(since), &BTreeMap::new());
    assert_eq!(next.backlog.last().expect("kept").payload, bytes(11));
}

#[test]
fn a_listener_that_lags_or_goes_disturbs_nobody() {
    let (sequencer, mut streams) = sequencer(100, 0);
    let mut small = sequencer.listen(2);
    drop(sequencer.listen(2));
    for value in 0..5 {
        sequencer.push(PORT, bytes(value));
    }
    assert_eq!(drain(&mut small).len(), 2);
    assert_eq!(sequencer.missed(), 3);
    assert_eq!(drain(&mut streams.recorder).len(), 5);
}

#[test]
fn sources_get_their_new_numbers_at_the_boundary_and_their_counters_go_along() {
    let (sequencer, mut old) = sequencer(100, 0);
    sequencer.notice(PORT, Notice::Opened("port".to_owned()));
    sequencer.push(SourceId(1), bytes(1));
    let numbers = BTreeMap::from([(PORT, Some(SourceId(1))), (SourceId(1), None)]);
    let mut new = sequencer.begin(QueueSizes::default(), None, &numbers);
    sequencer.push(PORT, bytes(2));
    sequencer.push(SourceId(1), bytes(3));
    let opened = &new.backlog[0];
    assert_eq!(opened.source, SourceId(1));
    let after = drain(&mut new.recorder);
    assert_eq!(after.len(), 1);
    assert_eq!(
        (after[0].source, &after[0].payload),
        (SourceId(1), &bytes(2))
    );
    assert_eq!(sequencer.counters()[&SourceId(1)].arrivals, 2);
    assert!(sequencer.counters()[&SourceId(1)].open);
    assert_eq!(drain(&mut old.recorder).len(), 2);
}

#[derive(Clone, Copy, Debug)]
enum Step {
    Push(u8),
    Record(u8),
    Estimate(u8),
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    let step = prop_oneof![
        (0_u8..20).prop_map(Step::Push),
        (0_u8..20).prop_map(Step::Record),
        (0_u8..20).prop_map(Step::Estimate),
    ];
    proptest::collection::vec(step, 0..60)
}

proptest! {
    /// However the consumers lag: data pushed is data recorded plus data reported lost, and
    /// every arrival is either seen by the estimator or within exactly one run that the
    /// recorder knows of.
    #[test]
    fn nothing_is_lost_in_silence(
        steps in steps(),
        recorder in 1_usize..30,
        estimator in 1_usize..10,
    ) {
        let (sequencer, mut streams) = sequencer(recorder, estimator);
        let mut queue = streams.estimator.take().expect("a queue");
        let (mut recorded, mut seen, mut pushed) = (Vec::new(), BTreeSet::new(), 0_u64);
        for step in steps {
            match step {
                Step::Push(count) => {
                    pushed += u64::from(count);
                    for value in 0..count {
                        sequencer.push(SourceId(u16::from(value % 3)), bytes(value));
                    }
                }
                Step::Record(count) => {
                    for _ in 0..count {
                        recorded.extend(streams.recorder.try_recv());
                    }
                }
                Step::Estimate(count) => {
                    for _ in 0..count {
                        seen.extend(queue.try_recv().map(|arrival| arrival.sequence));
                    }
                }
            }
        }
        sequencer.finish();
        recorded.extend(drain(&mut streams.recorder));
        seen.extend(drain(&mut queue).iter().map(|arrival| arrival.sequence));

        let (mut kept, mut lost) = (0, 0);
        let mut skipped = BTreeSet::new();
        for arrival in &recorded {
            match &arrival.payload {
                Payload::Bytes(_) => kept += 1,
                Payload::Notice(Notice::Lost { count, .. }) => lost += count,
                Payload::Notice(Notice::EstimatorSkipped { first_sequence, count }) => {
                    for sequence in *first_sequence..first_sequence + count {
                        prop_assert!(skipped.insert(sequence), "told twice: {}", sequence);
                    }
                }
                _ => {}
            }
        }
        prop_assert_eq!(kept + lost, pushed);
        prop_assert!(seen.is_disjoint(&skipped));
        let all: BTreeSet<u64> = (0..sequencer.next_sequence()).collect();
        prop_assert_eq!(&seen | &skipped, all);
    }
}
