//! From what the search found to the report: rivals and classes, confidence, values, places, the verdict.

use crate::confidence::{self, Leftover};
use crate::effects::{Effect, EffectName};
use crate::error::InputError;
use crate::estimate::Estimator;
use crate::excitation::Excitation;
use crate::fit::Fit;
use crate::judge;
use crate::kalman::tolerant;
use crate::locate::{self, Map};
use crate::model::{Nominal, total};
use crate::noise::Colour;
use crate::null::command_scale;
use crate::outcome::{Evidence, Outcome, Series};
use crate::patch::{patch, place};
use crate::pipeline::{Found, Rival, Search, lay_all};
use crate::prescribe;
use crate::report::{Both, FitTable, Hypothesis, Named, Place, Region, Report, Stretch, Verdict};
use crate::select::{Bench, Candidate};
use crate::track::{Total, Track};
use crate::values;
use std::collections::BTreeMap;

/// How many rivals of each effect are fitted in full.
const RIVALS: usize = 4;
/// A rival must be this many standard errors behind, and this far in log-likelihood, not to share a class.
const BEHIND_Z: f64 = 2.0;
const BEHIND: f64 = 3.0;
/// The same as a part of what the effect explains: less is the form of a law rather than its name.
const BEHIND_PART: f64 = 0.015;
/// A rival this far behind in log-likelihood under a slow disturbance, and by half of what the winner gains there, is
/// behind, and counts as by this many standard errors.
const BEHIND_SLOW: f64 = 30.0;
const BEHIND_SLOW_Z: f64 = 4.0;
/// Standard errors behind within which a rival's shape is worth polishing.
const WITHIN_REACH: f64 = 8.0;

/// Costs per segment on fitted and held-out recordings under one noise.
fn costs(candidate: &Candidate, nominal: &Nominal, held: &[Track]) -> Vec<f64> {
    let mut out = Vec::new();
    for (one, places) in candidate.fit.prepared.iter().zip(&candidate.fit.places) {
        for (square, (weight, count)) in
            one.squares(places, &candidate.fit.solution.x).iter().zip(one.weights())
        {
            out.push(0.5 * count * tolerant(square / weight / count).0);
        }
    }
    for laid in lay_all(candidate, nominal, held, &candidate.noise) {
        out.extend(laid.costs);
    }
    out
}

/// The search for waves is dear, and only waves are like waves.
fn is_periodic(name: EffectName) -> bool {
    matches!(name, EffectName::Cogging | EffectName::TorqueRipple)
}

/// Fits the rivals of each effect in its place and says how far behind they are.
pub(crate) fn rivals(bench: &Bench, last: &Candidate, slow: &Candidate, held: &[Track], found: &mut [Found]) {
    let best = bench.fit(last.model.clone(), &last.noise, Colour::White);
    let own = costs(&best, bench.nominal, held);
    for i in 0..found.len() {
        let mut less = best.model.clone();
        less.effects.remove(i);
        let name = best.model.effects[i].name;
        let base_fit = Fit::new(&less, bench.nominal, bench.tracks, &best.noise);
        let base = Candidate { model: less, noise: best.noise, fit: base_fit, merit: 0.0 };
        let mut out: Vec<Rival> = Vec::new();
        let periodic =
            is_periodic(name) || matches!(name, EffectName::MassImbalance | EffectName::EncoderEccentricity);
        let others: Vec<(Effect, f64)> = bench
            .screen(&base, &|other| other != name && (periodic || !is_periodic(other)))
            .into_iter()
            .take(RIVALS)
            .collect();
        // Needed only where a rival comes near, and the same for all of them.
        let mut without = None;
        for (effect, _) in others {
            let mut model = base.model.clone();
            model.effects.push(effect.clone());
            let fit = Fit::new(&model, bench.nominal, bench.tracks, &best.noise);
            let rival = Candidate { model, noise: best.noise, fit, merit: 0.0 };
            let lead = |rival: &Candidate| {
                let theirs = costs(rival, bench.nominal, held);
                judge::bootstrap(&theirs.iter().zip(&own).map(|(a, b)| a - b).collect::<Vec<f64>>())
            };
            let mut gain = lead(&rival);
            if gain.z < WITHIN_REACH {
                // A rival that may be near is fitted as well as the winner was.
                let polished = Candidate { noise: best.noise, ..bench.polish_one(&rival) };
                let again = lead(&polished);
                if again.sum < gain.sum {
                    gain = again;
                }
            }
            let mut rival = Rival { name: effect.name, z: gain.z, lead: gain.sum };
            if rival.z < BEHIND_Z {
                // What only a white noise takes for as good is behind.
                let mut model = base.model.clone();
                model.effects.push(effect.clone());
                let theirs = bench.fit_slow(model, &[&slow.noise]).merit;
                let without =
                    *without.get_or_insert_with(|| bench.fit_slow(base.model.clone(), &[&slow.noise]).merit);
                let behind = slow.merit - theirs;
                if behind > 0.5 * (slow.merit - without) && behind > BEHIND_SLOW {
                    rival.z = BEHIND_SLOW_Z;
                    rival.lead = rival.lead.max(behind);
                }
            }
            out.push(rival);
        }
        found[i].rivals = out;
    }
}

