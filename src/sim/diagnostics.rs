//! What a frame is judged by: conserved quantities, energies and extremes of all particles.

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::moments::moment_matrix;
use super::particles::Particles;
use super::problem::{Problem, Transfer};
use super::reaction::{Reaction, Surface, named_surfaces};
use crate::engine::FrameStats;
use crate::material;

/// One value of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    Count(u64),
    Real(f64),
}

impl From<u64> for Value {
    fn from(n: u64) -> Self {
        Self::Count(n)
    }
}

impl From<f64> for Value {
    fn from(x: f64) -> Self {
        Self::Real(x)
    }
}

/// Declares the row once: the struct, its column names and its values in order.
macro_rules! columns {
    ($($(#[doc = $doc:literal])+ $name:ident: $type:ty,)+) => {
        /// One row of diagnostics. The field names are the columns of the CSV, the keys of the JSON and the fields of the protobuf.
        #[derive(Clone, Debug, Default, PartialEq)]
        #[allow(non_snake_case)]
        pub struct Row {
            $($(#[doc = $doc])+ pub $name: $type,)+
            /// What the problem's surfaces bear, by [`named_surfaces`]; their columns follow the fixed ones.
            pub reactions: Vec<(Surface, Reaction)>,
        }

        impl Row {
            /// Names of the columns that all scenes have, in order.
            pub const COLUMNS: &'static [&'static str] = &[$(stringify!($name)),+];

            /// The values of these columns, in order.
            pub fn values(&self) -> [Value; Self::COLUMNS.len()] {
                [$(self.$name.into()),+]
            }
        }
    };
}

columns! {
    /// Frame number; 0 is the initial state.
    frame: u64,
    /// Simulated time (s).
    time_s: f64,
    /// Sub-steps of this frame.
    steps: u64,
    /// Their mean length (s).
    dt_s: f64,
    /// Total mass (kg; 2D: kg/m, and so on for all that follows).
    mass_kg: f64,
    /// Linear momentum (kg m/s).
    momentum_x: f64,
    /// Linear momentum (kg m/s).
    momentum_y: f64,
    /// Linear momentum (kg m/s).
    momentum_z: f64,
    /// Angular momentum about the origin, the affine part included (kg m²/s).
    angular_momentum_x: f64,
    /// Angular momentum about the origin, the affine part included (kg m²/s).
    angular_momentum_y: f64,
    /// Angular momentum about the origin, the affine part included (kg m²/s).
    angular_momentum_z: f64,
    /// Σ ½ m v² of the particles (J).
    kinetic_j: f64,
    /// Σ ½ m tr(B Cᵀ), the kinetic energy of the affine velocities (J).
    affine_j: f64,
    /// Σ V0 ψ(F), the stored energy of the materials (J).
    strain_j: f64,
    /// −Σ m g·x, the potential of gravity, zero at the origin (J).
    gravity_j: f64,
    /// Largest particle speed (m/s).
    max_speed: f64,
    /// Smallest volume ratio det F.
    min_J: f64,
    /// Particles reset because they were alone on their nodes, in this frame.
    isolated_reset: u64,
}

impl Row {
    /// Measures a frame. Sums run in f64 in an order that depends on the particles alone, with compensation, so that the
    /// result is the same for any number of threads and accurate to a few units in the last place.
    ///
    /// A particle stands for the velocity field v + C (x − x_p) weighted by its kernel. With B = Σ w v (x_i − x_p)ᵀ and
    /// D = Σ w (x_i − x_p)(x_i − x_p)ᵀ, its angular momentum beyond x_p × v is L_k = ε_kij B_ji, and its kinetic energy
    /// beyond ½ v² is ½ tr(B Cᵀ), C = B D⁻¹ (Jiang et al. 2015, "The affine particle-in-cell method", §5). PIC has neither.
    pub fn measure(problem: &Problem, particles: &Particles, frame: u64, time_s: f64, stats: &FrameStats) -> Self {
        let partials: Vec<Tally> = (0..particles.len())
            .into_par_iter()
            .chunks(CHUNK)
            .map(|chunk| {
                let mut tally = Tally::default();
                chunk.into_iter().for_each(|p| tally.add_particle(problem, particles, p));
                tally
            })
            .collect();
        let mut total = Tally::default();
        partials.iter().for_each(|partial| total.merge(partial));
        let [mass_kg, px, py, pz, lx, ly, lz, kinetic_j, affine_j, strain_j, gravity_j] =
            total.sums.map(|sum| sum.value());
        Self {
            frame,
            time_s,
            steps: stats.steps,
            dt_s: stats.dt_s,
            mass_kg,
            momentum_x: px,
            momentum_y: py,
            momentum_z: pz,
            angular_momentum_x: lx,
            angular_momentum_y: ly,
            angular_momentum_z: lz,
            kinetic_j,
            affine_j,
            strain_j,
            gravity_j,
            max_speed: total.max_speed2.sqrt(),
            min_J: total.min_j,
            isolated_reset: stats.isolated_reset,
            reactions: named_surfaces(problem)
                .into_iter()
                .map(|surface| {
                    let reaction = stats.reactions.get(surface.index).copied().unwrap_or_default();
                    (surface, reaction)
                })
                .collect(),
        }
    }

    /// The header line of the CSV, without line end. What would break a line in a collider's name is written `_`.
    pub fn csv_header(problem: &Problem) -> String {
        let surfaces = named_surfaces(problem);
        let plain = |name: String| name.replace(|c: char| c.is_control() || c == ',' || c == '"', "_");
        let dynamic = surfaces.iter().flat_map(Surface::columns).map(plain);
        Self::COLUMNS.iter().map(|name| name.to_string()).chain(dynamic).collect::<Vec<_>>().join(",")
    }

    /// The row as a line of CSV, without line end. Numbers round-trip.
    pub fn csv(&self) -> String {
        let dynamic = self.reactions.iter().flat_map(|(surface, reaction)| surface.values(reaction).map(Value::Real));
        let cells = self.values().into_iter().chain(dynamic).map(|value| match value {
            Value::Count(n) => n.to_string(),
            Value::Real(x) => format!("{x:?}"),
        });
        cells.collect::<Vec<_>>().join(",")
    }
}

/// Particles summed in sequence by one task.
const CHUNK: usize = 4096;

/// Running sums and extremes.
#[derive(Clone, Copy)]
struct Tally {
    /// mass, momentum (3), angular momentum (3), kinetic, affine, strain, gravity.
    sums: [Sum; 11],
    max_speed2: f64,
    min_j: f64,
}

impl Default for Tally {
    fn default() -> Self {
        Self { sums: [Sum::default(); 11], max_speed2: 0.0, min_j: f64::INFINITY }
    }
}

impl Tally {
    fn add_particle(&mut self, problem: &Problem, particles: &Particles, p: usize) {
        let (x, v, f) = (particles.x[p], particles.v[p], &particles.f[p]);
        let body = &problem.bodies[particles.body[p] as usize];
        let m = body.mass;
        let b = if problem.transfer == Transfer::Pic { [0.0; 9] } else { particles.b[p] };
        let c = affine_velocity(problem, x, &b);
        let spin = cross(x, v);
        let speed2 = dot(v, v);
        let terms = [
            m,
            m * v[0],
            m * v[1],
            m * v[2],
            m * (spin[0] + b[7] - b[5]),
            m * (spin[1] + b[2] - b[6]),
            m * (spin[2] + b[3] - b[1]),
            0.5 * m * speed2,
            0.5 * m * (0..9).map(|k| b[k] * c[k]).sum::<f64>(),
            body.volume0
                * material::energy_density(
                    &problem.materials[body.material],
                    problem.dimension,
                    f,
                    particles.plastic[p],
                ),
            -m * dot(problem.gravity, x),
        ];
        self.sums.iter_mut().zip(terms).for_each(|(sum, term)| sum.add(term));
        self.max_speed2 = self.max_speed2.max(speed2);
        self.min_j = self.min_j.min(determinant(f));
    }

    fn merge(&mut self, other: &Self) {
        self.sums.iter_mut().zip(other.sums).for_each(|(sum, part)| {
            sum.add(part.sum);
            sum.add(part.correction);
        });
        self.max_speed2 = self.max_speed2.max(other.max_speed2);
        self.min_j = self.min_j.min(other.min_j);
    }
}

/// Neumaier's compensated sum.
#[derive(Clone, Copy, Default)]
struct Sum {
    sum: f64,
    correction: f64,
}

impl Sum {
    fn add(&mut self, x: f64) {
        let t = self.sum + x;
        self.correction += if self.sum.abs() >= x.abs() { (self.sum - t) + x } else { (x - t) + self.sum };
        self.sum = t;
    }

    fn value(self) -> f64 {
        self.sum + self.correction
    }
}

/// C = B D⁻¹ at a particle (1/s), row-major.
fn affine_velocity(problem: &Problem, x: [f64; 3], b: &[f64; 9]) -> [f64; 9] {
    let position = std::array::from_fn(|a| (x[a] - problem.origin[a]) / problem.dx);
    let mut d = moment_matrix(problem.kernel, position, problem.dx, problem.dimension);
    for a in 0..3 {
        // The empty third axis of 2D, and the linear kernel on a node: there B is zero too.
        if d[4 * a] < 1e-12 * problem.dx * problem.dx {
            d[4 * a] = problem.dx * problem.dx;
        }
    }
    let inverse = Matrix3::from_row_slice(&d).try_inverse().expect("D is positive definite");
    let c = Matrix3::from_row_slice(b) * inverse;
    std::array::from_fn(|k| c[(k / 3, k % 3)])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// det F, rows first.
pub fn determinant(f: &[f64; 9]) -> f64 {
    dot([f[0], f[1], f[2]], cross([f[3], f[4], f[5]], [f[6], f[7], f[8]]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::schema::{Elastic, Implicit, Integrator, Kernel, Material, Precision};
    use crate::sim::particles::IDENTITY;
    use crate::sim::problem::{Axis, Body};

    /// A cube of 20³ particles of 1 m³ and 2 kg in all, at rest.
    fn cube(kernel: Kernel, transfer: Transfer) -> Problem {
        let mut particles = Particles::default();
        for k in 0..8000 {
            particles.x.push([k % 20, k / 20 % 20, k / 400].map(|i| 3.0 + (i as f64 + 0.5) / 20.0));
            particles.v.push([0.0; 3]);
            particles.b.push([0.0; 9]);
            particles.f.push(IDENTITY);
            particles.plastic.push(0.0);
            particles.body.push(0);
        }
        let elastic = Elastic { density: 2.0, youngs_modulus: 100.0, poissons_ratio: 0.25 };
        let body =
            Body { name: "cube".into(), material: 0, particles: 0..8000, volume0: 1.0 / 8000.0, mass: 2.0 / 8000.0 };
        Problem {
            name: "cube".into(),
            dimension: 3,
            origin: [0.0; 3],
            dx: 0.1,
            cells: [80; 3],
            axes: [Axis::Periodic; 3],
            gravity: [0.0, 0.0, -10.0],
            materials: vec![Material::FixedCorotated(elastic)],
            bodies: vec![body],
            sources: vec![],
            colliders: vec![],
            particles,
            kernel,
            transfer,
            precision: Precision::F64,
            cfl: 0.5,
            max_dt_s: None,
            integrator: Integrator::Explicit,
            implicit: Implicit::default(),
            frames: 1,
            frame_s: 0.1,
            fields: vec![],
            preview_points: 1,
            seed: 1,
        }
    }

    fn measure(problem: &Problem) -> Row {
        Row::measure(
            problem,
            &problem.particles,
            3,
            0.3,
            &FrameStats { steps: 4, dt_s: 0.025, isolated_reset: 1, reactions: vec![], solves: vec![] },
        )
    }

    /// Gives every particle the velocity ω × (x − center) and the affine state that goes with it, B = [ω]ₓ D.
    fn spin(problem: &mut Problem, omega: [f64; 3], center: [f64; 3]) {
        let [x, y, z] = omega;
        let skew = Matrix3::new(0.0, -z, y, z, 0.0, -x, -y, x, 0.0);
        for p in 0..problem.particles.len() {
            let at = problem.particles.x[p];
            let d = moment_matrix(problem.kernel, at.map(|c| c / problem.dx), problem.dx, 3);
            let b = skew * Matrix3::from_row_slice(&d);
            problem.particles.v[p] = cross(omega, std::array::from_fn(|a| at[a] - center[a]));
            problem.particles.b[p] = std::array::from_fn(|k| b[(k / 3, k % 3)]);
        }
    }

    fn assert_close(value: f64, expected: f64, what: &str) {
        assert!((value - expected).abs() <= 1e-12 * expected.abs().max(1.0), "{what}: {value} against {expected}");
    }

    #[test]
    fn a_body_at_rest() {
        let row = measure(&cube(Kernel::Compact, Transfer::Mls));
        assert_eq!((row.frame, row.time_s, row.steps, row.dt_s, row.isolated_reset), (3, 0.3, 4, 0.025, 1));
        assert_close(row.mass_kg, 2.0, "mass");
        assert_close(row.gravity_j, 2.0 * 10.0 * 3.5, "m g h of the centre");
        let still = [row.momentum_x, row.angular_momentum_z, row.kinetic_j, row.affine_j, row.strain_j, row.max_speed];
        assert_eq!(still, [0.0; 6]);
        assert_eq!(row.min_J, 1.0);
    }

    #[test]
    fn a_rigid_rotation_has_the_momentum_and_energy_of_its_inertia() {
        // Angular momentum about the origin of a body that spins about its own centre: I ω, the affine part included.
        // Particles carry the inertia of the points; each adds that of its kernel, Σ m (tr D − D) per unit of ω.
        let (omega, center) = ([0.3, -0.7, 1.1], [3.5; 3]);
        for kernel in [Kernel::Compact, Kernel::Quadratic, Kernel::Cubic, Kernel::Linear] {
            let mut problem = cube(kernel, Transfer::Apic);
            spin(&mut problem, omega, center);
            let mut inertia = Matrix3::zeros();
            for x in &problem.particles.x {
                let r = nalgebra::Vector3::from_fn(|a, _| x[a] - center[a]);
                let d = moment_matrix(kernel, x.map(|c| c / problem.dx), problem.dx, 3);
                let second = r * r.transpose() + Matrix3::from_row_slice(&d);
                inertia += problem.bodies[0].mass * (Matrix3::identity() * second.trace() - second);
            }
            let expected = inertia * nalgebra::Vector3::from(omega);
            let row = measure(&problem);
            assert_close(row.angular_momentum_x, expected.x, "L_x");
            assert_close(row.angular_momentum_y, expected.y, "L_y");
            assert_close(row.angular_momentum_z, expected.z, "L_z");
            let energy = 0.5 * expected.dot(&nalgebra::Vector3::from(omega));
            assert_close(row.kinetic_j + row.affine_j, energy, "½ ω·I ω");
            assert!(row.affine_j > 0.0);
        }
    }

    #[test]
    fn the_affine_part_of_pic_does_not_count() {
        let mut problem = cube(Kernel::Quadratic, Transfer::Pic);
        spin(&mut problem, [0.0, 0.0, 1.0], [3.5; 3]);
        assert_eq!(measure(&problem).affine_j, 0.0);
    }

    #[test]
    fn stored_energy_of_a_stretch() {
        let mut problem = cube(Kernel::Compact, Transfer::Mls);
        problem.particles.f.iter_mut().for_each(|f| f[0] = 0.9);
        let row = measure(&problem);
        // ψ = µ e² + ½ λ e², with µ = λ = 40 Pa, over 1 m³.
        assert_close(row.strain_j, 1.5 * 40.0 * 0.01, "strain energy");
        assert_close(row.min_J, 0.9, "J");
    }

    #[test]
    fn sums_do_not_depend_on_threads_and_keep_small_terms() {
        let mut problem = cube(Kernel::Compact, Transfer::Mls);
        // Large momenta that cancel, and small ones; products with this mass are exact.
        problem.bodies[0].mass = 1.0 / 4096.0;
        problem.particles.v.iter_mut().enumerate().for_each(|(p, v)| v[0] = if p % 2 == 0 { 1e12 } else { -1e12 });
        problem.particles.v[5][1] = 1.0;
        problem.particles.v[17][0] += 3.0;
        let row = measure(&problem);
        assert_eq!((row.momentum_x, row.momentum_y), (3.0 / 4096.0, 1.0 / 4096.0));
        for threads in [1, 2, 5] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert_eq!(pool.install(|| measure(&problem)), row);
        }
    }

    #[test]
    fn surfaces_have_columns_behind_the_fixed_ones() {
        use crate::scene::{self, Limits};
        let scene = r#"{ "gridfall": 1, "name": "t", "dimension": 2,
            "domain": { "min": [0, 0], "max": [1, 1], "dx": 0.125, "boundary": { "x": "periodic" } },
            "materials": { "m": { "model": "neo-hookean", "density": 1000, "youngs_modulus": 1e5, "poissons_ratio": 0.3 } },
            "bodies": [ { "name": "b", "material": "m", "shape": { "box": { "min": [0.25, 0.25], "max": [0.5, 0.5] } } } ],
            "colliders": [ { "name": "a, b", "contact": "slip", "shape": { "sphere": { "center": [0.5, 0.5], "radius": 0.1 } } } ],
            "time": { "end": 1 } }"#;
        let problem = scene::problem(&scene::parse(scene).unwrap(), &Limits::default()).unwrap();
        let reactions = (0..7).map(|n| Reaction { force: [f64::from(n); 3], torque: [0.5; 3] }).collect();
        let stats = FrameStats { reactions, ..FrameStats::default() };
        let row = Row::measure(&problem, &problem.particles, 1, 0.1, &stats).csv();
        let header = Row::csv_header(&problem);
        let columns: Vec<(&str, &str)> = header.split(',').zip(row.split(',')).skip(Row::COLUMNS.len()).collect();
        let expected = [
            ("wall_y-.force_x", "2.0"),
            ("wall_y-.force_y", "2.0"),
            ("wall_y-.force_z", "2.0"),
            ("wall_y+.force_x", "3.0"),
            ("wall_y+.force_y", "3.0"),
            ("wall_y+.force_z", "3.0"),
            ("a_ b.force_x", "6.0"),
            ("a_ b.force_y", "6.0"),
            ("a_ b.force_z", "6.0"),
            ("a_ b.torque_x", "0.5"),
            ("a_ b.torque_y", "0.5"),
            ("a_ b.torque_z", "0.5"),
        ];
        assert_eq!(columns, expected);
        assert_eq!(header.split(',').count(), row.split(',').count());
        // Frame 0 has no forces.
        let first = Row::measure(&problem, &problem.particles, 0, 0.0, &FrameStats::default());
        assert_eq!(first.reactions.len(), 3);
        assert!(first.reactions.iter().all(|(_, reaction)| *reaction == Reaction::default()));
    }
}
