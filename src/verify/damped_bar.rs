//! The damping of solids: what it takes from a mode.

use std::f64::consts::PI;

use super::Case;
use super::implicit::{Bar, damped_swing};
use super::report::Rule;
use super::session::Session;
use super::setup::Scheme;
use gridfall_core::sim::setup::{Kernel, Material, Transfer};
use gridfall_engine::{EngineError, NoControl};

pub const DAMPED_BAR: Case = Case {
    name: "damped-bar",
    claim: "the first mode of a free bar whose material is damped decays at the rate that its damping time gives",
    source: "Kelvin and Voigt's solid: x'' = -ω² (x + t_d x'), so the rate is ω² t_d/2 and the period 2π/(ω sqrt(1 - \
             ζ²)) with ζ = ω t_d/2",
    gpu: false,
    quick: true,
    run: damped_bar,
};

fn damped_bar(session: &mut Session) -> Result<(), EngineError> {
    let schemes = match session.quick() {
        true => vec![Scheme::new(2, Kernel::Compact, Transfer::Mls), Scheme::new(2, Kernel::Quadratic, Transfer::Mls)],
        false => session.schemes(&[2]),
    };
    // PIC damps by itself, and the more the shorter its steps.
    for scheme in schemes.into_iter().filter(|scheme| scheme.transfer != Transfer::Pic) {
        for ratio in session.pick(vec![0.1], vec![0.05, 0.1, 0.3]) {
            let mut bar = Bar::new(session, scheme, 1e-4);
            let Material::FixedCorotated(elastic) = &mut bar.problem.setup.materials[0] else { unreachable!() };
            elastic.damping = 2.0 * ratio / bar.omega;
            let mut engine = session.engine(&bar.problem)?;
            let frame_s = 2.0 * PI / bar.omega / 40.0;
            let mut values = vec![bar.amplitude(&bar.problem.particles)];
            for _ in 0..80 {
                engine.advance_frame(frame_s, &NoControl)?;
                values.push(bar.amplitude(&engine.snapshot()?));
            }
            let (angle, factor) = damped_swing(&values);
            let variant = format!("{scheme}, ratio {ratio}");
            let rule = (Rule::Relative, bar.omega * ratio, 0.05);
            session.check(&variant, "decay", "1/s", rule, -factor.ln() / frame_s);
            let period = 2.0 * PI / (bar.omega * (1.0f64 - ratio * ratio).sqrt());
            session.check(&variant, "period", "s", (Rule::Relative, period, 0.01), 2.0 * PI * frame_s / angle);
            let times = (0..values.len()).map(|frame| frame as f64 * frame_s).collect();
            session.curve(&variant, vec![("time_s", times), ("amplitude", values)]);
        }
    }
    Ok(())
}
