//! The stages one after another: read, null, search, judge, and what is handed on to the report.

use crate::effects::{Effect, EffectName};
use crate::error::InputError;
use crate::estimate::Estimator;
use crate::fit::Fit;
use crate::judge::{self, Gain, Laid};
use crate::kalman::Noise;
use crate::library::{self, Span};
use crate::model::{Key, Model, Nominal};
use crate::noise::Colour;
use crate::null;
use crate::periodic;
use crate::recording::Recording;
use crate::residuals::{forces, relative_gain};
use crate::rig::Rig;
use crate::select::{Bench, Candidate, MOST};
use crate::track::{Total, Track};
use crate::values;

/// Least gain of log-likelihood under coloured noise, after the cost of freedom, for an effect to be looked at on.
pub(crate) const WORTH: f64 = 6.0;

/// An effect as it came through the search, before it is judged.
#[derive(Clone)]
pub(crate) struct Found {
    pub(crate) effect: Effect,
    /// Fitted rivals: (name, merit less than the winner's, held-out and fit margin in standard errors).
    pub(crate) rivals: Vec<Rival>,
    /// Held-out gain of the full model over the model without it.
    pub(crate) holdout: Gain,
    /// The same on the fitted recordings.
    pub(crate) fit: Gain,
    /// How much less force it leaves on held-out recordings, over the square of what is left.
    pub(crate) force: Gain,
    /// Part of the refit's residual above the sensor's noise that it explains, on fitted or on held-out recordings.
    pub(crate) share: f64,
    /// Whether one of its values stands at the end of what is possible.
    pub(crate) at_bound: bool,
    /// Whether its waves, if it has any, are those of teeth or poles.
    pub(crate) is_comb: bool,
    /// Size that it would have on each recording, over the size that it has on all, fitted ones first.
    pub(crate) sizes: Vec<f64>,
}

/// How many candidates are judged per effect that may be named: who asks often enough hears a yes.
const TRIED: usize = 3;

/// Part of the refit's residual above the noise that an effect must explain to be named.
const SHARE: f64 = 0.05;
/// Below this part it must also stand out by [`CERTAIN`]: the form of a larger effect is never quite right.
const FAIR_SHARE: f64 = 0.1;
/// What explains this part is most of what was left out, and this many standard errors are sure.
const MOST_SHARE: f64 = 0.5;
const SURE: f64 = 3.0;
/// Factors on an effect that are the same size.
const SAME_SIZE: std::ops::Range<f64> = 0.75..1.33;
/// Least part where its gain is this many standard errors on fitted and on held-out recordings, however counted.
const LEAST_SHARE: f64 = 0.01;
const CERTAIN: f64 = 6.0;

impl Found {
    /// Whether it stands out of every stretch of every recording, however little it explains beside larger effects.
    pub(crate) fn is_certain(&self) -> bool {
        self.holdout.z.min(self.holdout.steady).min(self.fit.z) >= CERTAIN
    }

    /// Standard errors of its gain on fitted or on held-out recordings, whichever are fewer.
    pub(crate) fn least_z(&self) -> f64 {
        self.holdout.z.max(self.holdout.steady).min(self.fit.z.max(self.fit.steady))
    }

    /// Whether its gain is sure on fitted and on held-out recordings, with or without a limit on what a stretch counts.
    fn stands_out(&self) -> bool {
        self.least_z() >= CERTAIN
    }

    /// Whether it carries to the held-out recordings: by likelihood, or, where it is most of what was left out, by the force
    /// that it leaves and the same size as on the fitted ones. Next to reversals a law of slightly another form may be less
    /// likely at many blocks and yet leave a third of the force.
    fn carries(&self) -> bool {
        let likely = self.holdout.low > 0.0 && self.holdout.z.max(self.holdout.steady) >= 2.0;
        let is_same = self.sizes.iter().all(|size| SAME_SIZE.contains(size));
        likely || (self.force.low > 0.0 && is_same && self.share >= MOST_SHARE && self.fit.z >= SURE)
    }

