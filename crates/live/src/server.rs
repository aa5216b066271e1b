//! The server: page, data of the page, Foxglove protocol, and requests that write, on one port.

use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use axum::Extension;
use axum::Router;
use axum::body::Bytes;
use axum::extract::rejection::BytesRejection;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::{DefaultBodyLimit, Request, State};
use axum::http::{HeaderValue, StatusCode, Uri, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Redirect, Response};
use axum::routing::{get, post};
use serde_json::{Value, json};
use tokio::net::TcpListener;
use tokio::sync::{Semaphore, watch};
use tokio::time::sleep;

use crate::auth::{Access, Permission, Refusal, token_of};
use crate::recorder::{Control, MARK_MAX};
use crate::tls::{self, Listener};
use crate::{Hub, Playback, foxglove, page};

/// Longest body of a request, bytes.
const BODY_MAX: usize = 64 << 10;
/// Longest message of a websocket, bytes. A mark that is too long gets an answer.
const MESSAGE_MAX: usize = 4 << 20;
/// Connections without websocket for each client: files of the page.
const CONNECTIONS_FOR_EACH: usize = 4;
/// Delay of the answer to a wrong token.
const WRONG_TOKEN_DELAY: Duration = Duration::from_millis(500);
/// Period of the requests for the state of the recorder, while a page is open.
const STATUS_PERIOD: Duration = Duration::from_millis(500);
/// Only own files, and nothing of another host.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; \
                      img-src 'self' data:; connect-src 'self'; manifest-src 'self'; \
                      frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

/// Settings of a server.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Address and port.
    pub address: SocketAddr,
    /// Token; needed on another address than loopback.
    pub token: Option<String>,
    /// Names beside the address by which browsers may call the server.
    pub hosts: Vec<String>,
    /// Certificate chain and private key (PEM).
    pub tls: Option<[PathBuf; 2]>,
    /// Most clients at the same time.
    pub clients_max: usize,
}

/// Why a server cannot start.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The port cannot be opened.
    #[error(
        "cannot listen on {address}: {cause}; {}: set live.address of the configuration, or --listen",
        reason(cause)
    )]
    Listen {
        /// Address and port.
        address: SocketAddr,
        /// The error of the operating system.
        cause: io::Error,
    },
    /// The address is reachable from other computers, and there is no token.
    #[error(
        "{0} is reachable from other computers and needs a token: set live.token_file of the \
         configuration, or --token-file, to a file with at least 16 characters (openssl rand -hex 16 \
         makes one), or listen on 127.0.0.1"
    )]
    NoToken(SocketAddr),
    /// Certificate or key cannot be used.
    #[error("cannot use {}: {cause}; live.certificate and live.key are PEM files", path.display())]
    Certificate {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: String,
    },
}

/// What an error of listening means.
fn reason(cause: &io::Error) -> &'static str {
    match cause.kind() {
        io::ErrorKind::AddrInUse => "another program uses the port",
        io::ErrorKind::AddrNotAvailable => "this computer does not have the address at present",
        io::ErrorKind::PermissionDenied => "only root may use ports below 1024",
        _ => "the address or the port cannot be used",
    }
}

/// What all clients share.
pub(crate) struct Shared {
    pub(crate) hub: Hub,
    pub(crate) control: Control,
    pub(crate) playback: Option<Playback>,
    access: Access,
    is_tls: bool,
    clients: Arc<Semaphore>,
    status: watch::Sender<Arc<Value>>,
}

impl Shared {
    /// State of the recorder.
    pub(crate) fn status(&self) -> watch::Receiver<Arc<Value>> {
        self.status.subscribe()
    }
}

/// A server that listens.
pub struct Server {
    listener: Listener,
    address: SocketAddr,
    router: Router,
    shared: Arc<Shared>,
}

