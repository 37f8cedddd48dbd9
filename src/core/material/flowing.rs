//! Laws that flow inside an implicit step.
//!
//! Where plasticity is lagged, a body in flow exerts its yield stress and the elastic stress of one
//! step's stretch: a viscosity of μ dt. Here the stress is instead the one that the step ends with:
//! P = τ F⁻ᵀ with F the trial deformation gradient and τ the Kirchhoff stress of the state that the
//! return map takes F and the plastic state to, hardening included. In principal space
//! P_i = τ_i/σ_i, σ_i of the trial state.
//!
//! * Below [`EXTENSION`], 1/σ_i and ln σ_i continue as in `derivatives.rs`. A fixed corotated law
//!   (von Mises, snow) does not flow in inverted states, where its own stress restores, of snow
//!   with the hardening of the returned state; between, the two stresses are mixed.
//! * The stress of flow that is not associated is the derivative of no energy. A solver then needs
//!   a line search without one. [`Law::flowing_derivative`] is the nearest useful symmetric tangent.

use super::derivatives::{EXTENSION, Elastic, extend, gradient, hessian};
use super::parameters::Elasticity;
use super::principal::{Principal, spectral};
use super::stiffness::{Projected, quotient, shear};
use super::{FixedCorotated, Law};
use crate::maths::linalg::{Matrix, Vector};
use crate::maths::real::Real;
use crate::maths::svd::{Svd, svd};

/// Smallest extended stretch, so that products and logarithms of such stretches exist in f32. It
/// belongs to σ = −1.7.
const LEAST_STRETCH: f64 = 1e-9;

impl<T: Real> Law<T> {
    /// P(F) (Pa) of a body that flows inside the step. `None` where the law forbids the state
    /// (neo-Hookean at J ≤ 0) or numbers overflow. Elastic laws: that of [`Self::energy_and_pk1`].
    ///
    /// # Panics
    /// For fluids.
    pub fn flowing_pk1<const D: usize>(&self, f: &Matrix<T, D>, plastic: T) -> Option<Matrix<T, D>> {
        if !self.is_plastic() {
            let (energy, pk1) = self.energy_and_pk1(f, plastic);
            return energy.is_finite().then_some(pk1);
        }
        let Svd { u, sigma, v } = svd(f);
        let flow = principal!(self, law => Flowing::new(law, &sigma, plastic), { _ => unreachable!("elastic") });
        let pk1 = spectral(&u, &flow.gradient(&sigma, &self.elastic(flow.plastic)), &v);
        pk1.as_flattened().iter().all(|x| x.is_finite()).then_some(pk1)
    }

    /// ∂P/∂F at F of a body that flows inside the step, symmetric positive semidefinite. The terms
    /// that turn the axes are exact. Those that stretch them are as exact as
    /// `Principal::returned_tangent`, symmetrised and with negative eigenvalues set to 0.
    ///
    /// # Panics
    /// For fluids.
    pub fn flowing_derivative<const D: usize>(&self, f: &Matrix<T, D>, plastic: T) -> Projected<T, D> {
        if !self.is_plastic() {
            return self.projected_derivative(f, plastic);
        }
        self.flowing_tangent(&svd(f), plastic).clamped()
    }

    /// ∂P/∂F of a plastic law, symmetric but not definite.
    pub(super) fn flowing_tangent<const D: usize>(&self, at: &Svd<T, D>, plastic: T) -> Projected<T, D> {
        let sigma = &at.sigma;
        let (flow, tangent) = principal!(self, law => {
            let flow = Flowing::new(law, sigma, plastic);
            (flow, law.returned_tangent(&flow.stretch, plastic))
        }, { _ => unreachable!("elastic") });
        let tangent = symmetric(&tangent);
        let axial = hessian(sigma, &flow.tau, &tangent);
        let across = |i, j| flow.shear(sigma, &tangent, i, j);
        let elastic = self.elastic(flow.plastic);
        let gradient = flow.gradient(sigma, &elastic);
        match corotated(&elastic) {
            None => Projected::with_shear(at, &gradient, axial, across),
            Some(law) => {
                let (share, law) = (share(sigma), law.derivatives(sigma));
                let mut mixed = axial;
                for i in 0..D {
                    for j in 0..D {
                        mixed[i][j] = mix(share, axial[i][j], law.hessian[i][j]);
                    }
                }
                let across = |i, j| mix(share, across(i, j), shear(sigma, &law, i, j));
                Projected::with_shear(at, &gradient, mixed, across)
            }
        }
    }

