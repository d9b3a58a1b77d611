//! The stages one after another: read, null, search, judge, and what is handed on to the report.

use crate::effects::{Effect, EffectName};
use crate::error::InputError;
use crate::estimate::Estimator;
use crate::fit::Fit;
use crate::found::{Found, judge_all, lay_all};
use crate::joint;
use crate::kalman::Noise;
use crate::known::known;
use crate::library::Span;
use crate::model::{Model, Nominal};
use crate::noise::Colour;
use crate::null;
use crate::recording::Recording;
use crate::residuals::{drive_force, forces};
use crate::rig::Rig;
use crate::select::{Bench, Candidate, MOST};
use crate::steps::{self, Asked};
use crate::track::{Total, Track};
use crate::values;

/// Least gain of log-likelihood under coloured noise, after the cost of freedom, for an effect to be looked at on.
pub(crate) const WORTH: f64 = 6.0;

/// How many candidates are judged per effect that may be named: who asks often enough hears a yes.
const TRIED: usize = 3;

/// What the search ends with.
pub(crate) struct Search {
    pub(crate) nominal: Nominal,
    pub(crate) fit_tracks: Vec<Track>,
    pub(crate) held_tracks: Vec<Track>,
    pub(crate) span: Span,
    /// The null under coloured noise.
    pub(crate) null: Candidate,
    /// The final model under coloured noise.
    pub(crate) last: Candidate,
    pub(crate) found: Vec<Found>,
    /// Hypotheses that were fitted in full and lost: name, gain, reason.
    pub(crate) lost: Vec<(EffectName, f64, String)>,
}

/// Smooths held-out recordings with a fitted model; `scale` is the acceleration that the command makes.
fn smooth_held(candidate: &Candidate, nominal: &Nominal, span: &Span, tracks: &mut [Track], scale: f64) {
    let count = 1.0 / nominal.rig.encoder.counts_per_unit;
    // The first look trusts no friction: its sign is not known yet, and a filter that believes in the wrong one keeps to it.
    let drives: Vec<Total> = tracks.iter().map(|track| Total::of_command(track, nominal.gain())).collect();
    null::resmooth(tracks, &drives, &crate::noise::guess(tracks, scale), count);
    for _ in 0..3 {
        let laid = lay_all(candidate, nominal, &known(tracks, &candidate.model, span), &candidate.noise);
        for (track, laid) in tracks.iter_mut().zip(&laid) {
            track.bias = laid.bias;
        }
        let totals: Vec<Total> = laid.into_iter().map(|laid| laid.total).collect();
        null::resmooth(tracks, &totals, &candidate.noise, count);
    }
}

/// Fitted recordings smoothed with a model fitted to them, and the model fitted again: what a null leaves out is noise to
/// its smoother, and next to rest and reversals such a smoother knows neither the speed nor its sign.
fn in_its_own_motion(tracks: &[Track], candidate: Candidate, on: &Bench) -> (Vec<Track>, Candidate) {
    let mut own = tracks.to_vec();
    let count = 1.0 / on.nominal.rig.encoder.counts_per_unit;
    null::resmooth(&mut own, &candidate.fit.totals(tracks), &candidate.noise, count);
    let bench = Bench { tracks: &own, ..*on };
    let again = bench.fit(candidate.model, &candidate.noise, Colour::White);
    let again = joint::settled(&bench, again);
    (own, again)
}

/// Part of the force that a refit may leave for the forces to be in balance.
const BALANCED: f64 = 0.5;

fn is_balanced(refit: &Fit, nominal: &Nominal, tracks: &[Track], noise: &Noise, scale: f64) -> bool {
    let estimator = Estimator::new(tracks, noise, scale);
    let left = forces(&estimator, tracks, &refit.totals(tracks), nominal.rig.model.inertia);
    let force = drive_force(nominal, &estimator, tracks);
    estimator.rms(&left, tracks) < BALANCED * estimator.rms(&force, tracks)
}

fn loses_counts(tracks: &[Track]) -> bool {
    tracks.iter().any(|track| track.lost.iter().any(|lost| *lost != 0.0))
}

/// Looks for lost counts in every recording under the null, and again with the noise that is left without them and with
/// the knowledge that counts get lost.
fn find_steps(
    nominal: &Nominal,
    span: &Span,
    tracks: &mut [Track],
    noise: &Noise,
    scale: f64,
    mut asked: Asked,
) {
    let mut noise = *noise;
    for _ in 0..2 {
        for track in tracks.iter_mut() {
            let alone = std::slice::from_ref(&*track);
            let fit = Fit::new(&Model::default(), nominal, alone, &noise);
            track.lost = steps::find(track, &fit, span.count, asked);
        }
        if !loses_counts(tracks) {
            return;
        }
        asked = Asked::KNOWN;
        let model =
            Model { effects: vec![Effect::shaped(EffectName::MissedCounts, &[])], ..Model::default() };
        let totals = Fit::new(&model, nominal, tracks, &noise).totals(tracks);
        noise = crate::noise::estimate(tracks, &totals, &noise, scale, Colour::White);
    }
}

