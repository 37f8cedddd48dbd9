//! Helpers that several test files share: scenes from JSON, the software GPU, seeded random states.

use std::sync::{Arc, OnceLock};

use gridfall_core::sim::setup::Problem;
use gridfall_engine::explicit::gpu::GpuEngine;
use gridfall_engine::gpu::Gpu;
use gridfall_scene as scene;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// A problem from a scene, which must be valid.
pub fn problem(json: &str) -> Problem {
    let scene = scene::parse(json).unwrap_or_else(|faults| panic!("{faults:#?}"));
    scene::problem(&scene, &scene::Limits::default()).unwrap_or_else(|faults| panic!("{faults:#?}"))
}

/// A problem from a scene that names files of a folder.
pub fn problem_in(json: &str, folder: &std::path::Path) -> Problem {
    let scene = scene::parse(json).unwrap_or_else(|faults| panic!("{faults:#?}"));
    let files = scene::assets::LocalFiles { folder: folder.to_owned() };
    scene::problem_with(&scene, &scene::Limits::default(), &files).unwrap_or_else(|faults| panic!("{faults:#?}"))
}

/// The device that GPU tests run on: the adapter named by GRIDFALL_TEST_ADAPTER, otherwise
/// lavapipe. A missing device is a failure, not a skip.
pub fn gpu() -> Arc<Gpu> {
    // One device for all tests, because lavapipe compiles pipelines slowly.
    static GPU: OnceLock<Arc<Gpu>> = OnceLock::new();
    GPU.get_or_init(|| {
        let name = std::env::var("GRIDFALL_TEST_ADAPTER").unwrap_or_else(|_| "llvmpipe".into());
        Arc::new(
            Gpu::open(Some(&name)).unwrap_or_else(|e| panic!("GPU tests need a Vulkan driver (see tests/run): {e}")),
        )
    })
    .clone()
}

pub fn gpu_engine(problem: &Problem) -> GpuEngine {
    GpuEngine::new(gpu(), &problem.setup, problem.particles.clone(), "test").unwrap_or_else(|e| panic!("{e}"))
}

/// Random velocities, affine moments and deformations of realistic size: |v| ~ 1 m/s, |C| ~ 0.1
/// v/dx, strain ~ 0.1 after a rotation.
pub fn randomise(problem: &mut Problem, rng: &mut ChaCha8Rng) {
    use gridfall_core::sim::setup::Material;
    let dx = problem.setup.dx;
    for id in 0..problem.particles.len() {
        let p = &mut problem.particles;
        let mut random = |size: f64| rng.random_range(-size..size);
        p.v[id] = std::array::from_fn(|_| random(1.0));
        p.b[id] = std::array::from_fn(|_| random(0.03 * dx));
        let material = problem.setup.bodies[p.body[id] as usize].material;
        p.plastic[id] += match problem.setup.materials[material] {
            Material::DruckerPrager(_) | Material::MohrCoulomb(_) => random(0.05).max(0.0),
            Material::Nacc(_) | Material::Snow(_) => random(0.02),
            _ => 0.0,
        };
        p.f[id] = match problem.setup.materials[material] {
            Material::WeaklyCompressibleFluid(_) => {
                let s = (1.0 + random(0.05)).cbrt();
                [s, 0.0, 0.0, 0.0, s, 0.0, 0.0, 0.0, s]
            }
            _ => {
                let (sin, cos) = random(3.0).sin_cos();
                let stretch: [f64; 9] = std::array::from_fn(|i| if i % 4 == 0 { 1.0 } else { 0.0 } + random(0.1));
                // A stretch, rotated about z.
                std::array::from_fn(|i| match i / 3 {
                    0 => cos * stretch[i % 3] - sin * stretch[3 + i % 3],
                    1 => sin * stretch[i % 3] + cos * stretch[3 + i % 3],
                    _ => stretch[i],
                })
            }
        };
    }
}
