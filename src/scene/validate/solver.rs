//! Meaning of the solver's settings, and whether they suit the materials.

use gridfall_core::sim::settings::{Method, Norm, Plasticity};
use gridfall_core::sim::setup::ContactAt;

use crate::fault::join;
use crate::schema::{Body, ContactKind, Implicit, Integrator, Material, Scene, Solver};
use crate::validate::check::Check;
use crate::validate::shape::sheet_in;

/// Largest tolerances. Beyond them, the error of a step's velocities may be as large as their change.
pub const MAX_ERROR: f64 = 1e-1;
const MAX_CHARACTERISTIC: f64 = 1e-2;
/// Most levels: each has half the nodes along an axis, and no axis has more than 2¹⁶ cells.
pub const MAX_LEVELS: u32 = 10;

/// Judges the solver's settings.
pub fn check_solver(check: &mut Check, solver: &Solver) {
    if check.finite("/solver/cfl", solver.cfl) && !(solver.cfl > 0.0 && solver.cfl <= 1.0) {
        let reason = format!("the CFL number is {}", solver.cfl);
        check.fault("/solver/cfl", "out_of_range", reason, "write a number above 0 and up to 1");
    }
    if let Some(dt) = solver.max_dt {
        check.positive("/solver/max_dt", dt, "the largest step");
    }
    check_implicit(check, &solver.implicit);
    if solver.integrator == Integrator::Implicit {
        check_materials(check, solver.implicit.method);
        check_contact(check, solver);
    }
    check_sheets(check, solver);
}

/// A sheet has no inside, and nodes meet the inside of colliders only.
fn check_sheets(check: &mut Check, solver: &Solver) {
    let scene = check.scene;
    let Some(sheet) = scene.colliders.iter().find(|c| sheet_in("", &c.shape).is_some()) else { return };
    if solver.contact == ContactAt::Nodes {
        let reason = format!("the collider '{}' is a sheet, which particles meet and nodes do not", sheet.name);
        check.fault("/solver/contact", "unsupported", reason, "write `particles`, or give the mesh thickness");
    }
}

fn check_implicit(check: &mut Check, implicit: &Implicit) {
    let at = |name: &str| join("/solver/implicit", name);
    let tolerance = implicit.tolerance();
    let (most, usual) = match implicit.norm() {
        Norm::Error => (MAX_ERROR, "1e-2 is usual, 1e-4 accurate"),
        Norm::Characteristic => (MAX_CHARACTERISTIC, "1e-7 is usual, 1e-9 accurate"),
    };
    if check.finite(&at("tolerance"), tolerance) && !(tolerance > 0.0 && tolerance <= most) {
        let remedy = format!("write a number above 0 and up to {most}; {usual}");
        check.fault(&at("tolerance"), "out_of_range", format!("the tolerance is {tolerance}"), remedy);
    }
    if implicit.method != Method::Newton && implicit.norm() == Norm::Error {
        let reason = "only the method `newton` estimates the error of a step";
        check.fault(&at("norm"), "unsupported", reason, "write `characteristic`, or the method `newton`");
    }
    if implicit.method != Method::Newton && implicit.plasticity() == Plasticity::Flowing {
        let reason = "only the method `newton` lets materials flow within a step";
        check.fault(&at("plasticity"), "unsupported", reason, "write `lagged`, or the method `newton`");
    }
    if !(1..=MAX_LEVELS).contains(&implicit.levels) {
        let remedy = format!("write a number from 1 to {MAX_LEVELS}; 3 is usual");
        check.fault(&at("levels"), "out_of_range", format!("{} levels", implicit.levels), remedy);
    }
    if implicit.max_iterations == 0 {
        let remedy = "write a number above 0; 1000 is usual";
        check.fault(&at("max_iterations"), "out_of_range", "no iteration is allowed", remedy);
    }
}

/// Contact between bodies is explicit, and `admm` has none at particles.
fn check_contact(check: &mut Check, solver: &Solver) {
    let at_particles = solver.contact == ContactAt::Particles && !check.scene.colliders.is_empty();
    if at_particles && solver.implicit.method == Method::Admm {
        let reason = "`admm` has colliders act on nodes only".to_owned();
        check.fault("/solver/contact", "unsupported", reason, "write `nodes`, or another implicit method");
    }
    let own = |body: &&Body| body.contact.is_some_and(|kind| kind != ContactKind::Sticky);
    if let Some(body) = check.scene.bodies.iter().find(own) {
        let reason = format!("the body '{}' has contact with other bodies, which explicit runs have only", body.name);
        let remedy = "write `explicit` or `auto`, or take the body's `contact` out";
        check.fault("/solver/integrator", "unsupported", reason, remedy);
    }
}

/// Checks that `method` supports the materials in use.
fn check_materials(check: &mut Check, method: Method) {
    let Scene { materials, bodies, sources, .. } = check.scene;
    let used = bodies.iter().map(|body| &body.material).chain(sources.iter().map(|source| &source.material));
    let used: Vec<(&String, &Material)> =
        used.filter_map(|name| materials.get_key_value(name)).map(|(name, material)| (name, &material.law)).collect();
    if let Some((name, _)) = used.iter().find(|(_, material)| material.is_fluid()) {
        let reason = format!("the material '{name}' is a fluid, and fluids run explicitly only");
        let remedy = "write `explicit` or `auto`, or take the fluid out";
        check.fault("/solver/integrator", "unsupported", reason, remedy);
    }
    if let Some((name, _)) = used.iter().find(|(_, material)| material.damping() > 0.0) {
        let reason = format!("the material '{name}' has damping, which explicit steps alone have");
        let remedy = "write `explicit` or `auto`, or take out the damping; implicit steps damp by their length";
        check.fault("/solver/integrator", "unsupported", reason, remedy);
    }
    let plastic = used.iter().find(|(_, material)| !material.is_elastic() && !material.is_fluid());
    if let (Method::Admm, Some((name, _))) = (method, plastic) {
        let reason = format!("`admm` is for elastic materials, and '{name}' is plastic");
        let remedy = "write `hot`, or make the material fixed-corotated, neo-hookean or stvk-hencky";
        check.fault("/solver/implicit/method", "unsupported", reason, remedy);
    }
}
