//! Connections with and without TLS, and their limits.

mod validity;

use std::io;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::task::{Context, Poll};
use std::time::Duration;

use rustls_pki_types::pem::{self, PemObject};
use rustls_pki_types::{CertificateDer, PrivateKeyDer, UnixTime};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::mpsc;
use tokio::time::{Instant, Sleep, sleep, timeout};
use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::{self, ServerConfig};
use tokio_rustls::server::TlsStream;

use crate::server::Error;

/// Time for a TLS handshake.
const HANDSHAKE: Duration = Duration::from_secs(5);
/// Time without a byte of the client after which a connection is closed. The server pings clients of
/// websockets, so that these send more often.
const SILENCE: Duration = Duration::from_secs(30);
/// Answer to a connection above the limit.
const BUSY: &[u8] = b"HTTP/1.1 503 Service Unavailable\r\ncontent-type: text/plain\r\nconnection: close\r\n\r\nthe server has as many connections as it may have; close another page or raise live.clients_max\n";
/// Answer to a client without TLS of a server with TLS.
const NO_TLS: &[u8] = b"HTTP/1.1 400 Bad Request\r\ncontent-type: text/plain\r\nconnection: close\r\n\r\nthis server uses TLS: begin the address with https:// or wss://\n";
/// Contents of the two files.
const CERTIFICATE: &str = "certificate";
const KEY: &str = "private key without password";
/// First byte of a TLS handshake.
const TLS_HANDSHAKE: u8 = 0x16;
/// Time in which a client that is refused can read the answer.
const REFUSAL: Duration = Duration::from_secs(1);
/// Most bytes that are read of a client that is refused.
const REFUSED_MAX: u64 = 64 << 10;

/// TLS with a certificate chain and its key.
///
/// # Errors
/// If the files cannot be read, or do not fit together.
pub(crate) fn acceptor(certificate: &PathBuf, key: &PathBuf) -> Result<TlsAcceptor, Error> {
    let error = |path: &PathBuf, cause: String| Error::Certificate {
        path: path.clone(),
        cause,
    };
    let chain: Vec<CertificateDer<'static>> = CertificateDer::pem_file_iter(certificate)
        .and_then(Iterator::collect)
        .map_err(|cause| error(certificate, pem_text(&cause, CERTIFICATE)))?;
    if chain.is_empty() {
        return Err(error(
            certificate,
            pem_text(&pem::Error::NoItemsFound, CERTIFICATE),
        ));
    }
    warn_of_dates(certificate, &chain);
    let private =
        PrivateKeyDer::from_pem_file(key).map_err(|cause| error(key, pem_text(&cause, KEY)))?;
    let mut config = ServerConfig::builder()
        .with_no_client_auth()
        .with_single_cert(chain, private)
        .map_err(|cause| match cause {
            rustls::Error::InconsistentKeys(_) => error(
                key,
                format!(
                    "the key is not that of the certificate {}",
                    certificate.display()
                ),
            ),
            other => error(certificate, other.to_string()),
        })?;
    config.alpn_protocols = vec![b"http/1.1".to_vec()];
    Ok(TlsAcceptor::from(Arc::new(config)))
}

