//! The shaders' laws against those of `gridfall_core::material`, each on random, rotated, flat and
//! inverted states; and the shaders' SVD by reconstruction. Runs on software Vulkan unless
//! `GRIDFALL_TEST_ADAPTER` names a device.

use rand::{Rng, SeedableRng, rngs::StdRng};

use super::buffers::Counts;
use super::layout::{self, PART_CHANNELS, Params, STATE_GROUP, place_of_state};
use super::scene::{SceneData, material};
use crate::gpu::device::test_gpu;
use crate::gpu::memory::{Memory, Scope};
use crate::gpu::program::{Dispatch, Workgroups};
use crate::gpu::{Gpu, Shader, Variant};
use gridfall_core::material::{Law, initial_plastic_state, samples};
use gridfall_core::maths::linalg::{Matrix, det, identity, mul, mul_transpose};
use gridfall_core::maths::svd::svd;
use gridfall_core::sim::setup::{Kernel, Material, Transfer};

/// One thread a state: return map, stress, and the SVD of the state as it came.
const ENTRY: &str = "// uses explicit/state_io

fn off_identity(m: mat3x3<f32>) -> f32 {
    let e = transpose(m) * m - mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    return max(max_entry(e[0]), max(max_entry(e[1]), max_entry(e[2])));
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.x;
    let n = params.particles;
    if (i >= n) {
        return;
    }
    let m = materials[body_of[i]];
    var principal: Principal;
    let trial = load_deformation(i, m.model);
    let state = deform(trial, m, mat3x3<f32>(), &principal);
    store_deformation(i, m.model, state);
    let stress = kirchhoff(state, principal, m, mat3x3<f32>());
    let s = svd3(trial.F);
    let again = diagonal_times(s.u, s.sigma, s.v);
    for (var c = 0u; c < 3u; c++) {
        for (var r = 0u; r < 3u; r++) {
            set_frame_motion(3u * c + r, i, stress.tau[c][r]);
            set_frame_state(3u * c + r, i, again[c][r]);
        }
    }
    set_frame_motion(9u, i, stress.stiffening);
    set_frame_motion(10u, i, max(off_identity(s.u), off_identity(s.v)));
    set_frame_motion(11u, i, determinant(s.u) * determinant(s.v));
}
";

pub(super) struct State {
    pub material: usize,
    pub f: Matrix<f64, 3>,
    pub plastic: f64,
}

/// The channels of a state that an entry point wrote.
pub(super) struct Written {
    states: usize,
    /// Those of `deformation_out`, `frame_velocity` and `frame_deformation`.
    pub deformation: Vec<f32>,
    pub velocity: Vec<f32>,
    pub frame_deformation: Vec<f32>,
}

impl Written {
    /// Channel k of a state.
    pub fn scalar(&self, values: &[f32], k: usize, state: usize) -> f64 {
        f64::from(values[k * self.states + state])
    }

    /// A matrix by columns from channel `first` on.
    pub fn matrix(&self, values: &[f32], first: usize, state: usize) -> Matrix<f64, 3> {
        std::array::from_fn(|r| std::array::from_fn(|c| self.scalar(values, first + 3 * c + r, state)))
    }
}

/// What the shaders made of a state.
struct Answer {
    f: Matrix<f64, 3>,
    plastic: f64,
    tau: Matrix<f64, 3>,
    stiffening: f64,
    reconstructed: Matrix<f64, 3>,
    off_orthogonality: f64,
    determinants: f64,
}

