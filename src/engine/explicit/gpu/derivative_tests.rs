//! The shaders' energies, stresses and projected stiffnesses of the implicit step against those of
//! `gridfall_core::material`, on random, rotated, flat and inverted states.

use rand::{SeedableRng, rngs::StdRng};

use super::law_tests::{State, distance, random_matrix, random_states, run};
use crate::gpu::Gpu;
use crate::gpu::device::test_gpu;
use gridfall_core::material::{Law, initial_plastic_state, samples};
use gridfall_core::maths::linalg::{Matrix, mul, mul_transpose};
use gridfall_core::maths::svd::svd;
use gridfall_core::sim::setup::Material;

/// ψ, P, and the derivative along one entry of F.
const ENTRY: &str = "// uses explicit/state_io, implicit/derivatives

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.x;
    let n = params.particles;
    if (i >= n) {
        return;
    }
    let m = materials[body_of[i]];
    let state = load_deformation(i, m.model);
    var P: mat3x3<f32>;
    set_frame_motion(9u, i, elastic_energy_pk1(m, state.F, state.q, &P));
    let s = fine_svd(state.F);
    var dF: mat3x3<f32>;
    dF[i % 3u][(i / 3u) % 3u] = 1.0;
    let dP = projected_times(projected(s, elastic_slopes(m, s.sigma, state.q)), dF);
    for (var c = 0u; c < 3u; c++) {
        for (var r = 0u; r < 3u; r++) {
            set_frame_motion(3u * c + r, i, P[c][r]);
            set_frame_state(3u * c + r, i, dP[c][r]);
        }
    }
}
";

struct Answer {
    energy: f64,
    pk1: Matrix<f64, 3>,
    dp: Matrix<f64, 3>,
}

fn ask(gpu: &Gpu, materials: &[Material], states: &[State]) -> Vec<Answer> {
    let w = run(gpu, materials, states, ENTRY);
    let answer = |i: usize| Answer {
        energy: w.scalar(&w.velocity, 9, i),
        pk1: w.matrix(&w.velocity, 0, i),
        dp: w.matrix(&w.frame_deformation, 0, i),
    };
    (0..states.len()).map(answer).collect()
}

fn expected(law: &Law<f64>, state: &State, index: usize) -> Answer {
    let (energy, pk1) = law.energy_and_pk1(&state.f, state.plastic);
    let mut df = [[0.0; 3]; 3];
    df[index / 3 % 3][index % 3] = 1.0;
    Answer { energy, pk1, dp: law.projected_derivative(&state.f, state.plastic).times(&df) }
}

/// Largest differences over the states of each material. ψ: over what a change of F by 1 would make
/// of it, √(ψ (λ + 2μ)); P and dP over the largest stiffness at the state.
fn differences(materials: &[Material], states: &[State], answers: &[Answer]) -> Vec<[f64; 3]> {
    let mut worst = vec![[0.0f64; 3]; materials.len()];
    for (index, (state, answer)) in states.iter().zip(answers).enumerate() {
        let law = Law::<f64>::new(&materials[state.material]);
        let expected = expected(&law, state, index);
        let at_rest = law.stiffness_at_rest();
        let hessian = law.derivatives(&svd(&state.f).sigma, state.plastic).hessian;
        let stiffness = hessian.as_flattened().iter().fold(at_rest, |m, h| m.max(h.abs()));
        let found = [
            (expected.energy - answer.energy).abs() / (expected.energy * stiffness).sqrt(),
            distance(&expected.pk1, &answer.pk1) / stiffness,
            distance(&expected.dp, &answer.dp) / stiffness,
        ];
        for (worst, found) in worst[state.material].iter_mut().zip(found) {
            // NaN is as bad as it gets.
            *worst = if found.is_nan() { f64::INFINITY } else { worst.max(found) };
        }
    }
    worst
}