impl Server {
    /// Opens the port. `control` reaches the recorder, and `playback` a replay.
    ///
    /// # Errors
    /// If the port cannot be opened, a token is missing, or the certificate cannot be used.
    pub async fn open(
        settings: Settings,
        hub: Hub,
        control: Control,
        playback: Option<Playback>,
    ) -> Result<Self, Error> {
        let asked = settings.address;
        if !asked.ip().is_loopback() && settings.token.is_none() {
            return Err(Error::NoToken(asked));
        }
        let tls = settings.tls.as_ref();
        let tls = tls.map(|[certificate, key]| tls::acceptor(certificate, key));
        let tls = tls.transpose()?;
        let is_tls = tls.is_some();
        let error = |cause| Error::Listen {
            address: asked,
            cause,
        };
        let tcp = TcpListener::bind(asked).await.map_err(error)?;
        let address = tcp.local_addr().map_err(error)?;
        let connections = CONNECTIONS_FOR_EACH * settings.clients_max;
        let listener = Listener::start(tcp, tls, connections).map_err(error)?;
        let shared = Arc::new(Shared {
            hub,
            control,
            playback,
            access: Access::new(address, settings.hosts, settings.token),
            is_tls,
            clients: Arc::new(Semaphore::new(settings.clients_max)),
            status: watch::Sender::new(Arc::default()),
        });
        Ok(Self {
            listener,
            address,
            router: router(&shared),
            shared,
        })
    }

    /// Address and port.
    #[must_use]
    pub const fn address(&self) -> SocketAddr {
        self.address
    }

    /// Serves clients for ever.
    ///
    /// # Errors
    /// If the server cannot go on.
    pub async fn run(self) -> io::Result<()> {
        let shared = self.shared;
        tokio::spawn(async move {
            loop {
                if shared.status.receiver_count() > 0 {
                    let answer = shared
                        .control
                        .request(&json!({ "command": "status" }))
                        .await;
                    let status = answer.unwrap_or_else(|error| json!({ "error": error }));
                    shared.status.send_replace(Arc::new(status));
                }
                sleep(STATUS_PERIOD).await;
            }
        });
        axum::serve(self.listener, self.router).await
    }
}

fn router(shared: &Arc<Shared>) -> Router {
    Router::new()
        .route("/", get(root))
        .route("/ws", get(page_data))
        .route("/api/mark", post(mark))
        .route(
            "/api/start",
            post(|s: Shares, p: Permits| command(s, p, "start")),
        )
        .route(
            "/api/stop",
            post(|s: Shares, p: Permits| command(s, p, "stop")),
        )
        .fallback(get(file))
        .layer(DefaultBodyLimit::max(BODY_MAX))
        .layer(from_fn_with_state(Arc::clone(shared), check))
        .with_state(Arc::clone(shared))
}

type Shares = State<Arc<Shared>>;
type Permits = Extension<Permission>;

