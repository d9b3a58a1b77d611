//! The stages one after another: read, null, search, judge, and what is handed on to the report.

use crate::effects::definition::Span;
use crate::effects::{Effect, EffectName};
use crate::estimation::blocked_recording::BlockedRecording;
use crate::estimation::filter::{Knows, Noise};
use crate::estimation::fit::Fit;
use crate::estimation::force_residual::Estimator;
use crate::estimation::lost_counts::{self, Asked};
use crate::estimation::model::{Model, Nominal};
use crate::estimation::noise::Colour;
use crate::estimation::{quasi_static, refit};
use crate::io::error::InputError;
use crate::io::recording::Recording;
use crate::io::rig::Rig;
use crate::selection::candidates::span_of;
use crate::selection::context::{FitContext, FittedModel, MOST};
use crate::selection::{candidates, joint};
use crate::thresholds::MIN_LOG_LIKELIHOOD_GAIN;
use crate::validation::evidence::EffectEvidence;
use crate::validation::held_out::HeldOut;
use crate::validation::judge::judge_all;
use crate::validation::parameters;
use crate::validation::rejection::Rejection;
use crate::validation::residuals::{drive_force, forces};
use rayon::prelude::*;

/// How many candidates are judged per effect that may be named: who asks often enough hears a yes.
const TRIED: usize = 3;

/// What the search ends with.
pub(crate) struct Search {
    /// The rig as it was read.
    pub(crate) original: Rig,
    pub(crate) nominal: Nominal,
    pub(crate) fit_tracks: Vec<BlockedRecording>,
    pub(crate) holdout_tracks: HeldOut,
    pub(crate) span: Span,
    /// The null under coloured noise.
    pub(crate) null: FittedModel,
    /// The final model under coloured noise.
    pub(crate) last: FittedModel,
    pub(crate) found: Vec<EffectEvidence>,
    /// Hypotheses that were fitted in full and rejected: name, gain, and why.
    pub(crate) rejected: Vec<(EffectName, Option<f64>, Rejection)>,
}

/// Fitted recordings smoothed with a model fitted to them, and the model fitted again: what a null leaves out is noise to
/// its smoother, and next to rest and reversals such a smoother knows neither the speed nor its sign.
fn in_its_own_motion(
    tracks: &[BlockedRecording],
    candidate: FittedModel,
    on: &FitContext,
) -> (Vec<BlockedRecording>, FittedModel) {
    let mut own = tracks.to_vec();
    let count = 1.0 / on.nominal.rig.encoder.counts_per_unit;
    refit::estimate_motion(&mut own, &candidate.fit.totals(tracks), &candidate.noise, count, Knows::All);
    let context = FitContext { tracks: &own, ..*on };
    let again = context.fit(candidate.model, &candidate.noise, Colour::White);
    let again = joint::settled(&context, again);
    (own, again)
}

/// Part of the force that a refit may leave for the forces to be in balance.
const BALANCED: f64 = 0.5;

fn is_balanced(
    refit: &Fit,
    nominal: &Nominal,
    tracks: &[BlockedRecording],
    noise: &Noise,
    scale: f64,
) -> bool {
    let estimator = Estimator::new(tracks, noise, scale);
    let left = forces(&estimator, tracks, &refit.totals(tracks), nominal.rig.model.inertia);
    let force = drive_force(nominal, &estimator, tracks);
    estimator.rms(&left, tracks) < BALANCED * estimator.rms(&force, tracks)
}

/// Looks for lost counts in every recording under the null, and again with the noise that is left without them and with
/// the knowledge that counts get lost; gives how many are lost at a time, as travel. Held-out recordings take that, `spread`, from
/// the fitted ones.
fn find_steps(
    nominal: &Nominal,
    span: &Span,
    tracks: &mut [BlockedRecording],
    noise: &Noise,
    scale: f64,
    mut asked: Asked,
    spread: Option<f64>,
) -> Option<f64> {
    let mut noise = *noise;
    let mut sizes = Vec::new();
    for _ in 0..2 {
        sizes.clear();
        for track in tracks.iter_mut() {
            let alone = std::slice::from_ref(&*track);
            let fit = Fit::new(&Model::default(), nominal, alone, &noise);
            let found = lost_counts::find(track, &fit, span.count, asked, spread);
            (track.jumps.lost, track.jumps.price) = (found.lost, found.price);
            sizes.extend(found.sizes);
        }
        if sizes.is_empty() {
            return None;
        }
        asked = Asked::KNOWN;
        let of_jumps = EffectName::ALL.iter().filter(|name| name.definition().is_of_jumps());
        let effects = of_jumps.map(|name| Effect::shaped(*name, &[])).collect();
        let model = Model { effects, ..Model::default() };
        let totals = Fit::new(&model, nominal, tracks, &noise).totals(tracks);
        noise = crate::estimation::noise::estimate(tracks, &totals, &noise, scale, Colour::White);
    }
    Some(lost_counts::spread_of(&sizes, span.count))
}

