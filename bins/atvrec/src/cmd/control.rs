//! `atvrec mark`, `status`, `start`, `stop` and `reload`: requests to the running recorder.

use std::borrow::Cow;
use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Context;
use engine::Config;
use sample::text::{printable, printable_lines};
use serde_json::Value;

use crate::cli::{MarkArgs, OrderArgs, SocketArgs, StatusArgs};
use crate::control::{self, Request};
use crate::exit::Outcome;

/// How long an answer is waited for.
const PATIENCE: Duration = Duration::from_secs(3);
/// The same where files have to be closed.
const PATIENCE_WITH_FILES: Duration = Duration::from_secs(60);
/// Longest answer, bytes.
const ANSWER_MAX: u64 = 16 << 20;
/// The configuration of a recorder that runs as a service.
const OF_THE_SERVICE: &str = "/etc/atvrec/atvrec.toml";

/// Sets a mark.
pub fn mark(args: &MarkArgs) -> anyhow::Result<Outcome> {
    let request = Request::Mark {
        text: args.text.clone(),
    };
    let answer = ask(&args.socket, &request)?;
    println!("marked at {} ns", answer["time_ns"]);
    Ok(Outcome::Good)
}

/// Sends an order and prints the recorder's state after it.
pub fn order(args: &OrderArgs, request: &Request) -> anyhow::Result<Outcome> {
    let answer = ask(&args.socket, request)?;
    println!("{}", text(&answer["writing"]));
    Ok(Outcome::Good)
}

/// Shows the state.
pub fn status(args: &StatusArgs) -> anyhow::Result<Outcome> {
    let answer = ask(&args.socket, &Request::Status)?;
    if args.json {
        println!("{answer:#}");
    } else {
        print(&answer);
    }
    let failing = answer["disk"]["state"] == "failing";
    Ok(if failing {
        Outcome::Failed
    } else {
        Outcome::Good
    })
}

fn ask(socket: &SocketArgs, request: &Request) -> anyhow::Result<Value> {
    let mut stream = connect(socket)?;
    let patience = match request {
        Request::Mark { .. } | Request::Status => PATIENCE,
        Request::Start | Request::Stop | Request::Reload => PATIENCE_WITH_FILES,
    };
    stream.set_read_timeout(Some(patience))?;
    stream.set_write_timeout(Some(patience))?;
    writeln!(stream, "{}", serde_json::to_string(request)?)?;
    let mut line = String::new();
    BufReader::new(stream.take(ANSWER_MAX))
        .read_line(&mut line)
        .context("the recorder does not answer")?;
    let answer: Value = serde_json::from_str(&line).context("the recorder's answer is cut")?;
    if let Some(error) = answer["error"].as_str() {
        anyhow::bail!("the recorder refused: {}", printable_lines(error));
    }
    Ok(answer)
}

/// Connects to the first of the recorder's possible sockets that accepts.
fn connect(socket: &SocketArgs) -> anyhow::Result<UnixStream> {
    let paths = match &socket.socket {
        Some(path) => vec![path.clone()],
        None => {
            let mut config = Config::load(&configuration(socket))?;
            if let Some(directory) = &socket.directory {
                config.storage.directory.clone_from(directory);
            }
            control::paths(&config)
        }
    };
    let mut reasons = Vec::new();
    for path in &paths {
        match UnixStream::connect(path) {
            Ok(stream) => return Ok(stream),
            Err(error) => reasons.push(format!("{}: {error}", path.display())),
        }
    }
    anyhow::bail!(
        "no recorder answers; start one with `atvrec record`, or name its configuration or \
         socket ({})",
        reasons.join("; ")
    )
}

fn configuration(socket: &SocketArgs) -> PathBuf {
    let here = Path::new("atvrec.toml");
    match &socket.config {
        Some(config) => config.clone(),
        None if !here.exists() && Path::new(OF_THE_SERVICE).exists() => OF_THE_SERVICE.into(),
        None => here.to_owned(),
    }
}

/// A text of the answer, in one line.
fn text(value: &Value) -> Cow<'_, str> {
    printable(value.as_str().unwrap_or_default())
}

fn print(answer: &Value) {
    println!(
        "{}, {} arrivals",
        text(&answer["writing"]),
        answer["arrivals"]
    );
    if let Some(kept_s) = answer["memory_s"].as_f64() {
        println!("the last {kept_s:.1} s are kept in memory");
    }
    let disk = &answer["disk"];
    println!(
        "disk: {} {}, {} bytes, {} waiting",
        text(&disk["state"]),
        text(&disk["detail"]),
        disk["bytes"],
        disk["waiting"]
    );
    println!("  {}", text(&disk["estimate"]));
    print_losses(answer);
    print_retention(&answer["retention"]);
    for source in answer["sources"].as_array().into_iter().flatten() {
        println!(
            "  {:<14}{:<10}{:>10} items {:>12} bytes  {}",
            text(&source["name"]),
            if source["open"] == true {
                "open"
            } else {
                "closed"
            },
            source["items"],
            source["bytes"],
            text(&source["state"]),
        );
    }
    for name in answer["faulty_sensors"].as_array().into_iter().flatten() {
        println!("  the estimator leaves out: {}", text(name));
    }
}

fn print_retention(retention: &Value) {
    if retention["removed"].as_u64().is_some_and(|count| count > 0) {
        println!(
            "  removed {} logs, {} bytes, to keep within {}; the last was {}",
            retention["removed"],
            retention["removed_bytes"],
            text(&retention["reason"]),
            text(&retention["last"])
        );
    }
    for broken in retention["broken"].as_array().into_iter().flatten() {
        println!("  {}", text(broken));
    }
}

/// What waits for the disk, what is gone, and what is lost.
fn print_losses(answer: &Value) {
    let disk = &answer["disk"];
    print_backlog(&disk["backlog"]);
    if disk["raw_only"] == true {
        println!("  the disk is nearly full: decoded records are left out, raw data is written");
    }
    for gone in disk["gone"].as_array().into_iter().flatten() {
        println!(
            "  {} was {} while it was being written: {} arrivals lost",
            text(&gone["path"]),
            text(&gone["what"]),
            gone["arrivals"]
        );
    }
    for (place, count) in answer["lost"].as_object().into_iter().flatten() {
        if count.as_u64().is_some_and(|count| count > 0) {
            println!("lost ({}): {count}", printable(place));
        }
    }
}

/// What waits for the disk, once that is more than what waits for a disk that keeps pace.
fn print_backlog(backlog: &Value) {
    let number = |name: &str| backlog[name].as_f64().unwrap_or_default();
    let (seconds, unsynced_s) = (number("seconds"), number("unsynced_s"));
    if seconds < 1.0 && unsynced_s < 1.0 {
        return;
    }
    println!(
        "  the disk is slow: {} arrivals ({:.1} s, {:.1} kB) wait, the queue is {} % full, nothing \
         confirmed for {unsynced_s:.1} s",
        backlog["arrivals"],
        seconds,
        number("bytes") / 1000.0,
        backlog["queue_percent"]
    );
}
