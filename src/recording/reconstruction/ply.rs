//! PLY: all bodies in one mesh, with the number of the body at each vertex.

use std::io::{self, Write};

use super::{Model, line_of, reals};
use crate::palette::to_srgb;

pub fn write(model: &Model, to: &mut impl Write) -> io::Result<()> {
    let moves = model.moves();
    writeln!(to, "ply\nformat binary_little_endian 1.0\ncomment time_s {}", model.time_s)?;
    for part in &model.parts {
        writeln!(to, "comment body {} {}", part.number, line_of(&part.name))?;
    }
    let count = |of: fn(&super::Skin) -> usize| model.parts.iter().map(|part| of(&part.skin)).sum::<usize>();
    writeln!(to, "element vertex {}", count(|skin| skin.positions.len()))?;
    let mut properties = vec!["double x", "double y", "double z", "float nx", "float ny", "float nz"];
    properties.extend(["float vx", "float vy", "float vz"].iter().filter(|_| moves));
    properties.extend(["uchar red", "uchar green", "uchar blue", "uint body"]);
    properties.iter().try_for_each(|property| writeln!(to, "property {property}"))?;
    writeln!(to, "element face {}", count(|skin| skin.triangles.len()))?;
    writeln!(to, "property list uchar uint vertex_indices\nend_header")?;
    for part in &model.parts {
        let (skin, color) = (&part.skin, part.color.map(to_srgb));
        for (k, x) in skin.positions.iter().enumerate() {
            model.global(*x).iter().try_for_each(|x| to.write_all(&x.to_le_bytes()))?;
            reals(to, &skin.normals[k])?;
            if moves {
                reals(to, &skin.velocities[k])?;
            }
            to.write_all(&color)?;
            to.write_all(&(part.number as u32).to_le_bytes())?;
        }
    }
    let mut first = 0;
    for part in &model.parts {
        for corners in &part.skin.triangles {
            to.write_all(&[3])?;
            corners.iter().try_for_each(|corner| to.write_all(&(first + corner).to_le_bytes()))?;
        }
        first += part.skin.positions.len() as u32;
    }
    Ok(())
}