/// The model as far as it has come, under white and under coloured noise, and the motion that goes with it.
struct Standing {
    white: Candidate,
    slow: Candidate,
    tracks: Vec<Track>,
    held: Vec<Track>,
}

/// What was looked at and not taken.
#[derive(Default)]
struct Lost {
    names: Vec<(EffectName, f64, String)>,
    tried: usize,
    /// What stood and went: not looked at again.
    went: Vec<EffectName>,
}

/// The model with one more effect.
struct Next {
    standing: Standing,
    /// Whether the effect carries to the held-out recordings, rather than being likely to beside another.
    carries: bool,
}

/// The model with one more effect, if there is one that carries or, failing that, promises to; at most `most` may have
/// been tried by then.
fn with_one_more(now: &Standing, on: &Bench, lost: &mut Lost, most: usize) -> Option<Next> {
    let mut promising = None;
    let candidates = on.screen(&now.white, &|name| !lost.went.contains(&name));
    let mut finalists = on.finalists(&now.white, &candidates);
    on.polish(&mut finalists);
    order_near_ties(on, now.white.merit, &mut finalists);
    for finalist in finalists {
        let name = finalist.model.effects.last().expect("a finalist adds an effect").name;
        if finalist.merit - now.white.merit < WORTH || lost.tried >= most {
            break;
        }
        lost.tried += 1;
        let with = on.fit_slow(finalist.model.clone(), &[&now.slow.noise, &finalist.noise]);
        let gain = with.merit - now.slow.merit;
        if gain < WORTH {
            lost.names.push((name, gain, "what it explains is no more than a slow disturbance would".into()));
            continue;
        }
        let (tracks, white) = in_its_own_motion(&now.tracks, finalist, on);
        let own = Bench { tracks: &tracks, ..*on };
        let mut held = now.held.clone();
        smooth_held(&white, on.nominal, on.span, &mut held, on.scale);
        let judged = judge_all(&own, &white, &held).pop().expect("the last effect is judged");
        let weakness =
            judged.weakness().or_else(|| values::absence(&own, &white, white.model.effects.len() - 1));
        if weakness.is_none() || (promising.is_none() && judged.promises()) {
            let slow = own.fit_slow(white.model.clone(), &[&with.noise, &white.noise]);
            let carries = weakness.is_none();
            let next = Next { standing: Standing { white, slow, tracks, held }, carries };
            if carries {
                return Some(next);
            }
            promising = Some(next);
        }
        if let Some(reason) = weakness {
            lost.names.push((name, judged.holdout.sum, reason));
        }
    }
    promising
}

pub(crate) fn search(
    rig: &Rig,
    fit: &[Recording],
    held: &[Recording],
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Result<Search, InputError> {
    let mut tracks: Vec<Track> = fit.iter().map(|r| Track::new(r, rig)).collect();
    let mut held: Vec<Track> = held.iter().map(|r| Track::new(r, rig)).collect();
    let mut nominal = Nominal { rig: rig.clone(), external: 0.0, anchor: None, is_balanced: false };
    progress("refitting the nominal model", 0.1);
    let (noise, refit) = null::settle(&mut nominal, &mut tracks);
    let scale = null::command_scale(&nominal, &tracks);
    nominal.is_balanced = is_balanced(&refit, &nominal, &tracks, &noise, scale);
    let span = Span::of(&tracks, &nominal);
    find_steps(&nominal, &span, &mut tracks, &noise, scale, Asked::UNKNOWN);
    let asked = if loses_counts(&tracks) { Asked::KNOWN } else { Asked::UNKNOWN };
    let first = Fit::new(&Model::default(), &nominal, &tracks, &noise);
    let first = Candidate { model: Model::default(), noise, fit: first, merit: 0.0 };
    smooth_held(&first, &nominal, &span, &mut held, scale);
    find_steps(&nominal, &span, &mut held, &noise, scale, asked);
    for (r, track) in tracks.iter_mut().enumerate() {
        (track.place, track.bias) = (Some(r), first.fit.bias(r));
    }
    let bench = Bench { nominal: &nominal, tracks: &tracks, span: &span, scale };
    let white = bench.fit(Model::default(), &noise, Colour::White);
    let slow = bench.fit_slow(Model::default(), &[&noise, &white.noise]);
    let ground = Ground { nominal: &nominal, span: &span, scale, noise: &noise, progress };
    let mut lost = Lost::default();
    let grown = ground.grow(Standing { white, slow, tracks, held }, &mut lost);
    progress("judging on held-out recordings", 0.8);
    let mut s = ground.pruned(grown);
    lost.went = s.lost.iter().map(|(name, _, _)| *name).collect();
    if !s.found.is_empty() && !lost.went.is_empty() {
        // What went may have stood in the place of something else.
        lost.tried = 0;
        let mut again = ground.pruned(ground.grow(ground.standing(&s), &mut lost));
        if again.found.len() > s.found.len() {
            again.lost.splice(..0, s.lost);
            s = again;
        }
    }
    s.lost.splice(..0, lost.names);
    Ok(s)
}

/// What every model of a search stands on.
struct Ground<'a> {
    nominal: &'a Nominal,
    span: &'a Span,
    scale: f64,
    /// White, of the null.
    noise: &'a Noise,
    progress: &'a (dyn Fn(&str, f64) + Sync),
}

