//! What is wrong with a scene: where, why and what to change.

use std::collections::BTreeSet;
use std::fmt;

use serde::Serialize;

use crate::names::shown;

/// One fault of a scene.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Fault {
    /// JSON pointer (RFC 6901) to the value at fault, or to the place of a missing one; empty for
    /// the whole document.
    pub pointer: String,
    /// A stable code for programs: `unknown_field`, `not_positive`, …
    pub code: &'static str,
    /// What is wrong, in words.
    pub reason: String,
    /// What to change, in words.
    pub remedy: String,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let pointer = if self.pointer.is_empty() { "(document)" } else { &self.pointer };
        let [pointer, reason, remedy] = [pointer, &self.reason, &self.remedy].map(shown);
        write!(f, "{pointer}: {reason}; {remedy} [{}]", self.code)
    }
}

/// Most faults that are collected.
const MAX_FAULTS: usize = 200;

/// Faults found so far.
///
/// What depends on a faulty value is not judged: see [`Faults::clean`].
#[derive(Debug, Default)]
pub struct Faults {
    found: Vec<Fault>,
    /// Pointers of the values that have no meaning because of a fault.
    spoiled: BTreeSet<String>,
}

impl Faults {
    /// Adds a fault, unless the value, a part of it or a value that contains it is already known to
    /// be at fault.
    pub fn add(&mut self, pointer: &str, code: &'static str, reason: impl Into<String>, remedy: impl Into<String>) {
        if self.clean(pointer) {
            self.spoil(pointer);
            self.note(Fault { pointer: pointer.to_owned(), code, reason: reason.into(), remedy: remedy.into() });
        }
    }

    /// Whether no more faults are collected, so that looking for more is in vain.
    pub fn full(&self) -> bool {
        self.found.len() >= MAX_FAULTS
    }

    /// Adds a fault that leaves the rest of the value as meaningful as before.
    pub fn note(&mut self, fault: Fault) {
        if !self.full() {
            self.found.push(fault);
        }
    }

    /// Declares the whole value meaningless because of a fault that is already known.
    pub fn spoil(&mut self, pointer: &str) {
        self.spoiled.insert(pointer.to_owned());
    }

    /// Whether nothing at `pointer`, below it or above it is at fault. Unknown fields do not count
    /// because they do not change the meaning of others.
    pub fn clean(&self, pointer: &str) -> bool {
        let ends = pointer.match_indices('/').map(|(end, _)| end).chain([pointer.len()]);
        let above = ends.into_iter().any(|end| self.spoiled.contains(&pointer[..end]));
        let inner = format!("{pointer}/");
        let below = self.spoiled.range(inner.clone()..).next().is_some_and(|first| first.starts_with(&inner));
        !(above || below)
    }

    pub fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    pub fn into_vec(self) -> Vec<Fault> {
        self.found
    }
}

/// Appends a reference token to a JSON pointer.
pub fn join(pointer: &str, token: impl fmt::Display) -> String {
    format!("{pointer}/{}", token.to_string().replace('~', "~0").replace('/', "~1"))
}

/// A number to suggest, without its rounding error.
pub fn plain(x: f64) -> f64 {
    format!("{x:.12e}").parse().unwrap_or(x)
}
