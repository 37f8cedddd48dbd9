//! The outline of the domain.

use super::view::{View, corners};
use super::{Canvas, SUPERSAMPLING, V3};

/// Draws the edges of a box faintly, behind what is nearer than `depth` says.
pub fn draw_box(canvas: &mut Canvas, view: &View, bounds: &[V3; 2], depth: &[f32]) {
    let corners = corners(bounds);
    for from in 0..8 {
        for bit in [1, 2, 4].into_iter().filter(|bit| from & bit == 0) {
            draw_line(canvas, view, corners[from], corners[from | bit], depth);
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
    let steps = length.ceil() as usize;
    for step in 0..=steps {
        let t = step as f32 / steps.max(1) as f32;
        let x = ends[0][0] + t * (ends[1][0] - ends[0][0]);
        let y = ends[0][1] + t * (ends[1][1] - ends[0][1]);
        // Depths along a projected line are linear in their inverse; the difference is invisible here.
        let z = view.project(&(from + (to - from) * t))[2];
        for k in 0..SUPERSAMPLING {
            let (column, row) = if steep { (x + k as f32, y) } else { (x, y + k as f32) };
            if column < 0.0 || row < 0.0 || column >= width as f32 || row >= height as f32 {
                continue;
            }
            let at = row as usize * width + column as usize;
            if z <= depth[at] {
                canvas.pixels[at] = canvas.pixels[at].map(|c| c * 0.72);
            }
        }
    }
}
