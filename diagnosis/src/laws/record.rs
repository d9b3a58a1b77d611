//! The record of a law, which the filter, the regression and the simulator share.

use crate::laws::definition::Shown;
use crate::laws::{Effect, EffectName};
use regression::laws::{Need, RECORDS, Record, Subsystem};

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

    /// True if recordings show it only where they show a fact.
    pub(crate) fn needs(self, fact: Need) -> bool {
        self.record().is_some_and(|record| record.needs.contains(&fact))
    }
}

impl Effect {
    /// Other effects that recordings which show so much cannot distinguish from it, however well
    /// either fits.
    pub(crate) fn twins(&self, shown: &Shown) -> Vec<EffectName> {
        let twins = self.name.record().map_or(&[][..], |record| record.twins);
        let within = twins.iter().filter(|(limit, _)| shown.is_within(*limit, self));
        within.filter_map(|(_, key)| EffectName::find(key)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::definition::Allowed;
    use regression::laws::{ActsOn, Size, library};
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

    #[test]
    fn the_filter_bounds_a_law_as_its_record_does() {
        let allowed = Allowed {
            gain: 2.0,
            gain_reach: 1.5,
            is_anchored: false,
            viscous: Some(1.0),
            dry: Some(1.0),
            dry_by_uncertainty: 1.5,
        };
        let of_motion = |record: &&Record| record.acts_on == ActsOn::Motion && record.size == Size::Positive;
        let all: Vec<&Record> = RECORDS.iter().filter(of_motion).collect();
        assert!(all.len() > 3);
        for record in all {
            let name = EffectName::find(record.key).expect("a law of the rig");
            let (low, high) = name.definition().limits(0, &allowed);
            assert!(low >= 0.0 && high > 0.0, "{name}: {low} to {high}");
        }
    }
}
