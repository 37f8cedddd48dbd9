//! OBJ: an object a body, with normals. It has no place for velocities.

use std::io::{self, Write};

use super::{Model, line_of};

pub fn write(model: &Model, to: &mut impl Write) -> io::Result<()> {
    writeln!(to, "# time_s {}", model.time_s)?;
    let mut first = 1;
    for part in &model.parts {
        let skin = &part.skin;
        writeln!(to, "o {}", line_of(&part.name))?;
        for x in &skin.positions {
            let [x, y, z] = model.global(*x);
            writeln!(to, "v {x} {y} {z}")?;
        }
        skin.normals.iter().try_for_each(|[x, y, z]| writeln!(to, "vn {x} {y} {z}"))?;
        for corners in &skin.triangles {
            let [a, b, c] = corners.map(|corner| first + corner as usize);
            writeln!(to, "f {a}//{a} {b}//{b} {c}//{c}")?;
        }
        first += skin.positions.len();
    }
    Ok(())
}
