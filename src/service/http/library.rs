//! The scenes that come with the program.

use axum::Json;
use axum::extract::Path;
use axum::extract::rejection::PathRejection;
use axum::http::{HeaderMap, Method, header};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::conditional::Version;
use super::problem::{Code, Problem};
use super::submission::sha256_hex;

// Names and documents of the files in `scenes/`, by name.
include!(concat!(env!("OUT_DIR"), "/library.rs"));

/// The scenes that come with the program, by name.
#[derive(Debug, Serialize, ToSchema)]
pub struct Library {
    pub scenes: Vec<LibraryScene>,
}

/// A scene that comes with the program.
#[derive(Debug, Serialize, Deserialize, ToSchema)]
pub struct LibraryScene {
    pub name: String,
    /// What to look for.
    pub description: String,
    /// 2 or 3.
    #[serde(default = "three")]
    pub dimension: u8,
}

/// Scenes are 3D by default.
fn three() -> u8 {
    3
}

/// Lists the scenes that come with the program.
#[utoipa::path(get, path = "/v1/library", tag = "scenes", operation_id = "list_library",
    responses((status = 200, body = Library)))]
pub async fn list() -> Json<Library> {
    let scene = |(_, document): &(&str, &str)| {
        serde_json::from_str(document).expect("the scenes of the library are documents with descriptions")
    };
    Json(Library { scenes: SCENES.iter().map(scene).collect() })
}

/// The document of a scene that comes with the program.
#[utoipa::path(get, path = "/v1/library/{name}", tag = "scenes", operation_id = "get_library_scene",
    params(
        ("name" = String, Path, description = "Name of the scene"),
        ("If-None-Match" = Option<String>, Header, description = "`ETag` of an earlier answer"),
    ),
    responses(
        (status = 200, body = Object, headers(("ETag" = String))),
        (status = 304, description = "The client has it"),
    ))]
pub async fn get(name: Result<Path<String>, PathRejection>, headers: HeaderMap) -> Result<Response, Problem> {
    let Path(name) = name.map_err(|rejection| Problem::new(Code::InvalidPath, rejection.body_text()))?;
    let Some((_, document)) = SCENES.iter().find(|(known, _)| *known == name) else {
        let detail = format!("the library has no scene {name}; GET /v1/library lists all");
        return Err(Problem::new(Code::SceneNotFound, detail));
    };
    let version = Version::of_tag(format!("\"{}\"", &sha256_hex(document.as_bytes())[..32]));
    if let Some(answer) = version.judge(&Method::GET, &headers)? {
        return Ok(answer);
    }
    let mut answer = ([(header::CONTENT_TYPE, "application/json")], *document).into_response();
    version.write(answer.headers_mut());
    Ok(answer)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_library_is_whole() {
        assert!(SCENES.len() >= 70, "{}", SCENES.len());
        for (name, document) in SCENES {
            let scene: LibraryScene = serde_json::from_str(document).unwrap();
            assert_eq!(scene.name, *name);
        }
    }
}
