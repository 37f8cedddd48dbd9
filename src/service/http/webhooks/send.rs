//! Sends messages to webhooks: to an address that was looked up and judged for this message, over a connection of its
//! own, without following anything.

use std::fmt;
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::time::Duration;

use axum::body::{Body, Bytes};
use axum::http::{HeaderMap, Request, header};
use futures_util::StreamExt;
use hyper::client::conn::http1;
use hyper_util::rt::TokioIo;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpStream, lookup_host};
use tokio::time::timeout;
use tokio_rustls::TlsConnector;
use tokio_rustls::rustls::crypto::ring::default_provider;
use tokio_rustls::rustls::pki_types::ServerName;
use tokio_rustls::rustls::{ClientConfig, RootCertStore};
use url::{Host, Url};

use super::address::{self, Range};

/// How long a receiver may take, from the look-up of its address to the end of its answer.
const PATIENCE: Duration = Duration::from_secs(15);
/// What is kept of an answer (bytes). No more is read.
const ANSWER: usize = 1 << 10;

/// What a receiver answered.
pub struct Answer {
    pub status: u16,
    pub headers: HeaderMap,
    /// The beginning.
    pub text: String,
}

#[derive(Clone)]
pub struct Sender {
    tls: TlsConnector,
    allowed: Vec<Range>,
}

impl fmt::Debug for Sender {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Sender").field("allowed", &self.allowed).finish_non_exhaustive()
    }
}

impl Sender {
    pub fn new(allowed: Vec<Range>) -> Self {
        Self::trusting(authorities(), allowed)
    }

    fn trusting(roots: RootCertStore, allowed: Vec<Range>) -> Self {
        Self { tls: TlsConnector::from(Arc::new(tls(roots))), allowed }
    }

    /// The address of a webhook, if there is one that may be called.
    pub fn judge(text: &str) -> Result<Url, String> {
        let url = Url::parse(text).map_err(|error| format!("it is no URL: {error}"))?;
        if !["https", "http"].contains(&url.scheme()) {
            return Err(format!("it begins with `{}:`; give one with https: or http:", url.scheme()));
        }
        if !url.username().is_empty() || url.password().is_some() {
            return Err("it has a user or a password; put a token into the path, or check signatures".into());
        }
        if url.host().is_none() || url.fragment().is_some() {
            return Err("it has no host, or a fragment (#), which is not sent".into());
        }
        Ok(url)
    }

    /// Where a webhook is, of what may be called.
    pub async fn resolve(&self, url: &Url) -> Result<Vec<SocketAddr>, String> {
        let port = url.port_or_known_default().unwrap_or(443);
        let found: Vec<SocketAddr> = match url.host() {
            Some(Host::Ipv4(address)) => vec![(IpAddr::from(address), port).into()],
            Some(Host::Ipv6(address)) => vec![(IpAddr::from(address), port).into()],
            Some(Host::Domain(name)) => {
                let found = lookup_host((name, port)).await;
                found.map_err(|error| format!("its name {name} cannot be looked up: {error}"))?.collect()
            }
            None => vec![],
        };
        let fault = |at: &SocketAddr| address::fault(at.ip(), &self.allowed).map(|why| (at.ip(), why));
        let (refused, open): (Vec<_>, Vec<_>) = found.into_iter().partition(|at| fault(at).is_some());
        match (open.is_empty(), refused.first().and_then(fault)) {
            (false, _) => Ok(open),
            (true, Some((ip, why))) => Err(format!(
                "it is at {ip}, {why}, which this server does not call; its operator may allow that: \
                 gridfall serve --allow-webhook-address {ip}"
            )),
            (true, None) => Err("its name has no address".into()),
        }
    }

    /// Posts JSON. An error says why there is no answer.
    pub async fn post(&self, url: &Url, headers: HeaderMap, body: String) -> Result<Answer, String> {
        let answer = timeout(PATIENCE, self.exchange(url, headers, body)).await;
        answer.unwrap_or_else(|_| Err(format!("no whole answer within {} s", PATIENCE.as_secs())))
    }

