//! Periodic effects: finds the orders of a turn, or the period along the travel, that are
//! significant in the residual.

use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::effective_command::effective_command;
use crate::fit::input::Input;
use crate::fit::linear_fit::Fit;
use crate::fit::model::Model;
use crate::fit::nominal::Nominal;
use crate::laws::definition::Span;
use crate::laws::{Effect, EffectName as N};
use crate::propose::context::FitContext;
use crate::propose::score_statistic::{ScoreSums, Terms, project};
use crate::propose::wave_ladder::{self, Means};
use numerics::golden_section::golden;
use numerics::linear::dot;
use numerics::linear::{Factor, Square};
use numerics::parallel;
use std::f64::consts::TAU;

/// Highest order of a turn that is looked for, and how many orders one effect may have.
const HIGHEST: usize = 100;
const MOST_ORDERS: usize = 14;
/// Most cycles over the travel that are looked for where no turn is known.
const MOST_CYCLES: f64 = 480.0;
/// Fewest half cycles over the travel where no turn is known: less is a shape along the travel.
const FEWEST: usize = 6;
/// Gain of log-likelihood that a further order must bring, in addition to one for the orders looked
/// through.
const PER_ORDER: f64 = 8.0;

/// Periods that the travel must hold for an order to be distinguished from a shape along the
/// travel, and the part of a turn that shows a mass off its centre, whose order is known.
const PERIODS: f64 = 2.0;
const MOST_OF_TURN: f64 = 0.6;

/// True if a travel, in turns, shows an order of the turn.
pub(crate) fn fits(order: f64, turns: f64) -> bool {
    order * turns >= PERIODS || (order == 1.0 && turns > MOST_OF_TURN)
}

/// True if a travel, in turns, distinguishes two orders: their beat must go round once.
pub(crate) fn are_apart(a: f64, b: f64, turns: f64) -> bool {
    (a - b).abs() * turns >= 1.0
}

/// Spatial frequencies worth trying: whole orders of a turn where it is known, otherwise a grid of
/// cycles over the travel.
fn candidates(span: &Span, nominal: &Nominal) -> Option<(f64, Vec<f64>)> {
    let travel = span.travel();
    // A wave must be resolved by the encoder and stay in the band of the filter at slow speed.
    let shortest = (6.0 * span.count).max(span.slow * 2.0 * span.block);
    if let Some(turn) = nominal.rig.turn() {
        let highest = ((turn / shortest) as usize).clamp(1, HIGHEST);
        let orders: Vec<f64> = (1..=highest).map(|n| n as f64).filter(|n| fits(*n, travel / turn)).collect();
        return (!orders.is_empty()).then_some((turn, orders));
    }
    let most = (travel / shortest).min(MOST_CYCLES);
    // One over the travel is the reference; cycles over the travel play the part of orders.
    let count = (most * 2.0) as usize;
    (count >= 8).then(|| (travel, (FEWEST..=count).map(|i| 0.5 * i as f64).collect()))
}

/// The waves that a travel is too short for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum TooShort {
    /// No turn is known: this travel would be needed for any, rad or m.
    ForAll(f64),
    /// The highest order of the turn that is not looked for.
    ForOrders { up_to: f64 },
}

/// The waves that are not looked for because the travel is too short; none where all are.
pub(crate) fn too_short_for(name: N, span: &Span, nominal: &Nominal) -> Option<TooShort> {
    let all = candidates(span, nominal);
    match (nominal.rig.turn(), all) {
        (None, Some(_)) => None,
        // Three periods of the shortest wave that the encoder resolves.
        (None, None) => {
            let shortest = (6.0 * span.count).max(span.slow * 2.0 * span.block);
            Some(TooShort::ForAll((4.0 * shortest).max(span.travel())))
        }
        (Some(turn), _) => {
            let is_own = |order: &f64| name.definition().is_of_orders(&[*order]);
            let is_hidden = |order: &f64| is_own(order) && !fits(*order, span.travel() / turn);
            let order = (1..=HIGHEST).rev().map(|n| n as f64).find(is_hidden)?;
            Some(TooShort::ForOrders { up_to: order })
        }
    }
}

/// Everything that a search for waves looks at.
pub(crate) struct Searched<'a> {
    pub(crate) fit: &'a Fit,
    pub(crate) residuals: &'a [Vec<f64>],
    pub(crate) model: &'a Model,
}

/// Waves along the travel: orders of a turn where it is known, otherwise cycles over the travel,
/// with their responses.
struct Waves<'a> {
    context: &'a FitContext<'a>,
    searched: &'a Searched<'a>,
    /// The command's input of each recording, where the waves are in proportion to it.
    drives: Vec<Option<Input>>,
    /// The places of each recording's blocks.
    places: Vec<Vec<(f64, f64)>>,
    /// Travel over which orders are counted, rad or m.
    turn: f64,
    orders: Vec<f64>,
    /// True if orders are whole because the turn is known.
    whole: bool,
}

