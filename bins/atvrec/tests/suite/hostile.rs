//! Numbers, files and tables that make no sense.

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::support::{atvrec, simulate, stderr, stdout};

#[test]
fn a_number_out_of_its_range_is_named_with_option_and_range() {
    let directory = tempfile::tempdir().expect("a directory");
    for (command, option, allowed) in [
        (&["record"][..], "--for", "0.001 to 31536000 s"),
        (&["demo"], "--for", "0.001 to 31536000 s"),
        (
            &["simulate", "-m", "circle", "-o", "x.mcap"],
            "--for",
            "0.001 to 31536000 s",
        ),
        (&["virtual", "-m", "circle"], "--for", "0.001 to 31536000 s"),
        (&["replay", "x.mcap"], "--rate", "0.001 to 1000000 times"),
        (&["check"], "--listen-s", "0.01 to 3600 s"),
        (&["score", "x.mcap"], "--from", "0 to 1000000000 s"),
        (
            &["export", "x.mcap", "-t", "/mark"],
            "--to",
            "0 to 1000000000 s",
        ),
        (
            &["identify", "cornering", "x.mcap"],
            "--from",
            "0 to 1000000000 s",
        ),
        (
            &["identify", "handling", "x.mcap"],
            "--until",
            "0 to 1000000000 s",
        ),
        (
            &["identify", "inertia", "x.mcap"],
            "--mass-kg",
            "0.001 to 1000000 kg",
        ),
        (
            &["identify", "inertia", "x.mcap"],
            "--fixture-kg-m2",
            "0 to 1000000 kg",
        ),
        (
            &["calibrate", "zero", "x.mcap"],
            "--weight-sigma",
            "0.000001 to 1",
        ),
        (
            &["calibrate", "steer", "x.mcap"],
            "--plate-sigma-deg",
            "0.001 to 90",
        ),
        (
            &["identify", "response", "x.mcap"],
            "--window-s",
            "0.1 to 3600 s",
        ),
    ] {
        for value in ["1e300", "-1", "nan", "inf", "1e999", "x", ""] {
            let assert = atvrec(directory.path())
                .args(command)
                .arg(format!("{option}={value}"))
                .assert()
                .code(2);
            let told = stderr(&assert);
            let parts = [option, &format!("'{value}'"), allowed];
            let named = parts.iter().all(|part| told.contains(part)) || value.is_empty();
            assert!(named, "{command:?} {option} {value}: {told}");
        }
    }
    for value in ["-1", "1.5", "18446744073709551616"] {
        let assert = atvrec(directory.path())
            .args(["simulate", "-m", "circle", "-o", "x.mcap", "--seed", value])
            .assert()
            .code(2);
        let told = stderr(&assert);
        assert!(
            told.contains("--seed") && told.contains("0 to 18446744073709551615"),
            "{told}"
        );
    }
}

#[test]
fn holes_in_the_row_of_parts_are_shown() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    fs::create_dir(here.join("logs")).expect("made");
    fs::write(here.join("parts.toml"), "[storage]\nrotate_after_s = 1\n").expect("written");
    atvrec(here)
        .args(["virtual", "-m", "step-steer", "--for", "0.1", "-d", "ports"])
        .assert()
        .success();
    let mut text = fs::read_to_string(here.join("ports/atvrec.toml")).expect("a configuration");
    text.push_str("rotate_after_s = 1\n");
    fs::write(here.join("parts.toml"), text).expect("written");
    atvrec(here)
        .args([
            "simulate",
            "-m",
            "step-steer",
            "--for",
            "3.5",
            "-c",
            "parts.toml",
            "-o",
            "logs",
        ])
        .assert()
        .success();
    let mut parts: Vec<String> = fs::read_dir(here.join("logs"))
        .expect("listed")
        .map(|entry| entry.expect("an entry").path().display().to_string())
        .collect();
    parts.sort();
    assert!(parts.len() >= 3, "{parts:?}");
    let run = |arguments: &[&str]| atvrec(here).args(arguments).assert();
    let info = stdout(&run(&["info", &parts[0], &parts[2]]).success());
    assert!(info.contains("part 1 is missing"), "{info}");
    let info = stdout(&run(&["info", &parts[1], &parts[2]]).success());
    assert!(info.contains("part 0 is missing"), "{info}");
    let info = stdout(&run(&["info", &parts[1], &parts[0]]).success());
    assert!(!info.contains("missing"), "{info}");
    let told = stderr(&run(&["replay", "--verify", &parts[1], &parts[2]]).code(1));
    assert!(told.contains("part 0 is missing"), "{told}");
    let told = stderr(&run(&["replay", "--verify", &parts[0], &parts[2]]).code(1));
    assert!(told.contains("part 1 is missing"), "{told}");
    run(&[
        &["replay", "--verify"][..],
        &parts.iter().map(|p| &**p).collect::<Vec<_>>(),
    ]
    .concat())
    .success();
}