/// Standard errors that the nearest rival outside an effect's class is behind.
fn nearest_rival(found: &Found, class: &[EffectName]) -> f64 {
    found.rivals.iter().filter(|r| !class.contains(&r.name)).map(|r| r.z).fold(f64::INFINITY, f64::min)
}

/// Residual force of one model over recordings.
fn forces(estimator: &Estimator, tracks: &[Track], totals: &[Total], inertia: f64) -> Vec<Vec<f64>> {
    crate::pipeline::residuals(estimator, tracks, totals, inertia)
}

struct Residuals {
    force: Vec<Vec<f64>>,
    nominal: Vec<Vec<f64>>,
    refit: Vec<Vec<f64>>,
    patched: Vec<Vec<f64>>,
}

fn residuals(
    s: &Search,
    estimator: &Estimator,
    tracks: &[Track],
    held: bool,
    refit: &Candidate,
    patched: &Candidate,
) -> Residuals {
    let nominal = &s.nominal;
    let model = crate::model::Model::default();
    let plain = Nominal { anchor: None, ..nominal.clone() };
    let at_nominal: Vec<Total> = tracks
        .iter()
        .map(|track| {
            let columns = model.columns(&plain, track, &patched.noise);
            let theta: Vec<f64> = columns.iter().map(|c| c.prior.mean).collect();
            total(track, &columns, &theta)
        })
        .collect();
    let drive: Vec<Total> = tracks.iter().map(|track| Total::of_command(track, nominal.gain())).collect();
    let none: Vec<Total> = tracks.iter().map(|track| Total::zero(track.blocks())).collect();
    let lay = |c: &Candidate| -> Vec<Total> {
        if held {
            lay_all(c, nominal, tracks, &c.noise).into_iter().map(|laid| laid.total).collect()
        } else {
            c.fit.totals(tracks)
        }
    };
    let j0 = nominal.rig.model.inertia;
    let all = forces(estimator, tracks, &none, j0);
    let less = forces(estimator, tracks, &drive, j0);
    let force = all.iter().zip(&less).map(|(a, b)| a.iter().zip(b).map(|(a, b)| a - b).collect()).collect();
    Residuals {
        force,
        nominal: forces(estimator, tracks, &at_nominal, j0),
        refit: forces(estimator, tracks, &lay(refit), values::scale(nominal, refit).0),
        patched: forces(estimator, tracks, &lay(patched), values::scale(nominal, patched).0),
    }
}

