//! Arrays of npz files (NumPy's `savez`).

use std::io::{Cursor, Read};

use npyz::{NpyFile, Order};
use zip::ZipArchive;
use zip::result::ZipError;

use crate::vectors::vector3;

/// Most numbers of one array: 1 GiB.
const MAX_NUMBERS: u64 = 1 << 27;

pub type Archive<'a> = ZipArchive<Cursor<&'a [u8]>>;

/// Whether the bytes look like an npz.
pub fn is_npz(bytes: &[u8]) -> bool {
    bytes.starts_with(b"PK\x03\x04")
}

pub fn open(bytes: &[u8]) -> Result<Archive<'_>, String> {
    ZipArchive::new(Cursor::new(bytes)).map_err(|error| format!("the npz is broken: {error}"))
}

/// An array in row-major order.
pub struct Array {
    pub shape: Vec<u64>,
    pub values: Vec<f64>,
}

impl Array {
    pub fn expect(&self, name: &str, shape: &[u64]) -> Result<(), String> {
        if self.shape == shape {
            return Ok(());
        }
        Err(format!("the array `{name}` has the shape {:?}, where {shape:?} belongs", self.shape))
    }

    /// n vectors of d components; in 2D, z is 0.
    pub fn vectors(self, name: &str, n: u64, d: usize) -> Result<Vec<[f64; 3]>, String> {
        self.expect(name, &[n, d as u64])?;
        Ok(self.values.chunks_exact(d).map(vector3).collect())
    }

    /// n matrices of d × d, the rest of each as in `rest`.
    pub fn matrices(self, name: &str, n: u64, d: usize, rest: [f64; 9]) -> Result<Vec<[f64; 9]>, String> {
        self.expect(name, &[n, d as u64, d as u64])?;
        let matrix = |m: &[f64]| {
            let mut matrix = rest;
            for (k, value) in m.iter().enumerate() {
                matrix[3 * (k / d) + k % d] = *value;
            }
            matrix
        };
        Ok(self.values.chunks_exact(d * d).map(matrix).collect())
    }
}

/// Reads an array of the archive; none if there is none of that name.
pub fn array(archive: &mut Archive, name: &str) -> Result<Option<Array>, String> {
    let broken = |error: &dyn std::fmt::Display| format!("the array `{name}` cannot be read: {error}");
    let entry = match archive.by_name(&format!("{name}.npy")) {
        Ok(entry) => entry,
        Err(ZipError::FileNotFound) => return Ok(None),
        Err(error) => return Err(broken(&error)),
    };
    let file = NpyFile::new(entry.take(8 * MAX_NUMBERS + (1 << 16))).map_err(|error| broken(&error))?;
    let (shape, order) = (file.shape().to_vec(), file.order());
    let count = shape.iter().try_fold(1u64, |n, k| n.checked_mul(*k));
    if count.is_none_or(|n| n > MAX_NUMBERS) {
        return Err(broken(&format!("{MAX_NUMBERS} numbers are the most")));
    }
    let read: Result<Vec<f64>, _> = match file.try_data::<f64>() {
        Ok(values) => values.collect(),
        Err(file) => match file.try_data::<f32>() {
            Ok(values) => values.map(|value| value.map(f64::from)).collect(),
            Err(file) => match file.try_data::<u32>() {
                Ok(values) => values.map(|value| value.map(f64::from)).collect(),
                Err(_) => return Err(broken(&"it is of neither f4, f8 nor u4 (float32, float64, uint32)")),
            },
        },
    };
    let values = read.map_err(|error| broken(&error))?;
    let values = if order == Order::Fortran { rows_first(&values, &shape) } else { values };
    Ok(Some(Array { shape, values }))
}

/// Rearranges column-major values in row-major order.
fn rows_first(values: &[f64], shape: &[u64]) -> Vec<f64> {
    let place = |mut k: usize| {
        // Digits of k, last axis fastest, become strides with the first axis fastest.
        let mut digits = vec![0; shape.len()];
        for (digit, n) in digits.iter_mut().zip(shape).rev() {
            (*digit, k) = (k % *n as usize, k / *n as usize);
        }
        digits.iter().zip(shape).rev().fold(0, |at, (digit, n)| at * *n as usize + digit)
    };
    (0..values.len()).map(|k| values[place(k)]).collect()
}
