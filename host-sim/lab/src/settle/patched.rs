//! The simulation with what was settled: what the device feeds forward, and what its author takes
//! over.

use super::Name;
use diagnosis::Outcome;
use diagnosis::laws::EffectName;
use diagnosis::rig::Rig;

/// The rig of the last diagnosis with the settled effects and no others. A name that a round kept
/// is not in the patched rig of a diagnosis that names nothing; it is in the rig of its contender.
pub(super) fn patched(last: &Outcome, names: &[Name]) -> Rig {
    let rigs: Vec<&Rig> = std::iter::once(&last.patched_rig).chain(&last.contending_rigs).collect();
    with_settled(&rigs, &last.nominal_rig, names)
}

/// The first of `rigs` that has every settled effect, or the first one, without the effects that
/// are neither settled nor in the `nominal` rig.
fn with_settled(rigs: &[&Rig], nominal: &Rig, names: &[Name]) -> Rig {
    let has = |rig: &Rig, name: &Name| rig.effects.iter().any(|effect| effect.name.as_str() == name.name);
    let has_all = |rig: &&&Rig| names.iter().all(|name| has(rig, name));
    let mut rig = Rig::clone(rigs.iter().find(has_all).unwrap_or(&rigs[0]));
    let is_settled = |name: EffectName| names.iter().any(|settled| settled.name == name.as_str());
    let is_given = |name: EffectName| nominal.effects.iter().any(|effect| effect.name == name);
    rig.effects.retain(|effect| is_settled(effect.name) || is_given(effect.name));
    rig
}

#[cfg(test)]
mod tests {
    use super::*;
    use diagnosis::laws::Effect;

    fn rig(effects: &[EffectName]) -> Rig {
        let text = "format = 1\nkind = \"rotary\"\n[model]\ninertia = 1.4e-6\n[actuator]\ngain = 1.4e-5\n\
                    [encoder]\ncounts_per_unit = 636.6\n";
        let effects = effects.iter().map(|name| Effect::shaped(*name, &[])).collect();
        Rig { effects, ..Rig::parse(text, "rig.toml").expect("a rig") }
    }

    fn settled(name: EffectName) -> Name {
        let name = name.to_string();
        Name { class: vec![name.clone()], name, confidence: 0.9 }
    }

    fn names_of(rig: &Rig) -> Vec<EffectName> {
        rig.effects.iter().map(|effect| effect.name).collect()
    }

    use EffectName::{Cogging, CommandDelay, MassImbalance, QuadraticDrag};

    #[test]
    fn what_is_too_unsure_to_be_settled_is_left_out() {
        let (patched, nominal) = (rig(&[Cogging, QuadraticDrag]), rig(&[]));
        let only = with_settled(&[&patched], &nominal, &[settled(Cogging)]);
        assert_eq!(names_of(&only), [Cogging]);
    }

    #[test]
    fn a_name_that_a_round_kept_comes_from_its_contender() {
        let (patched, contender, nominal) = (rig(&[]), rig(&[CommandDelay]), rig(&[]));
        let kept = with_settled(&[&patched, &contender], &nominal, &[settled(CommandDelay)]);
        assert_eq!(names_of(&kept), [CommandDelay]);
    }

    #[test]
    fn an_effect_that_the_author_gave_stays() {
        let (patched, nominal) = (rig(&[MassImbalance, Cogging]), rig(&[MassImbalance]));
        let both = with_settled(&[&patched], &nominal, &[settled(Cogging)]);
        assert_eq!(names_of(&both), [MassImbalance, Cogging]);
    }
}
