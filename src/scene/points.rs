//! Particles from files: PLY (x, y, z; optionally vx, vy, vz) and npz (`x` n × d; optionally `v` n
//! × d, `F` n × d × d and `volume`).

use gridfall_core::sim::particles::IDENTITY;

use crate::mesh::ply;
use crate::npz::{self, Array};

/// The particles of a file, in the order of the file. 2D points have z = 0 and F_zz = 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    /// Position (m).
    pub x: Vec<[f64; 3]>,
    /// Velocity (m/s), if the file has it.
    pub v: Option<Vec<[f64; 3]>>,
    /// Deformation gradient, if the file has it.
    pub f: Option<Vec<[f64; 9]>>,
    /// Initial volume of one particle (m³; 2D: m²), if the file has it.
    pub volume: Option<f64>,
}

/// Reads points of the given dimension. Errors say what is wrong with the file.
pub fn read(bytes: &[u8], dimension: usize) -> Result<Points, String> {
    let points = if npz::is_npz(bytes) {
        from_npz(bytes, dimension)?
    } else if bytes.starts_with(b"ply") {
        let (x, v) = ply::points(bytes).map_err(|error| error.0)?;
        let flat = |v: [f64; 3]| if dimension == 2 { [v[0], v[1], 0.0] } else { v };
        Points {
            x: x.into_iter().map(flat).collect(),
            v: v.map(|v| v.into_iter().map(flat).collect()),
            f: None,
            volume: None,
        }
    } else {
        return Err("it is neither PLY nor npz".into());
    };
    if points.x.is_empty() {
        return Err("it has no points".into());
    }
    let bad = |values: &[[f64; 3]]| values.iter().position(|v| v.iter().any(|c| !c.is_finite()));
    for (name, values) in [("position", Some(&points.x)), ("velocity", points.v.as_ref())] {
        if let Some(n) = values.and_then(|values| bad(values)) {
            return Err(format!("the {name} of point {n} is not finite"));
        }
    }
    if points.volume.is_some_and(|volume| !(volume > 0.0 && volume.is_finite())) {
        return Err("the volume is not above 0".into());
    }
    Ok(points)
}

fn from_npz(bytes: &[u8], dimension: usize) -> Result<Points, String> {
    let mut archive = npz::open(bytes)?;
    let Some(x) = npz::array(&mut archive, "x")? else { return Err("it lacks the array `x` of positions".into()) };
    let n = x.shape.first().copied().unwrap_or(0);
    let x = x.vectors("x", n, dimension)?;
    let v = npz::array(&mut archive, "v")?.map(|v| v.vectors("v", n, dimension)).transpose()?;
    let f = npz::array(&mut archive, "F")?.map(|f| f.matrices("F", n, dimension, IDENTITY)).transpose()?;
    let volume = npz::array(&mut archive, "volume")?.map(|volume| one_volume(&volume, n)).transpose()?;
    Ok(Points { x, v, f, volume })
}

/// The volume of every particle; the particles of a body all have the same.
fn one_volume(array: &Array, n: u64) -> Result<f64, String> {
    if !array.shape.is_empty() {
        array.expect("volume", &[n])?;
    }
    let first = array.values.first().copied().unwrap_or(f64::NAN);
    let same = array.values.iter().all(|v| (v - first).abs() <= 1e-5 * first.abs());
    same.then_some(first).ok_or_else(|| "the volumes differ; give particles of one volume to one body each".into())
}

#[cfg(test)]
mod tests {
    use std::io::{Cursor, Write};

    use npyz::{Order, WriterBuilder};
    use zip::ZipWriter;
    use zip::write::SimpleFileOptions;

    use super::*;

    /// An npz of arrays: name, shape, values, and whether columns come first.
    fn npz(arrays: &[(&str, &[u64], &[f64], bool)], compressed: bool) -> Vec<u8> {
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        let method = if compressed { zip::CompressionMethod::Deflated } else { zip::CompressionMethod::Stored };
        for (name, shape, values, fortran) in arrays {
            let mut bytes = Vec::new();
            let options = npyz::WriteOptions::new().default_dtype().shape(shape);
            let order = if *fortran { Order::Fortran } else { Order::C };
            let mut writer = options.order(order).writer(&mut bytes).begin_nd().unwrap();
            writer.extend(values.iter().copied()).unwrap();
            writer.finish().unwrap();
            zip.start_file(format!("{name}.npy"), SimpleFileOptions::default().compression_method(method)).unwrap();
            zip.write_all(&bytes).unwrap();
        }
        zip.finish().unwrap().into_inner()
    }