/// The model as far as it has come, under white and under coloured noise, and the motion that goes with it.
struct SearchState {
    white: FittedModel,
    slow: FittedModel,
    tracks: Vec<BlockedRecording>,
    holdout: HeldOut,
}

/// What was looked at and not taken.
#[derive(Default)]
struct Rejected {
    names: Vec<(EffectName, Option<f64>, Rejection)>,
    tried: usize,
    /// Whether plain forces were looked for together.
    plain_tried: bool,
    /// What stood and excluded: not looked at again.
    excluded: Vec<EffectName>,
}

/// The model with one more effect.
struct Next {
    state: SearchState,
    /// Whether the effect generalises to the held-out recordings, rather than being likely to beside another.
    generalises: bool,
}

/// Most plain forces taken together.
const PLAIN_TOGETHER: usize = 3;
/// Part of what the best of all effects gains that plain friction and weight must gain to be taken before it, and that
/// forces with a twin in the library must.
const PLAIN_ENOUGH: f64 = 0.6;
const PLAIN_NEARLY_ALL: f64 = 0.9;

/// Sets of forces that any machine may have and the rig does not hold, as models. They are looked for together before anything
/// else: neither of two may show without the other.
fn plain_sets(on: &FitContext) -> Vec<Model> {
    let all = EffectName::ALL.iter().flat_map(|name| candidates::shapes(*name, on.span, on.nominal));
    let ranked = |effect: Effect| Some((effect.name.definition().plain(&effect)?.rank, effect));
    let mut plain: Vec<(u8, Effect)> = all.filter_map(ranked).collect();
    plain.sort_by_key(|(rank, _)| *rank);
    let mut sets: Vec<Vec<Effect>> = vec![Vec::new()];
    for (_, effect) in plain {
        let with = |set: &Vec<Effect>| {
            let fits = set.len() < PLAIN_TOGETHER && set.iter().all(|other| other.name != effect.name);
            fits.then(|| set.iter().chain([&effect]).cloned().collect::<Vec<_>>())
        };
        sets.extend(sets.iter().filter_map(with).collect::<Vec<_>>());
    }
    sets.into_iter().skip(1).map(|effects| Model { effects, ..Model::default() }).collect()
}

/// The model with the best set of plain forces, where they gain enough beside `best`, what any effect gains at the most, and
/// all of them generalise.
fn with_plain_forces(now: &SearchState, on: &FitContext, best: f64) -> Option<Next> {
    let mut ranked: Vec<FittedModel> = plain_sets(on)
        .into_par_iter()
        .map(|model| on.fit_at(model, &now.white.noise))
        .filter(|fitted| fitted.merit - now.white.merit > MIN_LOG_LIKELIHOOD_GAIN)
        .collect();
    ranked.sort_by(|a, b| b.merit.total_cmp(&a.merit));
    let mut sizes: Vec<usize> = Vec::new();
    let mut fitted: Vec<FittedModel> = Vec::new();
    for one in ranked {
        if !sizes.contains(&one.model.effects.len()) {
            sizes.push(one.model.effects.len());
            fitted.push(on.fit(one.model, &now.white.noise, Colour::White));
        }
    }
    fitted.sort_by(|a, b| b.merit.total_cmp(&a.merit));
    for white in fitted {
        let has_twin = |effect: &Effect| effect.name.definition().plain(effect).is_some_and(|it| it.has_twin);
        let enough = if white.model.effects.iter().any(has_twin) { PLAIN_NEARLY_ALL } else { PLAIN_ENOUGH };
        let gain = white.merit - now.white.merit;
        if gain < MIN_LOG_LIKELIHOOD_GAIN || gain < enough * best {
            continue;
        }
        let (tracks, white) = in_its_own_motion(&now.tracks, white, on);
        let own = FitContext { tracks: &tracks, ..*on };
        let mut holdout = now.holdout.clone();
        holdout.follow(&white, on.nominal, on.span, on.scale);
        let slow = own.fit_slow(white.model.clone(), &[&now.slow.noise, &white.noise]);
        let judged = judge_all(&own, &white, &slow.noise, &holdout);
        if judged.iter().all(|judged| judged.rejection().is_none()) {
            return Some(Next { state: SearchState { white, slow, tracks, holdout }, generalises: true });
        }
    }
    None
}

