//! Folders of files that are named by the SHA-256 of their bytes.

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};
use uuid::Uuid;

/// The hexadecimal digits that name these bytes.
pub fn name(bytes: &[u8]) -> String {
    digits(&Sha256::digest(bytes))
}

/// The digits for the bytes of a file, and their number.
pub fn name_of(file: &Path) -> io::Result<(String, u64)> {
    let (mut from, mut hash, mut bytes) = (File::open(file)?, Sha256::new(), 0);
    let mut part = vec![0; 1 << 20];
    loop {
        let n = from.read(&mut part)?;
        if n == 0 {
            break;
        }
        hash.update(&part[..n]);
        bytes += n as u64;
    }
    Ok((digits(&hash.finalize()), bytes))
}

fn digits(hash: &[u8]) -> String {
    hash.iter().map(|byte| format!("{byte:02x}")).collect()
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

/// A name in the folder for a file that is not complete.
pub fn partial(dir: &Path) -> PathBuf {
    dir.join(format!("{}.partial", Uuid::now_v7()))
}

/// Writes a file, which is renamed when complete, so that no reader ever sees half of it.
pub fn write(dir: &Path, name: &str, bytes: &[u8]) -> io::Result<()> {
    let partial = partial(dir);
    let mut file = File::create(&partial)?;
    file.write_all(bytes)?;
    file.sync_all()?;
    fs::rename(&partial, dir.join(name))?;
    File::open(dir)?.sync_all()
}

/// Gives a file a second name in the folder; copies it where that is not possible.
pub fn link(dir: &Path, name: &str, file: &Path) -> io::Result<()> {
    let partial = partial(dir);
    if fs::hard_link(file, &partial).is_err() {
        fs::copy(file, &partial)?;
        File::open(&partial)?.sync_all()?;
    }
    fs::rename(&partial, dir.join(name))?;
    File::open(dir)?.sync_all()
}
