//! From what the search found and what was weighed to the report: places, the verdict, what to record next.

use crate::excitation::Excitation;
use crate::foreign;
use crate::known;
use crate::locate::{self, Map};
use crate::model::Model;
use crate::noise::Colour;
use crate::null::command_scale;
use crate::outcome::{self, Evidence, Outcome, Series};
use crate::patch::{patch, place};
use crate::pipeline::Search;
use crate::prescribe;
use crate::report::{Hypothesis, Named, Place, Region, Report, Stretch, Verdict};
use crate::residuals::{Residuals, above};
use crate::rig::Rig;
use crate::select::{Bench, Candidate};
use crate::shown::Shown;
use crate::track::Track;
use crate::values;
use crate::verdict::{misfit, verdict};
use crate::weigh::{Weighed, Weighing, weigh};
use std::collections::BTreeMap;

pub(crate) fn conclude(mut s: Search) -> Outcome {
    let scale = command_scale(&s.nominal, &s.fit_tracks);
    let nominal = s.nominal.clone();
    let fit_tracks = std::mem::take(&mut s.fit_tracks);
    let held_tracks = std::mem::take(&mut s.held_tracks);
    let span = s.span.clone();
    let bench = Bench { nominal: &nominal, tracks: &fit_tracks, span: &span, scale };
    let count = 1.0 / nominal.rig.encoder.counts_per_unit;
    let excitation = Excitation::of(&fit_tracks, count, nominal.rig.turn());
    let refit = bench.fit(Model::default(), &s.null.noise, Colour::White);
    let weighing = weigh(&mut s, &bench, &refit, &held_tracks, &excitation);
    s.fit_tracks = fit_tracks.clone();
    if let Some(reason) = misfit(&weighing, &nominal) {
        return Outcome::cannot_tell(&nominal.rig, reason);
    }
    let maps_of = |shown: &Shown| {
        let (on_fit, on_held) = (&shown.on_fit.patched, &shown.on_held.patched);
        locate::maps((&fit_tracks, on_fit), (&held_tracks, on_held), nominal.rig.turn())
    };
    let maps_with_all = maps_of(&weighing.shown);
    let foreign =
        if weighing.named().is_empty() { foreign::alone(&bench, &refit, &held_tracks) } else { None };
    let (verdict, reason) = verdict(&weighing, &maps_with_all, &held_tracks, &excitation, foreign);
    // The verdict rests on all that was weighed, what people see on what is named.
    let with_named = only_named(&weighing, &bench, &refit, &held_tracks, &s);
    let Shown { patched, on_fit, on_held, table } = with_named.as_ref().unwrap_or(&weighing.shown);
    let maps = with_named.as_ref().map_or(maps_with_all, maps_of);
    let effects = named_effects(&weighing, with_named.as_ref(), &bench, &s);
    let patched_rig = patch(&s, patched);
    let floor = weighing.floor;
    let before = above(table.nominal.holdout, floor, 0.0).max(above(table.refit.holdout, floor, 0.0));
    let left = above(table.patched.holdout, floor, 0.0);
    let mut report = Report {
        format: 1,
        sentence: String::new(),
        effects,
        fit: table.clone(),
        refitted: refitted(&patched_rig),
        residual_bandwidth_hz: weighing.estimator.bandwidth_hz,
        noise_floor: floor,
        unexplained_fraction: if before > 0.0 { (left / before).min(1.0) } else { 0.0 },
        hypotheses: hypotheses(&weighing, &s),
        place: matches!(verdict, Verdict::Unexplained | Verdict::RandomDisturbance)
            .then(|| top_place(&held_tracks, &on_held.patched, &maps)),
        separating_experiment: match verdict {
            Verdict::InsufficientExcitation => Some(prescribe::SPEEDS.to_owned()),
            _ => known::beyond(&held_tracks, &patched.model, &span, nominal.rig.kind.length()),
        },
        verdict,
        reason,
    };
    report.sentence = outcome::sentence(&report, nominal.rig.kind);
    let mut series = all_series(&weighing, &fit_tracks, on_fit, false);
    series.extend(all_series(&weighing, &held_tracks, on_held, true));
    let evidence = Evidence { series, maps, kind: nominal.rig.kind, rig: nominal.rig.name.clone() };
    Outcome { report, evidence, patched_rig }
}

/// The model with the named effects and no other, where that is another one: what is not named was not found, and may be in
/// no patched rig.
fn only_named(
    weighing: &Weighing,
    bench: &Bench,
    refit: &Candidate,
    held: &[Track],
    s: &Search,
) -> Option<Shown> {
    let named = weighing.named();
    if named.len() == weighing.effects.len() {
        return None;
    }
    let all = &s.last.model.effects;
    let model = Model { effects: named.iter().map(|i| all[*i].clone()).collect(), ..s.last.model.clone() };
    let noises = [&s.null.noise, &s.last.noise];
    let slow = bench.fit_slow(model, &noises);
    let patched = bench.fit(slow.model, &slow.noise, Colour::White);
    Some(Shown::new(bench, held, &weighing.estimator, refit, patched))
}