/// The model with one more effect, if there is one that generalises or, failing that, promises to; at most `most` may have
/// been tried by then.
fn with_one_more(now: &SearchState, on: &FitContext, rejected: &mut Rejected, most: usize) -> Option<Next> {
    let mut promising = None;
    let candidates = on.screen(&now.white, &|name| !rejected.excluded.contains(&name));
    let mut finalists = on.finalists(&now.white, &candidates);
    on.polish(&mut finalists);
    order_near_ties(on, now.white.merit, &mut finalists);
    if now.white.model.effects.is_empty() && !rejected.plain_tried {
        rejected.plain_tried = true;
        let best = finalists.first().map_or(0.0, |best| best.merit - now.white.merit);
        if let Some(next) = with_plain_forces(now, on, best) {
            return Some(next);
        }
    }
    for finalist in finalists {
        let name = finalist.model.effects.last().expect("a finalist adds an effect").name;
        if finalist.merit - now.white.merit < MIN_LOG_LIKELIHOOD_GAIN || rejected.tried >= most {
            break;
        }
        rejected.tried += 1;
        let with = on.fit_slow(finalist.model.clone(), &[&now.slow.noise, &finalist.noise]);
        let gain = with.merit - now.slow.merit;
        if gain < MIN_LOG_LIKELIHOOD_GAIN {
            rejected.names.push((name, None, Rejection::SlowDisturbance));
            continue;
        }
        let (tracks, white) = in_its_own_motion(&now.tracks, finalist, on);
        let own = FitContext { tracks: &tracks, ..*on };
        let mut holdout = now.holdout.clone();
        holdout.follow(&white, on.nominal, on.span, on.scale);
        let judged = judge_all(&own, &white, &with.noise, &holdout).pop().expect("the last effect is judged");
        let rejection =
            judged.rejection().or_else(|| parameters::absence(&own, &white, white.model.effects.len() - 1));
        if rejection.is_none() || (promising.is_none() && judged.is_provisional()) {
            let slow = own.fit_slow(white.model.clone(), &[&with.noise, &white.noise]);
            let generalises = rejection.is_none();
            let next = Next { state: SearchState { white, slow, tracks, holdout }, generalises };
            if generalises {
                return Some(next);
            }
            promising = Some(next);
        }
        if let Some(why) = rejection {
            rejected.names.push((name, Some(judged.holdout.sum), why));
        }
    }
    promising
}

pub(crate) fn search(
    rig: &Rig,
    fit: &[Recording],
    holdout: &[Recording],
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Result<Search, InputError> {
    let mut tracks: Vec<BlockedRecording> = fit.iter().map(|r| BlockedRecording::moving(r, rig)).collect();
    let mut holdout: Vec<BlockedRecording> =
        holdout.iter().map(|r| BlockedRecording::moving(r, rig)).collect();
    let mut nominal =
        Nominal { rig: rig.clone(), external: 0.0, anchor: None, is_balanced: false, virtual_inertia: 0.0 };
    quasi_static::add_inertia(&mut nominal, &mut tracks, &mut holdout);
    progress("refitting the nominal model", 0.1);
    let (noise, refit) = refit::settle(&mut nominal, &mut tracks);
    let scale = refit::acceleration_scale(&nominal, &tracks);
    nominal.is_balanced = is_balanced(&refit, &nominal, &tracks, &noise, scale);
    let span = span_of(&tracks, &nominal);
    let spread = find_steps(&nominal, &span, &mut tracks, &noise, scale, Asked::UNKNOWN, None);
    let asked = if spread.is_some() { Asked::KNOWN } else { Asked::UNKNOWN };
    let first = Fit::new(&Model::default(), &nominal, &tracks, &noise);
    let first = FittedModel { model: Model::default(), noise, fit: first, merit: 0.0 };
    let mut holdout = HeldOut::new(holdout);
    holdout.follow(&first, &nominal, &span, scale);
    find_steps(&nominal, &span, &mut holdout.filtered, &noise, scale, asked, spread);
    holdout.share_jumps();
    for (r, track) in tracks.iter_mut().enumerate() {
        (track.place, track.bias) = (Some(r), first.fit.bias(r));
    }
    let context = FitContext { nominal: &nominal, tracks: &tracks, span: &span, scale };
    let white = context.fit(Model::default(), &noise, Colour::White);
    let slow = context.fit_slow(Model::default(), &[&noise, &white.noise]);
    let ground =
        SearchContext { original: rig, nominal: &nominal, span: &span, scale, noise: &noise, progress };
    let mut rejected = Rejected::default();
    let grown = ground.forward_selection(SearchState { white, slow, tracks, holdout }, &mut rejected);
    progress("judging on held-out recordings", 0.8);
    let mut s = ground.backward_elimination(grown);
    rejected.excluded = s.rejected.iter().map(|(name, _, _)| *name).collect();
    if !s.found.is_empty() && !rejected.excluded.is_empty() {
        // What went may have stood in the place of something else.
        rejected.tried = 0;
        let mut again =
            ground.backward_elimination(ground.forward_selection(ground.state(&s), &mut rejected));
        if again.found.len() > s.found.len() {
            again.rejected.splice(..0, s.rejected);
            s = again;
        }
    }
    s.rejected.splice(..0, rejected.names);
    Ok(s)
}

/// What every model of a search stands on.
struct SearchContext<'a> {
    original: &'a Rig,
    nominal: &'a Nominal,
    span: &'a Span,
    scale: f64,
    /// White, of the null.
    noise: &'a Noise,
    progress: &'a (dyn Fn(&str, f64) + Sync),
}