/// Checks who asks, before anything else.
async fn check(shares: Shares, mut request: Request, next: Next) -> Response {
    let shared = &shares.0;
    let permission = shared.access.check(request.headers(), request.uri());
    let mut response = match permission {
        Ok(permission) => {
            request.extensions_mut().insert(permission);
            next.run(request).await
        }
        Err(refusal) => {
            tracing::warn!(?refusal, path = request.uri().path(), "refused a request");
            if refusal == Refusal::WrongToken {
                sleep(WRONG_TOKEN_DELAY).await;
            }
            let status = match refusal {
                Refusal::NoToken | Refusal::WrongToken => StatusCode::UNAUTHORIZED,
                Refusal::Host | Refusal::Origin => StatusCode::FORBIDDEN,
            };
            (status, refusal.text()).into_response()
        }
    };
    let headers = response.headers_mut();
    for (name, value) in [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-store"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

/// The page, or the Foxglove protocol on the same address. A token in the address becomes a cookie.
async fn root(
    State(shared): Shares,
    Extension(permission): Permits,
    uri: Uri,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Response {
    if let Ok(upgrade) = upgrade {
        let upgrade = upgrade.protocols([foxglove::SUBPROTOCOL]);
        if upgrade.selected_protocol().is_none() {
            let text = "this websocket has the subprotocol foxglove.sdk.v1\n";
            return (StatusCode::BAD_REQUEST, text).into_response();
        }
        return admit(shared, upgrade, move |socket, shared| {
            foxglove::serve(socket, shared, permission)
        });
    }
    if token_of(&uri).is_some() {
        return match shared.access.begin_session(shared.is_tls) {
            Ok(cookie) => ([(header::SET_COOKIE, cookie)], Redirect::to("/")).into_response(),
            Err(error) => {
                let text = format!("cannot begin a session: {error}\n");
                (StatusCode::INTERNAL_SERVER_ERROR, text).into_response()
            }
        };
    }
    file(Uri::from_static("/index.html")).await
}

async fn page_data(
    State(shared): Shares,
    Extension(permission): Permits,
    upgrade: WebSocketUpgrade,
) -> Response {
    admit(shared, upgrade, move |socket, shared| {
        page::serve(socket, shared, permission)
    })
}

/// Serves a websocket if there is a free place.
fn admit<F>(
    shared: Arc<Shared>,
    upgrade: WebSocketUpgrade,
    serve: impl FnOnce(axum::extract::ws::WebSocket, Arc<Shared>) -> F + Send + 'static,
) -> Response
where
    F: Future<Output = ()> + Send + 'static,
{
    let Ok(place) = Arc::clone(&shared.clients).try_acquire_owned() else {
        tracing::warn!("refused a client: live.clients_max clients are connected");
        let text =
            "as many clients are connected as may be; close one, or raise live.clients_max\n";
        return (StatusCode::SERVICE_UNAVAILABLE, text).into_response();
    };
    upgrade
        .max_message_size(MESSAGE_MAX)
        .on_upgrade(move |socket| async move {
            serve(socket, shared).await;
            drop(place);
        })
}

async fn mark(
    State(shared): Shares,
    Extension(permission): Permits,
    body: Result<Bytes, BytesRejection>,
) -> Response {
    let body = match body {
        Ok(body) => body,
        Err(rejection) if rejection.status() == StatusCode::PAYLOAD_TOO_LARGE => {
            let error = format!(
                "the request has more than {BODY_MAX} bytes; use at most {MARK_MAX} characters for \
                 a mark"
            );
            return answer(StatusCode::PAYLOAD_TOO_LARGE, json!({ "error": error }));
        }
        Err(rejection) => {
            let text = format!("the request is incomplete: {rejection}");
            return answer(StatusCode::BAD_REQUEST, json!({ "error": text }));
        }
    };
    let body: Value = match serde_json::from_slice(&body) {
        Ok(body) => body,
        Err(error) => {
            let text = format!("the request is not JSON: {error}");
            return answer(StatusCode::BAD_REQUEST, json!({ "error": text }));
        }
    };
    if permission != Permission::Write {
        return needs_token();
    }
    let text = body["text"].as_str().unwrap_or_default();
    result(shared.control.mark(text).await)
}

async fn command(
    State(shared): Shares,
    Extension(permission): Permits,
    command: &'static str,
) -> Response {
    if permission != Permission::Write {
        return needs_token();
    }
    result(shared.control.request(&json!({ "command": command })).await)
}

fn needs_token() -> Response {
    let error = "marks, start and stop need the token: open the page once with ?token=TOKEN behind \
                 its address";
    answer(StatusCode::FORBIDDEN, json!({ "error": error }))
}

fn result(result: Result<Value, String>) -> Response {
    match result {
        Ok(value) => answer(StatusCode::OK, value),
        Err(error) => answer(StatusCode::BAD_GATEWAY, json!({ "error": error })),
    }
}

fn answer(status: StatusCode, value: Value) -> Response {
    let json = [(header::CONTENT_TYPE, "application/json")];
    (status, json, value.to_string()).into_response()
}

/// A file of the page.
async fn file(uri: Uri) -> Response {
    macro_rules! files {
        ($($name:literal $kind:literal),* $(,)?) => {
            [$((concat!("/", $name), $kind, include_bytes!(concat!("../assets/", $name)) as &[u8])),*]
        };
    }
    let files = files![
        "index.html" "text/html; charset=utf-8",
        "page.css" "text/css; charset=utf-8",
        "main.js" "text/javascript; charset=utf-8",
        "connection.js" "text/javascript; charset=utf-8",
        "vehicle.js" "text/javascript; charset=utf-8",
        "warnings.js" "text/javascript; charset=utf-8",
        "recorder.js" "text/javascript; charset=utf-8",
        "plots.js" "text/javascript; charset=utf-8",
        "map.js" "text/javascript; charset=utf-8",
        "format.js" "text/javascript; charset=utf-8",
        "icon.svg" "image/svg+xml",
        "uplot/uPlot.esm.js" "text/javascript; charset=utf-8",
        "uplot/uPlot.min.css" "text/css; charset=utf-8",
        "uplot/LICENSE" "text/plain; charset=utf-8",
    ];
    let found = files.iter().find(|(name, ..)| *name == uri.path());
    match found {
        Some((_, kind, bytes)) => ([(header::CONTENT_TYPE, *kind)], *bytes).into_response(),
        None => (StatusCode::NOT_FOUND, "there is no such file\n").into_response(),
    }
}
