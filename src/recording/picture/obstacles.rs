//! Colliders in pictures: rays traced through their distance fields.

use crate::appearance::{V3, global, local};
use crate::colliders::{domain_box, translucent};
use gridfall_core::sim::collider::{Pose, Sdf, rotate};
use gridfall_core::sim::setup::Setup;

/// A collider at the time of the picture.
pub struct Obstacle<'a> {
    setup: &'a Setup,
    sdf: &'a Sdf,
    pose: Pose,
    /// The part that is drawn, in the collider's pose at time 0.
    clip: [V3; 2],
    /// Material inside shows through.
    pub translucent: bool,
}

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    pub depth: f32,
    pub normal: V3,
}

/// All colliders that exist at a time. Those that do not move are cut off at the domain's walls.
pub fn obstacles(setup: &Setup, time_s: f64) -> Vec<Obstacle<'_>> {
    let local = |x| local(setup, x);
    let domain = domain_box(setup).map(local);
    let obstacle = |collider: &'_ gridfall_core::sim::collider::Collider| {
        let bounds = collider.sdf.bounds().map(local);
        let bounded = bounds.iter().all(|corner| corner.iter().all(|c| c.abs() < 1e10));
        let clip = if collider.motion.moves() && bounded {
            bounds
        } else {
            [bounds[0].sup(&domain[0]), bounds[1].inf(&domain[1])]
        };
        (clip, collider.motion.pose(time_s), translucent(collider))
    };
    setup
        .colliders
        .iter()
        .filter(|collider| collider.is_present(time_s))
        .map(|collider| {
            let (clip, pose, translucent) = obstacle(collider);
            Obstacle { setup, sdf: &collider.sdf, pose, clip, translucent }
        })
        .collect()
}

/// The nearest hit among obstacles, before depth `limit`.
pub fn nearest<'a>(
    obstacles: impl Iterator<Item = &'a Obstacle<'a>>,
    start: V3,
    direction: V3,
    limit: f32,
) -> Option<Hit> {
    obstacles.fold(None, |best: Option<Hit>, obstacle| {
        obstacle.hit(start, direction, best.map_or(limit, |hit| hit.depth)).or(best)
    })
}

impl Obstacle<'_> {
    /// Sphere tracing (Hart 1996) along start + depth × direction, inside the clip box.
    fn hit(&self, start: V3, direction: V3, limit: f32) -> Option<Hit> {
        let to_start = |x: V3| local(self.setup, self.pose.to_start(global(self.setup, x)));
        let origin = to_start(start);
        let ahead = to_start(start + direction) - origin;
        let (mut near, mut far, mut face) = (0.0f32, limit, V3::zeros());
        for a in 0..3 {
            let (low, high) = ((self.clip[0][a] - origin[a]) / ahead[a], (self.clip[1][a] - origin[a]) / ahead[a]);
            if low.is_nan() || high.is_nan() {
                return None;
            }
            if low.min(high) > near {
                near = low.min(high);
                face = V3::zeros();
                face[a] = -ahead[a].signum();
            }
            far = far.min(low.max(high));
        }
        let length = ahead.norm();
        let size = (self.clip[1] - self.clip[0]).norm();
        let distance = |x: V3| self.sdf.distance(global(self.setup, x)) as f32;
        let (mut depth, mut first) = (near, true);
        for _ in 0..96 {
            if depth >= far {
                return None;
            }
            let x = origin + ahead * depth;
            let d = distance(x);
            if d < 2e-4 * size {
                let h = 1e-3 * size;
                // The sides of a sheet face their own ways.
                let near = if self.sdf.is_sheet() { x - ahead * (2.0 * h / length) } else { x };
                let normal = if first { face } else { gradient(&distance, near, h) };
                let world = rotate(&self.pose.rotation, [normal.x, normal.y, normal.z].map(f64::from));
                return Some(Hit { depth, normal: V3::from(world.map(|c| c as f32)) });
            }
            first = false;
            depth += d / length;
        }
        None
    }
}

fn gradient(distance: &impl Fn(V3) -> f32, x: V3, h: f32) -> V3 {
    let slope = |axis: V3| distance(x + axis * h) - distance(x - axis * h);
    V3::new(slope(V3::x()), slope(V3::y()), slope(V3::z())).try_normalize(0.0).unwrap_or_default()
}
