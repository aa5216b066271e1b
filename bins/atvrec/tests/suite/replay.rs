use std::fs;
use std::path::Path;

use sample::{Arrival, Measurement, Payload};
use store::{Reader, Record, Selection, Stage, Writer};

use crate::support::{atvrec, simulate, stderr, stdout};

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_seed_others() {
    let directory = tempfile::tempdir().expect("a directory");
    let [first, second, other] = [("a.mcap", 7), ("b.mcap", 7), ("c.mcap", 8)]
        .map(|(name, seed)| fs::read(simulate(directory.path(), name, seed)).expect("a log"));
    assert!(first == second, "the same seed gives other bytes");
    assert!(first != other, "another seed gives the same bytes");
}

#[test]
fn a_replay_is_bit_identical_and_so_is_the_replay_of_its_output() {
    let directory = tempfile::tempdir().expect("a directory");
    simulate(directory.path(), "drive.mcap", 1);
    let assert = atvrec(directory.path())
        .args(["replay", "drive.mcap", "--verify", "-o", "again.mcap"])
        .assert()
        .success();
    let text = stdout(&assert);
    assert!(text.contains("are bit-identical"), "{text}");
    let assert = atvrec(directory.path())
        .args(["replay", "again.mcap", "--verify", "--json"])
        .assert()
        .success();
    let result: serde_json::Value =
        serde_json::from_str(&stdout(&assert)).expect("the result is JSON");
    assert_eq!(result["verify"]["identical"], true);
    let compared = &result["verify"]["compared"];
    for topic in [
        "/estimate/motion",
        "/estimate/tyre_forces",
        "/estimate/contact_forces",
        "/model/tyre_forces",
    ] {
        let count = compared[topic].as_u64().unwrap_or_default();
        assert!(
            count >= 190,
            "{count} messages on {topic} in two seconds at 100 Hz"
        );
    }
    assert!(compared["/estimate/parameters"].as_u64() >= Some(1));
}

#[test]
fn a_tuned_estimator_gives_other_estimates_and_the_log_carries_the_tuning() {
    let directory = tempfile::tempdir().expect("a directory");
    let log = simulate(directory.path(), "drive.mcap", 1);
    let attachments = Reader::open([&log])
        .and_then(|reader| reader.attachments())
        .expect("attachments");
    for attachment in &attachments {
        fs::write(directory.path().join(&attachment.name), &attachment.data).expect("written");
    }
    let config = directory.path().join("atvrec.toml");
    let text = fs::read_to_string(&config).expect("the log's configuration");
    let tuned = format!("{text}\n[estimator.tuning.fusion.members]\nmember_sigma_n = 30.0\n");
    fs::write(&config, tuned).expect("written");
    // The log's own estimates were made without it.
    atvrec(directory.path())
        .args(["replay", "drive.mcap", "-c", "atvrec.toml", "--verify"])
        .assert()
        .failure();
    atvrec(directory.path())
        .args([
            "replay",
            "drive.mcap",
            "-c",
            "atvrec.toml",
            "-o",
            "tuned.mcap",
        ])
        .assert()
        .success();
    fs::remove_file(&config).expect("removed");
    atvrec(directory.path())
        .args(["replay", "tuned.mcap", "--verify"])
        .assert()
        .success();
}

#[test]
fn a_replay_takes_the_truth_along_and_scores_the_same() {
    let directory = tempfile::tempdir().expect("a directory");
    atvrec(directory.path())
        .args(["simulate", "--manoeuvre", "slow-sine", "--for", "6"])
        .args(["--output", "drive.mcap"])
        .assert()
        .success();
    atvrec(directory.path())
        .args(["replay", "drive.mcap", "-o", "again.mcap"])
        .assert()
        .success();
    let scores = ["drive.mcap", "again.mcap"].map(|log| {
        let assert = atvrec(directory.path())
            .args(["score", log, "--json"])
            .assert()
            .success();
        stdout(&assert)
    });
    assert_eq!(scores[0], scores[1]);
    let score: serde_json::Value = serde_json::from_str(&scores[0]).expect("JSON");
    let rows = score["signals"].as_array().expect("a list");
    let load = rows
        .iter()
        .find(|row| row["signal"] == "measured_force_z" && row["wheel"] == "FL")
        .expect("the load of the front left tyre");
    let percent = load["normalised_percent"].as_f64().expect("a number");
    assert!((0.01..10.0).contains(&percent), "{load:#}");
    assert_eq!(score["false_lifts"], 0);
}