    async fn exchange(&self, url: &Url, headers: HeaderMap, body: String) -> Result<Answer, String> {
        let places = self.resolve(url).await?;
        // Just where it was found to be: a second look-up might be answered otherwise.
        let stream = TcpStream::connect(places.as_slice()).await.map_err(|error| format!("cannot connect: {error}"))?;
        let request = request(url, headers, body)?;
        if url.scheme() == "http" {
            return talk(stream, request).await;
        }
        let name = match url.host() {
            Some(Host::Domain(name)) => ServerName::try_from(name.to_owned()).map_err(|error| error.to_string())?,
            Some(Host::Ipv4(address)) => ServerName::from(IpAddr::from(address)),
            Some(Host::Ipv6(address)) => ServerName::from(IpAddr::from(address)),
            None => return Err("it has no host".into()),
        };
        let stream = self.tls.connect(name, stream).await.map_err(|error| format!("TLS failed: {error}"))?;
        talk(stream, request).await
    }
}

fn request(url: &Url, headers: HeaderMap, body: String) -> Result<Request<Body>, String> {
    let path = &url[url::Position::BeforePath..url::Position::AfterQuery];
    let host = &url[url::Position::BeforeHost..url::Position::AfterPort];
    let mut request = Request::post(path)
        .header(header::HOST, host)
        .header(header::CONTENT_LENGTH, body.len())
        .header(header::CONNECTION, "close")
        .body(Body::from(body))
        .map_err(|error| error.to_string())?;
    request.headers_mut().extend(headers);
    Ok(request)
}

/// Sends the request over a connection and takes the beginning of the answer.
async fn talk(
    stream: impl AsyncRead + AsyncWrite + Unpin + Send + 'static,
    request: Request<Body>,
) -> Result<Answer, String> {
    let broken = |error: hyper::Error| format!("the connection broke: {error}");
    let (mut sender, connection) = http1::handshake(TokioIo::new(stream)).await.map_err(broken)?;
    let exchange = async move {
        let (head, body) = sender.send_request(request).await.map_err(broken)?.into_parts();
        let mut text: Vec<u8> = Vec::new();
        let mut pieces = Body::new(body).into_data_stream();
        while text.len() < ANSWER
            && let Some(piece) = pieces.next().await
        {
            let piece: Bytes = piece.map_err(|error| format!("the answer broke off: {error}"))?;
            text.extend(&piece[..piece.len().min(ANSWER - text.len())]);
        }
        let text = String::from_utf8_lossy(&text).into_owned();
        Ok(Answer { status: head.status.as_u16(), headers: head.headers, text })
    };
    tokio::pin!(connection);
    tokio::pin!(exchange);
    // The connection ends with the exchange: what else the receiver has to say is not read.
    tokio::select! {
        answer = &mut exchange => answer,
        ended = &mut connection => match ended {
            Ok(()) => exchange.await,
            Err(error) => Err(broken(error)),
        },
    }
}

/// The authorities that the system trusts, so that an own one counts, or those of Mozilla where it has none.
fn authorities() -> RootCertStore {
    let mut roots = RootCertStore::empty();
    let found = rustls_native_certs::load_native_certs();
    roots.add_parsable_certificates(found.certs);
    if roots.is_empty() {
        roots.extend(webpki_roots::TLS_SERVER_ROOTS.iter().cloned());
    }
    roots
}

fn tls(roots: RootCertStore) -> ClientConfig {
    ClientConfig::builder_with_provider(Arc::new(default_provider()))
        .with_safe_default_protocol_versions()
        .expect("the provider has the ciphers of both versions")
        .with_root_certificates(roots)
        .with_no_client_auth()
}

#[cfg(test)]
mod tests {
    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    use tokio::net::TcpListener;
    use tokio_rustls::TlsAcceptor;
    use tokio_rustls::rustls::ServerConfig;

    use super::*;

