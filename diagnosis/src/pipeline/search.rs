//! The second stage: effects are added one after another as long as one generalises to stretches of
//! the fitted recordings that were left out of its fit. Held-out recordings are read once, when all
//! are chosen: they take out what does not carry to them, and choose nothing.

use super::Progress;
use crate::decide::acceptance_criteria::gather_evidence;
use crate::decide::elimination::{Found, RejectedHypothesis, eliminate};
use crate::decide::rejection::Rejection;
use crate::decide::thresholds::MIN_LOG_LIKELIHOOD_GAIN;
use crate::evidence::holdout_set::HoldoutSet;
use crate::evidence::parameters;
use crate::evidence::prepared::Prepared;
use crate::evidence::residuals::forces;
use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::force_residual::Estimator;
use crate::fit::model::Model;
use crate::fit::noise::Colour;
use crate::laws::{Effect, EffectName};
use crate::propose::candidates;
use crate::propose::context::{FitContext, FittedModel, MOST_EFFECTS};
use crate::propose::predictive::left_out_costs;
use crate::propose::two_mass::in_its_own_motion;
use numerics::parallel;
use std::cell::Cell;

/// Most candidates that are judged per effect that may be named: who asks often enough hears a yes.
const TRIED: usize = 3;

/// The part of a diagnosis that is done when the search begins and when it ends, and the share of
/// the rest that each of its steps takes, for the progress that people see.
const BEGUN: f64 = 0.15;
const SEARCHED: f64 = 0.85;
const STEP: f64 = 0.15;
/// The stage that people see.
const SEARCHING: &str = "searching for what was left out";

/// Searches for the effects that explain what the nominal model leaves.
pub(crate) fn search(prepared: &Prepared, progress: Progress) -> Found {
    let search = Search { prepared, progress, done: Cell::new(BEGUN) };
    let mut tried = Tried::default();
    let grown = search.forward_selection(search.start(), &mut tried);
    search.report_progress("judging on held-out recordings");
    let mut found = search.backward_elimination(grown);
    found.standing.rejected.splice(..0, tried.rejected);
    found
}

/// The model as far as it has come, under white and under coloured noise, and the motion that goes
/// with it.
struct SearchState {
    white_fit: FittedModel,
    coloured_fit: FittedModel,
    tracks: Vec<BlockedRecording>,
    /// The fitted recordings, in the motions in which recordings judge.
    judging: HoldoutSet,
}

/// The candidates that were judged so far.
#[derive(Default)]
struct Tried {
    rejected: Vec<RejectedHypothesis>,
    /// The number of candidates that were judged.
    count: usize,
    /// True once plain forces were looked for together.
    plain: bool,
}

/// The model with one more effect.
struct Next {
    state: SearchState,
    /// True if the effect generalises to what its fit left out; otherwise it is likely to
    /// generalise together with another effect.
    generalises: bool,
}

struct Search<'a> {
    prepared: &'a Prepared,
    progress: Progress<'a>,
    /// The part of the whole diagnosis that is done, 0 to 1.
    done: Cell<f64>,
}

