//! VTP: VTK's polygonal data, a vertex a point. The numbers follow the XML as they are (`AppendedData`, raw), which the
//! file formats of VTK allow and XML does not. Each array begins with its length (u64, bytes).

use std::io::{self, Write};

use super::{Array, Frame, Shape, kind_name, write_elements};

const NAMES: [&str; 8] = ["UInt8", "Int8", "UInt16", "Int16", "UInt32", "Int32", "Float32", "Float64"];
const AXES: [&str; 3] = ["x", "y", "z"];

pub fn write(frame: &Frame, to: &mut impl Write) -> io::Result<()> {
    let (n, arrays) = (frame.len() as u64, frame.arrays());
    let length = |array: &Array| array.elements.iter().map(|element| element.length() as u64).sum::<u64>() * n;
    let mut offset = 0;
    let mut declare = |to: &mut dyn Write, attributes: String, length: u64| {
        writeln!(to, r#"<DataArray {attributes} format="appended" offset="{offset}"/>"#)?;
        offset += 8 + length;
        io::Result::Ok(())
    };
    let time_s = frame.cloud.time_s();
    writeln!(
        to,
        r#"<?xml version="1.0"?>
<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">
<PolyData>
<FieldData>
<DataArray type="Float64" Name="TimeValue" NumberOfTuples="1" format="ascii">{time_s}</DataArray>
</FieldData>
<Piece NumberOfPoints="{n}" NumberOfVerts="{n}" NumberOfLines="0" NumberOfStrips="0" NumberOfPolys="0">
<PointData>"#
    )?;
    for array in &arrays {
        declare(to, attributes(array), length(array))?;
    }
    writeln!(to, "</PointData>\n<Points>")?;
    declare(to, r#"type="Float64" Name="Points" NumberOfComponents="3""#.into(), 24 * n)?;
    writeln!(to, "</Points>\n<Verts>")?;
    for name in ["connectivity", "offsets"] {
        declare(to, format!(r#"type="Int64" Name="{name}""#), 8 * n)?;
    }
    write!(to, "</Verts>\n</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_")?;
    for array in &arrays {
        to.write_all(&length(array).to_le_bytes())?;
        write_elements(frame, &array.elements, to)?;
    }
    to.write_all(&(24 * n).to_le_bytes())?;
    frame.positions().flatten().try_for_each(|x| to.write_all(&x.to_le_bytes()))?;
    // A cell a point: the first is point 0 and ends before entry 1.
    for first in [0, 1] {
        to.write_all(&(8 * n).to_le_bytes())?;
        (first..first + n).try_for_each(|k| to.write_all(&k.to_le_bytes()))?;
    }
    writeln!(to, "\n</AppendedData>\n</VTKFile>")
}

/// What VTK is told of an array.
fn attributes(array: &Array) -> String {
    let Array { name, shape, elements } = array;
    let mut text = format!(r#"type="{}" Name="{name}""#, kind_name(elements[0].kind, NAMES));
    let components: Vec<String> = match shape {
        Shape::Scalar => vec![],
        Shape::Vector(3) => AXES.map(String::from).into(),
        Shape::Vector(n) => ["r", "g", "b", "a"].iter().take(*n as usize).map(|name| (*name).into()).collect(),
        Shape::Tensor => (0..9).map(|k| format!("{}{}", AXES[k / 3], AXES[k % 3])).collect(),
    };
    if !components.is_empty() {
        text += &format!(r#" NumberOfComponents="{}""#, components.len());
    }
    components.iter().enumerate().for_each(|(k, name)| text += &format!(r#" ComponentName{k}="{name}""#));
    text
}
