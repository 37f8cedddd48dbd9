//! The points of a recorded frame, taken apart by the fields and the pose that the message declares.

use foxglove::messages::packed_element_field::NumericType;
use foxglove::messages::{PackedElementField, PointCloud, Pose};

/// Names of positions and colours; all others are fields of particles.
const POSITION: [&str; 3] = ["x", "y", "z"];
const COLOR: [&str; 4] = ["red", "green", "blue", "alpha"];
const VELOCITY: [&str; 3] = ["vx", "vy", "vz"];
/// Made of the velocity, which is recorded by its components.
const SPEED: &str = "speed";

/// A recorded frame's points.
#[derive(Debug)]
pub struct Cloud {
    message: PointCloud,
    time_s: f64,
    stride: usize,
    position: [Element; 3],
}

/// Points of a frame, as they are drawn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FramePoints {
    /// Simulated time (s).
    pub time_s: f64,
    /// Points of the recorded frame, of which the others here are some.
    pub recorded: usize,
    /// What positions are relative to (m).
    pub origin: [f64; 3],
    /// Positions relative to `origin` (m).
    pub positions: Vec<[f32; 3]>,
    /// Values of the field that was asked for; empty without one.
    pub values: Vec<f32>,
    /// Smallest and largest finite value of all recorded points; `None` without any.
    pub range: Option<[f32; 2]>,
    /// Colours as they were recorded (sRGB and alpha); empty if a field was asked for, or there are none.
    pub colors: Vec<[u8; 4]>,
}

/// Unit of a recorded field: `m/s`, `Pa`, or `1` for ratios; empty if it is not known.
pub fn unit(field: &str) -> &'static str {
    match field {
        SPEED | "vx" | "vy" | "vz" => "m/s",
        "von_mises" | "pressure" => "Pa",
        "J" | "plastic_strain" => "1",
        field if field.starts_with("stress_") => "Pa",
        field if field.starts_with("strain_") => "1",
        _ => "",
    }
}

/// Where a number of a point is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Element {
    offset: usize,
    pub kind: NumericType,
}

/// Length of a number (bytes).
fn size(kind: NumericType) -> usize {
    match kind {
        NumericType::Unknown => 0,
        NumericType::Uint8 | NumericType::Int8 => 1,
        NumericType::Uint16 | NumericType::Int16 => 2,
        NumericType::Uint32 | NumericType::Int32 | NumericType::Float32 => 4,
        NumericType::Float64 => 8,
    }
}

impl Element {
    /// Of a field that fits into a point.
    fn of(field: &PackedElementField, stride: usize) -> Option<Self> {
        let kind = NumericType::try_from(field.r#type).ok().filter(|kind| *kind != NumericType::Unknown)?;
        let offset = field.offset as usize;
        (offset + size(kind) <= stride).then_some(Self { offset, kind })
    }

    /// Length (bytes).
    pub fn length(self) -> usize {
        size(self.kind)
    }

    /// The number as it is stored, little-endian.
    pub fn bytes(self, point: &[u8]) -> &[u8] {
        &point[self.offset..][..size(self.kind)]
    }

    pub fn read(self, point: &[u8]) -> f64 {
        fn bytes<const N: usize>(point: &[u8], at: usize) -> [u8; N] {
            point[at..at + N].try_into().expect("the field fits into a point")
        }
        let at = self.offset;
        match self.kind {
            NumericType::Uint8 => f64::from(point[at]),
            NumericType::Int8 => f64::from(point[at] as i8),
            NumericType::Uint16 => f64::from(u16::from_le_bytes(bytes(point, at))),
            NumericType::Int16 => f64::from(i16::from_le_bytes(bytes(point, at))),
            NumericType::Uint32 => f64::from(u32::from_le_bytes(bytes(point, at))),
            NumericType::Int32 => f64::from(i32::from_le_bytes(bytes(point, at))),
            NumericType::Float32 => f64::from(f32::from_le_bytes(bytes(point, at))),
            NumericType::Float64 => f64::from_le_bytes(bytes(point, at)),
            NumericType::Unknown => f64::NAN,
        }
    }
}

impl Cloud {
    /// `None` if the message does not say where its points are.
    pub(crate) fn new(message: PointCloud, time_s: f64) -> Option<Self> {
        let stride = message.point_stride as usize;
        let element = |name: &str| {
            message.fields.iter().find(|field| field.name == name).and_then(|field| Element::of(field, stride))
        };
        let position = [element(POSITION[0])?, element(POSITION[1])?, element(POSITION[2])?];
        Some(Self { stride, position, message, time_s })
    }

