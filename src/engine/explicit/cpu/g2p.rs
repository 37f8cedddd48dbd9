//! Grid to particles, and the particles' own update (CK-MPM, eqs. 23–30).
//!
//! v = ½ Σ_s Σ_i w v_i, B = ½ Σ_s Σ_i w v_i (x_i − x_p)ᵀ; ∇v at the old position:
//! * MLS: ½ Σ_s Σ_i w v_i (x_i − x_p − x̄_s)ᵀ diag(p)⁻¹, with x̄_s the mean of grid s;
//! * MLS as published: B D(x)⁻¹;
//! * APIC, PIC: ½ Σ_s Σ_i v_i ∇wᵀ.
//!
//! Where a body's volume follows its fill, J or F first goes a little towards it. Then
//! F ← (I + dt ∇v) F, a fluid's J ← (1 + dt tr ∇v) J; x ← x + dt v. Single-grid kernels have no ½.
//! In: node velocities of a tile. Out: particles of its block. One thread a block.

use super::chunk::{Chunk, LANES, Lanes, MatrixLanes, Others, State, Stencils, matrix, set_matrix};
use super::constants::{BodySetup, Constants, Relaxation};
use super::fill::{self, Around};
use super::near::{self, Near};
use super::tile::{BLOCK, MASS, Node, SLACK, add_scaled};
use gridfall_core::maths::linalg::{add_scaled as add_scaled_matrix, det, double_dot, mul, trace};
use gridfall_core::maths::real::Real;
use gridfall_core::maths::widest::widest;
use gridfall_core::sim::kernel::ShapeFunction;
use gridfall_core::sim::timestep::MAX_GROWTH;
use gridfall_core::sim::volume;

/// What the particles of a block did.
#[derive(Clone, Copy, Debug, Default)]
pub struct Moves<T> {
    /// Largest |v|² (m²/s²).
    pub speed_squared: T,
    /// A particle moved a whole dx, or its velocity is not a number.
    pub diverged: bool,
    /// A particle is more than a cell outside a wall.
    pub outside: bool,
    /// A particle has left its tile: bin before the next P2G.
    pub strayed: bool,
    /// An entry of dt ∇v is above [`MAX_GROWTH`].
    pub growing: bool,
    /// Largest demand of the particles' materials after the step, if P2G has looked (1/s²).
    pub demand: T,
    /// Particles reset because they were alone on their nodes.
    pub isolated: u64,
}

impl<T: Real> Moves<T> {
    pub fn and(self, other: Self) -> Self {
        Self {
            speed_squared: self.speed_squared.max(other.speed_squared),
            diverged: self.diverged | other.diverged,
            outside: self.outside | other.outside,
            strayed: self.strayed | other.strayed,
            growing: self.growing | other.growing,
            demand: self.demand.max(other.demand),
            isolated: self.isolated + other.isolated,
        }
    }
}

