//! Pictures of 3D scenes.

use rayon::prelude::*;

use super::light::{Light, SAMPLES, Spiral};
use super::obstacles::{Hit, Obstacle, nearest, obstacles};
use super::splat::{Ball, Depths, splat};
use super::view::View;
use super::{Canvas, lines};
use crate::appearance::{V3, floor, local};
use crate::colliders::domain_box;
use crate::palette::Rgb;
use gridfall_core::sim::setup::Setup;

/// The paper behind the scene, at the top and at the bottom of the picture.
const BACKDROP: [Rgb; 2] = [[0.72, 0.77, 0.84], [0.93, 0.94, 0.95]];
const OBSTACLE: Rgb = [0.34, 0.37, 0.41];
const GLASS: Rgb = [0.62, 0.70, 0.78];
/// Light from the sky, from the floor, and from the lamp.
const SKY: f32 = 0.62;
const BOUNCE: f32 = 0.30;
const LAMP: f32 = 0.62;
/// Brightness of a floor in full shadow.
const SHADOW: f32 = 0.68;
/// Radius of ambient occlusion, as a share of the focus' diagonal.
const OCCLUSION_REACH: f32 = 0.05;

/// What is visible in a pixel.
#[derive(Clone, Copy)]
enum Seen {
    Nothing,
    Floor,
    Obstacle,
    Particle(Rgb, f32),
}

/// Shares of the sky's and of the lamp's light that reach a point.
#[derive(Clone, Copy, Default)]
struct Exposure {
    sky: f32,
    lamp: f32,
}

/// Everything that shading needs.
struct Scene<'a> {
    view: &'a View,
    light: Light,
    spiral: Spiral,
    seen: Vec<Seen>,
    depth: Vec<f32>,
    normal: Vec<V3>,
    reach: f32,
}

pub fn draw(setup: &Setup, view: &View, balls: &[Ball], time_s: f64) -> Canvas {
    let obstacles = obstacles(setup, time_s);
    let mut particles = splat(view, balls);
    particles.smooth(view, balls);
    let scene = Scene::new(setup, view, balls, &obstacles, &particles);
    let mut pixels = vec![[0.0; 3]; view.size[0] * view.size[1]];
    let rows = view.size[0] * view.samples;
    pixels
        .par_chunks_mut(rows)
        .enumerate()
        .for_each(|(band, pixels)| scene.shade_band(band * rows, pixels, &obstacles));
    let mut canvas = Canvas { size: view.size, pixels };
    let domain = domain_box(setup).map(|corner| local(setup, corner));
    lines::draw_box(&mut canvas, view, &domain, &scene.depth);
    canvas
}

impl<'a> Scene<'a> {
    fn new(setup: &Setup, view: &'a View, balls: &[Ball], obstacles: &[Obstacle], particles: &Depths) -> Self {
        let floor = floor(setup);
        let pixel = |at: usize| {
            let [start, direction] = ray(view, at);
            let (mut seen, mut depth, mut normal) = (Seen::Nothing, f32::INFINITY, -view.forward);
            if let Some(level) = floor.filter(|_| direction.z < 0.0) {
                (seen, depth, normal) = (Seen::Floor, (level - start.z) / direction.z, V3::z());
            }
            if particles.depth[at] < depth {
                let ball = &balls[particles.ball[at] as usize];
                seen = Seen::Particle(ball.color, ball.gloss);
                depth = particles.depth[at];
                normal = particle_normal(view, particles, at, ball);
            }
            let opaque = obstacles.iter().filter(|obstacle| !obstacle.translucent);
            if let Some(hit) = nearest(opaque, start, direction, depth) {
                (seen, depth, normal) = (Seen::Obstacle, hit.depth, hit.normal);
            }
            (seen, (depth, normal))
        };
        let (seen, (depth, normal)) = (0..view.size[0] * view.size[1]).into_par_iter().map(pixel).unzip();
        let reach = OCCLUSION_REACH * (view.focus[1] - view.focus[0]).norm();
        let light = Light::new(view, balls, obstacles);
        Self { view, light, spiral: Spiral::new(), seen, depth, normal, reach }
    }