    const X: [f64; 6] = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];

    #[test]
    fn arrays_are_read_in_either_order_and_compressed() {
        for compressed in [false, true] {
            let f: Vec<f64> = (0..18).map(f64::from).collect();
            let bytes = npz(
                &[("x", &[2, 3], &X, false), ("F", &[2, 3, 3], &f, false), ("volume", &[], &[0.5], false)],
                compressed,
            );
            let points = read(&bytes, 3).unwrap();
            assert_eq!(points.x, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
            assert_eq!(points.f.unwrap()[1], [9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0, 16.0, 17.0]);
            assert_eq!((points.v, points.volume), (None, Some(0.5)));
            // The same numbers as columns: x = [[1, 3, 5], [2, 4, 6]].
            let columns = read(&npz(&[("x", &[2, 3], &X, true), ("v", &[2, 3], &X, false)], compressed), 3).unwrap();
            assert_eq!(columns.x, [[1.0, 3.0, 5.0], [2.0, 4.0, 6.0]]);
            assert_eq!(columns.v.unwrap(), [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
        }
        let flat = npz(&[("x", &[3, 2], &X, false), ("F", &[3, 2, 2], &[2.0; 12], false)], false);
        let flat = read(&flat, 2).unwrap();
        assert_eq!(flat.x[2], [5.0, 6.0, 0.0]);
        assert_eq!(flat.f.unwrap()[0], [2.0, 2.0, 0.0, 2.0, 2.0, 0.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn ply_points_may_have_velocities() {
        let ply = |more: &str, row: &str| {
            format!(
                "ply\nformat ascii 1.0\nelement vertex 2\n\
                 property float x\nproperty float y\nproperty double z\n{more}end_header\n{row}\n{row}\n"
            )
        };
        let points = read(ply("", "1 2 3").as_bytes(), 3).unwrap();
        assert_eq!((points.x, points.v), (vec![[1.0, 2.0, 3.0]; 2], None));
        let v = "property float vx\nproperty float vy\nproperty float vz\n";
        let points = read(ply(v, "1 2 3 4 5 6").as_bytes(), 2).unwrap();
        assert_eq!((points.x[0], points.v.unwrap()[1]), ([1.0, 2.0, 0.0], [4.0, 5.0, 0.0]));
        assert!(read(ply("", "1 2 nan").as_bytes(), 3).unwrap_err().contains("broken"));
        assert!(read(ply("property float vx\n", "1 2 3 4").as_bytes(), 3).unwrap().v.is_none());
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let bad = |arrays: &[(&str, &[u64], &[f64], bool)], part: &str| {
            let error = read(&npz(arrays, false), 3).unwrap_err();
            assert!(error.contains(part), "{error}");
        };
        let x: (&str, &[u64], &[f64], bool) = ("x", &[2, 3], &X, false);
        bad(&[("y", &[2, 3], &X, false)], "lacks the array `x`");
        bad(&[("x", &[3, 2], &X, false)], "shape [3, 2], where [3, 3] belongs");
        bad(&[("x", &[0, 3], &[], false)], "no points");
        bad(&[("x", &[6], &X, false)], "shape [6]");
        bad(&[x, ("v", &[1, 3], &X[..3], false)], "`v`");
        bad(&[x, ("F", &[2, 3], &X, false)], "`F`");
        bad(&[x, ("volume", &[2], &[1.0, 2.0], false)], "volumes differ");
        bad(&[x, ("volume", &[2], &[0.0, 0.0], false)], "not above 0");
        bad(&[("x", &[2, 3], &[0.0, 0.0, f64::INFINITY, 0.0, 0.0, 0.0], false)], "position of point 0");
        assert!(read(b"x y z\n", 3).unwrap_err().contains("neither PLY nor npz"));
        let whole = npz(&[x], true);
        for end in 0..whole.len() {
            assert!(read(&whole[..end], 3).is_err());
        }
    }
}
