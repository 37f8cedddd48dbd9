//! A valid scene to a [`Problem`]: grid, walls, bodies with their particles, sources and colliders.

mod bodies;
mod motion;
mod neighbours;

use gridfall_core::sim::cost;
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::settings::Integrator;
use gridfall_core::sim::setup::{Axis, Body, Contact, Problem, Setup};
use rayon::prelude::*;

use crate::grid::{cells, frames, stream};
use crate::resolve::Resolved;
use crate::schema::{self, Boundary, ContactKind, Scene};
use crate::shape;
use crate::vectors::vector3;
use bodies::add_body;
use motion::colliders;

/// Builds the problem. The scene must be valid, and `resolved` what it resolves to.
pub(crate) fn build(scene: &Scene, resolved: &Resolved) -> Problem {
    let dimension = scene.dimension as usize;
    let materials: Vec<&String> = scene.materials.keys().collect();
    let setup = Setup {
        name: scene.name.clone(),
        dimension,
        origin: vector3(&scene.domain.min),
        dx: scene.domain.dx,
        cells: cells(&scene.domain, dimension).map(|n| n.round() as usize),
        axes: std::array::from_fn(|a| axis(&scene.domain, a, dimension)),
        gravity: scene.gravity.as_deref().map_or([0.0; 3], vector3),
        materials: scene.materials.values().map(|material| material.law.clone()).collect(),
        bodies: Vec::new(),
        sources: Vec::new(),
        colliders: colliders(scene, &resolved.fields),
        contact_at: scene.solver.contact,
        kernel: scene.solver.kernel,
        transfer: scene.solver.transfer,
        precision: scene.solver.precision,
        cfl: scene.solver.cfl,
        max_dt_s: scene.solver.max_dt,
        integrator: scene.solver.integrator,
        integrator_reason: String::new(),
        implicit: scene.solver.implicit,
        notices: resolved.notices.clone(),
        frames: frames(scene),
        frame_s: 1.0 / scene.time.frame_rate,
        fields: scene.output.fields.clone(),
        preview_points: scene.output.preview_points as usize,
        keep_state: scene.output.state,
        seed: scene.seed,
    };
    let mut problem = Problem { setup, particles: Particles::default() };
    let material = |name: &str| materials.iter().position(|known| *known == name).expect("a valid scene");
    for (index, body) in scene.bodies.iter().enumerate() {
        add_body(&mut problem, scene, resolved, index, material(&body.material));
    }
    for (n, source) in scene.sources.iter().enumerate() {
        let sdf = shape::sdf(&source.shape, &format!("/sources/{n}/shape"), &resolved.fields, dimension);
        let mut built = stream(scene, source, sdf, problem.setup.bodies.len());
        built.by_frame = (0..frames(scene)).map(|frame| built.entering(frame).count() as u64).collect();
        let material = material(&source.material);
        let (volume0, none) = (built.spacing.powi(dimension as i32), problem.particles.len());
        let mass = problem.setup.materials[material].density() * volume0;
        problem.setup.bodies.push(Body {
            name: source.name.clone(),
            material,
            particles: none..none,
            volume0,
            mass,
            contact: None,
        });
        problem.setup.sources.push(built);
    }
    let sticking = neighbours::sticking(&problem);
    problem.setup.notices.extend(sticking);
    (problem.setup.integrator, problem.setup.integrator_reason) =
        cost::choose(&problem.setup, &problem.particles, scene.solver.integrator);
    problem
}

/// Gives the particles of a problem another state, in sampling order.
///
/// # Errors
/// When it is not of as many particles of each body.
pub(crate) fn begin_with(problem: &mut Problem, state: Particles, integrator: Integrator) -> Result<(), String> {
    let mut counts = vec![0; problem.setup.bodies.len()];
    for &body in &state.body {
        *counts
            .get_mut(body as usize)
            .ok_or_else(|| format!("the state has a body {body}, and the scene has not"))? += 1;
    }
    for (body, count) in problem.setup.bodies.iter().zip(counts) {
        let own = body.particles.len();
        if own != count {
            let name = &body.name;
            return Err(format!("the state has {count} particles of the body {name:?}, and the scene makes {own}"));
        }
    }
    if state.body != problem.particles.body {
        return Err("the state's particles are in another order than the scene's".into());
    }
    problem.particles = state;
    // What is predicted from velocities and deformations.
    let Problem { setup, particles } = problem;
    (setup.integrator, setup.integrator_reason) = cost::choose(setup, particles, integrator);
    Ok(())
}

fn axis(domain: &schema::Domain, a: usize, dimension: usize) -> Axis {
    if a >= dimension {
        return Axis::Walls([Contact { kind: ContactKind::Slip, friction: 0.0 }; 2]);
    }
    let name = ["x", "y", "z"][a];
    if let Some(Boundary::Periodic(_)) = domain.boundary.get(name) {
        return Axis::Periodic;
    }
    let wall = |side: &str| match domain.boundary.get(&format!("{name}{side}")).or(domain.boundary.get(name)) {
        Some(Boundary::Wall(wall)) => Contact { kind: wall.contact, friction: wall.friction },
        _ => Contact { kind: ContactKind::Sticky, friction: 0.0 },
    };
    Axis::Walls([wall("-"), wall("+")])
}
