//! Waves that two periodic laws can make. A force over the angle and a part of the command over the
//! angle do the same while the command hardly changes, so a wave may belong to the law that a model
//! already has as well as to a second one.

use crate::fit::noise::Colour;
use crate::laws::Effect;
use crate::propose::context::{FitContext, FittedModel};
use crate::propose::periodic::are_apart;
use std::f64::consts::TAU;

impl FitContext<'_> {
    /// The rival of a candidate whose last effect is periodic: the model before it, with those
    /// waves in a periodic effect that it has, which is the last then. None where it has no such
    /// effect.
    pub(crate) fn with_fewer_laws(&self, candidate: &FittedModel) -> Option<FittedModel> {
        let (added, before) = candidate.model.effects.split_last()?;
        let widened = before.iter().enumerate().filter_map(|(place, own)| {
            let mut model = candidate.model.clone();
            model.effects = before.to_vec();
            model.effects.remove(place);
            model.effects.push(with_waves_of(own, added, self.span.travel())?);
            Some(self.fit(model, &candidate.noise, Colour::White))
        });
        widened.max_by(|a, b| a.log_score.total_cmp(&b.log_score))
    }
}

/// A periodic force with the waves of another one in addition to its own, those that a travel (rad
/// or m) distinguishes from its own; none where either is no such force, or where it distinguishes
/// none. Each wave was found by the search of its own law, so there may be more than one search
/// finds.
fn with_waves_of(own: &Effect, other: &Effect, travel: f64) -> Option<Effect> {
    let is_periodic = |effect: &Effect| effect.name.definition().is_periodic();
    if !is_periodic(own) || !is_periodic(other) || own.name == other.name || own.turn() != other.turn() {
        return None;
    }
    let lengths = |effect: &Effect| effect.waves().into_iter().map(|(_, wave)| TAU / wave);
    let mut periods: Vec<f64> = lengths(own).collect();
    let count = periods.len();
    let is_new = |period: &f64| lengths(own).all(|one| are_apart(travel / one, travel / period, 1.0));
    periods.extend(lengths(other).filter(is_new));
    if periods.len() == count {
        return None;
    }
    if let Some(turn) = own.turn() {
        let orders: Vec<f64> = periods.iter().map(|period| (turn / period).round()).collect();
        return Some(Effect::of_orders(own.name, turn, &orders));
    }
    periods.sort_by(f64::total_cmp);
    Some(Effect::of_periods(own.name, &periods))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::EffectName as N;

    #[test]
    fn the_waves_of_another_law_join_those_that_are_there() {
        let cogging = Effect::of_orders(N::Cogging, TAU, &[7.0, 14.0]);
        let ripple = |orders: &[f64]| Effect::of_orders(N::TorqueRipple, TAU, orders);
        let joined = Effect::of_orders(N::Cogging, TAU, &[7.0, 14.0, 28.0]);
        assert_eq!(with_waves_of(&cogging, &ripple(&[28.0]), TAU), Some(joined.clone()));
        assert_eq!(with_waves_of(&cogging, &ripple(&[14.0, 28.0]), TAU), Some(joined));
        assert_eq!(with_waves_of(&cogging, &ripple(&[7.0]), TAU), None, "it has that wave");
        assert_eq!(with_waves_of(&cogging, &cogging, TAU), None, "the same law");
        let eighth = with_waves_of(&cogging, &ripple(&[15.0]), TAU / 8.0);
        assert_eq!(eighth, None, "an eighth of a turn does not tell orders 14 and 15 apart");
        let along = Effect::of_periods(N::Cogging, &[0.02, 0.1]);
        let other = Effect::of_periods(N::TorqueRipple, &[0.05]);
        let joined = Effect::of_periods(N::Cogging, &[0.02, 0.05, 0.1]);
        assert_eq!(with_waves_of(&along, &other, 1.0), Some(joined));
        assert_eq!(with_waves_of(&along, &ripple(&[2.0]), 1.0), None, "its turn is not known");
        let off_centre = Effect::of_orders(N::EncoderEccentricity, TAU, &[1.0]);
        assert_eq!(with_waves_of(&off_centre, &ripple(&[2.0]), TAU), None, "no force");
        assert_eq!(with_waves_of(&cogging, &off_centre, TAU), None, "no force");
    }
}
