//! Compares the names of the first selection with those of a plain one, where other physics and not
//! noise limits: a name that only one of them gives is less sure, and where they differ on the
//! effect that takes most, either may be right.

use crate::effects::EffectName;
use crate::effects::definition::NominalTerm;
use crate::thresholds::{CONTESTS, LIMITED_BY_PHYSICS, MOST_IN_CLASS, SUREST_BESIDE_PHYSICS};
use crate::validation::plain_selection::PlainSelection;
use crate::validation::weighed_model::{WeighedEffect, WeighedModel};

/// Weighs the named effects again.
pub(crate) fn compare(weighed: &mut WeighedModel, plain: &PlainSelection) {
    if !is_limited_by_physics(weighed) {
        return;
    }
    let mut named = weighed.named();
    named.sort_by(|a, b| weighed.effects[*b].confidence.total_cmp(&weighed.effects[*a].confidence));
    let definition = |i: usize| weighed.effects[i].found.effect.name.definition();
    // A drift is relative to the dry friction, which is therefore not judged.
    let is_base = |i: usize| definition(i).nominal_term() == Some(NominalTerm::Coulomb);
    if named.iter().any(|i| definition(*i).needs_dry() && definition(*i).drifts()) {
        named.retain(|i| !is_base(*i));
    }
    let mut names: Vec<Named> = named.iter().map(|i| Named::of(&weighed.effects[*i])).collect();
    beside(&mut names, plain);
    for (i, name) in named.into_iter().zip(names) {
        let effect = &mut weighed.effects[i];
        (effect.class, effect.confidence, effect.instead) = (name.class, name.confidence, name.instead);
    }
}

/// True if a model leaves much more than reading whole counts does.
fn is_limited_by_physics(weighed: &WeighedModel) -> bool {
    let left = &weighed.shown.table.patched;
    left.fit.min(left.holdout) >= LIMITED_BY_PHYSICS * weighed.floor
}

/// A name with its class.
#[derive(Clone, Debug, PartialEq)]
struct Named {
    class: Vec<EffectName>,
    confidence: f64,
    /// The effect that a plain selection finds and that another name already represents.
    instead: Option<EffectName>,
}

impl Named {
    fn of(effect: &WeighedEffect) -> Self {
        Self { class: effect.class.clone(), confidence: effect.confidence, instead: None }
    }
}

/// Compares names, the surest first, with a plain selection.
fn beside(names: &mut [Named], plain: &PlainSelection) {
    let first = plain.found.first();
    // True once a name represents the first finding of the plain selection.
    let mut stands = first.is_some_and(|first| names.iter().any(|name| name.class.contains(&first.name)));
    for name in names {
        if plain.has_one_of(&name.class) || !plain.knows(&name.class) {
            continue;
        }
        name.confidence = name.confidence.min(SUREST_BESIDE_PHYSICS);
        let Some(first) = first else { continue };
        if stands {
            name.instead = Some(first.name);
        } else if first.share >= CONTESTS && name.class.len() < MOST_IN_CLASS {
            name.class.push(first.name);
            stands = true;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::EffectName as N;
    use crate::validation::plain_selection::PlainFinding;

    const KNOWN: [N; 4] = [N::CommandDelay, N::ElectricalLag, N::PositionSpring, N::TorqueRipple];

    fn names(all: &[N]) -> Vec<Named> {
        all.iter().map(|name| Named { class: vec![*name], confidence: 0.95, instead: None }).collect()
    }

    fn compared(all: &[N], found: &[(N, f64)]) -> Vec<Named> {
        let found = found.iter().map(|(name, share)| PlainFinding { name: *name, share: *share }).collect();
        let mut names = names(all);
        beside(&mut names, &PlainSelection::of(found, KNOWN.to_vec()));
        names
    }

    #[test]
    fn a_name_of_both_selections_stays_as_sure() {
        assert_eq!(compared(&[N::CommandDelay], &[(N::CommandDelay, 0.3)]), names(&[N::CommandDelay]));
        let later = [(N::PositionSpring, 0.4), (N::CommandDelay, 0.1)];
        assert_eq!(compared(&[N::CommandDelay], &later), names(&[N::CommandDelay]));
    }

    #[test]
    fn either_may_be_right_where_they_differ() {
        let one = &compared(&[N::TorqueRipple], &[(N::PositionSpring, 0.4)])[0];
        assert_eq!(one.class, [N::TorqueRipple, N::PositionSpring]);
        assert_eq!((one.confidence, one.instead), (SUREST_BESIDE_PHYSICS, None));
        let little = &compared(&[N::TorqueRipple], &[(N::PositionSpring, 0.1)])[0];
        assert_eq!(little.class, [N::TorqueRipple]);
        assert_eq!(little.confidence, SUREST_BESIDE_PHYSICS, "the plain selection does not find it");
    }

    #[test]
    fn a_second_name_with_one_that_both_give_does_not_count() {
        let both = compared(&[N::CommandDelay, N::TorqueRipple], &[(N::CommandDelay, 0.4)]);
        assert_eq!((both[0].instead, both[1].instead), (None, Some(N::CommandDelay)));
        let unknown = compared(&[N::CommandDelay, N::DriveCompliance], &[(N::CommandDelay, 0.4)]);
        assert_eq!(unknown[1], names(&[N::DriveCompliance])[0], "it has no law of that");
    }
}
