//! Pictures of 3D scenes.

use rayon::prelude::*;

use super::light::{Light, spiral};
use super::obstacles::{Hit, Obstacle, nearest, obstacles};
use super::splat::{Ball, Depths, splat};
use super::view::{View, floor};
use super::{Canvas, V3, lines};
use crate::recording::colliders::domain_box;
use crate::recording::palette::Rgb;
use crate::sim::problem::Problem;

/// The paper behind the scene, at the top and at the bottom of the picture.
const BACKDROP: [Rgb; 2] = [[0.72, 0.77, 0.84], [0.93, 0.94, 0.95]];
const OBSTACLE: Rgb = [0.34, 0.37, 0.41];
const GLASS: Rgb = [0.62, 0.70, 0.78];
/// Light from the sky, from the floor, and from the lamp.
const SKY: f32 = 0.62;
const BOUNCE: f32 = 0.30;
const LAMP: f32 = 0.62;
/// Radius of ambient occlusion, as a share of the focus' diagonal, and its samples.
const OCCLUSION_REACH: f32 = 0.05;
const OCCLUSION_SAMPLES: usize = 14;

/// What is seen in a pixel.
#[derive(Clone, Copy)]
enum Seen {
    Nothing,
    Floor,
    Obstacle,
    Particle(Rgb),
}

/// All that shading needs to know.
struct Scene<'a> {
    view: &'a View,
    light: Light,
    seen: Vec<Seen>,
    depth: Vec<f32>,
    normal: Vec<V3>,
    reach: f32,
}

pub fn draw(problem: &Problem, view: &View, balls: &[Ball], time_s: f64) -> Canvas {
    let obstacles = obstacles(problem, time_s);
    let mut particles = splat(view, balls);
    particles.smooth(view, balls);
    let scene = Scene::new(problem, view, balls, &obstacles, &particles);
    let count = view.size[0] * view.size[1];
    let pixels = (0..count).into_par_iter().map(|at| scene.shade(at, &obstacles)).collect();
    let mut canvas = Canvas { size: view.size, pixels };
    let domain = domain_box(problem).map(|corner| V3::from(corner.map(|c| c as f32)));
    lines::draw_box(&mut canvas, view, &domain, &scene.depth);
    canvas
}

impl<'a> Scene<'a> {
    fn new(problem: &Problem, view: &'a View, balls: &[Ball], obstacles: &[Obstacle], particles: &Depths) -> Self {
        let floor = floor(problem);
        let pixel = |at: usize| {
            let [start, direction] = ray(view, at);
            let (mut seen, mut depth, mut normal) = (Seen::Nothing, f32::INFINITY, -view.forward);
            if let Some(level) = floor.filter(|_| direction.z < 0.0) {
                (seen, depth, normal) = (Seen::Floor, (level - start.z) / direction.z, V3::z());
            }
            if particles.depth[at] < depth {
                let ball = &balls[particles.ball[at] as usize];
                seen = Seen::Particle(ball.color);
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
        Self { view, light: Light::new(view, balls, obstacles), seen, depth, normal, reach }
    }

    /// The colour of a pixel.
    fn shade(&self, at: usize, obstacles: &[Obstacle]) -> Rgb {
        let backdrop = self.backdrop(at);
        let [start, direction] = ray(self.view, at);
        let glass = obstacles.iter().filter(|obstacle| obstacle.translucent);
        let glass = nearest(glass, start, direction, self.depth[at]);
        let behind = match self.seen[at] {
            Seen::Nothing => backdrop,
            Seen::Floor => {
                let x = start + direction * self.depth[at];
                let shade = (0.62 + 0.38 * self.light.reaches(&x, noise(self.view, at))) * self.openness(at);
                backdrop.map(|c| c * shade)
            }
            Seen::Obstacle => self.lit(at, OBSTACLE, 0.1),
            Seen::Particle(color) => self.lit(at, color, 0.22),
        };
        glass.map_or(behind, |hit| pane(behind, &hit, &direction, &self.light.toward))
    }

    /// Colour of a lit surface: sky and floor light from their sides, the lamp where it reaches, and a highlight.
    fn lit(&self, at: usize, albedo: Rgb, gloss: f32) -> Rgb {
        let [start, direction] = ray(self.view, at);
        let x = start + direction * self.depth[at];
        let n = self.normal[at];
        let ambient = self.openness(at) * (BOUNCE + (SKY - BOUNCE) * (0.5 + 0.5 * n.z));
        let facing = n.dot(&self.light.toward);
        let lit = if facing > 0.0 { self.light.reaches(&x, noise(self.view, at)) } else { 0.0 };
        let diffuse = ambient + LAMP * lit * facing.max(0.0);
        let half = (self.light.toward - direction.normalize()).normalize();
        let highlight = gloss * lit * n.dot(&half).max(0.0).powi(40);
        albedo.map(|c| c * diffuse + highlight)
    }

    /// Share of the sky that is not hidden by what is near (after McGuire et al. 2011, "The Alchemy screen-space ambient
    /// obscurance algorithm").
    fn openness(&self, at: usize) -> f32 {
        let [width, height] = self.view.size;
        let [start, direction] = ray(self.view, at);
        let (x, n) = (start + direction * self.depth[at], self.normal[at]);
        let pixels = (self.reach * self.view.pixels_per_metre(self.depth[at])).min(160.0);
        let mut hidden = 0.0;
        for k in 0..OCCLUSION_SAMPLES {
            let [dx, dy] = spiral(k, OCCLUSION_SAMPLES, noise(self.view, at));
            let (column, row) = ((at % width) as f32 + dx * pixels, (at / width) as f32 + dy * pixels);
            if column < 0.0 || row < 0.0 || column >= width as f32 || row >= height as f32 {
                continue;
            }
            let other = row as usize * width + column as usize;
            if self.depth[other].is_infinite() {
                continue;
            }
            let [start, direction] = ray(self.view, other);
            let v = start + direction * self.depth[other] - x;
            let far = v.norm_squared() / (self.reach * self.reach);
            hidden += (1.0 - far).max(0.0) * (v.dot(&n) / v.norm().max(1e-12) - 0.12).max(0.0);
        }
        (1.0 - 2.2 * hidden / OCCLUSION_SAMPLES as f32).clamp(0.15, 1.0)
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

/// Normal of the smoothed surface from its neighbours in the picture; that of the ball where it stands alone.
fn particle_normal(view: &View, particles: &Depths, at: usize, ball: &Ball) -> V3 {
    let [width, height] = view.size;
    let position = |at: usize| {
        let [start, direction] = ray(view, at);
        start + direction * particles.depth[at]
    };
    let x = position(at);
    // The neighbour whose depth is nearer, so that slopes are not taken across outlines.
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

/// Interleaved gradient noise (Jimenez 2014).
fn noise(view: &View, at: usize) -> f32 {
    let (x, y) = ((at % view.size[0]) as f32, (at / view.size[0]) as f32);
    (52.982_918 * (0.067_110_56 * x + 0.005_837_15 * y).fract()).fract()
}
