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

use super::chunk::{Chunk, LANES, Lanes, MatrixLanes, State, Stencils, matrix, set_matrix};
use super::constants::{BodySetup, Constants, Relaxation};
use super::fill::{self, Around};
use super::tile::{BLOCK, MASS, Node, SLACK, Walk, add_scaled, index, scale};
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
        let lowest = &constants.layout.lowest;
        // ½ (v̄⁺ − v̄⁻): half the difference of the grids' means.
        let mut apart = [[T::ZERO; LANES]; D];
        if constants.transfer.is_affine() {
            let moments = stencils.moments();
            for l in 0..chunk.count {
                let (v, moment, difference) = gather_lane(lowest, &stencils, &moments, l, tile);
                for i in 0..D {
                    chunk.v[i][l] = v[i];
                    apart[i][l] = difference[i];
                    for k in 0..D {
                        chunk.b[i][k][l] = moment[k][i];
                    }
                }
                fill[l] = v[MASS];
            }
        }
        if !constants.transfer.is_mls() {
            for l in 0..chunk.count {
                let (v, slope, _) = gather_lane(lowest, &stencils, &stencils.slope, l, tile);
                for i in 0..D {
                    chunk.v[i][l] = v[i];
                    for k in 0..D {
                        grad_v[i][k][l] = slope[k][i] / constants.dx;
                    }
                }
                fill[l] = v[MASS];
            }
        } else {
            for l in 0..LANES {
                let mut moment = matrix(&chunk.b, l);
                let rates = if constants.transfer.is_centred() {
                    for i in 0..D {
                        for k in 0..D {
                            moment[i][k] -= apart[i][l] * stencils.skew[k][l];
                        }
                    }
                    stencils.times_inverse_spread(&moment, l)
                } else {
                    stencils.times_inverse_moment::<K>(&moment, l)
                };
                set_matrix(grad_v, l, &rates.map(|row| row.map(|c| c / constants.dx)));
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

/// ½ Σ_s Σ_i w v_i, and per axis ½ Σ_s Σ_i v_i `other`, where `other` takes the weight's place on that axis: w d for
/// B (d = (x_i − x_p)/dx), ∂w/∂x dx for ∇v. Last ½ Σ_s s Σ_i w v_i, 0 on a single grid.
#[inline(always)]
pub(super) fn gather_lane<T: Real, const D: usize, const G: usize, const W: usize>(
    lowest: &[i32; 2],
    s: &Stencils<T, D, G, W>,
    other: &[[[[T; LANES]; W]; G]; D],
    l: usize,
    tile: &[Node<T>],
) -> (Node<T>, [Node<T>; D], Node<T>) {
    let walk = const { Walk::new(D, G, W) };
    let (middle, inner) = (D - 2, D - 1);
    let zero = [T::ZERO; 4];
    let (mut total, mut moment) = (zero, [zero; D]);
    let mut first = zero;
    for g in 0..G {
        if g == 1 {
            first = total;
        }
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
    // Σ⁺ − Σ⁻ = 2 Σ⁺ − (Σ⁺ + Σ⁻).
    let difference = if G == 2 { add_scaled(scale(T::TWO, first), -T::ONE, total) } else { zero };
    (scale(mean, total), moment.map(|m| scale(mean, m)), scale(mean, difference))
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
            for l in (0..chunk.count).filter(|&l| over[l] > T::ONE) {
                let f = matrix(lanes, l);
                let gained = body.law.gained_volume(plastic[l]).unwrap_or(T::ZERO);
                let volume = det(&f) * gained.exp();
                if volume > goal[l] {
                    let weight = ((over[l] - T::ONE) / T::from_f64(volume::GRADUAL)).min(T::ONE);
                    let change = weight * share[l] * (goal[l] / volume - T::ONE);
                    let stretch = (change.ln_1p() / T::from_i32(D as i32)).exp();
                    set_matrix(lanes, l, &f.map(|row| row.map(|f| f * stretch)));
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
            State::Fluid { j, grad_v: kept } => {
                for l in 0..LANES {
                    j[l] *= T::ONE + dt * trace(&matrix(grad_v, l));
                }
                *kept = *grad_v;
            }
            State::Solid { f: lanes, grad_v: kept, .. } => {
                for l in 0..LANES {
                    let f = matrix(lanes, l);
                    let change = mul(&matrix(grad_v, l), &f);
                    set_matrix(lanes, l, &add_scaled_matrix(&f, dt, &change));
                }
                if let Some(kept) = kept {
                    **kept = *grad_v;
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
