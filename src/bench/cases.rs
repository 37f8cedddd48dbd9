//! The named cases. Bodies are boxes of whole cells, so that a case has as many particles as it is asked for, within
//! a few of a hundred; dx follows. Laws and their parameters are those of scenes in `scenes/`.

use serde::Deserialize;
use serde_json::{Value, json};

use super::amount::Amount;
use gridfall_core::sim::setup::{Kernel, Precision};

/// Particles of a cell, and along its edge.
const PER_CELL: usize = 8;
/// Cells of a block along its edge.
const BLOCK: usize = 4;

/// A named case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Case {
    /// A column of water that runs out of a corner (`fluid-dam-break-4m`).
    Fluid,
    /// Two fixed-corotated cubes that collide, and turn so that F is not a multiple of I.
    Pair,
    /// A heap of sand that lands and spreads, Drucker–Prager (`sand-spheres`).
    Sand,
    /// A block that breaks on the floor, NACC (`pumpkin-smash`).
    Nacc,
    /// Lead meets tungsten at 300 m/s (`bullet-on-tungsten`).
    Bullet,
}

/// A case's bodies in cells.
pub struct Shape {
    /// Of the domain.
    pub cells: [usize; 3],
    /// Lower corner and extent of each box.
    boxes: Vec<[[usize; 3]; 2]>,
}

impl Shape {
    pub fn particles(&self) -> usize {
        self.boxes.iter().map(|[_, extent]| PER_CELL * extent.iter().product::<usize>()).sum()
    }

    /// Blocks with particles, and those beside them, from above: bodies need not begin where a block does.
    pub fn blocks(&self) -> usize {
        let along = |cells: usize| cells.div_ceil(BLOCK) + 3;
        self.boxes.iter().map(|[_, extent]| extent.iter().map(|&n| along(n)).product::<usize>()).sum()
    }

    /// A box of the bodies as a shape, with a cell of `dx`.
    fn of_box(&self, k: usize, dx: f64) -> Value {
        let [low, extent] = self.boxes[k];
        let min = low.map(|n| n as f64 * dx);
        let max: [f64; 3] = std::array::from_fn(|a| (low[a] + extent[a]) as f64 * dx);
        json!({ "box": { "min": min, "max": max } })
    }
}

/// Cells along the edges of a box with about so many particles, which is `tall` times as high as it is wide.
fn column(particles: usize, tall: f64) -> [usize; 3] {
    let cells = particles as f64 / PER_CELL as f64;
    let wide = ((cells / tall).cbrt().round() as usize).max(2);
    let high = ((cells / (wide * wide) as f64).round() as usize).max(1);
    [wide, wide, high]
}

impl Case {
    pub const ALL: [Self; 5] = [Self::Fluid, Self::Pair, Self::Sand, Self::Nacc, Self::Bullet];

