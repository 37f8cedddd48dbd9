//! Mends what a file got wrong and leaves no doubt what it meant: duplicate faces, T-junctions,
//! faces and parts that are inside out.

mod duplicates;
mod edges;
mod junctions;
mod nesting;
mod orient;
mod seams;
mod union;

use super::triangles::TriangleMesh;
use duplicates::{drop_duplicates, leave_one};
pub use edges::Edges;
pub use nesting::Nesting;
use orient::{agree, parts};
use seams::close_seams;

/// A mesh after mending, and what was done to it.
#[derive(Clone, Debug, PartialEq)]
pub struct Mended {
    pub mesh: TriangleMesh,
    /// Faces that were there more than once and went.
    pub duplicates: usize,
    /// Vertices that lay on an edge of another face and are now a corner of it.
    pub seams: usize,
    /// Faces that disagreed with their neighbours about the outside, and were turned.
    pub faces: usize,
    /// Parts of the mesh.
    pub parts: usize,
    pub nesting: Nesting,
    /// Edges that are still open, or have faces that disagree, and all edges.
    pub open: (usize, usize),
}

/// Why a mesh cannot be mended: its faces cannot agree about the outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotOrientable;

/// Mends a welded mesh.
pub fn mend(mut mesh: TriangleMesh) -> Result<Mended, NotOrientable> {
    let duplicates = drop_duplicates(&mut mesh);
    let seams = close_seams(&mut mesh);
    let faces = agree(&mut mesh).ok_or(NotOrientable)? + junctions::fit(&mut mesh);
    let parts = parts(&mesh);
    let nesting = nesting::settle(&mut mesh, &parts);
    let open = Edges::new(&mesh).open();
    Ok(Mended { mesh, duplicates, seams, faces, parts: parts.len(), nesting, open })
}

/// Mends a welded mesh that is a sheet: without an inside, nothing of it is turned.
pub fn mend_sheet(mut mesh: TriangleMesh) -> Mended {
    let before = mesh.triangles.len();
    leave_one(&mut mesh);
    let duplicates = before - mesh.triangles.len();
    let seams = close_seams(&mut mesh);
    let open = Edges::new(&mesh).open();
    Mended { mesh, duplicates, seams, faces: 0, parts: 1, nesting: Nesting::default(), open }
}

#[cfg(test)]
mod tests;
