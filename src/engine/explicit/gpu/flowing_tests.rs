//! The shaders' stresses and tangents of laws that flow within an implicit step against those of
//! `gridfall_core::material`, on random states at strains of every size, flat and inverted ones too.

use rand::{Rng, SeedableRng, rngs::StdRng};

use super::law_tests::{State, distance, random_matrix, run};
use crate::gpu::Gpu;
use crate::gpu::device::test_gpu;
use gridfall_core::material::{Law, initial_plastic_state, samples};
use gridfall_core::maths::linalg::{Matrix, add_scaled, identity, mul, mul_transpose, scaled_identity};
use gridfall_core::maths::svd::{polar_rotation, svd};
use gridfall_core::sim::setup::Material;

/// ψ, P, and the derivative along one entry of F.
const ENTRY: &str = "// uses explicit/state_io, implicit/flowing_tangent

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
    set_frame_motion(9u, i, energy_pk1(m, state.F, state.q, true, &P));
    let s = fine_svd(state.F);
    var dF: mat3x3<f32>;
    dF[i % 3u][(i / 3u) % 3u] = 1.0;
    let dP = projected_times(projected(s, slopes_within(m, s.sigma, state.q, true)), dF);
    for (var c = 0u; c < 3u; c++) {
        for (var r = 0u; r < 3u; r++) {
            set_frame_motion(3u * c + r, i, P[c][r]);
            set_frame_state(3u * c + r, i, dP[c][r]);
        }
    }
}
";

/// A few roundings of F and of its decomposition.
const ROUNDING: f64 = 3e-7;
/// Largest differences over the stiffness: of P, which at strains that bodies have is [`FINE`], and of dP, in which
/// quotients of strains that differ by little have lost digits.
const TOLERANCE: [f64; 2] = [4e-6, 1e-4];
const FINE: f64 = 5e-7;

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

/// P, and dP along the entry of F that the shader takes at this index.
fn expected(law: &Law<f64>, f: &Matrix<f64, 3>, plastic: f64, index: usize) -> [Matrix<f64, 3>; 2] {
    let mut df = [[0.0; 3]; 3];
    df[index / 3 % 3][index % 3] = 1.0;
    [law.flowing_pk1(f, plastic).unwrap(), law.flowing_derivative(f, plastic).times(&df)]
}

/// Largest |entry|.
fn size(m: &Matrix<f64, 3>) -> f64 {
    m.iter().flatten().fold(0.0, |most, x| most.max(x.abs()))
}

/// What a material's states show.
#[derive(Clone, Copy, Default)]
struct Found {
    /// Largest differences of P, and of dP over the stiffness without states at a kink.
    worst: [f64; 2],
    /// States, those that flow, and those at which the reference's dP changes with a rounding of F: beside a kink of
    /// the yield surface.
    states: usize,
    flown: usize,
    kinks: usize,
}

impl std::fmt::Debug for Found {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { worst: [pk1, dp], states, flown, kinks } = self;
        write!(f, "P {pk1:.1e}, dP {dp:.1e}, {flown} of {states} flow, {kinks} beside kinks")
    }
}

impl Found {
    fn agrees(&self) -> bool {
        self.worst.iter().zip(TOLERANCE).all(|(d, t)| *d <= t)
    }
}

fn compare(materials: &[Material], states: &[State], answers: &[Answer]) -> Vec<Found> {
    let mut all = vec![Found::default(); materials.len()];
    let rng = &mut StdRng::seed_from_u64(1);
    for (index, (state, answer)) in states.iter().zip(answers).enumerate() {
        let law = Law::<f64>::new(&materials[state.material]);
        let found = &mut all[state.material];
        let [pk1, dp] = expected(&law, &state.f, state.plastic, index);
        let unit = law.stiffness_at_rest().max(size(&pk1)).max(size(&dp));
        let spread = (0..8).fold(0.0f64, |most, _| {
            let near = add_scaled(&state.f, ROUNDING * size(&state.f), &random_matrix(rng, 1.0));
            most.max(distance(&expected(&law, &near, state.plastic, index)[1], &dp) / unit)
        });
        let (mut after, mut plastic) = (state.f, state.plastic);
        law.return_map(&mut after, &mut plastic);
        found.states += 1;
        found.flown += usize::from(after != state.f);
        let larger = |worst: &mut f64, difference: f64| {
            // NaN is as bad as it gets.
            *worst = if difference.is_nan() { f64::INFINITY } else { worst.max(difference) };
        };
        larger(&mut found.worst[0], distance(&pk1, &answer.pk1) / unit);
        larger(&mut found.worst[0], answer.energy);
        if spread > TOLERANCE[1] {
            found.kinks += 1;
            let bounded = answer.dp.as_flattened().iter().all(|x| x.abs() < 10.0 * unit);
            assert!(bounded, "dP = {:?} at {:?}", answer.dp, state.f);
        } else {
            larger(&mut found.worst[1], distance(&dp, &answer.dp) / unit);
        }
    }
    all
}

fn plastic_laws() -> Vec<Material> {
    samples().into_iter().filter(|m| Law::<f64>::new(m).is_plastic()).collect()
}

/// A plastic state that a material may have: grains that touch and that are apart, clay and snow
/// before and after hardening.
fn plastic_state(rng: &mut StdRng, material: &Material) -> f64 {
    let state = match material {
        Material::DruckerPrager(_) | Material::MohrCoulomb(_) => {
            rng.random_range(0.0..0.05f64) * f64::from(rng.random_range(0..2))
        }
        Material::Nacc(_) => rng.random_range(-0.1..0.02),
        Material::Snow(_) => rng.random_range(0.9..1.1),
        other => initial_plastic_state(other),
    };
    f64::from(state as f32)
}