#[test]
fn a_file_is_given_once() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    simulate(here, "drive.mcap", 1);
    fs::hard_link(here.join("drive.mcap"), here.join("hard.mcap")).expect("linked");
    std::os::unix::fs::symlink("drive.mcap", here.join("soft.mcap")).expect("linked");
    for other in ["drive.mcap", "./drive.mcap", "hard.mcap", "soft.mcap"] {
        for command in ["info", "replay", "report", "score"] {
            let told = stderr(
                &atvrec(here)
                    .args([command, "drive.mcap", other])
                    .assert()
                    .code(1),
            );
            assert!(
                told.contains("are the same file"),
                "{command} {other}: {told}"
            );
        }
    }
}

/// Runs `simulate --truth`, which must refuse the file within a time and some memory.
fn refused_truth(here: &Path, name: &str, part: &str) {
    let begin = Instant::now();
    let program = env!("CARGO_BIN_EXE_atvrec");
    // 4 GB of addresses, so that memory that is only declared counts, too.
    let script =
        format!("ulimit -v 4000000; exec {program} simulate --truth {name} -o x.mcap --force");
    let output = std::process::Command::new("bash")
        .args(["-c", &script])
        .current_dir(here)
        .output()
        .expect("bash runs");
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{name}: {told}");
    assert!(told.contains(part), "{name}: {told}");
    assert!(!told.contains("panicked"), "{name}: {told}");
    assert!(
        begin.elapsed() < Duration::from_secs(20),
        "{name} took {:?}",
        begin.elapsed()
    );
    assert!(!here.join("x.mcap").exists() && !here.join("x.mcap.active").exists());
}

#[test]
fn tables_that_make_no_sense_are_refused_in_bounded_time_and_memory() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let long = format!("t[s],{}\n", "x".repeat(4 << 20));
    let many = (0..200_000).map(|n| format!("c{n},")).collect::<String>() + "t[s]\n";
    let quote = format!("t[s],\"roll[rad]\n{}", "1,2\n".repeat(300_000));
    for (name, text, part) in [
        ("long.csv", long, "bytes in a line"),
        ("many.csv", many, "bytes in a line"),
        ("quote.csv", quote, "does not have the column"),
        ("wide.csv", "a,".repeat(20_000) + "t[s]\n", "columns"),
        ("empty.csv", String::new(), "does not have the column"),
        (
            "cell.csv",
            format!("t[s]\n{}\n", "9".repeat(100_000) + "x"),
            "not a finite number",
        ),
        ("text.parquet", "no table".to_owned(), "cannot read"),
        ("none.parquet", String::new(), "no Parquet file"),
        (
            "gap.csv",
            truth_table(&[0.0, 0.01, 4000.0]),
            "the gap between rows 2 and 3 is 3999.99 s",
        ),
        (
            "back.csv",
            truth_table(&[0.0, 0.01, 0.0]),
            "time must increase",
        ),
    ] {
        fs::write(here.join(name), text).expect("written");
        refused_truth(here, name, part);
    }
    fs::File::create(here.join("sparse.csv"))
        .and_then(|file| file.set_len(1 << 42))
        .expect("sparse");
    refused_truth(here, "sparse.csv", "more than 1073741824 bytes");
}

/// A truth file of a vehicle that stands, at these times.
fn truth_table(times_s: &[f64]) -> String {
    let names: Vec<String> = sim::required_columns().collect();
    let mut text = names.join(",") + "\n";
    for time_s in times_s {
        let cells: Vec<String> = names
            .iter()
            .map(|name| {
                if name == "t[s]" {
                    time_s.to_string()
                } else {
                    "0.1".to_owned()
                }
            })
            .collect();
        text.push_str(&(cells.join(",") + "\n"));
    }
    text
}

