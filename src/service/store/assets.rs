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

impl Asset {
    /// The digits of its id.
    fn digits(&self) -> &str {
        &self.id["sha256:".len()..]
    }

    /// The name of its file.
    fn file(&self) -> String {
        format!("{}.{}", self.digits(), self.kind)
    }
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
        self.keep_as(asset, |name| hashed::write(&self.dir, name, bytes))
    }

    /// Takes over a file that will not change, by a link where the file system has them. Returns false if its bytes
    /// were there already.
    pub fn keep(&self, file: &Path, kind: &str) -> io::Result<(Asset, bool)> {
        let (hex, bytes) = hashed::name_of(file)?;
        let asset = Asset { id: format!("sha256:{hex}"), bytes, kind: kind.to_owned() };
        self.keep_as(asset, |name| hashed::link(&self.dir, name, file))
    }

    fn keep_as(&self, asset: Asset, make: impl FnOnce(&str) -> io::Result<()>) -> io::Result<(Asset, bool)> {
        let found = self.find(&asset.id)?;
        let new = found.is_none();
        let asset = found.map_or(asset, |(asset, _)| asset);
        if new {
            make(&asset.file())?;
        }
        // The other machines may not have it, although it is here.
        self.share(&asset)?;
        Ok((asset, new))
    }

    /// Gives an upload to other machines.
    fn share(&self, asset: &Asset) -> io::Result<()> {
        let Some(objects) = &self.objects else { return Ok(()) };
        let name = asset.file();
        objects.wait(objects.put_asset(&name, &self.dir.join(&name))).map_err(io::Error::other)
    }

    /// Gives all uploads to other machines.
    pub fn share_all(&self) -> io::Result<()> {
        self.here()?.iter().try_for_each(|(asset, _)| self.share(asset))
    }

    /// An upload and its file. Like all of these, for threads that may wait.
    pub fn find(&self, id: &str) -> io::Result<Option<(Asset, PathBuf)>> {
        let here = self.here()?.into_iter().find(|(asset, _)| asset.id == id);
        let Some(objects) = self.objects.as_ref().filter(|_| here.is_none()) else { return Ok(here) };
        let Some(asset) = self.elsewhere()?.into_iter().find(|asset| asset.id == id) else { return Ok(None) };
        let (name, partial) = (asset.file(), hashed::partial(&self.dir));
        objects.wait(objects.fetch_asset(&name, asset.bytes, &partial)).map_err(io::Error::other)?;
        if hashed::name_of(&partial)?.0 != asset.digits() {
            fs::remove_file(&partial)?;
            return Err(io::Error::other(format!("the object storage holds other bytes as {id}")));
        }
        let path = self.dir.join(name);
        fs::rename(&partial, &path)?;
        Ok(Some((asset, path)))
    }

    /// All uploads, by id.
    pub fn list(&self) -> io::Result<Vec<Asset>> {
        let mut found = self.elsewhere()?;
        found.extend(self.here()?.into_iter().map(|(asset, _)| asset));
        found.sort_by(|a, b| a.id.cmp(&b.id));
        found.dedup_by(|a, b| a.id == b.id);
        Ok(found)
    }

    /// The uploads in the folder.
    fn here(&self) -> io::Result<Vec<(Asset, PathBuf)>> {
        let mut found = Vec::new();
        for entry in fs::read_dir(&self.dir)? {
            let path = entry?.path();
            found.extend(asset(&path)?.map(|asset| (asset, path)));
        }
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
