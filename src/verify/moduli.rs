//! Elastic moduli from periods of oscillation: waves through a periodic box, a free bar, and a
//! cantilever under its own weight.

use std::f64::consts::PI;

use serde_json::json;

use super::Case;
use super::report::Rule;
use super::session::Session;
use super::setup::{Scheme, Vec3, elastic, problem, set_velocity};
use gridfall_core::sim::particles::Particles;
use gridfall_core::sim::setup::{Kernel, Problem, Transfer};
use gridfall_engine::{EngineError, NoControl};

/// Three dimensions, which a GPU can run as well; only the compact kernel in a quick run.
fn schemes(session: &Session) -> Vec<Scheme> {
    if session.quick() {
        return vec![Scheme::new(3, Kernel::Compact, Transfer::Mls)];
    }
    let mut schemes = session.schemes(&[3]);
    // PIC damps the oscillation.
    schemes.retain(|scheme| scheme.transfer != Transfer::Pic);
    schemes
}

/// Period (s) of the oscillation of `amplitude`, from its zero crossings by linear interpolation.
fn period_s(
    session: &Session,
    problem: &Problem,
    frame_s: f64,
    frames: usize,
    amplitude: impl Fn(&Particles) -> f64,
) -> Result<f64, EngineError> {
    let mut engine = session.engine(problem)?;
    let (mut crossings, mut before) = (Vec::new(), amplitude(&problem.particles));
    for frame in 1..=frames {
        engine.advance_frame(frame_s, &NoControl)?;
        let now = amplitude(&engine.snapshot()?);
        if now * before < 0.0 {
            crossings.push((frame as f64 - now / (now - before)) * frame_s);
        }
        before = now;
    }
    let count = crossings.len();
    Ok(if count < 2 { f64::NAN } else { 2.0 * (crossings[count - 1] - crossings[0]) / (count - 1) as f64 })
}

pub const ELASTIC_WAVES: Case = Case {
    name: "elastic-waves",
    claim: "standing P and S waves in a periodic box have the periods of the given Young's and bulk modulus",
    source: "linear elasticity: (L/T)² = (K + 4G/3)/ρ and G/ρ",
    gpu: true,
    quick: true,
    run: elastic_waves,
};

fn elastic_waves(session: &mut Session) -> Result<(), EngineError> {
    let (young, nu, dx, density) = (1e5, 0.3, 1.0 / 32.0, 1000.0);
    let cells = session.pick(16, 32);
    let length = cells as f64 * dx;
    for scheme in schemes(session) {
        let mut problem = problem(
            session,
            scheme,
            json!({
                "domain": { "min": [0, 0, 0], "max": [length, 4.0 * dx, 4.0 * dx], "dx": dx,
                            "boundary": { "x": "periodic", "y": "periodic", "z": "periodic" } },
                "materials": { "jelly": elastic("neo-hookean", young, nu) },
                "bodies": [ { "name": "bulk", "material": "jelly",
                              "shape": { "box": { "min": [0, 0, 0], "max": [length, 4.0 * dx, 4.0 * dx] } } } ],
            }),
        );
        let start = problem.particles.x.clone();
        let wave = 2.0 * PI / length;
        let mut modulus = |direction: usize, speed_m_s: f64| {
            let size = 1e-4 * speed_m_s;
            set_velocity(&mut problem, |x| {
                let (mut v, mut c) = ([0.0; 3], [0.0; 9]);
                v[direction] = size * (wave * x[0]).cos();
                c[3 * direction] = -size * wave * (wave * x[0]).sin();
                (v, c)
            });
            let amplitude =
                |p: &Particles| p.v.iter().zip(&start).map(|(v, x)| v[direction] * (wave * x[0]).cos()).sum::<f64>();
            let expected_s = length / speed_m_s;
            let period = period_s(session, &problem, expected_s / 20.0, 36, amplitude)?;
            Ok::<f64, EngineError>(density * (length / period).powi(2))
        };
        let (k, g) = (young / (3.0 * (1.0 - 2.0 * nu)), young / (2.0 * (1.0 + nu)));
        let p_wave = modulus(0, ((k + 4.0 / 3.0 * g) / density).sqrt())?;
        let shear = modulus(1, (g / density).sqrt())?;
        let bulk = p_wave - 4.0 / 3.0 * shear;
        session.check(scheme, "bulk modulus", "Pa", (Rule::Relative, k, 0.03), bulk);
        let stretch = 9.0 * bulk * shear / (3.0 * bulk + shear);
        session.check(scheme, "Young's modulus", "Pa", (Rule::Relative, young, 0.03), stretch);
    }
    Ok(())
}

pub const FREE_BAR: Case = Case {
    name: "free-bar",
    claim: "a slender free bar that narrows as it stretches swings with the period of Young's modulus",
    source: "first longitudinal mode of a free-free bar: T = 2 L sqrt(ρ/E)",
    gpu: true,
    quick: true,
    run: free_bar,
};