/// States turned at random at strains of a size, half of them compressed, more or less evenly.
fn states_of(rng: &mut StdRng, materials: &[Material], strain: f64, each: usize) -> Vec<State> {
    let mut states = Vec::new();
    for (index, material) in materials.iter().enumerate() {
        for _ in 0..each {
            let stretch = if rng.random() {
                add_scaled(&identity(), strain, &random_matrix(rng, 1.0))
            } else {
                let uneven = strain * rng.random_range(0.0f64..1.0).powi(2);
                add_scaled(&scaled_identity(1.0 - strain), uneven, &random_matrix(rng, 1.0))
            };
            let f = mul(&svd(&random_matrix(rng, 1.0)).u, &stretch).map(|row| row.map(|x| f64::from(x as f32)));
            states.push(State { material: index, f, plastic: plastic_state(rng, material) });
        }
    }
    states
}

#[test]
fn stresses_and_tangents_of_flow_agree_with_the_cpus() {
    let seed = 45;
    println!("seed {seed}");
    let (gpu, rng) = (test_gpu(), &mut StdRng::seed_from_u64(seed));
    let materials = plastic_laws();
    for strain in [1e-6, 1e-5, 1e-4, 1e-3, 0.01, 0.05, 0.2] {
        let states = states_of(rng, &materials, strain, 500);
        let answers = ask(&gpu, &materials, &states);
        for (material, found) in materials.iter().zip(compare(&materials, &states, &answers)) {
            println!("strain {strain:.0e}: {found:?} {material:?}");
            let fine = strain > 0.05 || found.worst[0] <= FINE;
            assert!(found.agrees() && fine && 4 * found.kinks < found.states, "{found:?} for {material:?}");
        }
    }
    // Planted: every parameter that matters to a step, off by three thousandths, must show.
    let mut states = states_of(rng, &materials, 0.02, 500);
    states.extend(states_of(rng, &materials, 0.1, 500));
    let answers = ask(&gpu, &materials, &states);
    for (material, found) in materials.iter().zip(compare(&materials, &states, &answers)) {
        assert!(found.agrees() && found.flown > 200, "{found:?} for {material:?}");
    }
    for index in 0..materials.len() {
        let json = serde_json::to_value(&materials[index]).unwrap();
        let own = |name: &str| !["density", "alpha0"].contains(&name);
        for (name, value) in json.as_object().unwrap().iter().filter(|(name, _)| own(name)) {
            let Some(value) = value.as_f64().filter(|value| *value != 0.0) else { continue };
            let mut planted = json.clone();
            planted[name] = (value * 1.003).into();
            let mut wrong = materials.clone();
            wrong[index] = serde_json::from_value(planted).unwrap();
            let found = compare(&wrong, &states, &answers)[index];
            assert!(!found.agrees(), "{name} of {:?} is not noticed", wrong[index]);
        }
    }
}

#[test]
fn trial_states_of_every_kind_agree() {
    let seed = 46;
    println!("seed {seed}");
    let rng = &mut StdRng::seed_from_u64(seed);
    let materials = plastic_laws();
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
        [1.0, 0.9, -3.0],
    ];
    let mut states = Vec::new();
    for (material, law) in materials.iter().enumerate() {
        for sigma in &spectra {
            for _ in 0..50 {
                let mut stretch: Matrix<f64, 3> = [[0.0; 3]; 3];
                (0..3).for_each(|i| stretch[i][i] = sigma[i]);
                let (u, v) = (svd(&random_matrix(rng, 1.0)).u, svd(&random_matrix(rng, 1.0)).u);
                let f = mul_transpose(&mul(&u, &stretch), &v).map(|row| row.map(|x| f64::from(x as f32)));
                states.push(State { material, f, plastic: initial_plastic_state(law) });
            }
        }
    }
    let answers = ask(&test_gpu(), &materials, &states);
    for (material, found) in materials.iter().zip(compare(&materials, &states, &answers)) {
        println!("{found:?} {material:?}");
        assert!(found.agrees() && found.flown > 200, "{found:?} for {material:?}");
    }
}

/// Polar rotations, from which Newton's matrices take how particles have turned.
const POLAR: &str = "// uses explicit/state_io

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.x;
    let n = params.particles;
    if (i >= n) {
        return;
    }
    let R = polar_rotation(load_deformation(i, STVK_HENCKY).F);
    for (var c = 0u; c < 3u; c++) {
        for (var r = 0u; r < 3u; r++) {
            set_frame_motion(3u * c + r, i, R[c][r]);
        }
    }
}
";

#[test]
fn polar_rotations_hold() {
    let seed = 47;
    println!("seed {seed}");
    let (gpu, rng) = (test_gpu(), &mut StdRng::seed_from_u64(seed));
    let materials: Vec<_> = samples().into_iter().filter(|m| matches!(m, Material::StvkHencky(_))).collect();
    for strain in [0.0, 1e-6, 1e-4, 0.01, 0.3, 0.8] {
        let states = states_of(rng, &materials, strain, 2000);
        let w = run(&gpu, &materials, &states, POLAR);
        let (mut worst, mut skew) = (0.0f64, 0.0f64);
        for (i, state) in states.iter().enumerate() {
            let found = w.matrix(&w.velocity, 0, i);
            skew = skew.max(distance(&mul_transpose(&found, &found), &identity()));
            let sigma = svd(&state.f).sigma;
            // An angle is as good as F over the sum of the two stretches across it.
            let condition = (sigma[1] + sigma[2]) / sigma[0];
            worst = worst.max(distance(&polar_rotation(&state.f), &found) * condition);
        }
        println!("strain {strain:.0e}: R off by {worst:.1e}, RᵀR by {skew:.1e}");
        assert!(worst < 2e-6 && skew < 2e-6, "{worst:e} {skew:e}");
    }
}
