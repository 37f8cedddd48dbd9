//! Accepts connections and bounds what each may cost: their number, and how long one may take to
//! send the head of a request or to take in an answer.

use std::convert::Infallible;
use std::io;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::body::Body;
use axum::http::Request;
use axum::response::Response;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use tokio::time::timeout;
use tokio_io_timeout::TimeoutStream;
use tower::{Service, ServiceExt};

use super::load::Crowded;
use super::state::Config;
use super::tls::Tls;

/// Connections beyond the usual number, for requests that always pass.
const SPARE_CONNECTIONS: usize = 64;
/// Longest head of a request (bytes).
const MAX_HEAD_BYTES: usize = 64 << 10;
/// How long to wait before a retry when the system has no room for one more connection.
const RETRY: Duration = Duration::from_millis(100);

/// Serves until `stop` resolves; then takes no more connections and waits for the requests in
/// flight.
pub async fn serve(
    listener: TcpListener,
    tls: Option<Arc<Tls>>,
    app: Router,
    config: &Config,
    stop: impl Future<Output = ()>,
) {
    let connections = Connections {
        app,
        tls,
        usual: Arc::new(Semaphore::new(config.max_connections)),
        spare: Arc::new(Semaphore::new(SPARE_CONNECTIONS)),
        header_timeout: config.header_timeout,
        write_timeout: config.write_timeout,
        closing: watch::Sender::new(()),
    };
    let mut stop = pin!(stop);
    loop {
        let accepted = tokio::select! {
            accepted = listener.accept() => accepted,
            () = &mut stop => break,
        };
        match accepted {
            Ok((stream, _)) => connections.take(stream),
            Err(error) if is_of_one_connection(&error) => {}
            Err(error) => {
                tracing::error!(%error, "cannot accept connections");
                tokio::time::sleep(RETRY).await;
            }
        }
    }
    drop(listener);
    connections.closing.send_replace(());
    connections.closing.closed().await;
}

/// A place among the connections. Whoever keeps one beyond the answer, as a WebSocket does, goes on being
/// counted.
#[derive(Clone)]
pub struct Occupied {
    _place: Arc<OwnedSemaphorePermit>,
    /// Changes when the server stops.
    pub closing: watch::Receiver<()>,
}

/// Marks requests that nobody on their way could read.
#[derive(Clone, Copy, Debug)]
pub struct Encrypted;

struct Connections {
    app: Router,
    tls: Option<Arc<Tls>>,
    usual: Arc<Semaphore>,
    spare: Arc<Semaphore>,
    header_timeout: Duration,
    write_timeout: Duration,
    /// Tells the connections to end. They keep receivers until they have.
    closing: watch::Sender<()>,
}

impl Connections {
    /// Serves a connection, or closes it if there are too many.
    fn take(&self, stream: TcpStream) {
        let Some((permit, crowded)) = self.permit() else { return };
        let occupied = Occupied { _place: Arc::new(permit), closing: self.closing.subscribe() };
        // Heads and bodies of short answers are written separately; without this the second waits
        // for the client's acknowledgement of the first.
        if let Err(error) = stream.set_nodelay(true) {
            tracing::debug!(%error, "cannot set TCP_NODELAY");
        }
        let mut stream = TimeoutStream::new(stream);
        stream.set_write_timeout(Some(self.write_timeout));
        let stream = Box::pin(stream);
        let place = occupied.clone();
        let encrypted = self.tls.is_some();
        let app = self.app.clone().map_request(move |request: Request<Incoming>| {
            let mut request = request.map(Body::new);
            request.extensions_mut().insert(place.clone());
            if crowded {
                request.extensions_mut().insert(Crowded);
            }
            if encrypted {
                request.extensions_mut().insert(Encrypted);
            }
            request
        });
        let header_timeout = self.header_timeout;
        let Some(tls) = &self.tls else {
            tokio::spawn(answer(stream, app, header_timeout, occupied));
            return;
        };
        let acceptor = tls.acceptor();
        tokio::spawn(async move {
            let mut closing = occupied.closing.clone();
            // Whoever is slow to shake hands is as one who is slow to ask.
            let shaken = tokio::select! {
                shaken = timeout(header_timeout, acceptor.accept(stream)) => shaken,
                _ = closing.changed() => return,
            };
            match shaken {
                Ok(Ok(stream)) => answer(stream, app, header_timeout, occupied).await,
                Ok(Err(error)) => tracing::debug!(%error, "a connection did not come to TLS"),
                Err(_) => tracing::debug!("a connection was too slow to come to TLS"),
            }
        });
    }

    /// Room for one more, and whether it is of the spare kind.
    fn permit(&self) -> Option<(OwnedSemaphorePermit, bool)> {
        match self.usual.clone().try_acquire_owned() {
            Ok(permit) => Some((permit, false)),
            Err(_) => Some((self.spare.clone().try_acquire_owned().ok()?, true)),
        }
    }
}

/// Answers what comes on a connection, until either side ends it.
async fn answer<S, A>(stream: S, app: A, header_timeout: Duration, occupied: Occupied)
where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
    A: Service<Request<Incoming>, Response = Response, Error = Infallible, Future: Send> + Clone + Send + 'static,
{
    let mut http = http1::Builder::new();
    // The timer of the head also runs between requests.
    http.timer(TokioTimer::new()).header_read_timeout(header_timeout).max_buf_size(MAX_HEAD_BYTES);
    let connection = http.serve_connection(TokioIo::new(stream), TowerToHyperService::new(app));
    let mut connection = pin!(connection.with_upgrades());
    let mut closing = occupied.closing.clone();
    let ended = tokio::select! {
        ended = connection.as_mut() => ended,
        _ = closing.changed() => {
            connection.as_mut().graceful_shutdown();
            connection.await
        }
    };
    if let Err(error) = ended {
        tracing::debug!(%error, "a connection broke");
    }
}

/// The client has gone already; the next one may be fine.
fn is_of_one_connection(error: &io::Error) -> bool {
    use io::ErrorKind::{ConnectionAborted, ConnectionRefused, ConnectionReset};
    matches!(error.kind(), ConnectionAborted | ConnectionRefused | ConnectionReset)
}
