//! Scenes kept for later: files in the data directory, named by the SHA-256 of their bytes.

use std::fs;
use std::io;
use std::path::PathBuf;

use super::hashed;

const PREFIX: &str = "sha256:";

/// The folder of scenes.
#[derive(Clone, Debug)]
pub struct SceneFiles {
    dir: PathBuf,
}

impl SceneFiles {
    /// Creates the folder if necessary and removes incomplete files that a crash left.
    pub(super) fn open(dir: PathBuf) -> io::Result<Self> {
        hashed::open(&dir)?;
        Ok(Self { dir })
    }

    /// The folder of a running server.
    pub(super) fn at(dir: PathBuf) -> Self {
        Self { dir }
    }

    /// Keeps a document. Returns its id, and false if it was there already.
    pub fn put(&self, document: &str) -> io::Result<(String, bool)> {
        let hex = hashed::name(document.as_bytes());
        let (id, name) = (format!("{PREFIX}{hex}"), format!("{hex}.json"));
        if self.dir.join(&name).exists() {
            return Ok((id, false));
        }
        hashed::write(&self.dir, &name, document.as_bytes())?;
        Ok((id, true))
    }

    /// The document with this id; none if there is none, or if it is no id.
    pub fn get(&self, id: &str) -> io::Result<Option<String>> {
        let Some(hex) = id.strip_prefix(PREFIX).filter(|hex| is_hash(hex)) else { return Ok(None) };
        match fs::read_to_string(self.dir.join(format!("{hex}.json"))) {
            Ok(document) => Ok(Some(document)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// The ids of all scenes, in order.
    pub fn list(&self) -> io::Result<Vec<String>> {
        let mut ids = Vec::new();
        for entry in fs::read_dir(&self.dir)? {
            let name = entry?.file_name().into_string().unwrap_or_default();
            ids.extend(name.strip_suffix(".json").filter(|hex| is_hash(hex)).map(|hex| format!("{PREFIX}{hex}")));
        }
        ids.sort_unstable();
        Ok(ids)
    }
}

fn is_hash(hex: &str) -> bool {
    hex.len() == 64 && hex.bytes().all(|byte| byte.is_ascii_digit() || (b'a'..=b'f').contains(&byte))
}
