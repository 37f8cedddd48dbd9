//! The outline of the domain.

use super::Canvas;
use super::view::View;
use crate::appearance::V3;
use crate::appearance::corners;
use crate::palette::Rgb;

const LINE: Rgb = [0.52, 0.55, 0.60];

/// Draws the edges of a box faintly where nothing is nearer than `depth`. Edges in front of the
/// scene are left out.
pub fn draw_box(canvas: &mut Canvas, view: &View, bounds: &[V3; 2], depth: &[f32]) {
    let corners = corners(bounds);
    let depths = corners.map(|corner| view.project(&corner)[2]);
    let nearest = (0..8).min_by(|&a, &b| depths[a].total_cmp(&depths[b])).expect("eight corners");
    for from in 0..8 {
        for to in [1, 2, 4].map(|bit| from | bit).into_iter().filter(|&to| to != from) {
            if view.is_parallel() || (from != nearest && to != nearest) {
                draw_line(canvas, view, corners[from], corners[to], depth);
            }
        }
    }
}

fn draw_line(canvas: &mut Canvas, view: &View, from: V3, to: V3, depth: &[f32]) {
    let [width, height] = view.size;
    let ends = [view.project(&from), view.project(&to)];
    if ends.iter().any(|end| end[2] <= 0.0) {
        return;
    }
    let length = (ends[1][0] - ends[0][0]).hypot(ends[1][1] - ends[0][1]);
    let steep = (ends[1][1] - ends[0][1]).abs() > (ends[1][0] - ends[0][0]).abs();
    // Steps are even in space, so there must be more of them than pixels.
    let steps = (2.0 * length).ceil() as usize;
    for step in 0..=steps {
        let [x, y, z] = view.project(&(from + (to - from) * (step as f32 / steps.max(1) as f32)));
        for k in 0..view.samples {
            let (column, row) = if steep { (x + k as f32, y) } else { (x, y + k as f32) };
            if column < 0.0 || row < 0.0 || column >= width as f32 || row >= height as f32 {
                continue;
            }
            let at = row as usize * width + column as usize;
            // The floor's outline lies in the floor itself.
            if z <= depth[at] * 1.002 {
                canvas.pixels[at] = LINE;
            }
        }
    }
}