impl SearchContext<'_> {
    fn context<'a>(&'a self, tracks: &'a [BlockedRecording]) -> FitContext<'a> {
        FitContext { nominal: self.nominal, tracks, span: self.span, scale: self.scale }
    }

    /// Adds effects one after another as long as one generalises.
    fn forward_selection(&self, mut now: SearchState, rejected: &mut Rejected) -> SearchState {
        let mut before = None;
        while now.white.model.effects.len() < MOST {
            let step = now.white.model.effects.len();
            (self.progress)("searching for what was left out", 0.15 + 0.2 * step as f64);
            let Some(next) = with_one_more(&now, &self.context(&now.tracks), rejected, TRIED * (step + 1))
            else {
                break;
            };
            if !next.generalises && before.is_some() {
                break;
            }
            // Of two effects as large as each other neither generalises alone: what promises stands until one more step decides.
            let last = std::mem::replace(&mut now, next.state);
            before = (!next.generalises).then_some(last);
        }
        before.unwrap_or(now)
    }

    /// What of a model stands when all its effects are judged together.
    fn backward_elimination(&self, now: SearchState) -> Search {
        let SearchState { white, slow, tracks, holdout } = now;
        let context = self.context(&tracks);
        let null = context.fit_slow(Model::default(), &[self.noise, &white.noise]);
        let mut s = Search {
            original: self.original.clone(),
            nominal: self.nominal.clone(),
            fit_tracks: Vec::new(),
            holdout_tracks: HeldOut::default(),
            span: self.span.clone(),
            null,
            last: slow,
            found: Vec::new(),
            rejected: Vec::new(),
        };
        eliminate(&mut s, &context, &holdout, &white.noise);
        (s.fit_tracks, s.holdout_tracks) = (tracks, holdout);
        s
    }

    /// What stands, in its own motion.
    fn state(&self, s: &Search) -> SearchState {
        let context = self.context(&s.fit_tracks);
        let fitted = context.fit(s.last.model.clone(), self.noise, Colour::White);
        let (tracks, white) = in_its_own_motion(&s.fit_tracks, fitted, &context);
        let mut holdout = s.holdout_tracks.clone();
        holdout.follow(&white, self.nominal, self.span, self.scale);
        let slow = self.context(&tracks).fit_slow(white.model.clone(), &[&s.last.noise, &white.noise]);
        SearchState { white, slow, tracks, holdout }
    }
}

/// Takes out whatever does not carry to the held-out recordings, the weakest first, until all that is left does, and
/// judges that; `noise` is white.
pub(crate) fn eliminate(s: &mut Search, context: &FitContext, holdout: &HeldOut, noise: &Noise) {
    loop {
        let plain = context.fit(s.last.model.clone(), noise, Colour::White);
        s.found = judge_all(context, &plain, &s.last.noise, holdout);
        let weakest = s
            .found
            .iter()
            .enumerate()
            .filter_map(|(i, f)| {
                let reason = f.rejection().or_else(|| parameters::absence(context, &plain, i))?;
                Some((i, f.holdout.z, reason))
            })
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((i, _, reason)) = weakest else { return };
        s.rejected.push((s.found[i].effect.name, Some(s.found[i].holdout.sum), reason));
        let mut model = s.last.model.clone();
        model.effects.remove(i);
        s.last = context.fit_slow(model, &[&s.null.noise, noise]);
    }
}

/// Candidates whose gain is this part of the best one's are near ties.
const NEAR_TIE: f64 = 0.9;

/// Puts near ties in the order of the force that they leave on the fitted recordings: what they gain on the noise of a
/// null that explains little says less.
fn order_near_ties(context: &FitContext, before: f64, finalists: &mut [FittedModel]) {
    let Some(best) = finalists.first().map(|c| c.merit - before) else { return };
    let near = finalists.iter().take_while(|c| c.merit - before >= NEAR_TIE * best).count();
    if near < 2 {
        return;
    }
    let estimator = Estimator::new(context.tracks, &finalists[0].noise, context.scale);
    let left = |c: &FittedModel| {
        let inertia = parameters::scale(context.nominal, c).0;
        let totals = c.fit.totals(context.tracks);
        estimator.rms(&forces(&estimator, context.tracks, &totals, inertia), context.tracks)
    };
    finalists[..near].sort_by_cached_key(|c| left(c).to_bits());
}
