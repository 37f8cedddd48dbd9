//! Particle storage: structures of arrays of a fixed number of lanes, so that arithmetic on
//! particles is vectorised and a block's particles are contiguous.

use super::near::Starts;
use super::tile::index;
use gridfall_core::maths::linalg::{Matrix, Vector, apply};
use gridfall_core::maths::real::Real;
use gridfall_core::sim::kernel::{ShapeFunction, times_inverse_diagonal};
use gridfall_core::sim::touch::Touch;

/// Particles of a chunk.
pub const LANES: usize = 16;

/// One value a particle.
pub type Lanes<T> = [T; LANES];

/// Up to [`LANES`] particles of one body in one block. Lanes beyond `count` hold a particle at rest, so that arithmetic
/// on them is harmless.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub struct Chunk<T, const D: usize> {
    /// Position in units of dx from the block's node 0: small numbers, so that f32 resolves slow
    /// motion in large domains.
    pub x: [Lanes<T>; D],
    pub v: [Lanes<T>; D],
    /// B = ½ Σ_s Σ_i w v_i (x_i − x_p)ᵀ / dx (m/s).
    pub b: [[Lanes<T>; D]; D],
    pub state: State<T, D>,
    /// What the particles remember of contact, where colliders act on particles.
    pub touch: Option<Box<Lanes<Touch>>>,
    /// Index in sampling order.
    pub id: Lanes<u32>,
    pub count: usize,
    pub body: u32,
}

/// What the law of a chunk's body knows of its particles' deformation.
#[derive(Clone, Debug)]
pub enum State<T, const D: usize> {
    Solid {
        /// Deformation gradient.
        f: MatrixLanes<T, D>,
        /// Plastic state of the laws that have one, else 0.
        plastic: Lanes<T>,
        /// ∇v (1/s) of the last G2P, where damping acts with it.
        grad_v: Option<Box<MatrixLanes<T, D>>>,
    },
    Fluid {
        /// Volume ratio.
        j: Lanes<T>,
        /// ∇v (1/s) of the last G2P, where viscosity acts with it.
        grad_v: Option<Box<MatrixLanes<T, D>>>,
    },
}

/// What of [`State`] a body's law needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Fluid,
    Viscous,
    Solid,
    Damped,
}

impl<T: Real, const D: usize> State<T, D> {
    /// At rest.
    pub fn rest(kind: Kind) -> Self {
        let zero = [[[T::ZERO; LANES]; D]; D];
        let grad_v = matches!(kind, Kind::Viscous | Kind::Damped).then(|| Box::new(zero));
        if matches!(kind, Kind::Fluid | Kind::Viscous) {
            return Self::Fluid { j: [T::ONE; LANES], grad_v };
        }
        let mut f = zero;
        for a in 0..D {
            f[a][a] = [T::ONE; LANES];
        }
        Self::Solid { f, plastic: [T::ZERO; LANES], grad_v }
    }

    /// ∇v (1/s) that the next P2G acts with, if viscosity or damping does.
    pub fn grad_v(&mut self) -> Option<&mut MatrixLanes<T, D>> {
        match self {
            Self::Solid { grad_v, .. } | Self::Fluid { grad_v, .. } => grad_v.as_deref_mut(),
        }
    }

    /// Copies a particle's state from a chunk of the same body.
    fn copy(&mut self, lane: usize, from: &Self, from_lane: usize) {
        let (to_rates, from_rates) = match (self, from) {
            (
                Self::Solid { f, plastic, grad_v },
                Self::Solid { f: from, plastic: from_plastic, grad_v: from_grad_v },
            ) => {
                copy_matrix(f, lane, from, from_lane);
                plastic[lane] = from_plastic[from_lane];
                (grad_v, from_grad_v)
            }
            (Self::Fluid { j, grad_v }, Self::Fluid { j: from_j, grad_v: from_grad_v }) => {
                j[lane] = from_j[from_lane];
                (grad_v, from_grad_v)
            }
            _ => unreachable!("a body is a fluid or it is not"),
        };
        if let (Some(to), Some(from)) = (to_rates, from_rates) {
            copy_matrix(to, lane, from, from_lane);
        }
    }
}

