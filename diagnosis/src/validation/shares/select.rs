//! Forward selection of effects by their shares of the force error.

use super::design::{Design, held_out};
use super::forms::forms;
use super::laws::{Asked, Columns, columns};
use super::sight::{FEWEST_ROWS, Scale, Sight, priors};
use crate::effects::definition::Unnamed;
use crate::effects::{Effect, EffectName as N};
use crate::estimation::blocked_recording::BlockedRecording;
use crate::estimation::filter::Noise;
use crate::estimation::force_residual::Estimator;
use crate::numerics::linear::Prior;
use crate::numerics::parallel;
use crate::selection::candidates;
use crate::selection::context::{FitContext, MOST};
use crate::selection::periodic::{self, Searched};
use crate::thresholds::{AS_GOOD, FORM_LEAVES, NAMED_SHARE, SAME_SIZE_OF_SHARE};
use crate::validation::out_of_library::unnamed_like;

/// Factors by which a value of a shape is moved, a pair in each round.
const MOVES: [[f64; 2]; 3] = [[0.5, 2.0], [0.7, 1.4], [0.85, 1.18]];
/// Additional share that a rival must take to replace an effect.
const SURELY: f64 = 0.01;
/// The number of values of a shape that are moved.
const MOVED: usize = 2;

/// An effect with its part in the force error.
#[derive(Clone, Debug)]
pub(crate) struct Share {
    pub(crate) effect: Effect,
    /// Parts of the force error, root mean square, that it takes on stretches left out of the fit and on held-out recordings.
    pub(crate) on_fit: f64,
    pub(crate) on_holdout: f64,
    /// Its size on the held-out recordings over that on the fitted ones.
    pub(crate) size: f64,
    /// True if a coefficient is at a limit of what the effect may be.
    pub(crate) at_bound: bool,
}

impl Share {
    /// True if it is about as large on held-out recordings as on fitted ones, and is not what it is only by a limit.
    pub(crate) fn fits(&self) -> bool {
        !self.at_bound && SAME_SIZE_OF_SHARE.contains(&self.size)
    }

    /// The smaller of its shares.
    pub(crate) fn least(&self) -> f64 {
        self.on_fit.min(self.on_holdout)
    }
}

/// An effect that was selected, and the others that could take its place.
pub(crate) struct Selected {
    pub(crate) share: Share,
    /// Best first.
    pub(crate) rivals: Vec<Share>,
    /// Residual of the best force of any form instead of it, over its own.
    pub(crate) form: f64,
    /// The share of the physics without a name that takes most instead.
    unnamed: f64,
}

impl Selected {
    /// True if it takes enough to be named and is about as large everywhere.
    pub(crate) fn is_named(&self) -> bool {
        let (share, fits) = (self.share.least(), self.share.fits());
        fits && share >= NAMED_SHARE && self.form >= FORM_LEAVES && self.unnamed < share
    }

    /// Every effect that takes nearly as much instead, itself first.
    pub(crate) fn class(&self) -> Vec<N> {
        let most = (1.0 - self.share.least()) * (1.0 + AS_GOOD);
        let near = self.rivals.iter().filter(|rival| rival.fits() && 1.0 - rival.least() <= most);
        std::iter::once(self.share.effect.name).chain(near.map(|rival| rival.effect.name)).collect()
    }
}

/// The recordings of a selection.
pub(crate) struct Selection<'a> {
    context: &'a FitContext<'a>,
    noise: Noise,
    sights: Vec<Sight<'a>>,
    priors: Vec<Prior>,
    /// Number of sights that are fitted.
    fits: usize,
}

impl<'a> Selection<'a> {
    /// Lays out recordings; none where too few rows move.
    pub(crate) fn new(
        context: &'a FitContext<'a>,
        noise: Noise,
        holdout: &'a [BlockedRecording],
    ) -> Option<Self> {
        let estimator = Estimator::new(context.tracks, &noise, context.scale);
        let all: Vec<&BlockedRecording> = context.tracks.iter().chain(holdout).collect();
        let mut sights =
            parallel::map(all.len(), |r| Sight::new(all[r], r, context.nominal, &noise, estimator));
        sights.retain(|sight| sight.rows() >= FEWEST_ROWS);
        let priors = priors(context.nominal, &context.tracks[0], &noise);
        let fits = sights.iter().filter(|sight| sight.track.place.is_some()).count();
        (fits > 0 && fits < sights.len()).then_some(Self { context, noise, sights, priors, fits })
    }

