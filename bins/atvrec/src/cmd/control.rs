//! `atvrec mark` and `atvrec status`: a word with the running recorder.

use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::time::Duration;

use anyhow::Context;
use serde_json::Value;

use crate::cli::{MarkArgs, SocketArgs, StatusArgs};
use crate::config::Config;
use crate::control::{Request, socket_path};
use crate::exit::Outcome;

/// How long an answer is waited for.
const PATIENCE: Duration = Duration::from_secs(3);

/// Sets a mark.
pub fn mark(args: &MarkArgs) -> anyhow::Result<Outcome> {
    let request = Request::Mark {
        text: args.text.clone(),
    };
    let (answer, _) = ask(&args.socket, &request)?;
    println!("marked at {} ns", answer["time_ns"]);
    Ok(Outcome::Good)
}

/// Shows the state.
pub fn status(args: &StatusArgs) -> anyhow::Result<Outcome> {
    let (mut answer, config) = ask(&args.socket, &Request::Status)?;
    name_sources(&mut answer, config.as_ref());
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

fn ask(socket: &SocketArgs, request: &Request) -> anyhow::Result<(Value, Option<Config>)> {
    let (path, config) = match &socket.socket {
        Some(path) => (path.clone(), None),
        None => {
            let config = Config::load(&socket.config)?;
            (socket_path(&config), Some(config))
        }
    };
    let mut stream = UnixStream::connect(&path).with_context(|| {
        format!(
            "no recorder answers on {}; start one with `atvrec record`, or name its \
             configuration or socket",
            path.display()
        )
    })?;
    stream.set_read_timeout(Some(PATIENCE))?;
    writeln!(stream, "{}", serde_json::to_string(request)?)?;
    let mut line = String::new();
    BufReader::new(stream)
        .read_line(&mut line)
        .context("the recorder does not answer")?;
    let answer: Value = serde_json::from_str(&line).context("the recorder's answer is cut")?;
    if let Some(error) = answer["error"].as_str() {
        anyhow::bail!("the recorder refused: {error}");
    }
    Ok((answer, config))
}

/// Puts the configuration's names beside the sources' numbers.
fn name_sources(answer: &mut Value, config: Option<&Config>) {
    let sources = answer["sources"].as_array_mut();
    for source in sources.into_iter().flatten() {
        let name = config.and_then(|config| {
            let known = config.sources.iter();
            let mut known = known.filter(|known| source["source"] == known.spec.id.0);
            known.next().map(|known| known.spec.name.clone())
        });
        let name = match (name, source["source"].as_u64()) {
            (Some(name), _) => name,
            (None, Some(number)) if number == u64::from(sample::SourceId::HOST.0) => {
                "recorder".to_owned()
            }
            (None, number) => format!("#{}", number.unwrap_or_default()),
        };
        source["name"] = name.into();
    }
}

fn tell(answer: &Value) {
    println!("{} arrivals", answer["arrivals"]);
    let disk = &answer["disk"];
    println!(
        "disk: {} {}, {} bytes, {} waiting",
        disk["state"].as_str().unwrap_or("unknown"),
        disk["detail"].as_str().unwrap_or_default(),
        disk["bytes"],
        disk["waiting"]
    );
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
}
