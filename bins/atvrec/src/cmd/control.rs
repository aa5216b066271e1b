//! `atvrec mark`, `status`, `start`, `stop` and `reload`: requests to the running recorder.

use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Context;
use engine::Config;
use sample::Wheel;
use sample::text::{printable, printable_lines};
use serde_json::Value;

use crate::cli::{ControlArgs, MarkArgs, SocketArgs, StatusArgs};
use crate::control::{self, MARK_MAX, Request};
use crate::exit::Outcome;
use crate::values::{self, text};

/// Timeout of a response.
const TIMEOUT: Duration = Duration::from_secs(3);
/// Timeout of a response to a request that closes files.
const TIMEOUT_WITH_FILES: Duration = Duration::from_secs(60);
/// Longest response, bytes.
const RESPONSE_MAX: u64 = 16 << 20;
/// Configuration of a recorder that runs as a service.
pub const SERVICE_CONFIG: &str = "/etc/atvrec/atvrec.toml";

/// Adds a mark.
pub fn mark(args: &MarkArgs) -> anyhow::Result<Outcome> {
    // The recorder does not read a request that is much longer.
    let length = args.text.chars().count();
    anyhow::ensure!(
        length <= MARK_MAX,
        "the text of the mark has {length} characters; use at most {MARK_MAX}"
    );
    let request = Request::Mark {
        text: args.text.clone(),
    };
    let response = send(&args.socket, &request)?;
    println!("added a mark at {} ns", response["time_ns"]);
    Ok(Outcome::Good)
}

/// Sends a command and prints the recorder's state after it.
pub fn command(args: &ControlArgs, request: &Request) -> anyhow::Result<Outcome> {
    let response = send(&args.socket, request)?;
    println!("{}", text(&response["writing"]));
    Ok(Outcome::Good)
}

/// Prints the recorder's state.
pub fn status(args: &StatusArgs) -> anyhow::Result<Outcome> {
    let response = send(&args.socket, &Request::Status)?;
    if args.json {
        println!("{response:#}");
    } else {
        print(&response);
    }
    let failing = response["disk"]["state"] == "failing";
    Ok(if failing {
        Outcome::Failed
    } else {
        Outcome::Good
    })
}

/// Sends a request and returns the response.
pub fn send(socket: &SocketArgs, request: &Request) -> anyhow::Result<Value> {
    let mut stream = connect(socket)?;
    let timeout = match request {
        Request::Mark { .. } | Request::Status => TIMEOUT,
        Request::Start | Request::Stop | Request::Reload => TIMEOUT_WITH_FILES,
    };
    stream.set_read_timeout(Some(timeout))?;
    stream.set_write_timeout(Some(timeout))?;
    writeln!(stream, "{}", serde_json::to_string(request)?)
        .context("cannot send the request to the recorder")?;
    let mut line = String::new();
    BufReader::new(stream.take(RESPONSE_MAX))
        .read_line(&mut line)
        .with_context(|| {
            format!(
                "the recorder did not respond within {} s; see its messages",
                timeout.as_secs()
            )
        })?;
    let response: Value = serde_json::from_str(&line)
        .context("the response of the recorder is incomplete; it may have ended: try again")?;
    if let Some(error) = response["error"].as_str() {
        anyhow::bail!(
            "the recorder rejected the request: {}",
            printable_lines(error)
        );
    }
    Ok(response)
}

/// Possible control sockets of the recorder.
pub fn control_paths(socket: &SocketArgs) -> anyhow::Result<Vec<PathBuf>> {
    match &socket.socket {
        Some(path) => Ok(vec![path.clone()]),
        None => Ok(control::paths(&with_socket(socket)?)),
    }
}

/// Configuration of the recorder.
pub fn with_socket(socket: &SocketArgs) -> anyhow::Result<Config> {
    let mut config = match configuration(socket) {
        // The log directory alone names the socket.
        path if socket.config.is_none() && socket.directory.is_some() && !path.exists() => {
            Config::from_text("", Path::new(""))?
        }
        path => Config::load(&path).context(
            "cannot find the running recorder; select it with --config, --directory or --socket",
        )?,
    };
    if let Some(directory) = &socket.directory {
        config.storage.directory.clone_from(directory);
    }
    Ok(config)
}