    pub fn name(self) -> &'static str {
        match self {
            Self::Fluid => "fluid",
            Self::Pair => "pair",
            Self::Sand => "sand",
            Self::Nacc => "nacc",
            Self::Bullet => "bullet",
        }
    }

    /// The sizes to measure: those that results are published with, and two small ones for engines on a processor.
    pub fn amounts(self, on_processor: bool) -> &'static [Amount] {
        use Amount::{About, Largest};
        match self {
            _ if on_processor => &[About(17_000), About(262_000)],
            Self::Fluid => &[About(1_000_000), About(4_000_000), About(9_000_000), Largest],
            Self::Pair => &[About(800_000)],
            Self::Sand => &[About(500_000)],
            Self::Nacc => &[About(2_000_000)],
            // The scene's.
            Self::Bullet => &[About(8_500_000)],
        }
    }

    /// Where the bodies are, with about so many particles.
    pub fn shape(self, particles: usize) -> Shape {
        match self {
            Self::Fluid => {
                let [n, _, high] = column(particles, 2.0);
                Shape { cells: [4 * n, 4 * n, 2 * high], boxes: vec![[[0; 3], [n, n, high]]] }
            }
            Self::Pair => {
                let [n, _, high] = column(particles / 2, 1.0);
                // A cell apart, so that they meet soon, and room to grow wide.
                let room = n / 2 + 4;
                let left = [[room; 3], [n, n, high]];
                let right = [[room + n + 1, room, room], [n, n, high]];
                Shape { cells: [2 * (room + n) + 1, 2 * room + n, 2 * room + high], boxes: vec![left, right] }
            }
            Self::Sand => {
                let [n, _, high] = column(particles, 0.5);
                Shape { cells: [3 * n, 3 * n, 2 * high + 4], boxes: vec![[[n, n, 1], [n, n, high]]] }
            }
            Self::Nacc => {
                let [n, _, high] = column(particles, 1.0);
                Shape {
                    cells: [2 * n + 8, 2 * n + 8, high + 8],
                    boxes: vec![[[n / 2 + 4, n / 2 + 4, 1], [n, n, high]]],
                }
            }
            Self::Bullet => {
                let [n, _, high] = column(particles, 1.0);
                let room = n / 4 + 4;
                // A box about as large as the scene's capsule.
                let (wide, long) = ((n / 7).max(1), (n / 5).max(2));
                let middle = |extent: usize| room + (extent - wide) / 2;
                let bullet = [[room, middle(n), middle(high)], [long, wide, wide]];
                let cube = [[room + long + 1, room, room], [n, n, high]];
                let cells = [2 * room + long + 1 + n, 2 * room + n, 2 * room + high];
                Shape { cells, boxes: vec![bullet, cube] }
            }
        }
    }

    /// The scene with about so many particles, as JSON.
    pub fn scene(self, particles: usize, kernel: Kernel, precision: Precision) -> String {
        let shape = self.shape(particles);
        let last = shape.boxes.len() - 1;
        let wide = shape.boxes[last][1][0] as f64;
        let body = |k: usize, dx: f64, material: &str, velocity: [f64; 3]| {
            let shape = shape.of_box(k, dx);
            json!({ "name": format!("body-{k}"), "material": material, "velocity": velocity, "shape": shape })
        };
        let slides = json!({ "contact": "separate" });
        let floor = json!({ "z-": { "contact": "separate", "friction": 0.5 } });
        let (dx, gravity, boundary, materials, bodies) = match self {
            Self::Fluid => {
                let dx = 0.25 / wide;
                let water = json!({ "model": "weakly-compressible-fluid", "density": 1000, "bulk_modulus": 71.5,
                                    "gamma": 7.15, "viscosity": 0.1 });
                // It runs from the start, as it would after a while.
                let bodies = json!([body(0, dx, "water", [0.2, 0.2, 0.0])]);
                let walls = json!({ "x": slides, "y": slides, "z": slides });
                (dx, -2.0, walls, json!({ "water": water }), bodies)
            }
            Self::Pair => {
                let dx = 0.4 / wide;
                let jelly = json!({ "model": "fixed-corotated", "density": 1000, "youngs_modulus": 1e6,
                                    "poissons_ratio": 0.3 });
                let mut bodies = [body(0, dx, "jelly", [1.0, 0.0, 0.0]), body(1, dx, "jelly", [-1.0, 0.0, 0.0])];
                bodies[0]["angular_velocity"] = json!([0, 0, 2]);
                bodies[1]["angular_velocity"] = json!([0, 2, 0]);
                (dx, 0.0, json!({}), json!({ "jelly": jelly }), json!(bodies))
            }
            Self::Sand => {
                let dx = 0.5 / wide;
                let sand = json!({ "model": "drucker-prager", "density": 1600, "youngs_modulus": 1e5,
                                   "poissons_ratio": 0.3, "friction_angle_degrees": 30 });
                let bodies = json!([body(0, dx, "sand", [0.0, 0.0, -2.0])]);
                (dx, -9.81, floor, json!({ "sand": sand }), bodies)
            }
            Self::Nacc => {
                let dx = 0.25 / wide;
                let flesh = json!({ "model": "nacc", "density": 250, "youngs_modulus": 2000, "poissons_ratio": 0.39,
                                    "M": 2.36, "beta": 2, "xi": 3, "alpha0": -0.04 });
                let bodies = json!([body(0, dx, "flesh", [0.0, 0.0, -1.0])]);
                (dx, -2.0, floor, json!({ "flesh": flesh }), bodies)
            }
            Self::Bullet => {
                let dx = 0.1 / wide;
                let law = |density: f64, youngs_modulus: f64, poissons_ratio: f64| {
                    json!({ "model": "fixed-corotated", "density": density, "youngs_modulus": youngs_modulus,
                            "poissons_ratio": poissons_ratio })
                };
                let materials = json!({ "lead": law(11340.0, 15e9, 0.435), "tungsten": law(19250.0, 450e9, 0.27) });
                let bodies = json!([body(0, dx, "lead", [300.0, 0.0, 0.0]), body(1, dx, "tungsten", [0.0; 3])]);
                (dx, -9.8, json!({}), materials, bodies)
            }
        };
        json!({
            "gridfall": 1,
            "name": self.name(),
            "domain": { "min": [0, 0, 0], "max": shape.cells.map(|n| n as f64 * dx), "dx": dx, "boundary": boundary },
            "gravity": [0.0, 0.0, gravity],
            "materials": materials,
            "bodies": bodies,
            "time": { "end": 1 },
            "output": { "fields": [] },
            "solver": { "kernel": kernel, "precision": precision, "integrator": "explicit" },
        })
        .to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::problem;

    fn about(case: Case, wanted: usize, most: f64) {
        let particles = case.shape(wanted).particles() as f64;
        assert!((particles / wanted as f64 - 1.0).abs() < most, "{case:?}: {particles} for {wanted}");
    }

    #[test]
    fn cases_have_as_many_particles_as_their_names_say() {
        for case in Case::ALL {
            for amount in [true, false].into_iter().flat_map(|on_processor| case.amounts(on_processor)) {
                if let Amount::About(wanted) = *amount {
                    about(case, wanted, 0.05);
                }
            }
            about(case, 2_000, 0.15);
            about(case, 44_000_000, 0.02);
        }
    }

    #[test]
    fn shapes_are_those_of_the_scenes() {
        for case in Case::ALL {
            let shape = case.shape(4_000);
            let problem =
                problem(&case.scene(4_000, Kernel::Compact, Precision::F32)).unwrap_or_else(|e| panic!("{e:?}"));
            assert_eq!(problem.particles.len(), shape.particles(), "{case:?}");
            assert_eq!(problem.setup.cells, shape.cells, "{case:?}");
            let blocks = gridfall_scene::estimate::estimate(&problem).blocks as usize;
            assert!(blocks <= shape.blocks() && shape.blocks() < 3 * blocks, "{case:?}: {blocks}, {}", shape.blocks());
        }
    }

    #[test]
    fn names_are_those_of_the_command_line() {
        for case in Case::ALL {
            assert_eq!(serde_json::from_value::<Case>(json!(case.name())).unwrap(), case);
        }
    }
}
