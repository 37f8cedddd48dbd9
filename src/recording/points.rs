//! `/particles`: a frame's particles as a `foxglove.PointCloud`.
//!
//! Coordinates are f32 and relative to the domain's lower corner, which the cloud's pose has in f64:
//! at UTM coordinates absolute ones would be rounded to half a metre.

use foxglove::messages::packed_element_field::NumericType;
use foxglove::messages::{PackedElementField, PointCloud, Pose, Quaternion, Timestamp, Vector3};
use rayon::prelude::*;

use super::appearance::Appearance;
use super::palette::{Palette, to_srgb};
use gridfall_core::material;
use gridfall_core::maths::linalg::determinant;
use gridfall_core::sim::excerpt::Excerpt;
use gridfall_core::sim::setup::{Material, OutputField, Setup};

/// Which particles of an excerpt are recorded, and the layout of a point; the same for all frames.
pub struct Points {
    /// Indices into excerpts, ascending.
    selected: Vec<u32>,
    /// Their numbers in sampling order.
    ids: Vec<u32>,
    palette: Palette,
    layout: Vec<PackedElementField>,
    stride: usize,
    /// The domain's lower corner (m).
    corner: [f64; 3],
}

impl Points {
    /// `selected` says which particles of an excerpt are recorded, and `ids` which particles these are.
    pub fn new(setup: &Setup, appearance: &Appearance, selected: Vec<u32>, ids: Vec<u32>) -> Self {
        let mut layout = Vec::new();
        let mut stride = 0;
        let mut add = |name: &str, kind: NumericType, size: u32| {
            layout.push(PackedElementField { name: name.into(), offset: stride, r#type: kind.into() });
            stride += size;
        };
        ["x", "y", "z"].iter().for_each(|name| add(name, NumericType::Float32, 4));
        for field in &setup.fields {
            names(*field).iter().for_each(|name| add(name, kind(*field), 4));
        }
        // Viewers recognise these four names as the points' colours without being told.
        ["red", "green", "blue", "alpha"].iter().for_each(|name| add(name, NumericType::Uint8, 1));
        let palette = Palette::new(setup, appearance);
        Self { selected, ids, palette, stride: stride as usize, layout, corner: setup.origin }
    }

    /// The frame's point cloud.
    pub fn message(&self, setup: &Setup, particles: &Excerpt, timestamp: Timestamp) -> PointCloud {
        let present = particles.present(&self.selected);
        let [x, y, z] = self.corner;
        let mut data = vec![0u8; self.stride * present];
        data.par_chunks_mut(self.stride).zip(self.selected.par_iter().zip(&self.ids)).for_each(|(bytes, (&p, &id))| {
            self.write_point(setup, particles, p as usize, id, bytes);
        });
        PointCloud {
            timestamp: Some(timestamp),
            frame_id: super::colliders::WORLD.into(),
            pose: Some(Pose {
                position: Some(Vector3 { x, y, z }),
                orientation: Some(Quaternion { w: 1.0, ..Default::default() }),
            }),
            point_stride: self.stride as u32,
            fields: self.layout.clone(),
            data: data.into(),
        }
    }

    fn write_point(&self, setup: &Setup, particles: &Excerpt, p: usize, id: u32, bytes: &mut [u8]) {
        let (scalars, rgba) = bytes.split_at_mut(self.stride - 4);
        let (x, v) = (particles.x[p], particles.v[p]);
        let real = |value: f64| (value as f32).to_le_bytes();
        // Several fields may need it.
        let stressed = setup.fields.iter().any(|field| of_stress(*field));
        let stress = if stressed { cauchy(setup, particles, p) } else { [0.0; 9] };
        let fields = setup.fields.iter().flat_map(|field| match field {
            OutputField::Velocity => v.map(real).to_vec(),
            OutputField::J => vec![real(determinant(&particles.f[p]))],
            OutputField::VonMises => vec![real(von_mises(&stress))],
            OutputField::Pressure => vec![real(pressure(&stress))],
            OutputField::Stress => components(&stress).map(real).to_vec(),
            OutputField::Strain => components(&material::hencky_strain(&particles.f[p])).map(real).to_vec(),
            OutputField::PlasticStrain => {
                vec![real(material::plastic_strain(material_of(setup, particles, p), particles.plastic[p]))]
            }
            OutputField::Body => vec![particles.body[p].to_le_bytes()],
            OutputField::Id => vec![id.to_le_bytes()],
        });
        let position = (0..3).map(|a| real(x[a] - self.corner[a]));
        for (slot, word) in scalars.chunks_exact_mut(4).zip(position.chain(fields)) {
            slot.copy_from_slice(&word);
        }
        let speed = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
        let [r, g, b] = self.palette.color(particles.body[p], speed).map(to_srgb);
        rgba.copy_from_slice(&[r, g, b, 255]);
    }
}

/// Scalar names of a recorded field.
fn names(field: OutputField) -> &'static [&'static str] {
    match field {
        OutputField::Velocity => &["vx", "vy", "vz"],
        OutputField::J => &["J"],
        OutputField::VonMises => &["von_mises"],
        OutputField::Pressure => &["pressure"],
        OutputField::Stress => &["stress_xx", "stress_yy", "stress_zz", "stress_xy", "stress_yz", "stress_xz"],
        OutputField::Strain => &["strain_xx", "strain_yy", "strain_zz", "strain_xy", "strain_yz", "strain_xz"],
        OutputField::PlasticStrain => &["plastic_strain"],
        OutputField::Body => &["body"],
        OutputField::Id => &["id"],
    }
}

/// What the scalars of a field are. All have four bytes.
fn kind(field: OutputField) -> NumericType {
    match field {
        OutputField::Body | OutputField::Id => NumericType::Uint32,
        _ => NumericType::Float32,
    }
}

fn of_stress(field: OutputField) -> bool {
    matches!(field, OutputField::VonMises | OutputField::Pressure | OutputField::Stress)
}

/// xx, yy, zz, xy, yz, xz of a symmetric tensor, the order of VTK.
fn components(t: &[f64; 9]) -> [f64; 6] {
    [t[0], t[4], t[8], t[1], t[5], t[2]]
}

fn material_of<'a>(setup: &'a Setup, particles: &Excerpt, p: usize) -> &'a Material {
    &setup.materials[setup.bodies[particles.body[p] as usize].material]
}

fn cauchy(setup: &Setup, particles: &Excerpt, p: usize) -> [f64; 9] {
    material::cauchy(material_of(setup, particles, p), setup.dimension, &particles.f[p], particles.plastic[p])
}

fn pressure(s: &[f64; 9]) -> f64 {
    -(s[0] + s[4] + s[8]) / 3.0
}

/// sqrt(3/2 dev σ : dev σ).
fn von_mises(s: &[f64; 9]) -> f64 {
    let p = pressure(s);
    let deviator: f64 = (0..9).map(|k| (s[k] + if k % 4 == 0 { p } else { 0.0 }).powi(2)).sum();
    (1.5 * deviator).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stress_measures_of_simple_states() {
        let uniaxial = [5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert!((von_mises(&uniaxial) - 5.0).abs() < 1e-14);
        assert!((pressure(&uniaxial) + 5.0 / 3.0).abs() < 1e-14);
        let shear = [0.0, 2.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert!((von_mises(&shear) - 2.0 * 3.0f64.sqrt()).abs() < 1e-14);
    }
}