    fn designs(&self, laws: &[&Columns]) -> (Design, Design) {
        let of = |from: usize, to: usize| Design::new(&self.sights[from..to], from, &self.priors, laws);
        (of(0, self.fits), of(self.fits, self.sights.len()))
    }

    /// Selects effects one after another while the best takes `least` of the force error, and swaps each once for what takes more.
    pub(crate) fn select(&self, least: f64) -> Vec<Selected> {
        let mut taken: Vec<Columns> = Vec::new();
        while taken.len() < MOST {
            let state = State::new(self, taken.iter().collect());
            let best = state.ranked(&|_| true).into_iter().find(|(share, _)| share.fits());
            let Some((_, tried)) = best.filter(|(share, _)| share.least() >= least) else { break };
            taken.push(tried);
        }
        let mut ranked: Vec<Option<Ranked>> = taken.iter().map(|_| None).collect();
        for i in 0..taken.len() {
            let mut place = self.in_place_of(&taken, i);
            if let Some(better) = place.as_mut().and_then(|ranked| ranked.better.take()) {
                taken[i] = better;
                // What was ranked before stood beside another effect.
                ranked.iter_mut().for_each(|one| *one = None);
                continue;
            }
            ranked[i] = place;
        }
        let again = |(i, ranked): (usize, Option<Ranked>)| {
            let Ranked { share, rivals, .. } = ranked.or_else(|| self.in_place_of(&taken, i))?;
            let form = self.form_in_place_of(&taken, i, &share);
            let unnamed = self.unnamed_in_place_of(&taken, i);
            Some(Selected { share, rivals, form, unnamed })
        };
        ranked.into_iter().enumerate().filter_map(again).collect()
    }

    /// Residual of the best force of any form instead of a law, over that of the law.
    fn form_in_place_of(&self, taken: &[Columns], i: usize, share: &Share) -> f64 {
        let others = taken.iter().enumerate().filter(|(k, _)| *k != i).map(|(_, c)| c).collect();
        let state = State::new(self, others);
        let sd = state.left.0.sqrt();
        let all = forms(&self.sights, self.fits, self.context.nominal, &share.effect, sd);
        let best = all.filter_map(|form| Some(state.share(&form)?.least())).fold(0.0, f64::max);
        (1.0 - best) / (1.0 - share.least()).max(1e-6)
    }

    /// The largest share that physics without a name takes in the place of a drift: a load that changes at once looks like one. Zero for
    /// other laws. Friction in proportion to the drive's force takes nearly all that any friction takes, so it says nothing here.
    fn unnamed_in_place_of(&self, taken: &[Columns], i: usize) -> f64 {
        let (nominal, effect) = (self.context.nominal, &taken[i].effect);
        if !effect.name.definition().drifts() {
            return 0.0;
        }
        let others = taken.iter().enumerate().filter(|(k, _)| *k != i).map(|(_, c)| c).collect();
        let state = State::new(self, others);
        let all = unnamed_like(Some(effect), self.context);
        let same: Vec<Unnamed> =
            all.into_iter().filter(|unnamed| unnamed.effect.name == effect.name).collect();
        let share =
            |unnamed: &Unnamed| state.share(&columns(&unnamed.effect, &self.sights, nominal, &state.asked)?);
        parallel::map_all(&same, share).iter().flatten().map(Share::least).fold(0.0, f64::max)
    }

    /// The share of an effect of known shape beside others.
    pub(crate) fn beside(&self, effect: &Effect, others: &[&Effect]) -> Option<Share> {
        let nominal = self.context.nominal;
        let first = State::new(self, Vec::new());
        let laws: Vec<Columns> =
            others.iter().filter_map(|other| columns(other, &self.sights, nominal, &first.asked)).collect();
        let state = State::new(self, laws.iter().collect());
        state.share(&columns(effect, &self.sights, nominal, &state.asked)?)
    }

