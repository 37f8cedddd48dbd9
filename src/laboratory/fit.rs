//! Parameters with which a material's curve is like a measured one, by Nelder and Mead's method
//! (`argmin`): it needs no derivatives, which curves do not have where they yield.
//!
//! What is made small is the root mean square of the differences, each column by its largest measured
//! value. Parameters above 0 are sought as logarithms, others as they are.

use std::cell::Cell;

use argmin::core::{CostFunction, Error, Executor, State, TerminationReason, TerminationStatus};
use argmin::solver::neldermead::NelderMead;
use gridfall_core::material::element::{self, Point, Programme};
use gridfall_core::material::parameters::Material;
use gridfall_scene as scene;
use serde_json::{Value, json};

use super::curve::{Measured, at};

/// A material whose curve is like a measured one.
#[derive(Clone, Debug)]
pub struct Fit {
    pub material: Material,
    /// Root mean square of the differences, by the largest measured values.
    pub residual: f64,
    /// Name, value before and after.
    pub parameters: Vec<(String, f64, f64)>,
    pub curve: Vec<Point>,
    /// Curves that were computed.
    pub evaluations: u64,
}

/// Why there is no fit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NoFit {
    /// It cannot be done as it was asked for.
    Asked(String),
    /// The search did not come to an end.
    Ended(String),
}

/// Iterations of one search for each parameter.
const ITERATIONS: u64 = 150;
/// Searches: each begins where the one before ended, with a new simplex.
const SEARCHES: [f64; 3] = [1.0, 0.3, 0.1];
/// Spread of the residuals in a simplex at which a search ends.
const SPREAD: f64 = 1e-9;
/// What a curve costs that there is not.
const IMPOSSIBLE: f64 = 1e6;

/// Fits parameters of a material, which are its values to begin with.
pub fn fit(
    material: &Material,
    programme: &Programme,
    measured: &Measured,
    parameters: &[String],
) -> Result<Fit, NoFit> {
    let document = serde_json::to_value(material).expect("a material is plain data");
    let mut scales = Vec::new();
    for (n, name) in parameters.iter().enumerate() {
        let Some(value) = document[name.as_str()].as_f64() else {
            let known = scene::presets::page::parameters(material).join(", ");
            let model = document["model"].as_str().unwrap_or_default();
            let reason = format!("the model {model} has no parameter '{name}'; it has {known}");
            return Err(NoFit::Asked(reason));
        };
        if parameters[..n].contains(name) {
            return Err(NoFit::Asked(format!("the parameter '{name}' is named twice")));
        }
        scales.push(Scale::new(name, value, measured));
    }
    if parameters.is_empty() || parameters.len() > measured.strain.len() {
        let reason = format!("{} parameters for {} points", parameters.len(), measured.strain.len());
        return Err(NoFit::Asked(reason));
    }
    let programme = Programme { strain: measured.end(), ..programme.clone() };
    let search = Search { document, parameters, scales: &scales, programme: &programme, measured, count: Cell::new(0) };
    let start: Vec<f64> = scales.iter().map(|scale| scale.coordinate(scale.start)).collect();
    search.does_matter(&start).map_err(NoFit::Asked)?;
    let mut best = start;
    let mut ended = false;
    for size in SEARCHES {
        let (place, converged) = search.run(&best, size).map_err(NoFit::Ended)?;
        (best, ended) = (place, converged);
    }
    let (material, curve) = search.curve(&best).ok_or(NoFit::Ended("the material has no curve there".into()))?;
    let residual = search.residual(&curve);
    if !ended {
        return Err(NoFit::Ended(format!(
            "not converged after {} curves; the best is {} with a residual of {residual:.3e}: begin nearer to it \
             (--set), or fit fewer parameters",
            search.count.get(),
            search.describe(&best)
        )));
    }
    let values = scales.iter().zip(&best);
    let parameters = parameters.iter().zip(values);
    let parameters = parameters.map(|(name, (scale, x))| (name.clone(), scale.start, scale.value(*x))).collect();
    Ok(Fit { material, residual, parameters, curve, evaluations: search.count.get() })
}

/// How a parameter is sought.
struct Scale {
    start: f64,
    logarithmic: bool,
    /// Of the first simplex, in coordinates.
    step: f64,
}

impl Scale {
    fn new(name: &str, start: f64, measured: &Measured) -> Self {
        let largest = measured.columns.iter().map(|(_, values)| largest(values)).fold(0.0, f64::max);
        let (logarithmic, step) = match name {
            _ if name.ends_with("_degrees") => (false, 6.0),
            "poissons_ratio" => (false, if start > 0.2 { -0.08 } else { 0.08 }),
            "alpha0" => (false, 0.5 * start.abs() + 1e-3),
            _ if start > 0.0 => (true, 0.7),
            // A cohesion that begins at 0.
            _ => (false, 0.1 * largest),
        };
        Self { start, logarithmic, step }
    }

