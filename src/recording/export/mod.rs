//! Frames of recordings as files of other programs: PLY, VTP (ParaView), npz (NumPy) and CSV.
//!
//! Positions are those of the scene, in f64. All else is what was recorded, number for number. A file is written as
//! its points are read, so no more than the recorded frame is in memory.

mod csv;
mod npz;
mod ply;
mod series;
mod vtp;

use std::io::{self, BufWriter, Seek, Write};
use std::path::Path;

use foxglove::messages::packed_element_field::NumericType;

use crate::cloud::{Cloud, Element};
use crate::files::{RecordingError, write_atomically};
use crate::frames::FrameIndex;

pub use series::Series;

/// A form of files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Polygon file format, binary and little-endian.
    Ply,
    /// VTK's polygonal data, XML with raw numbers at its end.
    Vtp,
    /// NumPy's arrays.
    Npz,
    Csv,
}

impl Format {
    pub const ALL: [Self; 4] = [Self::Ply, Self::Vtp, Self::Npz, Self::Csv];

    /// The name, which is also the extension of files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ply => "ply",
            Self::Vtp => "vtp",
            Self::Npz => "npz",
            Self::Csv => "csv",
        }
    }

    /// The form of a file of this name, by its extension.
    pub fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?;
        Self::ALL.into_iter().find(|format| format.name().eq_ignore_ascii_case(extension))
    }
}

/// What is exported of each frame.
#[derive(Clone, Debug)]
pub struct Selection {
    /// Names of bodies and sources, by number.
    names: Vec<String>,
    /// Numbers of those whose points are exported; `None` for all.
    bodies: Option<Vec<usize>>,
    /// Most points, the same share of all parts.
    most: usize,
}

/// Why nothing is exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    #[error("there is no body or source \"{name}\"; there are {}", known.join(", "))]
    NoBody { name: String, known: Vec<String> },
    #[error("the recording does not say of which body its points are; run the scene with \"body\" in output.fields")]
    NoBodies,
    #[error("there is no frame {frame}; {}", range(*frames))]
    NoFrame { frame: u64, frames: u64 },
    #[error(transparent)]
    Recording(#[from] RecordingError),
}

fn range(frames: u64) -> String {
    match frames {
        0 => "the recording has no complete frame".into(),
        1 => "the recording has frame 0 alone".into(),
        frames => format!("the recording has the frames 0 to {}", frames - 1),
    }
}

impl Selection {
    /// Points of the bodies and sources of these names, of all without any, and at most `most` of them. `names` are
    /// those of the recording ([`FrameIndex::bodies`](crate::FrameIndex::bodies)).
    ///
    /// # Errors
    /// When there is none of a name.
    pub fn new(names: Vec<String>, wanted: &[String], most: usize) -> Result<Self, ExportError> {
        if !wanted.is_empty() && names.is_empty() {
            return Err(ExportError::NoBodies);
        }
        let number = |name: &String| {
            let number = names.iter().position(|known| known == name);
            number.ok_or_else(|| ExportError::NoBody { name: name.clone(), known: names.clone() })
        };
        let mut bodies = wanted.iter().map(number).collect::<Result<Vec<_>, _>>()?;
        bodies.sort_unstable();
        bodies.dedup();
        let bodies = Some(bodies).filter(|bodies| !bodies.is_empty());
        Ok(Self { names, bodies, most })
    }

    /// Numbers of the bodies that were asked for.
    pub fn bodies(&self) -> &[usize] {
        self.bodies.as_deref().unwrap_or_default()
    }

    /// Indices of the points of a frame that are exported.
    fn points(&self, cloud: &Cloud) -> Result<Vec<u32>, ExportError> {
        let mut points: Vec<u32> = (0..cloud.len() as u32).collect();
        if let Some(bodies) = &self.bodies {
            let body = cloud.element("body").ok_or(ExportError::NoBodies)?;
            points.retain(|k| bodies.contains(&(body.read(cloud.point(*k as usize)) as usize)));
        }
        let all = points.len();
        if all > self.most {
            let nth = |k: usize| points[(k as u128 * all as u128 / self.most as u128) as usize];
            points = (0..self.most).map(nth).collect();
        }
        Ok(points)
    }
}

/// Writes a frame of the recording `target`, whose frames `index` knows. Returns its time (s) and the number of points
/// that were written.
///
/// # Errors
/// When there is no such frame, the recording cannot be read, or the file not written.
pub fn write_frame(
    (index, target): (&FrameIndex, &Path),
    frame: u64,
    (format, selection): (Format, &Selection),
    to: impl Write + Seek,
    path: &Path,
) -> Result<(f64, usize), ExportError> {
    let cloud = index.points(target, frame)?.ok_or(ExportError::NoFrame { frame, frames: index.len() })?;
    let frame = Frame { points: selection.points(&cloud)?, cloud: &cloud, bodies: &selection.names };
    let mut to = BufWriter::with_capacity(1 << 18, to);
    let written = match format {
        Format::Ply => ply::write(&frame, &mut to),
        Format::Vtp => vtp::write(&frame, &mut to),
        Format::Npz => npz::write(&frame, &mut to),
        Format::Csv => csv::write(&frame, &mut to),
    };
    written.and_then(|()| to.flush()).map_err(RecordingError::io("write", path))?;
    Ok((cloud.time_s(), frame.points.len()))
}