    /// The share of law `i` beside the others, with its rivals.
    fn in_place_of(&self, taken: &[Columns], i: usize) -> Option<Ranked> {
        let others = taken.iter().enumerate().filter(|(k, _)| *k != i).map(|(_, c)| c).collect();
        let state = State::new(self, others);
        let name = taken[i].effect.name;
        let share = state.share(&taken[i])?;
        let ranked = state.ranked(&|other| other != name);
        let rivals = ranked.iter().map(|(share, _)| share.clone()).collect();
        let is_better = |rival: &Share| rival.fits() && rival.least() > share.least() + SURELY;
        let better = ranked.into_iter().find(|(rival, _)| is_better(rival)).map(|(_, columns)| columns);
        Some(Ranked { share, rivals, better })
    }
}

/// An effect with its rank among others.
struct Ranked {
    share: Share,
    rivals: Vec<Share>,
    /// The rival that surely takes more.
    better: Option<Columns>,
}

/// The laws so far, with what they leave.
struct State<'a> {
    on: &'a Selection<'a>,
    laws: Vec<&'a Columns>,
    /// Mean squares that are left on folds of the fitted recordings and on held-out ones.
    left: (f64, f64),
    square: f64,
    asked: Asked,
}

impl<'a> State<'a> {
    fn new(on: &'a Selection<'a>, laws: Vec<&'a Columns>) -> Self {
        let (fitted, there) = on.designs(&laws);
        // Once with a guess of what is left, and again with that.
        let guess = fitted.left_by(&fitted.solve(0.01 * fitted.target(), |_| true));
        let x = fitted.solve(guess, |_| true);
        let square = fitted.left_by(&x);
        let left = (fitted.left_out(square), held_out(&fitted, &x, &there, square, &laws));
        let asked = Asked::new(on.sights.iter().map(|sight| asked(on, sight, &x)).collect());
        Self { on, laws, left, square, asked }
    }

    /// Part of the error that a law takes on stretches left out of the fit, with the design.
    fn on_fit(&self, tried: &Columns) -> f64 {
        let mut laws = self.laws.clone();
        laws.push(tried);
        let on = self.on;
        let fitted = Design::new(&on.sights[..on.fits], 0, &on.priors, &laws);
        1.0 - (fitted.left_out(self.square) / self.left.0.max(1e-300)).sqrt()
    }

    fn share(&self, tried: &Columns) -> Option<Share> {
        let mut laws = self.laws.clone();
        laws.push(tried);
        let (fitted, there) = self.on.designs(&laws);
        let x = fitted.solve(self.square, |_| true);
        let own = there.solve(self.square, |_| true);
        let last = laws.len() - 1;
        let on_holdout = held_out(&fitted, &x, &there, self.square, &laws);
        let share = Share {
            effect: tried.effect.clone(),
            on_fit: 1.0 - (fitted.left_out(self.square) / self.left.0.max(1e-300)).sqrt(),
            on_holdout: 1.0 - (on_holdout / self.left.1.max(1e-300)).sqrt(),
            size: size(&fitted, &x, &there, &own, last, tried.own),
            at_bound: is_at_bound(&fitted, &x, last, &tried.bounds),
        };
        (share.on_fit.is_finite() && share.on_holdout.is_finite()).then_some(share)
    }

    /// The best shape of every effect that may be added, the one with the largest share first.
    fn ranked(&self, wanted: &(dyn Fn(N) -> bool + Sync)) -> Vec<(Share, Columns)> {
        let context = self.on.context;
        let model = crate::estimation::model::Model {
            effects: self.laws.iter().map(|law| law.effect.clone()).collect(),
            ..Default::default()
        };
        let now = context.fit_at(model, &self.on.noise);
        let residuals: Vec<Vec<f64>> = (0..context.tracks.len()).map(|r| now.fit.residual(r)).collect();
        let all = context.that_may_be_added(&now.model, wanted);
        let is_periodic = |name: &N| name.definition().is_periodic();
        // Waves that stand out as a force may be of the drive, and the other way round.
        let sought: Vec<N> = match all.iter().any(is_periodic) {
            true => N::ALL.iter().copied().filter(is_periodic).collect(),
            false => Vec::new(),
        };
        let searched = Searched { fit: &now.fit, residuals: &residuals, model: &now.model };
        let waves: Vec<Effect> =
            periodic::search(&sought, context, &searched).into_iter().map(|(effect, _)| effect).collect();
        let best_of = |name: &N| -> Option<(Share, Columns)> {
            let tried = match is_periodic(name) {
                true => self.best_waves(*name, &waves)?,
                false => self.best_shape(*name)?,
            };
            Some((self.share(&tried)?, tried))
        };
        let mut found: Vec<(Share, Columns)> =
            parallel::map_all(&all, best_of).into_iter().flatten().collect();
        found.sort_by(|a, b| b.0.least().total_cmp(&a.0.least()));
        found
    }

