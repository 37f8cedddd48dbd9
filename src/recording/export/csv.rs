//! CSV: a line of names, then a line a point. Numbers read back as they were recorded.

use std::io::{self, Write};

use foxglove::messages::packed_element_field::NumericType;

use super::Frame;

pub fn write(frame: &Frame, to: &mut impl Write) -> io::Result<()> {
    let scalars = frame.scalars();
    write!(to, "time_s,x,y,z")?;
    scalars.iter().try_for_each(|(name, _)| write!(to, ",{name}"))?;
    writeln!(to)?;
    let time_s = frame.cloud.time_s();
    for (point, [x, y, z]) in frame.points().zip(frame.positions()) {
        write!(to, "{time_s},{x},{y},{z}")?;
        for (_, element) in &scalars {
            let value = element.read(point);
            match element.kind {
                // As short as f32 allows.
                NumericType::Float32 => write!(to, ",{}", value as f32)?,
                _ => write!(to, ",{value}")?,
            }
        }
        writeln!(to)?;
    }
    Ok(())
}