fn parquet_file(columns: &[&str], rows: usize, nested: bool) -> Vec<u8> {
    use parquet::data_type::DoubleType;
    use parquet::file::properties::WriterProperties;
    use parquet::file::writer::SerializedFileWriter;
    let fields: String = columns
        .iter()
        .map(|name| format!("required double {name};"))
        .collect();
    let open = if nested { "required group a { " } else { "" };
    let close = if nested { " }" } else { "" };
    let schema = format!("message m {{ {open}{fields}{close} }}");
    let schema = parquet::schema::parser::parse_message_type(&schema).expect("a schema");
    let level = parquet::basic::ZstdLevel::default();
    let properties = WriterProperties::builder()
        .set_compression(parquet::basic::Compression::ZSTD(level))
        .set_dictionary_enabled(false)
        .set_data_page_size_limit(1 << 30)
        .set_data_page_row_count_limit(1 << 30)
        .set_write_batch_size(1 << 30)
        .build();
    let mut bytes = Vec::new();
    let mut writer = SerializedFileWriter::new(&mut bytes, Arc::new(schema), Arc::new(properties))
        .expect("a writer");
    let mut group = writer.next_row_group().expect("a group");
    while let Some(mut column) = group.next_column().expect("a column") {
        let values = vec![0.0; rows];
        column
            .typed::<DoubleType>()
            .write_batch(&values, None, None)
            .expect("written");
        column.close().expect("closed");
    }
    group.close().expect("closed");
    writer.close().expect("closed");
    bytes
}

#[test]
fn parquet_files_that_declare_what_is_not_there_are_refused() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let write = |name: &str, bytes: &[u8]| fs::write(here.join(name), bytes).expect("written");
    // A page that inflates to 80 MB from some kB.
    let bomb = parquet_file(&["t[s]"], 10_000_000, false);
    assert!(bomb.len() < 100_000, "{}", bomb.len());
    write("bomb.parquet", &bomb);
    refused_truth(here, "bomb.parquet", "bytes after decompression");
    write("nested.parquet", &parquet_file(&["t[s]"], 10, true));
    refused_truth(here, "nested.parquet", "lists or structures");
    let names: Vec<String> = (0..20_000).map(|n| format!("c{n}")).collect();
    let names: Vec<&str> = names.iter().map(|name| &**name).collect();
    write("wide.parquet", &parquet_file(&names, 1, false));
    refused_truth(here, "wide.parquet", "more than 10000 columns");
    // Every byte of a small file, changed: an error or the same table, never a panic.
    let whole = parquet_file(&["t[s]"], 100, false);
    for at in (4..whole.len()).step_by(3) {
        for bits in [0x01, 0x80, 0xFF] {
            let mut changed = whole.clone();
            changed[at] ^= bits;
            write("changed.parquet", &changed);
            let refusal = sim::Motion::open(&here.join("changed.parquet"));
            assert!(refusal.is_err(), "byte {at}: other columns are missing");
        }
    }
}

#[test]
fn texts_that_make_no_sense_are_refused_by_import() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let map = "[time]\ncolumn = \"t\"\nunit = \"s\"\n[column.v]\nfrom = \"v\"\nquantity = \"speed.forward\"\nunit = \"m/s\"\n";
    fs::write(here.join("map.toml"), map).expect("written");
    let import = |part: &str, code: i32| {
        let begin = Instant::now();
        let assert = atvrec(here)
            .args([
                "import",
                "csv",
                "t.csv",
                "--columns",
                "map.toml",
                "-o",
                "x.mcap",
            ])
            .assert()
            .code(code);
        let told = stderr(&assert);
        assert!(
            told.contains(part) && told.len() < 8_000,
            "{part}: {} bytes, {told:.300}",
            told.len()
        );
        assert!(begin.elapsed() < Duration::from_secs(20));
        assert!(!here.join("x.mcap").exists());
    };
    for (text, part, code) in [
        (
            format!("t,v\n0,{}\n", "1".repeat(1 << 20)),
            "the limit is 65536",
            1,
        ),
        (
            format!("{}\n", "x,".repeat(1 << 20)),
            "the limit is 65536",
            1,
        ),
        (format!("{}\n", "x,".repeat(30_000)), "and 29951 more", 2),
        (
            format!("t,v\n0,{}x\n", "1".repeat(60_000)),
            "is not a number",
            2,
        ),
        (
            format!("t,v\n{}x,1\n", "1".repeat(60_000)),
            "is not a time",
            2,
        ),
        ("t,v\n1e17,1\n".to_owned(), "out of range", 2),
        ("t,v\n0,1\n0,1e400\n".to_owned(), "is not a number", 2),
    ] {
        fs::write(here.join("t.csv"), text).expect("written");
        import(part, code);
    }
    fs::File::create(here.join("t.csv"))
        .and_then(|file| file.set_len(1 << 42))
        .expect("sparse");
    import("more than 1073741824 bytes", 2);
}
