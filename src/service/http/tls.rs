//! TLS: the certificate and its key, which are read again when their files change.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, RwLock};
use std::time::{Duration, SystemTime};

use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::{self, PemObject};
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio_rustls::rustls::{self, ServerConfig};

/// How often it is looked whether the files have changed.
const LOOKS: Duration = Duration::from_secs(10);

/// Files of a server's certificate.
#[derive(Clone, Debug)]
pub struct Certificate {
    /// The certificate, and those that lead from it to a known authority (PEM).
    pub chain: PathBuf,
    /// Its private key (PEM).
    pub key: PathBuf,
}

#[derive(Debug, thiserror::Error)]
pub enum TlsError {
    #[error("{option} {path}: {error}; give a file in PEM format (`-----BEGIN …-----`) that has {what}")]
    File { option: &'static str, path: PathBuf, what: &'static str, error: pem::Error },
    #[error("--tls-cert {chain} and --tls-key {key}: {error}; give a certificate and the key that it was made for")]
    Pair { chain: PathBuf, key: PathBuf, error: rustls::Error },
}

/// When the two files were written, and how long they are.
type Stamp = [Option<(SystemTime, u64)>; 2];

/// A certificate in use.
#[derive(Debug)]
pub struct Tls {
    files: Certificate,
    config: RwLock<Arc<ServerConfig>>,
}

impl Tls {
    pub fn open(files: Certificate) -> Result<Self, TlsError> {
        let config = RwLock::new(Arc::new(load(&files)?));
        Ok(Self { files, config })
    }

    /// For the next connection.
    pub fn acceptor(&self) -> TlsAcceptor {
        self.config.read().expect(UNBROKEN).clone().into()
    }

    /// Takes over what the files become, for ever. New files that do not fit are said in the log, and the old
    /// certificate stays.
    pub async fn follow(self: Arc<Self>) {
        let mut known = self.stamp();
        loop {
            tokio::time::sleep(LOOKS).await;
            self.look(&mut known);
        }
    }

    fn look(&self, known: &mut Stamp) {
        let now = self.stamp();
        if now == std::mem::replace(known, now) {
            return;
        }
        match load(&self.files) {
            Ok(config) => {
                *self.config.write().expect(UNBROKEN) = Arc::new(config);
                tracing::info!(certificate = %self.files.chain.display(), "took over the new certificate");
            }
            Err(error) => tracing::error!(%error, "the new certificate is not used; the old one stays"),
        }
    }

    fn stamp(&self) -> Stamp {
        let of = |path: &Path| -> io::Result<_> {
            let metadata = path.metadata()?;
            Ok((metadata.modified()?, metadata.len()))
        };
        [of(&self.files.chain).ok(), of(&self.files.key).ok()]
    }
}

const UNBROKEN: &str = "no code panics while it holds this lock";

fn load(files: &Certificate) -> Result<ServerConfig, TlsError> {
    let Certificate { chain, key } = files;
    let unread = |option, path: &Path, what| {
        let path = path.to_owned();
        move |error| TlsError::File { option, path, what, error }
    };
    let certificates = CertificateDer::pem_file_iter(chain)
        .and_then(Iterator::collect::<Result<Vec<_>, _>>)
        .and_then(|found| if found.is_empty() { Err(pem::Error::NoItemsFound) } else { Ok(found) })
        .map_err(unread("--tls-cert", chain, "a certificate"))?;
    let private = PrivateKeyDer::from_pem_file(key).map_err(unread("--tls-key", key, "a private key"))?;
    let mut config = ServerConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_safe_default_protocol_versions()
        .and_then(|builder| builder.with_no_client_auth().with_single_cert(certificates, private))
        .map_err(|error| TlsError::Pair { chain: chain.clone(), key: key.clone(), error })?;
    config.alpn_protocols = vec![b"http/1.1".to_vec()];
    Ok(config)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_new_certificate_is_taken_over_and_a_broken_one_is_not() {
        let dir = tempfile::tempdir().unwrap();
        let files = Certificate { chain: dir.path().join("chain.pem"), key: dir.path().join("key.pem") };
        let write = |name: &str| {
            let made = rcgen::generate_simple_self_signed([name.to_owned()]).unwrap();
            fs::write(&files.chain, made.cert.pem()).unwrap();
            fs::write(&files.key, made.signing_key.serialize_pem()).unwrap();
        };
        write("first.example");
        let tls = Tls::open(files.clone()).unwrap();
        let used = || Arc::as_ptr(&tls.config.read().unwrap());
        let (first, mut known) = (used(), tls.stamp());
        tls.look(&mut known);
        assert_eq!(used(), first, "nothing has changed");
        write("the.second.example");
        tls.look(&mut known);
        let second = used();
        assert_ne!(second, first);
        fs::write(&files.key, "half a ").unwrap();
        tls.look(&mut known);
        assert_eq!(used(), second);
    }
}
