//! Uploads: files in the data directory, named by the SHA-256 of their bytes.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::hashed;
use gridfall_scene::assets::{Assets, Refusal, Source};

/// One upload.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Asset {
    /// `sha256:` and 64 hexadecimal digits.
    pub id: String,
    pub bytes: u64,
    /// `stl`, `obj`, …
    pub kind: String,
}

/// The folder of uploads.
#[derive(Clone, Debug)]
pub struct AssetFiles {
    dir: PathBuf,
}

impl AssetFiles {
    /// Creates the folder if necessary and removes incomplete files that a crash left.
    pub(super) fn open(dir: PathBuf) -> io::Result<Self> {
        hashed::open(&dir)?;
        Ok(Self { dir })
    }

    /// The folder of a running server.
    pub(super) fn at(dir: PathBuf) -> Self {
        Self { dir }
    }

    /// Stores the bytes. Returns false if they were there already.
    pub fn put(&self, bytes: &[u8], kind: &str) -> io::Result<(Asset, bool)> {
        let hex = hashed::name(bytes);
        let asset = Asset { id: format!("sha256:{hex}"), bytes: bytes.len() as u64, kind: kind.to_owned() };
        if self.find(&asset.id)?.is_some() {
            return Ok((asset, false));
        }
        hashed::write(&self.dir, &format!("{hex}.{kind}"), bytes)?;
        Ok((asset, true))
    }

    /// Takes over a file that will not change, by a link where the file system has them. Returns false if its bytes
    /// were there already.
    pub fn keep(&self, file: &Path, kind: &str) -> io::Result<(Asset, bool)> {
        let (hex, bytes) = hashed::name_of(file)?;
        let asset = Asset { id: format!("sha256:{hex}"), bytes, kind: kind.to_owned() };
        if self.find(&asset.id)?.is_some() {
            return Ok((asset, false));
        }
        hashed::link(&self.dir, &format!("{hex}.{kind}"), file)?;
        Ok((asset, true))
    }

    /// An upload and its file.
    pub fn find(&self, id: &str) -> io::Result<Option<(Asset, PathBuf)>> {
        for entry in fs::read_dir(&self.dir)? {
            let path = entry?.path();
            if let Some(asset) = asset(&path)?.filter(|asset| asset.id == id) {
                return Ok(Some((asset, path)));
            }
        }
        Ok(None)
    }

    /// All uploads, by id.
    pub fn list(&self) -> io::Result<Vec<Asset>> {
        let mut found = Vec::new();
        for entry in fs::read_dir(&self.dir)? {
            found.extend(asset(&entry?.path())?);
        }
        found.sort_by(|a, b| a.id.cmp(&b.id));
        Ok(found)
    }
}

/// The upload that a file is; `None` for other files.
fn asset(path: &Path) -> io::Result<Option<Asset>> {
    let part = |part: Option<&std::ffi::OsStr>| part.and_then(|p| p.to_str()).map(str::to_owned);
    let (Some(hex), Some(kind)) = (part(path.file_stem()), part(path.extension())) else { return Ok(None) };
    let named = hex.len() == 64 && hex.bytes().all(|b| b.is_ascii_hexdigit());
    let bytes = if named { path.metadata()?.len() } else { 0 };
    Ok(named.then(|| Asset { id: format!("sha256:{hex}"), bytes, kind }))
}

impl Assets for AssetFiles {
    fn read(&self, source: Source) -> Result<Vec<u8>, Refusal> {
        let Source::Asset(id) = source else { return Err(Refusal::no_files()) };
        let unreadable = |error: io::Error| {
            Refusal::new("asset_not_read", format!("the server cannot read the asset: {error}"), "try again later")
        };
        match self.find(id).map_err(unreadable)? {
            Some((_, path)) => fs::read(path).map_err(unreadable),
            None => Err(Refusal::unknown(id)),
        }
    }
}