widest! {
    /// Velocities and B of a chunk's particles from the velocities of a tile, ∇v (1/s), and the fill of their room if
    /// their volume follows it.
    pub fn gather[T: Real, K: ShapeFunction<G, W>, const D: usize, const G: usize, const W: usize][T, K, D, G, W](
        constants: &Constants<T, D>,
        chunk: &mut Chunk<T, D>,
        tile: &[Node<T>],
        around: &Around<T, D>,
        grad_v: &mut MatrixLanes<T, D>,
        fill: &mut Lanes<T>,
    ) {
        let stencils = Stencils::<T, D, G, W>::new::<K>(&chunk.x);
        let mut near = near::nothing::<T, G, W>();
        near::load::<T, D, G, W>(tile, &stencils.starts(&constants.layout.lowest), &mut near);
        let (count, per_dx) = (chunk.count, T::ONE / constants.dx);
        if constants.transfer.is_affine() {
            let sums = sums(&near, &stencils, &stencils.moments());
            for l in 0..LANES {
                let used = l < count;
                for i in 0..D {
                    chunk.v[i][l] = if used { sums.mean[i][l] } else { T::ZERO };
                    for k in 0..D {
                        let moment = sums.other[i][k][l] + sums.apart[i][l] * stencils.skew[k][l];
                        chunk.b[i][k][l] = if used { moment } else { T::ZERO };
                    }
                }
                fill[l] = sums.mean[MASS][l];
            }
            if constants.transfer.is_mls() {
                for l in 0..LANES {
                    let rates = if constants.transfer.is_centred() {
                        stencils.times_inverse_spread(&matrix(&sums.other, l), l)
                    } else {
                        stencils.times_inverse_moment::<K>(&matrix(&chunk.b, l), l)
                    };
                    for i in 0..D {
                        for k in 0..D {
                            grad_v[i][k][l] = if l < count { rates[i][k] * per_dx } else { T::ZERO };
                        }
                    }
                }
            }
        }
        if !constants.transfer.is_mls() {
            let sums = sums(&near, &stencils, &Stencils::<T, D, G, W>::slopes::<K>(&chunk.x));
            for l in 0..LANES {
                let used = l < count;
                for i in 0..D {
                    chunk.v[i][l] = if used { sums.mean[i][l] } else { T::ZERO };
                    for k in 0..D {
                        grad_v[i][k][l] = if used { sums.other[i][k][l] * per_dx } else { T::ZERO };
                    }
                }
                fill[l] = sums.mean[MASS][l];
            }
        }
        let body = &constants.bodies[chunk.body as usize];
        if body.relaxation.is_some() {
            for l in 0..LANES {
                fill[l] *= body.cells / body.mass;
            }
            if around.is_special() {
                fill::beside(&constants.layout, chunk.count, &stencils, around, fill);
            }
        }
    }
}

/// Sums over the nodes of a chunk's particles.
struct Sums<T, const D: usize> {
    /// ½ Σ_s Σ_i w v_i.
    mean: Lanes4<T>,
    /// ½ Σ_s s Σ_i w v_i, 0 on a single grid: half the difference of the grids' means.
    apart: [Lanes<T>; D],
    /// Per axis ½ Σ_s Σ_i v_i `other`, where `other` takes the weight's place on that axis.
    other: MatrixLanes<T, D>,
}

type Lanes4<T> = [Lanes<T>; 4];

/// `other`: moments about each grid's mean for B, ∂w/∂x dx for ∇v. Those of a particle add up to nothing on every axis.
#[inline(always)]
fn sums<T: Real, const D: usize, const G: usize, const W: usize>(
    near: &Near<T, G, W>,
    s: &Stencils<T, D, G, W>,
    other: &Others<T, D, G, W>,
) -> Sums<T, D> {
    let (middle, inner) = (D - 2, D - 1);
    let mut sums =
        Sums { mean: [[T::ZERO; LANES]; 4], apart: [[T::ZERO; LANES]; D], other: [[[T::ZERO; LANES]; D]; D] };
    let share = T::ONE / T::from_i32(G as i32);
    for g in 0..G {
        let sign = if g == 0 { share } else { -share };
        if W == 2 {
            // On two nodes a mean is a + w (b − a), and what the others sum up to is one of them times b − a.
            for l in 0..LANES {
                let (w_middle, w_inner) = (s.weight[middle][g][1][l], s.weight[inner][g][1][l]);
                let (mut mean, mut across, mut along) = sheet(&near[g][0], l, w_middle, w_inner);
                if D == 3 {
                    let (w, (mean_b, across_b, along_b)) =
                        (s.weight[0][g][1][l], sheet(&near[g][1], l, w_middle, w_inner));
                    let up = rise(mean, mean_b);
                    mean = add_scaled(mean, w, up);
                    across = add_scaled(across, w, rise(across, across_b));
                    along = add_scaled(along, w, rise(along, along_b));
                    for i in 0..D {
                        sums.other[i][0][l] += share * (other[0][g][1][l] * up[i]);
                    }
                }
                for i in 0..D {
                    sums.other[i][middle][l] += share * (other[middle][g][1][l] * across[i]);
                    sums.other[i][inner][l] += share * (other[inner][g][1][l] * along[i]);
                    sums.apart[i][l] += sign * mean[i];
                }
                for c in 0..4 {
                    sums.mean[c][l] += share * mean[c];
                }
            }
            continue;
        }
        for i in 0..if D == 3 { W } else { 1 } {
            for l in 0..LANES {
                let zero = [T::ZERO; 4];
                let (mut sum, mut across, mut along) = (zero, zero, zero);
                for j in 0..W {
                    let (mut sum_j, mut along_j) = (zero, zero);
                    for k in 0..W {
                        sum_j = add_scaled(sum_j, s.weight[inner][g][k][l], near[g][i][j][k][l]);
                        along_j = add_scaled(along_j, other[inner][g][k][l], near[g][i][j][k][l]);
                    }
                    sum = add_scaled(sum, s.weight[middle][g][j][l], sum_j);
                    across = add_scaled(across, other[middle][g][j][l], sum_j);
                    along = add_scaled(along, s.weight[middle][g][j][l], along_j);
                }
                let w = if D == 3 { s.weight[0][g][i][l] } else { T::ONE };
                for c in 0..4 {
                    sums.mean[c][l] += w * sum[c];
                }
                for c in 0..D {
                    if D == 3 {
                        sums.other[c][0][l] += other[0][g][i][l] * sum[c];
                    }
                    sums.other[c][middle][l] += w * across[c];
                    sums.other[c][inner][l] += w * along[c];
                }
            }
        }
    }
    sums
}

