//! Grid to particles, and the particles' own update (CK-MPM, eqs. 23–30).
//!
//! v = ½ Σ_s Σ_i w v_i, B = ½ Σ_s Σ_i w v_i (x_i − x_p)ᵀ; ∇v = B D(x)⁻¹ at the old position (MLS) or ½ Σ_s Σ_i v_i ∇wᵀ
//! (APIC, PIC); F ← (I + dt ∇v) F, a fluid's J ← (1 + dt tr ∇v) J; x ← x + dt v. Single-grid kernels have no ½.
//! In: node velocities of a tile. Out: particles of its block. One thread a block.

use super::chunk::{Chunk, LANES, MatrixLanes, State, Stencils, matrix, set_matrix};
use super::simulation::Constants;
use super::tile::{BLOCK, Node, SLACK, Walk, add_scaled, index, scale};
use gridfall_core::maths::linalg::{add_scaled as add_scaled_matrix, mul, trace};
use gridfall_core::maths::real::Real;
use gridfall_core::maths::widest::widest;
use gridfall_core::sim::kernel::ShapeFunction;
use gridfall_core::sim::timestep::MAX_GROWTH;

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
    /// Velocities and B of a chunk's particles from the velocities of a tile, and ∇v (1/s).
    pub fn gather[T: Real, K: ShapeFunction<G, W>, const D: usize, const G: usize, const W: usize][T, K, D, G, W](
        constants: &Constants<T, D>,
        chunk: &mut Chunk<T, D>,
        tile: &[Node<T>],
        grad_v: &mut MatrixLanes<T, D>,
    ) {
        let stencils = Stencils::<T, D, G, W>::new::<K>(&chunk.x);
        let lowest = &constants.layout.lowest;
        if constants.affine {
            let moments = stencils.moments();
            for l in 0..chunk.count {
                let (v, moment) = gather_lane(lowest, &stencils, &moments, l, tile);
                for i in 0..D {
                    chunk.v[i][l] = v[i];
                    for k in 0..D {
                        chunk.b[i][k][l] = moment[k][i];
                    }
                }
            }
        }
        if constants.gradient_form {
            for l in 0..chunk.count {
                let (v, slope) = gather_lane(lowest, &stencils, &stencils.slope, l, tile);
                for i in 0..D {
                    chunk.v[i][l] = v[i];
                    for k in 0..D {
                        grad_v[i][k][l] = slope[k][i] / constants.dx;
                    }
                }
            }
        } else {
            for l in 0..LANES {
                let c = stencils.times_inverse_moment::<K>(&matrix(&chunk.b, l), l);
                set_matrix(grad_v, l, &c.map(|row| row.map(|c| c / constants.dx)));
            }
        }
    }
}

/// ½ Σ_s Σ_i w v_i, and per axis ½ Σ_s Σ_i v_i `other`, where `other` takes the weight's place on that axis: w d for
/// B (d = (x_i − x_p)/dx), ∂w/∂x dx for ∇v.
#[inline(always)]
pub(super) fn gather_lane<T: Real, const D: usize, const G: usize, const W: usize>(
    lowest: &[i32; 2],
    s: &Stencils<T, D, G, W>,
    other: &[[[[T; LANES]; W]; G]; D],
    l: usize,
    tile: &[Node<T>],
) -> (Node<T>, [Node<T>; D]) {
    let walk = const { Walk::new(D, G, W) };
    let (middle, inner) = (D - 2, D - 1);
    let zero = [T::ZERO; 4];
    let (mut total, mut moment) = (zero, [zero; D]);
    for g in 0..G {
        let mut base = [0; D];
        for a in 0..D {
            base[a] = s.base[a][g][l];
        }
        let start = index::<D, G, W>(g, base, lowest[g]);
        for i in 0..walk.outer {
            let (mut sum_i, mut middle_i, mut inner_i) = (zero, zero, zero);
            for j in 0..W {
                let row = start + i * walk.outer_stride + j * walk.middle_stride;
                let row = &tile[row..row + W];
                let (mut sum_j, mut inner_j) = (zero, zero);
                for k in 0..W {
                    sum_j = add_scaled(sum_j, s.weight[inner][g][k][l], row[k]);
                    inner_j = add_scaled(inner_j, other[inner][g][k][l], row[k]);
                }
                sum_i = add_scaled(sum_i, s.weight[middle][g][j][l], sum_j);
                middle_i = add_scaled(middle_i, other[middle][g][j][l], sum_j);
                inner_i = add_scaled(inner_i, s.weight[middle][g][j][l], inner_j);
            }
            let mut w_i = T::ONE;
            if D == 3 {
                w_i = s.weight[0][g][i][l];
                moment[0] = add_scaled(moment[0], other[0][g][i][l], sum_i);
            }
            total = add_scaled(total, w_i, sum_i);
            moment[middle] = add_scaled(moment[middle], w_i, middle_i);
            moment[inner] = add_scaled(moment[inner], w_i, inner_i);
        }
    }
    let mean = T::ONE / T::from_i32(G as i32);
    (scale(mean, total), moment.map(|m| scale(mean, m)))
}

widest! {
    /// F ← (I + dt ∇v) F, or a fluid's J ← (1 + dt tr ∇v) J; x ← x + dt v. `inside` bounds
    /// positions (dx, relative to the block).
    pub fn advance[T: Real, const D: usize][T, D](
        constants: &Constants<T, D>,
        chunk: &mut Chunk<T, D>,
        dt: T,
        grad_v: &MatrixLanes<T, D>,
        inside: &[[T; 2]; D],
    ) -> Moves<T> {
        match &mut chunk.state {
            State::Fluid { j, grad_v: kept } => {
                for l in 0..LANES {
                    j[l] *= T::ONE + dt * trace(&matrix(grad_v, l));
                }
                *kept = *grad_v;
            }
            State::Solid { f: lanes, .. } => {
                for l in 0..LANES {
                    let f = matrix(lanes, l);
                    let change = mul(&matrix(grad_v, l), &f);
                    set_matrix(lanes, l, &add_scaled_matrix(&f, dt, &change));
                }
            }
        }

        let step = dt / constants.dx;
        let cell = T::from_f64(constants.layout.cell);
        let (low, high) = (cell - T::from_i32(SLACK), cell + T::from_i32(BLOCK + SLACK));
        let mut moves = Moves::<T>::default();
        let mut speed_squared = [T::ZERO; LANES];
        for a in 0..D {
            for l in 0..LANES {
                let x = chunk.x[a][l] + step * chunk.v[a][l];
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
