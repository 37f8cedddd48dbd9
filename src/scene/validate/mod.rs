//! Meaning: whether the numbers of a scene make sense together. Every fault is found; what depends on a faulty value is skipped.

pub mod material;
pub mod motion;
mod points;
pub mod shape;
mod solver;

use std::collections::BTreeMap;
use std::fmt::Display;

use crate::Limits;
use crate::build::solid::{sdf, vector3};
use crate::build::sources::check_source;
use crate::build::{cells, determinant, lattice, particles_per_cell};
use crate::estimate;
use crate::fault::{Faults, join, plain};
use crate::sampling::Lattice;
use crate::sampling::poisson;
use crate::schema::{Body, Boundary, ContactKind, Domain, Output, Sampling, Scene, Shape, Time};
use crate::suggest::{closest, list, quote};
use crate::validate::material::check_material;
use crate::validate::motion::check_colliders;
use crate::validate::points::check_points;
use crate::validate::shape::check_shape;
use crate::validate::solver::check_solver;

/// Frames of one run at most.
const MAX_FRAMES: f64 = 100_000.0;
/// Cells along one axis at most.
const MAX_CELLS: f64 = 65_536.0;
/// Lattice points that may be looked at for one body; its particles are limited far below.
const MAX_CANDIDATES: f64 = 1e15;
/// Points of a recorded frame at most.
const MAX_PREVIEW_POINTS: u32 = 100_000_000;

/// Judges a scene of sound structure. Its dimension-dependent parts are judged if the dimension is known.
pub fn check(scene: &Scene, limits: &Limits, faults: &mut Faults) {
    if scene.gridfall != 1 {
        faults.add(
            "/gridfall",
            "unsupported_version",
            format!("version {} of the scene format is not known", scene.gridfall),
            "write 1",
        );
    }
    if !(2..=3).contains(&scene.dimension) {
        faults.add("/dimension", "out_of_range", format!("{} dimensions", scene.dimension), "write 2 or 3");
    }
    let mut check = Check { scene, dimension: scene.dimension as usize, limits, faults };
    check.name("/name", &scene.name);
    if let Some(gravity) = &scene.gravity {
        check.vector("/gravity", gravity);
    }
    check.domain(&scene.domain);
    for (name, material) in &scene.materials {
        check_material(&mut check, &join("/materials", name), material);
    }
    check.time(&scene.time);
    check.bodies();
    check_colliders(&mut check, scene);
    check_solver(&mut check, &scene.solver);
    check.output(&scene.output);
}

pub(crate) struct Check<'a> {
    pub scene: &'a Scene,
    pub dimension: usize,
    limits: &'a Limits,
    pub faults: &'a mut Faults,
}

