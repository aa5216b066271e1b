use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Command, Stdio};

use sample::LogTime;
use store::Reader;

use crate::outside::Recorder;
use crate::support::{atvrec, simulate, stderr};

/// A source whose device does not exist: the recorder runs and waits for it.
const CONFIG: &str = "[source.imu]\nkind = \"crossbow440\"\ndevice = \"absent\"\n";

fn live_fails(directory: &Path, arguments: &[&str]) -> String {
    let assert = atvrec(directory)
        .args(["live", "--socket", "absent"])
        .args(arguments)
        .timeout(std::time::Duration::from_secs(20))
        .assert()
        .failure();
    stderr(&assert)
}

#[test]
fn the_live_process_says_why_it_cannot_listen() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let error = live_fails(here, &["--listen", "0.0.0.0:0"]);
    assert!(error.contains("needs a token"), "{error}");
    assert!(error.contains("openssl rand"), "{error}");

    let used = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = used.local_addr().expect("an address").to_string();
    let error = live_fails(here, &["--listen", &address]);
    assert!(
        error.contains(&format!("cannot listen on {address}")),
        "{error}"
    );
    assert!(error.contains("another program uses the port"), "{error}");
    assert!(error.contains("live.address"), "{error}");
    std::fs::write(here.join("good"), "0123456789abcdef\n").expect("written");
    // An address of TEST-NET-1, which no computer has.
    let error = live_fails(here, &["--listen", "192.0.2.1:9", "--token-file", "good"]);
    assert!(error.contains("does not have the address"), "{error}");

    std::fs::write(here.join("token"), "short\n").expect("written");
    let error = live_fails(here, &["--token-file", "token"]);
    assert!(error.contains("at least 16"), "{error}");
    assert!(
        !error.contains("short"),
        "the token is in no message: {error}"
    );
    let error = live_fails(here, &["--listen", "localhost:8765"]);
    assert!(error.contains("use an IP address and a port"), "{error}");
    let error = live_fails(here, &["--token-file", "absent"]);
    assert!(
        error.contains("cannot read the token file absent"),
        "{error}"
    );
}

/// The certificate in `testdata/tls` expired on 2021-01-02. Its key is in the same file.
#[test]
fn an_expired_certificate_is_named_with_its_date_and_the_server_starts() {
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    let project = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let pem = project.join("testdata/tls/expired.pem");
    std::fs::copy(pem, here.join("vehicle.pem")).expect("copied");
    let table = "[live]\ncertificate = \"vehicle.pem\"\nkey = \"vehicle.pem\"\n";
    std::fs::write(here.join("atvrec.toml"), format!("{CONFIG}{table}")).expect("written");
    let mut live = Command::new(env!("CARGO_BIN_EXE_atvrec"))
        .args(["live", "--config", "atvrec.toml", "--listen", "127.0.0.1:0"])
        .current_dir(here)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let mut lines = BufReader::new(live.stdout.take().expect("piped")).lines();
    let first = lines.next().expect("a line").expect("text");
    let _ = live.kill();
    let mut told = String::new();
    let mut errors = live.stderr.take().expect("piped");
    errors.read_to_string(&mut told).expect("text");
    let _ = live.wait();
    assert!(first.contains("https://127.0.0.1:"), "{first}");
    for text in [
        "vehicle.pem expired on 2021-01-02 03:04 UTC",
        "replace live.certificate",
        "set the clock",
    ] {
        assert!(told.contains(text), "{told}");
    }
}

#[test]
fn an_output_that_is_down_is_reported_and_the_recorder_records() {
    let directory = tempfile::tempdir().expect("a directory");
    let config = format!("{CONFIG}[output.can]\ninterface = \"absent0\"\n");
    let recorder = Recorder::start(directory.path(), &config);
    recorder.wait_for("output.can cannot send");
    let assert = recorder.ask(&["status", "--json"]).assert().success();
    let status: serde_json::Value =
        serde_json::from_slice(&assert.get_output().stdout).expect("JSON");
    assert_eq!(status["writing"], "recording");
    assert_eq!(status["output_can"]["open"], false);
    let problem = status["output_can"]["problem"].as_str().expect("a text");
    assert!(problem.starts_with("absent0: No such device"), "{problem}");
    let assert = recorder.ask(&["status"]).assert().success();
    let text = String::from_utf8_lossy(&assert.get_output().stdout).into_owned();
    assert!(text.contains("does not send at present: absent0"), "{text}");
    let long = "x".repeat(100_000);
    let error = stderr(&recorder.ask(&["mark", &long]).assert().failure());
    assert!(
        error.contains("100000 characters; use at most 1000"),
        "{error}"
    );
    // Its source sent nothing.
    assert_eq!(recorder.stop(), Some(3));
}

/// Sends a request to the live page. Returns the answer.
fn request(address: &str, head: &str, body: &str) -> String {
    let mut stream = TcpStream::connect(address).expect("a connection");
    let length = body.len();
    let text = format!(
        "{head}\r\nHost: {address}\r\nConnection: close\r\nContent-Length: {length}\r\n\r\n"
    );
    stream.write_all(text.as_bytes()).expect("sent");
    // The server answers before it has read a body that is too long, and closes the connection.
    let _ = stream.write_all(body.as_bytes());
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    String::from_utf8_lossy(&answer).into_owned()
}

