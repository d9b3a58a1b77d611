//! What to record next: the experiment that would separate two effects, or show one at all.

use crate::effects::{EffectName as N, experiments};

/// The recording that would decide within a class.
pub(crate) fn separating(class: &[N]) -> Option<String> {
    if class.len() < 2 {
        return None;
    }
    // The name that stands first knows best.
    let text = class.iter().find_map(|name| {
        let others = class.iter().filter(|other| *other != name);
        others.clone().find_map(|other| name.definition().experiment(*other))
    });
    Some(text.unwrap_or(experiments::RICH).to_owned())
}

/// What a recording needs so that a diagnosis is possible at all.
pub(crate) const GENERAL: &str = "ten seconds or more at 500 Hz or more with reversals, several speeds both ways and a \
    command that is not constant, for example a slow triangle with a multisine on top";

pub(crate) use crate::effects::experiments::SPEEDS;
