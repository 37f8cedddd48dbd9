//! The database behind the store: SQLite or PostgreSQL. SQL elsewhere in the store is what both
//! understand; what they do differently is here.

use std::path::Path;
use std::str::FromStr;
use std::time::Duration;

use sqlx::any::{Any, AnyConnectOptions, AnyPoolOptions, install_default_drivers};
use sqlx::{AnyConnection, AnyPool, Connection, Executor, Transaction};
use tokio::time::timeout;

use super::{Result, StoreError};

/// How long to wait for a database when the server starts.
const CONNECT_PATIENCE: Duration = Duration::from_secs(10);
/// How long a query waits for a connection. A request that waits longer fails.
const ACQUIRE_PATIENCE: Duration = Duration::from_secs(10);
/// Connections that read from SQLite.
const READERS: u32 = 4;
/// Connections of a server to PostgreSQL.
pub(super) const CONNECTIONS: u32 = 8;

/// How SQLite's writer is set up. An accepted job survives a power failure, not only a crash. What a statement may have
/// to undo is kept in memory: it would be written to a file that no crash needs. The log is carried over into the
/// database by [`checkpoint`], and by the writer, whom that stops for long, only to begin it anew.
const WRITER: &str = "PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL; PRAGMA temp_store = MEMORY; \
                      PRAGMA wal_autocheckpoint = 4000";
/// How often the log is carried over into the database.
const CHECKPOINTS: Duration = Duration::from_millis(250);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Dialect {
    Sqlite,
    Postgres,
}

/// Connections to the database.
#[derive(Clone, Debug)]
pub(super) struct Database {
    dialect: Dialect,
    /// SQLite: one connection, so that writes never wait for each other inside SQLite.
    pub writer: AnyPool,
    pub reader: AnyPool,
}

impl Database {
    /// Opens or creates a database in a file and migrates its schema.
    pub async fn file(path: &Path) -> Result<Self> {
        let opened = Self::sqlite(&format!("sqlite:{}", percent_encoded(path))).await;
        opened.map_err(|error| match error {
            StoreError::Database(error) => StoreError::Unopened { path: path.to_owned(), error },
            other => other,
        })
    }

    /// Connects to `postgres://…`, with at most so many connections, or `sqlite:PATH`, and migrates the schema.
    pub async fn url(url: &str, connections: u32) -> Result<Self> {
        match url.split_once(':') {
            Some(("postgres" | "postgresql", _)) => Self::postgres(url, connections).await,
            Some(("sqlite", path)) => Self::file(Path::new(path.strip_prefix("//").unwrap_or(path))).await,
            Some((scheme, _)) if scheme.bytes().all(|byte| byte.is_ascii_alphanumeric()) => {
                Err(StoreError::Url { fault: format!("{scheme:?} is no kind of database that Gridfall knows") })
            }
            _ => Err(StoreError::Url { fault: "it does not begin with a kind of database".into() }),
        }
    }

    async fn sqlite(url: &str) -> Result<Self> {
        install_default_drivers();
        let options = AnyConnectOptions::from_str(&format!("{url}?mode=rwc"))?;
        let writer = AnyPoolOptions::new().max_connections(1).after_connect(|connection, _| {
            // An accepted job survives a power failure, not only a crash.
            Box::pin(async move { connection.execute(WRITER).await.map(drop) })
        });
        let writer = writer.connect_with(options.clone()).await?;
        sqlx::migrate!("store/migrations/sqlite").run(&writer).await?;
        let checkpointer = AnyPoolOptions::new().max_connections(1).connect_with(options).await?;
        let options = AnyConnectOptions::from_str(&format!("{url}?mode=ro"))?;
        // All at once: one that a worker's thread opens later has a thread of SQLite that yields, as the worker's does.
        let reader = AnyPoolOptions::new().min_connections(READERS).max_connections(READERS);
        let reader = reader.connect_with(options).await?;
        tokio::spawn(checkpoint(checkpointer, reader.clone()));
        Ok(Self { dialect: Dialect::Sqlite, writer, reader })
    }

    async fn postgres(url: &str, connections: u32) -> Result<Self> {
        install_default_drivers();
        // The error names no part of the URL, which may have the password in the wrong place.
        let options = AnyConnectOptions::from_str(url).map_err(|error| StoreError::Url {
            fault: match error {
                sqlx::Error::Configuration(reason) => reason.to_string(),
                _ => "it cannot be read".into(),
            },
        })?;
        let unreachable = |reason: String| StoreError::Unreachable { place: place(&options), reason };
        // The pool would try again and again, so that the reason would come late.
        match timeout(CONNECT_PATIENCE, AnyConnection::connect_with(&options)).await {
            Ok(Ok(connection)) => connection.close().await?,
            Ok(Err(error)) => return Err(unreachable(error.to_string())),
            Err(_) => return Err(unreachable(format!("no answer within {} s", CONNECT_PATIENCE.as_secs()))),
        }
        let pool = AnyPoolOptions::new().max_connections(connections).acquire_timeout(ACQUIRE_PATIENCE);
        let pool = pool.connect_with(options.clone()).await?;
        sqlx::migrate!("store/migrations/postgres").run(&pool).await?;
        Ok(Self { dialect: Dialect::Postgres, writer: pool.clone(), reader: pool })
    }