#[test]
fn a_log_without_estimates_is_played_and_bad_requests_get_an_answer() {
    const TOKEN: &str = "0123456789abcdef";
    let directory = tempfile::tempdir().expect("a directory");
    let here = directory.path();
    for (name, text) in [
        ("t.csv", "t,v\n0,10\n0.5,10\n1,10\n"),
        (
            "map.toml",
            "[time]\ncolumn = \"t\"\nunit = \"s\"\n[column.v]\nfrom = \"v\"\nquantity = \
             \"speed.forward\"\nunit = \"m/s\"\n",
        ),
        ("token", TOKEN),
    ] {
        std::fs::write(here.join(name), text).expect("written");
    }
    let import = [
        "import",
        "csv",
        "t.csv",
        "--columns",
        "map.toml",
        "-o",
        "t.mcap",
    ];
    atvrec(here).args(import).assert().success();
    let replay = ["replay", "t.mcap", "--live", "--token-file", "token"];
    let mut child = Command::new(env!("CARGO_BIN_EXE_atvrec"))
        .args(replay)
        .args(["--listen", "127.0.0.1:0"])
        .current_dir(here)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("started");
    let mut lines = BufReader::new(child.stdout.take().expect("a pipe")).lines();
    let first = lines.next().expect("a line").expect("text");
    let address = first
        .strip_prefix("live page: http://")
        .expect("an address");
    let address = address.trim_end_matches('/');
    assert!(request(address, "GET / HTTP/1.1", "").contains("<html"));
    let mark = |length: usize| {
        let head = format!("POST /api/mark HTTP/1.1\r\nAuthorization: Bearer {TOKEN}");
        let text = "x".repeat(length);
        request(address, &head, &format!("{{\"text\":\"{text}\"}}"))
    };
    let answer = mark(2000);
    assert!(
        answer.contains("2000 characters; the limit is 1000"),
        "{answer}"
    );
    let answer = mark(1 << 20);
    assert!(answer.starts_with("HTTP/1.1 413"), "{answer}");
    assert!(
        answer.contains("use at most 1000 characters for a mark"),
        "{answer}"
    );
    let wrong = request(address, "GET /?token=wrong HTTP/1.1", "");
    assert!(wrong.contains("the token is wrong"), "{wrong}");
    child.kill().expect("killed");
    let output = child.wait_with_output().expect("ended");
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(messages.contains("the log has no vehicle"), "{messages}");
    assert!(!messages.contains(TOKEN), "{messages}");
}

#[test]
fn a_recorder_is_found_by_its_log_directory_alone() {
    let directory = tempfile::tempdir().expect("a directory");
    let recorder = Recorder::start(directory.path(), CONFIG);
    let elsewhere = tempfile::tempdir().expect("a directory");
    let status = recorder.ask(&["status", "--json"]).assert().success();
    let status: serde_json::Value =
        serde_json::from_slice(&status.get_output().stdout).expect("JSON");
    let logs = directory
        .path()
        .join(status["directory"].as_str().expect("a directory"));
    let found = atvrec(elsewhere.path())
        .args(["status", "--directory"])
        .arg(&logs)
        .assert()
        .success();
    let text = String::from_utf8_lossy(&found.get_output().stdout).into_owned();
    assert!(text.contains("recording"), "{text}");
    assert_eq!(recorder.stop(), Some(3));
}

/// Topics and columns of a layout's paths, such as `/estimate/tyre_forces.wheels[0].z_n`.
fn column_of(path: &str, between: char) -> (String, String) {
    let topic_end = path
        .match_indices('/')
        .nth(if between == '/' { 2 } else { 1 });
    let from = topic_end.map_or(0, |(at, _)| at + usize::from(between == '.'));
    let at = path[from..]
        .find(between)
        .map_or(path.len(), |at| from + at);
    let (topic, rest) = path.split_at(at);
    let mut column = rest.trim_start_matches(between).replace(between, ".");
    for (n, wheel) in ["fl", "fr", "rl", "rr"].into_iter().enumerate() {
        column = column.replace(&format!("wheels[{n}]"), wheel);
    }
    (topic.to_owned(), column)
}

#[test]
fn every_topic_and_field_of_the_layouts_is_in_a_log() {
    let directory = tempfile::tempdir().expect("a directory");
    let log = simulate(directory.path(), "drive.mcap", 1);
    let layouts = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../packaging/layouts");
    let read = |name: &str| std::fs::read_to_string(layouts.join(name)).expect("a layout");
    let mut wanted = Vec::new();
    for text in read("foxglove.json")
        .split('"')
        .filter(|text| text.starts_with('/'))
    {
        wanted.push(column_of(text, '.'));
    }
    let xml = read("plotjuggler.xml");
    let curves = xml.split("<curve name=\"").skip(1);
    wanted.extend(curves.map(|rest| column_of(rest.split('"').next().expect("a name"), '/')));
    for line in read("rerun.py")
        .lines()
        .filter(|line| line.starts_with("    (\"/"))
    {
        let mut texts = line.split('"').skip(1).step_by(2);
        let (topic, column) = (texts.next(), texts.next());
        wanted.push((
            topic.expect("a topic").to_owned(),
            column.expect("a column").to_owned(),
        ));
    }
    assert!(wanted.len() > 30, "{wanted:?}");
    let reader = Reader::open([log]).expect("a log");
    for (topic, column) in wanted {
        // A drive without events has no such topic.
        if topic == "/estimate/events" {
            continue;
        }
        let table = reader.table(&topic, LogTime(0), LogTime(u64::MAX));
        let table = table.unwrap_or_else(|error| panic!("{error}"));
        let is_there = column.is_empty() || table.columns.iter().any(|c| c.name == column);
        assert!(
            is_there && !table.log_time_ns.is_empty(),
            "{topic} {column}"
        );
    }
}
