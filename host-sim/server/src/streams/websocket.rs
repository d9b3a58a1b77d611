//! One JSON text a pose over a WebSocket. Nothing that a client says is listened to, so that none
//! can move or start anything; a page of another site may not connect from this computer's browser.

use super::feed::Snapshot;
use super::spec::Token;
use super::{MOST_CLIENTS, SEND_TIMEOUT};
use crate::bounded_listener::BoundedListener;
use axum::Router;
use axum::extract::ws::{Message, WebSocket};
use axum::extract::{Query, State, WebSocketUpgrade};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use serde::Deserialize;
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use tokio::net::TcpListener;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use tokio::time::timeout;

/// A client has nothing to say: longest message in bytes.
const LONGEST_MESSAGE: usize = 256;

#[derive(Clone)]
struct Shared {
    newest: watch::Receiver<Snapshot>,
    token: Option<Token>,
    places: Arc<Semaphore>,
}

#[derive(Deserialize)]
struct Credentials {
    token: Option<String>,
}

/// Serves `/` and `/pose` at `address`.
pub(super) async fn serve(
    address: SocketAddr,
    newest: watch::Receiver<Snapshot>,
    token: Option<Token>,
) -> io::Result<SocketAddr> {
    let listener = TcpListener::bind(address).await?;
    let bound = listener.local_addr()?;
    // A few more than may stream, so that one client too many receives a reason.
    let listener = BoundedListener::new(listener, 2 * MOST_CLIENTS);
    let shared = Shared { newest, token, places: Arc::new(Semaphore::new(MOST_CLIENTS)) };
    let router = Router::new().route("/", get(connect)).route("/pose", get(connect)).with_state(shared);
    tokio::spawn(async move {
        // Ends only with its task.
        let _ = axum::serve(listener, router).await;
    });
    Ok(bound)
}

async fn connect(
    State(shared): State<Shared>,
    Query(asked): Query<Credentials>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    match &shared.token {
        Some(token) if !asked.token.as_deref().is_some_and(|said| token.is(said.as_bytes())) => {
            return (StatusCode::UNAUTHORIZED, "add ?token=… as given to --stream-token").into_response();
        }
        None if !is_from_here(&headers) => {
            return (StatusCode::FORBIDDEN, "a page of another site may not see the needle").into_response();
        }
        _ => {}
    }
    let Ok(place) = shared.places.clone().try_acquire_owned() else {
        return (StatusCode::SERVICE_UNAVAILABLE, "too many clients; try again later").into_response();
    };
    upgrade
        .max_message_size(LONGEST_MESSAGE)
        .max_frame_size(LONGEST_MESSAGE)
        .on_upgrade(move |socket| stream(socket, shared.newest, place))
}

/// Programs that are no browser send no origin; a page of this computer is welcome, whatever its
/// port.
fn is_from_here(headers: &HeaderMap) -> bool {
    let Some(origin) = headers.get(header::ORIGIN) else { return true };
    let Ok(origin) = origin.to_str() else { return false };
    let Some((_, host)) = origin.split_once("://") else { return false };
    let name = if host.starts_with('[') { host.split_inclusive(']').next() } else { host.split(':').next() };
    matches!(name, Some("127.0.0.1" | "localhost" | "[::1]"))
}

async fn stream(mut socket: WebSocket, mut newest: watch::Receiver<Snapshot>, _place: OwnedSemaphorePermit) {
    newest.mark_changed();
    loop {
        tokio::select! {
            // The end of the conversation, or nonsense too long; anything else is thrown away.
            said = socket.recv() => match said {
                Some(Ok(_)) => continue,
                _ => return,
            },
            changed = newest.changed() => if changed.is_err() { return },
        }
        let Some(pose) = newest.borrow_and_update().pose.clone() else { continue };
        let Ok(text) = serde_json::to_string(&pose) else { return };
        if !matches!(timeout(SEND_TIMEOUT, socket.send(Message::Text(text.into()))).await, Ok(Ok(()))) {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_pages_of_this_computer_may_connect() {
        let from = |origin: &str| {
            let mut headers = HeaderMap::new();
            headers.insert(header::ORIGIN, origin.parse().unwrap());
            is_from_here(&headers)
        };
        assert!(is_from_here(&HeaderMap::new()));
        assert!(from("http://localhost:3000") && from("http://127.0.0.1") && from("http://[::1]:80"));
        assert!(!from("http://example.org") && !from("null") && !from("http://localhost.example.org"));
    }
}