/// f32 roundings of a decomposition; a quotient of differences at nearly equal stretches has a few
/// more.
const TOLERANCE: [f64; 3] = [3e-6, 3e-6, 5e-5];

fn solids() -> Vec<Material> {
    samples().into_iter().filter(|m| !m.is_fluid()).collect()
}

#[test]
fn energies_stresses_and_stiffnesses_agree_with_the_cpus() {
    let seed = 43;
    println!("seed {seed}");
    let gpu = test_gpu();
    let materials = solids();
    let states = random_states(&mut StdRng::seed_from_u64(seed), &materials, 2000);
    let answers = ask(&gpu, &materials, &states);
    for (material, worst) in materials.iter().zip(differences(&materials, &states, &answers)) {
        println!("{worst:?} {material:?}");
        assert!(worst.iter().zip(TOLERANCE).all(|(d, t)| *d <= t), "{worst:?} for {material:?}");
    }
    // Planted: elastic moduli, and snow's hardening, off by three thousandths must show in each of
    // the three.
    for index in 0..materials.len() {
        let json = serde_json::to_value(&materials[index]).unwrap();
        for name in ["youngs_modulus", "poissons_ratio", "hardening"] {
            let Some(value) = json[name].as_f64() else { continue };
            let mut planted = json.clone();
            planted[name] = (value * 1.003).into();
            let mut wrong = materials.clone();
            wrong[index] = serde_json::from_value(planted).unwrap();
            let found = differences(&wrong, &states, &answers)[index];
            assert!(found.iter().zip(TOLERANCE).all(|(d, t)| *d > t), "{name} of {:?}: only {found:?}", wrong[index]);
        }
    }
}

#[test]
fn trial_states_of_every_kind_agree() {
    let seed = 44;
    println!("seed {seed}");
    let rng = &mut StdRng::seed_from_u64(seed);
    let materials = solids();
    let spectra = [
        [1.0, 1.0, 1.0],
        [1.2, 1.2, 0.7],
        [1.2, 1.199, 0.7],
        [3.0, 1.1, 0.4],
        [0.6, 0.3, 0.2],
        [0.9, 0.12, 0.08],
        [1.2, 0.9, 0.0],
        [1.1, 0.5, 0.02],
        [1.2, 0.9, -0.5],
        [0.7, 0.4, -0.02],
    ];
    let mut states = Vec::new();
    for (material, law) in materials.iter().enumerate() {
        for sigma in spectra.iter().filter(|s| s[2] > 0.0 || !matches!(law, Material::NeoHookean(_))) {
            for _ in 0..50 {
                let mut stretch: Matrix<f64, 3> = [[0.0; 3]; 3];
                for i in 0..3 {
                    stretch[i][i] = sigma[i];
                }
                let (u, v) = (svd(&random_matrix(rng, 1.0)).u, svd(&random_matrix(rng, 1.0)).u);
                let f = mul_transpose(&mul(&u, &stretch), &v).map(|row| row.map(|x| f64::from(x as f32)));
                states.push(State { material, f, plastic: initial_plastic_state(law) });
            }
        }
    }
    let gpu = test_gpu();
    let answers = ask(&gpu, &materials, &states);
    for (material, worst) in materials.iter().zip(differences(&materials, &states, &answers)) {
        println!("{worst:?} {material:?}");
        // At rest there is no energy to compare with: what there is may be nothing but rounding.
        assert!(worst[1..].iter().zip(&TOLERANCE[1..]).all(|(d, t)| *d <= *t), "{worst:?} for {material:?}");
    }
    let rubber = materials.iter().position(|m| matches!(m, Material::NeoHookean(_))).unwrap();
    let inverted = [0.5, -0.5].map(|s| State {
        material: rubber,
        f: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, s]],
        plastic: 0.0,
    });
    let answers = ask(&gpu, &materials, &inverted);
    assert!(answers[0].energy < 1e6 && answers[1].energy > 1e38, "{} {}", answers[0].energy, answers[1].energy);
}
