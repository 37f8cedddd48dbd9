//! Return maps and stresses of the laws in principal space: one decomposition F = U Σ Vᵀ a particle
//! and step serves both.
//!
//! In: trial states of a chunk's particles, after F's update. Out: states on or inside the yield
//! surface, and τ there. One thread a block.

use super::chunk::{Chunk, LANES, Lanes, MatrixLanes, State, matrix, set_matrix, vector};
use gridfall_core::material::{Law, Principal};
use gridfall_core::maths::linalg::det;
use gridfall_core::maths::real::Real;
use gridfall_core::maths::svd::{Svd, svd};
use gridfall_core::maths::widest::widest;

/// F = U Σ Vᵀ of a chunk's particles; the order of the singular values means nothing here.
struct Spectra<T, const D: usize> {
    u: MatrixLanes<T, D>,
    sigma: [Lanes<T>; D],
    v: MatrixLanes<T, D>,
}

/// Sweeps after which a particle is left to the scalar decomposition.
const SWEEPS: usize = 8;

/// The fast path takes F with singular values within this ratio: below it, a column's direction loses digits.
const FLAT: f64 = 1e-2;

widest! {
    /// Moves the particles of a chunk back to their yield surfaces; `tau` becomes their Kirchhoff
    /// stress (Pa). Returns the largest ratio of a particle's stiffness to that at rest. The
    /// chunk's law must work in principal space.
    pub fn flow[T: Real, const D: usize][T, D](
        law: &Law<T>,
        chunk: &mut Chunk<T, D>,
        tau: &mut MatrixLanes<T, D>,
    ) -> T {
        let State::Solid { f: deformation, plastic, .. } = &mut chunk.state else {
            unreachable!("fluids do not flow in principal space");
        };
        let mut spectra = decompose(deformation);
        repair(deformation, chunk.count, &mut spectra);
        let Spectra { u, mut sigma, v } = spectra;
        let mut stress = sigma;
        let mut moved = [false; LANES];
        let mut stiffness = [T::ZERO; LANES];
        // A law of its own loop, where it vectorises.
        match law {
            Law::DruckerPrager(law) => {
                for l in 0..LANES {
                    let flow = law.flow(&vector(&sigma, l), plastic[l]);
                    for k in 0..D {
                        (sigma[k][l], stress[k][l]) = (flow.sigma[k], flow.tau[k]);
                    }
                    (moved[l], plastic[l], stiffness[l]) = (flow.moved, flow.plastic, flow.stiffness);
                }
            }
            _ => {
                for l in 0..chunk.count {
                    let flow = law.flow_principal(&vector(&sigma, l), plastic[l]).expect("a law in principal space");
                    for k in 0..D {
                        (sigma[k][l], stress[k][l]) = (flow.sigma[k], flow.tau[k]);
                    }
                    (moved[l], plastic[l], stiffness[l]) = (flow.moved, flow.plastic, flow.stiffness);
                }
            }
        }
        let most = stiffness[..chunk.count].iter().copied().fold(T::ZERO, T::max);
        for i in 0..D {
            for j in 0..D {
                for l in 0..LANES {
                    let mut f = T::ZERO;
                    for k in 0..D {
                        f += u[i][k][l] * sigma[k][l] * v[j][k][l];
                    }
                    deformation[i][j][l] = if moved[l] { f } else { deformation[i][j][l] };
                }
            }
        }
        assemble(&u, &stress, tau);
        most / law.stiffness_at_rest()
    }
}

/// Kirchhoff stress τ (Pa) of particles whose law works in principal space, where nothing flows. Returns each one's
/// stiffness ρ0 c² (Pa).
#[inline(always)]
pub fn stress<T: Real, const D: usize>(
    law: &Law<T>,
    f: &MatrixLanes<T, D>,
    plastic: &Lanes<T>,
    count: usize,
    tau: &mut MatrixLanes<T, D>,
) -> Lanes<T> {
    let mut spectra = decompose(f);
    repair(f, count, &mut spectra);
    let (mut stress, mut stiffness) = (spectra.sigma, [T::ZERO; LANES]);
    for l in 0..count {
        let (principal, bound) =
            law.principal_stress(&vector(&spectra.sigma, l), plastic[l]).expect("a law in principal space");
        for k in 0..D {
            stress[k][l] = principal[k];
        }
        stiffness[l] = bound;
    }
    assemble(&spectra.u, &stress, tau);
    stiffness
}

/// U diag(stress) Uᵀ.
#[inline(always)]
fn assemble<T: Real, const D: usize>(u: &MatrixLanes<T, D>, stress: &[Lanes<T>; D], tau: &mut MatrixLanes<T, D>) {
    for i in 0..D {
        for j in 0..D {
            for l in 0..LANES {
                let mut t = T::ZERO;
                for k in 0..D {
                    t += u[i][k][l] * stress[k][l] * u[j][k][l];
                }
                tau[i][j][l] = t;
            }
        }
    }
}

