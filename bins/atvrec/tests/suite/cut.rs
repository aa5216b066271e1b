//! `cut`, `split` and `merge`: logs of parts of logs and of several logs.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use sample::{LogTime, Measurement};
use store::{Reader, Selection};

use crate::support::{atvrec, names, simulate, stderr, stdout};

/// Messages by topic: log time, publish time and data.
type Messages = BTreeMap<String, Vec<(u64, u64, Vec<u8>)>>;

fn messages(log: &Path, selection: Selection) -> Messages {
    let reader = Reader::open([log]).expect("a log");
    let mut all = Messages::new();
    for message in reader.messages(selection) {
        let message = message.expect("a message");
        if !message.channel.schema.starts_with("atvrec.Raw") {
            let times = (
                message.log_time.0,
                message.publish_time.0,
                message.data.clone(),
            );
            all.entry(message.channel.topic.clone())
                .or_default()
                .push(times);
        }
    }
    all.values_mut().for_each(|messages| messages.sort());
    all
}

fn arrivals(log: &Path) -> Vec<sample::Arrival> {
    let reader = Reader::open([log]).expect("a log");
    reader
        .arrivals()
        .map(|arrival| arrival.expect("readable"))
        .collect()
}

fn verify(here: &Path, logs: &[&str], code: i32) -> String {
    let command = [&["replay", "--verify"], logs].concat();
    stdout(&atvrec(here).args(command).assert().code(code))
}

#[test]
fn a_cut_has_the_data_of_its_time_and_says_what_it_continues() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let log = simulate(here, "drive.mcap", 11);
    let before = fs::read(&log).expect("a log");
    let cut = ["cut", "drive.mcap", "--from", "0.5", "--to", "1.75", "-o"];
    atvrec(here).args(cut).arg("cut.mcap").assert().success();
    assert_eq!(fs::read(&log).expect("a log"), before);

    let whole = Reader::open([&log]).expect("a log");
    let (first, _) = whole.info().span.expect("data");
    let [from, to] = [0.5, 1.75].map(|time_s| first.offset_seconds(time_s));
    let path = here.join("cut.mcap");
    let of_span = Selection::default().between(from, to);
    let (found, expected) = (
        messages(&path, Selection::default()),
        messages(&log, of_span),
    );
    for topic in found.keys().chain(expected.keys()) {
        assert!(found.get(topic) == expected.get(topic), "{topic}");
    }
    let expected = arrivals(&log).into_iter();
    let is_within = |time: LogTime| time >= from && time <= to;
    let expected: Vec<_> = expected.filter(|a| is_within(a.log_time)).collect();
    assert_eq!(arrivals(&path), expected);

    let reader = Reader::open([&path]).expect("a log");
    assert_eq!(
        reader.attachments().expect("files"),
        whole.attachments().expect("files")
    );
    let origin = reader.session().origin.clone().expect("an origin");
    assert!(origin.is_continued);
    assert_eq!(origin.run_id, whole.session().run_id);
    assert_eq!((origin.from, origin.to), (from, to));
    assert_eq!(
        origin.counters["arrivals"],
        whole.info().counters["arrivals"]
    );
    assert_eq!(reader.info().missing, []);

    let told = verify(here, &["cut.mcap"], 3);
    assert!(
        told.contains("VERIFIED IN PART: the log continues the run"),
        "{told}"
    );
    let info = stdout(&atvrec(here).args(["info", "cut.mcap"]).assert().success());
    assert!(info.contains("continues the run"), "{info}");
    for command in ["report", "events"] {
        let mut command = atvrec(here).args([command, "cut.mcap"]).assert();
        command = command.success();
        drop(command);
    }
    // A cut of a cut says what it continues.
    let again = ["cut", "cut.mcap", "--to", "0.5", "-o", "again.mcap"];
    atvrec(here).args(again).assert().success();
    let told = verify(here, &["again.mcap"], 3);
    assert!(told.contains("continues the run"), "{told}");
    // The beginning of a log depends on nothing before it.
    let begin = ["cut", "drive.mcap", "--to", "1", "-o", "begin.mcap"];
    atvrec(here).args(begin).assert().success();
    let told = verify(here, &["begin.mcap"], 0);
    assert!(told.contains("verified: "), "{told}");
}

