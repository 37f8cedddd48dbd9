//! Who may change something here. A server on a loopback address trusts whoever can reach it, and
//! browsers reach it on behalf of any page. So a request that changes state must not come from
//! another origin's page, nor through a name that some stranger's DNS gave this address.

use std::net::IpAddr;

use axum::extract::{Request, State};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, Method, Uri, header};
use axum::middleware::Next;
use axum::response::Response;

use super::problem::{Code, Problem};
use super::state::{Api, Config};

/// Refuses what changes state and comes from a page of another origin, or to an unknown host.
pub async fn guard(State(api): State<Api>, request: Request, next: Next) -> Result<Response, Problem> {
    if !matches!(*request.method(), Method::GET | Method::HEAD | Method::OPTIONS) {
        judge(&api.config, request.uri(), request.headers(), "change anything")?;
    }
    Ok(next.run(request).await)
}

/// Refuses what comes from a page of another origin, or to an unknown host; `what` it may not do.
pub(super) fn judge(config: &Config, uri: &Uri, headers: &HeaderMap, what: &str) -> Result<(), Problem> {
    // Browsers always name the host.
    let host = match (uri.authority(), headers.get(header::HOST)) {
        (Some(authority), _) => Some(authority.clone()),
        (None, Some(value)) => Some(Authority::try_from(value.as_bytes()).map_err(|_| unknown_host(value.as_bytes()))?),
        (None, None) => None,
    };
    if let Some(host) = &host
        && !is_known(config, host.host())
    {
        return Err(unknown_host(host.as_str().as_bytes()));
    }
    let Some(origin) = headers.get(header::ORIGIN) else { return Ok(()) };
    let own = origin.to_str().ok().and_then(|text| text.parse::<Uri>().ok()).is_some_and(|origin| {
        let schemed = matches!(origin.scheme_str(), Some("http" | "https"));
        schemed && origin.authority().is_some() && origin.authority() == host.as_ref()
    });
    if own || config.cors_origins.contains(origin) {
        return Ok(());
    }
    let origin = String::from_utf8_lossy(origin.as_bytes());
    let detail = format!(
        "pages of the origin {origin} may not {what} here; if they should, start the server with \
         --cors-origin {origin}"
    );
    Err(Problem::new(Code::ForeignOrigin, detail))
}

/// An address is no name, so nobody's DNS can give it away.
fn is_known(config: &Config, host: &str) -> bool {
    let bare = host.trim_start_matches('[').trim_end_matches(']');
    let name = host.trim_end_matches('.').to_ascii_lowercase();
    bare.parse::<IpAddr>().is_ok()
        || name == "localhost"
        || name.ends_with(".localhost")
        || config.allowed_hosts.iter().any(|allowed| allowed.eq_ignore_ascii_case(&name))
}

fn unknown_host(host: &[u8]) -> Problem {
    let host = String::from_utf8_lossy(host);
    let detail = format!(
        "this server does not know itself as {host}; use its address or localhost, or start it with --allow-host and \
         that name"
    );
    Problem::new(Code::UnknownHost, detail)
}

#[cfg(test)]
mod tests {
    use axum::http::HeaderValue;
    use axum::response::IntoResponse;

    use super::*;

    #[test]
    fn strangers_pages_and_names_are_refused() {
        let config = Config {
            cors_origins: vec![HeaderValue::from_static("https://app.example")],
            allowed_hosts: vec!["sim.example".into()],
            ..Config::default()
        };
        let cases: &[(Option<&str>, Option<&str>, u16)] = &[
            (None, None, 200),
            (Some("127.0.0.1:8080"), None, 200),
            (Some("[::1]:8080"), None, 200),
            (Some("localhost"), None, 200),
            (Some("LocalHost.:8080"), None, 200),
            (Some("a.localhost"), None, 200),
            (Some("10.1.2.3:8080"), None, 200),
            (Some("sim.example"), None, 200),
            (Some("Sim.Example:443"), None, 200),
            (Some("rebound.example:8080"), None, 403),
            (Some("notlocalhost"), None, 403),
            (Some("127.0.0.1.example"), None, 403),
            (Some("a b"), None, 403),
            (Some("localhost:8080"), Some("http://localhost:8080"), 200),
            (Some("sim.example"), Some("https://sim.example"), 200),
            (Some("localhost:8080"), Some("https://app.example"), 200),
            (Some("localhost:8080"), Some("http://localhost:9090"), 403),
            (Some("localhost:8080"), Some("https://evil.example"), 403),
            (Some("localhost:8080"), Some("null"), 403),
            (Some("localhost:8080"), Some(""), 403),
            (None, Some("null"), 403),
            (None, Some("https://evil.example"), 403),
        ];
        for (host, origin, expected) in cases {
            let given = [(header::HOST, host), (header::ORIGIN, origin)];
            let headers: HeaderMap =
                given.into_iter().filter_map(|(name, value)| Some((name, value.as_ref()?.parse().unwrap()))).collect();
            let status = match judge(&config, &Uri::from_static("/v1/jobs"), &headers, "change anything") {
                Ok(()) => 200,
                Err(problem) => problem.into_response().status().as_u16(),
            };
            assert_eq!(status, *expected, "Host {host:?}, Origin {origin:?}");
        }
    }
}