impl Search<'_> {
    /// Tells that a step is done. Nobody knows how many follow, so each takes the same share of the
    /// rest.
    fn report_progress(&self, stage: &str) {
        self.done.set(self.done.get() + STEP * (SEARCHED - self.done.get()));
        (self.progress)(stage, self.done.get());
    }

    fn context<'a>(&'a self, tracks: &'a [BlockedRecording]) -> FitContext<'a> {
        self.prepared.context(tracks)
    }

    /// The model without any effect.
    fn start(&self) -> SearchState {
        let Prepared { fit, noise, .. } = self.prepared;
        let context = self.context(fit);
        let white_fit = context.fit(Model::default(), noise, Colour::White);
        let coloured_fit = context.fit_coloured(Model::default(), &[noise, &white_fit.noise]);
        let judging = self.followed(&HoldoutSet::new(fit.clone()), &white_fit);
        SearchState { white_fit, coloured_fit, tracks: fit.clone(), judging }
    }

    /// Adds effects one after another as long as one generalises.
    fn forward_selection(&self, mut now: SearchState, tried: &mut Tried) -> SearchState {
        let mut before = None;
        while now.white_fit.model.effects.len() < MOST_EFFECTS {
            let step = now.white_fit.model.effects.len();
            let Some(next) = self.with_one_more(&now, tried, TRIED * (step + 1)) else { break };
            if !next.generalises && before.is_some() {
                break;
            }
            // Two equally large effects each fail alone, so the best candidate is kept for one more
            // step.
            let last = std::mem::replace(&mut now, next.state);
            before = (!next.generalises).then_some(last);
        }
        before.unwrap_or(now)
    }

    /// Removes the effects that do not generalise when all are judged together.
    fn backward_elimination(&self, now: SearchState) -> Found {
        let SearchState { white_fit, coloured_fit, tracks, .. } = now;
        let holdout = self.followed(&self.prepared.holdout, &white_fit);
        let context = self.context(&tracks);
        let null = context.fit_coloured(Model::default(), &[&self.prepared.noise, &white_fit.noise]);
        let standing = eliminate(coloured_fit, &context, &holdout, &null.noise, &white_fit.noise, &[]);
        Found { fit: tracks, holdout, null, standing }
    }

    /// Recordings that judge in the motion of a model.
    fn followed(&self, judging: &HoldoutSet, model: &FittedModel) -> HoldoutSet {
        let Prepared { nominal, span, scale, .. } = self.prepared;
        let mut judging = judging.clone();
        judging.follow(model, nominal, span, *scale);
        judging
    }

    /// The model with one more effect, if there is one that generalises or, failing that, promises
    /// to; at most `most` may have been judged by then.
    fn with_one_more(&self, now: &SearchState, tried: &mut Tried, most: usize) -> Option<Next> {
        let on = self.context(&now.tracks);
        self.report_progress(SEARCHING);
        let candidates = on.screen(&now.white_fit, &|_| true);
        self.report_progress(SEARCHING);
        let mut finalists = on.finalists(&now.white_fit, &candidates);
        self.report_progress(SEARCHING);
        on.polish(&mut finalists);
        order_near_ties(&on, now.white_fit.log_score, &mut finalists);
        if now.white_fit.model.effects.is_empty() && !tried.plain {
            tried.plain = true;
            let best = finalists.first().map_or(0.0, |best| best.log_score - now.white_fit.log_score);
            if let Some(next) = self.with_plain_forces(now, best) {
                return Some(next);
            }
        }
        let mut promising = None;
        for finalist in finalists {
            if finalist.log_score - now.white_fit.log_score < MIN_LOG_LIKELIHOOD_GAIN || tried.count >= most {
                break;
            }
            tried.count += 1;
            self.report_progress(SEARCHING);
            let name = finalist.model.effects.last().expect("a finalist adds an effect").name;
            let finalist = prefer_fewer_waves(&on, finalist);
            match self.judge(now, finalist, promising.is_none()) {
                Judged::Generalises(state) => return Some(Next { state, generalises: true }),
                Judged::Rejected { why, provisional } => {
                    tried.rejected.push(RejectedHypothesis { name, holdout_gain: None, why });
                    let next = |state| Next { state, generalises: false };
                    promising = promising.or_else(|| provisional.map(next));
                }
            }
        }
        promising
    }

    /// Judges a model with one more effect; where it is rejected and `may_promise`, it is kept if
    /// it may generalise together with another effect.
    fn judge(&self, now: &SearchState, finalist: FittedModel, may_promise: bool) -> Judged {
        let on = self.context(&now.tracks);
        let with = on.fit_coloured(finalist.model.clone(), &[&now.coloured_fit.noise, &finalist.noise]);
        if with.log_score - now.coloured_fit.log_score < MIN_LOG_LIKELIHOOD_GAIN {
            return Judged::Rejected { why: Rejection::SlowDisturbance, provisional: None };
        }
        let (tracks, white_fit) = in_its_own_motion(&now.tracks, finalist, &on);
        let own = self.context(&tracks);
        let judging = self.followed(&now.judging, &white_fit);
        let judged = gather_evidence(&own, &white_fit, &with.noise, &judging)
            .pop()
            .expect("the last effect is judged");
        let last = white_fit.model.effects.len() - 1;
        let rejection = judged.rejection_in_search();
        let is_absent = || parameters::is_absent(&own, &white_fit, last).then_some(Rejection::NoSize);
        let rejection = rejection.or_else(is_absent);
        let is_kept = rejection.is_none() || (may_promise && judged.is_provisional());
        let coloured_fit =
            is_kept.then(|| own.fit_coloured(white_fit.model.clone(), &[&with.noise, &white_fit.noise]));
        let state = coloured_fit.map(|coloured_fit| SearchState { white_fit, coloured_fit, tracks, judging });
        match (rejection, state) {
            (None, Some(state)) => Judged::Generalises(state),
            (why, provisional) => {
                Judged::Rejected { why: why.expect("what is not rejected is kept"), provisional }
            }
        }
    }

    /// The model with the best set of plain forces, where they gain enough compared with `best`,
    /// the most that any effect gains, and all of them generalise.
    fn with_plain_forces(&self, now: &SearchState, best: f64) -> Option<Next> {
        let on = self.context(&now.tracks);
        for white_fit in best_plain_models(&on, now) {
            let has_twin =
                |effect: &Effect| effect.name.definition().plain(effect).is_some_and(|it| it.has_twin);
            let enough =
                if white_fit.model.effects.iter().any(has_twin) { PLAIN_NEARLY_ALL } else { PLAIN_ENOUGH };
            let gain = white_fit.log_score - now.white_fit.log_score;
            if gain < MIN_LOG_LIKELIHOOD_GAIN || gain < enough * best {
                continue;
            }
            let (tracks, white_fit) = in_its_own_motion(&now.tracks, white_fit, &on);
            let own = self.context(&tracks);
            let judging = self.followed(&now.judging, &white_fit);
            let coloured_fit =
                own.fit_coloured(white_fit.model.clone(), &[&now.coloured_fit.noise, &white_fit.noise]);
            let judged = gather_evidence(&own, &white_fit, &coloured_fit.noise, &judging);
            let is_there = |place: usize| !parameters::is_absent(&own, &white_fit, place);
            if judged.iter().all(|judged| judged.rejection().is_none()) && (0..judged.len()).all(is_there) {
                let state = SearchState { white_fit, coloured_fit, tracks, judging };
                return Some(Next { state, generalises: true });
            }
        }
        None
    }
}