/// The same into a file, which other processes see complete or not at all.
///
/// # Errors
/// As [`write_frame`].
pub fn write_file(
    recording: (&FrameIndex, &Path),
    frame: u64,
    what: (Format, &Selection),
    path: &Path,
) -> Result<(f64, usize), ExportError> {
    write_atomically(path, |file, partial| write_frame(recording, frame, what, file, partial))
}

/// What is written of a frame.
struct Frame<'a> {
    cloud: &'a Cloud,
    /// Indices of points.
    points: Vec<u32>,
    /// Names of bodies and sources.
    bodies: &'a [String],
}

/// Values of points that belong together.
struct Array {
    name: String,
    shape: Shape,
    /// All of one kind; nine of a tensor, by rows.
    elements: Vec<Element>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Shape {
    Scalar,
    /// So many components.
    Vector(u64),
    /// 3 × 3, symmetric.
    Tensor,
}

/// Scalars that are recorded one by one and make one array.
const VECTORS: [(&str, &[&str]); 2] =
    [("velocity", &["vx", "vy", "vz"]), ("color", &["red", "green", "blue", "alpha"])];
/// By rows.
const TENSOR: [&str; 9] = ["xx", "xy", "xz", "xy", "yy", "yz", "xz", "yz", "zz"];

impl Frame<'_> {
    fn len(&self) -> usize {
        self.points.len()
    }

    fn points(&self) -> impl Iterator<Item = &[u8]> {
        self.points.iter().map(|k| self.cloud.point(*k as usize))
    }

    /// Positions in the scene (m).
    fn positions(&self) -> impl Iterator<Item = [f64; 3]> {
        self.points().map(self.cloud.positions())
    }

    /// The recorded scalars, for forms that know nothing else.
    fn scalars(&self) -> Vec<(String, Element)> {
        self.cloud.scalars().into_iter().map(|(name, element)| (plain(name), element)).collect()
    }

    /// The recorded values, components of vectors and tensors together, each where its first component was.
    fn arrays(&self) -> Vec<Array> {
        let (mut arrays, mut done) = (Vec::new(), Vec::new());
        for (name, element) in self.cloud.scalars() {
            if done.iter().any(|known| known == name) {
                continue;
            }
            let single = Array { name: plain(name), shape: Shape::Scalar, elements: vec![element] };
            let (array, members) = self.whole(name, element).unwrap_or_else(|| (single, vec![name.to_owned()]));
            arrays.push(array);
            done.extend(members);
        }
        arrays
    }

    /// What a scalar is a component of, if the others are there and of its kind, with the names of all.
    fn whole(&self, name: &str, element: Element) -> Option<(Array, Vec<String>)> {
        let (name, shape, members) = group(name)?;
        let elements = members.iter().map(|member| self.cloud.element(member)).collect::<Option<Vec<_>>>()?;
        let alike = elements.iter().all(|member| member.kind == element.kind);
        alike.then_some((Array { name, shape, elements }, members))
    }
}

/// Name, shape and members of what a scalar is a component of.
fn group(name: &str) -> Option<(String, Shape, Vec<String>)> {
    if let Some((vector, members)) = VECTORS.iter().find(|(_, members)| members.contains(&name)) {
        let members: Vec<String> = members.iter().map(|member| (*member).into()).collect();
        return Some(((*vector).into(), Shape::Vector(members.len() as u64), members));
    }
    let (tensor, component) = name.rsplit_once('_')?;
    let member = |component: &&str| format!("{tensor}_{component}");
    TENSOR.contains(&component).then(|| (plain(tensor), Shape::Tensor, TENSOR.iter().map(member).collect()))
}

/// A name that every form of files takes. Those of Gridfall's fields are left as they are.
fn plain(name: &str) -> String {
    name.replace(|c: char| !c.is_ascii_alphanumeric() && !matches!(c, '_' | '-' | '.'), "_")
}

/// What a kind of numbers is called, by these names from the shortest to f64.
fn kind_name(kind: NumericType, names: [&'static str; 8]) -> &'static str {
    let [u8, i8, u16, i16, u32, i32, f32, f64] = names;
    match kind {
        NumericType::Uint8 => u8,
        NumericType::Int8 => i8,
        NumericType::Uint16 => u16,
        NumericType::Int16 => i16,
        NumericType::Uint32 => u32,
        NumericType::Int32 => i32,
        NumericType::Float32 => f32,
        NumericType::Float64 => f64,
        NumericType::Unknown => unreachable!("fields of an unknown kind are not read"),
    }
}

/// Writes the bytes of numbers of each point.
fn write_elements(frame: &Frame, elements: &[Element], to: &mut impl Write) -> io::Result<()> {
    frame.points().try_for_each(|point| elements.iter().try_for_each(|element| to.write_all(element.bytes(point))))
}

#[cfg(test)]
mod tests;
