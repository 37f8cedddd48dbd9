//! The incremental potential of one step (HOT eq. 1).
//!
//! E(Δv) = ½ Σ m_i |Δv_i|² + n Σ V0 ψ(F(Δv)) − dt Σ m_i g·Δv_i with F(Δv) = (I + dt ∇v) Fⁿ,
//! ∇v = (1/n) Σ v_i g_iᵀ, v = vⁿ + Δv; n = 2 for the compact kernel, whose two grids both carry the
//! full mass and force, else 1. ∇E_i = m_i (Δv_i − dt g) + dt Σ V0 P Fⁿᵀ g_i.

use rayon::prelude::*;

use self::linearised::Linearised;
use self::splitting::Split;
use super::assembly::{self, AtParticles};
use super::contact::{Faces, Response};
use super::discretisation::Discretisation;
use super::friction::{Drag, STICKING_DX};
use super::state::BodySetup;
use super::topology::period;
use crate::contract::Control;
use crate::implicit::solver::objective::{
    Freedom, LinearOperator, NodeId, NodeVectors, Objective, Renewed, Splitting, reach_of,
};
use crate::implicit::solver::sparse::Bsr;
use crate::implicit::solver::turning::UNFELT;
use gridfall_core::material::{Law, Projected, Tensor4};
use gridfall_core::maths::linalg::{
    Matrix, Vector, add_scaled, apply, dot, double_dot, identity, mul, mul_transpose, transpose,
};
use gridfall_core::maths::svd::polar_rotation;
use gridfall_core::sim::setup::{Plasticity, Setup};

mod linearised;
mod splitting;

/// Area of a node's characteristic norm over dx² (HOT §5.2); in 2D its length over dx, of the
/// square of its neighbours.
const fn characteristic_area(dimension: usize) -> f64 {
    if dimension == 3 { 24.0 } else { 8.0 }
}

/// One step's minimisation problem.
pub struct Potential<'a, const D: usize> {
    setup: &'a Setup,
    bodies: &'a [BodySetup],
    step: &'a Discretisation<D>,
    control: &'a dyn Control,
    masses: Vec<f64>,
    scales: Vec<f64>,
    /// Whether plastic materials flow within the step.
    flowing: bool,
    /// With the Δv that their normal impulses come from, where the solve goes on.
    friction: Option<(Vec<Drag<D>>, NodeVectors<D>)>,
    faces: Faces<'a, D>,
}

impl<'a, const D: usize> Potential<'a, D> {
    /// `control` may end a solver's work early.
    pub fn new(
        setup: &'a Setup,
        bodies: &'a [BodySetup],
        step: &'a Discretisation<D>,
        control: &'a dyn Control,
    ) -> Self {
        let system = &step.nodes[..step.unknowns()];
        let area = characteristic_area(D) * setup.dx.powi(D as i32 - 1);
        let masses = system.iter().map(|node| node.mass).collect();
        let scales = system.iter().map(|node| area * step.dt * node.stiffness).collect();
        let flowing = setup.implicit.plasticity() == Plasticity::Flowing;
        Self { setup, bodies, step, control, masses, scales, flowing, friction: None, faces: step.faces(setup) }
    }

    /// The same with the friction that the impulses (N s) of a solution without it cause, see
    /// [`Self::energy_and_forces`]; its solve goes on from that solution.
    pub fn with_friction(mut self, solved: NodeVectors<D>, impulses: &NodeVectors<D>) -> Self {
        self.faces.renew(&self.step.velocities(&solved));
        self.friction = Some((self.step.boundary.drags(impulses), solved));
        self
    }

    /// The limits of friction (N) at the particles.
    pub fn limits(&self) -> &[f64] {
        self.faces.limits()
    }

    /// Friction's nodes, and the speed (m/s) below which they count as sticking.
    fn drags(&self) -> (&[Drag<D>], f64) {
        let drags = self.friction.as_ref().map_or(&[][..], |friction| &friction.0);
        (drags, STICKING_DX * self.setup.dx / self.step.dt)
    }

    /// Dissipation (J) by friction.
    fn dissipation(&self, velocities: &NodeVectors<D>) -> f64 {
        let (drags, slow) = self.drags();
        sum(drags.iter().map(|drag| drag.energy(&velocities[drag.node], slow)))
    }

