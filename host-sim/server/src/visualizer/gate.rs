//! Who may see the page. This computer may, from the program's own page. Another one may only where
//! the program listens to a network, and with the token that the program printed: it comes once in
//! the address and then in a cookie.

use super::demonstration;
use crate::bounded_listener::BoundedListener;
use axum::extract::connect_info::Connected;
use axum::extract::{ConnectInfo, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Redirect, Response};
use axum::serve::IncomingStream;
use std::net::SocketAddr;

/// The address of a workbench's answers.
pub(super) const WORKBENCH: &str = "/import/";
/// Name of the token, in the address and in the cookie.
const TOKEN: &str = "token";

/// The other end of a connection.
#[derive(Clone, Copy, Debug)]
pub(super) struct Peer(SocketAddr);

impl Connected<IncomingStream<'_, BoundedListener>> for Peer {
    fn connect_info(stream: IncomingStream<'_, BoundedListener>) -> Self {
        Self(*stream.remote_addr())
    }
}

/// The token that other computers have to know; none where the program does not listen to them.
#[derive(Clone, Debug, Default)]
pub(super) struct Gate {
    token: Option<String>,
}

impl Gate {
    /// A gate with a new token of 128 random bits; an error where the system gives no random
    /// numbers.
    pub(super) fn with_token() -> Result<(Self, String), getrandom::Error> {
        let mut bits = [0; 16];
        getrandom::fill(&mut bits)?;
        let token: String = bits.iter().map(|byte| format!("{byte:02x}")).collect();
        Ok((Self { token: Some(token.clone()) }, token))
    }

    fn knows(&self, said: Option<&str>) -> bool {
        // Both are public in length; every letter is looked at, so that the time says nothing of
        // where they differ.
        let same = |token: &str, said: &str| {
            token.len() == said.len()
                && token.bytes().zip(said.bytes()).fold(0, |all, (a, b)| all | (a ^ b)) == 0
        };
        matches!((&self.token, said), (Some(token), Some(said)) if same(token, said))
    }
}

/// The address of the page with its token.
pub(super) fn address_with(url: &str, token: &str) -> String {
    format!("{url}?{TOKEN}={token}")
}

/// Lets a request through, or says why not. A request with the right token in its address gets the
/// cookie.
pub(super) async fn pass(
    State(gate): State<Gate>,
    ConnectInfo(Peer(peer)): ConnectInfo<Peer>,
    request: Request,
    next: Next,
) -> Response {
    let headers = request.headers();
    if peer.ip().is_loopback() {
        // Anybody on this computer may ask for what only shows a page. Only the page itself may ask
        // for what moves or reveals something.
        let path = request.uri().path();
        let is_free =
            !matches!(path, "/live" | "/debrief" | demonstration::PATH) && !path.starts_with(WORKBENCH);
        return match is_free || is_own_page(headers, true) {
            true => next.run(request).await,
            false => refuse("only the page of this program may do this"),
        };
    }
    if gate.knows(in_query(request.uri().query())) {
        let mut answer = Redirect::to("/").into_response();
        let cookie = format!(
            "{TOKEN}={}; HttpOnly; SameSite=Strict; Path=/",
            gate.token.as_deref().unwrap_or_default()
        );
        if let Ok(cookie) = HeaderValue::from_str(&cookie) {
            answer.headers_mut().insert(header::SET_COOKIE, cookie);
        }
        return answer;
    }
    if !gate.knows(in_cookie(headers)) {
        return refuse("open the address with its token that the program printed");
    }
    match is_own_page(headers, false) {
        true => next.run(request).await,
        false => refuse("only the page of this program may do this"),
    }
}

fn refuse(why: &'static str) -> Response {
    (StatusCode::FORBIDDEN, why).into_response()
}

fn in_query(query: Option<&str>) -> Option<&str> {
    query?.split('&').find_map(|pair| pair.strip_prefix(TOKEN)?.strip_prefix('='))
}

fn in_cookie(headers: &HeaderMap) -> Option<&str> {
    let all = headers.get(header::COOKIE)?.to_str().ok()?;
    all.split(';').find_map(|pair| pair.trim().strip_prefix(TOKEN)?.strip_prefix('='))
}

/// True if the page that sent the request is this program's own. Any site that a person visits may
/// open a WebSocket to this program and could drive the motor, so the origin that the browser
/// reports has to be this program. On this computer (`is_local`) the host that was asked for also
/// has to be this computer.
fn is_own_page(headers: &HeaderMap, is_local: bool) -> bool {
    let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
    let Some(host) = text(header::HOST) else { return false };
    let name = host.rsplit_once(':').map_or(host, |(name, _)| name);
    let is_own = !is_local || matches!(name, "127.0.0.1" | "localhost" | "[::1]");
    // Programs that are no browser send no origin.
    is_own && text(header::ORIGIN).is_none_or(|origin| origin.strip_prefix("http://") == Some(host))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(host: &str, origin: Option<&str>) -> HeaderMap {
        let mut headers = HeaderMap::new();
        headers.insert(header::HOST, host.parse().unwrap());
        if let Some(origin) = origin {
            headers.insert(header::ORIGIN, origin.parse().unwrap());
        }
        headers
    }

    #[test]
    fn only_the_own_page_may_connect() {
        assert!(is_own_page(&headers("127.0.0.1:8710", Some("http://127.0.0.1:8710")), true));
        assert!(is_own_page(&headers("localhost:9000", Some("http://localhost:9000")), true));
        assert!(is_own_page(&headers("127.0.0.1:8710", None), true));
        assert!(!is_own_page(&headers("127.0.0.1:8710", Some("http://example.org")), true));
        assert!(!is_own_page(&headers("127.0.0.1:8710", Some("null")), true));
        assert!(!is_own_page(&headers("example.org:8710", Some("http://example.org:8710")), true));
        assert!(is_own_page(&headers("10.0.0.7:8710", Some("http://10.0.0.7:8710")), false));
        assert!(!is_own_page(&headers("10.0.0.7:8710", Some("http://example.org")), false));
    }

    #[test]
    fn a_token_is_new_each_time_and_known_whole_only() {
        let (gate, token) = Gate::with_token().unwrap();
        assert_eq!(token.len(), 32);
        assert_ne!(token, Gate::with_token().unwrap().1);
        assert!(gate.knows(Some(&token)));
        for wrong in [None, Some(""), Some(&token[..31]), Some("0123456789abcdef0123456789abcdef")] {
            assert!(!gate.knows(wrong), "{wrong:?}");
        }
        assert!(!Gate::default().knows(Some("")), "without a token nobody is known");
    }

    #[test]
    fn a_token_is_found_among_others() {
        assert_eq!(in_query(Some("graphics=webgl&token=ab")), Some("ab"));
        assert_eq!(in_query(Some("tokens=ab")), None);
        let mut headers = HeaderMap::new();
        headers.insert(header::COOKIE, "theme=dark; token=ab".parse().unwrap());
        assert_eq!(in_cookie(&headers), Some("ab"));
    }
}
