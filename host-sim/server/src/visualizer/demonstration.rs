//! The report of a demonstration of the diagnosis. It is made when it is asked for, in a thread of
//! its own, because that takes seconds.

use super::debrief::report;
use axum::Router;
use axum::routing::get;
use device_sim::error::Error;

/// The report's address, here and in the static site.
pub(super) const PATH: &str = "/demo/missing/report.html";

/// Makes the report's page.
pub type Demonstration = fn() -> Result<String, Error>;

/// Serves what `write` makes.
pub(super) fn router(write: Demonstration) -> Router {
    // Its plots have a script of their own.
    let policy = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'";
    Router::new().route(PATH, get(move || report(write, policy)))
}