    /// Second derivatives (kg) of the dissipation, by node.
    fn resistances(&self, dv: &NodeVectors<D>) -> Vec<(usize, Matrix<f64, D>)> {
        let (velocities, (drags, slow)) = (self.step.velocities(dv), self.drags());
        drags.iter().map(|drag| (drag.node, drag.hessian(&velocities[drag.node], slow))).collect()
    }

    fn share(&self) -> f64 {
        self.step.topology.interpolation.shape.share
    }

    /// share Σ u_i g_iᵀ of a particle, for values of the nodes of its group.
    fn gradient_of(&self, particle: usize, values: &[Vector<f64, D>]) -> Matrix<f64, D> {
        let (_, g) = self.step.topology.stencil(particle);
        let mut sum = [[0.0; D]; D];
        for (u, g) in values.iter().zip(g) {
            for a in 0..D {
                for b in 0..D {
                    sum[a][b] += u[a] * g[b];
                }
            }
        }
        sum.map(|row| row.map(|x| self.share() * x))
    }

    /// F of a particle at the step's end, for velocities of the nodes of its group.
    fn deformed(&self, particle: usize, velocities: &[Vector<f64, D>]) -> Matrix<f64, D> {
        let grad_v = self.gradient_of(particle, velocities);
        mul(&add_scaled(&identity(), self.step.dt, &grad_v), &self.step.state.f[particle])
    }

    /// Calls `each` with a group's particles and its nodes' values.
    fn with_values(&self, group: usize, values: &NodeVectors<D>, mut each: impl FnMut(usize, &[Vector<f64, D>])) {
        let mut local = [[0.0; D]; 64];
        let nodes = self.step.topology.nodes_of(group);
        for (at, &node) in local.iter_mut().zip(nodes) {
            *at = values.get(node as usize).copied().unwrap_or([0.0; D]);
        }
        for p in self.step.topology.members(group) {
            each(p, &local[..nodes.len()]);
        }
    }

    /// Elastic energy (J) and, if asked for, dt V0 P Fⁿᵀ (J s) of every particle.
    fn stresses(&self, velocities: &NodeVectors<D>, stresses: Option<&mut Vec<Matrix<f64, D>>>) -> f64 {
        let groups = self.step.topology.groups();
        let of_group = |group: usize| {
            let mut energy = 0.0;
            let mut found = Vec::new();
            self.with_values(group, velocities, |p, local| {
                let body = &self.bodies[self.step.state.body[p] as usize];
                let (psi, pk1) = self.energy_and_pk1(&body.law, &self.deformed(p, local), self.step.state.plastic[p]);
                energy += body.volume0 * psi;
                let kirchhoff = mul_transpose(&pk1, &self.step.state.f[p]);
                found.push(kirchhoff.map(|row| row.map(|x| self.step.dt * body.volume0 * x)));
            });
            (energy, found)
        };
        let parts: Vec<_> = (0..groups).into_par_iter().with_min_len(8).map(of_group).collect();
        if let Some(stresses) = stresses {
            *stresses = parts.iter().flat_map(|part| &part.1).copied().collect();
        }
        sum(parts.iter().map(|part| part.0)) / self.share()
    }

    /// ψ (J/m³) and P (Pa) of a particle at the step's end. What flows within the step has no energy
    /// that solvers may compare: ψ is 0, or infinite where the law forbids the state.
    fn energy_and_pk1(&self, law: &Law<f64>, f: &Matrix<f64, D>, plastic: f64) -> (f64, Matrix<f64, D>) {
        if !(self.flowing && law.is_plastic()) {
            return law.energy_and_pk1(f, plastic);
        }
        law.flowing_pk1(f, plastic).map_or((f64::INFINITY, [[0.0; D]; D]), |pk1| (0.0, pk1))
    }

    /// ½ Σ m_i |Δv_i|² − dt Σ m_i g·Δv_i (J).
    fn inertia(&self, dv: &NodeVectors<D>) -> f64 {
        let (dt, gravity) = (self.step.dt, &self.setup.gravity);
        sum(dv
            .iter()
            .zip(&self.masses)
            .map(|(dv, m)| m * (0..D).map(|a| dv[a] * (0.5 * dv[a] - dt * gravity[a])).sum::<f64>()))
    }

