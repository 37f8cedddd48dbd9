//! What is wrong with a scene: where, why and what to change.

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
    /// Values that have no meaning because of a fault found below them.
    spoiled: Vec<String>,
}

impl Faults {
    /// Adds a fault, unless the value, a part of it or a value that contains it is already known to
    /// be at fault.
    pub fn add(&mut self, pointer: &str, code: &'static str, reason: impl Into<String>, remedy: impl Into<String>) {
        if self.clean(pointer) {
            self.found.push(Fault { pointer: pointer.to_owned(), code, reason: reason.into(), remedy: remedy.into() });
        }
    }

    /// Adds a fault that leaves the rest of the value as meaningful as before.
    pub fn note(&mut self, fault: Fault) {
        if self.found.len() < MAX_FAULTS {
            self.found.push(fault);
        }
    }

    /// Declares the whole value meaningless because of a fault that is already known.
    pub fn spoil(&mut self, pointer: &str) {
        self.spoiled.push(pointer.to_owned());
    }

    /// Whether nothing at `pointer`, below it or above it is at fault. Unknown fields do not count
    /// because they do not change the meaning of others.
    pub fn clean(&self, pointer: &str) -> bool {
        let meets = |other: &str| within(other, pointer) || within(pointer, other);
        let found = self.found.iter().filter(|f| f.code != "unknown_field").map(|f| f.pointer.as_str());
        !found.chain(self.spoiled.iter().map(String::as_str)).any(meets)
    }

    pub fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    pub fn into_vec(self) -> Vec<Fault> {
        self.found
    }
}

/// Whether pointer `inner` equals `outer` or lies below it.
fn within(inner: &str, outer: &str) -> bool {
    inner.strip_prefix(outer).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
}

/// Appends a reference token to a JSON pointer.
pub fn join(pointer: &str, token: impl fmt::Display) -> String {
    format!("{pointer}/{}", token.to_string().replace('~', "~0").replace('/', "~1"))
}

/// A number to suggest, without its rounding error.
pub fn plain(x: f64) -> f64 {
    format!("{x:.12e}").parse().unwrap_or(x)
}
