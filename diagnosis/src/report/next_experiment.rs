//! The recording to make next: the experiment that would separate two effects, or show one at all.

use crate::evidence::known_travel::BeyondFitted;
use crate::laws::{EffectName as N, experiments};
use numerics::digits::short_within;

/// The recording that would decide within a class.
pub(crate) fn separating(class: &[N]) -> Option<String> {
    if class.len() < 2 {
        return None;
    }
    // The first name knows best.
    let text = class.iter().find_map(|name| {
        let others = class.iter().filter(|other| *other != name);
        others.clone().find_map(|other| name.definition().experiment(*other))
    });
    Some(text.unwrap_or(experiments::RICH).to_owned())
}

/// Strokes that reach as far as the held-out recordings do; `length` is the unit of the coordinate.
pub(crate) fn strokes(beyond: BeyondFitted, length: &str) -> String {
    let BeyondFitted { from, to, low, high } = beyond;
    let tidy = |x: f64| short_within(x, high - low);
    format!(
        "to fit on, strokes over the travel from {} to {} {length}: held-out recordings go there and fitted ones only from {} to {}, so that the profile beyond is not known",
        tidy(from),
        tidy(to),
        tidy(low),
        tidy(high)
    )
}

/// A recording in which noise hides less.
pub(crate) const LOUDER: &str = "the same with larger and faster changes of the command, or with a finer sensor: noise hides most of the force here";

/// A recording that makes a diagnosis possible.
pub(crate) const GENERAL: &str = "ten seconds or more at 500 Hz or more with reversals, several speeds both ways and a \
    command that is not constant, for example a slow triangle with a multisine on top";

pub(crate) use crate::laws::experiments::SPEEDS;