    /// Energy (J/m³) whose derivative is [`Self::flowing_pk1`], the elastic energy of the returned
    /// state and what flow has dissipated: ψ(ε') + τ' : (ε − ε'), which holds where the return is to
    /// the nearest state in the norm of the elastic energy. `None` where there is no such energy, or
    /// no finite one: flow that is not associated, grains that are apart, fixed corotated
    /// plasticity, NACC.
    ///
    /// # Panics
    /// For fluids.
    pub fn flowing_energy<const D: usize>(&self, f: &Matrix<T, D>, plastic: T) -> Option<T> {
        if !self.is_plastic() {
            return Some(self.energy_and_pk1(f, plastic).0).filter(|energy| energy.is_finite());
        }
        if !self.is_associated(D, plastic) {
            return None;
        }
        let sigma = svd(f).sigma;
        let energy = principal!(self, law => {
            let flow = Flowing::new(law, &sigma, plastic);
            let flown = (0..D).map(|i| flow.tau[i] * (flow.stretch[i] / flow.after[i]).ln()).sum::<T>();
            law.energy(&flow.after, plastic) + flown
        }, { _ => unreachable!("elastic") });
        energy.is_finite().then_some(energy)
    }

    /// Whether flow is along the normal of the yield surface, in the norm of a Hencky energy.
    fn is_associated(&self, dimension: usize, plastic: T) -> bool {
        let same = |friction: T, dilatancy: T| {
            plastic == T::ZERO && (friction - dilatancy).abs() <= T::from_i32(8) * T::EPSILON * friction
        };
        match self {
            Self::VonMises(law) => law.elasticity == Elasticity::Hencky,
            Self::MohrCoulomb(law) => same(law.sin_friction, law.sin_dilatancy),
            Self::DruckerPrager(law) => same(law.slopes(dimension).friction, law.slopes(dimension).dilatancy),
            _ => false,
        }
    }
}

/// A trial state and where it returns to.
#[derive(Clone, Copy)]
struct Flowing<T, const D: usize> {
    /// e^ε of the extended logarithmic strain ε.
    stretch: Vector<T, D>,
    /// Stretches and plastic state after the return map, with their Kirchhoff stress (Pa).
    after: Vector<T, D>,
    plastic: T,
    tau: Vector<T, D>,
}

impl<T: Real, const D: usize> Flowing<T, D> {
    fn new(law: &impl Principal<T>, sigma: &Vector<T, D>, plastic: T) -> Self {
        let stretch = sigma.map(|s| extend(s).0.max(T::from_f64(LEAST_STRETCH)));
        let (after, plastic) = law.return_map(&stretch, plastic).unwrap_or((stretch, plastic));
        Self { stretch, after, plastic, tau: law.kirchhoff(&after, plastic) }
    }

    /// P_i (Pa).
    fn gradient(&self, sigma: &Vector<T, D>, elastic: &Elastic<T>) -> Vector<T, D> {
        let flowing = gradient(sigma, &self.tau);
        corotated(elastic).map_or(flowing, |law| {
            let (share, trial) = (share(sigma), law.derivatives(sigma).gradient);
            std::array::from_fn(|i| mix(share, flowing[i], trial[i]))
        })
    }

    /// (P_i − P_j)/(σ_i − σ_j) (Pa) with P_i = τ_i ε′_i, in terms that keep their digits near equal
    /// stretches. A strain that flows is often so small that σ_i − σ_j is only rounding in f32,
    /// while τ has a kink within it. So the quotient of τ is by strains, wherever these differ.
    fn shear(&self, sigma: &Vector<T, D>, tangent: &Matrix<T, D>, i: usize, j: usize) -> T {
        let (a, b) = (sigma[i], sigma[j]);
        let ((_, a_slope, a_curvature), (_, b_slope, b_curvature)) = (extend(a), extend(b));
        let [a_strain, b_strain] = [i, j].map(|k| self.stretch[k].ln());
        let difference = a_strain - b_strain;
        // Strains come from stretches, and so have the rounding errors of 1.
        let least = T::EPSILON.sqrt() * (a_strain.abs() + b_strain.abs()) + T::from_i32(8) * T::EPSILON;
        let modulus = if difference.abs() > least {
            (self.tau[i] - self.tau[j]) / difference
        } else {
            T::HALF * (tangent[i][i] + tangent[j][j]) - tangent[i][j]
        };
        let slope = T::HALF * (a_slope + b_slope);
        let strain = quotient(a, b, difference, || slope);
        let bend = quotient(a, b, a_slope - b_slope, || T::HALF * (a_curvature + b_curvature));
        modulus * strain * slope + T::HALF * (self.tau[i] + self.tau[j]) * bend
    }
}

fn symmetric<T: Real, const D: usize>(m: &Matrix<T, D>) -> Matrix<T, D> {
    std::array::from_fn(|i| std::array::from_fn(|j| T::HALF * (m[i][j] + m[j][i])))
}

/// The law whose own stress replaces that of flow in inverted states.
fn corotated<T>(elastic: &Elastic<T>) -> Option<&FixedCorotated<T>> {
    if let Elastic::FixedCorotated(law) = elastic { Some(law) } else { None }
}

/// By how much such a state flows: from 0 where it is flat to 1 where no stretch is extended.
fn share<T: Real, const D: usize>(sigma: &Vector<T, D>) -> T {
    let least = sigma.iter().copied().fold(T::from_f64(EXTENSION), T::min);
    (least / T::from_f64(EXTENSION)).max(T::ZERO)
}

/// share a + (1 − share) b.
fn mix<T: Real>(share: T, a: T, b: T) -> T {
    b + share * (a - b)
}