/// A decoded message that was changed is found in a log that continues another one, also if its time of validity
/// depends on the data before the log.
#[test]
fn a_changed_message_of_a_cut_is_found() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let drive = [
        "--quiet",
        "simulate",
        "-m",
        "slow-sine",
        "--for",
        "5",
        "-o",
        "drive.mcap",
    ];
    atvrec(here).args(drive).assert().success();
    let cut = ["cut", "drive.mcap", "--from", "1", "-o", "cut.mcap"];
    atvrec(here).args(cut).assert().success();
    let told = verify(here, &["cut.mcap"], 3);
    assert!(told.contains("VERIFIED IN PART"), "{told}");
    let reader = Reader::open([here.join("cut.mcap")]).expect("a log");
    let session = store::Session {
        attachments: reader.attachments().expect("files"),
        ..reader.session().clone()
    };
    let config = engine::Config::from_attachments(&session.attachments).expect("a configuration");
    let session = store::Session {
        dynamic: engine::session::replayed(&config, &session).dynamic,
        ..session
    };
    let last = reader.info().span.expect("data").1.offset_seconds(-1.0);
    let changes: [fn(&mut Measurement) -> bool; 3] = [
        |measurement| match measurement {
            Measurement::Signals(frame) => {
                frame.signals[0].value += 1.0;
                true
            }
            _ => false,
        },
        |measurement| match measurement {
            Measurement::Steer(steer) => {
                steer.steering_wheel_rad += 1e-6;
                true
            }
            _ => false,
        },
        |measurement| match measurement {
            Measurement::GnssPosition(position) => {
                position.height_m += 1e-3;
                true
            }
            _ => false,
        },
    ];
    for (number, change) in changes.into_iter().enumerate() {
        let path = here.join(format!("changed-{number}.mcap"));
        let options = store::Options::default();
        let mut writer = store::Writer::create(&path, session.clone(), options, 0).expect("a log");
        for arrival in reader.arrivals() {
            writer.push(arrival.expect("readable")).expect("written");
        }
        let mut changed = false;
        for message in reader.messages(Selection::default()) {
            let message = message.expect("readable");
            let Some(mut record) = message.record().expect("a record") else {
                continue;
            };
            if let store::Record::Sample(sample) = &mut record
                && message.log_time > last
                && !changed
            {
                changed = change(&mut sample.measurement);
            }
            writer.record(&record);
        }
        writer.finish().expect("closed");
        assert!(changed);
        let name = path.to_string_lossy().into_owned();
        let told = verify(here, &[&name], 1);
        assert!(told.contains("NOT IDENTICAL: 1 of"), "{number}: {told}");
    }
}

#[test]
fn the_pieces_of_a_log_give_the_log_again() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let log = simulate(here, "drive.mcap", 12);
    let split = ["split", "drive.mcap", "--every", "0.7", "-o", "pieces"];
    atvrec(here).args(split).assert().success();
    let pieces = ["drive-0001.mcap", "drive-0002.mcap", "drive-0003.mcap"];
    assert_eq!(names(&here.join("pieces")), pieces);
    let counts = pieces.map(|name| arrivals(&here.join("pieces").join(name)).len());
    assert_eq!(
        counts.iter().sum::<usize>(),
        arrivals(&log).len(),
        "{counts:?}"
    );
    // The sources of runs that follow each other are the same. The order of the files does not matter.
    let pieces = pieces.map(|name| format!("pieces/{name}"));
    let [a, b, c] = &pieces;
    let merge = ["merge", b, a, c, "-o", "again.mcap"];
    atvrec(here).args(merge).assert().success();
    let again = here.join("again.mcap");
    let (mut found, expected) = (arrivals(&again), arrivals(&log));
    assert_eq!(found.len(), expected.len());
    found.sort_by_key(|arrival| arrival.sequence);
    assert!(found == expected, "the arrivals differ");
    let mut expected = messages(&log, Selection::default());
    expected.retain(|topic, _| !topic.starts_with("/truth/"));
    assert!(
        messages(&again, Selection::default()) == expected,
        "the messages differ"
    );
    let told = verify(here, &["again.mcap"], 0);
    assert!(told.contains("verified: "), "{told}");
}