impl<T: Real, const D: usize> Chunk<T, D> {
    /// No particles; lanes at rest in the middle of the block.
    pub fn empty(body: u32, kind: Kind, touch: Option<Touch>) -> Self {
        Self {
            x: [[T::TWO; LANES]; D],
            v: [[T::ZERO; LANES]; D],
            b: [[[T::ZERO; LANES]; D]; D],
            state: State::rest(kind),
            touch: touch.map(|touch| Box::new([touch; LANES])),
            id: [u32::MAX; LANES],
            count: 0,
            body,
        }
    }

    /// Copies everything but the position of a particle of another chunk of the same body.
    pub fn copy_state(&mut self, lane: usize, from: &Self, from_lane: usize) {
        for i in 0..D {
            self.v[i][lane] = from.v[i][from_lane];
        }
        copy_matrix(&mut self.b, lane, &from.b, from_lane);
        self.state.copy(lane, &from.state, from_lane);
        if let (Some(to), Some(from)) = (&mut self.touch, &from.touch) {
            to[lane] = from[from_lane];
        }
        self.id[lane] = from.id[from_lane];
    }
}

fn copy_matrix<T: Real, const D: usize>(
    to: &mut MatrixLanes<T, D>,
    lane: usize,
    from: &MatrixLanes<T, D>,
    from_lane: usize,
) {
    for i in 0..D {
        for k in 0..D {
            to[i][k][lane] = from[i][k][from_lane];
        }
    }
}

/// A matrix a particle.
pub type MatrixLanes<T, const D: usize> = [[Lanes<T>; D]; D];

#[inline(always)]
pub fn vector<T: Real, const D: usize>(lanes: &[Lanes<T>; D], l: usize) -> Vector<T, D> {
    let mut v = [T::ZERO; D];
    for i in 0..D {
        v[i] = lanes[i][l];
    }
    v
}

#[inline(always)]
pub fn matrix<T: Real, const D: usize>(lanes: &[[Lanes<T>; D]; D], l: usize) -> Matrix<T, D> {
    let mut m = [[T::ZERO; D]; D];
    for i in 0..D {
        for k in 0..D {
            m[i][k] = lanes[i][k][l];
        }
    }
    m
}

#[inline(always)]
pub fn set_matrix<T: Real, const D: usize>(lanes: &mut [[Lanes<T>; D]; D], l: usize, m: &Matrix<T, D>) {
    for i in 0..D {
        for k in 0..D {
            lanes[i][k][l] = m[i][k];
        }
    }
}

/// What takes a weight's place in a sum over nodes, per axis, grid and node along the axis.
pub type Others<T, const D: usize, const G: usize, const W: usize> = [[[Lanes<T>; W]; G]; D];

/// Nodes and weights of the particles of a chunk.
#[derive(Clone, Debug)]
pub struct Stencils<T, const D: usize, const G: usize, const W: usize> {
    pub base: [[Lanes<i32>; G]; D],
    pub offset: [[Lanes<T>; G]; D],
    pub weight: [[[Lanes<T>; W]; G]; D],
    pub spread: [Lanes<T>; D],
    pub skew: [Lanes<T>; D],
}

impl<T: Real, const D: usize, const G: usize, const W: usize> Stencils<T, D, G, W> {
    #[inline(always)]
    pub fn new<K: ShapeFunction<G, W>>(x: &[Lanes<T>; D]) -> Self {
        let mut s = Self {
            base: [[[0; LANES]; G]; D],
            offset: [[[T::ZERO; LANES]; G]; D],
            weight: [[[[T::ZERO; LANES]; W]; G]; D],
            spread: [[T::ZERO; LANES]; D],
            skew: [[T::ZERO; LANES]; D],
        };
        for a in 0..D {
            for l in 0..LANES {
                let axis = K::axis(x[a][l]);
                s.spread[a][l] = axis.spread;
                s.skew[a][l] = axis.skew;
                for g in 0..G {
                    s.base[a][g][l] = axis.base[g];
                    s.offset[a][g][l] = axis.offset[g];
                    for k in 0..W {
                        s.weight[a][g][k][l] = axis.weight[g][k];
                    }
                }
            }
        }
        s
    }

