//! The debrief of the last recording at `/debrief`, in a language at `/debrief?language=de`. It is
//! made of the file in a thread of its own, because a long recording takes seconds.

use axum::Router;
use axum::extract::{RawQuery, State};
use axum::http::{StatusCode, header};
use axum::response::{Html, IntoResponse, Response};
use axum::routing::get;
use device_sim::error::Error;
use device_sim::session::Session;
use std::path::Path;
use std::sync::Arc;

/// Makes the page of a recording's file, in the language of a tag if there is one.
pub type Debrief = Arc<dyn Fn(&Path, Option<&str>) -> Result<String, Error> + Send + Sync>;

/// Serves what `write` makes of the file that the session names as recorded last.
pub(super) fn router(session: Session, write: Debrief) -> Router {
    Router::new().route("/debrief", get(page).with_state((session, write)))
}

async fn page(State((session, write)): State<(Session, Debrief)>, RawQuery(asked): RawQuery) -> Response {
    let Some(file) = session.subscribe().drain().link.recorded else {
        let what = "nothing has been recorded in the page yet; record an insertion first";
        return (StatusCode::NOT_FOUND, what).into_response();
    };
    // A debrief has its style and its figures in itself.
    let policy = "default-src 'none'; style-src 'unsafe-inline'; img-src data:";
    let language = move || asked.as_deref()?.strip_prefix("language=").map(str::to_owned);
    report(move || write(Path::new(&file), language().as_deref()), policy).await
}

/// Makes a page, which may take seconds, and serves it under a policy of its contents.
pub(super) async fn report(
    write: impl FnOnce() -> Result<String, Error> + Send + 'static,
    policy: &'static str,
) -> Response {
    match tokio::task::spawn_blocking(write).await {
        Ok(Ok(html)) => {
            let headers = [(header::CONTENT_SECURITY_POLICY, policy), (header::CACHE_CONTROL, "no-store")];
            (headers, Html(html)).into_response()
        }
        Ok(Err(error)) => (StatusCode::UNPROCESSABLE_ENTITY, error.to_string()).into_response(),
        Err(_) => (StatusCode::INTERNAL_SERVER_ERROR, "the report could not be made").into_response(),
    }
}
