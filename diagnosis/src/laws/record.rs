//! The record of a law, which the filter, the regression and the simulator share.

use crate::laws::definition::ExcitationLimits;
use crate::laws::{Effect, EffectName};
use regression::laws::{Bounds, Need, RECORDS, Record, Subsystem};

impl EffectName {
    /// The facts that filter, regression and simulator share; none of a user's own formula, nor of
    /// a force without a name.
    pub(super) fn record(self) -> Option<&'static Record> {
        RECORDS.iter().find(|record| record.key == self.as_str())
    }

    /// Returns the subsystem that it belongs to.
    pub(crate) fn subsystem(self) -> Subsystem {
        self.record().map_or(Subsystem::Load, |record| record.subsystem)
    }

    /// Returns the bounds of a term's coefficient within which it is what its name says; a force
    /// without a name has none.
    pub(crate) fn bounds_of(self, term: usize) -> Bounds {
        match self.formula() {
            Some(formula) => formula.bounds_of(term),
            None => self.record().map_or(Bounds::FREE, |record| record.bounds_of(term)),
        }
    }

    /// True if recordings show it only where they show a fact.
    pub(crate) fn needs(self, fact: Need) -> bool {
        self.record().is_some_and(|record| record.needs.contains(&fact))
    }
}

impl Effect {
    /// Other effects that recordings which show so much cannot distinguish from it, however well
    /// either fits.
    pub(crate) fn twins(&self, shown: &ExcitationLimits) -> Vec<EffectName> {
        let twins = self.name.record().map_or(&[][..], |record| record.twins);
        let within = twins.iter().filter(|(limit, _)| shown.is_within(*limit, self));
        within.filter_map(|(_, key)| EffectName::find(key)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::State;
    use regression::laws::library;
    use std::collections::BTreeSet;

    #[test]
    fn every_law_has_one_record_for_all_who_compute_it() {
        let keys: BTreeSet<&str> = RECORDS.iter().map(|record| record.key).collect();
        assert_eq!(keys.len(), RECORDS.len(), "no law has two");
        let is_law = |name: &&EffectName| **name != EffectName::Table;
        let in_rig: BTreeSet<&str> =
            EffectName::ALL.iter().filter(is_law).map(|name| name.as_str()).collect();
        let in_regression: BTreeSet<&str> = library().map(|law| law.key).collect();
        assert!(keys == in_rig && keys == in_regression, "{in_rig:?} {in_regression:?}");
        for record in &RECORDS {
            assert!(record.twins.iter().all(|(_, twin)| keys.contains(twin) && *twin != record.key));
            assert!(record.refines.is_none_or(|plain| keys.contains(plain) && plain != record.key));
        }
    }

    /// A coefficient that cannot be below zero takes energy from the axis and gives it none, so the
    /// record's bounds hold for the force as the filter computes it.
    #[test]
    fn a_law_bounded_at_zero_brakes_in_the_filter() {
        let mut seen = 0;
        for name in EffectName::ALL.iter().filter(|name| name.bounds_of(0).low == 0.0) {
            let shape = [("speed", 1.0), ("exponent", 1.0), ("deflection", 1e-6)];
            let Some(mut law) = name.definition().law(&Effect::shaped(*name, &shape)) else { continue };
            // A load on a spring swings, and bristles that yield take from the friction.
            if name.definition().coupling().is_some() || name.definition().bends_at_reversals() {
                continue;
            }
            seen += 1;
            for velocity in [0.5, -0.5] {
                let state = State {
                    velocity,
                    position: velocity,
                    external: 2.0,
                    drive: 3.0,
                    command: 3.0,
                    dt: 1.0,
                    ..State::default()
                };
                let mut terms = vec![0.0; law.names().len()];
                law.terms(&state, velocity, &mut terms);
                assert!(terms[0] * velocity <= 0.0, "{name} drives the axis: {terms:?}");
            }
        }
        assert_eq!(seen, 7);
    }
}
