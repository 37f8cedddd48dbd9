//! Keys: who may ask for what. A secret has 256 random bits, so that a plain hash of it tells nobody anything.

use std::fmt;
use std::str::FromStr;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use sqlx::any::AnyRow;
use sqlx::{AssertSqlSafe, FromRow, Row};

use super::row::timestamp;
use super::{JobStore, Result};

/// What secrets begin with, for people and for programs that look for secrets where none belong.
const MARK: &str = "gf";
const ID_BYTES: usize = 5;
const SECRET_BYTES: usize = 32;
/// Longest name of a key.
pub const MAX_KEY_NAME: usize = 64;

/// What a key allows. Each allows all that those before it do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum Scope {
    /// To see what the key's jobs have come to.
    Read,
    /// To submit jobs, to cancel and delete those of the key, to keep scenes and uploads.
    Submit,
    /// To see and change what belongs to other keys, too, and to see metrics.
    Admin,
}

impl Scope {
    pub const ALL: [Self; 3] = [Self::Read, Self::Submit, Self::Admin];

    pub fn as_str(self) -> &'static str {
        match self {
            Self::Read => "read",
            Self::Submit => "submit",
            Self::Admin => "admin",
        }
    }
}

impl fmt::Display for Scope {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

impl FromStr for Scope {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|scope| scope.as_str() == text);
        found.ok_or_else(|| format!("{text:?} is no scope; there are read, submit and admin"))
    }
}

/// Most of everything that a key may have; `None` is as much as it likes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, utoipa::ToSchema)]
pub struct Quotas {
    /// Jobs that wait.
    #[schema(required)]
    pub queued: Option<i64>,
    /// Jobs that run at a time.
    #[schema(required)]
    pub running: Option<i64>,
    /// Particles of a scene.
    #[schema(required)]
    pub particles: Option<i64>,
    /// Bytes of outputs and uploads that are kept.
    #[schema(required)]
    pub bytes: Option<i64>,
    /// Time on devices within 30 days (s).
    #[schema(required)]
    pub device_s: Option<i64>,
}

/// A key, but for its secret.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Key {
    /// Part of the secret, and no secret.
    pub id: String,
    pub name: String,
    pub scope: Scope,
    pub created_at: Timestamp,
    pub expires_at: Option<Timestamp>,
    pub revoked_at: Option<Timestamp>,
    /// To about a minute.
    pub last_used_at: Option<Timestamp>,
    pub quotas: Quotas,
}

/// Whether a key is good at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standing {
    Good,
    Expired,
    Revoked,
}

impl Key {
    pub fn standing(&self, now: Timestamp) -> Standing {
        match (self.revoked_at, self.expires_at) {
            (Some(_), _) => Standing::Revoked,
            (None, Some(end)) if end <= now => Standing::Expired,
            _ => Standing::Good,
        }
    }
}

/// A key to be made.
#[derive(Clone, Debug)]
pub struct NewKey {
    pub name: String,
    pub scope: Scope,
    pub expires_at: Option<Timestamp>,
    pub quotas: Quotas,
}

/// What a client sends. Shown once: the table has only its hash.
#[derive(Clone, PartialEq, Eq)]
pub struct Secret(String);

impl Secret {
    fn new(id: &str) -> Self {
        Self(format!("{MARK}_{id}_{}", random_hex::<SECRET_BYTES>()))
    }

    pub fn reveal(&self) -> &str {
        &self.0
    }

    /// The secret that a text is; none if it has not the form of one.
    pub fn parse(text: &str) -> Option<Self> {
        let (id, rest) = text.strip_prefix(MARK)?.strip_prefix('_')?.split_once('_')?;
        let hex = |text: &str, bytes: usize| {
            text.len() == 2 * bytes && text.bytes().all(|b| b.is_ascii_digit() || (b'a'..=b'f').contains(&b))
        };
        (hex(id, ID_BYTES) && hex(rest, SECRET_BYTES)).then(|| Self(text.to_owned()))
    }

    /// What is kept and searched by: whoever measures how long a search takes learns of hashes, not of secrets.
    pub fn sha256(&self) -> String {
        Sha256::digest(&self.0).iter().map(|byte| format!("{byte:02x}")).collect()
    }
}

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Secret")
    }
}

fn random_hex<const BYTES: usize>() -> String {
    let mut bytes = [0; BYTES];
    getrandom::fill(&mut bytes).expect("the system has random numbers");
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

const COLUMNS: &str = "id, name, scope, created_at, expires_at, revoked_at, last_used_at, max_queued, max_running, \
    max_particles, max_bytes, max_device_s";

pub(super) struct KeyRow(pub Key);

impl FromRow<'_, AnyRow> for KeyRow {
    fn from_row(row: &AnyRow) -> sqlx::Result<Self> {
        let time = |column| row.try_get::<Option<i64>, _>(column)?.map(timestamp).transpose();
        let scope = row.try_get::<String, _>("scope")?;
        Ok(Self(Key {
            id: row.try_get("id")?,
            name: row.try_get("name")?,
            scope: scope.parse().map_err(|error: String| sqlx::Error::Decode(error.into()))?,
            created_at: timestamp(row.try_get("created_at")?)?,
            expires_at: time("expires_at")?,
            revoked_at: time("revoked_at")?,
            last_used_at: time("last_used_at")?,
            quotas: Quotas {
                queued: row.try_get("max_queued")?,
                running: row.try_get("max_running")?,
                particles: row.try_get("max_particles")?,
                bytes: row.try_get("max_bytes")?,
                device_s: row.try_get("max_device_s")?,
            },
        }))
    }
}

