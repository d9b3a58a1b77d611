//! The fifth stage: the verdict, the effects that are named with their values, and the rigs that
//! follow from it.

use crate::data::recording::Recording;
use crate::data::rig::Rig;
use crate::data::schema::{Place, Region, Stretch, Verdict};
use crate::decide::assess::Assessment;
use crate::decide::confidence;
use crate::decide::contenders::contenders;
use crate::decide::decisive::{self, Decisive, Residual};
use crate::decide::diagnosis::{
    Complete, Diagnosis, FreeForce, JudgedHypothesis, Moved, NamedEffect, Reason, Rigs, Series,
};
use crate::decide::evidence_rows;
use crate::decide::free_form_check::{FreeFormShare, Unnamed};
use crate::decide::material;
use crate::decide::patched_rig::{patch, place};
use crate::decide::rejection::Rejection;
use crate::decide::verdict::verdict;
use crate::decide::weighed_model::{WeighedEffect, WeighedModel};
use crate::evidence::beside_rivals;
use crate::evidence::comparison::ModelComparison;
use crate::evidence::known_travel;
use crate::evidence::law_band::Band;
use crate::evidence::parameters;
use crate::evidence::prepared::Prepared;
use crate::evidence::residual_maps::{self, Map};
use crate::evidence::residuals::{Residuals, above};
use crate::evidence::run_forward::{pooled, simulated};
use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::filter::Noise;
use crate::fit::force_residual::Estimator;
use crate::fit::noise::Colour;
use crate::fit::nominal::{InertiaSource, Key, Nominal};
use crate::fit::skew;
use crate::laws::EffectName;
use crate::propose::context::FittedModel;
use crate::propose::untested::{self, NotTested};
use regression::Hypothesis;

/// Decides what is named; `rounds` are the regression's, `holdout` the held-out recordings as they
/// were read, `rate_hz` the rows a second of the slowest one.
pub(crate) fn decide(
    prepared: &Prepared,
    assessment: &Assessment,
    rounds: &[Vec<Hypothesis>],
    holdout: &[Recording],
    rate_hz: Option<f64>,
) -> Diagnosis {
    let decision = Decision { prepared, assessment, rounds };
    let maps_with_all = decision.maps(&assessment.weighed.shown);
    let (verdict, reason) = decision.verdict(&maps_with_all);
    // The verdict uses every weighed effect; plots use named ones.
    let with_named = assessment.named_alone.as_ref();
    let named_alone = with_named.unwrap_or(&assessment.weighed.shown);
    let unnamed = assessment.unnamed.as_ref().filter(|_| verdict == Verdict::Unexplained);
    let with_force = assessment.with_unnamed.as_ref().filter(|_| unnamed.is_some());
    let shown = with_force.unwrap_or(named_alone);
    let maps = with_named.map_or(maps_with_all, |shown| decision.maps(shown));
    let rigs = decision.rigs(shown);
    let simulated = simulated(&rigs.nominal, &rigs.refit, &rigs.patched, holdout);
    let motion = pooled(&simulated);
    let smoothed = &assessment.holdout.smoothed;
    let estimator = &assessment.weighed.estimator;
    let mut series = all_series(estimator, &assessment.fit, &shown.on_fit, false);
    series.extend(all_series(estimator, smoothed, &shown.on_holdout, true));
    let effects = decision.named_effects(with_named, motion.as_ref().is_some_and(confidence::follows_worse));
    // What is named was tested, if not in every order.
    let is_open = |(name, _): &(EffectName, NotTested)| effects.iter().all(|one| !one.class.contains(name));
    let untested =
        untested::untested(&prepared.span, &prepared.nominal).into_iter().filter(is_open).collect::<Vec<_>>();
    let decisive = decision.decisive(&effects, shown);
    let nothing_found = matches!(verdict, Verdict::Unexplained | Verdict::RandomDisturbance);
    Diagnosis::Complete(Box::new(Complete {
        verdict,
        reason,
        effects,
        hypotheses: hypotheses(&assessment.weighed, &untested, prepared),
        untested,
        contenders: contenders(prepared, assessment),
        errors: shown.table.clone(),
        moved: moved(&prepared.nominal, &assessment.fit, &shown.patched),
        bandwidth_hz: estimator.bandwidth_hz,
        noise_floor: assessment.weighed.floor,
        unexplained_fraction: unexplained_fraction(shown, assessment.weighed.floor),
        place: nothing_found.then(|| top_place(smoothed, &named_alone.on_holdout.patched, &maps)),
        free_form: free_form(unnamed, assessment.beside.as_ref()),
        beyond_fitted: known_travel::beyond(smoothed, &shown.patched.model, &prepared.span),
        decisive,
        evidence: evidence_rows::rows(assessment, rounds, motion.as_ref()),
        simulation: motion,
        simulated,
        series,
        maps,
        rigs,
        rate_hz,
    }))
}