/// The mean of the 2 × 2 nodes of a particle on the last two axes, and how it rises along these.
#[inline(always)]
fn sheet<T: Real, const W: usize>(
    nodes: &[[[Node<T>; LANES]; W]; W],
    l: usize,
    w_middle: T,
    w_inner: T,
) -> (Node<T>, Node<T>, Node<T>) {
    let (a, b) = (nodes[0][0][l], nodes[1][0][l]);
    let (along_a, along_b) = (rise(a, nodes[0][1][l]), rise(b, nodes[1][1][l]));
    let (a, b) = (add_scaled(a, w_inner, along_a), add_scaled(b, w_inner, along_b));
    let across = rise(a, b);
    (add_scaled(a, w_middle, across), across, add_scaled(along_a, w_middle, rise(along_a, along_b)))
}

/// b − a.
#[inline(always)]
fn rise<T: Real>(a: Node<T>, b: Node<T>) -> Node<T> {
    [b[0] - a[0], b[1] - a[1], b[2] - a[2], b[3] - a[3]]
}

/// J, or the volumetric strain of grains, a little towards that of which the fill tells.
#[inline(always)]
fn relax<T: Real, const D: usize>(
    body: &BodySetup<T>,
    relaxation: &Relaxation<T>,
    chunk: &mut Chunk<T, D>,
    dt: T,
    grad_v: &MatrixLanes<T, D>,
    fill: &Lanes<T>,
) {
    let [stirred, noise, densest] = [volume::STIRRED, volume::NOISE, volume::DENSEST].map(T::from_f64);
    let (mut goal, mut share, mut over) = ([T::ONE; LANES], [T::ZERO; LANES], [T::ONE; LANES]);
    for l in 0..LANES {
        over[l] = (fill[l] / relaxation.full).max(T::ONE);
        let crowd = T::from_f64(5.0) * (over[l].min(densest) - noise).max(T::ZERO);
        let rates = matrix(grad_v, l);
        let stirring = stirred * double_dot(&rates, &rates).sqrt();
        share[l] = (dt * (relaxation.rate + stirring + relaxation.crowded * crowd * crowd)).min(T::ONE);
        goal[l] = T::ONE / over[l].min(T::from_f64(volume::FULLEST));
    }
    match &mut chunk.state {
        State::Fluid { j, .. } => {
            for l in 0..LANES {
                j[l] += share[l] * (goal[l] - j[l]);
            }
        }
        State::Solid { f: lanes, plastic, .. } => {
            if over[..chunk.count].iter().all(|&over| over <= T::ONE) {
                return;
            }
            let grains = body.law.gained_volume(T::ZERO).is_some();
            for l in 0..LANES {
                let f = matrix(lanes, l);
                let volume = det(&f) * if grains { plastic[l].exp() } else { T::ONE };
                let weight = ((over[l] - T::ONE) / T::from_f64(volume::GRADUAL)).min(T::ONE);
                let change = weight * share[l] * (goal[l] / volume - T::ONE);
                let stretch = ((T::ONE + change).ln() / T::from_i32(D as i32)).exp();
                let stretch = if (over[l] > T::ONE) & (volume > goal[l]) { stretch } else { T::ONE };
                for i in 0..D {
                    for k in 0..D {
                        lanes[i][k][l] *= stretch;
                    }
                }
            }
        }
    }
}