/// Connects to the first of the recorder's possible sockets that accepts the connection.
fn connect(socket: &SocketArgs) -> anyhow::Result<UnixStream> {
    let paths = control_paths(socket)?;
    let mut reasons = Vec::new();
    for path in &paths {
        match UnixStream::connect(path) {
            Ok(stream) => return Ok(stream),
            Err(error) => reasons.push(format!("{}: {error}", path.display())),
        }
    }
    anyhow::bail!(
        "cannot connect to a recorder; start one with `atvrec record`, or select it with --config, \
         --directory or --socket (tried {})",
        reasons.join("; ")
    )
}

fn configuration(socket: &SocketArgs) -> PathBuf {
    let local = Path::new("atvrec.toml");
    match &socket.config {
        Some(config) => config.clone(),
        None if !local.exists() && Path::new(SERVICE_CONFIG).exists() => SERVICE_CONFIG.into(),
        None => local.to_owned(),
    }
}

fn print(response: &Value) {
    print!("{}", text(&response["writing"]));
    if let Some(since_s) = response["since_s"].as_f64() {
        print!(" for {}", values::duration(since_s));
    }
    println!(
        ", in {}, {} arrivals",
        text(&response["directory"]),
        response["arrivals"]
    );
    if let Some(kept_s) = response["memory_s"].as_f64() {
        println!("the last {kept_s:.1} s are kept in memory");
    }
    print_disk(&response["disk"]);
    print_losses(response);
    print_retention(&response["retention"]);
    print_sources(response);
    print_estimate(response);
    for name in response["faulty_sensors"].as_array().into_iter().flatten() {
        println!("  excluded by the estimator: {}", text(name));
    }
    print_outputs(response);
    for event in response["events"].as_array().into_iter().flatten() {
        let age = values::age_s(response, &event["time"]).unwrap_or_default();
        println!("  {} ago: {}", values::duration(age), text(&event["text"]));
    }
}

fn print_sources(response: &Value) {
    for source in values::sources(response) {
        let rate = &source["rate_hz"];
        let age = source["age_s"].as_f64();
        println!(
            "  {:<14}{:<8}{:>8}/s {:>9} old {:>10} items {:>12} bytes  {}",
            text(&source["name"]),
            if source["open"] == true {
                "open"
            } else {
                "closed"
            },
            values::number(rate, 0),
            age.map_or_else(|| "–".to_owned(), values::duration),
            source["items"],
            source["bytes"],
            text(&source["state"]),
        );
        if source["late"] != 0 || source["too_late"] != 0 {
            println!(
                "                late: {} by 5 to 100 ms, used at their own time; {} later, not used",
                source["late"], source["too_late"]
            );
        }
        let undecoded = source["undecoded"].as_array().into_iter().flatten();
        let undecoded: Vec<String> = undecoded
            .map(|message| format!("{} {}", text(&message["name"]), message["count"]))
            .collect();
        if !undecoded.is_empty() {
            println!("                not decoded: {}", undecoded.join(", "));
        }
    }
}

fn print_estimate(response: &Value) {
    let Some(estimate) = values::recent(response) else {
        println!("no estimate at present");
        return;
    };
    let motion = &estimate["motion"];
    println!(
        "speed {} m/s, roll {}°, pitch {}°, load-transfer ratio {} ± {}",
        values::number(&motion["velocity_x_m_s"], 1),
        values::degrees(&motion["roll_rad"]),
        values::degrees(&motion["pitch_rad"]),
        values::number(&estimate["rollover"]["load_transfer_ratio"], 3),
        values::number(&estimate["rollover"]["load_transfer_ratio_sigma"], 3),
    );
    if let Some(next) = values::next_lift(response) {
        println!(
            "  {} lifts in {:.2} s if its load keeps falling",
            next.wheel, next.time_s
        );
    }
    for wheel in Wheel::ALL {
        let force = &estimate["carrier"][wheel.index()];
        let axis = |n: usize| {
            let value = values::number(&force["force_n"][n], 0);
            format!(
                "{value:>6} ± {:>4}",
                values::number(&force["sigma_n"][n], 0)
            )
        };
        println!(
            "  {wheel}  F_x {} N   F_y {} N   F_z {} N{}",
            axis(0),
            axis(1),
            axis(2),
            match values::is_off_ground(estimate, wheel) {
                true => "   off the ground",
                false => "",
            }
        );
    }
}

