//! Grains in 2D: discs of their size, lit from the upper left.

use super::flat::{Discs, Rows};

/// Radius over half the spacing.
const SIZE: f32 = 1.06;
/// The light, in the picture (x to the right, y down) and towards the eye.
const LIGHT: [f32; 3] = [-0.45, -0.6, 0.66];

/// What is seen between grains, as a share of their colour.
pub fn gaps(body: &Discs) -> f32 {
    if body.exact { 0.8 } else { 0.42 }
}

/// Paints the grains of a body that reach into these rows.
pub fn paint(rows: &mut Rows, body: &Discs, chosen: &[u32], samples: usize) {
    let size = SIZE * body.radius;
    // Grains smaller than a pixel are as large as it is, and cover less.
    let least = 0.5 * samples as f32;
    let (radius, share) = if size < least { (least, (size / least).powi(2)) } else { (size, 1.0) };
    // Colours that say a value are shaded so that grains are told apart, and not more.
    let (shadow, lamp) = if body.exact { (0.88, 0.16) } else { (0.55, 0.6) };
    for disc in chosen.iter().map(|k| &body.discs[*k as usize]) {
        let [columns, lines] = rows.around(disc.center, radius + 0.5);
        for line in lines {
            let dy = (line + rows.first) as f32 - disc.center[1];
            for column in columns.clone() {
                let dx = column as f32 - disc.center[0];
                let covered = (radius + 0.5 - dx.hypot(dy)).clamp(0.0, 1.0);
                if covered == 0.0 {
                    continue;
                }
                let (nx, ny) = (dx / radius, dy / radius);
                let bulge = (1.0 - nx * nx - ny * ny).max(0.0).sqrt();
                let facing = (nx * LIGHT[0] + ny * LIGHT[1] + bulge * LIGHT[2]).max(0.0);
                let light = shadow + lamp * facing;
                rows.cover(line * rows.width + column, disc.color.map(|c| c * light), covered * share);
            }
        }
    }
}