/// Returns the values of the rig that a fit moved.
fn moved(nominal: &Nominal, tracks: &[BlockedRecording], shown: &FittedModel) -> Moved {
    let FittedModel { fit, noise, .. } = shown;
    let ratio = fit.value(Key::Gain).unwrap_or(nominal.gain());
    let by_gain = nominal.gain() / ratio;
    let is_known = nominal.virtual_inertia == 0.0 && by_gain > 0.0;
    Moved {
        late_rows: skew::total_rows(nominal, fit),
        inertia_by_gain: by_gain,
        deviations: if is_known { by_gain.ln() / nominal.gain_sd() } else { 0.0 },
        is_at_limit: is_known && nominal.is_at_limit(ratio),
        is_hidden: nominal.kept_inertia == Some(InertiaSource::OfRig),
        scatter: nominal.rig.encoder.noise_counts.is_none().then(|| scatter(nominal, tracks, noise)),
    }
}

/// Standard deviation of a reading by its noise, counts: the median over the blocks.
fn scatter(nominal: &Nominal, tracks: &[BlockedRecording], noise: &Noise) -> f64 {
    let of_row = |t: &BlockedRecording| t.rows.per_block as f64;
    let mut squares: Vec<f64> =
        tracks.iter().flat_map(|t| t.blocks.quantum.iter().map(move |q| q * of_row(t))).collect();
    squares.sort_by(f64::total_cmp);
    let middle = squares.get(squares.len() / 2).copied().unwrap_or(0.0);
    (noise.sensor * middle).sqrt() * nominal.rig.encoder.counts_per_unit
}

/// The data that a decision rests on.
struct Decision<'a> {
    prepared: &'a Prepared,
    assessment: &'a Assessment,
    /// The regression's proposals.
    rounds: &'a [Vec<Hypothesis>],
}

