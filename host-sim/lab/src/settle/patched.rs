//! The simulation with what was settled: what the device feeds forward, and what its author takes
//! over.

use super::Name;
use diagnosis::Outcome;
use diagnosis::effects::EffectName;
use diagnosis::rig::Rig;

/// The rig of the last diagnosis with the settled effects and no others. A name that a round kept
/// is not in the patched rig of a diagnosis that names nothing; it is in the rig of its contender.
pub(super) fn patched(last: &Outcome, names: &[Name]) -> Rig {
    let is_settled = |name: EffectName| names.iter().any(|settled| settled.name == name.as_str());
    let holds_all = |rig: &Rig| {
        names.iter().all(|settled| rig.effects.iter().any(|effect| effect.name.as_str() == settled.name))
    };
    let contenders = last.contending_rigs.iter();
    let all = std::iter::once(&last.patched_rig).chain(contenders);
    let mut rig = all.into_iter().find(|rig| holds_all(rig)).unwrap_or(&last.patched_rig).clone();
    // What the rig's author had put there stays.
    let given = |name: EffectName| last.nominal_rig.effects.iter().any(|effect| effect.name == name);
    rig.effects.retain(|effect| is_settled(effect.name) || given(effect.name));
    rig
}