/// Runs a shader, one thread a state.
pub(super) fn run(gpu: &Gpu, materials: &[Material], states: &[State], text: &str) -> Written {
    let n = states.len();
    let one = 1;
    let bodies = vec![layout::Body::default()];
    let scene = SceneData { bodies, materials: materials.iter().map(material).collect(), ..SceneData::default() };
    let counts = Counts { particles: n, capacity: one, grids: one, channels: 10, touches: false, scene: scene.sizes() };
    let memory = Memory::new(gpu, &counts.sizes()).unwrap();
    // Both buffers have five channels, and lie one after the other here.
    let stored = PART_CHANNELS * n.next_multiple_of(STATE_GROUP);
    let mut deformation = vec![0.0f32; 2 * stored];
    let place = |k: usize, i: usize| {
        k / PART_CHANNELS * stored + place_of_state(i, PART_CHANNELS) + STATE_GROUP * (k % PART_CHANNELS)
    };
    for (i, state) in states.iter().enumerate() {
        if materials[state.material].is_fluid() {
            deformation[place(0, i)] = det(&state.f) as f32;
            continue;
        }
        for (r, c) in (0..3).flat_map(|r| (0..3).map(move |c| (r, c))) {
            deformation[place(3 * c + r, i)] = state.f[r][c] as f32;
        }
        deformation[place(9, i)] = state.plastic as f32;
    }
    let body_of: Vec<u32> = states.iter().map(|s| s.material as u32).collect();
    let params = Params { particles: n as u32, ..Params::default() };
    memory.write(gpu, "params", 0, &[params]);
    scene.write(gpu, &memory);
    memory.write(gpu, "body_of", 0, &body_of);
    memory.write(gpu, "deformation_in", 0, &deformation[..stored]);
    memory.write(gpu, "rest_in", 0, &deformation[stored..]);

    let variant = Variant::full(Kernel::Compact, Transfer::Mls);
    let shader = Shader::of_text("laws", text, variant, gpu.workgroup).unwrap_or_else(|e| panic!("{e}"));
    let dispatch = Dispatch::of(gpu, gpu.program("laws", shader), (), &Scope::of(&memory));
    gpu.pass(|pass| dispatch.record(pass, Workgroups::Folded(n.div_ceil(64))));
    gpu.check().unwrap();
    let read = |parts: &[(&str, usize)]| -> Vec<f32> {
        parts.iter().flat_map(|(name, channels)| memory.read::<f32>(gpu, name, channels * n).unwrap()).collect()
    };
    let after: Vec<f32> =
        ["deformation_out", "rest_out"].map(|name| memory.read::<f32>(gpu, name, stored).unwrap()).concat();
    let places = (0..10).flat_map(|k| (0..n).map(move |i| (k, i)));
    Written {
        states: n,
        deformation: places.map(|(k, i)| after[place(k, i)]).collect(),
        velocity: read(&layout::MOTION),
        frame_deformation: read(&counts.deformation()),
    }
}

fn ask(gpu: &Gpu, materials: &[Material], states: &[State]) -> Vec<Answer> {
    let w = run(gpu, materials, states, ENTRY);
    let answer = |i: usize| Answer {
        f: w.matrix(&w.deformation, 0, i),
        plastic: w.scalar(&w.deformation, 9, i),
        tau: w.matrix(&w.velocity, 0, i),
        stiffening: w.scalar(&w.velocity, 9, i),
        reconstructed: w.matrix(&w.frame_deformation, 0, i),
        off_orthogonality: w.scalar(&w.velocity, 10, i),
        determinants: w.scalar(&w.velocity, 11, i),
    };
    (0..states.len()).map(answer).collect()
}

pub(super) fn random_matrix(rng: &mut StdRng, size: f64) -> Matrix<f64, 3> {
    std::array::from_fn(|_| std::array::from_fn(|_| rng.random_range(-size..size)))
}

/// Rotations about stretches, some of them beyond every yield surface.
pub(super) fn random_states(rng: &mut StdRng, materials: &[Material], each: usize) -> Vec<State> {
    let mut states = Vec::new();
    for (index, material) in materials.iter().enumerate() {
        for _ in 0..each {
            let strain = [0.003, 0.03, 0.3][rng.random_range(0..3)];
            let mut stretch: Matrix<f64, 3> = identity();
            for i in 0..3 {
                stretch[i][i] += rng.random_range(-strain..strain);
            }
            let (u, v) = (svd(&random_matrix(rng, 1.0)).u, svd(&random_matrix(rng, 1.0)).u);
            let f = mul_transpose(&mul(&u, &stretch), &v);
            let plastic = match material {
                Material::DruckerPrager(_) | Material::MohrCoulomb(_) => {
                    rng.random_range(0.0..0.05f64) * f64::from(rng.random_range(0..2))
                }
                Material::Nacc(_) => rng.random_range(-0.1..0.02),
                Material::Snow(_) => rng.random_range(0.9..1.1),
                other => initial_plastic_state(other),
            };
            // What the shader gets is rounded.
            let f = f.map(|row| row.map(|x| f64::from(x as f32)));
            states.push(State { material: index, f, plastic: f64::from(plastic as f32) });
        }
    }
    states
}

pub(super) fn distance(a: &Matrix<f64, 3>, b: &Matrix<f64, 3>) -> f64 {
    a.iter().flatten().zip(b.iter().flatten()).fold(0.0, |m, (x, y)| {
        let d = (x - y).abs();
        if d > m || d.is_nan() { d } else { m }
    })
}

/// Largest differences over the states of each material: F, plastic state, τ over the stiffness at
/// the state, stiffening over its value.
fn differences(materials: &[Material], states: &[State], answers: &[Answer]) -> Vec<[f64; 4]> {
    let mut worst = vec![[0.0f64; 4]; materials.len()];
    for (state, answer) in states.iter().zip(answers) {
        let law = Law::<f64>::new(&materials[state.material]);
        let (mut f, mut plastic) = (state.f, state.plastic);
        law.return_map(&mut f, &mut plastic);
        let (tau, stiffening) = law.kirchhoff(&f, plastic);
        let at_rest = law.stiffness_at_rest();
        let fluid = materials[state.material].is_fluid();
        let found = [
            if fluid { 0.0 } else { distance(&f, &answer.f) },
            if materials[state.material].has_plastic_state() { (plastic - answer.plastic).abs() } else { 0.0 },
            distance(&tau, &answer.tau) / (at_rest * stiffening.max(1.0)),
            (stiffening - answer.stiffening).abs() / stiffening,
        ];
        for k in 0..4 {
            // NaN is as bad as it gets.
            worst[state.material][k] =
                if found[k].is_nan() { f64::INFINITY } else { worst[state.material][k].max(found[k]) };
        }
    }
    worst
}