impl Decision<'_> {
    /// Residuals of a model over states.
    fn maps(&self, shown: &ModelComparison) -> Vec<Map> {
        let Assessment { fit, holdout, .. } = self.assessment;
        let (on_fit, on_holdout) = (&shown.on_fit.patched, &shown.on_holdout.patched);
        let turn = self.prepared.nominal.rig.turn();
        residual_maps::maps((fit, on_fit), (&holdout.smoothed, on_holdout), turn)
    }

    /// The verdict, and the residual where no effect is named; `maps` are of the residual of the
    /// whole model.
    fn verdict(&self, maps: &[Map]) -> (Verdict, Option<Reason>) {
        let Assessment { weighed, holdout, excitation, unnamed, foreign, .. } = self.assessment;
        let form = unnamed.is_some().then_some(Reason::FreeForm);
        let foreign = foreign.clone().map(Reason::UnnamedPhysics).or(form);
        let follows =
            || material::follows(self.rounds).map(|(effect, share)| Reason::Follows { effect, share });
        verdict(weighed, maps, &holdout.smoothed, excitation, foreign, &follows)
    }

    fn rigs(&self, shown: &ModelComparison) -> Rigs {
        let Prepared { given, nominal, .. } = self.prepared;
        let Assessment { fit, refit, .. } = self.assessment;
        let rig_of = |model: &FittedModel| -> Rig {
            if shown.keeps_nominal && model.model.effects.is_empty() {
                given.clone()
            } else {
                patch(given, nominal, fit, model)
            }
        };
        Rigs { nominal: given.clone(), refit: rig_of(refit), patched: rig_of(&shown.patched) }
    }

    /// The picture of the first named effect, with the nearest rival fitted instead.
    fn decisive(&self, named: &[NamedEffect], shown: &ModelComparison) -> Option<Decisive> {
        let Assessment { fit, refit, weighed, holdout, .. } = self.assessment;
        let name = named.first()?.name;
        let effect = shown.patched.model.effects.iter().find(|effect| effect.name == name)?;
        let (context, smoothed) = (self.prepared.context(fit), &holdout.smoothed);
        let fitted = |model| {
            let model = context.fit(model, &shown.patched.noise, Colour::White);
            ModelComparison::new(&context, smoothed, &weighed.estimator, refit, model)
        };
        let (estimator, holdout) = (&weighed.estimator, smoothed.as_slice());
        let rival = decisive::nearest_rival(name, weighed, shown, fitted);
        let named: Vec<_> = named.iter().map(|one| (one.name, &one.parameters)).collect();
        let band = Band::new(&context, estimator, &shown.patched, &named);
        Residual { shown, band, rival, fit, holdout, estimator }.decisive(effect)
    }

    /// The named effects, the one that explains most first.
    fn named_effects(&self, with_named: Option<&ModelComparison>, follows_worse: bool) -> Vec<NamedEffect> {
        let Assessment { fit, weighed, .. } = self.assessment;
        let nominal = &self.prepared.nominal;
        let (context, patched) = (self.prepared.context(fit), &with_named.unwrap_or(&weighed.shown).patched);
        let named_effect = |(i, effect): (usize, &WeighedEffect)| NamedEffect {
            name: effect.found.effect.name,
            class: effect.class.clone(),
            confidence: match follows_worse {
                true => confidence::with_worse_motion(effect.confidence),
                false => effect.confidence,
            },
            parameters: beside_rivals::widened(
                &context,
                patched,
                i,
                &effect.found.rivals,
                match with_named {
                    Some(_) => parameters::parameters(&context, patched, i),
                    None => effect.parameters.clone(),
                },
            ),
            place: place(nominal, fit, patched, i),
        };
        let named = weighed.named().into_iter().map(|i| &weighed.effects[i]).enumerate();
        let mut effects: Vec<(f64, NamedEffect)> =
            named.map(|(i, effect)| (effect.found.holdout.sum, named_effect((i, effect)))).collect();
        effects.sort_by(|a, b| b.0.total_cmp(&a.0));
        effects.into_iter().map(|(_, named)| named).collect()
    }
}

/// Returns the gain of a force of any form: alone where nothing is named, otherwise in addition to
/// the named effects.
fn free_form(unnamed: Option<&Unnamed>, beside: Option<&FreeFormShare>) -> Option<FreeForce> {
    let (taken, share_of_ceiling) = match (unnamed, beside) {
        (Some(unnamed), _) => (&unnamed.taken, 0.0),
        (None, Some(beside)) => (&beside.taken, beside.share),
        (None, None) => return None,
    };
    Some(FreeForce {
        inputs: taken.inputs,
        shape: unnamed.map(|unnamed| unnamed.shape.clone()),
        holdout_gain: unnamed.and_then(|unnamed| unnamed.holdout_gain),
        left_out_gain: taken.gain.sum,
        left_out_error: taken.gain.error,
        share_of_ceiling,
    })
}

/// Part of the held-out mean square above the noise that the patched model leaves.
fn unexplained_fraction(shown: &ModelComparison, floor: f64) -> f64 {
    let table = &shown.table;
    let before = above(table.nominal.holdout, floor, 0.0).max(above(table.refit.holdout, floor, 0.0));
    let left = above(table.patched.holdout, floor, 0.0);
    if before > 0.0 { (left / before).min(1.0) } else { 0.0 }
}

