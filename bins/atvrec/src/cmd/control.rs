//! `atvrec mark`, `status`, `start`, `stop` and `reload`: a word with the running recorder.

use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Context;
use serde_json::Value;

use crate::cli::{MarkArgs, OrderArgs, SocketArgs, StatusArgs};
use crate::config::Config;
use crate::control::{Request, socket_path};
use crate::exit::Outcome;

/// How long an answer is waited for.
const PATIENCE: Duration = Duration::from_secs(3);
/// The same where files have to be closed.
const PATIENCE_WITH_FILES: Duration = Duration::from_secs(60);
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

/// Gives an order and tells what became of it.
pub fn order(args: &OrderArgs, request: &Request) -> anyhow::Result<Outcome> {
    let answer = ask(&args.socket, request)?;
    println!("{}", answer["writing"].as_str().unwrap_or_default());
    Ok(Outcome::Good)
}

/// Shows the state.
pub fn status(args: &StatusArgs) -> anyhow::Result<Outcome> {
    let answer = ask(&args.socket, &Request::Status)?;
    if args.json {
        println!("{answer:#}");
    } else {
        tell(&answer);
    }
    let failing = answer["disk"]["state"] == "failing";
    Ok(if failing {
        Outcome::Failed
    } else {
        Outcome::Good
    })
}

fn ask(socket: &SocketArgs, request: &Request) -> anyhow::Result<Value> {
    let path = match &socket.socket {
        Some(path) => path.clone(),
        None => socket_path(&Config::load(&configuration(socket))?),
    };
    let mut stream = UnixStream::connect(&path).with_context(|| {
        format!(
            "no recorder answers on {}; start one with `atvrec record`, or name its \
             configuration or socket",
            path.display()
        )
    })?;
    let patience = match request {
        Request::Mark { .. } | Request::Status => PATIENCE,
        Request::Start | Request::Stop | Request::Reload => PATIENCE_WITH_FILES,
    };
    stream.set_read_timeout(Some(patience))?;
    writeln!(stream, "{}", serde_json::to_string(request)?)?;
    let mut line = String::new();
    BufReader::new(stream)
        .read_line(&mut line)
        .context("the recorder does not answer")?;
    let answer: Value = serde_json::from_str(&line).context("the recorder's answer is cut")?;
    if let Some(error) = answer["error"].as_str() {
        anyhow::bail!("the recorder refused: {error}");
    }
    Ok(answer)
}

fn configuration(socket: &SocketArgs) -> PathBuf {
    let here = Path::new("atvrec.toml");
    match &socket.config {
        Some(config) => config.clone(),
        None if !here.exists() && Path::new(OF_THE_SERVICE).exists() => OF_THE_SERVICE.into(),
        None => here.to_owned(),
    }
}

fn tell(answer: &Value) {
    println!(
        "{}, {} arrivals",
        answer["writing"].as_str().unwrap_or_default(),
        answer["arrivals"]
    );
    if let Some(kept_s) = answer["memory_s"].as_f64() {
        println!("the last {kept_s:.1} s are kept in memory");
    }
    let disk = &answer["disk"];
    println!(
        "disk: {} {}, {} bytes, {} waiting",
        disk["state"].as_str().unwrap_or("unknown"),
        disk["detail"].as_str().unwrap_or_default(),
        disk["bytes"],
        disk["waiting"]
    );
    println!("  {}", disk["estimate"].as_str().unwrap_or_default());
    tell_backlog(&disk["backlog"]);
    if disk["raw_only"] == true {
        println!("  the disk is nearly full: decoded records are left out, raw data is written");
    }
    for gone in disk["gone"].as_array().into_iter().flatten() {
        println!(
            "  {} was {} while it was being written: {} arrivals lost",
            gone["path"].as_str().unwrap_or_default(),
            gone["what"].as_str().unwrap_or_default(),
            gone["arrivals"]
        );
    }
    for (place, count) in answer["lost"].as_object().into_iter().flatten() {
        if count.as_u64().is_some_and(|count| count > 0) {
            println!("lost ({place}): {count}");
        }
    }
    tell_retention(&answer["retention"]);
    for source in answer["sources"].as_array().into_iter().flatten() {
        println!(
            "  {:<14}{:<10}{:>10} items {:>12} bytes  {}",
            source["name"].as_str().unwrap_or_default(),
            if source["open"] == true {
                "open"
            } else {
                "closed"
            },
            source["items"],
            source["bytes"],
            source["state"].as_str().unwrap_or_default(),
        );
    }
    for name in answer["faulty_sensors"].as_array().into_iter().flatten() {
        println!(
            "  the estimator leaves out: {}",
            name.as_str().unwrap_or_default()
        );
    }
}

fn tell_retention(retention: &Value) {
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
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

/// What waits for the disk, once that is more than what waits for a disk that keeps pace.
fn tell_backlog(backlog: &Value) {
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
