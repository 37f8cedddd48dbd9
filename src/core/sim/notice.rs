//! What a user should know of a scene that is run all the same.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Something in a scene that was mended, or that may not be what the user meant.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Notice {
    /// JSON pointer (RFC 6901) to the value.
    pub pointer: String,
    /// A stable code for programs: `mended_mesh`, `volume_differs`, …
    pub code: String,
    /// What was found, and what was made of it.
    pub reason: String,
    /// What to change if that is not what was meant.
    pub remedy: String,
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}; {} [{}]", self.pointer, self.reason, self.remedy, self.code)
    }
}
