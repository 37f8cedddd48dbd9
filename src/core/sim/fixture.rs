//! Small problems for unit tests: boxes of particles on a lattice, built without a scene document.

use super::particles::{IDENTITY, Particles};
use super::setup::{
    Axis, Body, Contact, ContactAt, ContactKind, Implicit, Integrator, Kernel, Precision, Problem, Setup, Transfer,
};
use crate::material::parameters::{Elastic, Fluid, Material};

/// A box filled with particles: index of the material, lower and upper corner (m).
pub type Block = (usize, [f64; 3], [f64; 3]);

/// A neo-Hookean solid of 1e5 Pa and a fluid, of equal density.
pub fn solid_and_fluid() -> Vec<Material> {
    vec![
        Material::NeoHookean(Elastic { density: 1000.0, youngs_modulus: 1e5, poissons_ratio: 0.3, damping: 0.0 }),
        Material::WeaklyCompressibleFluid(Fluid { density: 1000.0, bulk_modulus: 1e5, gamma: 7.15, viscosity: 0.0 }),
    ]
}

/// Boxes at rest in a cube of side 1 m with sticky walls, two particles along each side of a cell,
/// 50 frames of 1/50 s.
pub fn problem(dimension: usize, dx: f64, materials: Vec<Material>, blocks: &[Block]) -> Problem {
    let walls = Axis::Walls([Contact { kind: ContactKind::Sticky, friction: 0.0 }; 2]);
    let (spacing, volume0) = (0.5 * dx, (0.5 * dx).powi(dimension as i32));
    let mut particles = Particles::default();
    let mut bodies = Vec::new();
    for (index, &(material, lower, upper)) in blocks.iter().enumerate() {
        let first = particles.len();
        let count = |a: usize| if a < dimension { ((upper[a] - lower[a]) / spacing).round() as usize } else { 1 };
        let [nx, ny, nz] = [0, 1, 2].map(count);
        for k in 0..nx * ny * nz {
            let lattice = [k % nx, k / nx % ny, k / (nx * ny)];
            let place = |a: usize| lower[a] + (lattice[a] as f64 + 0.5) * spacing;
            particles.x.push(std::array::from_fn(|a| if a < dimension { place(a) } else { 0.0 }));
        }
        let n = particles.x.len();
        particles.v.resize(n, [0.0; 3]);
        particles.b.resize(n, [0.0; 9]);
        particles.f.resize(n, IDENTITY);
        particles.plastic.resize(n, 0.0);
        particles.body.resize(n, index as u32);
        let mass = materials[material].density() * volume0;
        bodies.push(Body {
            name: format!("body {index}"),
            material,
            particles: first..n,
            volume0,
            mass,
            contact: None,
        });
    }
    let cells = (1.0 / dx).round() as usize;
    let setup = Setup {
        name: "fixture".into(),
        dimension,
        origin: [0.0; 3],
        dx,
        cells: std::array::from_fn(|a| if a < dimension { cells } else { 1 }),
        axes: [walls; 3],
        gravity: [0.0; 3],
        materials,
        bodies,
        sources: Vec::new(),
        colliders: Vec::new(),
        contact_at: ContactAt::Nodes,
        kernel: Kernel::Compact,
        transfer: Transfer::Mls,
        precision: Precision::F32,
        cfl: 0.5,
        max_dt_s: None,
        integrator: Integrator::Explicit,
        integrator_reason: String::new(),
        notices: Vec::new(),
        implicit: Implicit::default(),
        frames: 50,
        frame_s: 1.0 / 50.0,
        fields: Vec::new(),
        preview_points: 1,
        keep_state: false,
        seed: 1,
    };
    Problem { setup, particles }
}
