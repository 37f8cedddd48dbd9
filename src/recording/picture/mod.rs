//! Pictures of frames, rendered on the CPU: particles as a smoothed surface of small spheres, lit
//! from above, with their shadow.

mod flat;
mod light;
mod lines;
mod obstacles;
mod splat;
mod surface;
mod view;

use rayon::prelude::*;

use super::excerpt::{Excerpt, select};
use super::palette::{Palette, Rgb, to_srgb};
use gridfall_core::sim::setup::Setup;
use splat::Ball;
use view::View;

use crate::appearance::{Appearance, local};

/// Size and effort of a picture.
struct Quality {
    /// Width and height (pixels).
    size: [usize; 2],
    /// Samples of a pixel along each axis.
    samples: usize,
    /// Maximum number of particles drawn.
    particles: usize,
    /// Pixels along each side of the shadow map.
    shadows: usize,
}

const STILL: Quality = Quality { size: [960, 540], samples: 2, particles: 1_000_000, shadows: 1024 };
const FILM: Quality = Quality { size: [480, 270], samples: 1, particles: 200_000, shadows: 384 };

/// The particles that a [`thumbnail`] shows.
pub fn thumbnail_selection(setup: &Setup) -> Vec<u32> {
    select(setup.total_particles(), STILL.particles, setup.seed)
}

/// A picture of a frame as PNG, 960 × 540, of all particles of an excerpt.
pub fn thumbnail(setup: &Setup, appearance: &Appearance, particles: &Excerpt, time_s: f64) -> Vec<u8> {
    let all = (0..particles.selected as u32).collect();
    Camera::new(setup, appearance, &STILL, all).render(setup, particles, time_s).png()
}

/// A camera that does not move during a run.
pub struct Camera {
    view: View,
    palette: Palette,
    /// The particles of an excerpt that are drawn, and the factor by which they are enlarged to
    /// stand for the others.
    selected: Vec<u32>,
    growth: f64,
}

impl Camera {
    /// A camera for small pictures of all frames. `selected` says which particles of an excerpt are
    /// drawn.
    pub fn film(setup: &Setup, appearance: &Appearance, selected: Vec<u32>) -> Self {
        Self::new(setup, appearance, &FILM, selected)
    }

    /// The particles that a film shows.
    pub fn film_selection(setup: &Setup) -> Vec<u32> {
        select(setup.total_particles(), FILM.particles, setup.seed)
    }

    fn new(setup: &Setup, appearance: &Appearance, quality: &Quality, selected: Vec<u32>) -> Self {
        let growth = (setup.total_particles() as f64 / selected.len().max(1) as f64).powf(1.0 / setup.dimension as f64);
        Self {
            view: View::of(setup, appearance.focus, quality),
            palette: Palette::new(setup, appearance),
            selected,
            growth,
        }
    }

    /// Draws a frame.
    pub fn render(&self, setup: &Setup, particles: &Excerpt, time_s: f64) -> Image {
        let balls = self.balls(setup, particles);
        let canvas = if setup.dimension == 2 {
            flat::draw(setup, &self.view, &balls, time_s)
        } else {
            surface::draw(setup, &self.view, &balls, time_s)
        };
        canvas.reduced(self.view.samples)
    }

    fn balls(&self, setup: &Setup, particles: &Excerpt) -> Vec<Ball> {
        let radii: Vec<f32> =
            setup.bodies.iter().map(|body| (self.growth * radius(setup, body.volume0)) as f32).collect();
        let ball = |&p: &u32| {
            let p = p as usize;
            let (v, body) = (particles.v[p], particles.body[p]);
            let gloss = self.palette.gloss(body);
            let color = self.palette.color(body, (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt());
            Ball { center: local(setup, particles.x[p]), radius: radii[body as usize], color, gloss }
        };
        let present = particles.present(&self.selected);
        self.selected[..present].par_iter().map(ball).collect()
    }
}

/// Half the spacing of a body's particles, enlarged so that neighbours leave no gaps.
fn radius(setup: &Setup, volume0: f64) -> f64 {
    if setup.dimension == 2 { 0.75 * volume0.sqrt() } else { 0.66 * volume0.cbrt() }
}

/// A picture in linear light.
struct Canvas {
    size: [usize; 2],
    pixels: Vec<Rgb>,
}

impl Canvas {
    /// Averages the samples of each pixel.
    fn reduced(&self, samples: usize) -> Image {
        let [width, height] = self.size.map(|s| s / samples);
        let mut rgb = vec![0; 3 * width * height];
        rgb.par_chunks_mut(3 * width).enumerate().for_each(|(row, line)| {
            for (column, pixel) in line.chunks_mut(3).enumerate() {
                let mut sum = [0.0; 3];
                for k in 0..samples * samples {
                    let (y, x) = (row * samples + k / samples, column * samples + k % samples);
                    (0..3).for_each(|c| sum[c] += self.pixels[y * self.size[0] + x][c].clamp(0.0, 1.0));
                }
                (0..3).for_each(|c| pixel[c] = to_srgb(sum[c] / (samples * samples) as f32));
            }
        });
        Image { size: [width, height], rgb }
    }
}

/// A finished picture.
pub struct Image {
    /// Width and height (pixels).
    pub size: [usize; 2],
    /// sRGB, rows from the top.
    pub rgb: Vec<u8>,
}

impl Image {
    /// The picture as a PNG file.
    pub fn png(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.size[0] as u32, self.size[1] as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::Fast);
        let mut writer = encoder.write_header().expect("a vector grows");
        writer.write_image_data(&self.rgb).expect("the size is right");
        writer.finish().expect("a vector grows");
        bytes
    }
}