impl<'a> Waves<'a> {
    /// The waves worth trying for an effect; none where the recordings cannot show any.
    fn new(name: N, context: &'a FitContext, searched: &'a Searched) -> Option<Self> {
        let (turn, orders) = candidates(context.span, context.nominal)?;
        let whole = context.nominal.rig.turn().is_some_and(|known| known == turn);
        let scales_drive = name.definition().scales_drive();
        let drive = |track: &BlockedRecording| {
            scales_drive.then(|| track.drive(effective_command(track, &searched.model.effects).as_deref()))
        };
        let drives = context.tracks.iter().map(drive).collect();
        let places = context.tracks.iter().map(wave_ladder::places).collect();
        Some(Self { context, searched, drives, places, turn, orders, whole })
    }

    /// Whitened responses to cosine and sine of one order.
    fn terms(&self, order: f64) -> Terms {
        let means = |places: &Vec<_>| vec![wave_ladder::means(places, order * TAU / self.turn)];
        terms_of(&[self], &self.places.iter().map(means).collect::<Vec<_>>()).remove(0)
    }

    fn project(&self, terms: &Terms) -> ScoreSums {
        project(self.searched.fit, self.searched.residuals, terms, true)
    }

    fn gain(&self, order: f64) -> f64 {
        gain_of(&self.project(&self.terms(order)))
    }

    /// The orders that gain most by themselves, apart from each other, each moved to where it gains
    /// most; `single` has the gain of each.
    fn best_alone(&self, single: &[f64]) -> Vec<f64> {
        let orders = &self.orders;
        let mut ranked: Vec<usize> = (0..orders.len()).collect();
        ranked.sort_by(|a, b| single[*b].total_cmp(&single[*a]).then(a.cmp(b)));
        let mut kept: Vec<usize> = Vec::new();
        for index in ranked {
            // Neighbours on a fine grid are the same peak.
            let apart = self.whole || kept.iter().all(|k| (orders[*k] - orders[index]).abs() > 1.2);
            if apart && single[index] > 3.0 {
                kept.push(index);
            }
            if kept.len() >= if self.whole { 2 * MOST_ORDERS } else { MOST_ORDERS } {
                break;
            }
        }
        if self.whole {
            return kept.iter().map(|k| orders[*k]).collect();
        }
        let refined = |k: &usize| golden(orders[*k] - 0.5, orders[*k] + 0.5, 7, |order| self.gain(order));
        parallel::map_all(&kept, refined)
    }

    /// The orders that gain most together, out of some, and their gain.
    fn best_together(&self, orders: &[f64]) -> (Vec<f64>, f64) {
        let columns = parallel::map_all(orders, |order| self.terms(*order));
        let recordings = self.context.tracks.len();
        let joined: Terms = (0..recordings)
            .map(|r| columns.iter().flat_map(|terms| terms[r].iter().cloned()).collect())
            .collect();
        let sums = self.project(&joined);
        let turns = self.context.span.travel() / self.turn;
        let may_join = |chosen: &[usize], order: usize| {
            !self.whole || chosen.iter().all(|other| are_apart(orders[*other], orders[order], turns))
        };
        let looked = (self.orders.len() as f64).ln();
        let (chosen, gain) = forward(&sums, orders.len(), recordings, looked, &may_join);
        (chosen.iter().map(|i| orders[*i]).collect(), gain)
    }

    /// The effect that is made of the orders that gain most, with their gain; `single` has the gain
    /// of each order alone.
    fn found(&self, name: N, single: &[f64]) -> Option<(Effect, f64)> {
        // Only the best by themselves are fitted together.
        let alone = self.best_alone(single);
        if alone.is_empty() {
            return None;
        }
        let (orders, gain) = self.best_together(&alone);
        if orders.is_empty() || (self.whole && !name.definition().is_of_orders(&orders)) {
            return None;
        }
        Some((self.made_of(name, &orders), gain))
    }

    /// An effect that is made of some orders.
    fn made_of(&self, name: N, orders: &[f64]) -> Effect {
        if self.whole {
            return Effect::of_orders(name, self.turn, orders);
        }
        let mut periods: Vec<f64> = orders.iter().map(|order| self.turn / order).collect();
        periods.sort_by(f64::total_cmp);
        Effect::of_periods(name, &periods)
    }
}

/// Whitened responses of each recording to cosine and sine of some waves, for one search after
/// another; `means` holds those waves for each recording. All searches are of the same recordings.
/// A walk over a recording takes little longer for four inputs than for one.
fn terms_of(searches: &[&Waves], means: &[Vec<Means>]) -> Vec<Terms> {
    let Some(first) = searches.first() else { return Vec::new() };
    let count: usize = means.first().map_or(0, Vec::len);
    let mut all = vec![Terms::with_capacity(means.len()); searches.len() * count];
    for (r, (track, means)) in first.context.tracks.iter().zip(means).enumerate() {
        let inputs_of = |search: &&Waves| -> Vec<Input> {
            let driven = |(cos, sin): &Means| match &search.drives[r] {
                Some(drive) => [drive.scaled(cos), drive.scaled(sin)],
                None => [Input::Held(cos.clone()), Input::Held(sin.clone())],
            };
            means.iter().flat_map(driven).collect()
        };
        let inputs: Vec<Input> = searches.iter().flat_map(inputs_of).collect();
        let gains = &first.searched.fit.prepared[r].gains;
        let responses = gains.responses(&track.observed(), &inputs.iter().collect::<Vec<_>>());
        let mut responses = responses.into_iter();
        for terms in &mut all {
            terms.push(responses.by_ref().take(2).collect());
        }
    }
    all
}

