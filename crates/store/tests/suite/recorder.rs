//! The recorder's threads: rotation, losses, disks that fail.

#![allow(
    clippy::disallowed_types,
    clippy::disallowed_methods,
    reason = "it times the recorder and starts itself with a variable set"
)]

use std::path::PathBuf;
use std::time::{Duration, Instant};

use atvrec_store::{
    DiskState, Missing, Options, Reader, Record, Recorder, RecorderSummary, Selection,
};
use sample::{Arrival, LossPlace, Notice, Payload};

use crate::common::{START, arrivals, estimate, session};

fn paths(summary: &RecorderSummary) -> Vec<PathBuf> {
    summary.files.iter().map(|file| file.path.clone()).collect()
}

fn read(paths: &[PathBuf]) -> Vec<Arrival> {
    let mut stream = Reader::open(paths).expect("a run").arrivals();
    let arrivals = stream.by_ref().collect::<Result<_, _>>().expect("readable");
    assert_eq!(stream.missing(), []);
    arrivals
}

fn push_all(recorder: &Recorder, arrivals: &[Arrival]) {
    for arrival in arrivals {
        assert!(recorder.push(arrival.clone()));
    }
}

#[test]
fn files_rotate_without_a_gap_and_explain_themselves() {
    let directory = tempfile::tempdir().expect("a directory");
    let options = Options {
        rotate_after: Some(Duration::from_secs(1)),
        ..Options::default()
    };
    let recorder =
        Recorder::start(directory.path(), "run", session(), options).expect("a recorder");
    let written = arrivals(21, 4_000);
    push_all(&recorder, &written);
    recorder.record(Record::Estimate(Box::new(estimate(START))));
    let summary = recorder.finish().expect("finished");
    let paths = paths(&summary);
    assert!(paths.len() >= 4, "{paths:?}");
    assert_eq!(read(&paths), written);
    assert_eq!(summary.losses.arrivals, 0);
    for path in &paths {
        let reader = Reader::open([path]).expect("a log");
        assert_eq!(reader.attachments().expect("readable").len(), 1);
        let other = |missing: &Missing| !matches!(missing, Missing::Parts { .. });
        assert!(!reader.info().missing.iter().any(other));
    }
    // Each file repeats the latched states.
    let last = Reader::open([paths.last().expect("a file")]).expect("a log");
    assert!(last.info().channels["/notice"].1 >= 1);
    let first = last.arrivals().next().expect("one").expect("readable");
    assert!(first.sequence > 0);
}

#[test]
fn rotation_can_be_asked_for() {
    let directory = tempfile::tempdir().expect("a directory");
    let recorder =
        Recorder::start(directory.path(), "run", session(), Options::default()).expect("started");
    let written = arrivals(22, 100);
    push_all(&recorder, &written[..50]);
    recorder.rotate();
    push_all(&recorder, &written[50..]);
    let summary = recorder.finish().expect("finished");
    assert_eq!(summary.files.len(), 2);
    assert_eq!(read(&paths(&summary)), written);
}

/// The file after a rotation begins with the states that last: they alone are not worth a log.
#[test]
fn a_file_cut_just_behind_its_rotation_is_removed() {
    let directory = tempfile::tempdir().expect("a directory");
    let recorder =
        Recorder::start(directory.path(), "run", session(), Options::default()).expect("started");
    push_all(&recorder, &arrivals(22, 200));
    wait_until(|| recorder.status().waiting == 0);
    recorder.rotate();
    let second = atvrec_store::part_path(directory.path(), "run", 1);
    wait_until(|| recorder.status().disk == DiskState::Writing(second.clone()));
    let copies = tempfile::tempdir().expect("a directory");
    let copy = copies.path().join("run_0001.mcap.active");
    std::fs::copy(directory.path().join("run_0001.mcap.active"), &copy).expect("copied");
    let begun = Reader::open([&copy]).expect("a log");
    assert!(begun.info().channels["/notice"].1 >= 1);
    assert!(atvrec_store::recover(&copy).expect("recovered").was_empty);
    let left = std::fs::read_dir(copies.path()).expect("readable");
    assert_eq!(left.count(), 0);
    recorder.finish().expect("finished");
}

