//! The rows of the evidence table: the figures of both proposers for every hypothesis, named or
//! not. Nothing here decides.

use crate::data::schema::Simulation;
use crate::decide::assess::Assessment;
use crate::decide::evidence_table::EvidenceRow;
use crate::decide::weighed_model::WeighedEffect;
use crate::laws::EffectName;
use regression::Hypothesis;

/// The rows of every effect that a proposer looked at, `none` first.
pub(crate) fn rows(
    assessment: &Assessment,
    rounds: &[Vec<Hypothesis>],
    motion: Option<&Simulation>,
) -> Vec<EvidenceRow> {
    let weighed = &assessment.weighed;
    let named: Vec<EffectName> =
        weighed.named().into_iter().map(|i| weighed.effects[i].found.effect.name).collect();
    let filter: Vec<&WeighedEffect> = weighed.effects.iter().chain(&weighed.dropped).collect();
    let row = |name: &EffectName| {
        let seen = filter.iter().find(|one| one.found.effect.name == *name).map(|one| one.found.holdout);
        let less = weighed.rejected.iter().find(|one| one.name == *name).and_then(|one| one.holdout_gain);
        // What leads a round is judged beside the laws before it, the rest beside none.
        let is_law = |one: &&Hypothesis| one.law.key == name.as_str();
        let leaders = || rounds.iter().filter_map(|round| round.first());
        let law = leaders().find(is_law).or_else(|| rounds.iter().flatten().find(is_law));
        let is_named = named.contains(name);
        let windows =
            motion.filter(|_| is_named).map_or([None; 2], |motion| [0.1, 0.5].map(|s| off(motion, s)));
        let filter = [seen.map(|gain| gain.sum).or(less), seen.map(|gain| gain.z)];
        let numbers = joined(filter, law.map_or([None; 9], of_law), windows);
        (numbers.iter().any(Option::is_some)).then_some(EvidenceRow {
            name: name.as_str(),
            is_named,
            numbers,
        })
    };
    let first = rounds.first().and_then(|round| round.first());
    let none = EvidenceRow { name: "none", is_named: named.is_empty(), numbers: of_none(first) };
    std::iter::once(none).chain(EffectName::ALL.iter().filter_map(row)).collect()
}

fn joined(filter: [Option<f64>; 2], law: [Option<f64>; 9], windows: [Option<f64>; 2]) -> [Option<f64>; 13] {
    let mut all = filter.into_iter().chain(law).chain(windows);
    std::array::from_fn(|_| all.next().flatten())
}

fn of_law(one: &Hypothesis) -> [Option<f64>; 9] {
    let e = &one.evidence;
    let agreement = e.held_out.map_or(e.size_agreement, |held| held.size_agreement.min(e.size_agreement));
    [
        Some(e.share),
        Some(e.z),
        e.held_out.map(|held| held.share),
        e.held_out.map(|held| held.z),
        Some(if one.valid { agreement } else { 0.0 }),
        Some(e.lead_z),
        Some(e.free_form_more),
        Some(e.residual_over_noise),
        Some(e.rows),
    ]
}

/// Nothing gains nothing; what it leaves is what the first law leaves and takes.
fn of_none(first: Option<&Hypothesis>) -> [Option<f64>; 13] {
    let e = first.map(|one| one.evidence);
    let left = e.map(|e| e.residual_over_noise / (1.0 - e.share).max(1e-3));
    let zero = Some(0.0);
    joined([zero; 2], [zero, zero, zero, zero, None, None, None, left, e.map(|e| e.rows)], [zero; 2])
}

/// Logarithm of the patched over the refitted simulation's error in windows of so many seconds.
fn off(motion: &Simulation, seconds: f64) -> Option<f64> {
    let window = motion.windows.iter().find(|window| window.seconds == seconds)?;
    Some((window.position.patched? / window.position.refit?).ln())
}
