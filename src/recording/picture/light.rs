//! The light from above and the shadows it casts.

use rayon::prelude::*;

use super::obstacles::{Obstacle, nearest};
use super::splat::{Ball, splat};
use super::view::View;
use crate::appearance::V3;

/// Samples for soft shadows and for occlusion.
pub const SAMPLES: usize = 16;
/// Radius of the penumbra, as a share of the focus' diagonal.
const SOFTNESS: f32 = 0.013;

/// A directional light with its shadow map.
pub struct Light {
    /// Unit vector to the light.
    pub toward: V3,
    view: View,
    depth: Vec<f32>,
    /// Depth within which a surface does not shade itself (m).
    bias: f32,
    softness: f32,
}

impl Light {
    /// A light above the camera's left shoulder.
    pub fn new(camera: &View, balls: &[Ball], obstacles: &[Obstacle]) -> Self {
        let size = camera.shadows;
        // Of a camera that looks straight down, what is up in the picture.
        let level = |v: V3| V3::new(v.x, v.y, 0.0).try_normalize(1e-3);
        let away = level(camera.forward).or_else(|| level(camera.up)).unwrap_or_else(V3::x);
        let toward = (V3::z() * 1.25 - camera.right * 0.55 - away * 0.35).normalize();
        let right = V3::z().cross(&toward).normalize();
        let view = View::parallel(right, toward.cross(&right), camera.focus, [size; 2]);
        let mut depth = splat(&view, balls).depth;
        if obstacles.iter().any(|obstacle| !obstacle.translucent) {
            depth.par_iter_mut().enumerate().for_each(|(at, depth)| {
                let [start, direction] = view.ray((at % size) as f32, (at / size) as f32);
                let opaque = obstacles.iter().filter(|obstacle| !obstacle.translucent);
                if let Some(hit) = nearest(opaque, start, direction, *depth) {
                    *depth = hit.depth;
                }
            });
        }
        let diagonal = (camera.focus[1] - camera.focus[0]).norm();
        let softness = SOFTNESS * diagonal;
        let radius = balls.iter().map(|ball| ball.radius).fold(0.0, f32::max);
        // On slopes the depth varies within the penumbra and within the map's pixels.
        let bias = (2.5 * radius).max(0.5 * softness).max(2.0 / view.pixels_per_metre(1.0));
        Self { toward, view, depth, bias, softness }
    }

    /// Share of the light that reaches a point, sampled at `points` of the unit disc.
    pub fn reaches(&self, x: &V3, points: &[[f32; 2]; SAMPLES]) -> f32 {
        let [column, row, depth] = self.view.project(x);
        let size = self.view.size[0];
        let reach = self.softness * self.view.pixels_per_metre(depth);
        let lit = points.iter().filter(|[dx, dy]| {
            let (x, y) = (column + dx * reach, row + dy * reach);
            // Beyond the map nothing is known to cast a shadow.
            let inside = x >= 0.0 && y >= 0.0 && (x as usize) < size && (y as usize) < size;
            !inside || self.depth[y as usize * size + x as usize] > depth - self.bias
        });
        lit.count() as f32 / SAMPLES as f32
    }
}

/// Points of a sunflower spiral in the unit disc (Vogel 1979), in many orientations.
pub struct Spiral {
    points: Vec<[[f32; 2]; SAMPLES]>,
}

/// Number of orientations to choose from.
const TURNS: usize = 64;

impl Spiral {
    pub fn new() -> Self {
        let point = |turn: usize, k: usize| {
            let radius = ((k as f32 + 0.5) / SAMPLES as f32).sqrt();
            let angle = 2.399_963_2 * k as f32 + std::f32::consts::TAU * turn as f32 / TURNS as f32;
            [radius * angle.cos(), radius * angle.sin()]
        };
        Self { points: (0..TURNS).map(|turn| std::array::from_fn(|k| point(turn, k))).collect() }
    }

    /// The points, rotated by a share of a full turn.
    pub fn turned(&self, turn: f32) -> &[[f32; 2]; SAMPLES] {
        &self.points[(turn * TURNS as f32) as usize % TURNS]
    }
}
