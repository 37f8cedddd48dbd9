//! Shapes.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::vector::{Matrix, Vector};

/// A closed shape; in 2D its cross-section.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Shape {
    /// A box along the axes.
    Box {
        /// Lower corner (m).
        min: Vector,
        /// Upper corner (m).
        max: Vector,
    },
    /// A ball; in 2D a disc.
    Sphere {
        /// Its centre (m).
        center: Vector,
        /// Its radius (m).
        radius: f64,
    },
    /// A capped cylinder; `height` along `axis`, centred (3D only).
    Cylinder {
        /// Middle of its axis (m).
        center: Vector,
        /// Direction of its axis, of any length.
        #[serde(default = "default_axis")]
        axis: Vector,
        /// Its radius (m).
        radius: f64,
        /// Its length along the axis (m).
        height: f64,
    },
    /// A cylinder with half-spheres on its ends; `height` is the length of the axis between their centres (3D only).
    Capsule {
        /// Middle of its axis (m).
        center: Vector,
        /// Direction of its axis, of any length.
        #[serde(default = "default_axis")]
        axis: Vector,
        /// Radius of the cylinder and of its ends (m).
        radius: f64,
        /// Length of the cylinder without its ends (m).
        height: f64,
    },
    #[doc = "A cone from the disc of `radius` about `base`, `height` along `axis`, to a point or to the disc of \
             `top_radius` (3D only)."]
    Cone {
        /// Middle of the disc that it begins with (m).
        base: Vector,
        /// Direction of its axis from there, of any length.
        #[serde(default = "default_axis")]
        axis: Vector,
        /// Radius at the base (m).
        radius: f64,
        /// Radius at the other end (m); 0 for a point.
        #[serde(default)]
        top_radius: f64,
        /// From the base to the other end (m).
        height: f64,
    },
    /// A ring about `axis` (3D only).
    Torus {
        /// Its centre (m).
        center: Vector,
        /// Direction of the axis that it is round about, of any length.
        #[serde(default = "default_axis")]
        axis: Vector,
        /// From the centre to the middle of the ring's tube (m).
        major_radius: f64,
        /// Radius of the tube (m).
        minor_radius: f64,
    },
    /// All points behind the plane: (x - point) · normal <= 0.
    HalfSpace {
        /// A point of the plane (m).
        point: Vector,
        /// Direction out of the solid, of any length.
        normal: Vector,
    },
    #[doc = "The solid between a plane and a surface above it. 3D: over the rectangle from `min` to `max` (x, y), \
             from z = `base` up to"]
    #[doc = "`heights[j][i]`, i along x and j along y, evenly spaced. 2D: over the interval from `min` to `max` (x), \
             from y = `base` up to"]
    /// `heights[0][i]`.
    Heightfield {
        /// Lower corner of the rectangle (m); in 2D where the interval begins.
        min: Vector,
        /// Upper corner of the rectangle (m); in 2D where the interval ends.
        max: Vector,
        /// Height of the plane below (m).
        base: f64,
        /// Heights of the surface (m), a list for each row along x.
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
        /// What is inside of it.
        #[serde(default)]
        fill: Fill,
    },
    /// All that is in one of the shapes or in several.
    Union(Vec<Shape>),
    /// What is in all of the shapes.
    Intersection(Vec<Shape>),
    /// The first shape without all others.
    Difference(Vec<Shape>),
    /// Moved by `offset`.
    Translate {
        /// How far along each axis (m).
        offset: Vector,
        /// What is moved.
        shape: Box<Shape>,
    },
    /// Turned by `angle_degrees` about `axis` (3D; default z) through `center` (default: origin).
    Rotate {
        /// Direction that it turns about, of any length (3D only).
        #[serde(default = "default_axis")]
        axis: Vector,
        /// By how much (degrees), counter-clockwise where the axis points at the viewer.
        angle_degrees: f64,
        /// A point that stays where it is (m); the origin by default.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        center: Option<Vector>,
        /// What is turned.
        shape: Box<Shape>,
    },
    /// Made larger by `factor` about `center` (default: origin).
    Scale {
        /// New lengths by old ones.
        factor: f64,
        /// A point that stays where it is (m); the origin by default.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        center: Option<Vector>,
        /// What is scaled.
        shape: Box<Shape>,
    },
    /// The layer of the given thickness inside the shape's surface.
    Shell {
        /// From the surface inwards (m).
        thickness: f64,
        /// What it is the shell of.
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
