//! No estimates during silence, and gaps of an import.

use std::fs;
use std::path::Path;

use store::Reader;

use crate::support::{atvrec, stderr, stdout};

const MAP: &str = "\
[time]
column = \"t\"
unit = \"s\"
sort = true
[column.v]
from = \"v\"
quantity = \"speed.forward\"
unit = \"m/s\"
[column.rate]
from = \"r\"
quantity = \"rate.z\"
unit = \"rad/s\"
";

/// Rows at 100 Hz, `rows` from each start, in seconds.
fn table(starts_s: &[f64], rows: u32) -> String {
    let mut text = "# made by hand\nt,v,r\n".to_owned();
    for start_s in starts_s {
        for row in 0..rows {
            text.push_str(&format!("{:.2},10,0.1\n", start_s + f64::from(row) / 100.0));
        }
    }
    text
}

fn import(here: &Path, text: &str, extra: &[&str]) -> assert_cmd::assert::Assert {
    fs::write(here.join("t.csv"), text).expect("written");
    fs::write(here.join("map.toml"), MAP).expect("written");
    atvrec(here)
        .args(["import", "csv", "t.csv", "--columns", "map.toml"])
        .args(["--vehicle", "prowler", "-o", "t.mcap"])
        .args(extra)
        .assert()
}

/// Instants of the estimates, s from the first.
fn instants(path: &Path) -> Vec<f64> {
    let reader = Reader::open([path]).expect("a log");
    let times: Vec<_> = reader
        .estimates()
        .map(|estimate| estimate.expect("an estimate").time)
        .collect();
    times
        .iter()
        .map(|time| time.seconds_since(times[0]))
        .collect()
}

#[test]
fn nothing_is_estimated_while_nothing_is_measured() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    import(here, &table(&[0.0, 20.0, 23.0], 100), &[]).success();
    let instants_s = instants(&here.join("t.mcap"));
    let silent = |s: &&f64| (2.0..19.99).contains(*s) || (22.0..22.99).contains(*s);
    assert_eq!(instants_s.iter().find(silent), None);
    let within = |s: &&f64| (0.0..1.9).contains(*s) || (20.0..21.9).contains(*s);
    assert_eq!(instants_s.iter().filter(within).count(), 380);
    for arguments in [&["--verify"][..], &["--verify", "-o", "again.mcap"]] {
        let told = stdout(
            &atvrec(here)
                .args(["replay", "t.mcap"])
                .args(arguments)
                .assert()
                .success(),
        );
        assert!(!told.contains("silence"), "{told}");
    }
    assert_eq!(instants(&here.join("again.mcap")), instants_s);
}

#[test]
fn the_size_of_a_log_follows_the_input_whatever_the_gaps() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let size = |starts_s: &[f64]| {
        import(here, &table(starts_s, 50), &["--force"]).success();
        atvrec(here)
            .args(["replay", "t.mcap", "-o", "again.mcap", "--force"])
            .assert()
            .success();
        let size = |name| fs::metadata(here.join(name)).expect("a log").len();
        [size("t.mcap"), size("again.mcap")]
    };
    let near = size(&[0.0, 2.0, 4.0, 6.0]);
    let far = size(&[0.0, 3500.0, 7000.0, 10_500.0]);
    for (near, far) in near.into_iter().zip(far) {
        assert!(
            far < near + near / 5,
            "{far} bytes with gaps, {near} without"
        );
    }
}

#[test]
fn a_gap_over_an_hour_is_an_error_or_parts_two_runs() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    // A clock that was set after the first row.
    let text = table(&[0.0], 1) + &table(&[1.7e9], 50).replace("# made by hand\nt,v,r\n", "");
    let told = stderr(&import(here, &text, &[]).code(2));
    for part in [
        "t.csv:3 (at ",
        "t.csv:4 (at ",
        "--split-gaps",
        "the limit is 1 h",
    ] {
        assert!(told.contains(part), "{part}: {told}");
    }
    assert!(!here.join("t.mcap").exists() && !here.join("t.mcap.active").exists());
    let text = table(&[0.0, 4000.0, 9000.0], 50);
    import(here, &text, &["--split-gaps"]).success();
    let names = ["t-1.mcap", "t-2.mcap", "t-3.mcap"];
    let mut runs = Vec::new();
    for name in names {
        let reader = Reader::open([here.join(name)]).expect("a log");
        assert_eq!(reader.info().channels["/ground_speed/t"].1, 50, "{name}");
        assert!(!instants(&here.join(name)).is_empty());
        runs.push(reader.session().run_id.clone());
        atvrec(here)
            .args(["replay", name, "--verify"])
            .assert()
            .success();
    }
    runs.dedup();
    assert_eq!(runs.len(), 3, "{runs:?}");
    // None of them is replaced, nor is another written before that is known.
    fs::remove_file(here.join("t-1.mcap")).expect("removed");
    let told = stderr(&import(here, &text, &["--split-gaps"]).code(2));
    assert!(told.contains("t-2.mcap exists already"), "{told}");
    assert!(!here.join("t-1.mcap").exists());
    // Without a gap that is one run.
    import(here, &table(&[0.0], 50), &["--split-gaps"]).success();
    assert!(here.join("t.mcap").exists());
}