    /// Energy (J), and ∇E (kg m/s) of all nodes before any projection and without friction: what
    /// surfaces must give those that are not free.
    pub fn energy_and_forces(&self, dv: &NodeVectors<D>) -> (f64, NodeVectors<D>) {
        let velocities = self.step.velocities(dv);
        let mut stresses = Vec::new();
        let energy = self.stresses(&velocities, Some(&mut stresses)) + self.inertia(dv);
        let pressed = self.faces.responses(&velocities);
        (energy + self.faces.energy(&pressed) / self.share(), self.forces(&velocities, &stresses, &pressed))
    }

    /// Inertia's ∇ (kg m/s) with that of the particles, dt V0 P Fⁿᵀ (J s) and what faces do to them, at all
    /// nodes.
    fn forces(
        &self,
        velocities: &NodeVectors<D>,
        stresses: &[Matrix<f64, D>],
        pressed: &[Response<D>],
    ) -> NodeVectors<D> {
        let bring = |group: usize, shares: &mut [Vector<f64, D>]| {
            for p in self.step.topology.members(group) {
                let (w, g) = self.step.topology.stencil(p);
                for (share, g) in shares.iter_mut().zip(g) {
                    let force = apply(&stresses[p], g);
                    (0..D).for_each(|a| share[a] += force[a]);
                }
                if let Some(press) = self.faces.of(pressed, p) {
                    for (share, w) in shares.iter_mut().zip(w) {
                        (0..D).for_each(|a| share[a] -= self.step.dt * w * press.force[a]);
                    }
                }
            }
        };
        let mut gradient =
            self.step.topology.gather([0.0; D], bring, |sum, part| (0..D).for_each(|a| sum[a] += part[a]));
        for (i, node) in self.step.nodes.iter().enumerate() {
            for a in 0..D {
                let dv = velocities[i][a] - node.velocity[a];
                gradient[i][a] += node.mass * (dv - self.step.dt * self.setup.gravity[a]);
            }
        }
        gradient
    }

    /// Adds friction to the forces on all nodes, and keeps the parts that the system's nodes can
    /// follow.
    fn complete(&self, velocities: &NodeVectors<D>, forces: &mut NodeVectors<D>) {
        let (drags, slow) = self.drags();
        for drag in drags {
            let force = drag.gradient(&velocities[drag.node], slow);
            (0..D).for_each(|a| forces[drag.node][a] += force[a]);
        }
        forces.truncate(self.step.boundary.freedoms.len());
        project(&self.step.boundary.freedoms, forces);
    }

    /// The matrix of a Hessian, of the particles' tensors at Δv.
    fn matrix(&self, dv: &NodeVectors<D>, tensors: &[Tensor4<f64, D>]) -> Bsr<f64, D> {
        let (topology, freedoms) = (&self.step.topology, &self.step.boundary.freedoms);
        let mut matrix = assembly::assemble(topology, tensors, &self.pressed(dv), &self.masses, freedoms);
        for (node, block) in self.resistances(dv) {
            matrix.add_to_diagonal(node, &self.projected(node, &block));
        }
        matrix
    }

    /// S M S of a node.
    fn projected(&self, node: usize, m: &Matrix<f64, D>) -> Matrix<f64, D> {
        self.step.boundary.freedoms[node].projection().map_or(*m, |s| mul(&mul(&s, m), &s))
    }

    /// Stiffness of what faces do to particles.
    fn pressed(&self, dv: &NodeVectors<D>) -> AtParticles<D> {
        self.faces.stiffness(&self.faces.responses(&self.step.velocities(dv)))
    }