    /// Why an effect may not be named, if it may not.
    fn weakness(&self) -> Option<String> {
        if !self.carries() {
            return Some("its gain does not carry to the held-out recordings".into());
        }
        if self.fit.z.max(self.fit.steady) < 2.0 && self.holdout.z < 3.0 {
            return Some("its gain rests on few moments of the fitted recordings".into());
        }
        if self.share < SHARE && !(self.share >= LEAST_SHARE && self.is_certain()) {
            return Some(format!(
                "it explains {:.1} % of what the noise leaves, less than 5 %",
                100.0 * self.share
            ));
        }
        if self.share < FAIR_SHARE && !self.stands_out() {
            return Some(format!(
                "it explains {:.1} % of what the noise leaves, and not surely enough for so little",
                100.0 * self.share
            ));
        }
        if !self.is_comb {
            return Some(
                "its orders follow each other without a gap, as at places along the travel, not at teeth or poles"
                    .into(),
            );
        }
        self.at_bound.then(|| "its values stand at the end of what is possible".into())
    }
}

/// How far a rival is behind.
#[derive(Clone, Debug)]
pub(crate) struct Rival {
    pub(crate) name: EffectName,
    /// Its shape, as well fitted as it was compared.
    pub(crate) effect: Effect,
    /// Mean lead of the winner over its standard error, over all segments.
    pub(crate) z: f64,
    /// Lead of the winner in log-likelihood.
    pub(crate) lead: f64,
}

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

/// Lays a model on every held-out recording.
pub(crate) fn lay_all(c: &Candidate, nominal: &Nominal, tracks: &[Track], noise: &Noise) -> Vec<Laid> {
    tracks.iter().map(|track| judge::lay(c, nominal, track, noise)).collect()
}