fn print_outputs(response: &Value) {
    let can = &response["output_can"];
    if can.is_object() {
        println!(
            "output.can: {} sets of frames sent, {} of them stale, {} frames lost{}{}",
            can["sets"],
            can["stale_sets"],
            can["lost_frames"],
            match can["latency_median_ms"].as_f64() {
                Some(median_ms) => format!(
                    ", latency {median_ms:.1} ms (99 %: {} ms)",
                    values::number(&can["latency_99_ms"], 1)
                ),
                None => String::new(),
            },
            match &*text(&can["problem"]) {
                "" => String::new(),
                problem => format!("; it does not send at present: {problem}"),
            }
        );
    }
    let tap = &response["tap"];
    if tap["clients"].as_u64().is_some_and(|count| count > 0) || tap["lost"] != 0 {
        println!(
            "live: {} connected, {} records left out for slow clients",
            tap["clients"], tap["lost"]
        );
    }
}

fn print_disk(disk: &Value) {
    let state = match (&*text(&disk["state"]), &*text(&disk["detail"])) {
        (state, "") => state.to_owned(),
        ("failing", reason) => format!("failing: {reason}"),
        (state, file) => format!("{state} {file}"),
    };
    println!(
        "disk: {state}, {} bytes written, {} items waiting",
        disk["bytes"], disk["waiting"]
    );
    println!("  {}", text(&disk["estimate"]));
}

fn print_retention(retention: &Value) {
    if retention["removed"].as_u64().is_some_and(|count| count > 0) {
        println!(
            "  removed {} logs ({} bytes); the last one was {}, for the limit {}",
            retention["removed"],
            retention["removed_bytes"],
            text(&retention["last"]),
            text(&retention["reason"])
        );
    }
    for exceeded in retention["broken"].as_array().into_iter().flatten() {
        println!("  {}", text(exceeded));
    }
}

/// Prints the backlog of the disk, logs that were deleted or renamed, and losses.
fn print_losses(response: &Value) {
    let disk = &response["disk"];
    print_backlog(&disk["backlog"]);
    if disk["raw_only"] == true {
        println!(
            "  the disk is nearly full: only raw data is written, without decoded records; free \
             space on it"
        );
    }
    for gone in disk["gone"].as_array().into_iter().flatten() {
        println!(
            "  {} was {} while it was being written: {} arrivals lost",
            text(&gone["path"]),
            text(&gone["what"]),
            gone["arrivals"]
        );
    }
    for (place, count) in response["lost"].as_object().into_iter().flatten() {
        if count.as_u64().is_some_and(|count| count > 0) {
            println!("lost ({}): {count}", printable(place));
        }
    }
}

/// Prints the data that waits for the disk, if it is more than for a disk that is fast enough.
fn print_backlog(backlog: &Value) {
    let number = |name: &str| backlog[name].as_f64().unwrap_or_default();
    let (seconds, unsynced_s) = (number("seconds"), number("unsynced_s"));
    if seconds < 1.0 && unsynced_s < 1.0 {
        return;
    }
    println!(
        "  the disk is slow: {} arrivals ({:.1} s, {:.1} kB) wait, the queue is {} % full, and \
         written data has not been confirmed for {unsynced_s:.1} s",
        backlog["arrivals"],
        seconds,
        number("bytes") / 1000.0,
        backlog["queue_percent"]
    );
}