/// The named effects, the one that explains most first.
fn named_effects(weighing: &Weighing, with_named: Option<&Shown>, bench: &Bench, s: &Search) -> Vec<Named> {
    let patched = &with_named.unwrap_or(&weighing.shown).patched;
    let one = |(i, weighed): (usize, &Weighed)| {
        let name = weighed.found.effect.name;
        Named {
            name,
            subsystem: name.subsystem(),
            confidence: weighed.confidence,
            parameters: match with_named {
                Some(_) => values::parameters(bench, patched, i),
                None => weighed.parameters.clone(),
            },
            place: place(s, patched, i),
            separating_experiment: prescribe::separating(&weighed.class),
            class: weighed.class.clone(),
        }
    };
    let named = weighing.named().into_iter().map(|i| &weighing.effects[i]);
    let mut effects: Vec<(f64, Named)> =
        named.enumerate().map(|(i, weighed)| (weighed.found.holdout.sum, one((i, weighed)))).collect();
    effects.sort_by(|a, b| b.0.total_cmp(&a.0));
    effects.into_iter().map(|(_, named)| named).collect()
}

/// What was weighed, what was fitted in its place, and what was looked at on the way, each effect once.
fn hypotheses(weighing: &Weighing, s: &Search) -> Vec<Hypothesis> {
    let weighed = |weighed: &Weighed| Hypothesis {
        name: weighed.found.effect.name,
        holdout_gain: weighed.found.holdout.sum,
        evidence: weighing.rests_on_evidence(weighed).then(|| weighed.evidence.clone()),
        class: weighed.class.clone(),
        rejected_because: weighing.doubt(weighed),
    };
    let mut out: Vec<Hypothesis> = weighing.effects.iter().chain(&weighing.dropped).map(weighed).collect();
    let mut lost = |name, holdout_gain, reason: String| {
        if out.iter().all(|known| known.name != name) {
            let rejected_because = Some(reason);
            out.push(Hypothesis { name, holdout_gain, evidence: None, class: Vec::new(), rejected_because });
        }
    };
    for one in weighing.effects.iter().map(|e| &e.found) {
        for rival in &one.rivals {
            let behind = || format!("{} explains more by {:.1} standard errors", one.effect.name, rival.z);
            let reason = rival.absence.clone().unwrap_or_else(behind);
            lost(rival.name, one.holdout.sum - rival.lead, reason);
        }
    }
    for (name, gain, reason) in &s.lost {
        lost(*name, *gain, reason.clone());
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
    ]
    .into_iter()
    .filter_map(|(key, value)| Some((key.to_owned(), value?)))
    .collect()
}

/// Where most of what no effect explains is.
fn top_place(held: &[Track], left: &[Vec<f64>], maps: &[Map]) -> Place {
    let stretch = |(track, left): (&Track, &Vec<f64>)| {
        let weight: Vec<f64> =
            left.iter().zip(&track.rest).map(|(x, rest)| if *rest { 0.0 } else { x * x }).collect();
        Stretch { file: track.file.clone(), intervals_s: locate::intervals(track, &weight) }
    };
    Place { recordings: held.iter().zip(left).map(stretch).collect(), states: strongest(maps) }
}

fn strongest(maps: &[Map]) -> Vec<Region> {
    let Some(map) = maps.iter().filter(|m| m.significant).max_by(|a, b| a.carries.total_cmp(&b.carries))
    else {
        return Vec::new();
    };
    let weight = |i: usize| map.forward[i].unwrap_or(0.0).abs().max(map.backward[i].unwrap_or(0.0).abs());
    let centres: Vec<f64> = map.edges.windows(2).map(|w| 0.5 * (w[0] + w[1])).collect();
    let weights: Vec<f64> = (0..centres.len()).map(weight).collect();
    locate::range(&centres, &weights)
        .map(|(low, high)| Region { variable: map.variable.into(), low, high })
        .into_iter()
        .collect()
}

/// Residuals over time of some recordings.
fn all_series(weighing: &Weighing, tracks: &[Track], of: &Residuals, held: bool) -> Vec<Series> {
    let one = |(r, track): (usize, &Track)| {
        let moving = weighing.estimator.moving(track);
        Series::new(track, held, &moving, &of.nominal[r], &of.refit[r], &of.patched[r], &of.force[r])
    };
    tracks.iter().enumerate().map(one).collect()
}