/// Smooths held-out recordings with a fitted model; `scale` is the acceleration that the command makes.
fn smooth_held(candidate: &Candidate, nominal: &Nominal, tracks: &mut [Track], scale: f64) {
    let count = 1.0 / nominal.rig.encoder.counts_per_unit;
    // The first look trusts no friction: its sign is not known yet, and a filter that believes in the wrong one keeps to it.
    let drives: Vec<Total> = tracks.iter().map(|track| Total::of_command(track, nominal.gain())).collect();
    null::resmooth(tracks, &drives, &crate::noise::guess(tracks, scale), count);
    for _ in 0..3 {
        let totals: Vec<Total> = tracks
            .iter()
            .map(|track| judge::lay(candidate, nominal, track, &candidate.noise).total)
            .collect();
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
    (own, again)
}

/// Part of the force that a refit may leave for the forces to be in balance.
const BALANCED: f64 = 0.5;

fn is_balanced(refit: &Fit, nominal: &Nominal, tracks: &[Track], noise: &Noise, scale: f64) -> bool {
    let estimator = Estimator::new(tracks, noise, scale);
    let left = forces(&estimator, tracks, &refit.totals(tracks), 1.0);
    let drives: Vec<Total> = tracks.iter().map(|track| Total::of_command(track, nominal.gain())).collect();
    let still: Vec<Total> = tracks.iter().map(|track| Total::zero(track.blocks())).collect();
    let (all, less) = (forces(&estimator, tracks, &still, 1.0), forces(&estimator, tracks, &drives, 1.0));
    let force: Vec<Vec<f64>> =
        all.iter().zip(&less).map(|(a, b)| a.iter().zip(b).map(|(a, b)| a - b).collect()).collect();
    estimator.rms(&left, tracks) < BALANCED * estimator.rms(&force, tracks)
}

/// Looks for lost counts in every recording under the null, and again with the noise that is left without them.
fn find_steps(nominal: &Nominal, span: &Span, tracks: &mut [Track], noise: &Noise, scale: f64) {
    let mut noise = *noise;
    for _ in 0..2 {
        for track in tracks.iter_mut() {
            let alone = std::slice::from_ref(&*track);
            let fit = Fit::new(&Model::default(), nominal, alone, &noise);
            let residual = fit.residual(0);
            track.lost = crate::steps::find(track, &fit, 0, &residual, span.count);
        }
        if tracks.iter().all(|track| track.lost.iter().all(|lost| *lost == 0.0)) {
            return;
        }
        let model = Model { effects: vec![Effect::shaped(EffectName::MissedCounts, &[])] };
        let totals = Fit::new(&model, nominal, tracks, &noise).totals(tracks);
        noise = crate::noise::estimate(tracks, &totals, &noise, scale, Colour::White);
    }
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
    find_steps(&nominal, &span, &mut tracks, &noise, scale);
    let first = Fit::new(&Model::default(), &nominal, &tracks, &noise);
    let first = Candidate { model: Model::default(), noise, fit: first, merit: 0.0 };
    smooth_held(&first, &nominal, &mut held, scale);
    find_steps(&nominal, &span, &mut held, &noise, scale);
    let mut white = Bench::new(&nominal, &tracks, &span, scale).fit(Model::default(), &noise, Colour::White);
    let mut slow =
        Bench::new(&nominal, &tracks, &span, scale).fit_slow(Model::default(), &[&noise, &white.noise]);
    let mut lost: Vec<(EffectName, f64, String)> = Vec::new();
    let mut tried = 0;
    for step in 0..MOST {
        progress("searching for what was left out", 0.15 + 0.2 * step as f64);
        let on = Bench::new(&nominal, &tracks, &span, scale);
        let candidates = on.screen(&white, &|_| true);
        let mut finalists = on.finalists(&white, &candidates);
        on.polish(&mut finalists);
        order_near_ties(&on, white.merit, &mut finalists);
        let mut taken = None;
        for finalist in finalists {
            let name = finalist.model.effects.last().expect("a finalist adds an effect").name;
            if finalist.merit - white.merit < WORTH || tried >= TRIED * (step + 1) {
                break;
            }
            tried += 1;
            let with = on.fit_slow(finalist.model.clone(), &[&slow.noise, &finalist.noise]);
            let gain = with.merit - slow.merit;
            if gain < WORTH {
                lost.push((name, gain, "what it explains is no more than a slow disturbance would".into()));
                continue;
            }
            let (own_tracks, finalist) = in_its_own_motion(&tracks, finalist, &on);
            let own = Bench::new(&nominal, &own_tracks, &span, scale);
            let mut own_held = held.clone();
            smooth_held(&finalist, &nominal, &mut own_held, scale);
            let judged = judge_all(&own, &finalist, &own_held).pop().expect("the last effect is judged");
            if let Some(reason) = judged.weakness() {
                lost.push((name, judged.holdout.sum, reason));
                continue;
            }
            let slow = own.fit_slow(finalist.model.clone(), &[&with.noise, &finalist.noise]);
            taken = Some((finalist, slow, own_tracks, own_held));
            break;
        }
        let Some(next) = taken else { break };
        (white, slow, tracks, held) = next;
    }
    progress("judging on held-out recordings", 0.8);
    let bench = Bench::new(&nominal, &tracks, &span, scale);
    let last = bench.fit_slow(white.model.clone(), &[&slow.noise, &white.noise]);
    let null = bench.fit_slow(Model::default(), &[&noise, &white.noise]);
    let mut s = Search {
        nominal: nominal.clone(),
        fit_tracks: Vec::new(),
        held_tracks: Vec::new(),
        span: span.clone(),
        null,
        last,
        found: Vec::new(),
        lost,
    };
    prune(&mut s, &bench, &held, &white.noise);
    (s.fit_tracks, s.held_tracks) = (tracks, held);
    Ok(s)
}

/// Takes out whatever does not carry to the held-out recordings, the weakest first, until all that is left does, and
/// judges that; `noise` is white.
pub(crate) fn prune(s: &mut Search, bench: &Bench, held: &[Track], noise: &Noise) {
    loop {
        let plain = bench.fit(s.last.model.clone(), noise, Colour::White);
        s.found = judge_all(bench, &plain, held);
        let absent = |i: usize, name| {
            let is_there = values::is_there(name, &values::parameters(bench, &plain, i));
            (!is_there).then(|| "its size cannot be told from zero".to_owned())
        };
        let weakest = s
            .found
            .iter()
            .enumerate()
            .filter_map(|(i, f)| {
                let reason = f.weakness().or_else(|| absent(i, f.effect.name))?;
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

/// Costs per segment of a model on the recordings it was fitted to, under some noise.
pub(crate) fn fit_costs(c: &Candidate) -> Vec<f64> {
    let mut out = Vec::new();
    for (one, places) in c.fit.prepared.iter().zip(&c.fit.places) {
        for (square, (weight, count)) in one.squares(places, &c.fit.solution.x).iter().zip(one.weights()) {
            out.push(0.5 * count * crate::kalman::tolerant(square / weight / count).0);
        }
    }
    out
}

fn judge_all(bench: &Bench, last: &Candidate, held: &[Track]) -> Vec<Found> {
    let with = lay_all(last, bench.nominal, held, &last.noise);
    let with_fit = fit_costs(last);
    let estimator = Estimator::new(bench.tracks, &last.noise, bench.scale);
    let left = |c: &Candidate, tracks: &[Track], totals: &[Total]| {
        forces(&estimator, tracks, totals, values::scale(bench.nominal, c).0)
    };
    let left_on_fit = |c: &Candidate| left(c, bench.tracks, &c.fit.totals(bench.tracks));
    let left_on_held = |c: &Candidate, laid: &[Laid]| {
        left(c, held, &laid.iter().map(|l| l.total.clone()).collect::<Vec<_>>())
    };
    let square = |left: &[Vec<f64>], tracks: &[Track]| estimator.rms(left, tracks).powi(2);
    let null = Fit::new(&Model::default(), bench.nominal, bench.tracks, &last.noise);
    let null = Candidate { model: Model::default(), noise: last.noise, fit: null, merit: 0.0 };
    let inertia = values::scale(bench.nominal, last).0;
    let count = 1.0 / bench.nominal.rig.encoder.counts_per_unit;
    let explainable = |whole: f64, tracks: &[Track]| {
        let floor = (estimator.counting(tracks, &last.noise, count) * inertia).powi(2);
        (whole - floor).max(0.02 * whole).max(1e-300)
    };
    let of_null = left_on_held(&null, &lay_all(&null, bench.nominal, held, &last.noise));
    let held_out = explainable(square(&of_null, held), held);
    let fitted = explainable(square(&left_on_fit(&null), bench.tracks), bench.tracks);
    let (left_held_out, left_fitted) = (left_on_held(last, &with), left_on_fit(last));
    (0..last.model.effects.len())
        .map(|i| {
            let mut less = last.model.clone();
            let effect = less.effects.remove(i);
            let fit = Fit::new(&less, bench.nominal, bench.tracks, &last.noise);
            let without = Candidate { model: less, noise: last.noise, fit, merit: 0.0 };
            let without_fit = fit_costs(&without);
            let gains: Vec<f64> = without_fit.iter().zip(&with_fit).map(|(a, b)| a - b).collect();
            let laid = lay_all(&without, bench.nominal, held, &last.noise);
            let holdout = judge::compare(&with, &laid);
            // What one recording hardly plays another may be made for.
            let (less_held_out, less_fitted) = (left_on_held(&without, &laid), left_on_fit(&without));
            let share = ((square(&less_held_out, held) - square(&left_held_out, held)) / held_out)
                .max((square(&less_fitted, bench.tracks) - square(&left_fitted, bench.tracks)) / fitted);
            let force = relative_gain(&estimator, held, &less_held_out, &left_held_out);
            let mut sizes = sizes(&estimator, bench.tracks, &left_fitted, &less_fitted);
            sizes.extend(self::sizes(&estimator, held, &left_held_out, &less_held_out));
            let is_bound =
                last.fit.keys.iter().zip(&last.fit.solution.bound).any(|((key, _), bound)| {
                    *bound && matches!(key, Key::Term { effect, .. } if *effect == i)
                });
            let at_bound = is_bound || library::is_at_end(&effect, bench.span);
            let is_comb = periodic::is_comb(&effect, &last.fit.amplitudes(i));
            Found {
                effect,
                rivals: Vec::new(),
                holdout,
                fit: judge::bootstrap(&gains),
                force,
                share,
                at_bound,
                is_comb,
                sizes,
            }
        })
        .collect()
}

/// Factors on what an effect does on each recording, which is the difference of what is left with it and without it, that
/// would leave the least.
fn sizes(estimator: &Estimator, tracks: &[Track], with: &[Vec<f64>], without: &[Vec<f64>]) -> Vec<f64> {
    let one = |(track, (with, without)): (&Track, (&Vec<f64>, &Vec<f64>))| {
        let (mut along, mut square) = (0.0, 0.0);
        for (j, _) in estimator.moving(track).iter().enumerate().filter(|(_, moving)| **moving) {
            let done = without[j] - with[j];
            along += done * with[j];
            square += done * done;
        }
        1.0 + along / f64::max(square, 1e-300)
    };
    tracks.iter().zip(with.iter().zip(without)).map(one).collect()
}