    /// dt² V0 share K of every particle (kg m²), K of
    /// [`gridfall_core::material::Projected::spatial`]; for assembly and products. `derivative` gets a
    /// particle's law, its deformation gradient at the step's end and its number.
    fn tensors(
        &self,
        dv: &NodeVectors<D>,
        derivative: impl Fn(&Law<f64>, &Matrix<f64, D>, usize) -> Projected<f64, D> + Sync,
    ) -> Vec<Tensor4<f64, D>> {
        let velocities = self.step.velocities(dv);
        let of_group = |group: usize| {
            let mut tensors = Vec::new();
            self.with_values(group, &velocities, |p, local| {
                let body = &self.bodies[self.step.state.body[p] as usize];
                let factor = self.step.dt * self.step.dt * body.volume0 * self.share();
                let mut k = derivative(&body.law, &self.deformed(p, local), p).spatial(&self.step.state.f[p]);
                k.iter_mut().flatten().flatten().flatten().for_each(|x| *x *= factor);
                tensors.push(k);
            });
            tensors
        };
        let groups = (0..self.step.topology.groups()).into_par_iter().with_min_len(8);
        groups.map(of_group).collect::<Vec<_>>().into_iter().flatten().collect()
    }

    /// The tensors of the projected Hessian at Δv, elastic within the step.
    fn elastic_tensors(&self, dv: &NodeVectors<D>) -> Vec<Tensor4<f64, D>> {
        self.tensors(dv, |law, f, p| law.projected_derivative(f, self.step.state.plastic[p]))
    }
}

/// R(end) R(start)ᵀ start: the start's stretch, turned to the end.
fn turned<const D: usize>(end: &Matrix<f64, D>, start: &Matrix<f64, D>) -> Matrix<f64, D> {
    let stretch = mul(&transpose(&polar_rotation(start)), start);
    mul(&polar_rotation(end), &stretch)
}

/// A sum in the order of the values, in parts, so that rounding grows slowly.
fn sum(values: impl Iterator<Item = f64>) -> f64 {
    let (mut total, mut part, mut count) = (0.0, 0.0, 0);
    for value in values {
        part += value;
        count += 1;
        if count == 128 {
            total += part;
            (part, count) = (0.0, 0);
        }
    }
    total + part
}

/// S u of nodes that are not free.
fn project<const D: usize>(freedoms: &[Freedom<D>], field: &mut NodeVectors<D>) {
    for (freedom, u) in freedoms.iter().zip(field) {
        if let Some(s) = freedom.projection() {
            *u = apply(&s, u);
        }
    }
}

