//! `gridfall material`: what the presets are, element tests of materials, and materials from measured
//! curves.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use super::CliError;
use super::run::read;
use crate::laboratory::curve::{self, Measured};
use crate::laboratory::fit::{self, Fit, NoFit};
use crate::laboratory::plot::{self, Panel, Series};
use crate::laboratory::shown;
use gridfall_core::material::element::{self, Point, Programme, Refused, Test, Wishes};
use gridfall_core::material::parameters::Material;
use gridfall_scene::{self as scene, Fault, presets};

/// List the presets of materials, show one with its sources, test a material, or fit it to a measured curve.
#[derive(Debug, Args)]
pub struct Arguments {
    /// A preset; or a material (JSON); or one of a scene: SCENE.json#materials.sand, SCENE.json#bodies.0.
    name: Option<String>,
    /// Test one element of it: a curve of stresses, strains and volumes. Triaxial and oedometer tests count
    /// compression as positive, the others tension.
    #[arg(long, value_enum)]
    test: Option<TestName>,
    /// Strain at the end of the test; by default some times the strain at which the material yields.
    #[arg(long, allow_negative_numbers = true, requires = "test")]
    strain: Option<f64>,
    /// Pressure (Pa) that a triaxial or shear test holds; by default 100 kPa, or a hundredth of the modulus if that is
    /// less.
    #[arg(long, value_name = "PA", requires = "test")]
    confining_pressure: Option<f64>,
    /// Steps of the test.
    #[arg(long, requires = "test", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    steps: Option<u32>,
    /// Strain per second, for viscosity and damping; without it, the test is slow.
    #[arg(long, requires = "test")]
    rate: Option<f64>,
    /// Replace a parameter, such as friction_angle_degrees=40; may be given several times.
    #[arg(long = "set", value_name = "FIELD=VALUE")]
    overrides: Vec<String>,
    /// Write the curve; - writes to standard output.
    #[arg(long, value_name = "OUT.csv", requires = "test")]
    csv: Option<PathBuf>,
    /// Draw the curve.
    #[arg(long, value_name = "OUT.svg", requires = "test")]
    plot: Option<PathBuf>,
    /// Fit parameters to a measured curve: CSV with a column strain and others of the program's, such as q.
    #[arg(long, value_name = "MEASURED.csv", requires = "test", requires = "parameters")]
    fit: Option<PathBuf>,
    /// Parameters to fit, such as friction_angle_degrees,youngs_modulus.
    #[arg(long, value_delimiter = ',', requires = "fit")]
    parameters: Vec<String>,
    /// Write the material (JSON), fitted if it was.
    #[arg(short, long, value_name = "OUT.json")]
    output: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum TestName {
    /// Pulled (or pressed, with a negative strain), the sides free.
    Uniaxial,
    /// Pressed, the sides held at a pressure.
    Triaxial,
    /// Sheared, at constant volume or under a constant vertical pressure.
    Shear,
    /// Pressed, the sides fixed.
    Oedometer,
}

impl From<TestName> for Test {
    fn from(name: TestName) -> Self {
        match name {
            TestName::Uniaxial => Self::Uniaxial,
            TestName::Triaxial => Self::Triaxial,
            TestName::Shear => Self::Shear,
            TestName::Oedometer => Self::Oedometer,
        }
    }
}

pub fn execute(arguments: Arguments) -> Result<(), CliError> {
    let Some(name) = &arguments.name else {
        return print(&if arguments.json { format!("{:#}\n", presets::json()) } else { list() });
    };
    let material = find(name, &arguments.overrides)?;
    let Some(test) = arguments.test else {
        if let Some(path) = &arguments.output {
            write(path, &format!("{:#}\n", material))?;
        }
        let known = presets::find(name).filter(|_| arguments.overrides.is_empty() && !arguments.json);
        return print(&known.map_or_else(
            || format!("{material:#}\n"),
            |preset| format!("{}\n  As a material of a scene\n{}\n", presets::page::text(preset), indented(&material)),
        ));
    };
    let law: Material = law(&material);
    let programme = programme(&arguments, &law, test.into())?;
    match &arguments.fit {
        None => tested(&arguments, &material, &law, &programme),
        Some(path) => fitted(&arguments, &material, &law, &programme, path),
    }
}

/// The law of a material that was found.
fn law(material: &Value) -> Material {
    scene::material(material, &[]).expect("it was a material").law
}

/// Runs a test and shows its curve.
fn tested(arguments: &Arguments, material: &Value, law: &Material, programme: &Programme) -> Result<(), CliError> {
    let points = run(law, programme)?;
    outputs(arguments, &title(arguments, programme), &points, None)?;
    if let Some(path) = &arguments.output {
        write(path, &format!("{material:#}\n"))?;
    }
    if arguments.csv.as_deref() == Some(Path::new("-")) {
        return Ok(());
    }
    if arguments.json {
        let rows: Vec<Value> = points.iter().map(|point| json!(point.values())).collect();
        let answer = json!({ "material": material, "test": programme.test.name(), "strain": programme.strain,
            "confining_pressure": programme.confining_pressure, "steps": programme.steps, "rate": programme.rate,
            "columns": Point::COLUMNS, "rows": rows });
        return print(&format!("{answer:#}\n"));
    }
    print(&table(&title(arguments, programme), &points))
}

/// Fits parameters and shows what came of it.
fn fitted(
    arguments: &Arguments,
    material: &Value,
    law: &Material,
    programme: &Programme,
    path: &Path,
) -> Result<(), CliError> {
    let name = path.display();
    let file = File::open(path).map_err(|error| CliError::BadInput(format!("cannot read {name}: {error}")))?;
    let measured = curve::read(file).map_err(|reason| CliError::BadInput(format!("{name}: {reason}")))?;
    let refused = |why| match why {
        NoFit::Asked(reason) => CliError::BadInput(reason),
        NoFit::Ended(reason) => CliError::Failed(reason),
    };
    let Fit { material: law, residual, parameters, curve, evaluations } =
        fit::fit(law, programme, &measured, &arguments.parameters).map_err(refused)?;
    let mut whole = material.clone();
    let fitted = serde_json::to_value(law).expect("a material is plain data");
    for (name, ..) in &parameters {
        whole[name.as_str()] = fitted[name.as_str()].clone();
    }
    let title = format!("{}, fitted", title(arguments, programme));
    outputs(arguments, &title, &curve, Some(&measured))?;
    if let Some(path) = &arguments.output {
        write(path, &format!("{whole:#}\n"))?;
    }
    if arguments.json {
        let rows: Vec<Value> =
            parameters.iter().map(|(name, from, to)| json!({ "name": name, "from": from, "to": to })).collect();
        let answer = json!({ "material": whole, "residual": residual, "parameters": rows, "evaluations": evaluations });
        return print(&format!("{answer:#}\n"));
    }
    let mut text = format!("{title}\n");
    for (name, from, to) in &parameters {
        text += &format!("  {name:<26} {to:.6e} (was {from:.6e})\n");
    }
    text += &format!("  residual {:.3} % of the largest values, after {evaluations} curves\n", 100.0 * residual);
    print(&text)
}

/// The material that an argument names, as JSON with all its parameters.
fn find(name: &str, overrides: &[String]) -> Result<Value, CliError> {
    let faulty = |faults: Vec<Fault>| CliError::Faults { scene: name.to_owned(), faults };
    let document = match name.split_once(".json#") {
        Some((stem, place)) => of_scene(Path::new(&format!("{stem}.json")), place)?,
        None if presets::find(name).is_some() => json!({ "preset": name }),
        None if Path::new(name).exists() => {
            let text = read(Path::new(name)).map_err(|why| CliError::BadInput(format!("cannot read {name}: {why}")))?;
            serde_json::from_str(&text).map_err(|error| CliError::BadInput(format!("{name} is no JSON: {error}")))?
        }
        None => {
            let known = presets::suggestion(name);
            return Err(CliError::BadInput(format!("there is no preset and no file '{name}'; {known}")));
        }
    };
    let material = scene::material(&document, overrides).map_err(faulty)?;
    Ok(serde_json::to_value(material).expect("a material is plain data"))
}

/// The material at `materials.NAME`, `bodies.N` or `sources.N` of a scene.
fn of_scene(path: &Path, place: &str) -> Result<Value, CliError> {
    let name = path.display();
    let text = read(path).map_err(|why| CliError::BadInput(format!("cannot read {name}: {why}")))?;
    let scene = scene::parse(&text).map_err(|faults| CliError::Faults { scene: name.to_string(), faults })?;
    let missing = || {
        CliError::BadInput(format!(
            "{name} has no material at '{place}'; write #materials.NAME, #bodies.0 or #sources.0; its materials are \
             {}",
            scene.materials.keys().map(String::as_str).collect::<Vec<_>>().join(", ")
        ))
    };
    let (list, rest) = place.split_once('.').ok_or_else(missing)?;
    let index = || rest.trim_end_matches(".material").parse::<usize>().ok();
    let used = match list {
        "materials" => Some(rest),
        "bodies" => index().and_then(|n| scene.bodies.get(n)).map(|body| body.material.as_str()),
        "sources" => index().and_then(|n| scene.sources.get(n)).map(|source| source.material.as_str()),
        _ => None,
    };
    let material = used.and_then(|used| scene.materials.get(used)).ok_or_else(missing)?;
    Ok(serde_json::to_value(material).expect("a material is plain data"))
}

/// The test that the arguments ask for.
fn programme(arguments: &Arguments, material: &Material, test: Test) -> Result<Programme, CliError> {
    let wishes = Wishes {
        strain: arguments.strain,
        confining_pressure: arguments.confining_pressure,
        steps: arguments.steps.map(|steps| steps as usize),
        rate: arguments.rate,
    };
    let option = |field: &str| format!("--{}", field.replace('_', "-"));
    let refused =
        |Refused { field, reason, remedy }| CliError::BadInput(format!("{} {reason}; {remedy}", option(field)));
    Programme::wished(material, test, &wishes).map_err(refused)
}

fn run(material: &Material, programme: &Programme) -> Result<Vec<Point>, CliError> {
    element::run(material, programme).map_err(|stuck| {
        CliError::Failed(format!(
            "the test ends at a strain of {}: {}; make --strain smaller, or --steps more",
            stuck.strain, stuck.reason
        ))
    })
}

fn title(arguments: &Arguments, programme: &Programme) -> String {
    let name = arguments.name.as_deref().unwrap_or_default();
    let set: Vec<String> = arguments.overrides.iter().map(|change| format!(", {}", change.trim())).collect();
    let pressure = match programme.confining_pressure {
        p if p >= 1e3 => format!(" at {} kPa", p / 1e3),
        p if p > 0.0 => format!(" at {p} Pa"),
        _ => String::new(),
    };
    format!("{name}{}: {}{pressure}", set.concat(), programme.test.name())
}

/// Writes the files that were asked for.
fn outputs(arguments: &Arguments, title: &str, points: &[Point], measured: Option<&Measured>) -> Result<(), CliError> {
    if let Some(path) = &arguments.csv {
        let failed = |reason: String| CliError::Failed(format!("cannot write {}: {reason}", path.display()));
        if path == Path::new("-") {
            curve::write(points, io::stdout().lock()).map_err(failed)?;
        } else {
            let file = File::create(path).map_err(|error| failed(error.to_string()))?;
            curve::write(points, file).map_err(failed)?;
            eprintln!("wrote {}", path.display());
        }
    }
    if let Some(path) = &arguments.plot {
        if path.extension().is_none_or(|extension| extension != "svg") {
            return Err(CliError::BadInput(format!("--plot {}: pictures are SVG; name it .svg", path.display())));
        }
        let test: Test = arguments.test.expect("a plot is of a test").into();
        let text = plot::svg(title, &panels(test, points, measured)).map_err(CliError::Failed)?;
        write(path, &text)?;
    }
    Ok(())
}

/// Diagrams of what was measured, or of what the test is about.
fn panels(test: Test, points: &[Point], measured: Option<&Measured>) -> Vec<Panel> {
    let columns: Vec<&str> = match measured {
        Some(measured) => measured.columns.iter().map(|(name, _)| name.as_str()).collect(),
        None => shown(test).to_vec(),
    };
    let line = |column: &str| {
        let at = |point: &Point| (point.strain, point.value(column).expect("the column is known"));
        let name = if measured.is_some() { "fitted" } else { column };
        Series { name: name.to_owned(), points: points.iter().map(at).collect(), measured: false }
    };
    let panel = |column: &&str| {
        let given = measured.and_then(|measured| {
            let (_, values) = measured.columns.iter().find(|(name, _)| name == column)?;
            let points = measured.strain.iter().copied().zip(values.iter().copied()).collect();
            Some(Series { name: "measured".into(), points, measured: true })
        });
        Panel { column: (*column).to_owned(), series: std::iter::once(line(column)).chain(given).collect() }
    };
    columns.iter().map(panel).collect()
}

/// Some points of a curve, for a terminal.
fn table(title: &str, points: &[Point]) -> String {
    let columns =
        ["strain", "axial_stress", "lateral_stress", "shear_stress", "p", "q", "volumetric_strain", "plastic_strain"];
    let mut text = format!("{title}\n");
    text += &columns.map(|name| format!("{name:>18}")).concat();
    text += "\n";
    let every = points.len().div_ceil(20).max(1);
    let rows = points.iter().enumerate().filter(|(n, _)| n % every == 0 || n + 1 == points.len());
    for (_, point) in rows {
        text += &columns.map(|name| format!("{:>18.5e}", point.value(name).unwrap_or_default())).concat();
        text += "\n";
    }
    text
}

/// The presets by group.
fn list() -> String {
    let (mut text, mut group) = (String::new(), "");
    for (of, preset) in presets::grouped() {
        if of != group {
            text += &format!("{}{of}\n", if group.is_empty() { "" } else { "\n" });
            group = of;
        }
        text += &format!("  {:<16} {}\n", preset.name, preset.about);
    }
    text + "\nIn a scene: \"materials\": { \"sand\": { \"preset\": \"dry-sand\", \"friction_angle_degrees\": 40 } }\n\
            Values and sources of one: gridfall material NAME; its curves: gridfall material NAME --test triaxial\n"
}

fn indented(value: &Value) -> String {
    format!("{value:#}").lines().map(|line| format!("  {line}")).collect::<Vec<_>>().join("\n")
}

fn write(path: &Path, text: &str) -> Result<(), CliError> {
    let failed = |error: io::Error| CliError::Failed(format!("cannot write {}: {error}", path.display()));
    fs::write(path, text).map_err(failed)?;
    eprintln!("wrote {}", path.display());
    Ok(())
}

fn print(text: &str) -> Result<(), CliError> {
    match io::stdout().write_all(text.as_bytes()) {
        // A reader such as `head` may close the pipe early.
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(CliError::Failed(error.to_string())),
        _ => Ok(()),
    }
}
