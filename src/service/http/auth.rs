//! Who may do what: the one place where each request is judged by its route before its handler sees it. What belongs
//! to another key is not there: it is answered as what does not exist is.

use axum::RequestExt;
use axum::extract::{MatchedPath, RawPathParams, Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use jiff::Timestamp;
use uuid::Uuid;

use super::audit::Hidden;
use super::caller::{Caller, shown};
use super::extract::is_hash;
use super::problem::{Code, Problem};
use super::state::Api;
use crate::store::{Scope, Secret, Standing, Upload};

/// What a route asks of its callers, where callers need keys; none where it is open to all.
pub fn needed(method: &str, route: &str) -> Option<Scope> {
    let reads = ["get", "head", "options"].iter().any(|read| method.eq_ignore_ascii_case(read));
    match route {
        "/" | "/openapi.json" | "/livez" | "/readyz" | "/v1/schema/scene" | "/v1/session" => None,
        "/v1/library" | "/v1/library/{name}" | "/v1/materials" | "/v1/materials/{name}" => None,
        _ if route.starts_with("/docs") || route.starts_with("/dashboard") => None,
        "/metrics" => Some(Scope::Admin),
        // They tell of everybody's jobs.
        _ if route.starts_with("/v1/webhooks") => Some(Scope::Admin),
        _ if reads => Some(Scope::Read),
        _ => Some(Scope::Submit),
    }
}

/// Lets requests pass that may, and tells their handlers who asks.
pub async fn authorize(State(api): State<Api>, mut request: Request, next: Next) -> Response {
    let route = request.extensions().get::<MatchedPath>().map(|route| route.as_str().to_owned());
    // What is nowhere is answered to all in the same way.
    let scope = route.as_deref().and_then(|route| needed(request.method().as_str(), route));
    let (Some(scope), Some(route)) = (scope, route) else { return next.run(request).await };
    let caller = match admitted(&api, request.headers(), scope).await {
        Ok(caller) => caller,
        Err((problem, caller)) => return known(problem.into_response(), caller),
    };
    if let Err(problem) = visible(&api, &caller, &route, &mut request).await {
        let mut answer = problem.into_response();
        answer.extensions_mut().insert(Hidden);
        return known(answer, Some(caller));
    }
    let confined = caller.key().is_some();
    request.extensions_mut().insert(caller.clone());
    let mut answer = next.run(request).await;
    if confined && !answer.headers().contains_key(header::CACHE_CONTROL) {
        // The cookie may be another one tomorrow.
        answer.headers_mut().insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    }
    known(answer, Some(caller))
}

/// Tells the audit who has got an answer.
fn known(mut answer: Response, caller: Option<Caller>) -> Response {
    if let Some(caller) = caller {
        answer.extensions_mut().insert(caller);
    }
    answer
}

/// The caller, if it may use the route at all.
async fn admitted(api: &Api, headers: &HeaderMap, scope: Scope) -> Result<Caller, (Problem, Option<Caller>)> {
    let caller = identified(api, headers).await.map_err(|problem| (problem, None))?;
    match caller.key() {
        Some(key) if key.scope < scope => {
            let detail = format!(
                "the key {} is for `{}`, and this needs `{scope}`; ask for a key that has it: gridfall keys create \
                 NAME --scope {scope}",
                key.name, key.scope
            );
            Err((Problem::new(Code::InsufficientScope, detail), Some(caller)))
        }
        _ => Ok(caller),
    }
}

/// Who asks, or why nobody can tell.
pub async fn identified(api: &Api, headers: &HeaderMap) -> Result<Caller, Problem> {
    if !api.asks_for_keys().await? {
        return Ok(Caller::Anybody);
    }
    let Some(text) = shown(headers) else {
        let detail = "send the header `Authorization: Bearer KEY`; whoever runs the server makes keys: gridfall keys \
                      create NAME";
        return Err(challenge(Problem::new(Code::KeyRequired, detail), "Bearer realm=\"gridfall\""));
    };
    judged(api, text).await.map(Caller::Key)
}

/// The key of a secret, if it is good.
pub async fn judged(api: &Api, text: &str) -> Result<std::sync::Arc<crate::store::Key>, Problem> {
    let refused = |detail: String| {
        let header = "Bearer realm=\"gridfall\", error=\"invalid_token\"";
        Err(challenge(Problem::new(Code::KeyRefused, detail), header))
    };
    let Some(secret) = Secret::parse(text) else {
        return refused("this has not the form of a key (`gf_…`), whole and as it was shown".into());
    };
    let Some(key) = api.key_of(&secret).await? else {
        return refused("this server knows no such key; it may have been renewed, or be another server's".into());
    };
    match key.standing(Timestamp::now()) {
        Standing::Good => Ok(key),
        Standing::Expired => refused(format!("the key {} has expired; have it renewed: gridfall keys renew", key.name)),
        Standing::Revoked => refused(format!("the key {} was revoked; ask for another one", key.name)),
    }
}

fn challenge(problem: Problem, with: &'static str) -> Problem {
    problem.with_header(header::WWW_AUTHENTICATE, HeaderValue::from_static(with))
}

/// Fails where the route is about something that is not the caller's.
async fn visible(api: &Api, caller: &Caller, route: &str, request: &mut Request) -> Result<(), Problem> {
    let Some(key) = caller.confined_to() else { return Ok(()) };
    let Some((kind, _)) = route.strip_prefix("/v1/").and_then(|rest| rest.split_once("/{id}")) else { return Ok(()) };
    let parameters = request.extract_parts::<RawPathParams>().await;
    let Some(id) =
        parameters.ok().and_then(|all| all.iter().find(|(name, _)| *name == "id").map(|(_, value)| value.to_owned()))
    else {
        return Ok(());
    };
    // What is no id is for the handler to refuse.
    match (kind, Uuid::parse_str(&id)) {
        ("jobs", Ok(id)) if !api.may_see_job(caller, id).await? => Err(Problem::job_not_found(id)),
        ("sweeps", Ok(id)) if !api.may_see_sweep(caller, id).await? => Err(Problem::sweep_not_found(id)),
        ("assets", _) if is_hash(&id) && !api.store.holds(key, Upload::Asset, &id.to_ascii_lowercase()).await? => {
            Err(Problem::asset_not_found(&id))
        }
        ("scenes", _) if is_hash(&id) && !api.store.holds(key, Upload::Scene, &id.to_ascii_lowercase()).await? => {
            Err(Problem::scene_not_found(&id))
        }
        ("jobs" | "sweeps" | "assets" | "scenes", _) => Ok(()),
        // Whoever adds a kind of things says here whose they are.
        _ => Err(super::problem::internal(format!("nobody knows whose things at {route} are"))),
    }
}

/// Whether a method is for changing something.
pub fn changes(method: &Method) -> bool {
    !matches!(*method, Method::GET | Method::HEAD | Method::OPTIONS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn routes_that_nobody_has_thought_of_are_not_open() {
        assert_eq!(needed("GET", "/v2/new"), Some(Scope::Read));
        assert_eq!(needed("delete", "/v2/new"), Some(Scope::Submit));
        assert_eq!(needed("get", "/v1/jobs"), Some(Scope::Read));
        assert_eq!(needed("post", "/v1/jobs"), Some(Scope::Submit));
        assert_eq!(needed("get", "/metrics"), Some(Scope::Admin));
        assert_eq!(needed("get", "/livez"), None);
    }
}
