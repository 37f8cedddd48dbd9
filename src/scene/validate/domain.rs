//! Meaning of the domain: its extent in whole cells, and its walls.

use crate::fault::{join, plain};
use crate::grid::{cells, is_whole};
use crate::schema::{Boundary, Domain};
use crate::suggest::{list, quote};
use crate::validate::check::Check;
use crate::validate::plausible::{PLACE, SPACING};

/// Most cells along one axis.
const MAX_CELLS: f64 = 65_536.0;

/// Judges the domain.
pub fn check_domain(check: &mut Check, domain: &Domain) {
    check.vector("/domain/min", &domain.min);
    check.vector("/domain/max", &domain.max);
    for (at, corner) in [("/domain/min", &domain.min), ("/domain/max", &domain.max)] {
        check.plausible_length(at, corner, &PLACE);
    }
    check.positive("/domain/dx", domain.dx, "the grid spacing");
    check.plausible("/domain/dx", domain.dx, &SPACING);
    if check.has_grid() {
        let n = cells(domain, check.dimension);
        for a in 0..check.dimension {
            extent(check, &join("/domain/max", a), domain, a, n[a]);
        }
    }
    for (key, boundary) in &domain.boundary {
        check_boundary(check, &join("/domain/boundary", key), key, boundary);
    }
    for axis in ["x", "y", "z"] {
        let sides = [format!("{axis}-"), format!("{axis}+")];
        if domain.boundary.contains_key(axis) && sides.iter().any(|side| domain.boundary.contains_key(side)) {
            let at = join("/domain/boundary", axis);
            let reason = format!("`{axis}` is given beside `{axis}-` or `{axis}+`");
            let remedy = format!("keep `{axis}` for both walls, or `{axis}-` and `{axis}+` for one each");
            check.fault(&at, "conflicting_walls", reason, remedy);
        }
    }
}

/// Judges the length of axis `a`, which is `n` cells.
fn extent(check: &mut Check, at: &str, domain: &Domain, a: usize, n: f64) {
    let (min, max, dx) = (domain.min[a], domain.max[a], domain.dx);
    if max <= min {
        check.fault(at, "empty", format!("max {max} is not above min {min}"), "write a larger max");
    } else if n > MAX_CELLS {
        let reason = format!("makes {n:.0} cells along the axis; {MAX_CELLS} is the most");
        check.fault(at, "too_many_cells", reason, "raise dx or shrink the domain");
    } else if !is_whole(n) {
        let (fewer, more) = (plain(min + n.floor().max(1.0) * dx), plain(min + n.ceil() * dx));
        let reason = format!("the domain is {} m long here, which is {n:.4} cells of dx = {dx}", plain(max - min));
        let remedy = format!("make it a whole number of cells: max = {fewer} or {more}, or change dx");
        check.fault(at, "not_whole_cells", reason, remedy);
    }
}

fn check_boundary(check: &mut Check, at: &str, key: &str, boundary: &Boundary) {
    let axes = if check.dimension == 2 { 2 } else { 3 };
    let keys: Vec<String> =
        ["x", "y", "z"][..axes].iter().flat_map(|a| ["", "-", "+"].map(|side| format!("{a}{side}"))).collect();
    if !keys.iter().any(|k| k == key) {
        let remedy = format!("name one of {}", list(keys.iter().map(String::as_str)));
        check.fault(at, "unknown_wall", format!("there is no wall {}", quote(key)), remedy);
        return;
    }
    match boundary {
        Boundary::Wall(wall) => check.contact(at, wall.contact, wall.friction),
        Boundary::Periodic(_) if key.len() > 1 => {
            let remedy = format!("write \"{}\": \"periodic\" for both walls of the axis", &key[..1]);
            check.fault(at, "periodic_wall", "one wall alone cannot be periodic", remedy);
        }
        Boundary::Periodic(_) if check.has_grid() => {
            let a = ["x", "y", "z"].iter().position(|axis| *axis == key).unwrap_or(0);
            let n = cells(&check.scene.domain, check.dimension)[a].round();
            if n % 4.0 != 0.0 {
                let reason = format!("a periodic axis of {n} cells; the grid's blocks of 4 cells must close up");
                let remedy =
                    format!("make it {} or {} cells", (n / 4.0).floor().max(1.0) * 4.0, (n / 4.0).ceil() * 4.0);
                check.fault(at, "periodic_cells", reason, remedy);
            }
        }
        Boundary::Periodic(_) => {}
    }
}