/// A file that could not be given its name used to take the file after it down: that one was
/// abandoned though nothing was wrong with it.
#[test]
fn a_name_that_cannot_be_given_is_tried_again_and_the_next_file_goes_on() {
    let directory = tempfile::tempdir().expect("a directory");
    let options = Options {
        sync_interval: Duration::from_millis(20),
        ..Options::default()
    };
    let recorder = Recorder::start(directory.path(), "run", session(), options).expect("started");
    // A folder stands where the first file's name is to be.
    let taken = atvrec_store::part_path(directory.path(), "run", 0);
    std::fs::create_dir_all(taken.join("full")).expect("a folder");
    let written = arrivals(31, 300);
    push_all(&recorder, &written[..100]);
    recorder.rotate();
    let second = atvrec_store::part_path(directory.path(), "run", 1);
    wait_until(|| recorder.status().disk == DiskState::Writing(second.clone()));
    push_all(&recorder, &written[100..200]);
    wait_until(|| recorder.status().waiting == 0);
    std::thread::sleep(Duration::from_millis(200));
    assert_eq!(recorder.status().disk, DiskState::Writing(second.clone()));
    std::fs::remove_dir_all(&taken).expect("removed");
    wait_until(|| taken.is_file());
    push_all(&recorder, &written[200..]);
    let summary = recorder.finish().expect("finished");
    assert_eq!(paths(&summary), [taken, second]);
    assert_eq!(summary.unfinished, Vec::<PathBuf>::new());
    assert_eq!(read(&paths(&summary)), written);
}

/// A disk that failed while a file was being made used to leave that file in the way of every further
/// attempt.
#[test]
fn a_name_that_is_taken_is_passed_over() {
    let directory = tempfile::tempdir().expect("a directory");
    let options = Options {
        retry_interval: Duration::from_millis(10),
        ..Options::default()
    };
    let recorder = Recorder::start(directory.path(), "run", session(), options).expect("started");
    let taken = directory.path().join("run_0001.mcap.active");
    std::fs::write(&taken, "").expect("written");
    let written = arrivals(31, 200);
    push_all(&recorder, &written[..100]);
    recorder.rotate();
    let next = atvrec_store::part_path(directory.path(), "run", 2);
    wait_until(|| recorder.status().disk == DiskState::Writing(next.clone()));
    push_all(&recorder, &written[100..]);
    let summary = recorder.finish().expect("finished");
    assert_eq!(read(&paths(&summary)), written);
    assert!(taken.exists());
}

/// The files that a killed process leaves are readable up to the last interval.
#[test]
fn a_run_that_is_not_finished_is_on_disk_but_for_the_last_moment() {
    let directory = tempfile::tempdir().expect("a directory");
    let recorder =
        Recorder::start(directory.path(), "run", session(), Options::default()).expect("started");
    let written = arrivals(23, 2_000);
    push_all(&recorder, &written);
    wait_until(|| recorder.status().waiting == 0);
    // Idle, the recorder hands on what it holds; then copy what a kill would leave.
    let active = directory.path().join("run_0000.mcap.active");
    let copies = tempfile::tempdir().expect("a directory");
    let copy = copies.path().join("run_0000.mcap.active");
    let mut saved = Vec::new();
    wait_until(|| {
        for entry in std::fs::read_dir(directory.path()).expect("readable") {
            let path = entry.expect("an entry").path();
            let name = path.file_name().expect("a name");
            std::fs::copy(&path, copies.path().join(name)).expect("copied");
        }
        let _ = std::fs::remove_file(copies.path().join("run_0000.mcap"));
        let recovered = atvrec_store::recover(&copy).expect("recovered");
        if recovered.was_empty {
            return false;
        }
        saved = read(&[recovered.path]);
        saved.len() == written.len()
    });
    assert_eq!(saved, written);
    assert!(active.exists());
    recorder.finish().expect("finished");
}