/// The number of orders that are computed one from the other.
const LADDER: usize = 16;

/// The gain of each order by itself, for one search after another.
fn single_gains(searches: &[&Waves]) -> Vec<Vec<f64>> {
    let Some(first) = searches.first() else { return Vec::new() };
    let orders: Vec<&[f64]> = first.orders.chunks(LADDER).collect();
    let gains = parallel::map_all(&orders, |orders| gains_on_ladder(searches, orders));
    let gains_of =
        |search: usize| gains.iter().flat_map(|all: &Vec<Vec<f64>>| all[search].iter().copied()).collect();
    (0..searches.len()).map(gains_of).collect()
}

/// The gain of evenly spaced orders, each by itself, for one search after another.
fn gains_on_ladder(searches: &[&Waves], orders: &[f64]) -> Vec<Vec<f64>> {
    let first = searches[0];
    let wave = |order: f64| order * TAU / first.turn;
    let step = wave(orders.get(1).map_or(0.0, |next| next - orders[0]));
    let ladder = |places: &Vec<_>| wave_ladder::ladder(places, wave(orders[0]), step, orders.len());
    let means: Vec<Vec<Means>> = first.places.iter().map(ladder).collect();
    let terms = terms_of(searches, &means);
    terms.chunks(orders.len()).map(|of| of.iter().map(|one| gain_of(&first.project(one))).collect()).collect()
}

/// Finds the orders of cogging or torque ripple, each effect for itself, in the residual of a fit;
/// the gain counts every recording's own phases. Effects without any significant order are left
/// out.
pub(crate) fn search(names: &[N], context: &FitContext, searched: &Searched) -> Vec<(Effect, f64)> {
    let waves: Vec<(N, Waves)> =
        names.iter().filter_map(|name| Some((*name, Waves::new(*name, context, searched)?))).collect();
    let single = single_gains(&waves.iter().map(|(_, waves)| waves).collect::<Vec<_>>());
    let all: Vec<_> = waves.iter().zip(&single).collect();
    let found = parallel::map_all(&all, |((name, waves), single)| waves.found(*name, single));
    found.into_iter().flatten().collect()
}

fn gain_of(sums: &ScoreSums) -> f64 {
    let x = Factor::new(&sums.information).solve(&sums.score);
    let gain = 0.5 * dot(&x, &sums.score);
    if gain.is_finite() { gain } else { 0.0 }
}

/// The gain of the coefficients at some places alone.
fn gain_at(sums: &ScoreSums, places: &[usize]) -> f64 {
    let mut information = Square::zero(places.len());
    for (a, i) in places.iter().enumerate() {
        for (b, j) in places.iter().enumerate() {
            information.a[a * places.len() + b] = sums.information.at(*i, *j);
        }
    }
    gain_of(&ScoreSums { information, score: places.iter().map(|i| sums.score[*i]).collect() })
}

/// Picks orders one after another while each brings more than it costs; `may_join` says which may
/// join those chosen.
fn forward(
    sums: &ScoreSums,
    orders: usize,
    recordings: usize,
    looked: f64,
    may_join: &dyn Fn(&[usize], usize) -> bool,
) -> (Vec<usize>, f64) {
    let places = |order: usize| -> Vec<usize> {
        (0..recordings).flat_map(|r| [0, 1].map(|i| r * 2 * orders + 2 * order + i)).collect()
    };
    let gain_with = |chosen: &[usize]| -> f64 {
        gain_at(sums, &chosen.iter().flat_map(|order| places(*order)).collect::<Vec<_>>())
    };
    let mut chosen: Vec<usize> = Vec::new();
    let mut gain = 0.0;
    while chosen.len() < MOST_ORDERS.min(orders) {
        let trials: Vec<(usize, f64)> = (0..orders)
            .filter(|order| !chosen.contains(order) && may_join(&chosen, *order))
            .map(|order| {
                let mut with = chosen.clone();
                with.push(order);
                (order, gain_with(&with))
            })
            .collect();
        let Some((order, best)) = trials.into_iter().max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))
        else {
            break;
        };
        // A later order must also be a fair part of what the first ones brought.
        if best - gain < PER_ORDER + looked || best - gain < 0.002 * best {
            break;
        }
        gain = best;
        chosen.push(order);
    }
    (chosen, gain)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_short_travel_shows_orders_that_fit_twice_and_beat_once() {
        assert!(fits(7.0, 0.3) && !fits(6.0, 0.3));
        assert!(fits(1.0, 0.7) && !fits(2.0, 0.7) && fits(3.0, 0.7));
        assert!(!are_apart(11.0, 12.0, 0.19) && are_apart(12.0, 18.0, 0.19));
        assert!(are_apart(1.0, 2.0, 1.0), "a whole turn shows every order");
    }
}
