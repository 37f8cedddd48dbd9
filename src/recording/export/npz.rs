//! npz: `time_s`, `position` (n × 3, f64) and the recorded values, vectors and tensors each as one array.

use std::io::{self, Seek, Write};

use foxglove::messages::packed_element_field::NumericType;
use zip::ZipWriter;

use super::{Array, Frame, Shape};
use crate::arrays::array;

pub fn write(frame: &Frame, to: &mut (impl Write + Seek)) -> io::Result<()> {
    let mut npz = ZipWriter::new(to);
    array(&mut npz, "time_s", &[], [frame.cloud.time_s()].into_iter())?;
    array(&mut npz, "position", &[frame.len() as u64, 3], frame.positions().flatten())?;
    for values in frame.arrays() {
        add(&mut npz, frame, &values)?;
    }
    npz.finish()?;
    Ok(())
}

fn add(npz: &mut ZipWriter<impl Write + Seek>, frame: &Frame, values: &Array) -> io::Result<()> {
    let Array { name, shape, elements } = values;
    let n = frame.len() as u64;
    let shape = match shape {
        Shape::Scalar => vec![n],
        Shape::Vector(components) => vec![n, *components],
        Shape::Tensor => vec![n, 3, 3],
    };
    let numbers = || frame.points().flat_map(|point| elements.iter().map(|element| element.read(point)));
    match elements[0].kind {
        NumericType::Uint8 => array(npz, name, &shape, numbers().map(|x| x as u8)),
        NumericType::Int8 => array(npz, name, &shape, numbers().map(|x| x as i8)),
        NumericType::Uint16 => array(npz, name, &shape, numbers().map(|x| x as u16)),
        NumericType::Int16 => array(npz, name, &shape, numbers().map(|x| x as i16)),
        NumericType::Uint32 => array(npz, name, &shape, numbers().map(|x| x as u32)),
        NumericType::Int32 => array(npz, name, &shape, numbers().map(|x| x as i32)),
        NumericType::Float32 => array(npz, name, &shape, numbers().map(|x| x as f32)),
        NumericType::Float64 | NumericType::Unknown => array(npz, name, &shape, numbers()),
    }
}