impl JobStore {
    /// Makes a key. Returns none if there is one of this name, even if it has ended.
    pub async fn create_key(&self, new: &NewKey) -> Result<Option<(Key, Secret)>> {
        let id = random_hex::<ID_BYTES>();
        let secret = Secret::new(&id);
        let Quotas { queued, running, particles, bytes, device_s } = new.quotas;
        let key: Option<KeyRow> = sqlx::query_as(AssertSqlSafe(format!(
            "INSERT INTO keys (id, name, secret_sha256, scope, created_at, expires_at, max_queued, max_running, \
               max_particles, max_bytes, max_device_s) VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11) \
             ON CONFLICT (name) DO NOTHING RETURNING {COLUMNS}"
        )))
        .bind(&id)
        .bind(&new.name)
        .bind(secret.sha256())
        .bind(new.scope.as_str())
        .bind(self.clock.now())
        .bind(new.expires_at.map(|time| time.as_microsecond()))
        .bind(queued)
        .bind(running)
        .bind(particles)
        .bind(bytes)
        .bind(device_s)
        .fetch_optional(&self.database.writer)
        .await?;
        Ok(key.map(|row| (row.0, secret)))
    }

    /// Gives a key another secret and another end; the old secret is void. Returns none if there is no such key.
    pub async fn renew_key(&self, name: &str, expires_at: Option<Timestamp>) -> Result<Option<(Key, Secret)>> {
        let Some(key) = self.key(name).await? else { return Ok(None) };
        let secret = Secret::new(&key.id);
        let renewed: Option<KeyRow> = sqlx::query_as(AssertSqlSafe(format!(
            "UPDATE keys SET secret_sha256 = $1, expires_at = $2, revoked_at = NULL WHERE id = $3 RETURNING {COLUMNS}"
        )))
        .bind(secret.sha256())
        .bind(expires_at.map(|time| time.as_microsecond()))
        .bind(&key.id)
        .fetch_optional(&self.database.writer)
        .await?;
        Ok(renewed.map(|row| (row.0, secret)))
    }

    /// Sets the quotas of a key. Returns none if there is no such key.
    pub async fn set_quotas(&self, name: &str, quotas: Quotas) -> Result<Option<Key>> {
        let Quotas { queued, running, particles, bytes, device_s } = quotas;
        let key: Option<KeyRow> = sqlx::query_as(AssertSqlSafe(format!(
            "UPDATE keys SET max_queued = $1, max_running = $2, max_particles = $3, max_bytes = $4, max_device_s = $5 \
             WHERE name = $6 RETURNING {COLUMNS}"
        )))
        .bind(queued)
        .bind(running)
        .bind(particles)
        .bind(bytes)
        .bind(device_s)
        .bind(name)
        .fetch_optional(&self.database.writer)
        .await?;
        Ok(key.map(|row| row.0))
    }

    /// Ends a key for good, and keeps what belongs to it. Returns none if there is no such key.
    pub async fn revoke_key(&self, name: &str) -> Result<Option<Key>> {
        let key: Option<KeyRow> = sqlx::query_as(AssertSqlSafe(format!(
            "UPDATE keys SET revoked_at = coalesce(revoked_at, $1) WHERE name = $2 RETURNING {COLUMNS}"
        )))
        .bind(self.clock.now())
        .bind(name)
        .fetch_optional(&self.database.writer)
        .await?;
        Ok(key.map(|row| row.0))
    }

    /// All keys, by name.
    pub async fn keys(&self) -> Result<Vec<Key>> {
        let rows: Vec<KeyRow> = sqlx::query_as(AssertSqlSafe(format!("SELECT {COLUMNS} FROM keys ORDER BY name")))
            .fetch_all(&self.database.reader)
            .await?;
        Ok(rows.into_iter().map(|row| row.0).collect())
    }

    /// The key of a name.
    pub async fn key(&self, name: &str) -> Result<Option<Key>> {
        self.key_where("name", name).await
    }

    /// The key of a secret, whatever its standing.
    pub async fn key_of(&self, secret: &Secret) -> Result<Option<Key>> {
        self.key_where("secret_sha256", &secret.sha256()).await
    }

    async fn key_where(&self, column: &str, value: &str) -> Result<Option<Key>> {
        let sql = format!("SELECT {COLUMNS} FROM keys WHERE {column} = $1");
        let row: Option<KeyRow> =
            sqlx::query_as(AssertSqlSafe(sql)).bind(value).fetch_optional(&self.database.reader).await?;
        Ok(row.map(|row| row.0))
    }

    /// Whether there has ever been a key. Keys are never deleted, so there will always be one.
    pub async fn has_keys(&self) -> Result<bool> {
        let row: Option<(i64,)> =
            sqlx::query_as("SELECT created_at FROM keys LIMIT 1").fetch_optional(&self.database.reader).await?;
        Ok(row.is_some())
    }

    /// Notes that a key was used now.
    pub async fn key_used(&self, id: &str) -> Result<()> {
        sqlx::query("UPDATE keys SET last_used_at = $1 WHERE id = $2")
            .bind(self.clock.now())
            .bind(id)
            .execute(&self.database.writer)
            .await?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn secrets_have_a_form_of_their_own_and_do_not_show_themselves() {
        let secret = Secret::new("00ff00ff00");
        assert_eq!(Secret::parse(secret.reveal()), Some(secret.clone()));
        assert_ne!(Secret::new("00ff00ff00"), secret);
        assert_eq!(format!("{secret:?}"), "Secret");
        for wrong in ["", "gf_", "gf_00ff00ff00_", &secret.reveal()[1..], &secret.reveal().to_uppercase()] {
            assert_eq!(Secret::parse(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn each_scope_allows_what_those_before_it_do() {
        assert!(Scope::ALL.is_sorted());
        for scope in Scope::ALL {
            assert_eq!(scope.as_str().parse(), Ok(scope));
        }
    }
}