#[test]
fn runs_of_two_recorders_at_the_same_time_become_one() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let (one, other) = (simulate(here, "a.mcap", 11), simulate(here, "b.mcap", 12));
    let merge = ["merge", "a.mcap", "b.mcap", "-o", "both.mcap"];
    let refused = stderr(&atvrec(here).args(merge).assert().code(2));
    assert!(
        refused.contains("several runs have the sources brake, can0, imu, "),
        "{refused}"
    );
    assert!(refused.contains("--rename"), "{refused}");
    assert_eq!(names(here), ["a.mcap", "b.mcap"]);
    let told = stdout(&atvrec(here).args(merge).arg("--rename").assert().success());
    assert!(told.contains("can0_2"), "{told}");
    let both = here.join("both.mcap");
    let all = arrivals(&both);
    assert_eq!(all.len(), arrivals(&one).len() + arrivals(&other).len());
    assert!(all.is_sorted_by_key(|arrival| arrival.log_time));
    let channels = Reader::open([&both]).expect("a log").info().channels;
    for (topic, of_other) in [("/can/can0/", &one), ("/can/can0_2/", &other)] {
        let whole = Reader::open([of_other]).expect("a log").info().channels;
        let own = whole
            .iter()
            .filter(|(name, _)| name.starts_with("/can/can0/"));
        for (name, (_, count)) in own {
            let name = name.replace("/can/can0/", topic);
            assert_eq!(
                channels.get(&name).map(|found| found.1),
                Some(*count),
                "{name}"
            );
        }
    }
    let told = verify(here, &["both.mcap"], 0);
    assert!(told.contains("verified: "), "{told}");
}

/// The parts of a run become one file with the estimates of the recording.
#[test]
fn the_parts_of_a_run_become_one_file() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let log = simulate(here, "drive.mcap", 13);
    let reader = Reader::open([&log]).expect("a log");
    let config = engine::Config::from_attachments(&reader.attachments().expect("files"));
    let config = config.expect("a configuration");
    let session = engine::session::replayed(&config, reader.session());
    let all = arrivals(&log);
    let mut engine = engine::Engine::new(&config).expect("an engine");
    let mut parts = Vec::new();
    for (number, part) in all.chunks(all.len() / 2 + 1).enumerate() {
        let path = here.join(format!("run_{number:04}.mcap"));
        let part_number = u32::try_from(number).expect("two parts");
        let options = store::Options::default();
        let mut writer =
            store::Writer::create(&path, session.clone(), options, part_number).expect("a log");
        let mut records = Vec::new();
        for arrival in part {
            engine.push(arrival, &mut records);
            writer.push(arrival.clone()).expect("written");
            records.drain(..).for_each(|record| writer.record(&record));
        }
        writer.finish().expect("closed");
        parts.push(format!("run_{number:04}.mcap"));
    }
    let merge = atvrec(here)
        .arg("merge")
        .args(&parts)
        .args(["-o", "one.mcap"])
        .assert();
    merge.success();
    assert_eq!(arrivals(&here.join("one.mcap")), all);
    let told = verify(here, &["one.mcap"], 0);
    assert!(told.contains("verified: "), "{told}");
    // Without its first part, a run is continued.
    let merge = ["merge", &parts[1], "-o", "second.mcap"];
    atvrec(here).args(merge).assert().success();
    let told = verify(here, &["second.mcap"], 3);
    assert!(told.contains("continues the run"), "{told}");
}

