//! Files that scenes refer to: meshes and particles, from uploads or from the scene's folder.

use std::io;
use std::path::PathBuf;

use crate::{mesh, npz, points};

/// Where a file is, according to the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Source<'a> {
    /// Id of an upload: `sha256:` and 64 hexadecimal digits.
    Asset(&'a str),
    /// Path relative to the scene's folder.
    File(&'a str),
}

impl<'a> Source<'a> {
    /// The one of the two fields that is given; none if both or neither are.
    pub fn of(asset: &'a Option<String>, file: &'a Option<String>) -> Option<Self> {
        match (asset, file) {
            (Some(id), None) => Some(Self::Asset(id)),
            (None, Some(path)) => Some(Self::File(path)),
            _ => None,
        }
    }

    /// The name of the given field, and its value.
    pub fn key(&self) -> (&'static str, String) {
        match *self {
            Self::Asset(value) | Self::File(value) => (self.field(), value.to_owned()),
        }
    }

    /// The name of the given field.
    pub fn field(&self) -> &'static str {
        match self {
            Self::Asset(_) => "asset",
            Self::File(_) => "file",
        }
    }
}

/// Why a file cannot be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// Code of the fault.
    pub code: &'static str,
    pub reason: String,
    pub remedy: String,
}

impl Refusal {
    pub fn new(code: &'static str, reason: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { code, reason: reason.into(), remedy: remedy.into() }
    }

    /// An upload that does not exist.
    pub fn unknown(id: &str) -> Self {
        Self::new(
            "unknown_asset",
            format!("there is no asset {id}"),
            "upload it (PUT /v1/assets) and write the id that it gets",
        )
    }

    /// A path, where only uploads are accepted.
    pub fn no_files() -> Self {
        Self::new(
            "file_refused",
            "files are read on the command line only",
            "upload the file (PUT /v1/assets) and write \"asset\" with its id instead of \"file\"",
        )
    }
}

/// The format of a file that a scene can use, or the reason why it cannot.
pub fn examine(bytes: &[u8]) -> Result<&'static str, String> {
    if npz::is_npz(bytes) {
        let read = points::read(bytes, 3).or_else(|error| points::read(bytes, 2).map_err(|_| error));
        return read.map(|_| "npz").map_err(|error| format!("it has no particles that can be used: {error}"));
    }
    let mesh = mesh::read(bytes).map_err(|error| format!("it is no mesh that can be used: {}", error.0));
    // A PLY without faces holds points.
    mesh.map(drop).or_else(|error| points::read(bytes, 3).map(drop).map_err(|_| error))?;
    Ok(mesh::format(bytes).map_or("", |format| format.name()))
}

/// A source of files for scenes.
pub trait Assets: Sync {
    fn read(&self, source: Source) -> Result<Vec<u8>, Refusal>;
}

/// No files at all, for scenes that come alone.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoAssets;

impl Assets for NoAssets {
    fn read(&self, source: Source) -> Result<Vec<u8>, Refusal> {
        Err(match source {
            Source::Asset(id) => Refusal::unknown(id),
            Source::File(_) => Refusal::no_files(),
        })
    }
}

/// The files beside a scene; for the command line.
#[derive(Clone, Debug)]
pub struct LocalFiles {
    /// Folder of the scene.
    pub folder: PathBuf,
}

impl Assets for LocalFiles {
    fn read(&self, source: Source) -> Result<Vec<u8>, Refusal> {
        match source {
            Source::Asset(_) => Err(Refusal::new(
                "asset_refused",
                "assets are kept by a server; there is none here",
                "write \"file\" with a path relative to the scene instead of \"asset\"",
            )),
            Source::File(path) => {
                let path = self.folder.join(path);
                std::fs::read(&path).map_err(|error| {
                    let remedy = match error.kind() {
                        io::ErrorKind::NotFound => "write a path relative to the scene's folder",
                        _ => "make it a file that can be read",
                    };
                    Refusal::new("file_not_read", format!("cannot read {}: {error}", path.display()), remedy)
                })
            }
        }
    }
}