    /// Colours the rows of one line of the finished picture. Samples of one pixel that lie on the
    /// same surface share what is costly to compute.
    fn shade_band(&self, first: usize, pixels: &mut [Rgb], obstacles: &[Obstacle]) {
        let (width, samples) = (self.view.size[0], self.view.samples);
        let mut known = vec![(usize::MAX, Exposure::default()); width / samples];
        for (offset, pixel) in pixels.iter_mut().enumerate() {
            let at = first + offset;
            let known = &mut known[offset % width / samples];
            if known.0 == usize::MAX || !self.same_surface(known.0, at) {
                *known = (at, self.exposure(at));
            }
            *pixel = self.shade(at, &known.1, obstacles);
        }
    }

    fn same_surface(&self, a: usize, b: usize) -> bool {
        let near = self.depth[a] == self.depth[b] || (self.depth[a] - self.depth[b]).abs() < 0.1 * self.reach;
        near && self.normal[a].dot(&self.normal[b]) > 0.9
    }

    fn exposure(&self, at: usize) -> Exposure {
        if matches!(self.seen[at], Seen::Nothing) {
            return Exposure::default();
        }
        let [start, direction] = ray(self.view, at);
        let x = start + direction * self.depth[at];
        let facing = self.normal[at].dot(&self.light.toward) > 0.0;
        Exposure { sky: self.openness(at), lamp: if facing { self.light.reaches(&x, self.disc(at)) } else { 0.0 } }
    }

    /// The colour of a sample.
    fn shade(&self, at: usize, exposure: &Exposure, obstacles: &[Obstacle]) -> Rgb {
        let [start, direction] = ray(self.view, at);
        let glass = obstacles.iter().filter(|obstacle| obstacle.translucent);
        let glass = nearest(glass, start, direction, self.depth[at]);
        let behind = match self.seen[at] {
            Seen::Nothing => self.backdrop(at),
            Seen::Floor => self.backdrop(at).map(|c| c * (SHADOW + (1.0 - SHADOW) * exposure.lamp) * exposure.sky),
            Seen::Obstacle => self.lit(at, &direction, exposure, OBSTACLE, 0.2),
            Seen::Particle(color, gloss) => self.lit(at, &direction, exposure, color, gloss),
        };
        glass.map_or(behind, |hit| pane(behind, &hit, &direction, &self.light.toward))
    }

    /// Colour of a lit surface: light from the sky and the floor, the lamp where it reaches, a
    /// highlight, and the sky mirrored at grazing angles (Schlick 1994).
    fn lit(&self, at: usize, direction: &V3, exposure: &Exposure, albedo: Rgb, gloss: f32) -> Rgb {
        let (n, toward_eye) = (self.normal[at], -direction.normalize());
        let ambient = exposure.sky * (BOUNCE + (SKY - BOUNCE) * (0.5 + 0.5 * n.z));
        let diffuse = ambient + LAMP * exposure.lamp * n.dot(&self.light.toward).max(0.0);
        let half = (self.light.toward + toward_eye).normalize();
        let highlight = gloss * exposure.lamp * n.dot(&half).max(0.0).powi(60);
        let mirror = gloss * exposure.sky * (0.05 + 0.6 * (1.0 - n.dot(&toward_eye).clamp(0.0, 1.0)).powi(4));
        std::array::from_fn(|k| albedo[k] * diffuse * (1.0 - mirror) + BACKDROP[1][k] * mirror + highlight)
    }