impl Ground<'_> {
    fn bench<'a>(&'a self, tracks: &'a [Track]) -> Bench<'a> {
        Bench { nominal: self.nominal, tracks, span: self.span, scale: self.scale }
    }

    /// Adds effects one after another as long as one carries.
    fn grow(&self, mut now: Standing, lost: &mut Lost) -> Standing {
        let mut before = None;
        for step in now.white.model.effects.len()..MOST {
            (self.progress)("searching for what was left out", 0.15 + 0.2 * step as f64);
            let Some(next) = with_one_more(&now, &self.bench(&now.tracks), lost, TRIED * (step + 1)) else {
                break;
            };
            if !next.carries && before.is_some() {
                break;
            }
            // Of two effects as large as each other neither carries alone: what promises stands until one more step decides.
            let last = std::mem::replace(&mut now, next.standing);
            before = (!next.carries).then_some(last);
        }
        before.unwrap_or(now)
    }

    /// What of a model stands when all its effects are judged together.
    fn pruned(&self, now: Standing) -> Search {
        let Standing { white, slow, tracks, held } = now;
        let bench = self.bench(&tracks);
        let null = bench.fit_slow(Model::default(), &[self.noise, &white.noise]);
        let mut s = Search {
            nominal: self.nominal.clone(),
            fit_tracks: Vec::new(),
            held_tracks: Vec::new(),
            span: self.span.clone(),
            null,
            last: slow,
            found: Vec::new(),
            lost: Vec::new(),
        };
        prune(&mut s, &bench, &held, &white.noise);
        (s.fit_tracks, s.held_tracks) = (tracks, held);
        s
    }

    /// What stands, in its own motion.
    fn standing(&self, s: &Search) -> Standing {
        let bench = self.bench(&s.fit_tracks);
        let fitted = bench.fit(s.last.model.clone(), self.noise, Colour::White);
        let (tracks, white) = in_its_own_motion(&s.fit_tracks, fitted, &bench);
        let mut held = s.held_tracks.clone();
        smooth_held(&white, self.nominal, self.span, &mut held, self.scale);
        let slow = self.bench(&tracks).fit_slow(white.model.clone(), &[&s.last.noise, &white.noise]);
        Standing { white, slow, tracks, held }
    }
}

/// Takes out whatever does not carry to the held-out recordings, the weakest first, until all that is left does, and
/// judges that; `noise` is white.
pub(crate) fn prune(s: &mut Search, bench: &Bench, held: &[Track], noise: &Noise) {
    loop {
        let plain = bench.fit(s.last.model.clone(), noise, Colour::White);
        s.found = judge_all(bench, &plain, held);
        let weakest = s
            .found
            .iter()
            .enumerate()
            .filter_map(|(i, f)| {
                let reason = f.weakness().or_else(|| values::absence(bench, &plain, i))?;
                Some((i, f.holdout.z, reason))
            })
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((i, _, reason)) = weakest else { return };
        s.lost.push((s.found[i].effect.name, s.found[i].holdout.sum, reason));
        let mut model = s.last.model.clone();
        model.effects.remove(i);
        s.last = bench.fit_slow(model, &[&s.null.noise, noise]);
    }
}

/// Candidates whose gain is this part of the best one's are near ties.
const NEAR_TIE: f64 = 0.9;

/// Puts near ties in the order of the force that they leave on the fitted recordings: what they gain on the noise of a
/// null that explains little says less.
fn order_near_ties(bench: &Bench, before: f64, finalists: &mut [Candidate]) {
    let Some(best) = finalists.first().map(|c| c.merit - before) else { return };
    let near = finalists.iter().take_while(|c| c.merit - before >= NEAR_TIE * best).count();
    if near < 2 {
        return;
    }
    let estimator = Estimator::new(bench.tracks, &finalists[0].noise, bench.scale);
    let left = |c: &Candidate| {
        let inertia = values::scale(bench.nominal, c).0;
        let totals = c.fit.totals(bench.tracks);
        estimator.rms(&forces(&estimator, bench.tracks, &totals, inertia), bench.tracks)
    };
    finalists[..near].sort_by_cached_key(|c| left(c).to_bits());
}
