//! What all checks share: the scene, the faults found so far, and rules for single values.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::sync::atomic::Ordering::Relaxed;

use gridfall_core::sim::collider::Sdf;
use gridfall_core::sim::source::Effort;

use crate::fault::{Faults, join};
use crate::limits::Limits;
use crate::names::hidden;
use crate::resolve::Resolved;
use crate::schema::{ContactKind, Scene, Shape};
use crate::shape;
use crate::suggest::{closest, list, quote};
use crate::validate::plausible::{LARGEST, SMALLEST};

/// Most characters of a name.
pub const MAX_NAME: usize = 200;

/// The validation of a scene in progress.
pub struct Check<'a> {
    pub scene: &'a Scene,
    pub resolved: &'a Resolved,
    pub dimension: usize,
    pub limits: &'a Limits,
    pub faults: &'a mut Faults,
    /// Work done so far, in units of [`Limits::max_work`].
    pub work: u64,
}

impl Check<'_> {
    /// Adds a fault, unless the value at `at` is already known to be at fault.
    pub fn fault(&mut self, at: &str, code: &'static str, reason: impl Display, remedy: impl Display) {
        self.faults.add(at, code, reason.to_string(), remedy.to_string());
    }

    /// The distances to a shape that may still be asked for.
    pub fn effort(&self, sdf: &Sdf) -> Effort {
        let left = self.limits.max_work.saturating_sub(self.work);
        Effort::at_most(left / sdf.ops.len().max(1) as u64)
    }

    /// Accounts for an effort. Too much is a fault of the shape at `at`; returns whether it was not.
    pub fn within(&mut self, effort: &Effort, sdf: &Sdf, at: &str) -> bool {
        let parts = sdf.ops.len().max(1) as u64;
        self.work = self.work.saturating_add(effort.spent.load(Relaxed).saturating_mul(parts));
        if effort.is_over() {
            let reason = format!(
                "finding its particles takes too much work: with this shape of {parts} parts, the scene asks for more \
                 than {} distances to parts",
                self.limits.max_work
            );
            let remedy = "write it with fewer parts, make its surface smaller or raise dx; \
                          `gridfall run` has no such limit, and the server's is --max-work";
            self.fault(at, "too_costly", reason, remedy);
        }
        !effort.is_over()
    }

    /// Whether the scene's dimension is valid.
    pub fn has_dimension(&self) -> bool {
        self.faults.clean("/dimension")
    }

    /// Whether the grid is valid.
    pub fn has_grid(&self) -> bool {
        ["/dimension", "/domain/min", "/domain/max", "/domain/dx"].iter().all(|at| self.faults.clean(at))
    }

    pub fn name(&mut self, at: &str, name: &str) {
        if name.trim().is_empty() {
            self.fault(at, "empty", "the name is empty", "give it a name");
        } else if name.chars().count() > MAX_NAME {
            self.fault(at, "too_long", format!("the name is longer than {MAX_NAME} characters"), "shorten it");
        }
        self.legible(at, name);
    }

    /// Checks that a text has no characters that change how the text around them is shown.
    pub fn legible(&mut self, at: &str, text: &str) {
        if let Some(code) = hidden(text) {
            let reason = format!("has the character {code}, which controls terminals, lines or the direction of text");
            self.fault(at, "hidden_character", reason, "take it out");
        }
    }

    /// Checks that a number is finite and not absurdly large, and returns whether it is.
    pub fn finite(&mut self, at: &str, value: f64) -> bool {
        if !value.is_finite() {
            self.fault(at, "not_finite", format!("is {value}"), "write a finite number");
        } else if value.abs() > LARGEST {
            let remedy = format!("write a number up to {LARGEST:e}; scenes are in SI units (m, kg, s)");
            self.fault(at, "implausible", format!("{value:e} is larger than any quantity here can be"), remedy);
        }
        value.abs() <= LARGEST
    }

    pub fn positive(&mut self, at: &str, value: f64, what: &str) {
        if !self.finite(at, value) {
            return;
        }
        if value <= 0.0 {
            self.fault(at, "not_positive", format!("{what} is {value}"), "write a number above 0");
        } else if value < SMALLEST {
            let remedy = format!("write a number from {SMALLEST:e}; scenes are in SI units (m, kg, s)");
            self.fault(at, "implausible", format!("{what} is {value:e}, smaller than it can be"), remedy);
        }
    }

    pub fn not_negative(&mut self, at: &str, value: f64, what: &str) {
        if self.finite(at, value) && value < 0.0 {
            self.fault(at, "negative", format!("{what} is {value}"), "write 0 or a number above 0");
        }
    }

    /// Checks a vector of the scene's dimension.
    pub fn vector(&mut self, at: &str, v: &[f64]) {
        if self.has_dimension() {
            self.vector_of(at, v, self.dimension);
        }
    }

    /// Checks a vector of `length` components.
    pub fn vector_of(&mut self, at: &str, v: &[f64], length: usize) {
        if v.len() != length {
            let reason = format!("has {} components in a scene of {} dimensions", v.len(), self.dimension);
            self.fault(at, "wrong_length", reason, format!("write {length}"));
            return;
        }
        for (a, value) in v.iter().enumerate() {
            self.finite(&join(at, a), *value);
        }
    }

    /// Checks an angular velocity, which has three components, in 2D one.
    pub fn angular(&mut self, at: &str, w: &[f64]) {
        if self.has_dimension() {
            self.vector_of(at, w, if self.dimension == 2 { 1 } else { 3 });
        }
    }

    /// Checks a square matrix of the scene's dimension.
    pub fn matrix(&mut self, at: &str, m: &[Vec<f64>]) {
        if !self.has_dimension() {
            return;
        }
        let d = self.dimension;
        if m.len() != d {
            let reason = format!("has {} rows in a scene of {d} dimensions", m.len());
            self.fault(at, "wrong_length", reason, format!("write {d} rows of {d} numbers"));
            return;
        }
        for (i, row) in m.iter().enumerate() {
            self.vector(&join(at, i), row);
        }
    }

    /// Checks the `contact` and `friction` of the value at `at`.
    pub fn contact(&mut self, at: &str, kind: ContactKind, friction: f64) {
        let known = self.faults.clean(&join(at, "contact"));
        let at = join(at, "friction");
        self.not_negative(&at, friction, "the friction coefficient");
        if known && friction != 0.0 && kind != ContactKind::Separate {
            let reason = "only the contact `separate` has friction";
            self.fault(&at, "friction_unused", reason, "take the friction out, or write `separate`");
        }
    }

    /// Checks names, given with their pointers, and that no two are the same.
    pub fn unique(&mut self, names: impl Iterator<Item = (String, String)>) {
        let mut seen: BTreeMap<String, String> = BTreeMap::new();
        for (at, name) in names {
            self.name(&at, &name);
            if let Some(first) = seen.get(&name) {
                let reason = format!("the name {} is taken by {first}", quote(&name));
                self.fault(&at, "duplicate_name", reason, "give it a name of its own");
            } else {
                seen.insert(name, at.trim_end_matches("/name").to_owned());
            }
        }
    }

    /// Checks the `material` of the value at `at`.
    pub fn known_material(&mut self, at: &str, name: &str) {
        let materials: Vec<&str> = self.scene.materials.keys().map(String::as_str).collect();
        if !materials.contains(&name) {
            let remedy = match closest(name, &materials) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("the materials are {}", list(materials.iter().copied())),
            };
            let reason = format!("there is no material {}", quote(name));
            self.fault(&join(at, "material"), "unknown_material", reason, remedy);
        }
    }

    /// The signed distance program of the valid shape at `at`.
    pub fn sdf(&self, at: &str, shape: &Shape) -> Sdf {
        shape::sdf(shape, at, &self.resolved.fields, self.dimension)
    }
}