#[test]
fn a_smoothing_replay_adds_better_estimates_and_changes_none() {
    let directory = tempfile::tempdir().expect("a directory");
    atvrec(directory.path())
        .args(["simulate", "--manoeuvre", "slow-sine", "--for", "12"])
        .args(["--output", "drive.mcap"])
        .assert()
        .success();
    atvrec(directory.path())
        .args(["replay", "drive.mcap", "--smooth", "--verify"])
        .args(["-o", "smooth.mcap"])
        .assert()
        .success();
    let assert = atvrec(directory.path())
        .args(["replay", "smooth.mcap", "--verify", "--json"])
        .assert()
        .success();
    let result: serde_json::Value = serde_json::from_str(&stdout(&assert)).expect("JSON");
    let compared = &result["verify"]["compared"];
    for topic in ["motion", "tyre_forces", "contact_forces"] {
        let [causal, smoothed] =
            ["estimate", "smoothed"].map(|stage| compared[format!("/{stage}/{topic}")].as_u64());
        assert!(causal.is_some_and(|count| count > 1000), "{compared:#}");
        assert_eq!(
            causal, smoothed,
            "one smoothed estimate for each causal one"
        );
    }
    let rmse = |arguments: &[&str]| {
        let mut all = vec!["score", "smooth.mcap", "--json"];
        all.extend(arguments);
        let assert = atvrec(directory.path()).args(all).assert().success();
        let score: serde_json::Value = serde_json::from_str(&stdout(&assert)).expect("JSON");
        let rows = score["signals"].as_array().expect("a list").clone();
        ["measured_force_z", "sideslip"].map(|signal| {
            let of_signal = rows.iter().filter(|row| row["signal"] == signal);
            of_signal
                .filter_map(|row| row["rmse"].as_f64())
                .sum::<f64>()
        })
    };
    let (causal, smoothed) = (rmse(&[]), rmse(&["--smoothed"]));
    for (causal, smoothed) in causal.iter().zip(smoothed) {
        assert!(smoothed < *causal, "{causal} {smoothed}");
    }
    atvrec(directory.path())
        .args(["score", "drive.mcap", "--smoothed"])
        .assert()
        .code(1);
    atvrec(directory.path())
        .args(["replay", "drive.mcap", "--smooth"])
        .assert()
        .code(2);
}

