//! Rivals: every effect found is taken out, others are fitted in its place, and how far they stay behind makes its class.

use crate::effects::{Effect, EffectName};
use crate::excitation::Excitation;
use crate::fit::Fit;
use crate::found::{Found, Rival, fit_costs, lay_all};
use crate::judge;
use crate::known::known;
use crate::model::Nominal;
use crate::noise::Colour;
use crate::periodic::is_periodic;
use crate::rig::Kind;
use crate::select::{Bench, Candidate};
use crate::track::Track;
use crate::values;
use rayon::prelude::*;

/// How many rivals of each effect are fitted in full.
const RIVALS: usize = 4;
/// A rival must be this many standard errors behind, and this far in log-likelihood, not to share a class.
pub(crate) const BEHIND_Z: f64 = 2.0;
const BEHIND: f64 = 3.0;
/// The same as a part of what the effect explains: less is the form of a law rather than its name.
const BEHIND_PART: f64 = 0.015;
/// A rival this far behind in log-likelihood under a slow disturbance, and by half of what the winner gains there, is
/// behind, and counts as by this many standard errors.
const BEHIND_SLOW: f64 = 30.0;
const BEHIND_SLOW_Z: f64 = 4.0;
/// Narrowest gap that an encoder sees, counts.
const SEEN: f64 = 2.0;
/// Most effects that a class may hold.
const MOST_IN_CLASS: usize = 3;
/// Standard errors behind within which a rival's shape is worth polishing.
const WITHIN_REACH: f64 = 8.0;

/// Costs per segment on fitted and held-out recordings under one noise.
fn costs(candidate: &Candidate, nominal: &Nominal, held: &[Track]) -> Vec<f64> {
    let mut out = fit_costs(candidate);
    for laid in lay_all(candidate, nominal, held, &candidate.noise) {
        out.extend(laid.costs);
    }
    out
}

/// Fits the rivals of each effect in its place and says how far behind they are.
pub(crate) fn fit_rivals(
    bench: &Bench,
    last: &Candidate,
    slow: &Candidate,
    held: &[Track],
    found: &mut [Found],
) {
    let best = bench.fit(last.model.clone(), &last.noise, Colour::White);
    for i in 0..found.len() {
        let mut less = best.model.clone();
        less.effects.remove(i);
        let name = best.model.effects[i].name;
        let base_fit = Fit::new(&less, bench.nominal, bench.tracks, &best.noise);
        let base = Candidate { model: less, noise: best.noise, fit: base_fit, merit: 0.0 };
        let periodic =
            is_periodic(name) || matches!(name, EffectName::MassImbalance | EffectName::EncoderEccentricity);
        let others: Vec<(Effect, f64)> = bench
            .screen(&base, &|other| other != name && (periodic || !is_periodic(other)))
            .into_iter()
            .take(RIVALS)
            .collect();
        let with = |effect: &Effect| {
            let mut model = base.model.clone();
            model.effects.push(effect.clone());
            model
        };
        let mut out: Vec<Rival> = others
            .par_iter()
            .map(|(effect, _)| {
                let model = with(effect);
                let fit = Fit::new(&model, bench.nominal, bench.tracks, &best.noise);
                let rival = Candidate { model, noise: best.noise, fit, merit: 0.0 };
                // Both are judged where both know something.
                let held = known(held, &best.model, bench.span);
                let held = known(&held, &rival.model, bench.span);
                let own = costs(&best, bench.nominal, &held);
                let lead = |rival: &Candidate| {
                    let theirs = costs(rival, bench.nominal, &held);
                    judge::bootstrap(&theirs.iter().zip(&own).map(|(a, b)| a - b).collect::<Vec<f64>>())
                };
                let mut gain = lead(&rival);
                let mut rival = rival;
                if gain.z < WITHIN_REACH {
                    // A rival that may be near is fitted as well as the winner was.
                    let polished = Candidate { noise: best.noise, ..bench.polish_one(&rival) };
                    let again = lead(&polished);
                    if again.sum < gain.sum {
                        (gain, rival) = (again, polished);
                    }
                }
                let last = rival.model.effects.len() - 1;
                let absence = (gain.z < BEHIND_Z).then(|| values::absence(bench, &rival, last)).flatten();
                Rival { name: effect.name, z: gain.z, lead: gain.sum, absence }
            })
            .collect();
        // Needed only where a rival comes near, and the same for all of them.
        let mut without = None;
        for (rival, (effect, _)) in out.iter_mut().zip(&others).filter(|(rival, _)| rival.z < BEHIND_Z) {
            // What only a white noise takes for as good is behind.
            let theirs = bench.fit_slow(with(effect), &[&slow.noise]).merit;
            let without =
                *without.get_or_insert_with(|| bench.fit_slow(base.model.clone(), &[&slow.noise]).merit);
            let behind = slow.merit - theirs;
            if behind > 0.5 * (slow.merit - without) && behind > BEHIND_SLOW {
                rival.z = BEHIND_SLOW_Z;
                rival.lead = rival.lead.max(behind);
            }
        }
        found[i].rivals = out;
    }
}

