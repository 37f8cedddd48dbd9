//! Host memory of a run, known before anything is allocated.

use gridfall_core::sim::settings::Integrator;

/// Host memory per particle (bytes), from above. Where blocks are full, the explicit CPU engine takes
/// 300 in f32 and 450 in f64, from loading to recording; sparse blocks take more, and so do engines
/// that hand over all particles at once.
pub(crate) const HOST_BYTES_PER_PARTICLE: u64 = 1024;
/// Host memory per particle (bytes) of the implicit integrator's matrices at 8 particles per cell:
/// two nodes per cell in a large body, 125 blocks of 9 f64 per node, and the coarser levels.
pub(crate) const MATRIX_BYTES_PER_PARTICLE: u64 = 3072;
/// Both sides of the implicit GPU engine's table of all blocks of the domain (bytes per block).
pub(crate) const DENSE_BYTES_PER_BLOCK: u64 = 8;

/// Memory (bytes) of a run with so many particles on so large a grid of so many fields of nodes. The domain counts in
/// implicit runs only: explicit ones know of blocks where particles are.
pub(crate) fn memory_bytes(particles: u64, cells: [u64; 3], fields: u64, integrator: Integrator) -> u64 {
    let of_particles = particles.saturating_mul(HOST_BYTES_PER_PARTICLE);
    if integrator != Integrator::Implicit {
        return of_particles;
    }
    let blocks = cells.iter().fold(fields, |n, cells| n.saturating_mul(cells.div_ceil(4)));
    of_particles
        .saturating_add(particles.saturating_mul(MATRIX_BYTES_PER_PARTICLE))
        .saturating_add(blocks.saturating_mul(DENSE_BYTES_PER_BLOCK))
}
