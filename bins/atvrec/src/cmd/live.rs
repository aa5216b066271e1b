//! `atvrec live`: the page, the Foxglove protocol and the outputs over the network.

use std::io::IsTerminal;
use std::net::SocketAddr;
use std::path::Path;

use anyhow::{Context, ensure};
use engine::Config;
use engine::config::{Live, UdpOutput};
use live::{Control, Hub, Playback, Server, Settings, UdpFormat};
use tokio::signal::unix::{SignalKind, signal};

use super::control::{control_paths, with_socket};
use crate::cli::LiveArgs;
use crate::control::tap_paths;
use crate::exit::Outcome;

mod replay;

pub use replay::run as replay;

/// Runs the command.
pub fn run(args: &LiveArgs) -> anyhow::Result<Outcome> {
    let config = match &args.socket.socket {
        // Without a configuration, the defaults hold.
        Some(_) => None,
        None => Some(with_socket(&args.socket)?),
    };
    let sockets = control_paths(&args.socket)?;
    let live = config
        .as_ref()
        .map_or_else(Live::default, |c| c.live.clone());
    let settings = settings(live, args.listen, args.token_file.as_deref())?;
    let udp = config.and_then(|config| config.output.udp);
    let hub = Hub::default();
    let taps = tap_paths(&sockets);
    let follow = live::follow(taps, hub.clone());
    block_on(settings, hub, Control::new(sockets), None, udp, follow)?;
    Ok(Outcome::Good)
}

/// Settings of the server by configuration and command line. Without a token on loopback, a new one
/// is made if a person can read it: marks, start and stop need a token.
pub fn settings(
    live: Live,
    listen: Option<SocketAddr>,
    token_file: Option<&Path>,
) -> anyhow::Result<Settings> {
    let address = listen.unwrap_or(live.address);
    let token = match token_file.or(live.token_file.as_deref()) {
        Some(path) => Some(read_token(path)?),
        None if address.ip().is_loopback() && std::io::stdout().is_terminal() => {
            Some(live::random_token().context("cannot make a token")?)
        }
        None => None,
    };
    Ok(Settings {
        address,
        token,
        hosts: live.hosts,
        tls: live.tls,
        clients_max: live.clients_max,
    })
}

fn read_token(path: &Path) -> anyhow::Result<String> {
    let text = std::fs::read_to_string(path).with_context(|| {
        format!(
            "cannot read the token file {}; `openssl rand -hex 16` makes a token",
            path.display()
        )
    })?;
    let token = text.trim();
    let is_plain = token.bytes().all(|byte| byte.is_ascii_alphanumeric());
    ensure!(
        token.len() >= live::TOKEN_MIN && is_plain,
        "the token in {} must have at least {} letters and digits, and nothing else; `openssl rand \
         -hex 16` makes one",
        path.display(),
        live::TOKEN_MIN
    );
    Ok(token.to_owned())
}

/// Serves until SIGINT or SIGTERM. `source` feeds the hub.
pub fn block_on(
    settings: Settings,
    hub: Hub,
    control: Control,
    playback: Option<Playback>,
    udp: Option<UdpOutput>,
    source: impl Future<Output = ()> + Send + 'static,
) -> anyhow::Result<()> {
    let runtime = runtime()?;
    runtime.block_on(async {
        let (token, scheme) = (settings.token.clone(), scheme(&settings));
        let server = Server::open(settings, hub.clone(), control, playback).await?;
        println!(
            "{}",
            address_text(server.address(), scheme, token.as_deref())
        );
        let server = tokio::spawn(server.run());
        tokio::spawn(source);
        if let Some(udp) = udp {
            tokio::spawn(send_udp(udp, hub));
        }
        let mut interrupt = signal(SignalKind::interrupt())?;
        let mut terminate = signal(SignalKind::terminate())?;
        crate::pipeline::ready();
        tokio::select! {
            ended = server => ended.context("the server panicked")?.context("the server failed"),
            _ = interrupt.recv() => Ok(()),
            _ = terminate.recv() => Ok(()),
        }
    })?;
    runtime.shutdown_background();
    Ok(())
}

/// Threads of the server.
pub fn runtime() -> anyhow::Result<tokio::runtime::Runtime> {
    tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .thread_name("live")
        .enable_all()
        .build()
        .context("cannot start the threads of the server")
}

/// `http` or `https`.
pub const fn scheme(settings: &Settings) -> &'static str {
    match settings.tls {
        Some(_) => "https",
        None => "http",
    }
}

/// Addresses of page and Foxglove protocol. A terminal shows the token; a log never does.
pub fn address_text(address: SocketAddr, scheme: &str, token: Option<&str>) -> String {
    let query = match token {
        Some(token) if std::io::stdout().is_terminal() => format!("?token={token}"),
        _ => String::new(),
    };
    let websocket = scheme.replacen("http", "ws", 1);
    format!(
        "live page: {scheme}://{address}/{query}\nFoxglove and Lichtblick: {websocket}://{address}/"
    )
}

async fn send_udp(output: UdpOutput, hub: Hub) {
    let format = if output.json {
        UdpFormat::Json
    } else {
        UdpFormat::Binary
    };
    if let Err(error) = live::send_udp(output.address, format, hub).await {
        tracing::error!(to = %output.address, %error, "cannot open a port for output.udp");
    }
}

/// Serves the live page of a recording in this process; returns its address.
pub async fn beside(config: &Config, token: String) -> anyhow::Result<SocketAddr> {
    let sockets = crate::control::paths(config);
    let hub = Hub::default();
    let any = SocketAddr::from(([127, 0, 0, 1], 0));
    let mut settings = Settings {
        address: config.live.address,
        token: Some(token),
        hosts: Vec::new(),
        tls: None,
        clients_max: config.live.clients_max,
    };
    let control = Control::new(sockets.clone());
    let server = match Server::open(settings.clone(), hub.clone(), control.clone(), None).await {
        Ok(server) => server,
        Err(_) => {
            // The usual port is in use.
            settings.address = any;
            Server::open(settings, hub.clone(), control, None).await?
        }
    };
    let address = server.address();
    tokio::spawn(server.run());
    tokio::spawn(live::follow(tap_paths(&sockets), hub));
    Ok(address)
}