    fn coordinate(&self, value: f64) -> f64 {
        if self.logarithmic { value.ln() } else { value }
    }

    fn value(&self, coordinate: f64) -> f64 {
        if self.logarithmic { coordinate.exp() } else { coordinate }
    }
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most: f64, value| most.max(value.abs()))
}

struct Search<'a> {
    document: Value,
    parameters: &'a [String],
    scales: &'a [Scale],
    programme: &'a Programme,
    measured: &'a Measured,
    count: Cell<u64>,
}

impl Search<'_> {
    /// The material at a place and its curve; none where it is not valid or the test cannot be done.
    fn curve(&self, place: &[f64]) -> Option<(Material, Vec<Point>)> {
        let mut document = self.document.clone();
        for ((name, scale), x) in self.parameters.iter().zip(self.scales).zip(place) {
            document[name.as_str()] = json!(scale.value(*x));
        }
        let material = scene::material(&document, &[]).ok()?.law;
        self.count.set(self.count.get() + 1);
        let curve = element::run(&material, self.programme).ok()?;
        Some((material, curve))
    }

    fn residual(&self, curve: &[Point]) -> f64 {
        let (mut sum, mut count) = (0.0, 0);
        for (name, values) in &self.measured.columns {
            let scale = largest(values).max(f64::MIN_POSITIVE);
            for (strain, value) in self.measured.strain.iter().zip(values) {
                sum += ((at(curve, name, *strain) - value) / scale).powi(2);
                count += 1;
            }
        }
        (sum / f64::from(count)).sqrt()
    }

    /// Refuses parameters that change nothing.
    fn does_matter(&self, start: &[f64]) -> Result<(), String> {
        let (_, before) = self.curve(start).ok_or(
            "the material cannot be tested as it is: its parameters are not valid, or the test does not reach the \
             strains measured; change them with --set",
        )?;
        for (n, scale) in self.scales.iter().enumerate() {
            let mut place = start.to_vec();
            place[n] += scale.step;
            let Some((_, after)) = self.curve(&place) else { continue };
            let changed = self.measured.columns.iter().any(|(name, values)| {
                let differs = |e: &f64| (at(&after, name, *e) - at(&before, name, *e)).abs() > 1e-9 * largest(values);
                self.measured.strain.iter().any(differs)
            });
            if !changed {
                let name = &self.parameters[n];
                let columns: Vec<&str> = self.measured.columns.iter().map(|(name, _)| name.as_str()).collect();
                return Err(format!(
                    "'{name}' changes nothing in {} here, so this test does not tell it; take it out of --parameters, \
                     or begin where it matters (--set)",
                    columns.join(" and ")
                ));
            }
        }
        Ok(())
    }

    /// One search: where it ended, and whether by itself.
    fn run(&self, start: &[f64], size: f64) -> Result<(Vec<f64>, bool), String> {
        let mut simplex = vec![start.to_vec()];
        for (n, scale) in self.scales.iter().enumerate() {
            let mut corner = start.to_vec();
            corner[n] += size * scale.step;
            simplex.push(corner);
        }
        let failed = |error: Error| format!("the search failed: {error}");
        let solver = NelderMead::new(simplex).with_sd_tolerance(SPREAD).map_err(failed)?;
        let most = ITERATIONS * self.scales.len() as u64;
        let ended = Executor::new(self, solver).configure(|state| state.max_iters(most)).run().map_err(failed)?;
        let by_itself = matches!(
            ended.state().get_termination_status(),
            TerminationStatus::Terminated(TerminationReason::SolverConverged)
        );
        let place = ended.state().get_best_param().cloned().unwrap_or_else(|| start.to_vec());
        Ok((place, by_itself))
    }

    fn describe(&self, place: &[f64]) -> String {
        let values = self.parameters.iter().zip(self.scales).zip(place);
        values.map(|((name, scale), x)| format!("{name} = {:.6e}", scale.value(*x))).collect::<Vec<_>>().join(", ")
    }
}

impl CostFunction for &Search<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, place: &Vec<f64>) -> Result<f64, Error> {
        Ok(self.curve(place).map_or(IMPOSSIBLE, |(_, curve)| self.residual(&curve)))
    }
}

