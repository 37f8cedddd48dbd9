//! Pictures of frames, rendered on the CPU. In 3D: particles as a smoothed surface of small spheres,
//! lit from above, with their shadow. In 2D: fluids and solids as filled areas, sand as grains.

mod aim;
mod areas;
mod flat;
mod grains;
mod light;
mod lines;
mod obstacles;
mod splat;
mod surface;
mod view;

use rayon::prelude::*;

use super::excerpt::{hash, select};
use super::palette::{Palette, Rgb, to_srgb};
use gridfall_core::sim::excerpt::Excerpt;
use gridfall_core::sim::setup::{Material, Setup};

use crate::appearance::{Appearance, V3, local};

pub use aim::Aim;
pub(crate) use splat::Ball;
pub(crate) use view::View;

/// Size and effort of a picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Quality {
    /// Width and height (pixels).
    pub size: [usize; 2],
    /// Samples of a pixel along each axis.
    pub samples: usize,
    /// Maximum number of particles drawn.
    pub particles: usize,
    /// Pixels along each side of the shadow map.
    pub shadows: usize,
}

pub(crate) const STILL: Quality = Quality { size: [960, 540], samples: 2, particles: 1_000_000, shadows: 1024 };
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
            view: View::of(setup, appearance.focus, quality, &Aim::default()),
            palette: Palette::new(setup, appearance),
            selected,
            growth,
        }
    }

    /// Draws a frame.
    pub fn render(&self, setup: &Setup, particles: &Excerpt, time_s: f64) -> Image {
        draw(setup, &self.view, &self.balls(setup, particles), time_s)
    }

    fn balls(&self, setup: &Setup, particles: &Excerpt) -> Vec<Ball> {
        let brush = Brush::new(setup, self.growth, false);
        let ball = |&p: &u32| {
            let p = p as usize;
            let (v, body) = (particles.v[p], particles.body[p]);
            let color = self.palette.color(body, (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt());
            brush.ball(local(setup, particles.x[p]), body, p as u32, (color, self.palette.gloss(body)))
        };
        let present = particles.present(&self.selected);
        self.selected[..present].par_iter().map(ball).collect()
    }
}

/// Draws particles with the colliders of a time.
pub(crate) fn draw(setup: &Setup, view: &View, balls: &[Ball], time_s: f64) -> Image {
    let canvas = if setup.dimension == 2 {
        flat::draw(setup, view, balls, time_s)
    } else {
        surface::draw(setup, view, balls, time_s)
    };
    canvas.reduced(view.samples)
}

/// How the particles of a body look.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Style {
    /// One area, or drops.
    Fluid,
    /// One area.
    Solid,
    /// Grain by grain.
    Grains,
}

impl Style {
    fn of(material: &Material) -> Self {
        match material {
            Material::DruckerPrager(_) | Material::MohrCoulomb(_) => Self::Grains,
            Material::WeaklyCompressibleFluid(_) => Self::Fluid,
            _ => Self::Solid,
        }
    }
}

/// Makes what is drawn of particles.
pub(crate) struct Brush {
    /// Radius and style, by body.
    bodies: Vec<(f32, Style)>,
    /// Whether colours say a value, and are left as they are.
    exact: bool,
}

impl Brush {
    /// `growth` is the factor by which particles are enlarged to stand for those that are not drawn.
    pub fn new(setup: &Setup, growth: f64, exact: bool) -> Self {
        let body = |body: &gridfall_core::sim::setup::Body| {
            ((growth * radius(setup, body.volume0)) as f32, Style::of(&setup.materials[body.material]))
        };
        Self { bodies: setup.bodies.iter().map(body).collect(), exact }
    }

    /// The particle at a place, with its colour and gloss. `id` is the same in all frames. Grains of sand are not all
    /// alike.
    pub fn ball(&self, center: V3, body: u32, id: u32, (color, gloss): (Rgb, f32)) -> Ball {
        let (radius, style) = self.bodies[body as usize];
        let tint = match style {
            Style::Grains if !self.exact => 0.87 + 0.26 * (hash(u64::from(id)) >> 40) as f32 / (1 << 24) as f32,
            _ => 1.0,
        };
        Ball { center, radius, color: color.map(|c| c * tint), gloss, body, exact: self.exact }
    }
}

/// Half the spacing of a body's particles, enlarged so that neighbours leave no gaps. In 2D, half the spacing.
fn radius(setup: &Setup, volume0: f64) -> f64 {
    if setup.dimension == 2 { 0.5 * volume0.sqrt() } else { 0.66 * volume0.cbrt() }
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
    /// Lays a colour over a pixel; what is beyond the picture is left out.
    pub(crate) fn cover(&mut self, [x, y]: [usize; 2], color: [u8; 3], share: f32) {
        let [width, height] = self.size;
        if x >= width || y >= height {
            return;
        }
        for (below, above) in self.rgb[3 * (y * width + x)..][..3].iter_mut().zip(color) {
            *below = (f32::from(*below) + (f32::from(above) - f32::from(*below)) * share).round() as u8;
        }
    }

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