#[test]
fn a_replay_with_another_vehicle_or_fewer_inputs_is_compared_with_the_first() {
    let directory = tempfile::tempdir().expect("a directory");
    simulate(directory.path(), "drive.mcap", 1);
    let reader = Reader::open([directory.path().join("drive.mcap")]).expect("the log opens");
    let attachments = reader.attachments().expect("attachments");
    let of_vehicle = attachments
        .iter()
        .find(|a| a.name == "prowler.vehicle.toml");
    let text = String::from_utf8(of_vehicle.expect("a vehicle").data.clone()).expect("text");
    let mass = text.lines().find(|line| line.starts_with("mass_kg"));
    let heavier = text.replacen(mass.expect("a mass"), "mass_kg = 700.0", 1);
    fs::write(directory.path().join("heavier.toml"), heavier).expect("written");
    let overrides = "vehicle = \"Prowler, road tyres\"\n[overrides]\n\"body.mass_kg\" = 700.0\n";
    let calibration = "vehicle = \"Prowler, road tyres\"\n[steer]\noffset_rad = 0.1\n";
    for (name, text) in [("mass.toml", overrides), ("steer.toml", calibration)] {
        fs::write(directory.path().join(name), text).expect("written");
    }
    for (change, value) in [
        ("--vehicle", "heavier.toml"),
        ("--overrides", "mass.toml"),
        ("--sensors", "full-bridge-16bit"),
        ("--calibration", "steer.toml"),
        ("--without", "strain,imu"),
        ("--method", "thesis"),
    ] {
        atvrec(directory.path())
            .args(["replay", "drive.mcap", "-o", "other.mcap", "--force"])
            .args([change, value])
            .assert()
            .success();
        let assert = atvrec(directory.path())
            .args(["score", "other.mcap", "--against", "drive.mcap", "--json"])
            .args(["--from", "0.5"])
            .assert()
            .success();
        let found: serde_json::Value = serde_json::from_str(&stdout(&assert)).expect("JSON");
        assert_eq!(found["identical"], false, "{change}");
        assert_eq!(found["only_here"], 0, "{change}");
        // The new log replays by what it was told.
        atvrec(directory.path())
            .args(["replay", "other.mcap", "--verify"])
            .assert()
            .success();
    }
    // What was left out can be taken in again.
    for arguments in [
        ["drive.mcap", "--without", "strain,imu", "-o", "less.mcap"],
        ["less.mcap", "--with", "strain,imu", "-o", "more.mcap"],
        ["drive.mcap", "--without", "imu", "-o", "less.mcap"],
    ] {
        atvrec(directory.path())
            .args(["replay", "--force"])
            .args(arguments)
            .assert()
            .success();
    }
    let assert = atvrec(directory.path())
        .args(["score", "more.mcap", "--against", "drive.mcap", "--json"])
        .assert()
        .success();
    let found: serde_json::Value = serde_json::from_str(&stdout(&assert)).expect("JSON");
    assert_eq!(found["identical"], true);
    let assert = atvrec(directory.path())
        .args(["replay", "less.mcap", "--with", "strain"])
        .assert()
        .code(2);
    assert!(
        stderr(&assert).contains("ignores imu"),
        "{}",
        stderr(&assert)
    );
    let assert = atvrec(directory.path())
        .args(["replay", "drive.mcap", "--without", "strian"])
        .assert()
        .code(2);
    assert!(stderr(&assert).contains("strain"), "{}", stderr(&assert));
}

#[test]
fn a_changed_raw_byte_is_found() {
    let directory = tempfile::tempdir().expect("a directory");
    let log = simulate(directory.path(), "drive.mcap", 1);
    rewrite(&log, &directory.path().join("same.mcap"), |_| {}, |_| {});
    atvrec(directory.path())
        .args(["replay", "same.mcap", "--verify"])
        .assert()
        .success();

    // One bit of one strain count.
    let mut changed = false;
    let change = |arrival: &mut Arrival| {
        if let Payload::Can(frames) = &mut arrival.payload
            && !changed
            && arrival.sequence > 500
        {
            frames[0].data[0] ^= 1;
            changed = true;
        }
    };
    rewrite(&log, &directory.path().join("changed.mcap"), change, |_| {});
    let assert = atvrec(directory.path())
        .args(["replay", "changed.mcap", "--verify"])
        .assert()
        .code(1);
    let text = stdout(&assert);
    assert!(text.contains("NOT IDENTICAL"), "{text}");
    assert!(text.contains("in the log"), "{text}");
}

#[test]
fn an_estimate_changed_by_the_last_bit_is_found() {
    let directory = tempfile::tempdir().expect("a directory");
    let log = simulate(directory.path(), "drive.mcap", 1);
    let mut changed = false;
    let change = |record: &mut Record| {
        if let Record::Motion {
            stage: Stage::Estimate,
            motion,
            time,
        } = record
            && !changed
            && time.0 % 1_000_000_000 > 500_000_000
        {
            motion.velocity_x_m_s = motion.velocity_x_m_s.next_up();
            changed = true;
        }
    };
    rewrite(&log, &directory.path().join("changed.mcap"), |_| {}, change);
    let assert = atvrec(directory.path())
        .args(["replay", "changed.mcap", "--verify"])
        .assert()
        .code(1);
    let text = stdout(&assert);
    assert!(text.contains("NOT IDENTICAL: 1 of"), "{text}");
    assert!(text.contains("/estimate/motion at"), "{text}");
}