    /// d weight / d x_p, times dx, per axis and node.
    #[inline(always)]
    pub fn slopes<K: ShapeFunction<G, W>>(x: &[Lanes<T>; D]) -> Others<T, D, G, W> {
        let mut slopes = [[[[T::ZERO; LANES]; W]; G]; D];
        for a in 0..D {
            for l in 0..LANES {
                let axis = K::axis(x[a][l]);
                for g in 0..G {
                    for k in 0..W {
                        slopes[a][g][k][l] = axis.slope[g][k];
                    }
                }
            }
        }
        slopes
    }

    /// w (x_i − x_p − x̄_s)/dx per axis and node, x̄_s the mean of grid s.
    #[inline(always)]
    pub fn moments(&self) -> Others<T, D, G, W> {
        let mut moments = self.weight;
        for a in 0..D {
            for g in 0..G {
                for l in 0..LANES {
                    // Of two nodes, each lies from the mean by the weight of the other.
                    if W == 2 {
                        let product = self.weight[a][g][0][l] * self.weight[a][g][1][l];
                        (moments[a][g][0][l], moments[a][g][1][l]) = (-product, product);
                        continue;
                    }
                    for k in 0..W {
                        moments[a][g][k][l] *= self.offset[a][g][l] + T::from_i32(k as i32);
                    }
                }
            }
        }
        moments
    }

    /// Where in a tile the particles' lowest nodes are.
    #[inline(always)]
    pub fn starts(&self, lowest: &[i32; 2]) -> Starts<G> {
        let mut starts = [[0; LANES]; G];
        for g in 0..G {
            for l in 0..LANES {
                let mut base = [0; D];
                for a in 0..D {
                    base[a] = self.base[a][g][l];
                }
                starts[g][l] = index::<D, G, W>(g, base, lowest[g]);
            }
        }
        starts
    }

    /// ½ Σ_s Σ_i w² of every particle: what Σ w m_i / m_p is when no other particle shares its nodes.
    pub fn own_share(&self) -> Lanes<T> {
        let mut share = [T::ZERO; LANES];
        for l in 0..LANES {
            for g in 0..G {
                let mut product = T::ONE / T::from_i32(G as i32);
                for a in 0..D {
                    let squares = (0..W).map(|k| self.weight[a][g][k][l] * self.weight[a][g][k][l]);
                    product *= squares.sum();
                }
                share[l] += product;
            }
        }
        share
    }

    /// m D at lane l's position.
    pub fn times_moment(&self, m: &Matrix<T, D>, l: usize) -> Matrix<T, D> {
        let skew = vector(&self.skew, l);
        let along = apply(m, &skew);
        let mut product = *m;
        for i in 0..D {
            for k in 0..D {
                product[i][k] = m[i][k] * self.spread[k][l] + along[i] * skew[k];
            }
        }
        product
    }

    /// m diag(spread)⁻¹ at lane l's position.
    #[inline(always)]
    pub fn times_inverse_spread(&self, m: &Matrix<T, D>, l: usize) -> Matrix<T, D> {
        times_inverse_diagonal(m, &vector(&self.spread, l))
    }

    /// m D⁻¹ at lane l's position.
    #[inline(always)]
    pub fn times_inverse_moment<K: ShapeFunction<G, W>>(&self, m: &Matrix<T, D>, l: usize) -> Matrix<T, D> {
        K::times_inverse_moment(m, &vector(&self.spread, l), &vector(&self.skew, l))
    }
}
