//! Shapes.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::vector::{Matrix, Vector};

/// A closed shape; in 2D its cross-section.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Shape {
    Box {
        min: Vector,
        max: Vector,
    },
    Sphere {
        center: Vector,
        radius: f64,
    },
    /// A capped cylinder; `height` along `axis`, centred (3D only).
    Cylinder {
        center: Vector,
        #[serde(default = "default_axis")]
        axis: Vector,
        radius: f64,
        height: f64,
    },
    /// A cylinder with half-spheres on its ends; `height` is the length of the axis between their centres (3D only).
    Capsule {
        center: Vector,
        #[serde(default = "default_axis")]
        axis: Vector,
        radius: f64,
        height: f64,
    },
    #[doc = "A cone from the disc of `radius` about `base`, `height` along `axis`, to a point or to the disc of \
             `top_radius` (3D only)."]
    Cone {
        base: Vector,
        #[serde(default = "default_axis")]
        axis: Vector,
        radius: f64,
        #[serde(default)]
        top_radius: f64,
        height: f64,
    },
    /// A ring about `axis` (3D only).
    Torus {
        center: Vector,
        #[serde(default = "default_axis")]
        axis: Vector,
        major_radius: f64,
        minor_radius: f64,
    },
    /// All points behind the plane: (x - point) · normal <= 0.
    HalfSpace {
        point: Vector,
        normal: Vector,
    },
    #[doc = "The solid between a plane and a surface above it. 3D: over the rectangle from `min` to `max` (x, y), \
             from z = `base` up to"]
    #[doc = "`heights[j][i]`, i along x and j along y, evenly spaced. 2D: over the interval from `min` to `max` (x), \
             from y = `base` up to"]
    /// `heights[0][i]`.
    Heightfield {
        min: Vector,
        max: Vector,
        base: f64,
        heights: Matrix,
    },
    /// A closed triangle mesh in metres, or a sheet, from an STL, OBJ, PLY or glTF (3D only). Give one of `asset` and
    /// `file`.
    Mesh {
        /// Id of an asset that was uploaded to the server: `sha256:` and 64 hexadecimal digits.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        asset: Option<String>,
        /// Path of a file, relative to the scene's; on the command line only.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        file: Option<String>,
        #[serde(default)]
        fill: Fill,
    },
    Union(Vec<Shape>),
    Intersection(Vec<Shape>),
    /// The first shape without all others.
    Difference(Vec<Shape>),
    Translate {
        offset: Vector,
        shape: Box<Shape>,
    },
    /// Turned by `angle_degrees` about `axis` (3D; default z) through `center` (default: origin).
    Rotate {
        #[serde(default = "default_axis")]
        axis: Vector,
        angle_degrees: f64,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        center: Option<Vector>,
        shape: Box<Shape>,
    },
    /// Made larger by `factor` about `center` (default: origin).
    Scale {
        factor: f64,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        center: Option<Vector>,
        shape: Box<Shape>,
    },
    /// The layer of the given thickness inside the shape's surface.
    Shell {
        thickness: f64,
        shape: Box<Shape>,
    },
}

/// How a mesh tells inside from outside.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Fill {
    /// It must be closed.
    #[default]
    Watertight,
    /// It may have holes: inside is where the generalized winding number is above a half (Jacobson et al. 2013).
    WindingNumber,
    /// It is a surface without inside: a sheet of no thickness that has two sides; only for colliders.
    Sheet,
}

fn default_axis() -> Vector {
    vec![0.0, 0.0, 1.0]
}

impl Shape {
    /// The name of the shape in a document, where it is the key of the only field.
    pub fn key(&self) -> &'static str {
        match self {
            Self::Box { .. } => "box",
            Self::Sphere { .. } => "sphere",
            Self::Cylinder { .. } => "cylinder",
            Self::Capsule { .. } => "capsule",
            Self::Cone { .. } => "cone",
            Self::Torus { .. } => "torus",
            Self::HalfSpace { .. } => "half-space",
            Self::Heightfield { .. } => "heightfield",
            Self::Mesh { .. } => "mesh",
            Self::Union(_) => "union",
            Self::Intersection(_) => "intersection",
            Self::Difference(_) => "difference",
            Self::Translate { .. } => "translate",
            Self::Rotate { .. } => "rotate",
            Self::Scale { .. } => "scale",
            Self::Shell { .. } => "shell",
        }
    }

    /// Whether the shape has no meaning in 2D.
    pub fn is_solid_only(&self) -> bool {
        matches!(
            self,
            Self::Cylinder { .. } | Self::Capsule { .. } | Self::Cone { .. } | Self::Torus { .. } | Self::Mesh { .. }
        )
    }
}