impl Check<'_> {
    /// True when the scene's dimension is known.
    pub fn has_dimension(&self) -> bool {
        self.faults.clean("/dimension")
    }

    /// True when nothing is wrong with the grid.
    pub fn has_grid(&self) -> bool {
        ["/dimension", "/domain/min", "/domain/max", "/domain/dx"].iter().all(|at| self.faults.clean(at))
    }

    pub fn name(&mut self, at: &str, name: &str) {
        if name.trim().is_empty() {
            self.faults.add(at, "empty", "the name is empty", "give it a name");
        } else if name.chars().count() > 200 {
            self.faults.add(at, "too_long", "the name is longer than 200 characters", "shorten it");
        }
    }

    pub fn finite(&mut self, at: &str, value: f64) -> bool {
        if !value.is_finite() {
            self.faults.add(at, "not_finite", format!("is {value}"), "write a finite number");
        }
        value.is_finite()
    }

    pub fn positive(&mut self, at: &str, value: f64, what: &str) {
        if self.finite(at, value) && value <= 0.0 {
            self.faults.add(at, "not_positive", format!("{what} is {value}"), "write a number above 0");
        }
    }

    pub fn not_negative(&mut self, at: &str, value: f64, what: &str) {
        if self.finite(at, value) && value < 0.0 {
            self.faults.add(at, "negative", format!("{what} is {value}"), "write 0 or a number above 0");
        }
    }

    /// A vector of the scene's dimension with finite components.
    pub fn vector(&mut self, at: &str, v: &[f64]) {
        if self.has_dimension() {
            self.vector_of(at, v, self.dimension);
        }
    }

    pub fn vector_of(&mut self, at: &str, v: &[f64], length: usize) {
        if v.len() != length {
            let reason = format!("has {} components in a scene of {} dimensions", v.len(), self.dimension);
            self.faults.add(at, "wrong_length", reason, format!("write {length}"));
            return;
        }
        for (a, value) in v.iter().enumerate() {
            self.finite(&join(at, a), *value);
        }
    }

    pub fn angular(&mut self, at: &str, w: &[f64]) {
        if self.has_dimension() {
            self.vector_of(at, w, if self.dimension == 2 { 1 } else { 3 });
        }
    }

    fn matrix(&mut self, at: &str, m: &[Vec<f64>]) {
        if !self.has_dimension() {
            return;
        }
        let d = self.dimension;
        if m.len() != d {
            let reason = format!("has {} rows in a scene of {d} dimensions", m.len());
            self.faults.add(at, "wrong_length", reason, format!("write {d} rows of {d} numbers"));
            return;
        }
        for (i, row) in m.iter().enumerate() {
            self.vector(&join(at, i), row);
        }
    }

    fn domain(&mut self, domain: &Domain) {
        self.vector("/domain/min", &domain.min);
        self.vector("/domain/max", &domain.max);
        self.positive("/domain/dx", domain.dx, "the grid spacing");
        if self.has_grid() {
            let n = cells(domain, self.dimension);
            for a in 0..self.dimension {
                self.extent(&join("/domain/max", a), domain, a, n[a]);
            }
        }
        for (key, boundary) in &domain.boundary {
            self.boundary(&join("/domain/boundary", key), key, boundary);
        }
        for axis in ["x", "y", "z"] {
            let sides = [format!("{axis}-"), format!("{axis}+")];
            if domain.boundary.contains_key(axis) && sides.iter().any(|side| domain.boundary.contains_key(side)) {
                let at = join("/domain/boundary", axis);
                let reason = format!("`{axis}` is given beside `{axis}-` or `{axis}+`");
                let remedy = format!("keep `{axis}` for both walls, or `{axis}-` and `{axis}+` for one each");
                self.faults.add(&at, "conflicting_walls", reason, remedy);
            }
        }
    }

    fn extent(&mut self, at: &str, domain: &Domain, a: usize, n: f64) {
        let (min, max, dx) = (domain.min[a], domain.max[a], domain.dx);
        if max <= min {
            self.faults.add(at, "empty", format!("max {max} is not above min {min}"), "write a larger max");
        } else if n > MAX_CELLS {
            let reason = format!("makes {n:.0} cells along the axis; {MAX_CELLS} is the most");
            self.faults.add(at, "too_many_cells", reason, "raise dx or shrink the domain");
        } else if n.round() < 1.0 || (n - n.round()).abs() > 1e-6 * n.max(1.0) {
            let (fewer, more) = (plain(min + n.floor().max(1.0) * dx), plain(min + n.ceil() * dx));
            let reason = format!("the domain is {} m long here, which is {n:.4} cells of dx = {dx}", plain(max - min));
            let remedy = format!("make it a whole number of cells: max = {fewer} or {more}, or change dx");
            self.faults.add(at, "not_whole_cells", reason, remedy);
        }
    }

    fn boundary(&mut self, at: &str, key: &str, boundary: &Boundary) {
        let axes = if self.dimension == 2 { 2 } else { 3 };
        let keys: Vec<String> =
            ["x", "y", "z"][..axes].iter().flat_map(|a| ["", "-", "+"].map(|side| format!("{a}{side}"))).collect();
        if !keys.iter().any(|k| k == key) {
            let remedy = format!("name one of {}", list(keys.iter().map(String::as_str)));
            self.faults.add(at, "unknown_wall", format!("there is no wall {}", quote(key)), remedy);
            return;
        }
        match boundary {
            Boundary::Wall(wall) => self.contact(at, wall.contact, wall.friction),
            Boundary::Periodic(_) if key.len() > 1 => {
                let remedy = format!("write \"{}\": \"periodic\" for both walls of the axis", &key[..1]);
                self.faults.add(at, "periodic_wall", "one wall alone cannot be periodic", remedy);
            }
            Boundary::Periodic(_) if self.has_grid() => {
                let a = ["x", "y", "z"].iter().position(|axis| *axis == key).unwrap_or(0);
                let n = cells(&self.scene.domain, self.dimension)[a].round();
                if n % 4.0 != 0.0 {
                    let reason = format!("a periodic axis of {n} cells; the grid's blocks of 4 cells must close up");
                    let remedy =
                        format!("make it {} or {} cells", (n / 4.0).floor().max(1.0) * 4.0, (n / 4.0).ceil() * 4.0);
                    self.faults.add(at, "periodic_cells", reason, remedy);
                }
            }
            Boundary::Periodic(_) => {}
        }
    }

    pub fn contact(&mut self, at: &str, kind: ContactKind, friction: f64) {
        let known = self.faults.clean(&join(at, "contact"));
        let at = join(at, "friction");
        self.not_negative(&at, friction, "the friction coefficient");
        if known && friction != 0.0 && kind != ContactKind::Separate {
            let reason = "only the contact `separate` has friction";
            self.faults.add(&at, "friction_unused", reason, "take the friction out, or write `separate`");
        }
    }

    pub fn unique(&mut self, names: impl Iterator<Item = (String, String)>) {
        let mut seen: BTreeMap<String, String> = BTreeMap::new();
        for (at, name) in names {
            self.name(&at, &name);
            if let Some(first) = seen.get(&name) {
                let reason = format!("the name {} is taken by {first}", quote(&name));
                self.faults.add(&at, "duplicate_name", reason, "give it a name of its own");
            } else {
                seen.insert(name, at.trim_end_matches("/name").to_owned());
            }
        }
    }

    fn bodies(&mut self) {
        let scene = self.scene;
        if scene.bodies.is_empty() && scene.sources.is_empty() {
            self.faults.add("/bodies", "empty", "there are no bodies", "add at least one, or a source");
        }
        let bodies = scene.bodies.iter().enumerate().map(|(n, body)| (format!("/bodies/{n}/name"), body.name.clone()));
        let sources = scene.sources.iter().enumerate().map(|(n, s)| (format!("/sources/{n}/name"), s.name.clone()));
        self.unique(bodies.chain(sources));
        let (mut total, mut counted) = (0, true);
        for (n, body) in scene.bodies.iter().enumerate() {
            match self.body(&format!("/bodies/{n}"), body) {
                Some(particles) => total += particles,
                None => counted = false,
            }
        }
        let most = self.most_particles();
        for (n, source) in scene.sources.iter().enumerate() {
            match check_source(self, &format!("/sources/{n}"), scene, source, most) {
                Some(particles) => total += particles,
                None => counted = false,
            }
        }
        let limit = self.limits.max_particles;
        if total > limit {
            let reason = format!("{total} particles; the limit is {limit}");
            let remedy = "raise dx, lower particles_per_cell or shrink the bodies";
            self.faults.add("/bodies", "too_many_particles", reason, remedy);
        } else if counted && self.has_grid() {
            let cells = cells(&scene.domain, self.dimension).map(|n| n.round() as u64);
            let (bytes, limit) =
                (estimate::memory_bytes(total, cells, scene.solver.integrator), self.limits.max_memory_bytes);
            if bytes > limit {
                let reason = format!(
                    "{total} particles on {cells:?} cells take {} MiB; the limit is {}",
                    bytes >> 20,
                    limit >> 20
                );
                let remedy = "raise dx, lower particles_per_cell, or shrink the bodies or the domain";
                self.faults.add("/bodies", "too_much_memory", reason, remedy);
            }
        }
    }

    /// Particles that one body or source may have.
    fn most_particles(&self) -> u64 {
        self.limits.max_particles.min(self.limits.max_memory_bytes / estimate::HOST_BYTES_PER_PARTICLE)
    }

    /// The `material` of the value at `at`.
    pub fn known_material(&mut self, at: &str, name: &str) {
        let materials: Vec<&str> = self.scene.materials.keys().map(String::as_str).collect();
        if !materials.contains(&name) {
            let remedy = match closest(name, &materials) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("the materials are {}", list(materials.iter().copied())),
            };
            let reason = format!("there is no material {}", quote(name));
            self.faults.add(&join(at, "material"), "unknown_material", reason, remedy);
        }
    }

    /// Judges a body; its number of particles, if that can be told.
    fn body(&mut self, at: &str, body: &Body) -> Option<u64> {
        self.known_material(at, &body.material);
        let (per_cell, per_axis) = particles_per_cell(body, self.dimension);
        if per_axis.is_none() && self.has_dimension() {
            let d = self.dimension;
            let reason = format!("{per_cell} particles do not fill a cell evenly");
            let remedy = match d {
                2 => "write a square: 1, 4, 9, 16, …, or sample by `poisson-disk`",
                _ => "write a cube: 1, 8, 27, 64, …, or sample by `poisson-disk`",
            };
            self.faults.add(&join(at, "particles_per_cell"), "not_a_power", reason, remedy);
        }
        self.initial_state(at, body);
        let shape = match (&body.shape, &body.points) {
            (Some(shape), None) => shape,
            (None, Some(points)) => return check_points(self, at, body, points),
            (shape, _) => {
                let reason = match shape {
                    Some(_) => "`shape` is given beside `points`",
                    None => "the body has neither `shape` nor `points`",
                };
                self.faults.add(&join(at, "shape"), "not_one_source", reason, "give one of `shape` and `points`");
                return None;
            }
        };
        let shape_at = join(at, "shape");
        check_shape(self, &shape_at, shape);
        let judged =
            self.has_grid() && self.faults.clean(&join(at, "particles_per_cell")) && self.faults.clean(&shape_at);
        if judged { self.particles(&shape_at, body, shape, per_axis?) } else { None }
    }

    fn initial_state(&mut self, at: &str, body: &Body) {
        if let Some(velocity) = &body.velocity {
            self.vector(&join(at, "velocity"), velocity);
        }
        if let Some(spin) = &body.angular_velocity {
            self.angular(&join(at, "angular_velocity"), spin);
        }
        if let Some(gradient) = &body.velocity_gradient {
            self.matrix(&join(at, "velocity_gradient"), gradient);
        }
        if let Some(f) = &body.deformation_gradient {
            let at = join(at, "deformation_gradient");
            self.matrix(&at, f);
            if self.faults.clean(&at) && self.has_dimension() {
                let mut m = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
                for (i, row) in f.iter().enumerate() {
                    m[3 * i..3 * i + row.len()].copy_from_slice(row);
                }
                if determinant(&m) <= 0.0 {
                    let reason = format!("its determinant is {}, which turns the body inside out", determinant(&m));
                    self.faults.add(&at, "not_positive", reason, "write a matrix with a positive determinant");
                }
            }
        }
        if let Some(j) = body.j {
            self.positive(&join(at, "J"), j, "the volume ratio");
            if body.deformation_gradient.is_some() {
                let reason = "`J` is given beside `deformation_gradient`";
                self.faults.add(&join(at, "J"), "conflicting_fields", reason, "keep one of them");
            }
        }
    }

    /// Counts the particles of a body without making them, and looks for some outside the domain.
    fn particles(&mut self, at: &str, body: &Body, shape: &Shape, per_axis: f64) -> Option<u64> {
        let (domain, d) = (&self.scene.domain, self.dimension);
        let sdf = sdf(shape, d);
        let whole = lattice(domain, per_axis, &sdf, d);
        let [lower, upper] = sdf.bounds();
        let (min, max) = (vector3(&domain.min), vector3(&domain.max));
        let extent = |v: [f64; 3]| format!("{:?}", &v[..d]);
        let apart = (0..d).any(|a| lower[a] >= max[a] || upper[a] <= min[a]);
        if apart && (0..d).all(|a| lower[a] < upper[a]) {
            let reason = format!("the body spans {} to {}, outside the domain", extent(lower), extent(upper));
            self.faults.add(at, "outside_domain", reason, "move the body or enlarge the domain");
            return None;
        }
        let n = cells(domain, d).map(|n| n.round() as usize);
        let inside = whole.clipped(n, per_axis);
        let sticks_out = whole.candidates() > inside.candidates();
        let most = self.most_particles();
        let count = |lattice: &Lattice| lattice.count(&sdf, most);
        if whole.candidates() > MAX_CANDIDATES && sticks_out {
            let reason = format!("the body spans {} to {}, far beyond the domain", extent(lower), extent(upper));
            self.faults.add(at, "outside_domain", reason, "shrink the body or enlarge the domain");
            return None;
        }
        let counts = if whole.candidates() > MAX_CANDIDATES { None } else { count(&inside).zip(count(&whole)) };
        let Some((particles, all)) = counts else {
            let reason =
                format!("the body has more than {most} particles at a spacing of {} m, the limit", whole.spacing);
            let remedy = "raise dx, lower particles_per_cell or shrink the body";
            self.faults.add(at, "too_many_particles", reason, remedy);
            return None;
        };
        if all > particles {
            let reason = format!(
                "{} of the body's {all} particles are outside the domain: it spans {} to {}, the domain {} to {}",
                all - particles,
                extent(lower),
                extent(upper),
                extent(min),
                extent(max)
            );
            self.faults.add(at, "outside_domain", reason, "move or shrink the body, or enlarge the domain");
            return None;
        }
        if particles == 0 {
            let reason = format!("no particle lies in the shape at a spacing of {} m", whole.spacing);
            let remedy =
                "make the shape larger, lower dx or raise particles_per_cell; a difference may have taken all of it";
            self.faults.add(at, "no_particles", reason, remedy);
            return None;
        }
        if body.sampling == Sampling::PoissonDisk {
            let limit = self.limits.max_memory_bytes;
            if inside.darts().count_cells(&sdf, inside.bounds(), limit / poisson::CELL_BYTES).is_none() {
                let reason = format!("to sample the shape takes more than {} MiB, the limit", limit >> 20);
                self.faults.add(at, "too_much_memory", reason, "raise dx, shrink the body, or write `jittered`");
                return None;
            }
        }
        Some(particles)
    }

    fn time(&mut self, time: &Time) {
        self.positive("/time/end", time.end, "the end");
        self.positive("/time/frame_rate", time.frame_rate, "the frame rate");
        if !self.faults.clean("/time") {
            return;
        }
        let frames = time.end * time.frame_rate;
        if frames > MAX_FRAMES {
            let reason = format!("{frames:.0} frames; {MAX_FRAMES} is the most");
            self.faults.add("/time/end", "too_many_frames", reason, "end earlier or lower frame_rate");
        } else if frames.round() < 1.0 || (frames - frames.round()).abs() > 1e-3 {
            let at = |frames: f64| plain(frames / time.frame_rate);
            let reason = format!("{} s at {} frames a second are {frames:.4} frames", time.end, time.frame_rate);
            let remedy = format!(
                "end on a frame: at {} or {} s, or change frame_rate",
                at(frames.floor().max(1.0)),
                at(frames.ceil().max(2.0))
            );
            self.faults.add("/time/end", "not_whole_frames", reason, remedy);
        }
    }

    fn output(&mut self, output: &Output) {
        if !(1..=MAX_PREVIEW_POINTS).contains(&output.preview_points) {
            let remedy = format!("write a number from 1 to {MAX_PREVIEW_POINTS}");
            let reason = format!("{} points a frame", output.preview_points);
            self.faults.add("/output/preview_points", "out_of_range", reason, remedy);
        }
        for (n, field) in output.fields.iter().enumerate() {
            if output.fields[..n].contains(field) {
                let at = format!("/output/fields/{n}");
                self.faults.add(&at, "duplicate", "the field is named twice", "name it once");
            }
        }
    }

    pub fn fault(&mut self, at: &str, code: &'static str, reason: impl Display, remedy: impl Display) {
        self.faults.add(at, code, reason.to_string(), remedy.to_string());
    }
}