#[test]
fn the_header_of_a_sorted_table_stays_first() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    import(here, &table(&[5.0, 0.0], 50), &[]).success();
    let reader = Reader::open([here.join("t.mcap")]).expect("a log");
    assert_eq!(reader.info().channels["/ground_speed/t"].1, 100);
}

#[test]
fn a_moos_log_with_a_gap_names_both_lines() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let text = "0.0 zGyroZ_gXbow440 gXbow440 0.1\n0.1 zGyroZ_gXbow440 gXbow440 0.1\n\
                9999 zGyroZ_gXbow440 gXbow440 0.1\n";
    fs::write(here.join("d.alog"), text).expect("written");
    let import = ["import", "alog", "d.alog", "-o", "d.mcap"];
    let told = stderr(&atvrec(here).args(import).assert().code(2));
    assert!(
        told.contains("d.alog:2") && told.contains("d.alog:3"),
        "{told}"
    );
    atvrec(here)
        .args(import)
        .arg("--split-gaps")
        .assert()
        .success();
    assert!(here.join("d-2.mcap").exists());
}

/// Ticks without data, as a recorder has whose sources are silent.
#[test]
fn ticks_alone_give_no_estimates() {
    use sample::{Arrival, Payload, SourceId};
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    import(here, &table(&[0.0, 8.0], 100), &[]).success();
    let reader = Reader::open([here.join("t.mcap")]).expect("a log");
    let mut session = reader.session().clone();
    session.attachments = reader.attachments().expect("attachments");
    let mut arrivals: Vec<Arrival> = reader.arrivals().map(|a| a.expect("an arrival")).collect();
    let start = arrivals[0].log_time;
    for tick in 0..120_u64 {
        let log_time = start.offset_seconds(tick as f64 / 10.0);
        arrivals.push(Arrival {
            sequence: 0,
            source: SourceId::HOST,
            log_time,
            realtime_ns: 0,
            payload: Payload::Tick,
        });
    }
    arrivals.sort_by_key(|arrival| arrival.log_time);
    let options = store::Options::default();
    let mut writer =
        store::Writer::create(&here.join("ticks.mcap"), session, options, 0).expect("a log");
    for (sequence, mut arrival) in arrivals.into_iter().enumerate() {
        arrival.sequence = sequence as u64;
        writer.push(arrival).expect("written");
    }
    writer.finish().expect("closed");
    atvrec(here)
        .args(["replay", "ticks.mcap", "-o", "again.mcap"])
        .assert()
        .success();
    let instants_s = instants(&here.join("again.mcap"));
    let silent = |s: &&f64| (2.0..7.99).contains(*s) || **s > 10.0;
    assert_eq!(instants_s.iter().find(silent), None);
    let imported_s = instants(&here.join("t.mcap"));
    assert_eq!(instants_s[..imported_s.len()], imported_s);
    atvrec(here)
        .args(["replay", "again.mcap", "--verify"])
        .assert()
        .success();
}

/// A recorder whose only device is missing has ticks and no data.
#[test]
fn a_recording_without_data_is_as_silent_as_its_replay() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let text = "[source.imu]\nkind = \"crossbow440\"\ndevice = \"absent\"\n\n[vehicle]\nfile = \
                \"prowler\"\n\n[storage]\ndirectory = \"logs\"\n";
    fs::write(here.join("atvrec.toml"), text).expect("written");
    let _ = atvrec(here).args(["-q", "record", "--for", "3"]).assert();
    let logs = fs::read_dir(here.join("logs")).expect("listed");
    let mut logs = logs.map(|entry| entry.expect("an entry").path());
    let log = logs
        .find(|path| path.extension().is_some_and(|end| end == "mcap"))
        .expect("a log");
    let reader = Reader::open([&log]).expect("a log");
    let (first, last) = reader.info().span.expect("ticks");
    assert!(last.seconds_since(first) > 2.0);
    let last_s = instants(&log).last().copied().unwrap_or(0.0);
    assert!(last_s <= 1.0, "estimates until {last_s} s");
    atvrec(here)
        .args(["replay", "--verify", "-o", "again.mcap"])
        .arg(&log)
        .assert()
        .success();
    assert_eq!(instants(&here.join("again.mcap")), instants(&log));
}