fn free_bar(session: &mut Session) -> Result<(), EngineError> {
    let (young, dx) = (1e5, 1.0 / 32.0);
    let cells = session.pick(32, 48);
    let length = cells as f64 * dx;
    for scheme in schemes(session) {
        let low = 4.0 * dx;
        let mut problem = problem(
            session,
            scheme,
            json!({
                "domain": { "min": [0, 0, 0], "max": [length + 8.0 * dx, 12.0 * dx, 12.0 * dx], "dx": dx },
                "materials": { "jelly": elastic("fixed-corotated", young, 0.3) },
                "bodies": [ { "name": "bar", "material": "jelly",
                              "shape": { "box": { "min": [low, low, low],
                                                 "max": [low + length, 8.0 * dx, 8.0 * dx] } } } ],
            }),
        );
        let start = problem.particles.x.clone();
        let speed = (young / 1000.0f64).sqrt();
        let mode = |x: Vec3| (PI * (x[0] - low) / length).cos();
        set_velocity(&mut problem, |x| {
            let mut c = [0.0; 9];
            c[0] = -1e-4 * speed * PI / length * (PI * (x[0] - low) / length).sin();
            ([1e-4 * speed * mode(x), 0.0, 0.0], c)
        });
        let expected_s = 2.0 * length / speed;
        let amplitude = |p: &Particles| p.v.iter().zip(&start).map(|(v, x)| v[0] * mode(*x)).sum::<f64>();
        let period = period_s(session, &problem, expected_s / 30.0, session.pick(40, 55), amplitude)?;
        let got = 1000.0 * (2.0 * length / period).powi(2);
        session.check(scheme, "Young's modulus", "Pa", (Rule::Relative, young, 0.03), got);
    }
    Ok(())
}

pub const CANTILEVER: Case = Case {
    name: "cantilever",
    claim: "the tip of a cantilever let go swings about the static deflection under its own weight",
    source: "Timoshenko's beam, δ = q L⁴ / 8 E I + q L² / 2 κ G A = 0.368 + 0.012 m for 10 × 2 × 2 m, 100 MPa, \
             1000 kg/m³; period of Euler and Bernoulli's",
    gpu: true,
    quick: false,
    run: cantilever,
};

fn cantilever(session: &mut Session) -> Result<(), EngineError> {
    let (young, gravity, length, side) = (1e8, 9.81, 10.0, 2.0);
    let dx = 0.25;
    let second_moment = side * side * side * side / 12.0;
    let (load, area) = (1000.0 * gravity * side * side, side * side);
    let bending = load * f64::powi(length, 4) / (8.0 * young * second_moment);
    // ν = 0, κ = 5/6. At a length of five heights, shear is 3 % of the whole.
    let shear = load * length * length / (2.0 * 5.0 / 6.0 * 0.5 * young * area);
    let expected = bending + shear;
    // First bending mode, 1.875² sqrt(EI / ρ A L⁴).
    let period = 2.0 * PI / (3.516 * (young * second_moment / (1000.0 * side * side * f64::powi(length, 4))).sqrt());
    let schemes = match session.extent {
        super::Extent::Quick => vec![Scheme::new(3, Kernel::Quadratic, Transfer::Mls)],
        super::Extent::Full => [Kernel::Quadratic, Kernel::Compact].map(|k| Scheme::new(3, k, Transfer::Mls)).to_vec(),
    };
    for scheme in schemes {
        let problem = problem(
            session,
            scheme,
            json!({
                "domain": { "min": [0, 0, 0], "max": [12, 4, 5], "dx": dx },
                "gravity": [0, 0, -gravity],
                "materials": { "beam": elastic("fixed-corotated", young, 0.0) },
                "bodies": [ { "name": "beam", "material": "beam",
                              "shape": { "box": { "min": [0, 1, 2.5], "max": [length, 3, 4.5] } } } ],
            }),
        );
        // The face of the tip: the last layer of particles, half a spacing from the end.
        let face: Vec<usize> =
            (0..problem.particles.len()).filter(|&p| problem.particles.x[p][0] > length - 0.5 * dx).collect();
        let height = |p: &Particles| face.iter().map(|&i| p.x[i][2]).sum::<f64>() / face.len() as f64;
        let start = height(&problem.particles);
        let mut engine = session.engine(&problem)?;
        let frame_s = period / 60.0;
        let (mut time, mut deflection) = (vec![0.0], vec![0.0]);
        // Until the first return. The mean over one oscillation is the static deflection, whatever
        // the period turns out to be.
        let mut highest = 0.0f64;
        let returned = loop {
            engine.advance_frame(frame_s, &NoControl)?;
            time.push(time.len() as f64 * frame_s);
            deflection.push(start - height(&engine.snapshot()?));
            let n = deflection.len();
            highest = highest.max(deflection[n - 1]);
            if n > 30 && deflection[n - 1] > deflection[n - 2] && deflection[n - 2] < 0.3 * highest {
                break true;
            }
            if n > 100 {
                break false;
            }
        };
        let n = deflection.len() - 1;
        let mean = deflection[..n].iter().sum::<f64>() / n as f64;
        let variant = format!("{scheme} dx {dx}");
        session.check(&variant, "mean tip deflection", "m", (Rule::Relative, expected, 0.05), mean);
        let swing_s = if returned { time[n - 1] } else { f64::NAN };
        session.check(&variant, "period", "s", (Rule::Relative, period, 0.05), swing_s);
        session.curve(&variant, vec![("time_s", time), ("deflection_m", deflection)]);
    }
    Ok(())
}