/// One-sided Jacobi (see [`svd`]) in step, so that the loops over lanes are vectorised. Right for F
/// with det F > 0 that are not flat.
#[inline(always)]
fn decompose<T: Real, const D: usize>(f: &MatrixLanes<T, D>) -> Spectra<T, D> {
    let mut c = *f;
    let mut v = [[[T::ZERO; LANES]; D]; D];
    for k in 0..D {
        v[k][k] = [T::ONE; LANES];
    }
    for _ in 0..SWEEPS {
        let mut rotated = [false; LANES];
        for p in 0..D - 1 {
            for q in p + 1..D {
                for l in 0..LANES {
                    let (mut alpha, mut beta, mut gamma) = (T::ZERO, T::ZERO, T::ZERO);
                    for i in 0..D {
                        alpha += c[i][p][l] * c[i][p][l];
                        beta += c[i][q][l] * c[i][q][l];
                        gamma += c[i][p][l] * c[i][q][l];
                    }
                    rotated[l] |= gamma * gamma >= T::EPSILON * (alpha * beta);
                    let delta = beta - alpha;
                    let denominator = delta.abs() + (delta * delta + T::TWO * T::TWO * gamma * gamma).sqrt() + T::TINY;
                    let t = T::TWO * gamma.copysign(gamma * delta) / denominator;
                    let cos = T::ONE / (T::ONE + t * t).sqrt();
                    let sin = t * cos;
                    for i in 0..D {
                        let (a, b) = (c[i][p][l], c[i][q][l]);
                        (c[i][p][l], c[i][q][l]) = (cos * a - sin * b, sin * a + cos * b);
                        let (a, b) = (v[i][p][l], v[i][q][l]);
                        (v[i][p][l], v[i][q][l]) = (cos * a - sin * b, sin * a + cos * b);
                    }
                }
            }
        }
        // Convergence is quadratic: what is left of an angle after a sweep is about its square.
        if !rotated.contains(&true) {
            break;
        }
    }
    let mut sigma = [[T::ZERO; LANES]; D];
    for k in 0..D {
        for l in 0..LANES {
            let mut square = T::ZERO;
            for i in 0..D {
                square += c[i][k][l] * c[i][k][l];
            }
            sigma[k][l] = square.sqrt();
            let inverse = T::ONE / sigma[k][l];
            for i in 0..D {
                c[i][k][l] *= inverse;
            }
        }
    }
    Spectra { u: c, sigma, v }
}

/// Decomposes anew the particles for which [`decompose`] is not made.
#[inline(always)]
fn repair<T: Real, const D: usize>(f: &MatrixLanes<T, D>, count: usize, spectra: &mut Spectra<T, D>) {
    for l in 0..count {
        let (mut least, mut most) = (spectra.sigma[0][l], spectra.sigma[0][l]);
        for k in 1..D {
            least = least.min(spectra.sigma[k][l]);
            most = most.max(spectra.sigma[k][l]);
        }
        let f = matrix(f, l);
        // NaN fails the comparison, too.
        if !(det(&f) > T::ZERO && least > T::from_f64(FLAT) * most) {
            replace(spectra, l, &svd(&f));
        }
    }
}

#[cold]
#[inline(never)]
fn replace<T: Real, const D: usize>(spectra: &mut Spectra<T, D>, l: usize, svd: &Svd<T, D>) {
    set_matrix(&mut spectra.u, l, &svd.u);
    set_matrix(&mut spectra.v, l, &svd.v);
    for k in 0..D {
        spectra.sigma[k][l] = svd.sigma[k];
    }
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng, rngs::StdRng};

    use super::super::chunk::Kind;
    use super::*;
    use gridfall_core::material::samples;
    use gridfall_core::maths::linalg::Matrix;

    /// Chunks of random, flat and inverted states against the law a particle at a time.
    fn check<const D: usize>(rng: &mut StdRng) {
        for material in samples() {
            let law = Law::<f64>::new(&material);
            if !law.is_principal() {
                continue;
            }
            for round in 0..40 {
                let mut chunk = Chunk::<f64, D>::empty(0, Kind::Solid, None);
                chunk.count = 1 + round % LANES;
                let State::Solid { f: lanes, plastic, .. } = &mut chunk.state else { unreachable!() };
                for l in 0..chunk.count {
                    let size = [0.0, 0.02, 0.3, 1.5][rng.random_range(0..4)];
                    for i in 0..D {
                        for k in 0..D {
                            lanes[i][k][l] = f64::from(u8::from(i == k)) + rng.random_range(-1.0..1.0) * size;
                        }
                    }
                    plastic[l] = gridfall_core::material::initial_plastic_state(&material);
                }
                let (before, plastic_before) = (*lanes, *plastic);
                let mut tau = before;
                let most = flow(&law, &mut chunk, &mut tau);
                let State::Solid { f: lanes, plastic: plastic_after, .. } = &chunk.state else { unreachable!() };
                let mut expected_most = 0.0f64;
                for l in 0..chunk.count {
                    let (mut f, mut plastic): (Matrix<f64, D>, f64) = (matrix(&before, l), plastic_before[l]);
                    law.return_map(&mut f, &mut plastic);
                    let (expected, stiffening) = law.kirchhoff(&f, plastic);
                    expected_most = expected_most.max(stiffening);
                    let modulus = law.stiffness_at_rest() * stiffening.max(1.0);
                    for i in 0..D {
                        for k in 0..D {
                            assert!((lanes[i][k][l] - f[i][k]).abs() < 1e-11, "{material:?}: F = {f:?}");
                            assert!((tau[i][k][l] - expected[i][k]).abs() < 1e-10 * modulus, "{material:?}: F = {f:?}");
                        }
                    }
                    assert!((plastic_after[l] - plastic).abs() < 1e-11, "{material:?}: {plastic} at F = {f:?}");
                }
                assert!((most / expected_most - 1.0).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn chunks_flow_as_their_particles_do() {
        let seed = 51;
        println!("seed {seed}");
        let rng = &mut StdRng::seed_from_u64(seed);
        check::<2>(rng);
        check::<3>(rng);
    }
}
