//! Uploads: files in the data directory, named by the SHA-256 of their bytes.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::hashed;
use super::objects::Objects;
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
    /// Where they are for other machines, too.
    objects: Option<Objects>,
}

impl AssetFiles {
    /// Creates the folder if necessary and removes incomplete files that a crash left.
    pub(super) fn open(dir: PathBuf) -> io::Result<Self> {
        hashed::open(&dir)?;
        Ok(Self { dir, objects: None })
    }

    /// The folder of a running server.
    pub(super) fn at(dir: PathBuf) -> Self {
        Self { dir, objects: None }
    }

    pub(super) fn with_objects(self, objects: Objects) -> Self {
        Self { objects: Some(objects), ..self }
    }

    /// Stores the bytes. Returns false if they were there already.
    pub fn put(&self, bytes: &[u8], kind: &str) -> io::Result<(Asset, bool)> {
        let hex = hashed::name(bytes);
        let asset = Asset { id: format!("sha256:{hex}"), bytes: bytes.len() as u64, kind: kind.to_owned() };
        if self.find(&asset.id)?.is_some() {
            return Ok((asset, false));
        }
        let name = format!("{hex}.{kind}");
        hashed::write(&self.dir, &name, bytes)?;
        self.share(&name)?;
        Ok((asset, true))
    }

    /// Gives a file of the folder to other machines. Where that fails, the file goes: an upload is everywhere or
    /// nowhere.
    fn share(&self, name: &str) -> io::Result<()> {
        let Some(objects) = &self.objects else { return Ok(()) };
        let path = self.dir.join(name);
        objects.wait(objects.put_asset(name, &path)).map_err(|error| {
            let _ = fs::remove_file(&path);
            io::Error::other(error)
        })
    }

    /// Takes over a file that will not change, by a link where the file system has them. Returns false if its bytes
    /// were there already.
    pub fn keep(&self, file: &Path, kind: &str) -> io::Result<(Asset, bool)> {
        let (hex, bytes) = hashed::name_of(file)?;
        let asset = Asset { id: format!("sha256:{hex}"), bytes, kind: kind.to_owned() };
        if self.find(&asset.id)?.is_some() {
            return Ok((asset, false));
        }
        let name = format!("{hex}.{kind}");
        hashed::link(&self.dir, &name, file)?;
        self.share(&name)?;
        Ok((asset, true))
    }

    /// An upload and its file. Like all of these, for threads that may wait.
    pub fn find(&self, id: &str) -> io::Result<Option<(Asset, PathBuf)>> {
        for entry in fs::read_dir(&self.dir)? {
            let path = entry?.path();
            if let Some(asset) = asset(&path)?.filter(|asset| asset.id == id) {
                return Ok(Some((asset, path)));
            }
        }
        let Some(objects) = &self.objects else { return Ok(None) };
        let elsewhere = self.elsewhere()?.into_iter().find(|asset| asset.id == id);
        let Some(asset) = elsewhere else { return Ok(None) };
        let name = format!("{}.{}", &asset.id["sha256:".len()..], asset.kind);
        let path = self.dir.join(&name);
        objects.wait(objects.fetch_asset(&name, asset.bytes, &path)).map_err(io::Error::other)?;
        Ok(Some((asset, path)))
    }

    /// All uploads, by id.
    pub fn list(&self) -> io::Result<Vec<Asset>> {
        let mut found = self.elsewhere()?;
        for entry in fs::read_dir(&self.dir)? {
            found.extend(asset(&entry?.path())?);
        }
        found.sort_by(|a, b| a.id.cmp(&b.id));
        found.dedup_by(|a, b| a.id == b.id);
        Ok(found)
    }

    /// The uploads in the object storage.
    fn elsewhere(&self) -> io::Result<Vec<Asset>> {
        let Some(objects) = &self.objects else { return Ok(Vec::new()) };
        let objects = objects.wait(objects.assets()).map_err(io::Error::other)?;
        Ok(objects.iter().filter_map(|(name, bytes)| named(Path::new(name), *bytes)).collect())
    }
}

/// The upload that a file is; `None` for other files.
fn asset(path: &Path) -> io::Result<Option<Asset>> {
    Ok(named(path, path.metadata()?.len()))
}

/// The upload that is named so.
fn named(path: &Path, bytes: u64) -> Option<Asset> {
    let part = |part: Option<&std::ffi::OsStr>| part.and_then(|p| p.to_str()).map(str::to_owned);
    let (hex, kind) = (part(path.file_stem())?, part(path.extension())?);
    let named = hex.len() == 64 && hex.bytes().all(|b| b.is_ascii_hexdigit());
    named.then(|| Asset { id: format!("sha256:{hex}"), bytes, kind })
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