#[cfg(test)]
mod tests {
    use gridfall_core::material::element::{Test, run};
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn preset(name: &str, changes: &[&str]) -> Material {
        let changes: Vec<String> = changes.iter().map(|change| (*change).to_owned()).collect();
        scene::material(&json!({ "preset": name }), &changes).unwrap().law
    }

    /// What a laboratory would measure of a material, with errors of a share of the largest value.
    fn measure(truth: &Material, programme: &Programme, columns: &[&str], noise: f64) -> Measured {
        let seed = 7;
        println!("seed {seed}");
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let curve = run(truth, programme).unwrap();
        let strain: Vec<f64> = (0..40).map(|n| programme.strain * f64::from(n) / 39.0).collect();
        let column = |name: &&str| {
            let exact: Vec<f64> = strain.iter().map(|e| at(&curve, name, *e)).collect();
            let size = noise * largest(&exact);
            ((*name).to_owned(), exact.iter().map(|x| x + size * rng.random_range(-1.0..1.0)).collect())
        };
        Measured { columns: columns.iter().map(column).collect(), strain }
    }

    #[track_caller]
    fn recovered(fit: &Fit, name: &str, truth: f64, share: f64) {
        let (_, _, value) = fit.parameters.iter().find(|(known, ..)| known == name).unwrap();
        assert!((value - truth).abs() <= share * truth.abs(), "{name} is {value} and not {truth}");
    }

    #[test]
    fn parameters_of_sand_are_found_in_a_noisy_curve() {
        let truth =
            preset("dense-sand", &["friction_angle_degrees=38", "youngs_modulus=3.2e7", "dilatancy_angle_degrees=8"]);
        let start = preset("dry-sand", &["dilatancy_angle_degrees=1"]);
        let programme = Programme { strain: 0.06, ..Programme::usual(&start, Test::Triaxial) };
        let names = ["friction_angle_degrees", "youngs_modulus", "dilatancy_angle_degrees"].map(str::to_owned);
        let measured = measure(&truth, &programme, &["q", "volumetric_strain"], 0.02);
        let fit = fit(&start, &programme, &measured, &names).unwrap();
        recovered(&fit, "friction_angle_degrees", 38.0, 0.01);
        recovered(&fit, "youngs_modulus", 3.2e7, 0.05);
        recovered(&fit, "dilatancy_angle_degrees", 8.0, 0.05);
        assert!(fit.residual < 0.02 && fit.evaluations > 20, "{fit:?}");
    }

    #[test]
    fn parameters_without_noise_are_found_exactly() {
        let start = preset("natural-rubber", &[]);
        let truth = preset("natural-rubber", &["youngs_modulus=3e6", "poissons_ratio=0.4"]);
        let programme = Programme::usual(&start, Test::Uniaxial);
        let names = ["youngs_modulus", "poissons_ratio"].map(str::to_owned);
        let measured = measure(&truth, &programme, &["nominal_stress", "volumetric_strain"], 0.0);
        let rubber = fit(&start, &programme, &measured, &names).unwrap();
        recovered(&rubber, "youngs_modulus", 3e6, 1e-5);
        recovered(&rubber, "poissons_ratio", 0.4, 1e-5);
        let start = preset("lead", &[]);
        let programme = Programme { strain: 0.01, ..Programme::usual(&start, Test::Uniaxial) };
        let truth = preset("lead", &["youngs_modulus=1e10", "yield_stress=2e7"]);
        let measured = measure(&truth, &programme, &["axial_stress"], 0.0);
        let metal = fit(&start, &programme, &measured, &["youngs_modulus", "yield_stress"].map(str::to_owned)).unwrap();
        recovered(&metal, "youngs_modulus", 1e10, 1e-3);
        recovered(&metal, "yield_stress", 2e7, 1e-5);
    }

    #[test]
    fn what_cannot_be_fitted_is_said() {
        let sand = preset("dry-sand", &[]);
        let programme = Programme { strain: 0.05, ..Programme::usual(&sand, Test::Triaxial) };
        let measured = measure(&sand, &programme, &["q"], 0.0);
        let said = |names: &[&str]| {
            let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
            match fit(&sand, &programme, &measured, &names).unwrap_err() {
                NoFit::Asked(reason) => reason,
                NoFit::Ended(reason) => panic!("{reason}"),
            }
        };
        assert!(said(&["yield_stress"]).contains("mohr-coulomb has no parameter 'yield_stress'; it has"));
        assert!(said(&["density"]).contains("'density' changes nothing in q"));
        assert!(said(&["cohesion", "cohesion"]).contains("twice"));
        assert!(said(&[]).contains("0 parameters"));
    }
}