impl<const D: usize> Objective<D> for Potential<'_, D> {
    fn nodes(&self) -> &[NodeId<D>] {
        &self.step.topology.nodes[..self.step.boundary.freedoms.len()]
    }

    fn freedoms(&self) -> &[Freedom<D>] {
        &self.step.boundary.freedoms
    }

    fn period(&self) -> [Option<i32>; D] {
        period(self.setup)
    }

    fn canceled(&self) -> bool {
        self.control.canceled()
    }

    fn masses(&self) -> &[f64] {
        &self.masses
    }

    fn scales(&self) -> &[f64] {
        &self.scales
    }

    /// Free fall; if that is a state that a material forbids, the nodes at rest (in their sliding
    /// directions).
    fn start(&self) -> NodeVectors<D> {
        if let Some((_, solved)) = &self.friction {
            return solved.clone();
        }
        let n = self.step.unknowns();
        let step = |velocities: &[Vector<f64, D>]| -> NodeVectors<D> {
            let nodes = velocities[..n].iter().zip(&self.step.nodes);
            nodes.map(|(v, node)| std::array::from_fn(|a| v[a] - node.velocity[a])).collect()
        };
        let falling = step(&self.step.boundary.velocities);
        if self.energy(&falling).is_finite() {
            return falling;
        }
        let mut moving: NodeVectors<D> = self.step.boundary.velocities[..n].to_vec();
        project(&self.step.boundary.freedoms, &mut moving);
        let rest: NodeVectors<D> = self.step.boundary.velocities[..n]
            .iter()
            .zip(&moving)
            .map(|(v, moving)| std::array::from_fn(|a| v[a] - moving[a]))
            .collect();
        step(&rest)
    }

    fn energy(&self, dv: &NodeVectors<D>) -> f64 {
        let velocities = self.step.velocities(dv);
        let pressed = self.faces.energy(&self.faces.responses(&velocities)) / self.share();
        self.stresses(&velocities, None) + self.inertia(dv) + self.dissipation(&velocities) + pressed
    }

    fn energy_and_gradient(&self, dv: &NodeVectors<D>, gradient: &mut NodeVectors<D>) -> f64 {
        let (energy, mut forces) = self.energy_and_forces(dv);
        let velocities = self.step.velocities(dv);
        self.complete(&velocities, &mut forces);
        *gradient = forces;
        energy + self.dissipation(&velocities)
    }

    fn hessian(&self, dv: &NodeVectors<D>) -> Bsr<f64, D> {
        self.matrix(dv, &self.elastic_tensors(dv))
    }

    fn tangent(&self, dv: &NodeVectors<D>, elastic: bool) -> Bsr<f64, D> {
        let derivative = |law: &Law<f64>, f: &Matrix<f64, D>, p: usize| {
            let (start, plastic) = (&self.step.state.f[p], self.step.state.plastic[p]);
            if self.flowing && law.is_plastic() && !elastic {
                law.flowing_derivative(f, plastic)
            } else {
                law.projected_derivative(&turned(f, start), plastic)
            }
        };
        self.matrix(dv, &self.tensors(dv, derivative))
    }

    fn reach(&self, p: &NodeVectors<D>) -> f64 {
        if !self.flowing {
            return 1.0;
        }
        let of_group = |group: usize| {
            let mut most = 0.0f64;
            self.with_values(group, p, |particle, local| {
                if self.bodies[self.step.state.body[particle] as usize].law.is_plastic() {
                    let strain = self.gradient_of(particle, local).map(|row| row.map(|x| self.step.dt * x));
                    most = most.max(double_dot(&strain, &strain));
                }
            });
            most
        };
        let groups = (0..self.step.topology.groups()).into_par_iter().with_min_len(8);
        let most = groups.map(of_group).reduce(|| 0.0, f64::max).sqrt();
        reach_of(most)
    }

    fn renew(&mut self, dv: &NodeVectors<D>) -> Renewed {
        self.faces.renew(&self.step.velocities(dv))
    }

    /// An error ε of velocities in the norm of the Hessian is one of ε √M ‖v‖ √ΣK dt of the faces' impulse.
    fn sharpness(&self) -> f64 {
        let mass = self.share() * sum(self.masses.iter().copied());
        1.0 / (self.step.dt * (self.faces.holding() / mass).sqrt()).max(1.0)
    }

    fn least_change(&self) -> f64 {
        let nodes = &self.step.nodes[..self.step.unknowns()];
        let mass: f64 = sum(self.masses.iter().copied());
        let speed = sum(nodes.iter().map(|node| node.mass * dot(&node.velocity, &node.velocity)));
        let fall = dot(&self.setup.gravity, &self.setup.gravity).sqrt() * self.step.dt;
        (fall * mass.sqrt()).max(UNFELT * speed.sqrt())
    }

    fn linearised<'a>(&'a self, dv: &NodeVectors<D>) -> Box<dyn LinearOperator<D> + 'a> {
        Box::new(Linearised::new(self, dv))
    }

    fn coarse_hessian(&self, dv: &NodeVectors<D>, level: u32) -> (Vec<NodeId<D>>, Bsr<f64, D>) {
        let dx = self.setup.dx * f64::from(1u32 << level);
        let (coarse, order) = self.step.coarsened(self.setup, self.bodies, dx);
        let tensors = self.elastic_tensors(dv);
        let tensors: Vec<_> = order.iter().map(|&p| tensors[p as usize]).collect();
        let masses: Vec<f64> = coarse.nodes[..coarse.unknowns()].iter().map(|node| node.mass).collect();
        let mut points = self.pressed(dv);
        points.of = order.iter().filter_map(|&p| points.of.get(p as usize)).copied().collect();
        let matrix = assembly::assemble(&coarse.topology, &tensors, &points, &masses, &coarse.boundary.freedoms);
        (coarse.topology.nodes[..coarse.unknowns()].to_vec(), matrix)
    }

    fn splitting<'a>(&'a self) -> Box<dyn Splitting<D> + 'a> {
        Box::new(Split(self))
    }
}

#[cfg(test)]
mod tests;