/// Parts of the force: left so little, a model has understood it; left so much, it has not, whatever it names. Between the
/// two it must leave less than this part of what the refit left.
const LITTLE_FORCE: f64 = 0.12;
const MUCH_FORCE: f64 = 0.5;
const MUCH_OF_REFIT: f64 = 0.65;
/// Least probability with which an effect is named.
const NAMED: f64 = 0.5;
/// Part of the force that must be left, on every recording, to say that the rig's model does not speak of these recordings.
const FOREIGN: f64 = 0.85;
/// Part of the force that a disturbance must make up before it is called one, beside the noise.
const DISTURBED: f64 = 0.05;
/// Part of the refit's mean square that doubtful effects must leave at the most for the mismatch to be called repeatable.
const REPEATS: f64 = 0.7;

/// Whether at least one of the values that say how large an effect is cannot be zero.
fn is_there(named: &Named) -> bool {
    let drifts = matches!(named.name, EffectName::FrictionDrift | EffectName::GainDrift);
    let where_or_when = |key: &str| key.starts_with("period") || (drifts && key == "time_constant");
    named.parameters.is_empty()
        || named.parameters.iter().any(|(key, p)| !where_or_when(key) && p.ci95[0] * p.ci95[1] > 0.0)
}

/// Part of the force that a refit must take from the held-out residual before values are called wrong.
const REFIT_MATTERS: f64 = 0.02;

/// Whether other values explain held-out recordings better than the rig's own, each recording's bias left aside.
fn refit_matters(estimator: &Estimator, tracks: &[Track], held: &Residuals, force: f64) -> bool {
    let unbiased = |residuals: &[Vec<f64>]| -> Vec<Vec<f64>> {
        let centred = |(x, track): (&Vec<f64>, &Track)| {
            let moving = estimator.moving(track);
            let (sum, n) =
                x.iter().zip(&moving).filter(|(_, m)| **m).fold((0.0, 0.0), |a, (x, _)| (a.0 + x, a.1 + 1.0));
            let mean = if n > 0.0 { sum / n } else { 0.0 };
            x.iter().map(|x| x - mean).collect()
        };
        residuals.iter().zip(tracks).map(centred).collect()
    };
    let (before, after) = (unbiased(&held.nominal), unbiased(&held.refit));
    let taken = estimator.rms(&before, tracks).powi(2) - estimator.rms(&after, tracks).powi(2);
    taken > (REFIT_MATTERS * force).powi(2) && relative_gain(estimator, tracks, &before, &after)[0] > 0.0
}