/// Returns the candidate, or its rival with one periodic law fewer where the stretches that a fit
/// leaves out are as likely with that.
fn prefer_fewer_waves(on: &FitContext, candidate: FittedModel) -> FittedModel {
    let Some(rival) = on.with_fewer_laws(&candidate) else { return candidate };
    let cost = |one: &FittedModel| left_out_costs(&one.fit).iter().sum::<f64>();
    if cost(&rival) <= cost(&candidate) { rival } else { candidate }
}

/// The judgement of a model with one more effect.
enum Judged {
    Generalises(SearchState),
    Rejected {
        why: Rejection,
        /// The model, where the effect may generalise together with another effect.
        provisional: Option<SearchState>,
    },
}

/// Most plain forces taken together.
const PLAIN_TOGETHER: usize = 3;
/// Part of what the best of all effects gains that plain friction and weight must gain to be taken
/// before it, and that forces with a twin in the library must.
const PLAIN_ENOUGH: f64 = 0.6;
const PLAIN_NEARLY_ALL: f64 = 0.9;

/// Sets of forces that any machine may have and the rig does not hold, as models. They are looked
/// for together before anything else: neither of two may show without the other.
fn plain_sets(on: &FitContext) -> Vec<Model> {
    let all = EffectName::ALL.iter().flat_map(|name| candidates::shapes(*name, on.span, on.nominal));
    let ranked = |effect: Effect| Some((effect.name.definition().plain(&effect)?.rank, effect));
    let mut plain: Vec<(u8, Effect)> = all.filter_map(ranked).collect();
    plain.sort_by_key(|(rank, _)| *rank);
    let mut sets: Vec<Vec<Effect>> = vec![Vec::new()];
    for (_, effect) in plain {
        let extended = |set: &Vec<Effect>| {
            let fits = set.len() < PLAIN_TOGETHER && set.iter().all(|other| other.name != effect.name);
            fits.then(|| set.iter().chain([&effect]).cloned().collect::<Vec<_>>())
        };
        sets.extend(sets.iter().filter_map(extended).collect::<Vec<_>>());
    }
    sets.into_iter().skip(1).map(|effects| Model { effects, ..Model::default() }).collect()
}

/// The best model of each number of plain forces under its own noise, best first.
fn best_plain_models(on: &FitContext, now: &SearchState) -> Vec<FittedModel> {
    let mut ranked =
        parallel::map_all(&plain_sets(on), |model| on.fit_at(model.clone(), &now.white_fit.noise));
    ranked.retain(|fitted| fitted.log_score - now.white_fit.log_score > MIN_LOG_LIKELIHOOD_GAIN);
    ranked.sort_by(|a, b| b.log_score.total_cmp(&a.log_score));
    let mut sizes: Vec<usize> = Vec::new();
    let mut fitted: Vec<FittedModel> = Vec::new();
    for one in ranked {
        if !sizes.contains(&one.model.effects.len()) {
            sizes.push(one.model.effects.len());
            fitted.push(on.fit(one.model, &now.white_fit.noise, Colour::White));
        }
    }
    fitted.sort_by(|a, b| b.log_score.total_cmp(&a.log_score));
    fitted
}

/// Candidates whose gain is this part of the best one's are near ties.
const NEAR_TIE: f64 = 0.9;

/// Puts near ties in the order of the force that they leave on the fitted recordings: what they
/// gain on the noise of a null that explains little says less.
fn order_near_ties(context: &FitContext, before: f64, finalists: &mut [FittedModel]) {
    let Some(best) = finalists.first().map(|c| c.log_score - before) else { return };
    let near = finalists.iter().take_while(|c| c.log_score - before >= NEAR_TIE * best).count();
    if near < 2 {
        return;
    }
    let estimator = Estimator::new(context.tracks, &finalists[0].noise, context.scale);
    let error_left = |c: &FittedModel| {
        let inertia = parameters::scale(context.nominal, c).0;
        let totals = c.fit.totals(context.tracks);
        estimator.rms(&forces(&estimator, context.tracks, &totals, inertia), context.tracks)
    };
    finalists[..near].sort_by_cached_key(|c| error_left(c).to_bits());
}

#[cfg(test)]
mod tests;
