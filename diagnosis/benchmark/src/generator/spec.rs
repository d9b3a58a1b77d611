//! The request for a case, before anything of it is drawn.

use super::excite::Kind;
use crate::key::Category;

/// The specification of a case.
#[derive(Clone, Debug)]
pub(crate) struct Spec {
    /// Opaque number: the only thing that the tool can see of it.
    pub(crate) id: usize,
    pub(crate) category: Category,
    /// The hidden effects: contract names, or foreign ones in [`Category::Outside`].
    pub(crate) hidden: Vec<&'static str>,
    /// Effect over noise that is asked for; zero where nothing is hidden.
    pub(crate) strength: f64,
    /// The number of the draw among those of the same kind.
    pub(crate) repeat: usize,
    /// Plays one of these alone: recordings that do not suffice for a verdict.
    pub(crate) poor: Option<&'static [Kind]>,
    /// Rate in Hz and duration in s, where they are not drawn.
    pub(crate) recorder: Option<(f64, f64)>,
}

impl Spec {
    /// The name of the case's folder.
    pub(crate) fn name(&self) -> String {
        format!("case-{:04}", self.id)
    }
}
