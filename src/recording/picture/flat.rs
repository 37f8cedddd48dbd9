//! Pictures of 2D scenes: filled areas and grains on a sheet, obstacles in grey.

use rayon::prelude::*;

use super::splat::Ball;
use super::view::View;
use super::{Canvas, Style, areas, grains, lines};
use crate::appearance::global;
use crate::palette::Rgb;
use gridfall_core::sim::setup::Setup;

const PAPER: [f32; 3] = [0.93, 0.94, 0.955];
const OBSTACLE: [f32; 3] = [0.36, 0.39, 0.43];
/// Rows that one task fills.
const BAND: usize = 32;

/// Particles of one body, as discs in the picture.
pub struct Discs {
    pub style: Style,
    /// In samples, from the top left corner.
    pub discs: Vec<Disc>,
    /// Half the spacing of the particles (samples).
    pub radius: f32,
    /// Whether colours say a value.
    pub exact: bool,
    /// Indices of those that reach into each band of rows.
    bands: Vec<Vec<u32>>,
}

#[derive(Clone, Copy, Debug)]
pub struct Disc {
    pub center: [f32; 2],
    pub color: Rgb,
}

/// Rows of the picture that are being painted.
pub struct Rows<'a> {
    pub first: usize,
    pub width: usize,
    pub pixels: &'a mut [Rgb],
}

impl Rows<'_> {
    /// Lays a colour over a sample.
    pub fn cover(&mut self, at: usize, color: Rgb, share: f32) {
        let below = &mut self.pixels[at];
        *below = std::array::from_fn(|k| below[k] + (color[k] - below[k]) * share);
    }

    /// Columns and rows of a square around a point, the rows counted from the first one here.
    pub fn around(&self, [x, y]: [f32; 2], reach: f32) -> [std::ops::Range<usize>; 2] {
        let range = |low: f32, high: f32, size: usize| {
            (low.ceil().max(0.0) as usize)..((high.floor() + 1.0).max(0.0) as usize).min(size)
        };
        let (top, height) = (self.first as f32, self.pixels.len() / self.width);
        [range(x - reach, x + reach, self.width), range(y - reach - top, y + reach - top, height)]
    }
}

pub fn draw(setup: &Setup, view: &View, balls: &[Ball], time_s: f64) -> Canvas {
    let mut canvas = Canvas { size: view.size, pixels: sheet(setup, view, time_s) };
    let nothing = vec![f32::INFINITY; canvas.pixels.len()];
    lines::draw_box(&mut canvas, view, &view.focus, &nothing);
    let bodies = bodies(setup, view, balls);
    let width = view.size[0];
    canvas.pixels.par_chunks_mut(BAND * width).enumerate().for_each(|(band, pixels)| {
        let mut rows = Rows { first: band * BAND, width, pixels };
        let of = |grains| bodies.iter().filter(move |body| (body.style == Style::Grains) == grains);
        of(false).for_each(|body| areas::paint(&mut rows, body, &body.bands[band], None));
        for body in of(true) {
            areas::paint(&mut rows, body, &body.bands[band], Some(grains::gaps(body)));
            grains::paint(&mut rows, body, &body.bands[band], view.samples);
        }
    });
    canvas
}

/// The paper with what does not move as particles do.
fn sheet(setup: &Setup, view: &View, time_s: f64) -> Vec<Rgb> {
    // What a grip holds must stay visible.
    let solid = setup.colliders.iter().filter(|collider| collider.is_present(time_s) && !collider.grip);
    let solid: Vec<_> = solid.map(|collider| collider.at(time_s)).collect();
    let scale = view.pixels_per_metre(1.0);
    let pixel = |at: usize| {
        let [start, _] = view.ray((at % view.size[0]) as f32, (at / view.size[0]) as f32);
        let [x, y, _] = global(setup, start);
        let inside = (0..2).all(|a| start[a] >= view.focus[0][a] && start[a] <= view.focus[1][a]);
        if !inside {
            return PAPER;
        }
        let distance = solid.iter().map(|collider| collider.distance([x, y, 0.0])).fold(f64::INFINITY, f64::min);
        let share = (0.5 - distance as f32 * scale).clamp(0.0, 1.0);
        std::array::from_fn(|k| PAPER[k] + (OBSTACLE[k] - PAPER[k]) * share)
    };
    (0..view.size[0] * view.size[1]).into_par_iter().map(pixel).collect()
}

/// The particles that are in the picture, by body.
fn bodies(setup: &Setup, view: &View, balls: &[Ball]) -> Vec<Discs> {
    let count = view.size[1].div_ceil(BAND);
    let body = |body: &gridfall_core::sim::setup::Body| Discs {
        style: Style::of(&setup.materials[body.material]),
        discs: Vec::new(),
        radius: 0.0,
        exact: false,
        bands: vec![Vec::new(); count],
    };
    let mut bodies: Vec<Discs> = setup.bodies.iter().map(body).collect();
    let [width, height] = view.size.map(|size| size as f32);
    for ball in balls {
        let body = &mut bodies[ball.body as usize];
        let [x, y, _] = view.project(&ball.center);
        body.radius = ball.radius * view.pixels_per_metre(1.0);
        body.exact = ball.exact;
        let reach = areas::REACH * body.radius + 1.0;
        if x + reach < 0.0 || y + reach < 0.0 || x - reach > width || y - reach > height {
            continue;
        }
        let band = |row: f32| (row.max(0.0) as usize / BAND).min(count - 1);
        for band in band(y - reach)..=band(y + reach) {
            body.bands[band].push(body.discs.len() as u32);
        }
        body.discs.push(Disc { center: [x, y], color: ball.color });
    }
    bodies
}
