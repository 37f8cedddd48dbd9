//! The uploads and kept scenes that a caller may use: its own. Files are named by what is in them, and may be several
//! keys': nobody learns from that what others have.

use gridfall_scene::assets::{Assets, Refusal, Source};
use tokio::runtime::Handle;

use super::caller::Caller;
use super::problem::Problem;
use super::state::Api;
use crate::store::{AssetFiles, JobStore, SceneFiles, StoreError, Upload};

/// For threads that judge scenes, which may wait.
pub struct Holdings {
    /// The key whose files these are; none for all.
    key: Option<String>,
    store: JobStore,
    runtime: Handle,
    assets: AssetFiles,
    scenes: SceneFiles,
}

impl Holdings {
    /// Called where requests are answered.
    pub fn of(api: &Api, caller: &Caller) -> Self {
        Self {
            key: caller.confined_to().map(str::to_owned),
            store: api.store.clone(),
            runtime: Handle::current(),
            assets: api.data.assets(),
            scenes: api.data.scenes(),
        }
    }

    fn has(&self, kind: Upload, id: &str) -> Result<bool, StoreError> {
        match &self.key {
            Some(key) => self.runtime.block_on(self.store.holds(key, kind, id)),
            None => Ok(true),
        }
    }

    /// The document of a kept scene.
    pub fn scene(&self, id: &str) -> Result<Option<String>, Problem> {
        Ok(if self.has(Upload::Scene, id)? { self.scenes.get(id)? } else { None })
    }
}

impl Assets for Holdings {
    fn read(&self, source: Source) -> Result<Vec<u8>, Refusal> {
        if let Source::Asset(id) = source {
            let unknown = |error| {
                let reason = format!("the server cannot look the asset up: {error}");
                Refusal::new("asset_not_read", reason, "try again later")
            };
            if !self.has(Upload::Asset, id).map_err(unknown)? {
                return Err(Refusal::unknown(id));
            }
        }
        self.assets.read(source)
    }
}

/// Notes that a file is a caller's. Returns whether it is new, to the caller, where it was there (`new` says).
pub async fn hold(
    api: &Api,
    caller: &Caller,
    (kind, id, bytes): (Upload, &str, u64),
    new: bool,
) -> Result<bool, Problem> {
    match caller.key() {
        Some(key) => Ok(api.store.hold(&key.id, kind, id, bytes).await?),
        None => Ok(new),
    }
}