/// Environment variable that makes the test below the process that is killed.
const VICTIM: &str = "ATVREC_TEST_VICTIM";
/// Kills, each at another size of the run.
const ROUNDS: u64 = 8;
/// What waits for the writer at most, so that a busy machine loses no more than a free one.
const VICTIM_QUEUE: usize = 64;
/// Arrivals of the test's run are less than this apart on the log clock.
const ARRIVAL_SPACING_NANOS: i64 = 3_000_000;

/// File beside the run's directory that holds the sequence of the last arrival that was taken.
const PUSHED: &str = "pushed";
/// More than are written before the last kill.
const VICTIM_ARRIVALS: u64 = 40_000;

/// Kills at odd moments: the run is whole up to the last moments, without a gap. What is lost is
/// what waited for the writer, and what the journal had not taken.
#[test]
fn a_killed_run_is_recovered_without_a_gap() {
    if let Some(directory) = std::env::var_os(VICTIM) {
        record_until_killed(directory.as_ref());
    }
    let all = arrivals(99, VICTIM_ARRIVALS);
    let journal_interval = Options::default().journal_interval.expect("a journal");
    // Two more: one in the writer's hands, one that closed the journal's interval.
    let lost_max_nanos =
        journal_interval.as_nanos() as i64 + (VICTIM_QUEUE as i64 + 2) * ARRIVAL_SPACING_NANOS;
    let mut from_journals = 0;
    for round in 0..ROUNDS {
        let place = tempfile::tempdir().expect("a directory");
        let directory = place.path().join("logs");
        std::fs::create_dir(&directory).expect("made");
        let this = std::env::current_exe().expect("a test binary");
        let mut victim = std::process::Command::new(this)
            .args([
                "--exact",
                "recorder::a_killed_run_is_recovered_without_a_gap",
            ])
            .env(VICTIM, place.path())
            .stdout(std::process::Stdio::null())
            .spawn()
            .expect("started");
        let wanted = 8_000 + 17_000 * round;
        wait_until(|| bytes_in(&directory) > wanted);
        victim.kill().expect("killed");
        victim.wait().expect("gone");
        let pushed = std::fs::read(place.path().join(PUSHED)).expect("it pushed");
        let pushed = u64::from_le_bytes(pushed.try_into().expect("a number"));
        for (_, result) in atvrec_store::recover_directory(&directory).expect("readable") {
            from_journals += result.expect("recovered").arrivals_of_journal;
        }
        let entries = std::fs::read_dir(&directory).expect("readable");
        let files: Vec<PathBuf> = entries
            .filter_map(|entry| Some(entry.ok()?.path()))
            .collect();
        assert!(
            files
                .iter()
                .all(|path| path.extension() == Some("mcap".as_ref())),
            "journals and unfinished files are gone: {files:?}"
        );
        let saved = read(&files);
        assert!(!saved.is_empty(), "round {round} saved nothing");
        assert_eq!(saved, all[..saved.len()]);
        let lost = all[pushed as usize].log_time - all[saved.len() - 1].log_time;
        assert!(
            lost <= lost_max_nanos,
            "{lost} ns of round {round} are lost"
        );
        let counters = Reader::open(&files).expect("a run").info().counters;
        assert_eq!(counters["arrivals"], saved.len() as u64);
    }
    assert!(from_journals > 0, "no kill met an open group");
}

fn bytes_in(directory: &std::path::Path) -> u64 {
    std::fs::read_dir(directory)
        .expect("readable")
        .filter_map(|entry| Some(entry.ok()?.metadata().ok()?.len()))
        .sum()
}