#[test]
fn a_log_that_is_cut_replays_as_far_as_it_goes() {
    let directory = tempfile::tempdir().expect("a directory");
    let log = simulate(directory.path(), "drive.mcap", 1);
    let bytes = fs::read(&log).expect("a log");
    fs::write(directory.path().join("cut.mcap"), &bytes[..bytes.len() / 2]).expect("written");
    let assert = atvrec(directory.path())
        .args(["replay", "cut.mcap", "--verify"])
        .assert()
        .success();
    let text = stdout(&assert);
    assert!(text.contains("was not closed"), "{text}");
    assert!(text.contains("are bit-identical"), "{text}");
    let assert = atvrec(directory.path())
        .args(["recover", "cut.mcap"])
        .assert()
        .code(3);
    let text = stdout(&assert);
    assert!(
        text.contains("messages saved") && text.contains("lost: "),
        "{text}"
    );
    let original = fs::read(directory.path().join("cut.mcap.damaged")).expect("kept");
    assert_eq!(original, bytes[..bytes.len() / 2]);
    atvrec(directory.path())
        .args(["replay", "cut.mcap", "--verify"])
        .assert()
        .success();
}

#[test]
fn measurements_stand_at_the_instant_when_they_were_true() {
    let directory = tempfile::tempdir().expect("a directory");
    let log = simulate(directory.path(), "drive.mcap", 1);
    let reader = Reader::open([&log]).expect("the log opens");
    let mut truth = reader.messages(Selection::topics(["/truth/motion"]));
    let first = truth.next().expect("a truth").expect("a message");
    let start = first.log_time;
    let selection = Selection::topics(["/imu/imu", "/gnss/novatel/velocity"]);
    let [mut worst_imu_s, mut worst_velocity_s] = [0.0_f64; 2];
    let (mut imu, mut velocities) = (0, 0);
    for message in reader.messages(selection) {
        let message = message.expect("a message");
        let Some(Record::Sample(sample)) = message.record().expect("a record") else {
            continue;
        };
        let true_s = sample.valid_time.seconds_since(start);
        match sample.measurement {
            Measurement::Imu(_) => {
                imu += 1;
                let off_grid_s = true_s - (true_s / 0.01).round() * 0.01;
                worst_imu_s = worst_imu_s.max(off_grid_s.abs());
            }
            Measurement::GnssVelocity(velocity) if true_s > 1.0 => {
                velocities += 1;
                // Tags stand on multiples of 50 ms; the record says how late its velocity is.
                let latency_s = velocity.latency_s.expect("BESTVEL has a latency");
                assert!(latency_s > 0.0);
                let tag_s = true_s + latency_s;
                let off_grid_s = tag_s - (tag_s / 0.05).round() * 0.05;
                worst_velocity_s = worst_velocity_s.max(off_grid_s.abs());
            }
            _ => {}
        }
    }
    assert!(
        imu > 150 && velocities > 10,
        "{imu} and {velocities} samples"
    );
    assert!(
        worst_imu_s < 1e-3,
        "inertial samples are off by {worst_imu_s} s"
    );
    assert!(
        worst_velocity_s < 2e-3,
        "velocities are off by {worst_velocity_s} s"
    );
}

#[test]
fn info_tells_topics_and_attachments() {
    let directory = tempfile::tempdir().expect("a directory");
    simulate(directory.path(), "drive.mcap", 1);
    let assert = atvrec(directory.path())
        .args(["info", "drive.mcap", "--json"])
        .assert()
        .success();
    let info: serde_json::Value = serde_json::from_str(&stdout(&assert)).expect("JSON");
    for topic in ["/imu/imu", "/strain", "/steer", "/truth/motion", "/health"] {
        let count = info["channels"][topic]["messages"].as_u64();
        assert!(count.is_some_and(|count| count > 0), "{topic}: {count:?}");
    }
    let attachments = info["attachments"].as_array().expect("a list");
    for name in [
        "atvrec.toml",
        "prowler.vehicle.toml",
        "prowler.dbc",
        "thesis-10bit.sensors.toml",
    ] {
        assert!(
            attachments.iter().any(|a| a["name"] == name),
            "{name} is not attached"
        );
    }
}

