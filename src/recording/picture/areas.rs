//! Bodies in 2D as filled areas: where particles are dense, where most of the neighbourhood is, or one
//! is near.
//!
//! The density is Σ (1 − d²/h²)³ over the particles within h, as a share of that of a whole body. It
//! is one half on a straight edge, whatever h is. With a wide h it is more only inside of a body: so
//! gaps between particles that have moved apart are closed, and edges stay where they are.

use super::Style;
use super::flat::{Discs, Rows};
use crate::palette::Rgb;

/// Half the spacings within which particles are added up.
pub const REACH: f32 = 8.0;
/// The same for the edge.
const NEAR: f32 = 5.0;
/// The density at the edge of what is drawn. Below one half, so that small gaps are closed.
const EDGE: f32 = 0.42;
/// The density in the wide neighbourhood of a gap that is closed.
const GAP: f32 = 0.58;
/// Slope of the density across a straight edge, times h.
const SLOPE: f32 = 1.15;
/// Radius of a particle that is alone, over half the spacing: for its area, or a little less where it is part of a
/// solid, whose edge would show it.
const DROP: [f32; 2] = [1.13, 0.85];
/// Width of the outline (samples), and how much of the colour it keeps.
const RIM: f32 = 4.0;
const RIM_SHADE: f32 = 0.72;

/// What is known of a sample.
#[derive(Clone, Copy, Default)]
struct Sum {
    near: f32,
    wide: f32,
    /// Of the particles in the wide neighbourhood.
    color: Rgb,
    tone: f32,
    /// How much of the sample a single particle covers.
    drop: f32,
}

/// Paints a body, in the colours of its particles or in a shade of them. `chosen` are the particles near these rows.
pub fn paint(rows: &mut Rows, body: &Discs, chosen: &[u32], shade: Option<f32>) {
    if chosen.is_empty() {
        return;
    }
    let (wide, near) = ((REACH * body.radius).max(2.0), (NEAR * body.radius).max(1.5));
    let drop = DROP[usize::from(body.style == Style::Solid)] * body.radius;
    let mut sums = vec![Sum::default(); rows.pixels.len()];
    for disc in chosen.iter().map(|k| &body.discs[*k as usize]) {
        let [columns, lines] = rows.around(disc.center, wide);
        for line in lines {
            let dy = (line + rows.first) as f32 - disc.center[1];
            for column in columns.clone() {
                let dx = column as f32 - disc.center[0];
                let square = dx * dx + dy * dy;
                let share = 1.0 - square / (wide * wide);
                if share <= 0.0 {
                    continue;
                }
                let sum = &mut sums[line * rows.width + column];
                let weight = share * share * share;
                sum.wide += weight;
                // Colours blend over a particle or two.
                let local = weight * weight * weight;
                sum.tone += local;
                (0..3).for_each(|k| sum.color[k] += local * disc.color[k]);
                let share = (1.0 - square / (near * near)).max(0.0);
                sum.near += share * share * share;
                sum.drop = sum.drop.max(drop + 0.5 - square.sqrt());
            }
        }
    }
    // The integral of the weight over the area of a particle.
    let area = (4.0 * body.radius * body.radius).max(0.25);
    let whole = |reach: f32| std::f32::consts::PI * reach * reach / 4.0 / area;
    for (at, sum) in sums.iter().enumerate().filter(|(_, sum)| sum.tone > 0.0) {
        // Samples from the edge, inwards.
        let depth = (sum.near / whole(near) - EDGE) * near / SLOPE;
        let gap = (sum.wide / whole(wide) - GAP) * wide / SLOPE;
        let covered = (depth + 0.5).max(gap + 0.5).max(sum.drop).clamp(0.0, 1.0);
        if covered == 0.0 {
            continue;
        }
        let rim = RIM_SHADE + (1.0 - RIM_SHADE) * (depth.max(gap) / RIM).clamp(0.0, 1.0);
        let shade = shade.unwrap_or(rim);
        rows.cover(at, sum.color.map(|c| c / sum.tone * shade), covered);
    }
}