    /// Simulated time (s).
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.message.data.len() / self.stride
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Names of the fields that points can be coloured by.
    pub fn fields(&self) -> Vec<&str> {
        let declared = self.message.fields.iter().map(|field| field.name.as_str());
        let named = declared.filter(|name| ![&POSITION[..], &COLOR[..]].concat().contains(name));
        self.velocity().map(|_| SPEED).into_iter().chain(named).collect()
    }

    /// At most `most` points, the same share of all parts of the frame; of the field of this name, or else in the
    /// colours that were recorded. There are no values of a field that is not there.
    pub fn take(&self, field: Option<&str>, most: usize) -> FramePoints {
        let (turned, origin) = self.placement();
        let (all, n) = (self.len(), self.len().min(most));
        let chosen = || (0..n).map(|k| self.point((k as u128 * all as u128 / n.max(1) as u128) as usize));
        let position = |point: &[u8]| {
            let x = self.position.map(|element| element.read(point));
            turned.map(|row| dot(row, x) as f32)
        };
        let mut taken = FramePoints { time_s: self.time_s, recorded: all, origin, ..FramePoints::default() };
        taken.positions = chosen().map(position).collect();
        if let Some(value) = field.and_then(|name| self.value(name)) {
            taken.values = chosen().map(|point| value.read(point)).collect();
            let all = (0..all).map(|k| value.read(self.point(k))).filter(|value| value.is_finite());
            taken.range = all.fold(None, |range: Option<[f32; 2]>, value| {
                let [low, high] = range.unwrap_or([value; 2]);
                Some([low.min(value), high.max(value)])
            });
        } else if field.is_none()
            && let Some(colors) = self.elements(&COLOR)
        {
            let color = |point: &[u8]| std::array::from_fn(|k| colors[k].read(point) as u8);
            taken.colors = chosen().map(color).collect();
        }
        taken
    }

    /// Values of a field, of all points; `None` if they do not have it.
    pub(crate) fn values(&self, field: &str) -> Option<Vec<f32>> {
        let value = self.value(field)?;
        Some((0..self.len()).map(|k| value.read(self.point(k))).collect())
    }

    /// Colours of all points as they were recorded (sRGB); `None` if they have none.
    pub(crate) fn colors(&self) -> Option<Vec<[u8; 3]>> {
        let elements = self.elements(&COLOR[..3])?;
        let color = |k: usize| std::array::from_fn(|c| elements[c].read(self.point(k)) as u8);
        Some((0..self.len()).map(color).collect())
    }

    /// The pose: a rotation, by rows, and what positions are relative to (m).
    fn placement(&self) -> ([[f64; 3]; 3], [f64; 3]) {
        let pose = self.message.pose.unwrap_or_default();
        (rotation(&pose), pose.position.map_or([0.0; 3], |at| [at.x, at.y, at.z]))
    }

    /// How to read positions of points in the scene (m).
    pub(crate) fn positions(&self) -> impl Fn(&[u8]) -> [f64; 3] {
        let ((turned, origin), elements) = (self.placement(), self.position);
        move |point| {
            let x = elements.map(|element| element.read(point));
            std::array::from_fn(|a| origin[a] + dot(turned[a], x))
        }
    }

    /// How to read velocities of points (m/s), turned as their positions are; `None` if there are none.
    pub(crate) fn velocities(&self) -> Option<impl Fn(&[u8]) -> [f32; 3]> {
        let ((turned, _), elements) = (self.placement(), self.velocity()?);
        Some(move |point: &[u8]| {
            let v = std::array::from_fn(|a| elements[a].read(point));
            turned.map(|row| dot(row, v) as f32)
        })
    }

    /// Names of the recorded scalars but for positions, colours included, and how to read each.
    pub(crate) fn scalars(&self) -> Vec<(&str, Element)> {
        let others = self.message.fields.iter().filter(|field| !POSITION.contains(&field.name.as_str()));
        others.filter_map(|field| Some((field.name.as_str(), Element::of(field, self.stride)?))).collect()
    }

    pub(crate) fn point(&self, k: usize) -> &[u8] {
        &self.message.data[k * self.stride..][..self.stride]
    }

    pub(crate) fn element(&self, name: &str) -> Option<Element> {
        self.message.fields.iter().find(|field| field.name == name).and_then(|field| Element::of(field, self.stride))
    }

    fn elements(&self, names: &[&str]) -> Option<Vec<Element>> {
        names.iter().map(|name| self.element(name)).collect()
    }

    fn velocity(&self) -> Option<Vec<Element>> {
        self.elements(&VELOCITY)
    }