#[test]
fn what_cannot_be_replayed_is_refused_by_name() {
    let directory = tempfile::tempdir().expect("a directory");
    fs::write(directory.path().join("text.mcap"), "this is no log").expect("written");
    for (arguments, part) in [
        (["replay", "absent.mcap"], "absent.mcap"),
        (["replay", "text.mcap"], "not an MCAP file"),
        (["info", "text.mcap"], "not an MCAP file"),
    ] {
        let assert = atvrec(directory.path()).args(arguments).assert().code(1);
        let text = stderr(&assert);
        assert!(text.contains(part), "{text}");
    }
    simulate(directory.path(), "drive.mcap", 1);
    let assert = atvrec(directory.path())
        .args(["replay", "drive.mcap", "-o", "drive.mcap"])
        .assert()
        .code(2);
    assert!(stderr(&assert).contains("cannot be its output"));
}

/// Writes a log again with changed arrivals and records.
fn rewrite(
    from: &Path,
    to: &Path,
    mut change_arrival: impl FnMut(&mut Arrival),
    mut change_record: impl FnMut(&mut Record),
) {
    let reader = Reader::open([from]).expect("the log opens");
    let mut session = reader.session().clone();
    session.attachments = reader.attachments().expect("attachments");
    let options = store::Options::default();
    let mut writer = Writer::create(to, session, options, 0).expect("a new log");
    for arrival in reader.arrivals() {
        let mut arrival = arrival.expect("an arrival");
        change_arrival(&mut arrival);
        writer.push(arrival).expect("written");
    }
    for message in reader.messages(Selection::default()) {
        let message = message.expect("a message");
        if let Some(mut record) = message.record().expect("a record") {
            change_record(&mut record);
            writer.record(&record);
        }
    }
    writer.finish().expect("closed");
}

/// Replayed on a processor without fused multiplication, 8 % of the messages differed in their last
/// bits: the C library has other variants of sine and its kin there.
#[test]
fn a_replay_on_a_lesser_processor_is_bit_identical() {
    let directory = tempfile::tempdir().expect("a directory");
    atvrec(directory.path())
        .args(["simulate", "--manoeuvre", "slow-sine", "--for", "5"])
        .args(["--output", "drive.mcap"])
        .assert()
        .success();
    atvrec(directory.path())
        .env("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-FMA,-FMA4,-AVX2")
        .args(["replay", "drive.mcap", "--verify"])
        .assert()
        .success();
}

/// Copies the messages of a log from a time on, as the tools of other programs do.
fn cut(log: &Path, to: &Path, from_s: f64, until_s: f64) {
    let bytes = fs::read(log).expect("a log");
    let summary = mcap::Summary::read(&bytes)
        .expect("a log")
        .expect("a summary");
    let start = summary
        .stats
        .as_ref()
        .expect("statistics")
        .message_start_time;
    let at = |seconds: f64| start + (seconds * 1e9) as u64;
    let mut copied = Vec::new();
    let mut writer = mcap::Writer::new(std::io::Cursor::new(&mut copied)).expect("a vector");
    for index in &summary.attachment_indexes {
        let attachment = mcap::read::attachment(&bytes, index).expect("an attachment");
        writer.attach(&attachment).expect("a vector");
    }
    for index in &summary.metadata_indexes {
        let metadata = mcap::read::metadata(&bytes, index).expect("metadata");
        writer.write_metadata(&metadata).expect("a vector");
    }
    for message in mcap::MessageStream::new(&bytes).expect("a log") {
        let message = message.expect("a message");
        if (at(from_s)..at(until_s)).contains(&message.log_time) {
            writer.write(&message).expect("a vector");
        }
    }
    writer.finish().expect("a vector");
    drop(writer);
    fs::write(to, copied).expect("written");
}

#[test]
fn a_run_that_another_tool_cut_is_not_called_different() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let log = simulate(here, "drive.mcap", 1);
    cut(&log, &here.join("begin.mcap"), 0.8, 1e6);
    let assert = atvrec(here)
        .args(["replay", "begin.mcap", "--verify"])
        .assert()
        .code(3);
    let text = stdout(&assert);
    assert!(
        text.contains("the log does not begin at its beginning"),
        "{text}"
    );
    assert!(!text.contains("NOT IDENTICAL"), "{text}");
    cut(&log, &here.join("end.mcap"), 0.0, 1.2);
    let assert = atvrec(here)
        .args(["replay", "end.mcap", "--verify"])
        .assert()
        .success();
    let text = stdout(&assert);
    assert!(text.contains("the log does not end at its end"), "{text}");
}
