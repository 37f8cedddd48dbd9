//! PLY: a vertex a point, `x`, `y`, `z` in f64 and the recorded scalars as they are.

use std::io::{self, Write};

use super::{Frame, kind_name};

const NAMES: [&str; 8] = ["uchar", "char", "ushort", "short", "uint", "int", "float", "double"];

pub fn write(frame: &Frame, to: &mut impl Write) -> io::Result<()> {
    let scalars = frame.scalars();
    writeln!(to, "ply\nformat binary_little_endian 1.0\ncomment time_s {}", frame.cloud.time_s())?;
    for (number, name) in frame.bodies.iter().enumerate() {
        // A comment ends with its line.
        writeln!(to, "comment body {number} {}", name.replace(char::is_control, " "))?;
    }
    writeln!(to, "element vertex {}", frame.len())?;
    ["x", "y", "z"].iter().try_for_each(|axis| writeln!(to, "property double {axis}"))?;
    scalars
        .iter()
        .try_for_each(|(name, element)| writeln!(to, "property {} {name}", kind_name(element.kind, NAMES)))?;
    writeln!(to, "end_header")?;
    for (point, position) in frame.points().zip(frame.positions()) {
        position.iter().try_for_each(|x| to.write_all(&x.to_le_bytes()))?;
        scalars.iter().try_for_each(|(_, element)| to.write_all(element.bytes(point)))?;
    }
    Ok(())
}
