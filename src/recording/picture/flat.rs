//! Pictures of 2D scenes: discs on a sheet, obstacles in grey.

use rayon::prelude::*;

use super::splat::{Ball, splat};
use super::view::View;
use super::{Canvas, lines};
use crate::appearance::global;
use gridfall_core::sim::setup::Setup;

const PAPER: [f32; 3] = [0.93, 0.94, 0.955];
const OBSTACLE: [f32; 3] = [0.36, 0.39, 0.43];

pub fn draw(setup: &Setup, view: &View, balls: &[Ball], time_s: f64) -> Canvas {
    let seen = splat(view, balls);
    let width = view.size[0];
    // What a grip holds must stay visible.
    let solid = setup.colliders.iter().filter(|collider| collider.is_present(time_s) && !collider.grip);
    let solid: Vec<_> = solid.map(|collider| collider.at(time_s)).collect();
    let pixel = |at: usize| {
        if seen.ball[at] != u32::MAX {
            return balls[seen.ball[at] as usize].color;
        }
        let [start, _] = view.ray((at % width) as f32, (at / width) as f32);
        let [x, y, _] = global(setup, start);
        let x = [x, y, 0.0];
        let inside = (0..2).all(|a| start[a] >= view.focus[0][a] && start[a] <= view.focus[1][a]);
        let blocked = inside && solid.iter().any(|collider| collider.distance(x) < 0.0);
        if blocked { OBSTACLE } else { PAPER }
    };
    let pixels = (0..seen.ball.len()).into_par_iter().map(pixel).collect();
    let mut canvas = Canvas { size: view.size, pixels };
    lines::draw_box(&mut canvas, view, &view.focus, &seen.depth);
    canvas
}
