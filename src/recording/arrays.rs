//! Arrays in an npz, for NumPy.

use std::io::{self, Seek, Write};

use npyz::{AutoSerialize, WriterBuilder};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

/// Adds an array of this name and shape.
///
/// # Errors
/// When the file cannot be written.
pub fn array<T: AutoSerialize>(
    npz: &mut ZipWriter<impl Write + Seek>,
    name: &str,
    shape: &[u64],
    values: impl Iterator<Item = T>,
) -> io::Result<()> {
    // Stored: the numbers of a simulation hardly get shorter. More than 4 GiB need a longer head.
    let options = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored).large_file(true);
    npz.start_file(format!("{name}.npy"), options)?;
    let mut writer = npyz::WriteOptions::new().default_dtype().shape(shape).writer(npz).begin_nd()?;
    writer.extend(values)?;
    writer.finish()
}