#[test]
fn marks_are_found_and_wrong_input_is_refused_by_name() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let marked = ["--quiet", "simulate", "-m", "load-rig", "-o", "rig.mcap"];
    atvrec(here).args(marked).assert().success();
    let reader = Reader::open([here.join("rig.mcap")]).expect("a log");
    let marks = report::marks(&reader).expect("marks");
    let (first, last) = reader.info().span.expect("data");
    let (time, text) = &marks[1];
    let around = ["cut", "rig.mcap", "--around", text, "-o", "mark.mcap"];
    atvrec(here).args(around).assert().success();
    let span = Reader::open([here.join("mark.mcap")])
        .expect("a log")
        .info()
        .span;
    let (from, to) = span.expect("data");
    let [begin, end] = [-5.0, 5.0].map(|offset_s| time.offset_seconds(offset_s));
    assert!(from.seconds_since(begin.max(first)).abs() < 0.2);
    assert!(to.seconds_since(end.min(last)).abs() < 0.2);
    let split = ["split", "rig.mcap", "--at-marks", "-o", "pieces"];
    atvrec(here).args(split).assert().success();
    let mut times: Vec<LogTime> = marks.iter().map(|(time, _)| *time).collect();
    times.dedup();
    assert_eq!(names(&here.join("pieces")).len(), times.len() + 1);

    simulate(here, "drive.mcap", 11);
    let have = names(here);
    for (command, code, part) in [
        (
            &["cut", "rig.mcap", "--around", "absent", "-o", "x.mcap"][..],
            1,
            marks[0].1.as_str(),
        ),
        (
            &["cut", "rig.mcap", "--around", "absent", "-o", "x.mcap"],
            1,
            "no mark \"absent\"",
        ),
        (
            &[
                "cut",
                "drive.mcap",
                "--from",
                "1.5",
                "--to",
                "1",
                "-o",
                "x.mcap",
            ],
            1,
            "nothing is between",
        ),
        (
            &["cut", "drive.mcap", "--from", "9", "-o", "x.mcap"],
            1,
            "nothing is between 9.0 s",
        ),
        (
            &["cut", "drive.mcap", "--to", "1", "-o", "rig.mcap"],
            2,
            "rig.mcap exists",
        ),
        (
            &[
                "cut",
                "drive.mcap",
                "--to",
                "1",
                "-o",
                "drive.mcap",
                "--force",
            ],
            2,
            "is the input",
        ),
        (&["cut", "drive.mcap", "-o", "x.mcap"], 2, "--from"),
        (
            &["split", "drive.mcap", "--at-marks", "-o", "y"],
            2,
            "the log has no mark",
        ),
        (&["split", "drive.mcap", "-o", "y"], 2, "--every"),
        (
            &["split", "drive.mcap", "--every", "0", "-o", "y"],
            2,
            "--every",
        ),
        (
            &[
                "split",
                "drive.mcap",
                "--every",
                "0.01",
                "--at-marks",
                "-o",
                "y",
            ],
            2,
            "cannot be used",
        ),
        (
            &["merge", "absent.mcap", "drive.mcap", "-o", "x.mcap"],
            1,
            "absent.mcap",
        ),
        (
            &["merge", "drive.mcap", "drive.mcap", "-o", "x.mcap"],
            1,
            "give it once",
        ),
    ] {
        let told = stderr(&atvrec(here).args(command).assert().code(code));
        assert!(told.contains(part), "{command:?}: {told}");
        assert_eq!(names(here), have, "{command:?}");
    }
}

/// A log of the first version can be cut. Its parts are in the present layout.
#[test]
fn a_log_of_an_earlier_version_can_be_cut() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let old = testkit::project().join("testdata/compat/slow-sine-0.mcap");
    let old = old.display().to_string();
    let cut = ["cut", &old, "--from", "1", "--to", "3", "-o", "cut.mcap"];
    atvrec(here).args(cut).assert().success();
    let told = verify(here, &["cut.mcap"], 3);
    assert!(told.contains("continues the run"), "{told}");
}