    #[tokio::test]
    async fn places_are_judged_as_they_are_found() {
        let sender = Sender::new(vec![]);
        for inside in [
            "http://127.0.0.1/",
            "http://[::1]:9/",
            "http://169.254.169.254/latest",
            "http://localhost/",
            "http://127.1/",
            "http://0x7f000001/",
            "http://2130706433/",
            "http://[::ffff:10.0.0.1]/",
        ] {
            let refused = sender.resolve(&Sender::judge(inside).unwrap()).await.unwrap_err();
            assert!(refused.contains("--allow-webhook-address"), "{inside}: {refused}");
        }
        let open = sender.resolve(&Sender::judge("https://1.1.1.1/hook?a=b").unwrap()).await.unwrap();
        assert_eq!(open, ["1.1.1.1:443".parse().unwrap()]);
        for wrong in ["", "ftp://example.com/", "https://", "/v1", "https://me:secret@example.com/", "file:///etc"] {
            assert!(Sender::judge(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn requests_name_their_host_and_path() {
        let url = Sender::judge("https://hooks.example:8443/a%20b?c=d").unwrap();
        let made = request(&url, HeaderMap::new(), "{}".into()).unwrap();
        assert_eq!(
            (made.uri().to_string().as_str(), made.headers()["host"].as_bytes()),
            ("/a%20b?c=d", &b"hooks.example:8443"[..])
        );
    }
    /// A server with a certificate of its own, for `localhost`, that answers once.
    async fn secured() -> (SocketAddr, RootCertStore) {
        let made = rcgen::generate_simple_self_signed(["localhost".to_owned()]).unwrap();
        let mut roots = RootCertStore::empty();
        roots.add(made.cert.der().clone()).unwrap();
        let key = made.signing_key.serialize_der().try_into().unwrap();
        let config = ServerConfig::builder_with_provider(Arc::new(default_provider()))
            .with_safe_default_protocol_versions()
            .unwrap()
            .with_no_client_auth()
            .with_single_cert(vec![made.cert.der().clone()], key)
            .unwrap();
        let (acceptor, listener) =
            (TlsAcceptor::from(Arc::new(config)), TcpListener::bind("127.0.0.1:0").await.unwrap());
        let address = listener.local_addr().unwrap();
        tokio::spawn(async move {
            let (stream, _) = listener.accept().await.unwrap();
            let Ok(mut stream) = acceptor.accept(stream).await else { return };
            let mut request = vec![0; 1000];
            let length = stream.read(&mut request).await.unwrap();
            assert!(String::from_utf8_lossy(&request[..length]).starts_with("POST /hook HTTP/1.1\r\n"));
            let answer = b"HTTP/1.1 201 made\r\ncontent-length: 4\r\n\r\nkept";
            stream.write_all(answer).await.unwrap();
            stream.shutdown().await.unwrap();
        });
        (address, roots)
    }

    #[tokio::test]
    async fn certificates_are_checked() {
        let local = || vec![address::range("127.0.0.0/8").unwrap()];
        let (at, roots) = secured().await;
        let url = |host: &str, at: SocketAddr| Sender::judge(&format!("https://{host}:{}/hook", at.port())).unwrap();
        let sender = Sender::trusting(roots, local());
        let answer = sender.post(&url("localhost", at), HeaderMap::new(), "{}".into()).await.unwrap();
        assert_eq!((answer.status, answer.text.as_str()), (201, "kept"));
        // Another name, and an authority that nobody trusts.
        let (at, roots) = secured().await;
        let sender = Sender::trusting(roots, local());
        let refused = sender.post(&url("127.0.0.1", at), HeaderMap::new(), "{}".into()).await.err().unwrap();
        assert!(refused.starts_with("TLS failed: "), "{refused}");
        let (at, _) = secured().await;
        let sender = Sender::new(local());
        let refused = sender.post(&url("localhost", at), HeaderMap::new(), "{}".into()).await.err().unwrap();
        assert!(refused.starts_with("TLS failed: "), "{refused}");
    }
}
