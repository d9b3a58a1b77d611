//! From what the search found and what was weighed to the report: places, the verdict, what to record next.

use crate::estimation::blocked_recording::BlockedRecording;
use crate::estimation::model::Model;
use crate::estimation::noise::Colour;
use crate::estimation::refit::{acceleration_scale, is_driven};
use crate::io::recording::Recording;
use crate::io::rig::Rig;
use crate::io::schema::{Hypothesis, Named, Place, Region, Report, Stretch, Verdict};
use crate::report::free_form;
use crate::report::next_experiment;
use crate::report::outcome::{self, Evidence, Outcome, Series};
use crate::report::patched_rig::{patch, place};
use crate::report::run_forward::{pooled, simulated};
use crate::report::text;
use crate::report::verdict::{Reason, misfit, verdict};
use crate::selection::context::{FitContext, FittedModel};
use crate::selection::excitation::Excitation;
use crate::validation::assess::{Assessed, Assessment, weigh};
use crate::validation::comparison::Shown;
use crate::validation::known_travel;
use crate::validation::opponent;
use crate::validation::out_of_library;
use crate::validation::parameters;
use crate::validation::rejection::Rejection;
use crate::validation::residual_maps::{self, Map};
use crate::validation::residuals::{Residuals, above};
use crate::validation::stepwise::Search;
use std::collections::BTreeMap;

pub(crate) fn conclude(mut s: Search, given: &Rig, held_out: &[Recording]) -> Outcome {
    let scale = acceleration_scale(&s.nominal, &s.fit_tracks);
    let nominal = s.nominal.clone();
    let fit_tracks = std::mem::take(&mut s.fit_tracks);
    let holdout = std::mem::take(&mut s.holdout_tracks);
    let smoothed = &holdout.smoothed;
    let span = s.span.clone();
    let context = FitContext { nominal: &nominal, tracks: &fit_tracks, span: &span, scale };
    let count = 1.0 / nominal.rig.encoder.counts_per_unit;
    let excitation = Excitation::of(&fit_tracks, count, nominal.rig.turn());
    let refit = context.fit(Model::default(), &s.null.noise, Colour::White);
    let mut assessment = weigh(&mut s, &context, &refit, &holdout, &excitation);
    s.fit_tracks = fit_tracks.clone();
    let driven = is_driven(&nominal, &fit_tracks);
    if let Some(reason) = misfit(&assessment, &nominal).filter(|_| driven) {
        return Outcome::cannot_tell(&nominal.rig, &reason);
    }
    let beside = opponent::oppose(&mut assessment, &context, &s);
    let maps_of = |shown: &Shown| {
        let (on_fit, on_holdout) = (&shown.on_fit.patched, &shown.on_holdout.patched);
        residual_maps::maps((&fit_tracks, on_fit), (smoothed, on_holdout), nominal.rig.turn())
    };
    let maps_with_all = maps_of(&assessment.shown);
    let nothing_named = assessment.named().is_empty();
    let unnamed = nothing_named.then(|| opponent::alone(&context, &refit, &holdout, &s)).flatten();
    let length = nominal.rig.kind.length();
    let form = unnamed.as_ref().map(|unnamed| free_form::sentence(&unnamed.shape, length));
    let foreign = nothing_named
        .then(|| out_of_library::alone(&context, &refit, &holdout))
        .flatten()
        .map(Reason::Foreign)
        .or_else(|| form.is_some().then_some(Reason::FreeForm));
    let (verdict, reason) = verdict(&assessment, &maps_with_all, smoothed, &excitation, foreign);
    let unnamed = unnamed.filter(|_| verdict == Verdict::Unexplained);
    let form = form.filter(|_| unnamed.is_some());
    let reason = reason.map(|reason| text::reason(&reason, form.as_deref()));
    // The verdict rests on all that was weighed, what people see on what is named.
    let with_named = only_named(&assessment, &context, &refit, smoothed, &s);
    let named_alone = with_named.as_ref().unwrap_or(&assessment.shown);
    let where_left = &named_alone.on_holdout.patched;
    let free_form = free_form::told(unnamed.as_ref(), form, beside);
    let drawn = unnamed.as_ref().map(|unnamed| unnamed.shape.clone());
    let with_force = unnamed.and_then(|unnamed| {
        Some(Shown::new(&context, smoothed, &assessment.estimator, &refit, unnamed.fitted?))
    });
    let Shown { patched, on_fit, on_holdout, table, keeps_nominal } =
        with_force.as_ref().unwrap_or(named_alone);
    let maps = with_named.as_ref().map_or(maps_with_all, maps_of);
    let effects = named_effects(&assessment, with_named.as_ref(), &context, &s);
    let rig_of = |model: &FittedModel| {
        if *keeps_nominal && model.model.effects.is_empty() { s.original.clone() } else { patch(&s, model) }
    };
    let (patched_rig, refit_rig) = (rig_of(patched), rig_of(&refit));
    let simulated = simulated(given, &refit_rig, &patched_rig, held_out);
    let floor = assessment.floor;
    let before = above(table.nominal.holdout, floor, 0.0).max(above(table.refit.holdout, floor, 0.0));
    let left = above(table.patched.holdout, floor, 0.0);
    let mut report = Report {
        format: 1,
        sentence: String::new(),
        effects,
        fit: table.clone(),
        refitted: refitted(&patched_rig),
        residual_bandwidth_hz: assessment.estimator.bandwidth_hz,
        noise_floor: floor,
        unexplained_fraction: if before > 0.0 { (left / before).min(1.0) } else { 0.0 },
        hypotheses: hypotheses(&assessment, &s),
        place: matches!(verdict, Verdict::Unexplained | Verdict::RandomDisturbance)
            .then(|| top_place(smoothed, where_left, &maps)),
        free_form,
        separating_experiment: match verdict {
            Verdict::InsufficientExcitation => Some(next_experiment::SPEEDS.to_owned()),
            _ => known_travel::beyond(smoothed, &patched.model, &span, length),
        },
        simulation: pooled(&simulated),
        verdict,
        reason,
    };
    report.sentence = outcome::sentence(&report, nominal.rig.kind);
    let mut series = all_series(&assessment, &fit_tracks, on_fit, false);
    series.extend(all_series(&assessment, smoothed, on_holdout, true));
    let evidence = Evidence {
        series,
        maps,
        form: drawn,
        simulated,
        kind: nominal.rig.kind,
        rig: nominal.rig.name.clone(),
        rate_hz: None,
    };
    Outcome { report, evidence, nominal_rig: given.clone(), refit_rig, patched_rig }
}

