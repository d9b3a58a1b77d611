//! Names that a round keeps of the round before.
//!
//! A diagnosis names an effect only if it is a material part of the force in all recordings
//! together. An input that was designed to distinguish rivals need not make the effect large: with
//! it the effect becomes a smaller part, while there is more evidence for it. So a small part does
//! not take a name back; rivals and the model without the effect do.

use super::Name;

/// The names of a diagnosis, or, if it gives none, those of the round before that still lead the
/// contenders.
pub(super) fn carried(before: &[Name], names: Vec<Name>, contenders: &[(String, f64)]) -> Vec<Name> {
    let most = contenders.iter().max_by(|a, b| a.1.total_cmp(&b.1));
    let Some((leader, _)) = most.filter(|_| names.is_empty()) else { return names };
    before
        .iter()
        .filter(|name| name.class.contains(leader))
        .map(|name| of(name, leader, contenders))
        .collect()
}

/// `name` with the rest of its class, as probable as the contenders of that class together.
fn of(name: &Name, leader: &str, contenders: &[(String, f64)]) -> Name {
    let left = || contenders.iter().filter(|(contender, _)| name.class.contains(contender));
    Name {
        name: leader.to_owned(),
        class: left().map(|(contender, _)| contender.clone()).collect(),
        confidence: left().map(|(_, probability)| probability).sum(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(class: &[&str], confidence: f64) -> Name {
        let class: Vec<String> = class.iter().map(|name| (*name).to_owned()).collect();
        Name { name: class[0].clone(), class, confidence }
    }

    fn contenders(list: &[(&str, f64)]) -> Vec<(String, f64)> {
        list.iter().map(|(name, probability)| ((*name).to_owned(), *probability)).collect()
    }

    #[test]
    fn a_name_that_still_leads_is_kept() {
        let before = [name(&["stribeck_friction", "presliding_friction"], 0.88)];
        let left = contenders(&[("stribeck_friction", 0.8), ("none", 0.2)]);
        assert_eq!(carried(&before, vec![], &left), [name(&["stribeck_friction"], 0.8)]);
    }

    #[test]
    fn a_name_that_no_longer_leads_is_not_kept() {
        let before = [name(&["stribeck_friction"], 0.88)];
        let none = contenders(&[("none", 0.6), ("stribeck_friction", 0.4)]);
        let rival = contenders(&[("presliding_friction", 0.6), ("stribeck_friction", 0.3), ("none", 0.1)]);
        for left in [none, rival, vec![]] {
            assert_eq!(carried(&before, vec![], &left), []);
        }
    }

    #[test]
    fn what_the_diagnosis_names_is_what_counts() {
        let before = [name(&["stribeck_friction"], 0.88)];
        let names = vec![name(&["cogging"], 0.9)];
        let left = contenders(&[("stribeck_friction", 0.8), ("none", 0.2)]);
        assert_eq!(carried(&before, names.clone(), &left), names);
        assert_eq!(carried(&[], vec![], &left), [], "no round named it before");
    }
}
