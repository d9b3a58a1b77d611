//! The waves of an effect that repeats along the travel: those that are significant under the
//! noise, and the whole orders of a known turn by their own shares, since other physics may hide
//! them from a likelihood.

use super::laws::Columns;
use super::state::State;
use crate::effects::{Effect, EffectName as N};
use crate::selection::periodic::{are_apart, fits};

/// Orders of a turn that are tried.
const ORDERS: usize = 24;
/// Orders that are tried together, the best alone first, and how many of them one effect may have.
const TOGETHER: (usize, usize) = (6, 4);
/// Additional share that a further order must take.
const FURTHER: f64 = 0.02;

/// Waves with the share that they take on stretches left out of the fit.
type Tried = (f64, Columns);

impl State<'_> {
    /// The waves that take most on stretches left out of the fit, as those of one effect; `found`
    /// are those significant under the noise.
    pub(super) fn best_waves(&self, name: N, found: &[Effect]) -> Option<Columns> {
        let standing = found.iter().filter_map(|one| self.tried(Effect { name, ..one.clone() }));
        let best = standing.chain(self.best_orders(name)).max_by(|a, b| a.0.total_cmp(&b.0));
        Some(best?.1)
    }

    fn tried(&self, effect: Effect) -> Option<Tried> {
        let columns = self.columns(&effect)?;
        Some((self.on_fit(&columns), columns))
    }

    /// The whole orders of the turn that take most together, one after another; none where the turn
    /// is not known.
    fn best_orders(&self, name: N) -> Option<Tried> {
        let span = self.on.context.span;
        let turn = span.rig.turn?;
        let is_seen = |order: &f64| {
            let is_in_band = *order == 1.0 || order * span.speed <= 2.0 * self.on.bandwidth_hz() * turn;
            fits(*order, span.travel() / turn) && is_in_band
        };
        let orders = (1..=ORDERS).map(|order| order as f64).filter(is_seen);
        let alone = |order: f64| Some((order, self.tried(Effect::of_orders(name, turn, &[order]))?));
        let mut ranked: Vec<(f64, Tried)> = orders.filter_map(alone).collect();
        ranked.sort_by(|a, b| b.1.0.total_cmp(&a.1.0));
        ranked.truncate(TOGETHER.0);
        let others: Vec<f64> = ranked.iter().skip(1).map(|(order, _)| *order).collect();
        let (first, mut best) = ranked.into_iter().next()?;
        let mut taken = vec![first];
        for order in others {
            if taken.len() == TOGETHER.1 {
                break;
            }
            if !taken.iter().all(|other| are_apart(*other, order, span.travel() / turn)) {
                continue;
            }
            let with: Vec<f64> = taken.iter().copied().chain([order]).collect();
            let Some(more) = self.tried(Effect::of_orders(name, turn, &with)) else { continue };
            if more.0 > best.0 + FURTHER {
                (best, taken) = (more, with);
            }
        }
        name.definition().is_of_orders(&taken).then_some(best)
    }
}
