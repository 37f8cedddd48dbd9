//! The dashboard: pages, styles and scripts, all in the program. What they show comes from the API, as any client gets
//! it.

use std::sync::LazyLock;

use axum::Router;
use axum::extract::Path;
use axum::http::{HeaderMap, HeaderValue, Method, Uri, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;

use super::conditional::Version;
use super::layers::route_not_found;
use super::problem::Problem;
use super::state::Api;
use super::submission::sha256_hex;

/// The browser takes scripts, styles and pictures from this server only, and sends nothing elsewhere.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; \
                      base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// A file of the dashboard, and its content.
macro_rules! files {
    ($($name:literal $kind:literal,)+) => {
        &[$(($name, $kind, include_str!(concat!("dashboard/", $name)))),+]
    };
}

const FILES: &[(&str, &str, &str)] = files! {
    "index.html" "text/html; charset=utf-8",
    "style.css" "text/css; charset=utf-8",
    "lists.css" "text/css; charset=utf-8",
    "new.css" "text/css; charset=utf-8",
    "job.css" "text/css; charset=utf-8",
    "view.css" "text/css; charset=utf-8",
    "narrow.css" "text/css; charset=utf-8",
    "icon.svg" "image/svg+xml",
    "theme.js" "text/javascript; charset=utf-8",
    "main.js" "text/javascript; charset=utf-8",
    "signin.js" "text/javascript; charset=utf-8",
    "api.js" "text/javascript; charset=utf-8",
    "dom.js" "text/javascript; charset=utf-8",
    "format.js" "text/javascript; charset=utf-8",
    "actions.js" "text/javascript; charset=utf-8",
    "axes.js" "text/javascript; charset=utf-8",
    "drawing.js" "text/javascript; charset=utf-8",
    "estimate.js" "text/javascript; charset=utf-8",
    "exports.js" "text/javascript; charset=utf-8",
    "frames.js" "text/javascript; charset=utf-8",
    "job.js" "text/javascript; charset=utf-8",
    "jobs.js" "text/javascript; charset=utf-8",
    "legend.js" "text/javascript; charset=utf-8",
    "library.js" "text/javascript; charset=utf-8",
    "options.js" "text/javascript; charset=utf-8",
    "orbit.js" "text/javascript; charset=utf-8",
    "outputs.js" "text/javascript; charset=utf-8",
    "places.js" "text/javascript; charset=utf-8",
    "plot.js" "text/javascript; charset=utf-8",
    "plots.js" "text/javascript; charset=utf-8",
    "pointer.js" "text/javascript; charset=utf-8",
    "preview.js" "text/javascript; charset=utf-8",
    "problem.js" "text/javascript; charset=utf-8",
    "results.js" "text/javascript; charset=utf-8",
    "scene3d.js" "text/javascript; charset=utf-8",
    "selection.js" "text/javascript; charset=utf-8",
    "shaders.js" "text/javascript; charset=utf-8",
    "solids.js" "text/javascript; charset=utf-8",
    "submit.js" "text/javascript; charset=utf-8",
    "sweep.js" "text/javascript; charset=utf-8",
    "sweepform.js" "text/javascript; charset=utf-8",
    "sweeps.js" "text/javascript; charset=utf-8",
    "uploads.js" "text/javascript; charset=utf-8",
    "values.js" "text/javascript; charset=utf-8",
    "viewer.js" "text/javascript; charset=utf-8",
};

static VERSIONS: LazyLock<Vec<Version>> = LazyLock::new(|| {
    let tag = |text: &str| format!("\"{}\"", &sha256_hex(text.as_bytes())[..32]);
    FILES.iter().map(|(_, _, text)| Version::of_tag(tag(text))).collect()
});

/// The routes of the dashboard's files. They are no part of the API, so the document has none of them.
pub fn routes() -> Router<Api> {
    Router::new().route("/dashboard/{file}", get(file))
}

/// The page at the server's address.
pub fn page(headers: &HeaderMap) -> Result<Response, Problem> {
    send(0, headers)
}

async fn file(Path(name): Path<String>, uri: Uri, headers: HeaderMap) -> Result<Response, Problem> {
    match FILES.iter().skip(1).position(|(known, ..)| *known == name) {
        Some(at) => send(at + 1, &headers),
        None => Err(route_not_found(uri).await),
    }
}

fn send(at: usize, headers: &HeaderMap) -> Result<Response, Problem> {
    let ((_, kind, text), version) = (FILES[at], &VERSIONS[at]);
    let mut answer = match version.judge(&Method::GET, headers)? {
        Some(answer) => answer,
        None => ([(header::CONTENT_TYPE, kind)], text).into_response(),
    };
    version.write(answer.headers_mut());
    answer.headers_mut().insert(header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY));
    Ok(answer)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_is_served_and_loads_only_what_is_served() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/http/dashboard");
        let known: Vec<&str> = FILES.iter().map(|(name, ..)| *name).collect();
        for entry in std::fs::read_dir(folder).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            assert!(known.contains(&name.as_str()), "{name} is in no list");
        }
        for (name, _, text) in FILES {
            let imports = text.split(" from \"./").skip(1).filter_map(|rest| rest.split('"').next());
            let loads = text.split("=\"/dashboard/").skip(1).filter_map(|rest| rest.split('"').next());
            for loaded in imports.chain(loads) {
                assert!(known.contains(&loaded), "{name} loads {loaded}");
            }
            assert!(!text.contains("style=\"") && !text.contains("onclick="), "{name} has what the policy forbids");
        }
    }
}
