//! The last state of a run, for another run to begin with and for NumPy: an npz with `x`, `v` (n × d), `B`, `F`
//! (n × d × d), `plastic` and `body` (n), of all particles in sampling order ([`Particles`] has what they mean).

use std::fs::File;
use std::io::{self, BufWriter, Seek, Write};
use std::path::Path;

use zip::ZipWriter;

use crate::arrays::array;
use crate::files::{RecordingError, partial_path, publish};
use gridfall_core::sim::particles::Particles;

/// Writes a state. Other processes see it complete or not at all.
///
/// # Errors
/// When the file cannot be written.
pub fn write(path: &Path, dimension: usize, particles: &Particles) -> Result<(), RecordingError> {
    let partial = partial_path(path);
    let file = File::create(&partial).map_err(RecordingError::io("create", &partial))?;
    let mut npz = ZipWriter::new(BufWriter::with_capacity(1 << 20, file));
    arrays(&mut npz, dimension, particles)
        .and_then(|()| npz.finish()?.flush())
        .map_err(RecordingError::io("write", &partial))?;
    publish(&partial, path)
}

fn arrays(npz: &mut ZipWriter<impl Write + Seek>, d: usize, particles: &Particles) -> io::Result<()> {
    let Particles { x, v, b, f, plastic, body, .. } = particles;
    let n = x.len() as u64;
    let vector = |v: &[f64; 3]| v[..d].to_vec();
    let matrix = |m: &[f64; 9]| (0..d * d).map(|k| m[3 * (k / d) + k % d]).collect::<Vec<f64>>();
    let (vectors, matrices) = ([n, d as u64], [n, d as u64, d as u64]);
    array(npz, "x", &vectors, x.iter().flat_map(vector))?;
    array(npz, "v", &vectors, v.iter().flat_map(vector))?;
    array(npz, "B", &matrices, b.iter().flat_map(matrix))?;
    array(npz, "F", &matrices, f.iter().flat_map(matrix))?;
    array(npz, "plastic", &[n], plastic.iter().copied())?;
    array(npz, "body", &[n], body.iter().copied())
}