/// What no recording of motion tells from an effect; `count` is one of the encoder's.
fn twin(effect: &Effect, leaves_much: bool, kind: Kind, count: f64) -> Option<EffectName> {
    use EffectName as N;
    match effect.name {
        // A drive that clips, and a roller that slips at a constant force.
        N::CommandSaturation => Some(N::RollerSlip),
        N::RollerSlip => Some(N::CommandSaturation),
        // A spring that explains little of what it should explain may well have a gap.
        N::DriveCompliance if leaves_much => Some(N::Backlash),
        // A gap that the encoder does not see, and the spring that its flanks are.
        N::Backlash if effect.shape_or("gap", f64::INFINITY) < SEEN * count => Some(N::DriveCompliance),
        // Waves of once a turn, where nothing that turns need be heavy.
        N::MassImbalance if kind == Kind::Linear => Some(N::Cogging),
        _ => None,
    }
}

/// Every effect that these recordings cannot tell from the one found, itself first.
pub(crate) fn class(
    found: &Found,
    excitation: &Excitation,
    leaves_much: bool,
    bench: &Bench,
) -> Vec<EffectName> {
    let name = found.effect.name;
    let mut class = vec![name];
    class.extend(twin(&found.effect, leaves_much, bench.nominal.rig.kind, bench.span.count));
    class.extend(excitation.twin(name).filter(|twin| !class.contains(twin)));
    let least = BEHIND.max(BEHIND_PART * (found.fit.sum + found.holdout.sum));
    let is_near = |r: &&Rival| (r.z < BEHIND_Z || r.lead < least) && r.absence.is_none();
    let mut near: Vec<&Rival> = found.rivals.iter().filter(is_near).collect();
    near.sort_by(|a, b| a.z.total_cmp(&b.z));
    for rival in near {
        if class.len() < MOST_IN_CLASS && !class.contains(&rival.name) {
            class.push(rival.name);
        }
    }
    class
}

/// Standard errors that the nearest rival outside an effect's class is behind.
pub(crate) fn nearest(found: &Found, class: &[EffectName]) -> f64 {
    let outside = found.rivals.iter().filter(|r| !class.contains(&r.name) && r.absence.is_none());
    outside.map(|r| r.z).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unseen_gap_may_be_a_spring_and_a_wave_of_a_screw_may_be_of_its_motor() {
        use EffectName as N;
        let of = |name: N, shape: &[(&str, f64)], kind: Kind| {
            twin(&Effect::shaped(name, shape), false, kind, 1e-6)
        };
        assert_eq!(of(N::Backlash, &[("gap", 1.5e-6)], Kind::Linear), Some(N::DriveCompliance));
        assert_eq!(of(N::Backlash, &[("gap", 3e-6)], Kind::Linear), None);
        assert_eq!(of(N::MassImbalance, &[], Kind::Linear), Some(N::Cogging));
        assert_eq!(of(N::MassImbalance, &[], Kind::Rotary), None, "there a mass turns");
    }
}