    fn columns(&self, effect: &Effect) -> Option<Columns> {
        columns(effect, &self.on.sights, self.on.context.nominal, &self.asked)
    }

    /// The waves that take most on stretches left out of the fit, as those of one effect.
    fn best_waves(&self, name: N, waves: &[Effect]) -> Option<Columns> {
        let tried = waves.iter().filter_map(|found| {
            let columns = self.columns(&Effect { name, ..found.clone() })?;
            Some((self.on_fit(&columns), columns))
        });
        Some(tried.max_by(|a, b| a.0.total_cmp(&b.0))?.1)
    }

    /// The shape of an effect that takes most on stretches left out of the fit.
    fn best_shape(&self, name: N) -> Option<Columns> {
        let on = self.on;
        let grid = candidates::shapes(name, on.context.span, on.context.nominal);
        let tried = grid.iter().filter_map(|effect| {
            let columns = self.columns(effect)?;
            Some((self.on_fit(&columns), columns))
        });
        let mut best = tried.max_by(|a, b| a.0.total_cmp(&b.0))?;
        for moves in MOVES {
            for (key, low, high) in candidates::movable(&best.1.effect, on.context.span).iter().take(MOVED) {
                let at = best.1.effect.shape[*key];
                for factor in moves {
                    let mut effect = best.1.effect.clone();
                    effect.shape.insert((*key).to_owned(), (at * factor).clamp(*low, *high));
                    if !name.definition().is_possible(&effect) {
                        continue;
                    }
                    let Some(moved) = self.columns(&effect) else { continue };
                    let share = self.on_fit(&moved);
                    if share > best.0 {
                        best = (share, moved);
                    }
                }
            }
        }
        Some(best.1)
    }
}

/// The drive's force that the nominal terms ask for, with the recording's own offset.
fn asked(on: &Selection, sight: &Sight, x: &[f64]) -> Vec<f64> {
    let none = vec![0.0; sight.track.block_count()];
    let predicted = sight.asked(&x[..sight.nominal.len()], &none);
    let gain = Scale::of(on.context.nominal).gain;
    let drive = sight.blocks_of(&sight.track.rows.command_input);
    let drive: Vec<f64> = drive.iter().map(|u| gain * u).collect();
    let offset = sight.offset(&drive, &predicted);
    predicted.iter().map(|force| force + offset).collect()
}

/// Size of the last law on held-out recordings over that on fitted ones.
fn size(fitted: &Design, x: &[f64], there: &Design, own: &[f64], law: usize, has_own_phase: bool) -> f64 {
    if has_own_phase {
        let square = |x: &[f64], places: &[Vec<usize>]| {
            places.iter().flatten().map(|place| x[*place].powi(2)).sum::<f64>() / places.len() as f64
        };
        return (square(own, &there.laws[law]) / square(x, &fitted.laws[law]).max(1e-300)).sqrt();
    }
    let mut carried = own.to_vec();
    for (from, to) in fitted.laws[law][0].iter().zip(&there.laws[law][0]) {
        carried[*to] = x[*from];
    }
    there.along(law, &carried, own) / there.along(law, &carried, &carried).max(1e-300)
}

/// True if a coefficient of a law is at one of its bounds; zero is none.
fn is_at_bound(design: &Design, x: &[f64], law: usize, bounds: &[(f64, f64)]) -> bool {
    let is_at = |x: f64, bound: f64| bound.is_finite() && bound != 0.0 && (x / bound - 1.0).abs() < 1e-6;
    let places = design.laws[law].iter();
    places
        .flat_map(|of| of.iter().zip(bounds))
        .any(|(place, (low, high))| is_at(x[*place], *low) || is_at(x[*place], *high))
}