/// Returns the weighed effects, their rivals, the hypotheses that were rejected on the way, and
/// what the search found less in than in those, each effect once. With those that could not be
/// tested and those of the rig it is the whole library.
fn hypotheses(
    weighed: &WeighedModel,
    untested: &[(EffectName, NotTested)],
    prepared: &Prepared,
) -> Vec<JudgedHypothesis> {
    let of_effect = |effect: &WeighedEffect| JudgedHypothesis {
        name: effect.found.effect.name,
        holdout_gain: Some(effect.found.holdout.sum),
        evidence: weighed.rests_on_evidence(effect).then(|| effect.evidence.clone()),
        class: effect.class.clone(),
        rejection: weighed.doubt(effect),
    };
    let mut out: Vec<JudgedHypothesis> =
        weighed.effects.iter().chain(&weighed.dropped).map(of_effect).collect();
    let mut lost = |name: EffectName, holdout_gain, why: Rejection| {
        if out.iter().all(|known| known.name != name) {
            let (evidence, class, rejection) = (None, Vec::new(), Some(why));
            out.push(JudgedHypothesis { name, holdout_gain, evidence, class, rejection });
        }
    };
    for WeighedEffect { found: one, class, .. } in &weighed.effects {
        for rival in &one.rivals {
            let winner = one.effect.name;
            let behind = || match class.contains(&rival.name) {
                true => Rejection::Indistinguishable { from: winner },
                false => Rejection::Behind { winner, z: rival.z },
            };
            let why = if rival.is_absent { Rejection::NoSize } else { behind() };
            lost(rival.name, Some(one.holdout.sum - rival.held_out_lead), why);
        }
    }
    for rejected in &weighed.rejected {
        lost(rejected.name, rejected.holdout_gain, rejected.why.clone());
    }
    let is_tested = |name: &EffectName| untested.iter().all(|(other, _)| other != name);
    let is_in_question = |name: &&EffectName| {
        name.definition().is_sought() && is_tested(name) && !prepared.nominal.holds(**name)
    };
    for name in EffectName::ALL.iter().filter(is_in_question) {
        let is_sought = !prepared.unsought.contains(name);
        lost(*name, None, if is_sought { Rejection::LessInSearch } else { Rejection::NotInMotion });
    }
    out
}

/// Returns the place of most of what no effect explains.
fn top_place(holdout: &[BlockedRecording], left: &[Vec<f64>], maps: &[Map]) -> Place {
    let stretch = |(track, left): (&BlockedRecording, &Vec<f64>)| {
        let weight: Vec<f64> =
            left.iter().zip(&track.motion.rest).map(|(x, rest)| if *rest { 0.0 } else { x * x }).collect();
        Stretch { file: track.blocks.file.clone(), intervals_s: residual_maps::intervals(track, &weight) }
    };
    Place { recordings: holdout.iter().zip(left).map(stretch).collect(), states: strongest(maps) }
}

fn strongest(maps: &[Map]) -> Vec<Region> {
    let Some(map) = maps.iter().filter(|m| m.significant).max_by(|a, b| a.carries.total_cmp(&b.carries))
    else {
        return Vec::new();
    };
    let weight = |i: usize| map.forward[i].unwrap_or(0.0).abs().max(map.backward[i].unwrap_or(0.0).abs());
    let centres: Vec<f64> = map.edges.windows(2).map(|w| 0.5 * (w[0] + w[1])).collect();
    let weights: Vec<f64> = (0..centres.len()).map(weight).collect();
    residual_maps::range(&centres, &weights)
        .map(|(low, high)| Region { variable: map.variable.into(), low, high })
        .into_iter()
        .collect()
}

/// Residuals over time of some recordings.
fn all_series(
    estimator: &Estimator,
    tracks: &[BlockedRecording],
    of: &Residuals,
    holdout: bool,
) -> Vec<Series> {
    let series = |(r, track): (usize, &BlockedRecording)| {
        let moving = estimator.moving(track);
        Series::new(track, holdout, &moving, &of.nominal[r], &of.refit[r], &of.patched[r], &of.force[r])
    };
    tracks.iter().enumerate().map(series).collect()
}
