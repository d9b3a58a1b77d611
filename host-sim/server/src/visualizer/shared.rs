//! The state that the server and its connections share.

use device_sim::session::Session;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// The state that every request needs.
#[derive(Clone)]
pub(super) struct Shared {
    pub(super) session: Session,
    /// True if a person has taken the needle in any page.
    pub(super) person: Arc<AtomicBool>,
}