    pub async fn close(&self) {
        self.reader.close().await;
        self.writer.close().await;
    }

    /// Begins a transaction that sees the queue as it is and keeps everybody else from adding to it.
    pub async fn lock_queue(&self) -> sqlx::Result<Transaction<'static, Any>> {
        match self.dialect {
            Dialect::Sqlite => self.writer.begin_with("BEGIN IMMEDIATE").await,
            Dialect::Postgres => {
                let mut tx = self.writer.begin().await?;
                // Any number will do, if all servers take the same one.
                tx.execute("SELECT 1 FROM pg_advisory_xact_lock(7316530801)").await?;
                Ok(tx)
            }
        }
    }

    /// Follows `FROM jobs` where the queue's index is to be walked. SQLite would look into the row of each job.
    pub fn along_queue(&self) -> &'static str {
        match self.dialect {
            Dialect::Sqlite => "INDEXED BY jobs_in_queue",
            Dialect::Postgres => "",
        }
    }

    /// Follows `FROM jobs` where the index of offers is to be walked: they are few, and SQLite would look through all
    /// jobs that wait.
    pub fn along_offers(&self) -> &'static str {
        match self.dialect {
            Dialect::Sqlite => "INDEXED BY jobs_by_offer",
            Dialect::Postgres => "",
        }
    }

    /// Ends a `SELECT` of rows that the same statement is going to change: servers that do the same at
    /// the same time take other rows instead of waiting for this one.
    pub fn skip_locked(&self) -> &'static str {
        match self.dialect {
            // There is one writer.
            Dialect::Sqlite => "",
            Dialect::Postgres => "FOR UPDATE SKIP LOCKED",
        }
    }
}

/// Carries what was written over into SQLite's database from beside the writer, until the database is closed.
async fn checkpoint(connection: AnyPool, reader: AnyPool) {
    loop {
        tokio::select! {
            () = tokio::time::sleep(CHECKPOINTS) => {}
            () = reader.close_event() => return connection.close().await,
        }
        // What fails is done by the next one, or by the writer.
        let _ = connection.execute("PRAGMA wal_checkpoint(PASSIVE)").await;
    }
}

/// Whether the database cannot be reached now: the connection broke, or the database is starting, stopping or full of
/// connections.
pub(super) fn is_away(error: &sqlx::Error) -> bool {
    match error {
        sqlx::Error::Io(_) | sqlx::Error::PoolTimedOut | sqlx::Error::PoolClosed | sqlx::Error::WorkerCrashed => true,
        // PostgreSQL's classes 08 (connections), 53 (resources) and 57P (stopped by an operator).
        sqlx::Error::Database(error) => {
            error.code().is_some_and(|code| ["08", "53", "57P"].iter().any(|class| code.starts_with(class)))
        }
        _ => false,
    }
}

/// Host and database of a URL, for people, without user and password.
fn place(options: &AnyConnectOptions) -> String {
    let url = &options.database_url;
    // A password with an unescaped `/` or `?` ends up behind the host.
    let plain = url.as_str().split_once("://").is_none_or(|(_, rest)| rest.matches('@').count() <= 1)
        && !url.path().contains('@')
        && !url.query().unwrap_or_default().contains('@');
    match (plain, url.host_str()) {
        (true, Some(host)) => {
            let port = url.port().map(|port| format!(":{port}")).unwrap_or_default();
            format!("{host}{port}{}", url.path())
        }
        _ => "its server".into(),
    }
}

/// A path in a URL.
fn percent_encoded(path: &Path) -> String {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"/-_.".contains(&byte);
    let bytes = path.as_os_str().as_encoded_bytes().iter();
    bytes.map(|&byte| if plain(byte) { char::from(byte).to_string() } else { format!("%{byte:02X}") }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_have_no_password() {
        let place = |url| place(&AnyConnectOptions::from_str(url).unwrap());
        assert_eq!(place("postgres://me:secret@db.example:5433/jobs?password=secret"), "db.example:5433/jobs");
        for url in ["postgres://me:12/secret@db/jobs", "postgres://me:12?secret@db/jobs"] {
            assert_eq!(place(url), "its server");
        }
    }

    #[tokio::test]
    async fn a_database_may_have_any_path() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["plain", "with space", "a?mode=memory#b%20", "ünï"] {
            let path = dir.path().join(name);
            Database::file(&path).await.unwrap().close().await;
            assert!(path.exists(), "{name}");
        }
    }
}
