//! Element tests of materials.

use axum::Json;
use axum::extract::State;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

use super::dto;
use super::extract::JsonBody;
use super::openapi::PROBLEM;
use super::problem::Problem;
use super::scenes::by_judges;
use super::state::Api;
use gridfall_core::material::element::{self, Point, Programme, Refused, Stuck, Test, Wishes};
use gridfall_scene::{self as scene, Fault};

/// Most steps of a test, which bound its cost. The command line takes more.
const MAX_STEPS: u32 = 2000;

/// Described by the scene's own schema.
#[derive(ToSchema)]
pub struct Material {}

/// A request to take one element of a material through a test of a laboratory.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TestMaterial {
    /// As in a scene: a preset, with values to replace beside it, or a model with its parameters.
    #[schema(value_type = Material)]
    material: Value,
    test: ElementTest,
    /// Strain at the end of the test; by default some times the strain at which the material yields.
    strain: Option<f64>,
    /// Pressure (Pa) that a triaxial or shear test holds; by default 100 kPa, or a hundredth of the modulus if that is
    /// less.
    #[schema(minimum = 0)]
    confining_pressure: Option<f64>,
    /// Steps of the test; 200 by default.
    #[schema(minimum = 1, maximum = 2000)]
    steps: Option<u32>,
    /// Strain per second, for viscosity and damping; without it, the test is slow.
    rate: Option<f64>,
}

/// A test of a laboratory. Triaxial and oedometer tests count compression as positive, the others tension.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ElementTest {
    /// Pulled (or pressed, with a negative strain), the sides free.
    Uniaxial,
    /// Pressed, the sides held at a pressure.
    Triaxial,
    /// Sheared, at constant volume or under a constant vertical pressure.
    Shear,
    /// Pressed, the sides fixed.
    Oedometer,
}

impl From<ElementTest> for Test {
    fn from(test: ElementTest) -> Self {
        match test {
            ElementTest::Uniaxial => Self::Uniaxial,
            ElementTest::Triaxial => Self::Triaxial,
            ElementTest::Shear => Self::Shear,
            ElementTest::Oedometer => Self::Oedometer,
        }
    }
}

/// The curve of an element test, and the test as it was done.
#[derive(Debug, Serialize, ToSchema)]
pub struct MaterialCurve {
    /// With its model and all its parameters.
    #[schema(value_type = Object)]
    material: Value,
    test: ElementTest,
    /// At the end of the test.
    strain: f64,
    /// Pressure (Pa) before the test, which was then held; 0 for none.
    confining_pressure: f64,
    steps: u64,
    /// Strain per second; 0 where it was slow.
    rate: f64,
    /// What the numbers of a row are. Stresses are in Pa.
    #[schema(value_type = Vec<String>)]
    columns: [&'static str; Point::COLUMNS.len()],
    /// A row a step; the first is the state before the test.
    #[schema(value_type = Vec<Vec<f64>>)]
    rows: Vec<[f64; Point::COLUMNS.len()]>,
}

/// Takes one element of a material through a test of a laboratory, by the laws that the engines run.
#[utoipa::path(post, path = "/v1/materials/test", tag = "scenes", operation_id = "test_material",
    request_body = TestMaterial,
    responses(
        (status = 200, body = MaterialCurve),
        (status = 422, body = dto::Problem, content_type = PROBLEM,
            description = "`invalid_material` with all its `faults`, `invalid_request`"),
    ))]
pub async fn test(
    State(api): State<Api>,
    JsonBody(request, room): JsonBody<TestMaterial>,
) -> Result<Json<MaterialCurve>, Problem> {
    let tested = by_judges(&api, room, move || curve(&request)).await?;
    tested.map(Json).map_err(Problem::invalid_material)
}

fn curve(request: &TestMaterial) -> Result<MaterialCurve, Vec<Fault>> {
    let material = scene::material(&request.material, &[]).map_err(|faults| {
        let inside = |fault: Fault| Fault { pointer: format!("/material{}", fault.pointer), ..fault };
        faults.into_iter().map(inside).collect::<Vec<_>>()
    })?;
    if let Some(steps) = request.steps.filter(|steps| *steps > MAX_STEPS) {
        let remedy = format!("write {MAX_STEPS} or less; `gridfall material` takes more");
        return Err(fault("steps", "too_many", format!("{steps} steps are too many"), remedy));
    }
    let wishes = Wishes {
        strain: request.strain,
        confining_pressure: request.confining_pressure,
        steps: request.steps.map(|steps| steps as usize),
        rate: request.rate,
    };
    let refused =
        |Refused { field, reason, remedy }| fault(field, "out_of_range", format!("`{field}` {reason}"), remedy.into());
    let programme = Programme::wished(&material.law, request.test.into(), &wishes).map_err(refused)?;
    let stuck = |Stuck { strain, reason }| {
        let reason = format!("the test ends at a strain of {strain}: {reason}");
        fault("strain", "test_ends", reason, "make `strain` smaller, or `steps` more".into())
    };
    let points = element::run(&material.law, &programme).map_err(stuck)?;
    Ok(MaterialCurve {
        material: serde_json::to_value(&material).expect("a material is plain data"),
        test: request.test,
        strain: programme.strain,
        confining_pressure: programme.confining_pressure,
        steps: programme.steps as u64,
        rate: programme.rate,
        columns: Point::COLUMNS,
        rows: points.iter().map(Point::values).collect(),
    })
}

fn fault(field: &str, code: &'static str, reason: String, remedy: String) -> Vec<Fault> {
    vec![Fault { pointer: format!("/{field}"), code, reason, remedy }]
}
