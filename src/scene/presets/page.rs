//! Tables of the page on materials.