pub(crate) fn conclude(mut s: Search) -> Result<Outcome, InputError> {
    let scale = command_scale(&s.nominal, &s.fit_tracks);
    let nominal = s.nominal.clone();
    let fit_tracks = std::mem::take(&mut s.fit_tracks);
    let held_tracks = std::mem::take(&mut s.held_tracks);
    let span = s.span.clone();
    let bench = Bench { nominal: &nominal, tracks: &fit_tracks, span: &span, scale };
    let mut found = std::mem::take(&mut s.found);
    let refit = bench.fit(crate::model::Model::default(), &s.null.noise, Colour::White);
    let patched = bench.fit(s.last.model.clone(), &s.last.noise, Colour::White);
    rivals(&bench, &patched, &s.last, &held_tracks, &mut found);
    let estimator = Estimator::new(&fit_tracks, &patched.noise, scale);
    let on_fit = residuals(&s, &estimator, &fit_tracks, false, &refit, &patched);
    let on_held = residuals(&s, &estimator, &held_tracks, true, &refit, &patched);
    let both = |a: &Vec<Vec<f64>>, b: &Vec<Vec<f64>>| Both {
        fit: estimator.rms(a, &fit_tracks),
        holdout: estimator.rms(b, &held_tracks),
    };
    let (inertia, _, _) = values::scale(&nominal, &patched);
    let count = 1.0 / nominal.rig.encoder.counts_per_unit;
    let floor = estimator.counting(&fit_tracks, &patched.noise, count) * inertia;
    let mut table = FitTable {
        metric: "force_rmse".into(),
        unit: nominal.rig.kind.force().into(),
        nominal: both(&on_fit.nominal, &on_held.nominal),
        refit: both(&on_fit.refit, &on_held.refit),
        patched: both(&on_fit.patched, &on_held.patched),
        force_rms: both(&on_fit.force, &on_held.force),
        holdout_gain_ci95: [0.0, 0.0],
    };
    table.holdout_gain_ci95 = relative_gain(&estimator, &held_tracks, &on_held.refit, &on_held.patched);
    let maps =
        locate::maps((&fit_tracks, &on_fit.patched), (&held_tracks, &on_held.patched), nominal.rig.turn());
    s.fit_tracks = fit_tracks.clone();
    // What is left and hangs together over time, against what the effects explain: if most of it is left, the names
    // stand for something else.
    let explained = (table.refit.fit.powi(2) - table.patched.fit.powi(2)).max(0.0);
    let left = s.last.noise.slow * inertia * inertia;
    let leftover = Leftover {
        of_explained: if explained > 0.0 { left / explained } else { 0.0 },
        of_force: left.sqrt() / table.force_rms.fit.max(1e-300),
        unexplained: table.patched.holdout / table.refit.holdout.max(1e-300),
    };
    // A model that leaves much of the force, or much of what the refit left, has not understood it, whatever it names.
    let part_of_force = table.patched.holdout / table.force_rms.holdout.max(1e-300);
    let helps_much = table.patched.holdout < MUCH_OF_REFIT * table.refit.holdout;
    let understood = part_of_force < LITTLE_FORCE || (helps_much && part_of_force < MUCH_FORCE);
    let excitation = Excitation::of(&fit_tracks, count, nominal.rig.turn());
    let mut effects: Vec<(f64, Named)> = Vec::new();
    let mut hypotheses: Vec<Hypothesis> = Vec::new();
    for (i, one) in found.iter().enumerate() {
        let name = one.effect.name;
        let mut class = vec![name];
        let least = BEHIND.max(BEHIND_PART * (one.fit.sum + one.holdout.sum));
        let mut near: Vec<&Rival> = one.rivals.iter().filter(|r| r.z < BEHIND_Z || r.lead < least).collect();
        near.sort_by(|a, b| a.z.total_cmp(&b.z));
        // What no recording of motion tells apart: a drive that clips and a roller that slips at a constant force.
        if name == EffectName::CommandSaturation {
            class.push(EffectName::RollerSlip);
        }
        if name == EffectName::RollerSlip {
            class.push(EffectName::CommandSaturation);
        }
        class.extend(excitation.twin(name));
        // A spring that explains little of what it should explain may well have a gap.
        if name == EffectName::DriveCompliance && table.patched.fit.powi(2) > 0.3 * table.refit.fit.powi(2) {
            class.push(EffectName::Backlash);
        }
        for rival in near {
            if class.len() < 3 && !class.contains(&rival.name) {
                class.push(rival.name);
            }
        }
        let evidence = confidence::evidence(one, nearest_rival(one, &class), leftover);
        let named = Named {
            name,
            subsystem: name.subsystem(),
            confidence: confidence::confidence(&evidence),
            parameters: values::parameters(&bench, &patched, i),
            place: place(&s, &patched, i),
            separating_experiment: prescribe::separating(&class),
            class,
        };
        let doubt = if !understood {
            Some("with it the model still leaves too much of the force to have understood it".to_owned())
        } else if !is_there(&named) {
            Some("its size cannot be told from zero".to_owned())
        } else if named.confidence < NAMED {
            Some(format!("it is right with a probability of only {:.2}", named.confidence))
        } else {
            None
        };
        let may_be_judged = understood && is_there(&named);
        hypotheses.push(Hypothesis {
            name,
            holdout_gain: one.holdout.sum,
            evidence: may_be_judged.then_some(evidence),
            class: named.class.clone(),
            rejected_because: doubt.clone(),
        });
        if doubt.is_none() {
            effects.push((one.holdout.sum, named));
        }
    }
    effects.sort_by(|a, b| b.0.total_cmp(&a.0));
    let effects: Vec<Named> = effects.into_iter().map(|e| e.1).collect();
    let above = |x: f64| (x * x - floor * floor).max(0.0);
    let unexplained = {
        let before = above(table.nominal.holdout).max(above(table.refit.holdout));
        if before > 0.0 { (above(table.patched.holdout) / before).min(1.0) } else { 0.0 }
    };
    let carries = maps.iter().any(|m| m.significant && m.carries > 0.1);
    // What was found and is too unsure to be named still says that the mismatch repeats, if it explains much of it.
    let helps = !found.is_empty() && table.patched.holdout.powi(2) < REPEATS * table.refit.holdout.powi(2);
    let disturbed = above(table.patched.holdout).sqrt() > DISTURBED * table.force_rms.holdout;
    let refit_matters = refit_matters(&estimator, &held_tracks, &on_held, table.force_rms.holdout);
    // Where the inertia is hardly known the refit alone says little; elsewhere it must explain something.
    let judged = if nominal.anchor.is_some() { table.patched } else { table.refit };
    let foreign =
        judged.holdout > FOREIGN * table.force_rms.holdout && judged.fit > FOREIGN * table.force_rms.fit;
    if foreign {
        return Ok(Outcome::cannot_tell(
            &nominal.rig,
            format!(
                "the rig's model with refitted values leaves {:.0} % of the force unexplained, as it does where a unit is off (seconds, counts, command) or where the axis is moved by something that was not recorded",
                100.0 * judged.holdout / table.force_rms.holdout.max(1e-300)
            ),
        ));
    }
    let verdict = if !effects.is_empty() {
        Verdict::MissingPhysics
    } else if excitation.is_one_speed() {
        Verdict::InsufficientExcitation
    } else if (understood && helps) || (disturbed && carries) {
        Verdict::Unexplained
    } else if disturbed {
        Verdict::RandomDisturbance
    } else if refit_matters {
        Verdict::ParametersOnly
    } else {
        Verdict::NoMismatch
    };
    let cannot_tell = matches!(verdict, Verdict::InsufficientExcitation);
    for one in &found {
        for rival in &one.rivals {
            if found.iter().all(|f| f.effect.name != rival.name)
                && hypotheses.iter().all(|h| h.name != rival.name)
            {
                hypotheses.push(Hypothesis {
                    name: rival.name,
                    holdout_gain: one.holdout.sum - rival.lead,
                    evidence: None,
                    class: Vec::new(),
                    rejected_because: Some(format!(
                        "{} explains more by {:.1} standard errors",
                        one.effect.name, rival.z
                    )),
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
    let patched_rig = patch(&s, &patched);
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
        fit: table,
        refitted,
        residual_bandwidth_hz: estimator.bandwidth_hz,
        noise_floor: floor,
        unexplained_fraction: unexplained,
        hypotheses,
        place: top_place,
        separating_experiment: cannot_tell.then(|| prescribe::SPEEDS.to_owned()),
        reason: cannot_tell.then(|| excitation.one_speed()),
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

/// Interval of the relative reduction of the held-out mean square.
fn relative_gain(
    estimator: &Estimator,
    tracks: &[Track],
    before: &[Vec<f64>],
    after: &[Vec<f64>],
) -> [f64; 2] {
    let mut gains = Vec::new();
    let mut whole = 0.0;
    for ((track, a), b) in tracks.iter().zip(before).zip(after) {
        let moving = estimator.moving(track);
        for w in track.segments.windows(2) {
            let mut gain = 0.0;
            for j in w[0]..w[1] {
                if moving[j] {
                    gain += a[j] * a[j] - b[j] * b[j];
                    whole += a[j] * a[j];
                }
            }
            gains.push(gain);
        }
    }
    let gain = judge::bootstrap(&gains);
    // Nothing can take more than there is; some resamplings of few segments would.
    if whole > 0.0 { [gain.low, gain.high].map(|x| (x / whole).min(1.0)) } else { [0.0, 0.0] }
}
