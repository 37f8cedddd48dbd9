//! Prescribed motion: keyframes, colliders that exist only for a time, grips.

use crate::problems::{Vec3, centre};
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::reaction::WALLS;
use gridfall_core::sim::setup::Problem;
use gridfall_engine::explicit::cpu::CpuEngine;
use gridfall_engine::{Engine, NoControl};
use gridfall_scene::{self as scene, Limits};

pub fn problem(json: &str) -> Problem {
    let scene = scene::parse(json).unwrap_or_else(|faults| panic!("{faults:#?}"));
    scene::problem(&scene, &Limits::default()).unwrap_or_else(|faults| panic!("{faults:#?}"))
}

/// A bar along x between two grips. One holds; the other rotates by 40° about the bar's axis in
/// half a second and lets go.
fn twisted_bar() -> Problem {
    problem(
        r#"{ "gridfall": 1, "name": "bar", "domain": { "min": [0, 0, 0], "max": [0.75, 0.5, 0.5], "dx": 0.03125 },
        "materials": {
            "jelly": { "model": "neo-hookean", "density": 1000, "youngs_modulus": 1e5, "poissons_ratio": 0.3 } },
        "bodies": [ { "name": "bar", "material": "jelly",
            "shape": { "box": { "min": [0.125, 0.1875, 0.1875], "max": [0.625, 0.3125, 0.3125] } },
            "grips": [
                { "name": "held", "shape": { "box": { "min": [0.05, 0.1, 0.1], "max": [0.19, 0.4, 0.4] } } },
                { "name": "turned", "shape": { "box": { "min": [0.56, 0.1, 0.1], "max": [0.7, 0.4, 0.4] } },
                  "until": 0.75,
                  "motion": { "center": [0.6, 0.25, 0.25], "axis": [2, 0, 0],
                              "keyframes": [ { "time": 0 }, { "time": 0.5, "angle_degrees": 40 } ] } } ] } ],
        "time": { "end": 1, "frame_rate": 16 }, "solver": { "precision": "f64" } }"#,
    )
}

/// Mean angle about the bar's axis by which particles that started with x in `range` have rotated
/// (°).
fn twist(problem: &Problem, now: &Particles, range: [f64; 2]) -> f64 {
    let (mut sin, mut cos) = (0.0, 0.0);
    for (start, now) in problem.particles.x.iter().zip(&now.x).filter(|(x, _)| x[0] > range[0] && x[0] < range[1]) {
        let arm = |x: &Vec3| [x[1] - 0.25, x[2] - 0.25];
        let (a, b) = (arm(start), arm(now));
        cos += a[0] * b[0] + a[1] * b[1];
        sin += a[0] * b[1] - a[1] * b[0];
    }
    f64::atan2(sin, cos).to_degrees()
}

#[test]
fn grips_twist_a_bar_and_let_go() {
    let problem = twisted_bar();
    assert_eq!(problem.setup.colliders.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(), ["bar/held", "bar/turned"]);
    let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
    let mut at = |frames: usize| {
        let stats: Vec<_> =
            (0..frames).map(|_| engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap()).collect();
        let torques: Vec<[Vec3; 2]> =
            stats.iter().map(|s| [0, 1].map(|grip| s.reactions[WALLS + grip].torque)).collect();
        let now = engine.snapshot().unwrap();
        ([[0.0, 0.17], [0.35, 0.4], [0.58, 1.0]].map(|range| twist(&problem, &now, range)), torques)
    };
    let ([held, middle, turned], _) = at(8);
    println!("after 0.5 s: {held:.2}°, {middle:.2}°, {turned:.2}°");
    assert!(held.abs() < 0.5 && (turned - 40.0).abs() < 1.0);
    assert!((middle - 20.0).abs() < 4.0);
    let ([_, _, turned], torques) = at(4);
    assert!((turned - 40.0).abs() < 1.0, "the grip lost the bar: {turned}°");
    // Saint-Venant's torsion of a square bar of side a between the grips: T = 0.1406 a⁴ G θ / l.
    // Four cells across are coarse.
    let expected = 0.1406 * 0.125f64.powi(4) * (1e5 / 2.6) * 40f64.to_radians() / 0.37;
    let [held, turned] = [0, 1].map(|grip| torques.iter().map(|t| t[grip][0]).sum::<f64>() / torques.len() as f64);
    println!("torques about the bar: {held:.4} and {turned:.4} N m, expected ±{expected:.4}");
    assert!((held / expected - 1.0).abs() < 0.25 && (turned / -expected - 1.0).abs() < 0.25);
    assert!((held + turned).abs() < 0.1 * expected, "action and reaction: {held} and {turned} N m");
    let ([held, _, free], torques) = at(2);
    println!("an eighth of a second after letting go: {held:.2}°, {free:.2}°");
    assert!(held.abs() < 0.5 && free < 30.0);
    assert_eq!(torques[1][1], [0.0; 3], "a grip that is gone bears nothing");
}

