//! Domains of whole cells.

use std::borrow::Cow;

use gridfall_core::sim::notice::Notice;

use crate::fault::{join, plain};
use crate::grid::{cells, is_whole, periodic};
use crate::schema::{DomainFit, Scene};

/// A scene with a domain of whole cells, if its `fit` lets it grow, and what was done. An axis that cannot grow is
/// left to be judged.
pub(crate) fn fit(scene: &Scene) -> (Cow<'_, Scene>, Vec<Notice>) {
    let mut fitted = Cow::Borrowed(scene);
    let mut notices = Vec::new();
    let domain = &scene.domain;
    let dimension = scene.dimension as usize;
    let sound = (2..=3).contains(&dimension) && [&domain.min, &domain.max].iter().all(|v| v.len() == dimension);
    if !sound || domain.fit == DomainFit::Exact {
        return (fitted, notices);
    }
    let (n, periodic) = (cells(domain, dimension), periodic(domain, dimension));
    for a in 0..dimension {
        // Less than one cell is no domain, and a longer period another one.
        if !(n[a].is_finite() && n[a] >= 1.0) || is_whole(n[a]) || periodic[a] {
            continue;
        }
        let max = domain.min[a] + n[a].ceil() * domain.dx;
        notices.push(Notice {
            pointer: join("/domain/max", a),
            code: "domain_grown".into(),
            reason: format!(
                "the domain is {} m long here, which is {:.4} cells of dx = {}; it is taken as {} cells, up to {}",
                plain(domain.max[a] - domain.min[a]),
                n[a],
                domain.dx,
                n[a].ceil(),
                plain(max)
            ),
            remedy: format!(
                "where the wall must be exact, write {} or {}, or change dx; `\"fit\": \"exact\"` refuses such domains",
                plain(domain.min[a] + n[a].floor() * domain.dx),
                plain(max)
            ),
        });
        fitted.to_mut().domain.max[a] = max;
    }
    (fitted, notices)
}