    /// How to read a field of a point.
    fn value(&self, name: &str) -> Option<Value> {
        if !self.fields().contains(&name) {
            return None;
        }
        self.element(name).map(Value::Recorded).or_else(|| self.velocity().map(Value::Length))
    }
}

/// A field that points can be coloured by.
enum Value {
    Recorded(Element),
    /// Of a vector, by its components.
    Length(Vec<Element>),
}

impl Value {
    fn read(&self, point: &[u8]) -> f32 {
        let value = match self {
            Self::Recorded(element) => element.read(point),
            Self::Length(vector) => vector.iter().map(|component| component.read(point).powi(2)).sum::<f64>().sqrt(),
        };
        value as f32
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| a[k] * b[k]).sum()
}

/// The rotation of a pose, by rows.
fn rotation(pose: &Pose) -> [[f64; 3]; 3] {
    let (x, y, z, w) = pose.orientation.as_ref().map_or((0.0, 0.0, 0.0, 1.0), |q| (q.x, q.y, q.z, q.w));
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
        [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

#[cfg(test)]
mod tests {
    use foxglove::messages::{Quaternion, Vector3};

    use super::*;

    /// Points in another layout than this crate writes: doubles, other order, a gap, a pose.
    fn cloud(points: &[[f64; 6]]) -> Cloud {
        let kinds = [("J", NumericType::Float32, 0), ("y", NumericType::Float64, 4), ("x", NumericType::Float64, 12)];
        let more = [("z", NumericType::Float64, 24), ("vx", NumericType::Float32, 32), ("vy", NumericType::Int16, 36)];
        let last = [("vz", NumericType::Int8, 38)];
        let fields = kinds.into_iter().chain(more).chain(last).map(|(name, kind, offset)| PackedElementField {
            name: name.into(),
            offset,
            r#type: kind.into(),
        });
        let mut data = Vec::new();
        for [x, y, z, j, vx, vy] in points {
            data.extend((*j as f32).to_le_bytes());
            data.extend(y.to_le_bytes());
            data.extend(x.to_le_bytes());
            data.extend([0; 4]);
            data.extend(z.to_le_bytes());
            data.extend((*vx as f32).to_le_bytes());
            data.extend((*vy as i16).to_le_bytes());
            data.push(0);
        }
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let pose = Pose {
            position: Some(Vector3 { x: 100.0, y: 200.0, z: 300.0 }),
            orientation: Some(Quaternion { x: 0.0, y: 0.0, z: half, w: half }),
        };
        let message = PointCloud {
            pose: Some(pose),
            point_stride: 39,
            fields: fields.collect(),
            data: data.into(),
            ..PointCloud::default()
        };
        Cloud::new(message, 0.5).unwrap()
    }

    #[test]
    fn points_are_read_as_the_message_declares_them() {
        let cloud = cloud(&[[1.0, 2.0, 3.0, 0.5, 3.0, -4.0], [4.0, 5.0, 6.0, f64::NAN, 0.0, 0.0]]);
        assert_eq!(cloud.fields(), ["speed", "J", "vx", "vy", "vz"]);
        let taken = cloud.take(Some("speed"), 10);
        assert_eq!((taken.recorded, taken.origin), (2, [100.0, 200.0, 300.0]));
        // A quarter turn about z.
        for (position, expected) in taken.positions.iter().zip([[-2.0, 1.0, 3.0], [-5.0, 4.0, 6.0]]) {
            (0..3).for_each(|a| assert!((position[a] - expected[a] as f32).abs() < 1e-6, "{position:?}"));
        }
        assert_eq!((taken.values, taken.range), (vec![5.0, 0.0], Some([0.0, 5.0])));
        assert_eq!(cloud.take(Some("J"), 10).range, Some([0.5, 0.5]));
        let plain = cloud.take(None, 1);
        assert_eq!((plain.positions.len(), plain.recorded, plain.colors.len()), (1, 2, 0));
        assert!(cloud.take(Some("x"), 10).values.is_empty() && cloud.take(Some("q"), 10).values.is_empty());
    }

    #[test]
    fn what_has_no_positions_or_fields_beyond_a_point_is_refused() {
        let field =
            |name: &str, offset| PackedElementField { name: name.into(), offset, r#type: NumericType::Float32.into() };
        let with = |fields: Vec<PackedElementField>| PointCloud { point_stride: 12, fields, ..PointCloud::default() };
        assert!(Cloud::new(with(vec![field("x", 0), field("y", 4)]), 0.0).is_none());
        assert!(Cloud::new(with(vec![field("x", 0), field("y", 4), field("z", 9)]), 0.0).is_none());
        let sound = Cloud::new(with(vec![field("x", 0), field("y", 4), field("z", 8)]), 0.0).unwrap();
        assert!(sound.is_empty() && sound.fields().is_empty());
    }
}