/// A sticky ball carries a jelly along keyframes, there and back, and is in the right place in
/// between.
#[test]
fn keyframes_carry_a_body_there_and_back() {
    for precision in ["f32", "f64"] {
        let problem = problem(&format!(
            r#"{{ "gridfall": 1, "name": "ride", "dimension": 2,
            "domain": {{ "min": [0, 0], "max": [1, 1], "dx": 0.03125 }},
            "materials": {{
                "jelly": {{ "model": "fixed-corotated", "density": 1000,
                            "youngs_modulus": 1e5, "poissons_ratio": 0.3 }} }},
            "bodies": [ {{ "name": "a", "material": "jelly",
                "shape": {{ "sphere": {{ "center": [0.3, 0.5], "radius": 0.12 }} }} }} ],
            "colliders": [ {{ "name": "core", "contact": "sticky",
                "shape": {{ "sphere": {{ "center": [0.3, 0.5], "radius": 0.08 }} }},
                "motion": {{ "keyframes": [ {{ "time": 0.25 }},
                    {{ "time": 0.5, "offset": [0.2, 0.1] }}, {{ "time": 1, "offset": [0, 0] }} ] }} }} ],
            "time": {{ "end": 1.25, "frame_rate": 20 }}, "solver": {{ "precision": "{precision}" }} }}"#
        ));
        let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
        for (frames, x, y) in [(5, 0.3, 0.5), (5, 0.5, 0.6), (5, 0.4, 0.55), (8, 0.3, 0.5)] {
            (0..frames).for_each(|_| drop(engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap()));
            let now = engine.snapshot().unwrap();
            let at = centre(&now, 0..now.len());
            println!("{precision}: {at:?}, expected {x}, {y}");
            assert!((at[0] - x).hypot(at[1] - y) < 0.15 * problem.setup.dx);
        }
    }
}

/// A shelf holds a block until it is removed; another is in the way only once it exists.
#[test]
fn colliders_come_and_go() {
    let problem = problem(
        r#"{ "gridfall": 1, "name": "shelves", "dimension": 2,
        "domain": { "min": [0, 0], "max": [0.5, 2], "dx": 0.03125 },
        "gravity": [0, -10],
        "materials": {
            "jelly": { "model": "fixed-corotated", "density": 1000, "youngs_modulus": 1e5, "poissons_ratio": 0.3 } },
        "bodies": [ { "name": "a", "material": "jelly",
            "shape": { "box": { "min": [0.125, 1.5], "max": [0.375, 1.75] } } } ],
        "colliders": [
            { "name": "shelf", "contact": "separate", "until": 0.2,
              "shape": { "box": { "min": [0, 1.4], "max": [0.5, 1.5] } } },
            { "name": "ghost", "contact": "separate", "from": 0.6,
              "shape": { "box": { "min": [0, 1.2], "max": [0.5, 1.3] } } },
            { "name": "floor", "contact": "separate", "from": 0.5,
              "shape": { "box": { "min": [0, 0.2], "max": [0.5, 0.5] } } } ],
        "time": { "end": 1, "frame_rate": 20 } }"#,
    );
    let mut engine = CpuEngine::new(&problem.setup, problem.particles.clone()).unwrap();
    let mut height = |frames: usize| {
        (0..frames).for_each(|_| drop(engine.advance_frame(problem.setup.frame_s, &NoControl).unwrap()));
        let now = engine.snapshot().unwrap();
        centre(&now, 0..now.len())[1]
    };
    assert!((height(4) - 1.625).abs() < 0.02, "the shelf holds");
    let fallen = 1.625 - height(6);
    assert!((fallen - 0.5 * 10.0 * 0.09).abs() < 0.05, "free fall for 0.3 s, fallen {fallen} m");
    let rest = height(10);
    println!("fell {fallen:.3} m, ended at {rest:.3} m");
    // It comes down at 4.5 m/s after 0.65 s. Without any loss it would be back at 1.58 m, without the floor at 0.1 m.
    assert!(rest > 0.58 && rest < 1.5, "the floor holds: {rest}");
    let lowest = engine.snapshot().unwrap().x.iter().map(|x| x[1]).fold(f64::MAX, f64::min);
    assert!(lowest > 0.5, "nothing is in the floor: {lowest}");
}