fn record_until_killed(place: &std::path::Path) -> ! {
    use std::os::unix::fs::FileExt as _;
    let options = Options {
        rotate_bytes: Some(60_000),
        sync_interval: Duration::from_millis(20),
        queue_capacity: VICTIM_QUEUE,
        ..Options::default()
    };
    let run = arrivals(99, VICTIM_ARRIVALS);
    let recorder =
        Recorder::start(&place.join("logs"), "run", session(), options).expect("started");
    let pushed = std::fs::File::create(place.join(PUSHED)).expect("made");
    for arrival in run {
        while recorder.status().waiting >= VICTIM_QUEUE {
            std::thread::sleep(Duration::from_micros(200));
        }
        let sequence = arrival.sequence;
        assert!(recorder.push(arrival), "there was room");
        pushed
            .write_all_at(&sequence.to_le_bytes(), 0)
            .expect("written");
        if sequence % 50 == 49 {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
    unreachable!("it is killed long before");
}

fn wait_until(mut done: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !done() {
        assert!(begin.elapsed() < Duration::from_secs(20), "it never came");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Moves the folder of the logs away and puts a file in its place: no new file can be made there.
fn take_folder_away(directory: &std::path::Path, away: &std::path::Path) {
    std::fs::rename(directory, away).expect("moved");
    std::fs::write(directory, "").expect("written");
}

#[test]
fn a_disk_that_comes_back_gets_what_was_kept() {
    let parent = tempfile::tempdir().expect("a directory");
    let directory = parent.path().join("logs");
    let away = parent.path().join("away");
    std::fs::create_dir(&directory).expect("made");
    let options = Options {
        retry_interval: Duration::from_millis(10),
        ..Options::default()
    };
    let recorder = Recorder::start(&directory, "run", session(), options).expect("started");
    let written = arrivals(24, 600);
    push_all(&recorder, &written[..200]);
    wait_until(|| recorder.status().waiting == 0);
    take_folder_away(&directory, &away);
    recorder.rotate();
    push_all(&recorder, &written[200..400]);
    wait_until(|| matches!(recorder.status().disk, DiskState::Failing { .. }));
    std::fs::remove_file(&directory).expect("removed");
    std::fs::rename(&away, &directory).expect("moved");
    wait_until(|| matches!(recorder.status().disk, DiskState::Writing(_)));
    push_all(&recorder, &written[400..]);
    let summary = recorder.finish().expect("finished");
    assert_eq!(summary.losses.arrivals, 0);
    assert!(summary.last_failure.is_some());
    let mut files = paths(&summary);
    for (_, result) in atvrec_store::recover_directory(&directory).expect("readable") {
        files.push(result.expect("recovered").path);
    }
    assert_eq!(read(&files), written);
}

/// With a backlog of ten, the rest is lost, and counted to the last one.
#[test]
fn a_disk_that_stays_away_costs_what_is_counted() {
    let parent = tempfile::tempdir().expect("a directory");
    let directory = parent.path().join("logs");
    std::fs::create_dir(&directory).expect("made");
    let options = Options {
        retry_interval: Duration::from_secs(3600),
        backlog_capacity: 10,
        ..Options::default()
    };
    let recorder = Recorder::start(&directory, "run", session(), options).expect("started");
    let written = arrivals(25, 300);
    push_all(&recorder, &written[..100]);
    wait_until(|| recorder.status().waiting == 0);
    take_folder_away(&directory, &parent.path().join("away"));
    recorder.rotate();
    wait_until(|| matches!(recorder.status().disk, DiskState::Failing { .. }));
    push_all(&recorder, &written[100..]);
    let summary = recorder.finish().expect("finished");
    assert_eq!(summary.losses.arrivals, 200);
    let active = parent.path().join("away/run_0000.mcap.active");
    let recovered = atvrec_store::recover(&active).expect("recovered");
    assert_eq!(read(&[recovered.path]), written[..100]);
}

/// The recorder wrote on into the deleted file: status "writing", nothing recorded, nothing lost.
#[test]
fn a_deleted_log_is_noticed_within_a_second_and_counted() {
    for folder_too in [false, true] {
        let parent = tempfile::tempdir().expect("a directory");
        let directory = parent.path().join("logs");
        std::fs::create_dir(&directory).expect("made");
        let recorder =
            Recorder::start(&directory, "run", session(), Options::default()).expect("started");
        let written = arrivals(41, 3_000);
        // What is synced when the next group is written is not in memory any more.
        push_all(&recorder, &written[..1_000]);
        wait_until(|| recorder.status().waiting == 0);
        std::thread::sleep(Duration::from_millis(1_200));
        push_all(&recorder, &written[1_000..2_000]);
        wait_until(|| recorder.status().waiting == 0);
        if folder_too {
            std::fs::remove_dir_all(&directory).expect("removed");
        } else {
            std::fs::remove_file(directory.join("run_0000.mcap.active")).expect("removed");
        }
        let begin = Instant::now();
        let second = atvrec_store::part_path(&directory, "run", 1);
        wait_until(|| recorder.status().disk == DiskState::Writing(second.clone()));
        assert!(begin.elapsed() < Duration::from_secs(1));
        assert_eq!(recorder.status().gone.len(), 1);
        push_all(&recorder, &written[2_000..]);
        let summary = recorder.finish().expect("finished");
        let saved = read(&paths(&summary));
        assert_eq!(saved, written[3_000 - saved.len()..]);
        assert_eq!(summary.losses.arrivals as usize, 3_000 - saved.len());
        assert!(summary.losses.arrivals > 0);
        let [gone] = summary.gone.as_slice() else {
            panic!("{summary:?}");
        };
        assert!(gone.deleted && gone.arrivals == summary.losses.arrivals);
        // The next file states the losses, source by source, and begins with the states that last.
        let info = Reader::open(paths(&summary)).expect("a log").info();
        for source in session().sources {
            let count = |run: &[Arrival]| -> u64 {
                let own = run.iter().filter(|arrival| arrival.source == source.id);
                own.map(items).sum()
            };
            let lost = count(&written) - count(&saved);
            let stated = info.counters.get(&format!("lost.{}.disk", source.name));
            assert_eq!(stated.copied().unwrap_or_default(), lost, "{}", source.name);
        }
        assert_eq!(info.counters["lost_arrivals"], summary.losses.arrivals);
        assert!(info.channels["/notice"].1 >= 1);
    }
}

#[test]
fn a_log_that_was_renamed_stays_whole_and_the_run_continues_in_a_new_file() {
    for folder_too in [false, true] {
        let parent = tempfile::tempdir().expect("a directory");
        let (directory, away) = (parent.path().join("logs"), parent.path().join("away"));
        std::fs::create_dir(&directory).expect("made");
        let recorder =
            Recorder::start(&directory, "run", session(), Options::default()).expect("started");
        let written = arrivals(42, 3_000);
        push_all(&recorder, &written[..2_000]);
        wait_until(|| recorder.status().waiting == 0);
        let moved = if folder_too {
            std::fs::rename(&directory, &away).expect("moved");
            away.join("run_0000.mcap.active")
        } else {
            let moved = directory.join("other.mcap.active");
            std::fs::rename(directory.join("run_0000.mcap.active"), &moved).expect("moved");
            moved
        };
        let second = atvrec_store::part_path(&directory, "run", 1);
        wait_until(|| recorder.status().disk == DiskState::Writing(second.clone()));
        push_all(&recorder, &written[2_000..]);
        let summary = recorder.finish().expect("finished");
        assert!(summary.losses.is_empty(), "{summary:?}");
        assert_eq!(summary.gone.len(), 1);
        let mut files = paths(&summary);
        files.push(atvrec_store::recover(&moved).expect("recovered").path);
        assert_eq!(read(&files), written);
    }
}

/// `lost.<source>.disk` was cumulative over the run in each file, so that the sum over its files told
/// of more than was lost; and it took the place of what the sources' own notices had told.
#[test]
fn each_file_tells_of_its_own_losses() {
    let directory = tempfile::tempdir().expect("a directory");
    let options = Options {
        queue_capacity: 1,
        ..Options::default()
    };
    let recorder = Recorder::start(directory.path(), "run", session(), options).expect("started");
    let run = arrivals(26, 60_000);
    let mut next = run.iter();
    let mut taken = Vec::new();
    for part in 0..3 {
        for _ in 0..100 {
            wait_until(|| recorder.status().waiting == 0);
            let arrival = next.next().expect("more");
            assert!(recorder.push(arrival.clone()));
            taken.push(arrival);
        }
        // Without the wait a queue of one overflows.
        let lost_before = recorder.status().losses.arrivals;
        while recorder.status().losses.arrivals < lost_before + 100 {
            let arrival = next.next().expect("losses");
            if recorder.push(arrival.clone()) {
                taken.push(arrival);
            }
        }
        wait_until(|| recorder.status().waiting == 0);
        if part < 2 {
            recorder.rotate();
            let path = atvrec_store::part_path(directory.path(), "run", part + 1);
            wait_until(|| recorder.status().disk == DiskState::Writing(path.clone()));
        }
    }
    let lost = recorder.status().losses.at(LossPlace::Disk);
    let summary = recorder.finish().expect("finished");
    assert_eq!(summary.files.len(), 3);
    let counters = Reader::open(paths(&summary))
        .expect("a run")
        .info()
        .counters;
    for source in session().sources {
        // Not what notices tell of losses on the way to the disk: that would be told twice.
        let expected = lost.get(&source.id).copied().unwrap_or_default();
        let found = counters.get(&format!("lost.{}.disk", source.name));
        assert_eq!(
            found.copied().unwrap_or_default(),
            expected,
            "{}",
            source.name
        );
    }
    assert_eq!(counters["arrivals"], taken.len() as u64);
    assert_eq!(counters["first_sequence"], 0);
    let last = taken.last().map(|arrival| arrival.sequence);
    assert_eq!(counters.get("last_sequence").copied(), last);
}

/// Items of an arrival: what counts as received and recorded.
fn items(arrival: &Arrival) -> u64 {
    match &arrival.payload {
        Payload::Can(frames) => frames.len() as u64,
        Payload::Bytes(_) => 1,
        Payload::Tick | Payload::Notice(_) => 0,
    }
}

/// Received = recorded + counted as lost, by source and place, though the queue overflows all the
/// time. A notice that was lost also loses its content.
#[test]
fn nothing_is_lost_in_silence() {
    let directory = tempfile::tempdir().expect("a directory");
    let options = Options {
        queue_capacity: 8,
        rotate_bytes: Some(30_000),
        ..Options::default()
    };
    let recorder = Recorder::start(directory.path(), "run", session(), options).expect("started");
    let run = arrivals(28, 20_000);
    for (number, burst) in run.chunks(13).enumerate() {
        if number % 8 == 0 {
            wait_until(|| recorder.waiting() == 0);
        }
        recorder.push_all(burst.to_vec());
    }
    let summary = recorder.finish().expect("finished");
    assert!(summary.losses.arrivals > 1_000, "{summary:?}");
    assert!(summary.files.len() > 1, "{summary:?}");
    let reader = Reader::open(paths(&summary)).expect("a run");
    let counters = reader.info().counters;
    let recorded: Vec<Arrival> = reader.arrivals().map(|a| a.expect("readable")).collect();
    for source in session().sources {
        let received = |run: &[Arrival]| {
            let own = run.iter().filter(|arrival| arrival.source == source.id);
            own.map(items).sum::<u64>()
        };
        let told = |place: LossPlace| {
            let name = format!("lost.{}.{}", source.name, place.name());
            counters.get(&name).copied().unwrap_or_default()
        };
        assert_eq!(
            received(&run),
            received(&recorded) + told(LossPlace::Disk),
            "{}",
            source.name
        );
        for place in [LossPlace::Device, LossPlace::Kernel, LossPlace::Queue] {
            let noticed = run.iter().filter_map(|arrival| match arrival.payload {
                Payload::Notice(Notice::Lost { place: at, count })
                    if arrival.source == source.id && at == place =>
                {
                    Some(count)
                }
                _ => None,
            });
            assert_eq!(
                told(place),
                noticed.sum::<u64>(),
                "{} {place:?}",
                source.name
            );
        }
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_told_and_loses_only_what_is_counted() {
    // `/dev/full` takes no byte: what a full disk answers.
    let full = std::fs::OpenOptions::new()
        .write(true)
        .open("/dev/full")
        .expect("Linux has it");
    let refused = atvrec_store::LogWriter::new(full, session(), Options::default(), 0);
    let error = refused.err().expect("nothing can be written");
    assert!(error.to_string().contains("No space left"), "{error}");
}

#[test]
fn decoded_records_are_in_the_log_too() {
    let directory = tempfile::tempdir().expect("a directory");
    let recorder =
        Recorder::start(directory.path(), "run", session(), Options::default()).expect("started");
    for n in 0..200 {
        assert!(recorder.record(Record::Estimate(Box::new(estimate(START + n * 10_000_000)))));
    }
    let summary = recorder.finish().expect("finished");
    let reader = Reader::open(paths(&summary)).expect("a log");
    assert_eq!(reader.estimates().count(), 200);
    assert_eq!(
        reader
            .messages(Selection::topics(["/estimate/*"]))
            .filter_map(Result::ok)
            .count(),
        800
    );
}

/// A mark with a number.
fn mark(number: u64) -> Record {
    Record::Mark {
        time: sample::LogTime(START.0 + number),
        text: number.to_string(),
    }
}

/// Numbers of the marks in logs, in their order.
fn marks(paths: &[PathBuf]) -> Vec<u64> {
    let reader = Reader::open(paths).expect("a run");
    let messages = reader.messages(Selection::topics(["/mark"]));
    let texts = messages.filter_map(|message| {
        match message
            .and_then(|message| message.record())
            .expect("readable")
        {
            Some(Record::Mark { text, .. }) => text.parse().ok(),
            _ => None,
        }
    });
    texts.collect()
}

#[test]
fn records_of_one_command_are_in_the_log_in_their_order() {
    let directory = tempfile::tempdir().expect("a directory");
    let recorder =
        Recorder::start(directory.path(), "run", session(), Options::default()).expect("started");
    assert_eq!(recorder.record_all(Vec::new()), 0);
    assert_eq!(recorder.record_all((0..100).map(mark).collect()), 0);
    assert!(recorder.record(mark(100)));
    let summary = recorder.finish().expect("finished");
    assert_eq!(marks(&paths(&summary)), (0..=100).collect::<Vec<_>>());
    assert_eq!(summary.losses.records, 0);
}

/// A quarter of the queue is kept for arrivals.
#[test]
fn records_that_the_queue_has_no_room_for_are_lost_from_the_end_and_counted() {
    let directory = tempfile::tempdir().expect("a directory");
    let options = Options {
        queue_capacity: 8,
        ..Options::default()
    };
    let recorder = Recorder::start(directory.path(), "run", session(), options).expect("started");
    assert_eq!(recorder.record_all((0..10).map(mark).collect()), 4);
    let summary = recorder.finish().expect("finished");
    assert_eq!(marks(&paths(&summary)), (0..6).collect::<Vec<_>>());
    assert_eq!(summary.losses.records, 4);
}