/// The model with the named effects and no other, where that is another one: what is not named was not found, and may be in
/// no patched rig.
fn only_named(
    assessment: &Assessment,
    context: &FitContext,
    refit: &FittedModel,
    holdout: &[BlockedRecording],
    s: &Search,
) -> Option<Shown> {
    let named = assessment.named();
    if named.len() == assessment.effects.len() {
        return None;
    }
    let all = &s.last.model.effects;
    let model = Model { effects: named.iter().map(|i| all[*i].clone()).collect(), ..s.last.model.clone() };
    let noises = [&s.null.noise, &s.last.noise];
    let slow = context.fit_slow(model, &noises);
    let patched = context.fit(slow.model, &slow.noise, Colour::White);
    Some(Shown::new(context, holdout, &assessment.estimator, refit, patched))
}

/// The named effects, the one that explains most first.
fn named_effects(
    assessment: &Assessment,
    with_named: Option<&Shown>,
    context: &FitContext,
    s: &Search,
) -> Vec<Named> {
    let patched = &with_named.unwrap_or(&assessment.shown).patched;
    let one = |(i, assessed): (usize, &Assessed)| {
        let name = assessed.found.effect.name;
        Named {
            name,
            subsystem: name.subsystem(),
            confidence: assessed.confidence,
            parameters: match with_named {
                Some(_) => parameters::parameters(context, patched, i),
                None => assessed.parameters.clone(),
            },
            place: place(s, patched, i),
            separating_experiment: next_experiment::separating(&assessed.class),
            class: assessed.class.clone(),
        }
    };
    let named = assessment.named().into_iter().map(|i| &assessment.effects[i]);
    let mut effects: Vec<(f64, Named)> =
        named.enumerate().map(|(i, assessed)| (assessed.found.holdout.sum, one((i, assessed)))).collect();
    effects.sort_by(|a, b| b.0.total_cmp(&a.0));
    effects.into_iter().map(|(_, named)| named).collect()
}

/// What was weighed, what was fitted in its place, and what was looked at on the way, each effect once.
fn hypotheses(assessment: &Assessment, s: &Search) -> Vec<Hypothesis> {
    let weighed = |assessed: &Assessed| Hypothesis {
        name: assessed.found.effect.name,
        holdout_gain: Some(assessed.found.holdout.sum),
        evidence: assessment.rests_on_evidence(assessed).then(|| assessed.evidence.clone()),
        class: assessed.class.clone(),
        rejected_because: assessment.doubt(assessed).as_ref().map(text::rejection),
    };
    let mut out: Vec<Hypothesis> =
        assessment.effects.iter().chain(&assessment.dropped).map(weighed).collect();
    let mut lost = |name, holdout_gain, why: Rejection| {
        if out.iter().all(|known| known.name != name) {
            let rejected_because = Some(text::rejection(&why));
            out.push(Hypothesis { name, holdout_gain, evidence: None, class: Vec::new(), rejected_because });
        }
    };
    for Assessed { found: one, class, .. } in &assessment.effects {
        for rival in &one.rivals {
            let winner = one.effect.name;
            let behind = || {
                if class.contains(&rival.name) {
                    Rejection::Indistinguishable { from: winner }
                } else {
                    Rejection::Behind { winner, z: rival.z }
                }
            };
            let why = rival.absence.clone().unwrap_or_else(behind);
            lost(rival.name, Some(one.holdout.sum - rival.held_out_lead), why);
        }
    }
    for (name, gain, why) in &s.rejected {
        lost(*name, *gain, why.clone());
    }
    out
}

/// The values of the rig that a refit may move.
fn refitted(patched: &Rig) -> BTreeMap<String, f64> {
    let model = &patched.model;
    [
        ("inertia", Some(model.inertia)),
        ("gain", Some(patched.actuator.gain)),
        ("viscous", model.viscous),
        ("coulomb", model.coulomb),
        ("offset", model.offset),
        ("weight", model.weight),
        ("gravity", model.gravity),
    ]
    .into_iter()
    .filter_map(|(key, value)| Some((key.to_owned(), value?)))
    .collect()
}

/// Where most of what no effect explains is.
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
    assessment: &Assessment,
    tracks: &[BlockedRecording],
    of: &Residuals,
    holdout: bool,
) -> Vec<Series> {
    let one = |(r, track): (usize, &BlockedRecording)| {
        let moving = assessment.estimator.moving(track);
        Series::new(track, holdout, &moving, &of.nominal[r], &of.refit[r], &of.patched[r], &of.force[r])
    };
    tracks.iter().enumerate().map(one).collect()
}