    /// Share of the sky that nearby surfaces do not hide (after McGuire et al. 2011, "The Alchemy
    /// screen-space ambient obscurance algorithm").
    fn openness(&self, at: usize) -> f32 {
        let [width, height] = self.view.size;
        let [start, direction] = ray(self.view, at);
        let (x, n) = (start + direction * self.depth[at], self.normal[at]);
        let pixels = (self.reach * self.view.pixels_per_metre(self.depth[at])).min(160.0);
        let mut hidden = 0.0;
        for [dx, dy] in self.disc(at) {
            let column = ((at % width) as f32 + 0.5 + dx * pixels) as usize;
            let row = ((at / width) as f32 + 0.5 + dy * pixels) as usize;
            if column >= width || row >= height {
                continue;
            }
            let other = row * width + column;
            if self.depth[other].is_infinite() {
                continue;
            }
            let [start, direction] = ray(self.view, other);
            let v = start + direction * self.depth[other] - x;
            let far = v.norm_squared() / (self.reach * self.reach);
            hidden += (1.0 - far).max(0.0) * (v.dot(&n) / v.norm().max(1e-12) - 0.12).max(0.0);
        }
        (1.0 - 2.2 * hidden / SAMPLES as f32).clamp(0.15, 1.0)
    }

    /// Where to sample around a pixel: rotated by interleaved gradient noise (Jimenez 2014).
    fn disc(&self, at: usize) -> &[[f32; 2]; SAMPLES] {
        let (x, y) = ((at % self.view.size[0]) as f32, (at / self.view.size[0]) as f32);
        let fraction = |x: f32| x - x as i32 as f32;
        self.spiral.turned(fraction(52.982_918 * fraction(0.067_110_56 * x + 0.005_837_15 * y)))
    }

    fn backdrop(&self, at: usize) -> Rgb {
        let t = (at / self.view.size[0]) as f32 / self.view.size[1] as f32;
        std::array::from_fn(|k| BACKDROP[0][k] + (BACKDROP[1][k] - BACKDROP[0][k]) * (t * 1.4).min(1.0))
    }
}

/// Glass in front of a colour: clear where it faces the camera, milky at its edges.
fn pane(behind: Rgb, hit: &Hit, direction: &V3, light: &V3) -> Rgb {
    let facing = hit.normal.dot(&direction.normalize()).abs();
    let milk = 0.16 + 0.55 * (1.0 - facing).powi(2);
    let shade = 0.7 + 0.3 * hit.normal.dot(light).max(0.0);
    std::array::from_fn(|k| behind[k] * (1.0 - milk) + GLASS[k] * shade * milk)
}

/// Normal of the smoothed surface from its neighbours in the picture. Where it has none, the ball's
/// own normal.
fn particle_normal(view: &View, particles: &Depths, at: usize, ball: &Ball) -> V3 {
    let [width, height] = view.size;
    let position = |at: usize| {
        let [start, direction] = ray(view, at);
        start + direction * particles.depth[at]
    };
    let x = position(at);
    // The neighbour with the nearer depth, so that slopes are not taken across outlines.
    let slope = |before: Option<usize>, after: Option<usize>| {
        let difference = |other: Option<usize>| {
            other.filter(|&other| (particles.depth[other] - particles.depth[at]).abs() < 2.0 * ball.radius)
        };
        let gap = |other: usize| (particles.depth[other] - particles.depth[at]).abs();
        match (difference(before), difference(after)) {
            (Some(b), Some(a)) if gap(b) < gap(a) => Some(x - position(b)),
            (_, Some(a)) => Some(position(a) - x),
            (Some(b), None) => Some(x - position(b)),
            (None, None) => None,
        }
    };
    let (column, row) = (at % width, at / width);
    let across = slope((column > 0).then(|| at - 1), (column + 1 < width).then(|| at + 1));
    let down = slope((row > 0).then(|| at - width), (row + 1 < height).then(|| at + width));
    let normal = match (across, down) {
        (Some(across), Some(down)) => down.cross(&across),
        _ => x - ball.center,
    };
    normal.try_normalize(0.0).unwrap_or(-view.forward)
}

fn ray(view: &View, at: usize) -> [V3; 2] {
    view.ray((at % view.size[0]) as f32, (at / view.size[0]) as f32)
}
