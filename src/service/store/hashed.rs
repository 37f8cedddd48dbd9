//! Folders of files that are named by the SHA-256 of their bytes.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;

use sha2::{Digest, Sha256};
use uuid::Uuid;

/// The hexadecimal digits that name these bytes.
pub fn name(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Creates the folder if necessary and removes incomplete files that a crash left.
pub fn open(dir: &Path) -> io::Result<()> {
    fs::create_dir_all(dir)?;
    for entry in fs::read_dir(dir)? {
        let path = entry?.path();
        if path.extension().is_some_and(|extension| extension == "partial") {
            fs::remove_file(path)?;
        }
    }
    Ok(())
}

/// Writes a file, which is renamed when complete, so that no reader ever sees half of it.
pub fn write(dir: &Path, name: &str, bytes: &[u8]) -> io::Result<()> {
    let partial = dir.join(format!("{}.partial", Uuid::now_v7()));
    let mut file = File::create(&partial)?;
    file.write_all(bytes)?;
    file.sync_all()?;
    fs::rename(&partial, dir.join(name))?;
    File::open(dir)?.sync_all()
}
