//! The light from above and the shadows it casts.

use rayon::prelude::*;

use super::V3;
use super::obstacles::{Obstacle, nearest};
use super::splat::{Ball, splat};
use super::view::View;

/// Pixels along each side of the shadow map.
const MAP_SIZE: usize = 1024;
/// Samples of the map for a soft shadow.
const SAMPLES: usize = 16;
/// Radius of the penumbra, as a share of the focus' diagonal.
const SOFTNESS: f32 = 0.008;

/// A directional light with what it sees.
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
        let away = V3::new(camera.forward.x, camera.forward.y, 0.0).normalize();
        let toward = (V3::z() * 1.25 - camera.right * 0.55 - away * 0.35).normalize();
        let right = V3::z().cross(&toward).normalize();
        let view = View::parallel(right, toward.cross(&right), camera.focus, [MAP_SIZE; 2]);
        let mut depth = splat(&view, balls).depth;
        if obstacles.iter().any(|obstacle| !obstacle.translucent) {
            depth.par_iter_mut().enumerate().for_each(|(at, depth)| {
                let [start, direction] = view.ray((at % MAP_SIZE) as f32, (at / MAP_SIZE) as f32);
                let opaque = obstacles.iter().filter(|obstacle| !obstacle.translucent);
                if let Some(hit) = nearest(opaque, start, direction, *depth) {
                    *depth = hit.depth;
                }
            });
        }
        let diagonal = (camera.focus[1] - camera.focus[0]).norm();
        let radius = balls.iter().map(|ball| ball.radius).fold(0.0, f32::max);
        Self { toward, view, depth, bias: (2.5 * radius).max(0.004 * diagonal), softness: SOFTNESS * diagonal }
    }

    /// Share of the light that reaches a point; `noise` in [0, 1) turns the samples.
    pub fn reaches(&self, x: &V3, noise: f32) -> f32 {
        let [column, row, depth] = self.view.project(x);
        let reach = self.softness * self.view.pixels_per_metre(depth);
        let lit = (0..SAMPLES).filter(|&k| {
            let [dx, dy] = spiral(k, SAMPLES, noise);
            let (x, y) = ((column + dx * reach).round(), (row + dy * reach).round());
            let inside = x >= 0.0 && y >= 0.0 && x < MAP_SIZE as f32 && y < MAP_SIZE as f32;
            !inside || self.depth[y as usize * MAP_SIZE + x as usize] > depth - self.bias
        });
        lit.count() as f32 / SAMPLES as f32
    }
}

/// The k-th of n points of a sunflower spiral in the unit disc (Vogel 1979), turned by `turn` of a circle.
pub fn spiral(k: usize, n: usize, turn: f32) -> [f32; 2] {
    let radius = ((k as f32 + 0.5) / n as f32).sqrt();
    let angle = 2.399_963_2 * k as f32 + std::f32::consts::TAU * turn;
    [radius * angle.cos(), radius * angle.sin()]
}