/// f32 roundings of a decomposition. The deviator that NACC's surface allows has an infinite slope
/// at the tips, where a rounding of J comes back as a few of F; snow's stiffness has one of J_p ten
/// times over. The planted errors show that this is small enough.
const TOLERANCE: [f64; 4] = [1e-5, 3e-6, 1e-5, 3e-5];

#[test]
fn laws_agree_with_the_cpus() {
    let seed = 41;
    println!("seed {seed}");
    let gpu = test_gpu();
    let materials = samples();
    let states = random_states(&mut StdRng::seed_from_u64(seed), &materials, 2000);
    let answers = ask(&gpu, &materials, &states);
    for (material, worst) in materials.iter().zip(differences(&materials, &states, &answers)) {
        println!("{worst:?} {material:?}");
        assert!(worst.iter().zip(TOLERANCE).all(|(d, t)| *d <= t), "{worst:?} for {material:?}");
    }
    // Planted: every parameter of every law off by three thousandths must show, unless it is 0.
    for index in 0..materials.len() {
        let json = serde_json::to_value(&materials[index]).unwrap();
        for (name, value) in json
            .as_object()
            .unwrap()
            .iter()
            .filter(|(name, _)| !["density", "alpha0", "viscosity"].contains(&name.as_str()))
        {
            let Some(value) = value.as_f64().filter(|value| *value != 0.0) else { continue };
            let mut planted = json.clone();
            planted[name] = (value * 1.003).into();
            let mut wrong = materials.clone();
            wrong[index] = serde_json::from_value(planted).unwrap();
            let found = differences(&wrong, &states, &answers)[index];
            assert!(!found.iter().zip(TOLERANCE).all(|(d, t)| *d <= t), "{name} of {:?} is not noticed", wrong[index]);
        }
    }
}

#[test]
fn svd_of_every_kind_of_state() {
    let seed = 42;
    println!("seed {seed}");
    let rng = &mut StdRng::seed_from_u64(seed);
    let materials = samples();
    let solid = materials.iter().position(|m| matches!(m, Material::StvkHencky(_))).unwrap();
    let spectra =
        [[1.0, 1.0, 1.0], [1.5, 1.0, 0.7], [1.0, 1.0, -1.0], [2.0, 0.5, -0.1], [1.0, 1e-3, 1e-6], [1.0, 1.0, 0.0]];
    let more = [[1.0, 0.0, 0.0], [0.0; 3], [1e-20, 1e-20, 1e-20], [1e15, 1e14, -1e13], [1.0, 1.0 - 1e-7, 1.0 + 1e-7]];
    let mut states = Vec::new();
    for sigma in spectra.iter().chain(&more) {
        for _ in 0..200 {
            let mut stretch: Matrix<f64, 3> = [[0.0; 3]; 3];
            for i in 0..3 {
                stretch[i][i] = sigma[i];
            }
            let (u, v) = (svd(&random_matrix(rng, 1.0)).u, svd(&random_matrix(rng, 1.0)).u);
            states.push(State { material: solid, f: mul_transpose(&mul(&u, &stretch), &v), plastic: 0.0 });
        }
        states.push(State {
            material: solid,
            f: std::array::from_fn(|i| std::array::from_fn(|k| if i == k { sigma[i] } else { 0.0 })),
            plastic: 0.0,
        });
    }
    for (state, answer) in states.iter().zip(ask(&test_gpu(), &materials, &states)) {
        let f = state.f.map(|row| row.map(|x| f64::from(x as f32)));
        let size = f.iter().flatten().fold(0.0f64, |m, x| m.max(x.abs()));
        let error = distance(&f, &answer.reconstructed);
        assert!(error <= 4e-6 * size, "U diag(σ) Vᵀ misses {f:?} by {error:e}");
        assert!(
            answer.off_orthogonality < 4e-6,
            "U or V off orthogonality by {:e} for {f:?}",
            answer.off_orthogonality
        );
        assert!((answer.determinants - 1.0).abs() < 1e-5, "det U det V = {} for {f:?}", answer.determinants);
        let finite = answer.tau.iter().flatten().all(|t| t.is_finite()) && answer.stiffening.is_finite();
        assert!(finite, "τ = {:?} for {f:?}", answer.tau);
    }
}
