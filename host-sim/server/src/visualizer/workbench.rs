//! A page that hands files and questions to the program and shows what it makes of them, on this
//! computer only. What it asks for is the caller's: this module knows a name and bytes.

use super::debrief::report;
use super::gate::WORKBENCH;
use axum::Router;
use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Path, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use device_sim::error::Error;
use std::sync::Arc;

/// The largest file that is taken, in bytes.
const LARGEST_FILE: usize = 1 << 28;

/// Answers a question, given by its name and the bytes that came with it: JSON, or a page for
/// `report`.
pub type Workbench = Arc<dyn Fn(&str, &[u8]) -> Result<String, Error> + Send + Sync>;

/// Serves the answers.
pub(super) fn router(answer: Workbench) -> Router {
    Router::new()
        .route(&format!("{WORKBENCH}{{*what}}"), post(ask))
        .route(&format!("{WORKBENCH}report.html"), get(page))
        .layer(DefaultBodyLimit::max(LARGEST_FILE))
        .with_state(answer)
}

async fn ask(State(answer): State<Workbench>, Path(what): Path<String>, body: Bytes) -> Response {
    match tokio::task::spawn_blocking(move || answer(&what, &body)).await {
        Ok(Ok(json)) => ([(header::CONTENT_TYPE, "application/json")], json).into_response(),
        Ok(Err(error)) => (StatusCode::UNPROCESSABLE_ENTITY, error.to_string()).into_response(),
        Err(_) => (StatusCode::INTERNAL_SERVER_ERROR, "the question could not be answered").into_response(),
    }
}

/// The plots of a report have a script of their own.
async fn page(State(answer): State<Workbench>) -> Response {
    let policy = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'";
    report(move || answer("report", &[]), policy).await
}
