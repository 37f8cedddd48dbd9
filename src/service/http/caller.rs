//! Who asks. A caller shows the secret of a key; what a server knows of keys it looks up again every few seconds.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use axum::extract::FromRequestParts;
use axum::http::request::Parts;
use axum::http::{HeaderMap, header};
use jiff::Timestamp;
use uuid::Uuid;

use super::problem::{Problem, internal};
use super::state::Api;
use crate::store::{Key, Owner, Scope, Secret};

/// How long a key is taken as it was, so that clients may ask often. A key that was revoked is good for as long.
const FRESH: Duration = Duration::from_secs(3);
/// How often it is noted that a key was used.
const USE_NOTED: jiff::SignedDuration = jiff::SignedDuration::from_secs(60);
/// Keys, and owners of jobs, that are remembered.
const KNOWN: usize = 1 << 16;
/// The cookie that the dashboard signs in by.
pub const COOKIE: &str = "gridfall_key";

/// Whom a request comes from.
#[derive(Clone, Debug)]
pub enum Caller {
    /// Whoever can reach the server: it asks nobody for a key.
    Anybody,
    Key(Arc<Key>),
}

impl Caller {
    /// Whose a thing is that this caller makes.
    pub fn owner(&self) -> Owner {
        match self {
            Self::Anybody => Owner::default(),
            Self::Key(key) => Owner { key: key.id.clone(), max_queued: key.quotas.queued },
        }
    }

    pub fn key(&self) -> Option<&Arc<Key>> {
        match self {
            Self::Anybody => None,
            Self::Key(key) => Some(key),
        }
    }

    /// The id of the key whose things alone this caller may see; none for all there are.
    pub fn confined_to(&self) -> Option<&str> {
        self.key().filter(|key| key.scope < Scope::Admin).map(|key| key.id.as_str())
    }
}

impl FromRequestParts<Api> for Caller {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &Api) -> Result<Self, Problem> {
        // Routes that are open to all have none.
        parts.extensions.get::<Self>().cloned().ok_or_else(|| internal("a route asks for a caller, and is open to all"))
    }
}

/// The secret that a request shows: that of its header or, without one, of its cookie.
pub fn shown(headers: &HeaderMap) -> Option<&str> {
    match headers.get(header::AUTHORIZATION) {
        // What is neither is no secret, and is refused as such.
        Some(value) => {
            let text = value.to_str().unwrap_or_default();
            let bearer = text.split_once(' ').filter(|(scheme, _)| scheme.eq_ignore_ascii_case("bearer"));
            Some(bearer.map_or(text, |(_, token)| token.trim()))
        }
        None => {
            let cookies = headers.get_all(header::COOKIE).into_iter().filter_map(|value| value.to_str().ok());
            let named = |pair: &'_ str| pair.trim().split_once('=').filter(|(name, _)| *name == COOKIE).is_some();
            let pair = cookies.flat_map(|list| list.split(';')).find(|pair| named(pair))?;
            pair.trim().split_once('=').map(|(_, value)| value)
        }
    }
}

type Looked = (Instant, Option<Arc<Key>>);

/// What is known of keys, and of whose things are.
#[derive(Debug, Default)]
pub struct Authority {
    /// There are keys. There will then always be some.
    asks: AtomicBool,
    looked_at: Mutex<Option<Instant>>,
    /// By the hashes of secrets: when a key was looked up, and whether there is one.
    keys: Mutex<HashMap<String, Looked>>,
    /// Whose a job or sweep is never changes.
    owners: Mutex<HashMap<Uuid, Arc<str>>>,
}

impl Api {
    /// Whether everybody is asked for a key.
    pub(super) async fn asks_for_keys(&self) -> Result<bool, Problem> {
        let authority = &self.authority;
        if self.has_asked() {
            return Ok(true);
        }
        let fresh = authority.looked_at.lock().expect(UNBROKEN).is_some_and(|at| at.elapsed() < FRESH);
        if fresh {
            return Ok(false);
        }
        let asks = self.store.has_keys().await?;
        authority.asks.store(asks, Ordering::Relaxed);
        *authority.looked_at.lock().expect(UNBROKEN) = Some(Instant::now());
        Ok(asks)
    }

    /// Whether somebody has been asked for a key.
    pub(super) fn has_asked(&self) -> bool {
        self.config.require_keys || self.authority.asks.load(Ordering::Relaxed)
    }

    /// The key of a secret, whatever its standing.
    pub(super) async fn key_of(&self, secret: &Secret) -> Result<Option<Arc<Key>>, Problem> {
        let hash = secret.sha256();
        let known = self.authority.keys.lock().expect(UNBROKEN).get(&hash).cloned();
        if let Some((at, key)) = known
            && at.elapsed() < FRESH
        {
            return Ok(key);
        }
        let key = self.store.key_of(secret).await?.map(Arc::new);
        remember(&self.authority.keys, hash, (Instant::now(), key.clone()));
        if let Some(key) = &key {
            self.note_use(key);
        }
        Ok(key)
    }

    fn note_use(&self, key: &Key) {
        if key.last_used_at.is_none_or(|last| Timestamp::now().duration_since(last) > USE_NOTED) {
            let (store, id) = (self.store.clone(), key.id.clone());
            tokio::spawn(async move {
                if let Err(error) = store.key_used(&id).await {
                    tracing::warn!(%error, "cannot note that a key was used");
                }
            });
        }
    }

    /// Whether a caller may see a job, which there may be.
    pub(super) async fn may_see_job(&self, caller: &Caller, id: Uuid) -> Result<bool, Problem> {
        let Some(key) = caller.confined_to() else { return Ok(true) };
        if let Some(owner) = self.authority.owners.lock().expect(UNBROKEN).get(&id) {
            return Ok(**owner == *key);
        }
        let Some(owner) = self.store.owner_of_job(id).await? else { return Ok(false) };
        let own = owner == key;
        remember(&self.authority.owners, id, owner.into());
        Ok(own)
    }

    /// Whether a caller may see a sweep, which there may be.
    pub(super) async fn may_see_sweep(&self, caller: &Caller, id: Uuid) -> Result<bool, Problem> {
        let Some(key) = caller.confined_to() else { return Ok(true) };
        Ok(self.store.owner_of_sweep(id).await?.is_some_and(|owner| owner == key))
    }
}

const UNBROKEN: &str = "no code panics while it holds this lock";

fn remember<K: std::hash::Hash + Eq, V>(known: &Mutex<HashMap<K, V>>, key: K, value: V) {
    let mut known = known.lock().expect(UNBROKEN);
    if known.len() >= KNOWN {
        known.clear();
    }
    known.insert(key, value);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn secrets_come_by_header_or_cookie() {
        type Headers = &'static [(&'static str, &'static str)];
        let cases: &[(Headers, Option<&str>)] = &[
            (&[], None),
            (&[("authorization", "Bearer a")], Some("a")),
            (&[("authorization", "bearer  a ")], Some("a")),
            (&[("authorization", "Basic a")], Some("Basic a")),
            (&[("cookie", "theme=dark; gridfall_key=b")], Some("b")),
            (&[("cookie", "x_gridfall_key=b")], None),
            (&[("cookie", "theme=dark"), ("cookie", "gridfall_key=b")], Some("b")),
            (&[("authorization", "Bearer a"), ("cookie", "gridfall_key=b")], Some("a")),
        ];
        for (headers, expected) in cases {
            let mut map = HeaderMap::new();
            for (name, value) in *headers {
                map.append(header::HeaderName::from_static(name), value.parse().unwrap());
            }
            assert_eq!(shown(&map), *expected, "{headers:?}");
        }
    }
}