/// Warns of a certificate that is not valid at present. The server starts: the clock of a vehicle may be
/// wrong, and a browser can make an exception.
fn warn_of_dates(path: &Path, chain: &[CertificateDer<'_>]) {
    if let Some(problem) = validity::problem(chain, UnixTime::now()) {
        tracing::warn!(
            "the certificate {} {problem}: browsers and Foxglove refuse the connection; replace \
             live.certificate and start again, or set the clock of this computer if its date is wrong",
            path.display()
        );
    }
}

/// `what` the file should contain.
fn pem_text(cause: &pem::Error, what: &str) -> String {
    match cause {
        pem::Error::Io(cause) => cause.to_string(),
        pem::Error::NoItemsFound => format!("the file contains no {what}"),
        other => format!("the file is damaged: {other}"),
    }
}

/// Accepts connections up to a limit.
pub(crate) struct Listener {
    address: SocketAddr,
    ready: mpsc::Receiver<(Connection, SocketAddr)>,
}

impl Listener {
    /// Accepts from `tcp`, at most `limit` connections at the same time.
    pub(crate) fn start(
        tcp: TcpListener,
        tls: Option<TlsAcceptor>,
        limit: usize,
    ) -> io::Result<Self> {
        let address = tcp.local_addr()?;
        let (sender, ready) = mpsc::channel(8);
        tokio::spawn(accept(tcp, tls, limit, sender));
        Ok(Self { address, ready })
    }
}

async fn accept(
    tcp: TcpListener,
    tls: Option<TlsAcceptor>,
    limit: usize,
    sender: mpsc::Sender<(Connection, SocketAddr)>,
) {
    let open = Arc::new(AtomicUsize::new(0));
    loop {
        let (stream, peer) = match tcp.accept().await {
            Ok(accepted) => accepted,
            Err(error) => {
                tracing::warn!(%error, "cannot accept a connection; the next attempt is in 1 s");
                sleep(Duration::from_secs(1)).await;
                continue;
            }
        };
        let place = Place::take(&open, limit);
        let (tls, sender) = (tls.clone(), sender.clone());
        tokio::spawn(async move {
            let Some(place) = place else {
                refuse(stream, BUSY).await;
                return;
            };
            // Without it, small messages wait for acknowledgements.
            let _ = stream.set_nodelay(true);
            let Some(stream) = begin(stream, tls).await else {
                return;
            };
            let connection = Connection {
                stream,
                silence: Box::pin(sleep(SILENCE)),
                _place: place,
            };
            // Fails only when the server ends.
            let _ = sender.send((connection, peer)).await;
        });
    }
}

/// The connection after the TLS handshake, if the server has TLS; `None` if the handshake
/// fails.
async fn begin(stream: TcpStream, tls: Option<TlsAcceptor>) -> Option<Stream> {
    let Some(tls) = tls else {
        return Some(Stream::Plain(stream));
    };
    let mut first = [0];
    let count = timeout(HANDSHAKE, stream.peek(&mut first))
        .await
        .ok()?
        .ok()?;
    if count > 0 && first[0] != TLS_HANDSHAKE {
        refuse(stream, NO_TLS).await;
        return None;
    }
    let stream = timeout(HANDSHAKE, tls.accept(stream)).await.ok()?.ok()?;
    Some(Stream::Tls(Box::new(stream)))
}

/// Writes an answer and closes the connection. What the client has sent is read first, because the
/// answer is lost if a connection is closed with unread data.
async fn refuse(mut stream: TcpStream, answer: &[u8]) {
    // The client may have left.
    let _ = timeout(REFUSAL, async {
        stream.write_all(answer).await?;
        stream.shutdown().await?;
        tokio::io::copy(&mut stream.take(REFUSED_MAX), &mut tokio::io::sink()).await
    })
    .await;
}

impl axum::serve::Listener for Listener {
    type Io = Connection;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Self::Io, Self::Addr) {
        match self.ready.recv().await {
            Some(accepted) => accepted,
            None => std::future::pending().await,
        }
    }

    fn local_addr(&self) -> io::Result<Self::Addr> {
        Ok(self.address)
    }
}

/// One of the limited places of connections.
struct Place(Arc<AtomicUsize>);

impl Place {
    fn take(open: &Arc<AtomicUsize>, limit: usize) -> Option<Self> {
        let taken = open.fetch_update(Ordering::AcqRel, Ordering::Acquire, |count| {
            (count < limit).then_some(count + 1)
        });
        taken.ok().map(|_| Self(Arc::clone(open)))
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::AcqRel);
    }
}

/// A connection, which ends if the client is silent.
pub(crate) struct Connection {
    stream: Stream,
    silence: Pin<Box<Sleep>>,
    _place: Place,
}

enum Stream {
    Plain(TcpStream),
    Tls(Box<TlsStream<TcpStream>>),
}

impl AsyncRead for Connection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let polled = match &mut self.stream {
            Stream::Plain(stream) => Pin::new(stream).poll_read(context, buffer),
            Stream::Tls(stream) => Pin::new(stream).poll_read(context, buffer),
        };
        if polled.is_ready() {
            self.silence.as_mut().reset(Instant::now() + SILENCE);
            return polled;
        }
        match self.silence.as_mut().poll(context) {
            Poll::Ready(()) => Poll::Ready(Err(io::ErrorKind::TimedOut.into())),
            Poll::Pending => Poll::Pending,
        }
    }
}

impl AsyncWrite for Connection {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let polled = match &mut self.stream {
            Stream::Plain(stream) => Pin::new(stream).poll_write(context, bytes),
            Stream::Tls(stream) => Pin::new(stream).poll_write(context, bytes),
        };
        // A client that does not read is silent, too.
        if polled.is_pending() && self.silence.as_mut().poll(context).is_ready() {
            return Poll::Ready(Err(io::ErrorKind::TimedOut.into()));
        }
        polled
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        match &mut self.stream {
            Stream::Plain(stream) => Pin::new(stream).poll_flush(context),
            Stream::Tls(stream) => Pin::new(stream).poll_flush(context),
        }
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        match &mut self.stream {
            Stream::Plain(stream) => Pin::new(stream).poll_shutdown(context),
            Stream::Tls(stream) => Pin::new(stream).poll_shutdown(context),
        }
    }
}