widest! {
    /// F ← (I + dt ∇v) F, or a fluid's J ← (1 + dt tr ∇v) J; x ← x + dt v. `inside` bounds
    /// positions and `planes` stops them (dx, relative to the block).
    pub fn advance[T: Real, const D: usize][T, D](
        constants: &Constants<T, D>,
        chunk: &mut Chunk<T, D>,
        dt: T,
        grad_v: &MatrixLanes<T, D>,
        fill: &Lanes<T>,
        inside: &[[T; 2]; D],
        planes: &[[T; 2]; D],
    ) -> Moves<T> {
        let body = &constants.bodies[chunk.body as usize];
        if let Some(relaxation) = &body.relaxation {
            relax(body, relaxation, chunk, dt, grad_v, fill);
        }
        match &mut chunk.state {
            State::Fluid { j, .. } => {
                for l in 0..LANES {
                    j[l] *= T::ONE + dt * trace(&matrix(grad_v, l));
                }
            }
            State::Solid { f: lanes, .. } => {
                for l in 0..LANES {
                    let f = matrix(lanes, l);
                    let change = mul(&matrix(grad_v, l), &f);
                    set_matrix(lanes, l, &add_scaled_matrix(&f, dt, &change));
                }
            }
        }
        if let Some(kept) = chunk.state.grad_v() {
            *kept = *grad_v;
        }

        let step = dt / constants.dx;
        let cell = T::from_f64(constants.layout.cell);
        let (low, high) = (cell - T::from_i32(SLACK), cell + T::from_i32(BLOCK + SLACK));
        let mut moves = Moves::<T>::default();
        let mut speed_squared = [T::ZERO; LANES];
        for a in 0..D {
            for l in 0..LANES {
                let from = chunk.x[a][l];
                // A plane stops those that come from inside, and does not hide one that is outside.
                let mut x = from + step * chunk.v[a][l];
                x = if from >= planes[a][0] { x.max(planes[a][0]) } else { x };
                x = if from <= planes[a][1] { x.min(planes[a][1]) } else { x };
                chunk.x[a][l] = x;
                speed_squared[l] += chunk.v[a][l] * chunk.v[a][l];
                moves.strayed |= (x < low) | (x >= high);
                moves.outside |= (x < inside[a][0]) | (x > inside[a][1]);
            }
        }
        let mut growth = [T::ZERO; LANES];
        for entry in grad_v.iter().flatten() {
            for l in 0..LANES {
                growth[l] = growth[l].max(entry[l].abs());
            }
        }
        let most = T::from_f64(MAX_GROWTH) / dt;
        moves.growing = growth[..chunk.count].iter().any(|&g| g > most);
        for l in 0..LANES {
            moves.speed_squared = moves.speed_squared.max(speed_squared[l]);
            let share = speed_squared[l] * step * step;
            moves.diverged |= (share >= T::ONE) | !share.is_finite();
        }
        moves
    }
}
