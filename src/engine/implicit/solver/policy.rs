//! When a minimisation ends without having converged, when its model of the Hessian is rebuilt, and
//! what helps after a direction that did not: decisions without vectors, the same for the CPU and
//! the GPU.

/// Iterations without progress after which rounding is all that is left.
pub const STALLED: u32 = 8;

/// Iterations that the first, the second and each later model of the Hessian serves for. Where
/// stiff bodies turn, the start of the step is strained by far more than its end, so that the
/// Hessian there is a poor guide; soft bodies have converged by then. Measured: half the iterations
/// of models for 16 where materials of 1e5 and 1e9 Pa meet, and on the twisted bar.
const LIFETIMES: [u32; 3] = [2, 3, 16];

/// Within so many times the tolerance a few iterations will do, and a new model costs as much
/// (measured on the reduced scenes: a fifth less time than with 3).
const NEAR: f64 = 100.0;

/// Whether a minimisation still gets anywhere, in energy or residual.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    noise: f64,
    least: f64,
    stalled: u32,
}

impl Progress {
    /// From a start with this residual; falls of the energy by no more than the part `noise` of it
    /// are rounding.
    pub fn new(noise: f64, residual: f64) -> Self {
        Self { noise, least: residual, stalled: 0 }
    }

    /// Takes note of a step that changed the energy from `before` to `after`.
    pub fn note(&mut self, before: f64, after: f64, residual: f64) {
        let progress = before - after > self.noise * before.abs() || residual < self.least;
        self.stalled = if progress { 0 } else { self.stalled + 1 };
        self.least = self.least.min(residual);
    }

    /// Whether rounding is all that is left.
    pub fn has_stalled(&self) -> bool {
        self.stalled >= STALLED
    }
}

/// When models of the Hessian are rebuilt.
#[derive(Clone, Copy, Debug)]
pub struct Rules {
    /// Of the residual (ε).
    pub tolerance: f64,
    /// When they have served their time. If not, the first serves for the whole step.
    pub with_age: bool,
    /// When a direction of a model that is not new fails.
    pub after_failure: bool,
}

/// The age of the model of the Hessian that a quasi-Newton method is preconditioned with.
#[derive(Clone, Copy, Debug)]
pub struct Lifetime {
    rules: Rules,
    /// Iterations that the present model has served for, and models before it.
    age: u32,
    replaced: usize,
}

/// What an iteration takes as its model of the Hessian.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// The present one.
    Present,
    /// A new one, built where the minimisation stands.
    New {
        /// Without the history: it goes with the first model, for the reason for which that is
        /// replaced. Later models hand it on.
        forget: bool,
    },
}

/// What to do after a direction that did not help.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Retreat {
    /// Go on without the history.
    Forget,
    /// Go on with a new model.
    Rebuild,
    /// Make the preconditioner more cautious, as long as that is possible.
    Strengthen,
    GiveUp,
}

impl Lifetime {
    /// Of the model at the start.
    pub fn new(rules: Rules) -> Self {
        Self { rules, age: 0, replaced: 0 }
    }

    /// The model for the next iteration, from a point with this residual.
    pub fn iterate(&mut self, residual: f64) -> Model {
        let model = if self.rules.with_age && self.is_over(residual) {
            let forget = self.replaced == 0;
            self.replace();
            Model::New { forget }
        } else {
            Model::Present
        };
        self.age += 1;
        model
    }

    /// What to do after a direction that did not help: `history` tells whether there was any,
    /// `descending` whether the direction pointed downhill.
    pub fn retreat(&mut self, history: bool, descending: bool) -> Retreat {
        if history {
            Retreat::Forget
        } else if self.rules.after_failure && self.age > 1 {
            self.replace();
            Retreat::Rebuild
        } else if descending {
            Retreat::GiveUp
        } else {
            Retreat::Strengthen
        }
    }

    fn is_over(&self, residual: f64) -> bool {
        let last = LIFETIMES.len() - 1;
        let far = residual / self.rules.tolerance > NEAR;
        self.age >= LIFETIMES[last] || (self.age >= LIFETIMES[self.replaced.min(last)] && far)
    }

    fn replace(&mut self) {
        (self.age, self.replaced) = (0, self.replaced + 1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RULES: Rules = Rules { tolerance: 1e-7, with_age: true, after_failure: true };

    #[test]
    fn progress_is_made_in_energy_or_residual() {
        let mut progress = Progress::new(1e-12, 1.0);
        for _ in 0..STALLED - 1 {
            progress.note(-5.0, -5.0, 1.0);
        }
        assert!(!progress.has_stalled());
        // A lower residual than ever is progress, and so is a fall of the energy beyond rounding.
        progress.note(-5.0, -5.0, 0.9);
        for _ in 0..STALLED - 1 {
            progress.note(-5.0, -5.0 - 4e-12, 0.95);
        }
        progress.note(-5.0, -5.0 - 6e-12, 0.95);
        for _ in 0..STALLED {
            assert!(!progress.has_stalled());
            progress.note(-5.0, -5.0, 0.9);
        }
        assert!(progress.has_stalled());
    }

    /// The iterations, of `n` at this residual, that begin with a new model, and whether these
    /// forget.
    fn rebuilds(rules: Rules, residual: f64, n: u32) -> Vec<(u32, bool)> {
        let mut lifetime = Lifetime::new(rules);
        let new = |i| match lifetime.iterate(residual) {
            Model::New { forget } => Some((i, forget)),
            Model::Present => None,
        };
        (0..n).filter_map(new).collect()
    }

    #[test]
    fn models_are_rebuilt_after_2_5_and_every_16_iterations_unless_the_end_is_near() {
        assert_eq!(rebuilds(RULES, 1e-3, 38), [(2, true), (5, false), (21, false), (37, false)]);
        assert_eq!(rebuilds(RULES, 1e-6, 38), [(16, true), (32, false)]);
        assert_eq!(rebuilds(Rules { with_age: false, ..RULES }, 1e-3, 38), []);
    }

    #[test]
    fn a_retreat_first_forgets_then_rebuilds_then_strengthens() {
        let mut lifetime = Lifetime::new(RULES);
        lifetime.iterate(1e-6);
        lifetime.iterate(1e-6);
        assert_eq!(lifetime.retreat(true, true), Retreat::Forget);
        assert_eq!(lifetime.retreat(false, true), Retreat::Rebuild);
        // A new model is not at fault for its age.
        assert_eq!(lifetime.iterate(1e-6), Model::Present);
        assert_eq!(lifetime.retreat(false, false), Retreat::Strengthen);
        assert_eq!(lifetime.retreat(false, true), Retreat::GiveUp);
        let mut lifetime = Lifetime::new(Rules { after_failure: false, ..RULES });
        lifetime.iterate(1e-6);
        lifetime.iterate(1e-6);
        assert_eq!(lifetime.retreat(false, false), Retreat::Strengthen);
    }
}
