//! From what the search found and what was weighed to the report: places, the verdict, what to record next.

use crate::effects::CommandLaw;
use crate::error::InputError;
use crate::excitation::Excitation;
use crate::known;
use crate::locate::{self, Map};
use crate::model::Model;
use crate::noise::Colour;
use crate::null::command_scale;
use crate::outcome::{Evidence, Outcome, Series};
use crate::patch::{patch, place};
use crate::pipeline::Search;
use crate::prescribe;
use crate::report::{Hypothesis, Named, Place, Region, Report, Stretch, Verdict};
use crate::residuals::refit_matters;
use crate::select::{Bench, Candidate};
use crate::shown::Shown;
use crate::track::Track;
use crate::values;
use crate::weigh::{LITTLE_FORCE, Weighed, Weighing, weigh};
use std::collections::BTreeMap;

/// Part of the force that must be left, on every recording, to say that the rig's model does not speak of these recordings.
const FOREIGN: f64 = 0.85;
/// Part of the force that a disturbance must make up before it is called one, beside the noise.
const DISTURBED: f64 = 0.05;
/// Part of the refit's mean square that doubtful effects must leave at the most for the mismatch to be called repeatable.
const REPEATS: f64 = 0.7;

pub(crate) fn conclude(mut s: Search) -> Result<Outcome, InputError> {
    let scale = command_scale(&s.nominal, &s.fit_tracks);
    let nominal = s.nominal.clone();
    let fit_tracks = std::mem::take(&mut s.fit_tracks);
    let held_tracks = std::mem::take(&mut s.held_tracks);
    let span = s.span.clone();
    let bench = Bench { nominal: &nominal, tracks: &fit_tracks, span: &span, scale };
    let count = 1.0 / nominal.rig.encoder.counts_per_unit;
    let excitation = Excitation::of(&fit_tracks, count, nominal.rig.turn());
    let weighing = weigh(&mut s, &bench, &held_tracks, &excitation);
    let Weighing { estimator, floor, understood, swing, .. } = &weighing;
    let maps_of = |shown: &Shown| {
        let (on_fit, on_held) = (&shown.on_fit.patched, &shown.on_held.patched);
        locate::maps((&fit_tracks, on_fit), (&held_tracks, on_held), nominal.rig.turn())
    };
    // The verdict rests on all that was weighed, what people see on what is named.
    let Shown { on_held: with_all_on_held, table: with_all, .. } = &weighing.shown;
    let maps_with_all = maps_of(&weighing.shown);
    let carries = repeats(&maps_with_all);
    let named = weighing.named();
    let with_named = only(&named, &weighing, &bench, &held_tracks, &s);
    let shown = with_named.as_ref().unwrap_or(&weighing.shown);
    let Shown { patched, on_fit, on_held, table } = shown;
    let maps = with_named.as_ref().map_or(maps_with_all, maps_of);
    s.fit_tracks = fit_tracks.clone();
    let mut effects: Vec<(f64, Named)> = Vec::new();
    let mut hypotheses: Vec<Hypothesis> = Vec::new();
    let hypothesis = |weighed: &Weighed| Hypothesis {
        name: weighed.found.effect.name,
        holdout_gain: weighed.found.holdout.sum,
        evidence: weighing.rests_on_evidence(weighed).then(|| weighed.evidence.clone()),
        class: weighed.class.clone(),
        rejected_because: weighing.doubt(weighed),
    };
    hypotheses.extend(weighing.effects.iter().chain(&weighing.dropped).map(hypothesis));
    for (i, weighed) in named.iter().map(|i| &weighing.effects[*i]).enumerate() {
        let name = weighed.found.effect.name;
        let named = Named {
            name,
            subsystem: name.subsystem(),
            confidence: weighed.confidence,
            parameters: match &with_named {
                Some(_) => values::parameters(&bench, patched, i),
                None => weighed.parameters.clone(),
            },
            place: place(&s, patched, i),
            separating_experiment: prescribe::separating(&weighed.class),
            class: weighed.class.clone(),
        };
        effects.push((weighed.found.holdout.sum, named));
    }
    effects.sort_by(|a, b| b.0.total_cmp(&a.0));
    let effects: Vec<Named> = effects.into_iter().map(|e| e.1).collect();
    let above = |x: f64| (x * x - floor * floor).max(0.0);
    let unexplained = {
        let before = above(table.nominal.holdout).max(above(table.refit.holdout));
        if before > 0.0 { (above(table.patched.holdout) / before).min(1.0) } else { 0.0 }
    };
    // What was found and is too unsure to be named still says that the mismatch repeats, if it explains much of it.
    let helps = !weighing.effects.is_empty()
        && with_all.patched.holdout.powi(2) < REPEATS * with_all.refit.holdout.powi(2);
    let disturbed = above(with_all.patched.holdout).sqrt() > DISTURBED * table.force_rms.holdout;
    let refit_matters = refit_matters(estimator, &held_tracks, with_all_on_held, table.force_rms.holdout);
    // Where the inertia is hardly known the refit alone says little; elsewhere it must explain something, unless what was
    // found explains nearly all.
    let judged = if nominal.anchor.is_some() { with_all.patched } else { with_all.refit };
    // A command that is another one explains anything.
    let is_another = weighing.effects.iter().any(|e| CommandLaw::new(&e.found.effect).is_some());
    let foreign = judged.holdout > FOREIGN * table.force_rms.holdout
        && judged.fit > FOREIGN * table.force_rms.fit
        && (is_another || with_all.patched.holdout > LITTLE_FORCE * table.force_rms.holdout);
    if foreign {
        return Ok(Outcome::cannot_tell(
            &nominal.rig,
            format!(
                "the rig's model with refitted values leaves {:.0} % of the force unexplained, as it does where a unit is off (seconds, counts, command) or where the axis is moved by something that was not recorded",
                100.0 * judged.holdout / table.force_rms.holdout.max(1e-300)
            ),
        ));
    }
    let swings = swing.and_then(|swing| swing.in_words()).filter(|_| disturbed);
    let verdict = if !effects.is_empty() {
        Verdict::MissingPhysics
    } else if excitation.is_one_speed() {
        Verdict::InsufficientExcitation
    } else if (*understood && helps) || (disturbed && carries) || swings.is_some() {
        Verdict::Unexplained
    } else if disturbed {
        Verdict::RandomDisturbance
    } else if refit_matters {
        Verdict::ParametersOnly
    } else {
        Verdict::NoMismatch
    };
    let cannot_tell = matches!(verdict, Verdict::InsufficientExcitation);
    for one in weighing.effects.iter().map(|e| &e.found) {
        for rival in &one.rivals {
            if hypotheses.iter().all(|h| h.name != rival.name) {
                hypotheses.push(Hypothesis {
                    name: rival.name,
                    holdout_gain: one.holdout.sum - rival.lead,
                    evidence: None,
                    class: Vec::new(),
                    rejected_because: Some(rival.absence.clone().unwrap_or_else(|| {
                        format!("{} explains more by {:.1} standard errors", one.effect.name, rival.z)
                    })),
                });
            }
        }
    }
    for (name, gain, reason) in &s.lost {
        if hypotheses.iter().all(|h| h.name != *name) {
            hypotheses.push(Hypothesis {
                name: *name,
                holdout_gain: *gain,
                evidence: None,
                class: Vec::new(),
                rejected_because: Some(reason.clone()),
            });
        }
    }
    let patched_rig = patch(&s, patched);
    let mut refitted = BTreeMap::new();
    refitted.insert("inertia".to_owned(), patched_rig.model.inertia);
    refitted.insert("gain".to_owned(), patched_rig.actuator.gain);
    for (key, value) in [
        ("viscous", patched_rig.model.viscous),
        ("coulomb", patched_rig.model.coulomb),
        ("offset", patched_rig.model.offset),
        ("weight", patched_rig.model.weight),
    ] {
        if let Some(value) = value {
            refitted.insert(key.to_owned(), value);
        }
    }
    let top_place = matches!(verdict, Verdict::Unexplained | Verdict::RandomDisturbance).then(|| Place {
        recordings: held_tracks
            .iter()
            .zip(&on_held.patched)
            .map(|(track, r)| {
                let weight: Vec<f64> =
                    r.iter().zip(&track.rest).map(|(x, rest)| if *rest { 0.0 } else { x * x }).collect();
                Stretch { file: track.file.clone(), intervals_s: locate::intervals(track, &weight) }
            })
            .collect(),
        states: strongest(&maps),
    });
    let mut report = Report {
        format: 1,
        verdict,
        sentence: String::new(),
        effects,
        fit: table.clone(),
        refitted,
        residual_bandwidth_hz: estimator.bandwidth_hz,
        noise_floor: *floor,
        unexplained_fraction: unexplained,
        hypotheses,
        place: top_place,
        separating_experiment: if cannot_tell {
            Some(prescribe::SPEEDS.to_owned())
        } else {
            known::beyond(&held_tracks, &patched.model, &span, nominal.rig.kind.length())
        },
        reason: match verdict {
            Verdict::InsufficientExcitation => Some(excitation.one_speed()),
            Verdict::Unexplained => swings.or_else(|| weighing.foreign()),
            _ => None,
        },
    };
    report.sentence = crate::outcome::sentence(&report, nominal.rig.kind);
    let mut series = Vec::new();
    for (tracks, residuals, held) in [(&fit_tracks, on_fit, false), (&held_tracks, on_held, true)] {
        for (r, track) in tracks.iter().enumerate() {
            series.push(Series::new(
                track,
                held,
                &estimator.moving(track),
                &residuals.nominal[r],
                &residuals.refit[r],
                &residuals.patched[r],
                &residuals.force[r],
            ));
        }
    }
    let refit_maps: Vec<Map> = maps;
    Ok(Outcome {
        report,
        evidence: Evidence {
            series,
            maps: refit_maps,
            kind: nominal.rig.kind,
            rig: nominal.rig.name.clone(),
        },
        patched_rig,
    })
}

/// Whether what a model leaves repeats over some state.
fn repeats(maps: &[Map]) -> bool {
    maps.iter().any(|map| map.significant && map.carries > 0.1)
}

/// The model with the named effects and no other, where that is another one: what is not named was not found, and may be in
/// no patched rig.
fn only(named: &[usize], weighing: &Weighing, bench: &Bench, held: &[Track], s: &Search) -> Option<Shown> {
    if named.len() == weighing.effects.len() {
        return None;
    }
    let all = &s.last.model.effects;
    let model = Model { effects: named.iter().map(|i| all[*i].clone()).collect() };
    let white = |candidate: Candidate| bench.fit(candidate.model, &candidate.noise, Colour::White);
    let refit = bench.fit(Model::default(), &s.null.noise, Colour::White);
    let patched = white(bench.fit_slow(model, &[&s.null.noise, &s.last.noise]));
    Some(Shown::new(bench, held, &weighing.estimator, &refit, patched))
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
