//! Draws balls into depth buffers.

use rayon::prelude::*;

use super::view::View;
use crate::appearance::V3;
use crate::palette::Rgb;

/// A particle to be drawn.
#[derive(Clone, Copy, Debug)]
pub struct Ball {
    pub center: V3,
    /// Radius (m).
    pub radius: f32,
    pub color: Rgb,
    /// Share of the sky that it reflects, 0 to 1.
    pub gloss: f32,
    /// Index of the body.
    pub body: u32,
    /// Whether the colour says a value.
    pub exact: bool,
}

/// What is visible in each pixel, by rows from the top.
pub struct Depths {
    /// Depth along the view (m); infinite where nothing is.
    pub depth: Vec<f32>,
    /// Index of the ball.
    pub ball: Vec<u32>,
}

/// Rows that one task fills.
const BAND: usize = 32;
/// Share of the picture's height that a ball may have as its radius.
const MOST_OF_PICTURE: f32 = 0.2;

/// Draws balls with their bulge towards the camera.
pub fn splat(view: &View, balls: &[Ball]) -> Depths {
    let [width, height] = view.size;
    let projected: Vec<[f32; 4]> = balls
        .par_iter()
        .map(|ball| {
            let [column, row, depth] = view.project(&ball.center);
            [column, row, depth, ball.radius * view.pixels_per_metre(depth)]
        })
        .collect();
    let mut depths = Depths { depth: vec![f32::INFINITY; width * height], ball: vec![u32::MAX; width * height] };
    let bands = depths.depth.par_chunks_mut(BAND * width).zip(depths.ball.par_chunks_mut(BAND * width)).enumerate();
    bands.for_each(|(band, (depth, ball))| {
        let (top, rows) = (band * BAND, depth.len() / width);
        for (k, &[x, y, z, r]) in projected.iter().enumerate() {
            // What is right before the camera would hide all else.
            let near = z <= 0.0 || r > MOST_OF_PICTURE * height as f32;
            if near || y + r < top as f32 || y - r > (top + rows) as f32 {
                continue;
            }
            // At least the pixel under the centre.
            let r = r.max(0.71);
            let clip = |low: f32, high: f32, size: usize| (low.max(0.0) as usize, (high.max(0.0) as usize).min(size));
            let (first_row, last_row) = clip((y - r - top as f32).ceil(), (y + r - top as f32).ceil(), rows);
            let (first, last) = clip((x - r).ceil(), (x + r).ceil(), width);
            for row in first_row..last_row {
                let dy = (row + top) as f32 - y;
                for column in first..last {
                    let dx = column as f32 - x;
                    let bulge = 1.0 - (dx * dx + dy * dy) / (r * r);
                    let at = row * width + column;
                    let front = z - balls[k].radius * bulge.max(0.0).sqrt();
                    if bulge > 0.0 && front < depth[at] {
                        (depth[at], ball[at]) = (front, k as u32);
                    }
                }
            }
        }
    });
    depths
}

impl Depths {
    /// Smooths away the bumps of single balls but keeps the outlines: the narrow-range filter of
    /// Truong & Yuksel (2018, "A narrow-range filter for screen-space fluid rendering"), along rows
    /// and along columns, twice. A neighbour far behind a pixel does not count, nor does its mirror
    /// image. A neighbour far in front counts as a little in front.
    pub fn smooth(&mut self, view: &View, balls: &[Ball]) {
        let [width, height] = view.size;
        for pass in 0..4 {
            let source = std::mem::take(&mut self.depth);
            let ball = &self.ball;
            let along_rows = pass % 2 == 0;
            let filtered = |at: usize| {
                let center = source[at];
                if center.is_infinite() {
                    return center;
                }
                let radius = balls[ball[at] as usize].radius;
                let reach = (3.2 * radius * view.pixels_per_metre(center)).clamp(3.0, 64.0);
                let (position, size, stride) =
                    if along_rows { (at % width, width, 1) } else { (at / width, height, width) };
                let taps = (reach as usize).min(position).min(size - 1 - position);
                let (mut sum, mut weights) = (center, 1.0);
                for k in 1..=taps {
                    let (a, b) = (source[at - k * stride], source[at + k * stride]);
                    if a.max(b) - center < 5.0 * radius {
                        let near = 1.0 - (k * k) as f32 / (reach * reach);
                        let weight = near * near;
                        sum += weight * (a.max(center - radius) + b.max(center - radius));
                        weights += 2.0 * weight;
                    }
                }
                sum / weights
            };
            self.depth = (0..width * height).into_par_iter().map(filtered).collect();
        }
    }
}
